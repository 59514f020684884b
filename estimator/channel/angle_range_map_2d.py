r"""The spherical-wave matched filter of one user's pilot, over angle and path length."""

from functools import partial

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.array.resolution import HALF_POWER
from estimator.imaging.aperture_parts import PolarGrid
from estimator.imaging.backprojection import focus_uplink, prepare
from estimator.imaging.polar_image import focus_polar
from estimator.imaging.range_compression import range_profiles, unambiguous_path
from estimator.measurement.model import MeasurementError, Uplink
from estimator.results.estimate import AngleRangeMap

X_AXIS = np.array([1.0, 0.0, 0.0])
Y_AXIS = np.array([0.0, 1.0, 0.0])
SAMPLES = 3.0
"""Samples for each −3 dB width of a map that is shown: 0.3 dB of a peak are lost at most, between
two of them. [-]"""
DECIMALS = 9
"""Decimals to which places along the axis are told apart: a nanometre is rounding. [decimals of m]
"""
SHORTEST = 1e-9
"""Least length of a vector that has a direction, and difference of cosines that is no rounding.
[-]"""
FEWEST = 64
"""Angles, and lengths, from which on a map is worth to be formed of parts of the array. [-]"""


def angle_range_map(
    uplink: Uplink,
    *,
    aoa: Float[np.ndarray, " angles"],
    path_length: Float[np.ndarray, " ranges"],
    centre: Float[np.ndarray, " 3"] | None = None,
    axis: Float[np.ndarray, " 3"] = X_AXIS,
    boresight: Float[np.ndarray, " 3"] = Y_AXIS,
    amplitude_ratio: bool = False,
) -> AngleRangeMap:
    r"""Match a pilot to spherical waves from every angle and path length.

    The joint filter of :func:`estimator.imaging.backprojection.focus_uplink` on polar points:
    (3-10) at the full bandwidth, so that neither the wavefront's curvature nor the walk of the
    range along the aperture is lost.

    Parameters
    ----------
    uplink
        The user's pilot at the array.
    aoa
        Angles from the array's axis. [rad]
    path_length
        Path lengths from the array's centre, in one way. [m]
    centre
        Where angles and lengths are counted from; ``None``: the mean of the elements. [m]
    axis, boresight
        Unit vectors along the array and to the side on which sources are assumed: a linear
        array gives a cone, and the map is its cut with this half plane.
    amplitude_ratio
        Whether the wave's decay along the array is matched as well.

    Returns
    -------
    Complex map; a unit wave (at the array's centre) from a grid point peaks at 1.

    Raises
    ------
    MeasurementError
        If a path length is beyond the unambiguous one or not positive, an angle is outside
        0…π, or axis and boresight span no plane.
    """
    middle = uplink.positions.mean(axis=0) if centre is None else centre
    points = partial(
        polar_points,
        aoa=aoa,
        path_length=path_length,
        centre=middle,
        axis=axis,
        boresight=boresight,
    )
    grid = None if amplitude_ratio else _uniform(aoa, path_length)
    if grid is None:
        values = focus_uplink(uplink, points(), amplitude_ratio=amplitude_ratio)
    else:
        _ = points(aoa=aoa[:1], path_length=path_length[:1])  # refuses what makes no map
        ready = prepare(range_profiles(uplink))
        values = focus_polar(ready, grid, centre=middle, axis=_unit("axis", axis)).T[::-1].copy()
    return AngleRangeMap(values=values, aoa=aoa, path_length=path_length, user=uplink.user)


def _uniform(
    aoa: Float[np.ndarray, " angles"], path_length: Float[np.ndarray, " ranges"]
) -> PolarGrid | None:
    """Return rising lengths and falling cosines as a grid, if the cosines are equally spaced."""
    cosines = np.cos(aoa)
    if aoa.size < FEWEST or path_length.size < FEWEST or not path_length[0] > 0:
        return None
    uniform = np.linspace(cosines[-1], cosines[0], aoa.size)
    if np.abs(cosines[::-1] - uniform).max() > SHORTEST or np.any(np.diff(path_length) <= 0):
        return None
    return PolarGrid(path_length, uniform)


