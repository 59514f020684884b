r"""Fast factorised back-projection of a linear array onto any points.

The image without the carrier's phase over the range, :math:`I(p)\, e^{-j k_c R(p)}`, depends on the
distance R from the array's centre and on the sine s towards its axis alone, and varies with them no
faster than

.. math:: \psi_R = \max |k_n \partial_R \rho_m - k_c| , \qquad
          \psi_s = \max |k_n \partial_s \rho_m|

(:mod:`estimator.imaging.polar_image`). It is formed on a polar grid that samples that,
from parts of the array, and read from there at each point by a product of two interpolators. Where
pixels are finer than the resolution, and the array is long, that saves most of the work of
back-projection.
"""

from typing import Any

import drjit as dr
import numpy as np
from jaxtyping import Complex, Float
from numpy.polynomial import Chebyshev, Polynomial
from scipy.constants import speed_of_light
from scipy.special import i0

from estimator.compute import engine
from estimator.imaging.aperture_parts import (
    Line,
    PolarGrid,
    kaiser_shape,
    kaiser_taps,
    line_of,
)
from estimator.imaging.backprojection import FLAT, Focuser, focus, prepare
from estimator.imaging.polar_image import ERROR, focus_polar
from estimator.imaging.range_compression import (
    range_profiles,
    refuse_points_out_of_range,
    unambiguous_path,
)
from estimator.measurement.model import Echo

OVERSAMPLING = 2.5
"""Samples of the polar grid over those that the bandwidth asks for: the transition of the
interpolator, which reads as many for each point. [-]"""
NEAREST = 2.0
"""Least distance over half the array: nearer, the image is formed exactly, as the interpolator
would reach where the array's ends have no angle. [-]"""
DEGREE = 9
"""Of the polynomials that give the interpolator's weights. [-]"""
PROBES = 17
"""Sines at which the bandwidth is looked up; it varies smoothly. [-]"""


def factorised_backproject(
    echo: Echo,
    pixels: Float[np.ndarray, "*grid 3"],
    *,
    weights: Float[np.ndarray, "#positions #freqs"] | None = None,
    error: float = ERROR,
) -> Complex[np.ndarray, "*grid"]:
    """Form a SAR image by factorised back-projection.

    Parameters
    ----------
    echo
        Stepped-frequency echo.
    pixels
        Pixel centres in the world frame. [m]
    weights
        Taper over positions and frequencies; ``None``: all one. [-]
    error
        Against :func:`estimator.imaging.backprojection.backproject`, over the peak of a point
        target. [-]

    Returns
    -------
    Complex image; an ideal unit point target peaks at 1. It is back-projected exactly if the array
    is no line, if transmitters stand apart, or if pixels are as near as the array is long. [-]

    Raises
    ------
    MeasurementError
        If a pixel lies beyond the unambiguous range or is not finite.
    """
    return factorised_focus(prepare(range_profiles(echo, weights=weights)), pixels, error=error)


def suits_factorising(echo: Echo, points: Float[np.ndarray, "*grid 3"]) -> bool:
    """Tell whether an echo can be factorised: of one line, and of points that are far enough."""
    places = echo.positions - echo.positions.mean(axis=0)
    _, sizes, axes = np.linalg.svd(places, full_matrices=False)
    if echo.transmit_positions is not None or sizes[0] <= FLAT or sizes[1:].max() > FLAT:
        return False
    half = float(np.abs(places @ axes[0]).max())
    reach = np.linalg.norm(points - echo.positions.mean(axis=0), axis=-1)
    longest = unambiguous_path(echo.frequencies) / 2
    return bool(reach.min() >= NEAREST * half and reach.max() + half <= longest)


def factorised_focus(
    focuser: Focuser, points: Float[np.ndarray, "*grid 3"], *, error: float = ERROR
) -> Complex[np.ndarray, "*grid"]:
    """Focus prepared range profiles on points; see :func:`factorised_backproject`."""
    leg = focuser.legs[-1]
    line = line_of(focuser, leg.centre, leg.axes[0]) if len(leg.axes) else None
    if line is None or not points.size:
        return focus(focuser, points)
    columns = np.moveaxis(points, -1, 0).reshape(3, -1)
    refuse_points_out_of_range(focuser.profiles, columns)
    offsets = columns - line.centre[:, None]
    reach = np.sqrt(np.einsum("xp,xp->p", offsets, offsets))
    half = float(np.abs(line.along).max())
    if float(reach.min()) < NEAREST * half:
        return focus(focuser, points)
    sines = (line.axis @ offsets) / reach
    taps = kaiser_taps(error, OVERSAMPLING)
    grid = _grid(line, reach, sines, taps)
    image = focus_polar(
        focuser, grid, centre=line.centre, axis=line.axis, error=error, carrier=False
    )
    values = _read(image, grid, reach, sines, taps)
    turns = focuser.profiles.passes * focuser.profiles.carrier / speed_of_light * reach
    values *= np.exp(2j * np.pi * (turns - np.round(turns)))
    return values.reshape(points.shape[:-1])


