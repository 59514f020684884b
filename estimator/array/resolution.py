r"""Resolution and sampling of an array and a sweep, after (2-15) to (2-28) of the thesis.

``passes`` is how often the path is travelled: 2 in an echo (down and back), 1 in an uplink.
Angles φ are measured from the array's broadside here, as in those equations; an angle of
arrival is θ = π/2 - φ.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.constants import speed_of_light

from estimator.measurement.model import MeasurementError

HALF_POWER = 0.8859
"""Width of sin(πx)/(πx) between its -3 dB points: the cell without a taper. [-]"""


@dataclass(frozen=True, kw_only=True)
class Cell:
    """The -3 dB extents of an image point without a taper."""

    along_range: float  # [m]
    across: float  # perpendicular to the range, in the plane of array and point [m]


def range_resolution(bandwidth: float, *, passes: int = 2) -> float:
    """Return the -3 dB range cell 0.886 c/(nB) of an untapered band, in metres.

    The rounder c/(2B) of the thesis is its null-to-peak distance. Range means distance for
    ``passes = 2`` and path length for ``passes = 1``.
    """
    _positive(bandwidth=bandwidth)
    return HALF_POWER * speed_of_light / (_passes(passes) * bandwidth)


def cross_range_resolution(
    *,
    wavelength: float,
    distance: float,
    aperture_length: float,
    angle: float = 0.0,
    passes: int = 2,
) -> float:
    """Return the -3 dB cross-range cell 0.886 λR/(n D cos φ) of a linear array, in metres.

    Parameters
    ----------
    wavelength
        At the centre of the band. [m]
    distance
        From the array's centre. [m]
    aperture_length
        Of the array. [m]
    angle
        Off broadside. [rad]
    passes
        2 for an echo, 1 for an uplink.
    """
    _positive(wavelength=wavelength, distance=distance, aperture_length=aperture_length)
    return distance * angular_resolution(
        wavelength=wavelength, aperture_length=aperture_length, angle=angle, passes=passes
    )


def angular_resolution(
    *, wavelength: float, aperture_length: float, angle: float = 0.0, passes: int = 1
) -> float:
    """Return the -3 dB beam width 0.886 λ/(n D cos φ) of a linear array, in radians."""
    _positive(wavelength=wavelength, aperture_length=aperture_length)
    if not abs(angle) < np.pi / 2:
        raise MeasurementError(
            f"angle: {np.degrees(angle):g}° off broadside; a linear array resolves angles only "
            "between -90° and 90°"
        )
    effective = _passes(passes) * aperture_length * np.cos(angle)
    return float(HALF_POWER * wavelength / effective)


def cell_at(
    point: Float[np.ndarray, " 3"],
    *,
    positions: Float[np.ndarray, "positions 3"],
    frequencies: Float[np.ndarray, " freqs"],
    passes: int = 2,
) -> Cell:
    r"""Return the -3 dB cell of a point, also in the near field and off the axis.

    In the near field the formula's D cos φ / R is the spread of the directions under which
    the array is seen: the width across is :math:`0.886 \lambda / (n |u_1 - u_2|)`, with u the
    components, across the range, of the unit vectors to the array's two outermost elements.
    """
    centre = positions.mean(axis=0)
    distance = np.linalg.norm(point - centre)
    if not distance > 0:
        raise MeasurementError("the point is the array's centre; no range direction exists there")
    along = (point - centre) / distance
    rays = point - positions
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    sideways = rays - np.outer(rays @ along, along)
    # The direction across in which the array spreads most: the plane of array and point.
    spread = np.linalg.svd(sideways - sideways.mean(axis=0), full_matrices=False)[2][0]
    extent = float(np.ptp(sideways @ spread))
    if not extent > 0:
        raise MeasurementError("seen from the point all positions lie in one line; no cross-range")
    wavelength = speed_of_light / float(frequencies[0] + frequencies[-1]) * 2
    return Cell(
        along_range=range_resolution(float(frequencies[-1] - frequencies[0]), passes=passes),
        across=HALF_POWER * wavelength / (passes * extent),
    )


def unambiguous_range(frequency_step: float, *, passes: int = 2) -> float:
    """Return c/(nΔf), up to which complex samples are unambiguous, in metres.

    A distance for ``passes = 2``, a path length for ``passes = 1``. The thesis' c/(4Δf) is
    the stricter rule for real samples.
    """
    _positive(frequency_step=frequency_step)
    return speed_of_light / (_passes(passes) * frequency_step)


def largest_frequency_step(longest: float, *, passes: int = 2) -> float:
    """Return the largest step c/(nR) that keeps ranges up to ``longest`` [m] apart, in hertz."""
    _positive(longest=longest)
    return speed_of_light / (_passes(passes) * longest)


def phase_per_frequency_step(distance: float, frequency_step: float) -> float:
    """Return 4πRΔf/c, by which an echo turns from one frequency to the next, in radians.

    (2-24) with Δf for the misprinted Δλ; it must stay below 2π.
    """
    return 4 * np.pi * distance * frequency_step / speed_of_light


def largest_spacing(wavelength: float, *, angle: float = np.pi / 2, passes: int = 2) -> float:
    """Return the largest element spacing without grating lobes, in metres.

    λ_min/(2n sin φ_max): (2-22) asks λ/4 of an echo always, which is only needed for targets
    at 90° off broadside.

    Parameters
    ----------
    wavelength
        The shortest of the band. [m]
    angle
        Largest angle off broadside at which anything scatters. [rad]
    passes
        2 for an echo, 1 for an uplink.
    """
    _positive(wavelength=wavelength)
    sine = abs(float(np.sin(angle)))
    return float(wavelength / (2 * _passes(passes) * sine)) if sine else float("inf")


def unaliased_sine(spacing: float, wavelength: float, *, passes: int = 2) -> float:
    """Return the largest sin φ (at most 1) that a spacing tells from its grating lobes.

    Parameters
    ----------
    spacing
        Of neighbouring elements. [m]
    wavelength
        The shortest of the band. [m]
    passes
        2 for an echo, 1 for an uplink.
    """
    _positive(spacing=spacing, wavelength=wavelength)
    return min(1.0, wavelength / (2 * _passes(passes) * spacing))


def aliased(
    points: Float[np.ndarray, "*grid 3"],
    *,
    positions: Float[np.ndarray, "positions 3"],
    frequencies: Float[np.ndarray, " freqs"],
    passes: int = 2,
) -> Bool[np.ndarray, "*grid"]:
    """Tell which points a linear array cannot tell from their grating lobes.

    Those that the array's centre sees at a sin φ of more than λ_min/(2n Δx).
    """
    sine, spacing, wavelength = _view(points, positions, frequencies)
    return np.asarray(sine > unaliased_sine(spacing, wavelength, passes=passes))


def aliasing_note(
    points: Float[np.ndarray, "*grid 3"],
    *,
    positions: Float[np.ndarray, "positions 3"],
    frequencies: Float[np.ndarray, " freqs"],
    passes: int = 2,
) -> str | None:
    """Say, with the numbers, which part of a grid the aperture's spacing leaves ambiguous."""
    sine, spacing, wavelength = _view(points, positions, frequencies)
    limit = unaliased_sine(spacing, wavelength, passes=passes)
    outside = float(np.mean(sine > limit))
    if outside == 0:
        return None
    return (
        f"{100 * outside:.2g} % of the points lie more than {np.degrees(np.arcsin(limit)):.1f}° "
        f"off broadside, where a spacing of {1e3 * spacing:.3g} mm leaves grating lobes at "
        f"{frequencies[-1] / 1e9:.4g} GHz; all angles need "
        f"{1e3 * largest_spacing(wavelength, passes=passes):.3g} mm"
    )


