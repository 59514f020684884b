r"""The true distance of a plane that the image shows at one of several: its order of ambiguity.

A wall at the distance d + n c/2Δf is imaged at d as well. What it scatters is focused best at its
true distance (:mod:`estimator.imaging.range_alias`), and a part of a wall that is seen beside the
array's own reflection tells by that. The reflection itself is a flat wave from any distance: it
tells by its level alone. Of a wall with the reflection coefficient Γ, met head-on, isotropic
antennas receive

.. math:: |S| = |\Gamma| \frac{\lambda}{8 \pi d} ,

so that a level that would ask for more than a perfect mirror at a distance is not from there, if
the echo is calibrated; and what the array's antennas gain is not known.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.array.planar_array import PlanarArray, planar_resolution
from estimator.array.resolution_cell import coarse_resolution
from estimator.geometry.wall_3d import PlaneWall
from estimator.imaging.range_alias import ORDERS, focus_by_range
from estimator.imaging.range_compression import RangeProfiles, unambiguous_path
from estimator.imaging.survey_3d import VolumeSurvey
from estimator.measurement.model import Echo
from estimator.prediction.echo_calibration import CALIBRATED, GAINS_DB
from estimator.walls.plane_fit import FittedPlane
from estimator.walls.wall_detection_3d import Planes, beyond_the_flash, peaks_on

FEWEST = 3
"""Fewest peaks beside the array's reflection whose mean is taken: of two nothing tells how they
scatter. [-]"""
MOST = 40
"""Brightest peaks that are focused at all distances, for time. [-]"""
TOLD = 3.0
"""Deviations of a mean of log ratios from 0, from which they tell near from far. [-]"""
COEFFICIENTS_DB = (-25.0, 1.0)
"""Range of the reflection coefficients of walls met head-on, from a lossy board to a conductor, and
the error of a level. [dB]"""
FARTHER = 0.5
"""Prior probability of each order over that of the one before: a sweep is mostly chosen for the
room that it is taken in. An assumption. [-]"""
NEGLIGIBLE = 1e-3
"""Probability of an order below which it is left out, as little as an answer may leave open. [-]"""


def unambiguous_range(echo: Echo) -> float:
    """Return the distance c/2Δf after which ranges repeat. [m]."""
    return unambiguous_path(echo.frequencies) / 2


def order_probabilities(
    wall: PlaneWall,
    peaks: Float[np.ndarray, "peaks 3"],
    echo: Echo,
    array: PlanarArray,
    *,
    flat_wave: bool,
    profiles: RangeProfiles,
) -> Float[np.ndarray, " orders"]:
    """Return how probable it is that a plane stands where it is imaged, or farther by n ranges.

    Parameters
    ----------
    wall
        As the image shows it, in the array's frame.
    peaks
        Of the image that lie on it, strongest first. [m]
    echo, array
        What was measured.
    flat_wave
        Whether the array's own reflection in it was seen.
    profiles
        Of the echo, not tapered.

    Returns
    -------
    One probability for each of the orders 0 to :data:`ORDERS`; 1 at 0 where nothing indicates that
    it may stand farther, all 0 where its echo is from farther, but from how far is not told.
    """
    orders = np.zeros(ORDERS + 1)
    told = _by_curvature(wall, peaks, echo, array, profiles)
    if told > TOLD:
        return orders
    if told < -TOLD or not flat_wave:
        orders[0] = 1.0
        return orders
    distance = abs(float(wall.centre @ wall.normal))
    distances = distance + np.arange(ORDERS + 1) * unambiguous_range(echo)
    wavelength = speed_of_light / float(echo.frequencies.mean())
    level = 20 * np.log10(_flat_level(wall, echo) * 8 * np.pi * distances / wavelength)
    low, high = COEFFICIENTS_DB
    within = (level > low) & (level < high)
    density = CALIBRATED * within / (high - low) + (1 - CALIBRATED) / GAINS_DB
    orders = density * FARTHER ** np.arange(ORDERS + 1)
    orders[orders < NEGLIGIBLE * orders.sum()] = 0.0
    return np.asarray(orders / orders.sum())


def planes_within_range(
    planes: Planes,
    echo: Echo,
    array: PlanarArray,
    looked: VolumeSurvey,
    profiles: RangeProfiles,
) -> list[FittedPlane]:
    """Leave out planes that are echoes from beyond; give the others their orders.

    Parameters
    ----------
    planes
        As they were found.
    echo, array, looked, profiles
        As they were found in.
    """
    coarse = coarse_resolution(planar_resolution(array, echo))
    kept = []
    for plane, head_on in zip(planes.fitted, planes.head_on, strict=True):
        peaks = looked.peaks[peaks_on(looked.peaks, plane.wall, coarse)]
        chances = order_probabilities(
            plane.wall, peaks, echo, array, flat_wave=head_on, profiles=profiles
        )
        if chances.any():
            kept.append(replace(plane, orders=chances))
    return kept


def other_distances(
    walls: Sequence[PlaneWall],
    orders: Sequence[Float[np.ndarray, " orders"]],
    step: float,
    *,
    most: int,
) -> tuple[tuple[float, tuple[PlaneWall, ...]], ...]:
    """Return all combinations of the distances that walls may have, the likeliest first.

    Parameters
    ----------
    walls
        As the image shows them. [m]
    orders
        Of each, how probable its orders are.
    step
        Distance from one order to the next. [m]
    most
        Combinations that are returned; their probabilities then sum to less than 1.
    """
    combined: list[tuple[float, tuple[PlaneWall, ...]]] = [(1.0, ())]
    for wall, chances in zip(walls, orders, strict=True):
        combined = [
            (probability * float(chances[order]), (*before, farther(wall, int(order) * step)))
            for probability, before in combined
            for order in np.flatnonzero(chances)
        ]
        combined.sort(key=lambda one: -one[0])
        combined = combined[:most]
    return tuple(combined)


def farther(wall: PlaneWall, distance: float) -> PlaneWall:
    """Return a plane that is seen in the same directions, and that much farther away. [m]."""
    if distance == 0.0:
        return wall
    offset = abs(float(wall.centre @ wall.normal))
    scale = (offset + distance) / offset
    return PlaneWall(
        corners=scale * wall.corners,
        centre=scale * wall.centre,
        axes=wall.axes,
        covariance=_about_a_farther_centre(wall, scale),
    )


def _about_a_farther_centre(wall: PlaneWall, scale: float) -> Float[np.ndarray, "3 3"]:
    """Return the covariance of (tilts, offset) at the scaled centre.

    The flat wave tells the normal, and the distance of the foot of the array's perpendicular: the
    plane turns about that foot, which lies nearer to the old centre than to the new one.
    """
    foot = float(wall.centre @ wall.normal) * wall.normal
    # Rise at the centre for each slope, about the foot: the offset at the foot errs as before.
    lever = wall.axes @ (wall.centre - foot)
    change = np.eye(3)
    change[2, :2] = (scale - 1) * lever
    return np.asarray(change @ wall.covariance @ change.T)


def _by_curvature(
    wall: PlaneWall,
    peaks: Float[np.ndarray, "peaks 3"],
    echo: Echo,
    array: PlanarArray,
    profiles: RangeProfiles,
) -> float:
    """Return by how many deviations a plane's peaks are focused better from farther. [-]."""
    fine = planar_resolution(array, echo)
    aside = peaks[beyond_the_flash(peaks, wall, array, fine)][:MOST]
    if len(aside) < FEWEST:
        return 0.0
    found = focus_by_range(profiles, aside, fine)
    ratios: np.ndarray = np.log(found.beyond / found.here)
    spread = float(ratios.std(ddof=1) / np.sqrt(len(ratios)))
    return float(ratios.mean()) / max(spread, float(np.finfo(float).tiny))


def _flat_level(wall: PlaneWall, echo: Echo) -> float:
    """Return the amplitude of the flat wave that a plane returns to the array. [-]."""
    away = np.sign(float(wall.centre @ wall.normal)) * wall.normal
    lengths: np.ndarray = abs(float(wall.centre @ wall.normal)) - echo.positions @ away
    turns = np.outer(lengths, 2 * echo.frequencies / speed_of_light)
    focused: complex = np.mean(echo.samples * np.exp(2j * np.pi * (turns - np.round(turns))))
    return abs(focused)