def _grid(
    line: Line,
    reach: Float[np.ndarray, " points"],
    sines: Float[np.ndarray, " points"],
    taps: int,
) -> PolarGrid:
    """Cover points with a polar grid that samples the image about them."""
    near, far = float(reach.min()), float(reach.max())
    low, high = float(sines.min()), float(sines.max())
    ranges = np.array([near, far])[:, None]
    probes = np.linspace(low, high, PROBES)
    over_range = over_sine = 0.0
    for place in line.along[[0, -1]]:
        length = np.sqrt(ranges**2 - 2 * ranges * probes * place + place**2)
        for wavenumber in line.wavenumbers[[0, 2]]:
            change = wavenumber * (ranges - probes * place) / length - line.wavenumbers[1]
            over_range = max(over_range, float(np.abs(change).max()))
            over_sine = max(over_sine, float(np.abs(wavenumber * ranges * place / length).max()))
    steps = np.pi / OVERSAMPLING / np.array([over_range, over_sine])
    axes = [
        start - taps * step + step * np.arange(int(np.ceil((end - start) / step)) + 2 * taps + 1)
        for start, end, step in ((near, far, steps[0]), (low, high, steps[1]))
    ]
    return PolarGrid(axes[0], axes[1])


def _weights(taps: int) -> list[list[float]]:
    """Polynomials, highest power first, of the weight of each tap over -½ … ½ of a step."""
    shape = kaiser_shape(taps, OVERSAMPLING)

    def weight(part: np.ndarray, tap: int) -> np.ndarray:
        away = part + 0.5 - tap
        inside = np.maximum(1 - (away / taps) ** 2, 0.0)
        return np.asarray(np.sinc(away) * i0(shape * np.sqrt(inside)) / i0(shape))

    return [
        [
            float(value)
            for value in Chebyshev.interpolate(weight, DEGREE, domain=[-0.5, 0.5], args=(tap,))
            .convert(kind=Polynomial)
            .coef[::-1]
        ]
        for tap in range(1 - taps, taps + 1)
    ]


def _read(
    image: Complex[np.ndarray, "ranges sines"],
    grid: PolarGrid,
    reach: Float[np.ndarray, " points"],
    sines: Float[np.ndarray, " points"],
    taps: int,
) -> Complex[np.ndarray, " points"]:
    """Interpolate a smooth image on a polar grid."""
    arrays: Any = engine.arrays()
    source = arrays.UInt64(image.astype(np.complex64).ravel().view(np.uint64))
    columns = dr.opaque(arrays.UInt32, grid.sines.size)
    weights = _weights(taps)
    corners, by_axis = [], []
    for values, axis in ((reach, grid.ranges), (sines, grid.sines)):
        first, step = float(axis[0]), float(axis[1] - axis[0])
        place = (arrays.Float64(values) - dr.opaque(arrays.Float64, first)) * dr.opaque(
            arrays.Float64, 1 / step
        )
        whole = dr.floor(place)
        part = arrays.Float(place - whole) - 0.5
        corners.append(arrays.UInt32(whole) + 1 - taps)
        of_axis = []
        for polynomial in weights:
            weight = arrays.Float(polynomial[0])
            for coefficient in polynomial[1:]:
                weight = dr.fma(weight, part, coefficient)
            of_axis.append(weight)
        by_axis.append(of_axis)
    re, im = arrays.Float(0), arrays.Float(0)
    for i, over_range in enumerate(by_axis[0]):
        row_re, row_im = arrays.Float(0), arrays.Float(0)
        start = (corners[0] + i) * columns + corners[1]
        for j, over_sine in enumerate(by_axis[1]):
            pair = dr.gather(arrays.UInt64, source, start + j)
            low = dr.reinterpret_array(arrays.Float, arrays.UInt32(pair))
            high = dr.reinterpret_array(arrays.Float, arrays.UInt32(pair >> 32))
            row_re, row_im = dr.fma(over_sine, low, row_re), dr.fma(over_sine, high, row_im)
        re, im = dr.fma(over_range, row_re, re), dr.fma(over_range, row_im, im)
    dr.eval(re, im)
    values = np.empty(reach.size, dtype=np.complex128)
    values.real, values.imag = re.numpy(), im.numpy()
    return values
