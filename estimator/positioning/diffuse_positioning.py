r"""A user found by what a rough wall scatters, where no mirror-like path stands out.

Each point of a known wall that scatters the pilot is an anchor. Focused on a wall point s, with
a further distance d left free,

.. math:: F(s, d) = \frac{1}{MN} \Bigl|\sum_{m,n} w_n\, y_{mn}\,
          e^{+jk_n (\lVert s - q_m \rVert + d)}\Bigr|,

the pilot shows how far the user is from s. All wall points together tell where it is: the
position is searched that maximises the summed log-likelihood ratio
:math:`\sum_s \ln(1 + |F(s, \lVert u - s \rVert)|^2 / \sigma_s^2)`, with the median over d as the
background :math:`\sigma_s^2`. The logarithm is that of speckle of unknown level in each point:
few bright ones do not decide. Cells of a quadtree whose upper bound (the largest value within
the cell's circle of distances) is below the best value found are dropped, so that the search is
as good as an exhaustive one.

The position is then refined as in trilateration: stretches of wall, each with speckle of its
own, tell how much nearer or farther the user is; what they disagree about gives the covariance.
A wall that is seen through others serves too: the pilot is focused on its ghost, the user is
sought about its true place. Points on the far side of a wall are not looked at: for them, all
distances are the same as for their mirror images.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.ndimage import map_coordinates, maximum_filter1d

from estimator.measurement.model import Uplink
from estimator.positioning.wall_anchors import (
    SAMPLES_PER_CELL,
    STRETCHES,
    Anchors,
    SeenWall,
    distances_from,
    lit_points,
    most_lit,
    score_at,
    score_indices,
    wall_anchors,
)

COARSEST = 0.064
"""Width of the first cells of the search: how coarse they are decides on time. [m]"""

MOST_CELLS = 60_000
"""Most cells of one level, for memory; the best ones are kept. [-]"""

AT_ONCE = 4096
"""Cells whose distances from all wall points are held at once: 3 MB for a hundred points. [-]"""

FEWEST_LIT = 0.5
"""Share of some wall's points that must be lit: a mirror-like path lights a few only. [-]"""

PARALLEL = float(np.cos(np.radians(10.0)))
"""Cosine between the normals of walls that count as parallel: within 10°. Images of a place in two
walls that are turned by t from each other are 2 d sin t apart, at a distance d from where their
lines cross: 0.35 d, a decimetre at 0.3 m, where diffuse places are known to centimetres. It is not
reached in five of the rooms of ``python -m validation.experiments.thresholds decisions``. [-]"""

FEWEST_STRETCHES = 5
"""Stretches that must show a maximum: three more than the place's coordinates, for a covariance.
[-]"""

WIDEST, SHIFTS = 1.5, 49
"""Distances that are tried about a place's own: to half a cell beyond the parabola's own width
[cells c/B], and how many: sixteen a cell. [-]"""

ROUNDS = 4
"""Trilaterations, each from the place of the last: Gauss-Newton steps. Four times as many move the
place by 4e-5 of its deviation at most, of eight pilots (``python -m
validation.experiments.thresholds limits``). [-]"""

RIVAL = 0.9
"""Score, over the best one (both less the mean score), that makes a place a rival. ``python -m
validation.experiments.thresholds answers``: of 16 pilots over a rough wall 15 are placed right and
one 2 mm off, outside of its region, with 0.8 and 0.95 as with this. [-]"""

MOST_RIVALS = 8
"""Most rivals that are told apart: with so many, one more changes no answer. [-]"""

RIVAL_APART = 6.0
"""Distance from the best place, in its deviations, beyond which a place is another one. [-]"""


@dataclass(frozen=True, kw_only=True)
class DiffuseFix:
    """A position from diffuse scattering, in the array's frame."""

    position: Float[np.ndarray, " 3"]  # [m]
    covariance: Float[np.ndarray, "3 3"]  # [m²]
    wall: int  # index of the wall that scatters most
    lit: float  # share of its points that are lit [-]
    several: bool  # whether two walls or more, that are not parallel, scatter from there
    rivals: Float[np.ndarray, "rivals 3"]  # other places that explain the pilot as well [m]


