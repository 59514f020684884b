"""A planar array: its frame, its apertures, and what they resolve."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.array.array_frame import ArrayFrame
from estimator.array.linear_array import LEAST_DEPTH, WIDEST_SINE
from estimator.array.resolution import unaliased_sine
from estimator.array.resolution_cell import Resolution
from estimator.measurement.model import Echo, MeasurementError, Uplink, frequency_step

FLATNESS = 1e-4
"""Largest distance of a phase centre from the array's plane, as for the line of a linear
array: 0.1 mm is 0.6 rad at 300 GHz. Every method uses the positions themselves. [m]"""

PLANAR = 0.05
"""Width over length from which positions span a plane; a line that jitters is narrower. [-]"""

LEAST_WIDTH = 10.0
"""The same over :data:`FLATNESS`: 1 mm. [-]"""

MOST_SLANT = 1e-3
"""Largest angle between the boresight that is stated and the normal of the array: 0.06°, a stated
value's rounding. [rad]"""

ROUNDING = 1e-9
"""Component of a normal that is rounding: an array along the world's axes has exactly these. [-]"""

REACH_MARGIN = 0.995
"""Part of the unambiguous distance that is used, for rounding's sake. [-]"""


@dataclass(frozen=True, kw_only=True)
class PlanarArray:
    """Extents and spacings of an array in its own frame, along its x and z."""

    aperture: tuple[float, float]  # [m]
    spacing: tuple[float, float]  # [m]

    @property
    def half(self) -> float:
        """Distance of the farthest corner from the centre. [m]."""
        return 0.5 * float(np.hypot(*self.aperture))

    def unaliased(self, frequencies: Float[np.ndarray, " freqs"], *, passes: int) -> float:
        """Return the direction sine, along either axis, within which no grating lobe is. [-]."""
        shortest = speed_of_light / float(frequencies[-1])
        sines = [unaliased_sine(spacing, shortest, passes=passes) for spacing in self.spacing]
        return min(WIDEST_SINE, *sines)

    def beam(self, frequencies: Float[np.ndarray, " freqs"], *, passes: int) -> tuple[float, float]:
        """Return λ/(nD) along x and z: the resolution in direction cosines. [-]."""
        wavelength = speed_of_light / float(frequencies.mean())
        return wavelength / (passes * self.aperture[0]), wavelength / (passes * self.aperture[1])


def spans_a_plane(positions: Float[np.ndarray, "positions 3"]) -> bool:
    """Tell a planar array from a linear one, however crooked that is."""
    if len(positions) < 4:
        return False
    directions = np.linalg.svd(positions - positions.mean(axis=0), full_matrices=False)[2]
    extents = np.ptp(positions @ directions.T, axis=0)
    return bool(extents[1] > max(PLANAR * extents[0], LEAST_WIDTH * FLATNESS))


def is_flat(positions: Float[np.ndarray, "positions 3"]) -> bool:
    """Tell whether phase centres lie in a plane, to :data:`FLATNESS`."""
    centred = positions - positions.mean(axis=0)
    normal = np.linalg.svd(centred, full_matrices=False)[2][2]
    return bool(np.abs(centred @ normal).max() <= FLATNESS)


def planar_frame(
    positions: Float[np.ndarray, "positions 3"], boresight: Float[np.ndarray, " 3"]
) -> ArrayFrame:
    """Find the frame of a planar array: x horizontal in its plane, y ahead, z up.

    Parameters
    ----------
    positions
        Phase centres. [m]
    boresight
        Unit vector that the array looks along.

    Raises
    ------
    MeasurementError
        If the positions do not lie in a plane, or it is not perpendicular to the boresight.
    """
    origin = 0.5 * (positions.min(axis=0) + positions.max(axis=0))
    directions = np.linalg.svd(positions - positions.mean(axis=0), full_matrices=False)[2]
    off = float(np.abs((positions - positions.mean(axis=0)) @ directions[2]).max())
    if off > FLATNESS:
        raise MeasurementError(
            f"aperture_position: positions lie up to {1e3 * off:.3f} mm off a plane, the limit is "
            f"{1e3 * FLATNESS} mm; users are located with a linear or a planar array"
        )
    ahead = directions[2] * np.sign(directions[2] @ boresight or 1.0)
    slant = float(np.linalg.norm(np.cross(ahead, boresight)))
    if slant > MOST_SLANT:
        raise MeasurementError(
            f"boresight: {np.degrees(np.arcsin(min(slant, 1.0))):.2f}° from the normal of the "
            "planar array; it must be perpendicular to the array"
        )
    ahead = np.where(np.abs(ahead) < ROUNDING, 0.0, ahead)
    ahead = ahead / np.linalg.norm(ahead)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    if np.linalg.norm(right) < 1e-6:  # it looks straight up or down: x is what is horizontal
        right = np.array([1.0, 0.0, 0.0]) - ahead[0] * ahead
    right = right / np.linalg.norm(right)
    return ArrayFrame(origin=origin, axes=np.stack([right, ahead, np.cross(right, ahead)]))


def planar_array(positions: Float[np.ndarray, "positions 3"]) -> PlanarArray:
    """Measure an array in its own frame.

    Raises
    ------
    MeasurementError
        If all positions share one place along x or z.
    """
    apertures, spacings = [], []
    for column in (positions[:, 0], positions[:, 2]):
        # A tenth of a millimetre: places that differ by less are one column that jitters.
        places = np.sort(column)
        first = np.concatenate([[True], np.diff(places) > FLATNESS])
        groups = np.split(places, np.flatnonzero(first)[1:])
        centres = np.array([group.mean() for group in groups])
        if centres.size < 2:
            raise MeasurementError(
                "aperture_position: a planar array needs at least two places along each axis"
            )
        apertures.append(float(centres[-1] - centres[0]))
        spacings.append(float(np.median(np.diff(centres))))
    return PlanarArray(aperture=(apertures[0], apertures[1]), spacing=(spacings[0], spacings[1]))


def planar_resolution(array: PlanarArray, echo: Echo) -> Resolution:
    """Return c/2B along the ray and the coarser λ/2D across it."""
    band = float(echo.frequencies[-1] - echo.frequencies[0])
    return Resolution(
        along_ray=speed_of_light / (2 * band),
        across_ray=max(array.beam(echo.frequencies, passes=2)),
    )


def planar_reach(
    array: PlanarArray, measured: Echo | Uplink, *, passes: int
) -> tuple[float, float]:
    """Return the distances between which sources are looked for. [m].

    From half the diagonal of the aperture to where the farthest element's path would be
    ambiguous, c/(nΔf), at the outermost angles without grating lobes.

    Raises
    ------
    MeasurementError
        If nothing is left between.
    """
    limit = speed_of_light / (passes * frequency_step(measured.frequencies))
    sine = min(1.0, np.sqrt(2) * array.unaliased(measured.frequencies, passes=passes))
    # |p − q|² ≤ R² + 2 R h sin φ + h² for an element at h.
    lever = array.half * sine
    nearest = array.half
    farthest = REACH_MARGIN * (float(np.sqrt(lever**2 + limit**2 - nearest**2)) - lever)
    if farthest < LEAST_DEPTH * nearest:
        raise MeasurementError(
            f"frequency: the steps are unambiguous to {limit:.3g} m only, less than twice the "
            f"aperture's diagonal of {2 * array.half:.3g} m; take smaller frequency steps"
        )
    return nearest, farthest
