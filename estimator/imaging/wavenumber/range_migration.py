r"""Range migration (the ω-k algorithm) for linear and planar apertures, after (2-13), (2-14).

Back-projection correlates the echo with :math:`e^{+j 2 k r}`. By stationary phase the
transform of that kernel over the aperture is

.. math:: 2 k \sqrt{2 \pi j y / k_y^3}\; e^{+j k_y y} \quad \text{(linear)}, \qquad
          2 \pi j\, 2 k\, y / k_y^2\; e^{+j k_y y} \quad \text{(planar)},

with the exact dispersion relation :math:`k_y = \sqrt{4 k^2 - k_x^2 - k_z^2}`. So the same
image follows from FFTs, once the samples, uniform in k, stand on a uniform grid of
:math:`k_y`: the Stolt step, here a gridding with the Jacobian :math:`k_y / 4 k`. With these
weights the image equals that of back-projection, not only its focus.

Two things differ from the thesis: with exp(+jωt), focusing needs :math:`e^{+j k_y y}`, and
its plain inverse FFT over k leaves the Stolt step out.
"""

import finufft
import numpy as np
import scipy.fft
from jaxtyping import Complex, Complex64, Float
from scipy.constants import speed_of_light

from estimator.imaging.range_compression import unambiguous_path
from estimator.imaging.wavenumber.stolt import (
    OVERSAMPLING,
    ApertureAxis,
    GatedSpectrum,
    kernel_transform,
    stolt,
)
from estimator.measurement.model import Echo, MeasurementError
from estimator.results.pixel_grid import PixelGrid

LATTICE = 1e-3
"""Largest departure of a position from the aperture's grid, over its spacing. [-]"""

GATE_MARGIN = 24.0
"""Range that the gate's slopes take on each side, over c/2B. [-]

Gating cuts away ranges that no pixel needs, and with them most of the work. What a smooth
gate adds to the width of the band (about a twelfth) is kept by the margin of the spectrum.
"""

BAND_MARGIN = 1.12  # width within which the gate leaves anything, over that of the band
SPECTRUM_MARGIN = 1.25  # width of the kept spectrum over that of the band

FRESNEL_MARGIN = 3.0
"""How far beside the pixels' own directions the spectrum falls off, over √(λy/2). [-]

The ends of the aperture blur the stationary points by about one of these lengths.
"""


def range_migration(
    echo: Echo,
    grid: PixelGrid,
    *,
    weights: Float[np.ndarray, "#positions #freqs"] | None = None,
) -> Complex[np.ndarray, "*grid"]:
    r"""Form a monostatic SAR image by range migration.

    Parameters
    ----------
    echo
        Echo at positions along x (linear) or on a grid over x and z (planar), all at one y.
        Positions and frequencies may be missing or uneven, but those of a planar aperture
        lie on its grid.
    grid
        Pixels in front of the array, at larger y. For a linear array they lie in its plane.
    weights
        Taper over positions and frequencies; ``None``: all one. [-]

    Returns
    -------
    Complex image, as back-projection gives it: an ideal unit point target peaks at 1. It
    differs from that where sin φ > λ_min/(4Δx): the aperture does not sample such
    directions, and back-projection shows their grating lobes. [-]

    Raises
    ------
    MeasurementError
        If the geometry does not suit (back-projection takes any), or a pixel lies beyond
        the unambiguous range.
    """
    _refuse_other_geometry(echo, grid)
    depth = grid.y - echo.positions[0, 1]
    samples = echo.samples if weights is None else echo.samples * weights
    gain = float(np.sum(np.broadcast_to(1.0 if weights is None else weights, samples.shape)))
    spectrum = _gated(samples, echo, *_ranges(echo, grid))
    wavelength = speed_of_light / float(echo.frequencies[0])
    axes = tuple(
        transform_axis(echo.positions[:, i], pixels, depth, spectrum.far, wavelength)
        for i, pixels in ((0, grid.x), (2, grid.z))
    )
    planes = over_aperture(spectrum.values, echo.positions[:, ::2], axes)
    corner = (grid.x[0] - axes[0].start, depth[0], grid.z[0] - axes[1].start)
    image = stolt(planes, spectrum, axes, depth, corner)
    image = at_pixels(image, 0, axes[0], grid.x)
    image = at_pixels(image, 1, axes[1], grid.z)
    spread = 2j * np.pi * depth
    result = image * (np.sqrt(spread) if axes[1].size == 1 else spread) / gain
    return np.ascontiguousarray(result.transpose(0, 2, 1)).reshape(grid.shape)