def _view(
    points: Float[np.ndarray, "*grid 3"],
    positions: Float[np.ndarray, "positions 3"],
    frequencies: Float[np.ndarray, " freqs"],
) -> tuple[Float[np.ndarray, "*grid"], float, float]:
    """Return each point's sin φ, the array's spacing and the shortest wavelength."""
    centre = positions.mean(axis=0)
    axis = np.linalg.svd(positions - centre, full_matrices=False)[2][0]
    along = np.sort((positions - centre) @ axis)
    steps = np.diff(along)
    if not np.any(steps > 1e-9):
        raise MeasurementError("one position has no aperture; cross-range needs at least two")
    # The typical spacing: one hole in the aperture raises sidelobes but makes no grating lobe.
    spacing = float(np.median(steps[steps > 1e-9]))
    rays = points - centre
    sine = np.abs(rays @ axis) / np.maximum(np.linalg.norm(rays, axis=-1), 1e-30)
    return np.asarray(sine), spacing, speed_of_light / float(frequencies[-1])


def _passes(passes: int) -> int:
    if passes not in (1, 2):
        raise MeasurementError(f"passes is {passes}; it must be 2 (echo) or 1 (uplink)")
    return passes


def _positive(**values: float) -> None:
    for name, value in values.items():
        if not (np.isfinite(value) and value > 0):
            raise MeasurementError(f"{name} is {value:g}; it must be positive and finite")
