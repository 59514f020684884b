r"""The Stolt step of range migration: from uniform k to uniform :math:`k_y`, by gridding.

Each line over k is interpolated with a short kernel whose transform was divided out over
range beforehand, which makes the result exact to 1e-4 (a non-uniform FFT, in other words).
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np
import scipy.fft
from jaxtyping import Complex64, Float

from estimator.compute import engine
from estimator.compute.integer_division import row_and_column
from estimator.compute.sincos import sincos_of_turns

OVERSAMPLING = 1.5  # of the spectrum, for the Stolt step
TAPS = 6  # its kernel reaches over this many samples
SHAPE = 0.97 * np.pi * TAPS * (1 - 0.5 / OVERSAMPLING)  # exponent of the kernel: errs by 1e-4


@dataclass(frozen=True, kw_only=True)
class ApertureAxis:
    """Positions along one axis of the aperture, and the transform over them."""

    start: float  # first position [m]
    spacing: float  # [m]
    size: int  # length of the zero-padded transform; 1: the aperture does not span the axis
    tangent: float  # the pixels' largest ratio of this axis' wavenumber to k_y
    slope: float  # over which the spectrum falls off beyond it

    @property
    def wavenumbers(self) -> Float[np.ndarray, " size"]:
        """Wavenumbers of the transform, in its order, in rad/m."""
        return np.asarray(2 * np.pi * scipy.fft.fftfreq(self.size, self.spacing))

    @property
    def period(self) -> float:
        """Length after which the transform repeats, in metres; 1 off the aperture."""
        return self.size * self.spacing if self.size > 1 else 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class GatedSpectrum:
    """Samples over a short, oversampled grid of frequencies, for ranges inside the gate."""

    values: Complex64[np.ndarray, "*aperture freqs"]  # in the order of an FFT
    carrier: float  # wavenumber of the first one [rad/m]
    step: float  # [rad/m]
    reach: float  # on each side of the first one there is something [rad/m]
    reference: float  # range whose phase over the band is taken out [m]
    near: float  # the gate [m]
    far: float  # [m]


def kernel_transform(places: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Transform the Stolt step's kernel exp(β(√(1-x²)-1)), x over half its reach."""
    nodes, quadrature = np.polynomial.legendre.leggauss(40)
    values = quadrature * np.exp(SHAPE * (np.sqrt(1 - nodes**2) - 1)) * TAPS / 2
    return np.asarray(np.cos(np.pi * TAPS * np.outer(places, nodes)) @ values)


def stolt(
    planes: Complex64[np.ndarray, "kx kz freqs"],
    spectrum: GatedSpectrum,
    axes: tuple[ApertureAxis, ...],
    depth: Float[np.ndarray, " ny"],
    corner: tuple[float, float, float],
) -> Complex64[np.ndarray, "kx kz ny"]:
    """Bring uniform k onto uniform k_y, and transform to depths."""
    cosine = 1 / np.sqrt(
        1 + sum((axis.tangent + axis.slope) ** 2 for axis in axes if axis.size > 1)
    )
    high = 2 * (spectrum.carrier + spectrum.reach)
    low = 2 * max(spectrum.carrier - spectrum.reach, 0.0) * cosine
    # Long enough that depths inside the gate, but outside the image, do not wrap into it.
    length = max(spectrum.far - depth[0], depth[-1] - spectrum.near * cosine)
    pixel = depth[1] - depth[0] if depth.size > 1 else 2 * np.pi / (high - low)
    size = int(scipy.fft.next_fast_len(int(np.ceil(length / pixel)) + 2))
    step = 2 * np.pi / (size * pixel)
    band = (int(np.floor(low / step)), int(np.ceil(high / step)))
    gridded = _gridded(planes, spectrum, axes, size, step, band, corner)
    image = scipy.fft.ifft(gridded, axis=2, norm="forward", workers=-1, overwrite_x=True)
    return np.asarray(image[:, :, : depth.size])