def suits_range_migration(echo: Echo, grid: PixelGrid) -> bool:
    """Tell whether range migration takes a geometry; if not, back-projection does.

    Parameters
    ----------
    echo, grid
        As in :func:`range_migration`.
    """
    spans = [
        max(pixels[-1] - ends.min(), ends.max() - pixels[0])
        for pixels, ends in zip((grid.x, grid.y, grid.z), echo.positions.T, strict=True)
    ]
    near = float(np.linalg.norm(spans)) <= unambiguous_path(echo.frequencies) / 2
    return near and echo.frequencies.size > 1 and is_lattice(echo, grid)


def is_lattice(echo: Echo, grid: PixelGrid) -> bool:
    """Tell whether the positions lie on a line or a grid before the pixels, monostatic."""
    x, y, z = echo.positions.T
    if echo.transmit_positions is not None or np.ptp(y) > 1e-6 or np.ptp(x) < 1e-9:
        return False
    if grid.y[0] <= y[0]:
        return False
    if np.ptp(z) < 1e-9:
        return bool(np.abs(grid.z - z[0]).max() <= 1e-6)
    for column in (x, z):
        first, spacing = _lattice(column)
        places = (column - first) / spacing
        if np.abs(places - np.rint(places)).max() > LATTICE:
            return False
    return True


def _lattice(positions: Float[np.ndarray, " positions"]) -> tuple[float, float]:
    """Return the first place and the spacing of positions along one axis. [m]."""
    places = np.unique(np.round(positions, 12))
    steps = np.diff(places)
    spacing = float(np.median(steps[steps > 0.5 * np.median(steps)]))
    low, high = float(places[0]), float(places[-1])
    return low, (high - low) / max(1, round((high - low) / spacing))


def _refuse_other_geometry(echo: Echo, grid: PixelGrid) -> None:
    if echo.transmit_positions is not None:
        raise MeasurementError(
            "range migration takes a monostatic echo; use back-projection for separate "
            "transmit positions"
        )
    if echo.frequencies.size < 2:
        raise MeasurementError(
            "frequency: one point has no bandwidth; range needs at least two frequencies"
        )
    x, y, z = echo.positions.T
    if np.ptp(y) > 1e-6 or grid.y[0] <= y[0] or np.ptp(x) < 1e-9:
        raise MeasurementError(
            "range migration needs positions along x, all at one y, and pixels at larger y; "
            "use back-projection for any other geometry"
        )
    if np.ptp(z) < 1e-9 and np.abs(grid.z - z[0]).max() > 1e-6:
        raise MeasurementError(
            f"a linear array images the plane it lies in (z = {z[0]:g} m); give that plane, or "
            "use back-projection"
        )


def _ranges(echo: Echo, grid: PixelGrid) -> tuple[float, float]:
    """Return the shortest and longest distance between the boxes of positions and pixels."""
    gaps, spans = [], []
    for pixels, ends in zip((grid.x, grid.y, grid.z), echo.positions.T, strict=True):
        gaps.append(max(pixels[0] - ends.max(), ends.min() - pixels[-1], 0.0))
        spans.append(max(pixels[-1] - ends.min(), ends.max() - pixels[0]))
    near, far = float(np.linalg.norm(gaps)), float(np.linalg.norm(spans))
    limit = unambiguous_path(echo.frequencies) / 2
    if far > limit:
        raise MeasurementError(
            f"pixels reach {far:.3f} m from the array, but the frequency step is unambiguous "
            f"only up to {limit:.3f} m; take smaller frequency steps or a nearer grid"
        )
    return near, far