def polar_points(
    *,
    aoa: Float[np.ndarray, " angles"],
    path_length: Float[np.ndarray, " ranges"],
    centre: Float[np.ndarray, " 3"],
    axis: Float[np.ndarray, " 3"] = X_AXIS,
    boresight: Float[np.ndarray, " 3"] = Y_AXIS,
) -> Float[np.ndarray, "angles ranges 3"]:
    """Place points at angles from the array's axis and distances from its centre, in metres."""
    if aoa.size and (aoa.min() < 0 or aoa.max() > np.pi):
        raise MeasurementError(
            f"angles of arrival reach from {np.degrees(aoa.min()):g}° to "
            f"{np.degrees(aoa.max()):g}°; measured from the array's axis they are 0…180°"
        )
    if path_length.size and path_length.min() <= 0:
        raise MeasurementError(
            f"the shortest path length is {path_length.min():g} m; it must be positive"
        )
    along = _unit("axis", axis)
    across = _unit(
        "boresight, less its part along the axis,", boresight - (boresight @ along) * along
    )
    direction = np.cos(aoa)[:, None] * along + np.sin(aoa)[:, None] * across
    return np.asarray(centre + path_length[None, :, None] * direction[:, None, :])


def default_angles(
    uplink: Uplink, *, axis: Float[np.ndarray, " 3"] = X_AXIS, cells: float = SAMPLES
) -> Float[np.ndarray, " angles"]:
    r"""Sample the sector in which the array's angles are unambiguous, uniformly in cos θ.

    A source at cos θ is repeated at cos θ ± λ/d; the sector |cos θ| < λ_min/(2d) holds no
    repetition, which is all angles for d ≤ λ_min/2.

    Parameters
    ----------
    uplink
        Pilot whose elements and band set aperture and wavelength.
    axis
        Unit vector along the array.
    cells
        Samples for each -3 dB beam width 0.886 λ_min/D.

    Returns
    -------
    Rising angles from the array's axis. [rad]

    Raises
    ------
    MeasurementError
        If all elements lie at one place along the axis.
    """
    along = np.unique(np.round(uplink.positions @ _unit("axis", axis), DECIMALS))
    if along.size < 2:
        raise MeasurementError(
            "the elements all lie at one place along the axis; an angle needs an aperture"
        )
    wavelength = speed_of_light / uplink.frequencies[-1]
    # The nominal pitch: holes in the array do not change where its grating lobes are.
    sector = min(1.0, wavelength / (2 * np.diff(along).min()))
    beam = HALF_POWER * wavelength / (along[-1] - along[0])
    count = int(np.ceil(2 * sector / beam * cells)) + 1
    return np.arccos(np.linspace(sector, -sector, count))


def default_path_lengths(
    uplink: Uplink,
    *,
    centre: Float[np.ndarray, " 3"] | None = None,
    longest: float | None = None,
    cells: float = SAMPLES,
) -> Float[np.ndarray, " ranges"]:
    """Sample path lengths from one cell up to the unambiguous path c/Δf.

    Parameters
    ----------
    uplink
        Pilot whose frequencies set cell and limit.
    centre
        Where lengths are counted from; ``None``: the mean of the elements. [m]
    longest
        A shorter limit. [m]
    cells
        Samples for each -3 dB range cell 0.886 c/B.

    Returns
    -------
    Path lengths in equal steps. [m]

    Raises
    ------
    MeasurementError
        If there is one frequency only, or ``longest`` is not positive.
    """
    frequencies = uplink.frequencies
    if frequencies.size < 2:
        raise MeasurementError(
            "frequency: one point has no bandwidth; range needs at least two frequencies"
        )
    # Elements beyond the centre are farther away than it, and must be in range as well.
    middle = uplink.positions.mean(axis=0) if centre is None else centre
    size = np.linalg.norm(uplink.positions - middle, axis=1).max()
    limit = unambiguous_path(frequencies) - float(size)
    end = limit if longest is None else min(longest, limit)
    step = HALF_POWER * speed_of_light / float(frequencies[-1] - frequencies[0]) / cells
    if end <= step * cells:
        raise MeasurementError(
            f"path lengths up to {end:g} m hold no range cell ({step * cells:g} m); "
            "give a longer limit or smaller frequency steps"
        )
    return np.arange(step * cells, end, step)


def _unit(name: str, vector: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 3"]:
    length = float(np.linalg.norm(vector))
    if not length > SHORTEST:
        raise MeasurementError(f"{name} has length {length:g}; it must have a direction")
    return np.asarray(vector / length, dtype=np.float64)