def _gridded(
    planes: Complex64[np.ndarray, "kx kz freqs"],
    spectrum: GatedSpectrum,
    axes: tuple[ApertureAxis, ...],
    size: int,
    step: float,
    band: tuple[int, int],
    corner: tuple[float, float, float],
) -> Complex64[np.ndarray, "kx kz ky"]:
    """Interpolate each line of the spectrum at the k that belong to uniform k_y.

    A k_y and those that differ from it by whole turns per pixel share one element. The
    phases of the first pixel are applied as well, in float64.
    """
    arrays = engine.arrays()
    freqs = planes.shape[2]
    source = arrays.UInt64(np.ascontiguousarray(planes).view(np.uint64).ravel())
    element = dr.arange(arrays.UInt32, planes.shape[0] * planes.shape[1] * size)
    line, column = row_and_column(element, size)
    row, rank = row_and_column(line, planes.shape[1])
    kx = dr.gather(arrays.Float64, arrays.Float64(axes[0].wavenumbers), row)
    kz = dr.gather(arrays.Float64, arrays.Float64(axes[1].wavenumbers), rank)
    scalar = {
        name: dr.opaque(arrays.Float64, float(value))
        for name, value in {
            "step": step,
            "size": size,
            "carrier": spectrum.carrier,
            "density": 1 / spectrum.step,
            "reference": spectrum.reference * spectrum.step,
            "reach": min(spectrum.reach / spectrum.step, freqs / 2 - TAPS),
            "first": band[0],
            "x": corner[0],
            "y": corner[1],
            "z": corner[2],
            # dk_y for the sum over it, 1/step for that over k, 1/(period) for each of the others
            "scale": step / spectrum.step / (axes[0].period * axes[1].period) / 2,
        }.items()
    }
    total_re, total_im = arrays.Float(0), arrays.Float(0)
    scale = arrays.Float(scalar["scale"])
    # The lowest of the band's wavenumbers that fall on this element.
    lowest = dr.ceil((scalar["first"] - arrays.Float64(column)) / scalar["size"])
    sideways = kx * scalar["x"] + kz * scalar["z"]
    for turn in range(-(-(band[1] - band[0]) // size)):
        ky = (arrays.Float64(column) + (lowest + turn) * scalar["size"]) * scalar["step"]
        place = dr.sqrt(kx * kx + kz * kz + ky * ky) / 2
        place = (place - scalar["carrier"]) * scalar["density"]
        forward = arrays.Float(ky)
        sector = _falloff(axes[0], arrays.Float(kx), forward)
        if axes[1].size > 1:
            sector *= _falloff(axes[1], arrays.Float(kz), forward)
        inside = sector > 0
        inside &= (ky > 0) & (dr.abs(place) < scalar["reach"])
        re, im = _interpolated(arrays, source, line, freqs, place, inside)
        phase = sideways + ky * scalar["y"] - 2 * place * scalar["reference"]
        cycles = phase / (2 * np.pi)
        sine, cosine = sincos_of_turns(arrays.Float(cycles - dr.round(cycles)))
        jacobian = dr.rsqrt(forward) if axes[1].size == 1 else dr.rcp(forward)
        weight = dr.select(inside, scale * sector * jacobian, 0.0)
        total_re += weight * (re * cosine - im * sine)
        total_im += weight * (re * sine + im * cosine)
    low = arrays.UInt64(dr.reinterpret_array(arrays.UInt32, total_re))
    high = arrays.UInt64(dr.reinterpret_array(arrays.UInt32, total_im))
    values = (low | (high << 32)).numpy().view(np.complex64)
    return np.asarray(values.reshape(*planes.shape[:2], size))


def _falloff(axis: ApertureAxis, sideways: Any, forward: Any) -> Any:
    """Weigh a direction: 1 where pixels need it, smoothly 0 at ``slope`` beyond."""
    tangent = dr.opaque(type(forward), axis.tangent)
    slope = dr.opaque(type(forward), axis.slope)
    beyond = (dr.abs(sideways) - tangent * forward) / (slope * forward)
    fall = 1 - dr.clip(beyond, 0.0, 1.0)
    return dr.select(forward > 0, fall * fall * (3 - 2 * fall), 0.0)


def _interpolated(
    arrays: Any, source: Any, line: Any, freqs: int, place: Any, inside: Any
) -> tuple[Any, Any]:
    """Sum the neighbours of a place on each line, weighted by the gridding kernel."""
    first = dr.ceil(place - TAPS / 2)
    distance = arrays.Float(first - place)
    count = dr.opaque(arrays.Int32, freqs)
    base = line * arrays.UInt32(count)
    re, im = arrays.Float(0), arrays.Float(0)
    for tap in range(TAPS):
        x = (distance + tap) * (2 / TAPS)
        kernel = dr.exp(SHAPE * (dr.sqrt(dr.maximum(1 - x * x, 0.0)) - 1))
        index = arrays.Int32(first) + tap
        index = dr.select(index < 0, index + count, index)  # the order of an FFT
        pair = dr.gather(arrays.UInt64, source, base + arrays.UInt32(index), inside)
        re = dr.fma(kernel, dr.reinterpret_array(arrays.Float, arrays.UInt32(pair)), re)
        im = dr.fma(kernel, dr.reinterpret_array(arrays.Float, arrays.UInt32(pair >> 32)), im)
    return re, im