def _gated(
    samples: Complex[np.ndarray, "positions freqs"], echo: Echo, near: float, far: float
) -> GatedSpectrum:
    """Cut the needed ranges out, and return to frequencies just dense enough for them."""
    frequencies = echo.frequencies
    step = speed_of_light / unambiguous_path(frequencies)
    carrier = float(frequencies[frequencies.size // 2])
    offsets = (frequencies - carrier) / step
    span = int(np.ceil(offsets[-1] - offsets[0])) + 1
    # The carrier may lie off the middle: the spectrum must hold the longer half twice.
    half = max(float(offsets[-1]), float(-offsets[0]))
    cells = int(scipy.fft.next_fast_len(int(np.ceil(2 * half * SPECTRUM_MARGIN)) + 2))
    cell = speed_of_light / (2 * step * cells)
    margin = int(np.ceil(GATE_MARGIN * cells / span))
    first = int(np.floor(near / cell)) - margin
    count = int(np.ceil(far / cell)) + margin + 1 - first
    whole = np.rint(offsets).astype(np.int64)
    if np.abs(offsets - whole).max() <= 1e-3:
        padded = np.zeros((len(samples), cells), dtype=np.complex64)
        padded[:, whole] = samples
        profiles = scipy.fft.ifft(padded, axis=1, norm="forward", workers=-1)
        if count >= cells:  # the whole period is needed: nothing to cut
            first = int(np.floor(0.5 * (near + far) / cell)) - cells // 2
            count, margin = cells, 0
        window = profiles[:, np.arange(first, first + count) % cells]
    else:
        phase = 2 * np.pi * offsets / cells
        shifted = samples * np.exp(1j * phase * (first + count // 2))
        window = finufft.nufft1d1(phase, shifted, count, eps=1e-6, isign=1, nthreads=1)
    window = window * _slopes(count, margin)
    # Oversampled, with the kernel's own transform divided out: gridding is then exact.
    size = int(scipy.fft.next_fast_len(int(np.ceil(OVERSAMPLING * count))))
    places = np.arange(count) - count // 2
    segment = np.zeros((len(samples), size), dtype=np.complex64)
    segment[:, places] = window / (size * kernel_transform(places / size))
    return GatedSpectrum(
        values=scipy.fft.fft(segment, axis=1, workers=-1, overwrite_x=True),
        carrier=2 * np.pi * carrier / speed_of_light,
        step=2 * np.pi * step * cells / size / speed_of_light,
        reach=2 * np.pi * half * step * BAND_MARGIN / speed_of_light,
        reference=(first + count // 2) * cell,
        near=max(near - margin * cell, 0.0),
        far=far + margin * cell,
    )


def _slopes(count: int, margin: int) -> Float[np.ndarray, " count"]:
    gate = np.ones(count)
    if margin:
        rise = np.sin(0.5 * np.pi * (np.arange(margin) + 0.5) / margin) ** 2
        gate[:margin], gate[-margin:] = rise, rise[::-1]
    return gate


def transform_axis(
    positions: Float[np.ndarray, " positions"],
    pixels: Float[np.ndarray, " n"],
    depth: Float[np.ndarray, " ny"],
    far: float,
    wavelength: float,
) -> ApertureAxis:
    """Choose a transform long enough that nothing wraps round into the image."""
    places = np.unique(np.round(positions, 12))
    if places[-1] - places[0] < 1e-9:
        return ApertureAxis(start=float(places[0]), spacing=1.0, size=1, tangent=1.0, slope=1.0)
    high = float(places[-1])
    low, spacing = _lattice(positions)
    widest = max(float(pixels[-1]) - low, high - float(pixels[0]))
    tangent = widest / float(depth[0])
    slope = FRESNEL_MARGIN * float(np.sqrt(wavelength / (2 * depth[0])))
    # What the kept angles hold up to the gate's end lies up to here beside the aperture.
    reach = far * (tangent + slope) / np.hypot(1, tangent + slope)
    length = max(high + reach - float(pixels[0]), float(pixels[-1]) - low + reach)
    size = int(scipy.fft.next_fast_len(int(np.ceil(length / spacing)) + 1))
    pixel = float(pixels[1] - pixels[0]) if pixels.size > 1 else spacing
    wanted = size
    while wanted < 1.2 * size:  # a period of whole pixels lets an FFT reach the pixels
        ratio = wanted * spacing / pixel
        if abs(ratio - round(ratio)) < 1e-6:
            return ApertureAxis(
                start=low, spacing=spacing, size=wanted, tangent=tangent, slope=slope
            )
        wanted = int(scipy.fft.next_fast_len(wanted + 1))
    return ApertureAxis(start=low, spacing=spacing, size=size, tangent=tangent, slope=slope)


def over_aperture(
    values: Complex64[np.ndarray, "positions freqs"],
    positions: Float[np.ndarray, "positions 2"],
    axes: tuple[ApertureAxis, ...],
) -> Complex64[np.ndarray, "kx kz freqs"]:
    """Transform over the aperture's grid; missing positions count as zeros."""
    places = [
        (column - axis.start) / axis.spacing for column, axis in zip(positions.T, axes, strict=True)
    ]
    whole = [np.rint(place).astype(np.int64) for place in places]
    off = max(np.abs(a - b).max() for a, b in zip(places, whole, strict=True))
    counts = [int(index.max()) + 1 for index in whole]
    if off <= LATTICE:
        aperture = np.zeros((*counts, values.shape[1]), dtype=np.complex64)
        aperture[whole[0], whole[1]] = values
    elif axes[1].size == 1:
        # Uneven steps: the sums themselves, onto the same wavenumbers.
        turn = np.exp(-1j * np.outer(axes[0].wavenumbers, places[0] * axes[0].spacing))
        return np.ascontiguousarray((turn.astype(np.complex64) @ values)[:, None, :])
    else:
        raise MeasurementError(
            f"positions are up to {off:.2g} spacings off the planar aperture's grid; use "
            "back-projection, which takes any positions"
        )
    if axes[1].size > 1:
        aperture = scipy.fft.fft(aperture, n=axes[1].size, axis=1, workers=-1)
    planes = scipy.fft.fft(aperture, n=axes[0].size, axis=0, workers=-1)
    return np.asarray(planes)


def at_pixels(
    spectrum: Complex64[np.ndarray, "kx kz ny"],
    dimension: int,
    axis: ApertureAxis,
    pixels: Float[np.ndarray, " n"],
) -> Complex64[np.ndarray, "..."]:
    """Sum one axis' plane waves at its pixels, by FFT where a period is whole pixels."""
    if axis.size == 1:
        return spectrum
    moved = np.moveaxis(spectrum, dimension, 0)
    waves = axis.wavenumbers
    ratio = axis.period / (pixels[1] - pixels[0]) if pixels.size > 1 else 0.5
    if abs(ratio - round(ratio)) > 1e-6 * ratio or ratio < 1:
        matrix = np.exp(1j * np.outer(pixels - pixels[0], waves)).astype(np.complex64)
        return np.moveaxis(np.tensordot(matrix, moved, axes=1), 0, dimension)
    size = round(ratio)
    folded = np.zeros((size, *moved.shape[1:]), dtype=np.complex64)
    orders = np.rint(waves * axis.period / (2 * np.pi)).astype(np.int64)
    for block in np.split(np.arange(axis.size), np.flatnonzero(np.diff(orders // size)) + 1):
        folded[orders[block] % size] += moved[block]
    image = scipy.fft.ifft(folded, axis=0, norm="forward", workers=-1, overwrite_x=True)
    return np.moveaxis(image[: pixels.size], 0, dimension)