def search_diffuse(uplink: Uplink, walls: Sequence[SeenWall]) -> DiffuseFix | None:
    """Search the position that explains what rough walls scatter of a pilot.

    Parameters
    ----------
    uplink
        The pilot, with positions in the array's frame.
    walls
        The map.

    Returns
    -------
    The position, or ``None`` if no wall scatters from most of its length.
    """
    if not walls:
        return None
    anchors = wall_anchors(uplink, walls)
    cells, unlit = _search(anchors)
    if len(cells) == 0:
        return None
    scores, _ = score_at(anchors, cells)
    if scores.max() < unlit:
        return None  # another place explains more, from which no wall scatters
    best = cells[int(np.argmax(scores))]
    refined = _refined(anchors, best)
    if refined is None:
        return None
    place, covariance = refined
    lit = lit_points(anchors, place)
    shares = [float(lit[anchors.wall == index].mean()) for index in range(len(walls))]
    wall = int(np.argmax(shares))
    if shares[wall] < FEWEST_LIT:
        return None
    rivals, spread = _rivals(anchors, cells, scores, place, covariance)
    full = np.zeros((3, 3))
    full[:2, :2] = covariance + spread
    return DiffuseFix(
        position=np.append(place, 0.0),
        covariance=full,
        wall=wall,
        lit=shares[wall],
        several=_several(walls, wall, shares),
        rivals=rivals,
    )


def _several(walls: Sequence[SeenWall], brightest: int, shares: Sequence[float]) -> bool:
    """Tell whether another wall, not parallel to the brightest, scatters from most of its length.

    Parallel ones tell the same distances, and share the mirror images.
    """
    normal = walls[brightest].true.normal
    return any(
        share >= FEWEST_LIT and abs(float(normal @ wall.true.normal)) < PARALLEL
        for wall, share in zip(walls, shares, strict=True)
    )


def _search(anchors: Anchors) -> tuple[Float[np.ndarray, "cells 2"], float]:
    """Divide the plane into ever smaller cells, and drop those that cannot hold the best place.

    Returns
    -------
    The smallest cells that may, and the highest score of places from which no wall is lit.
    """
    reach = float(anchors.farthest.max())
    low, high = anchors.places.min(axis=0) - reach, anchors.places.max(axis=0) + reach
    width = max(COARSEST, float(np.sqrt(np.prod(high - low) / MOST_CELLS)))
    axes = [np.arange(low[axis], high[axis], width) + width / 2 for axis in (0, 1)]
    cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    quarters = np.array([(-0.25, -0.25), (-0.25, 0.25), (0.25, -0.25), (0.25, 0.25)])
    highest = unlit = 0.0
    while True:
        some = _promising(anchors, cells, width, highest)
        cells, highest, unlit = cells[some.kept], some.highest, max(unlit, some.unlit)
        if width < np.sqrt(2) * anchors.step or len(cells) == 0:
            return np.asarray(cells), unlit
        cells = (cells[:, None] + quarters * width).reshape(-1, 2)
        width /= 2


@dataclass(frozen=True)
class _Promising:
    """Cells that are searched further."""

    kept: np.ndarray  # their indices
    highest: float  # score of any place so far [-]
    unlit: float  # that of places from which no wall is lit [-]


def _promising(
    anchors: Anchors, cells: Float[np.ndarray, "cells 2"], width: float, highest: float
) -> _Promising:
    """Select the cells that may hold the best place or a rival.

    Besides its score a place needs a wall of which most points are lit: where nothing scatters the
    pilot, that leaves no cell after few divisions.
    """
    radius = width / np.sqrt(2)
    reach = int(np.ceil(radius / anchors.step))
    widened = maximum_filter1d(anchors.scores, 2 * reach + 1, axis=1, mode="nearest")
    bounds, values, lit = (np.empty(len(cells)) for _ in range(3))
    for first in range(0, len(cells), AT_ONCE):
        some = slice(first, first + AT_ONCE)
        column, possible = score_indices(anchors, cells[some])
        most = np.where(possible, widened.take(column), 0.0)
        bounds[some], lit[some] = most.sum(axis=0), most_lit(anchors, most)
        values[some] = np.where(possible, anchors.scores.take(column), 0.0).sum(axis=0)
    chance = float(np.median(anchors.scores)) * len(anchors.scores)
    highest = max(highest, float(values.max(initial=0.0)))
    least = chance + RIVAL * (highest - chance)
    dark = lit < FEWEST_LIT
    kept = np.flatnonzero((bounds >= least) & ~dark)
    if len(kept) > MOST_CELLS // 4:
        kept = kept[np.argsort(-bounds[kept], kind="stable")[: MOST_CELLS // 4]]
    return _Promising(kept, highest, float(values[dark].max(initial=0.0)))


def _refined(
    anchors: Anchors, start: Float[np.ndarray, " 2"]
) -> tuple[Float[np.ndarray, " 2"], Float[np.ndarray, "2 2"]] | None:
    """Trilaterate from stretches of the walls, beginning at a place."""
    place = start
    cell = SAMPLES_PER_CELL * anchors.step
    shifts = np.linspace(-WIDEST, WIDEST, SHIFTS) * cell
    fit = np.abs(shifts) <= cell
    for _ in range(ROUNDS):
        distance, possible = distances_from(anchors, place[None])
        usable = np.flatnonzero(possible[:, 0] & lit_points(anchors, place))
        if len(usable) < STRETCHES:
            return None
        columns = (distance[usable] + shifts) / anchors.step
        rows = np.broadcast_to(usable[:, None], columns.shape)
        profiles = map_coordinates(
            anchors.splines, [rows, columns], order=3, mode="mirror", prefilter=False
        )
        stretches = np.array_split(np.arange(len(usable)), STRETCHES)
        directions = place - anchors.places[usable]
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        rows_, offsets, weights = [], [], []
        for stretch in stretches:
            mean = profiles[stretch].mean(axis=0)
            curve = np.polynomial.polynomial.polyfit(shifts[fit] / cell, mean[fit], 2)
            if curve[2] >= 0:
                continue
            offsets.append(float(np.clip(-curve[1] / (2 * curve[2]), -1.0, 1.0)) * cell)
            weights.append(-float(curve[2]))
            rows_.append(directions[stretch].mean(axis=0))
        if len(rows_) < FEWEST_STRETCHES:
            return None
        jacobian, residual, weight = np.array(rows_), np.array(offsets), np.sqrt(np.array(weights))
        normal = np.linalg.inv((jacobian * weight[:, None] ** 2).T @ jacobian)
        move = normal @ (jacobian * weight[:, None] ** 2).T @ residual
        left = residual - jacobian @ move
        scores = jacobian * (weight**2 * left)[:, None]
        count = len(rows_)
        covariance = count / (count - 2) * normal @ (scores.T @ scores) @ normal
        place = place + move
    return place, covariance


def _rivals(
    anchors: Anchors,
    cells: Float[np.ndarray, "cells 2"],
    scores: Float[np.ndarray, " cells"],
    place: Float[np.ndarray, " 2"],
    covariance: Float[np.ndarray, "2 2"],
) -> tuple[Float[np.ndarray, "rivals 3"], Float[np.ndarray, "2 2"]]:
    """Find other positions that explain the pilot nearly as well.

    Returns
    -------
    Separate local maxima [m], and the spread of those that are one with the place [m²].
    """
    chance = float(np.median(anchors.scores)) * len(anchors.scores)
    left = scores >= chance + RIVAL * (float(scores.max()) - chance)
    apart = RIVAL_APART * float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    apart += SAMPLES_PER_CELL * anchors.step
    rivals: list[np.ndarray] = []
    spread = np.zeros((2, 2))
    centre = place
    while True:
        left = left & (np.linalg.norm(cells - centre, axis=-1) > apart)
        if not left.any() or len(rivals) == MOST_RIVALS:
            return np.array(rivals).reshape(-1, 3), spread
        centre = cells[int(np.argmax(np.where(left, scores, -np.inf)))]
        climbed = _refined(anchors, centre)
        if climbed is None or np.linalg.norm(climbed[0] - centre) > apart:
            continue
        off = climbed[0] - place
        if np.linalg.norm(off) < apart:
            spread = max(spread, np.outer(off, off), key=np.trace)
        elif all(np.linalg.norm(climbed[0] - rival[:2]) > apart for rival in rivals):
            rivals.append(np.append(climbed[0], 0.0))
