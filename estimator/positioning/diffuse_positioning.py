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
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Complex, Float
from scipy.constants import speed_of_light
from scipy.ndimage import map_coordinates, maximum_filter1d, spline_filter

from estimator.array.windows import survey_weights
from estimator.geometry.wall_2d import Wall
from estimator.measurement.model import Uplink

SIDELOBES = 10**-4.5
"""Intensity, over the largest one, that sidelobes of the taper may have near the main lobe. [-]"""

SAMPLES_PER_CELL = 4
"""Samples of the distance for each range cell c/B: twice what the sampling theorem asks of
the intensity, for splines between them. [-]"""

POINTS_PER_CELL = 2.0
"""Points of a wall for each cross-range cell: as the sampling theorem asks. [-]"""

COARSEST = 0.064
"""Width of the first cells of the search: how coarse they are decides on time. [m]"""

MOST_CELLS = 60_000
"""Most cells of one level, for memory; the best ones are kept. [-]"""

AT_ONCE = 4096
"""Cells whose distances from all wall points are held at once: 3 MB for a hundred points. [-]"""

LIT = 6.0
"""Intensity over the background from which a wall point counts as lit: speckle and noise pass
it in 1 of 60 points (ln 2 · 6 = 4.2 times their mean). [-]"""

FEWEST_LIT = 0.5
"""Share of some wall's points that must be lit: a mirror-like path lights a few only. [-]"""

PARALLEL = float(np.cos(np.radians(10.0)))
"""Cosine between the normals of walls that count as parallel: within 10°. Chosen, not measured.
[-]"""

STRETCHES = 12
"""Stretches of a wall whose distances are told apart. [-]"""

FEWEST_STRETCHES = 5
"""Stretches that must show a maximum: three more than the place's coordinates, for a covariance.
[-]"""

WIDEST, SHIFTS = 1.5, 49
"""Distances that are tried about a place's own: to half a cell beyond the parabola's own width
[cells c/B], and how many: sixteen a cell. [-]"""

ROUNDS = 4
"""Trilaterations, each from the place of the last: Gauss-Newton steps; chosen, not measured. [-]"""

RIVAL = 0.9
"""Score, over the best one (both less the mean score), that makes a place a rival. ``python -m
validation.experiments.thresholds answers``: of 16 pilots over a rough wall, 14 are placed right,
one 2 mm off and outside of its region, and one has rivals, with 0.95 as with this; with 0.8 one
more has rivals. [-]"""

RIVAL_APART = 6.0
"""Distance from the best place, in its deviations, beyond which a place is another one. [-]"""


@dataclass(frozen=True, kw_only=True)
class SeenWall:
    """A wall as the array sees it, and where it is."""

    seen: Wall  # a ghost, if it is seen through others
    true: Wall
    through: tuple[int, ...]  # indices of the walls it is seen through


@dataclass(frozen=True, kw_only=True)
class DiffuseFix:
    """A position from diffuse scattering, in the array's frame."""

    position: Float[np.ndarray, " 3"]  # [m]
    covariance: Float[np.ndarray, "3 3"]  # [m²]
    wall: int  # index of the wall that scatters most
    lit: float  # share of its points that are lit [-]
    several: bool  # whether two walls or more, that are not parallel, scatter from there
    rivals: Float[np.ndarray, "rivals 3"]  # other places that explain the pilot as well [m]


@dataclass(frozen=True, kw_only=True)
class _Anchors:
    """What points of all walls tell about their distances to the user."""

    places: Float[np.ndarray, "points 2"]  # true ones [m]
    normals: Float[np.ndarray, "points 2"]  # to the side that is looked at
    wall: np.ndarray  # index of each point's wall
    scores: Float[np.ndarray, "points distances"]  # ln(1 + I/σ²)
    step: float  # of the distances [m]

    @property
    def farthest(self) -> float:
        """Largest distance that is told apart. [m]."""
        return float(self.step * self.scores.shape[1])

    @cached_property
    def splines(self) -> Float[np.ndarray, "points distances"]:
        """Coefficients of cubic splines through the scores. [-]."""
        return np.asarray(spline_filter(self.scores, order=3, mode="mirror"))


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
    anchors = _anchors(uplink, walls)
    cells = _search(anchors)
    if len(cells) == 0:
        return None
    scores, _ = _score(anchors, cells)
    best = cells[int(np.argmax(scores))]
    refined = _refined(anchors, best)
    if refined is None:
        return None
    place, covariance = refined
    shares = [
        float(_lit(anchors, place)[anchors.wall == index].mean()) for index in range(len(walls))
    ]
    wall = int(np.argmax(shares))
    if shares[wall] < FEWEST_LIT:
        return None
    full = np.zeros((3, 3))
    full[:2, :2] = covariance
    return DiffuseFix(
        position=np.append(place, 0.0),
        covariance=full,
        wall=wall,
        lit=shares[wall],
        several=_several(walls, wall, shares),
        rivals=_rivals(anchors, cells, scores, place, covariance),
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


def further_distances(
    uplink: Uplink, points: Float[np.ndarray, "points 3"]
) -> tuple[Float[np.ndarray, "points distances"], float]:
    """Focus a pilot on points, and tell how much farther its source is from each.

    Parameters
    ----------
    uplink
        The pilot, with positions in the frame of the points.
    points
        Where it is scattered. [m]

    Returns
    -------
    The intensity over the distance, from 0 to the unambiguous one; and the distance's step [m].
    """
    frequencies = uplink.frequencies
    count = frequencies.size
    step = float(frequencies[-1] - frequencies[0]) / (count - 1)
    # A low-sidelobe taper: a bright point must not light the whole wall.
    taper = survey_weights(uplink)
    # Phases over a uniform grid are products of a few: n = inner · a + b.
    inner = int(np.ceil(np.sqrt(count)))
    padded = np.zeros((len(uplink.positions), inner * inner), dtype=np.complex128)
    padded[:, :count] = uplink.samples * taper
    samples = padded.reshape(-1, inner, inner)
    outer_grid = frequencies[0] + step * inner * np.arange(inner)
    inner_grid = step * np.arange(inner)

    def focused(point: Float[np.ndarray, " 3"]) -> Complex[np.ndarray, " freqs"]:
        delays = np.linalg.norm(point - uplink.positions, axis=-1)[:, None] / speed_of_light
        coarse, fine = _phasor(delays * outer_grid), _phasor(delays * inner_grid)
        return np.asarray(np.einsum("ma,mab,mb->ab", coarse, samples, fine).ravel()[:count])

    spectra = np.stack([focused(point) for point in points])
    size = SAMPLES_PER_CELL * count
    profiles = np.fft.ifft(spectra, size, axis=1)
    return np.abs(profiles) ** 2, speed_of_light / (step * size)


def _phasor(turns: Float[np.ndarray, "*n"]) -> Complex[np.ndarray, "*n"]:
    return np.asarray(np.exp(2j * np.pi * (turns - np.rint(turns))))


def _anchors(uplink: Uplink, walls: Sequence[SeenWall]) -> _Anchors:
    wavelength = speed_of_light / float(uplink.frequencies.mean())
    beam = wavelength / float(np.ptp(uplink.positions[:, 0]))
    places, normals, owner, scores = [], [], [], []
    step = 0.0
    for index, wall in enumerate(walls):
        along = wall.seen.end - wall.seen.start
        middle = 0.5 * (wall.seen.start + wall.seen.end)
        far = float(np.linalg.norm(middle))
        # What the wall's length looks like from the array, in beams.
        across = abs(along[0] * middle[1] - along[1] * middle[0]) / far**2
        count = max(STRETCHES, round(POINTS_PER_CELL * across / beam))
        shares = ((np.arange(count) + 0.5) / count)[:, None]
        intensity, step = further_distances(uplink, wall.seen.start + shares * along)
        background = np.median(intensity, axis=1, keepdims=True)
        scores.append(np.log1p(intensity / (background + SIDELOBES * intensity.max())))
        true = wall.true.end - wall.true.start
        places.append((wall.true.start + shares * true)[:, :2])
        normal = np.array([true[1], -true[0]]) / np.linalg.norm(true)
        before = np.zeros(2) if not wall.through else _middle(walls[wall.through[-1]].true)
        if normal @ (before - places[-1][0]) < 0:
            normal = -normal
        normals.append(np.broadcast_to(normal, (count, 2)))
        owner.append(np.full(count, index))
    return _Anchors(
        places=np.concatenate(places),
        normals=np.concatenate(normals),
        wall=np.concatenate(owner),
        scores=np.concatenate(scores),
        step=step,
    )


def _middle(wall: Wall) -> Float[np.ndarray, " 2"]:
    middle: np.ndarray = 0.5 * (wall.start + wall.end)[:2]
    return middle


def _distances(
    anchors: _Anchors, places: Float[np.ndarray, "n 2"]
) -> tuple[Float[np.ndarray, "points n"], Bool[np.ndarray, "points n"]]:
    """Distances of places from all wall points, and which points can scatter there."""
    apart = places - anchors.places[:, None]
    before = np.einsum("pnx,px->pn", apart, anchors.normals) > 0
    distance = np.linalg.norm(apart, axis=-1)
    return distance, before & (distance < anchors.farthest)


def _score(
    anchors: _Anchors, places: Float[np.ndarray, "n 2"], scores: np.ndarray | None = None
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "points n"]]:
    """Sum of the points' scores at their distances to places; and each point's."""
    table = anchors.scores if scores is None else scores
    distance, possible = _distances(anchors, places)
    column = np.minimum(np.rint(distance / anchors.step).astype(int), table.shape[1] - 1)
    each = np.where(possible, table[np.arange(len(table))[:, None], column], 0.0)
    return each.sum(axis=0), each


def _lit(anchors: _Anchors, place: Float[np.ndarray, " 2"]) -> Bool[np.ndarray, " points"]:
    lit: np.ndarray = _score(anchors, place[None])[1][:, 0] > np.log1p(LIT)
    return lit


def _search(anchors: _Anchors) -> Float[np.ndarray, "cells 2"]:
    """Divide the plane into ever smaller cells, and drop those that cannot hold the best place."""
    reach = anchors.farthest
    low, high = anchors.places.min(axis=0) - reach, anchors.places.max(axis=0) + reach
    width = max(COARSEST, float(np.sqrt(np.prod(high - low) / MOST_CELLS)))
    axes = [np.arange(low[axis], high[axis], width) + width / 2 for axis in (0, 1)]
    cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    quarters = np.array([(-0.25, -0.25), (-0.25, 0.25), (0.25, -0.25), (0.25, 0.25)])
    while True:
        kept, done = _promising(anchors, cells, width)
        cells = cells[kept]
        if done or len(cells) == 0:
            return np.asarray(cells)
        cells = (cells[:, None] + quarters * width).reshape(-1, 2)
        width /= 2


def _promising(
    anchors: _Anchors, cells: Float[np.ndarray, "cells 2"], width: float
) -> tuple[np.ndarray, bool]:
    """Return the indices of cells that may hold the best place or a rival; and whether to stop."""
    radius = width / np.sqrt(2)
    reach = int(np.ceil(radius / anchors.step))
    widened = maximum_filter1d(anchors.scores, 2 * reach + 1, axis=1, mode="nearest")
    bounds, values = np.empty(len(cells)), np.empty(len(cells))
    for first in range(0, len(cells), AT_ONCE):
        some = slice(first, first + AT_ONCE)
        bounds[some], values[some] = (
            _score(anchors, cells[some], table)[0] for table in (widened, anchors.scores)
        )
    chance = float(np.median(anchors.scores)) * len(anchors.scores)
    least = chance + RIVAL * (float(values.max(initial=0.0)) - chance)
    kept = np.flatnonzero(bounds >= least)
    if len(kept) > MOST_CELLS // 4:
        kept = kept[np.argsort(-bounds[kept], kind="stable")[: MOST_CELLS // 4]]
    return kept, bool(radius < anchors.step)


def _refined(
    anchors: _Anchors, start: Float[np.ndarray, " 2"]
) -> tuple[Float[np.ndarray, " 2"], Float[np.ndarray, "2 2"]] | None:
    """Trilaterate from stretches of the walls, beginning at a place."""
    place = start
    cell = SAMPLES_PER_CELL * anchors.step
    shifts = np.linspace(-WIDEST, WIDEST, SHIFTS) * cell
    fit = np.abs(shifts) <= cell
    for _ in range(ROUNDS):
        distance, possible = _distances(anchors, place[None])
        usable = np.flatnonzero(possible[:, 0] & _lit(anchors, place))
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
    anchors: _Anchors,
    cells: Float[np.ndarray, "cells 2"],
    scores: Float[np.ndarray, " cells"],
    place: Float[np.ndarray, " 2"],
    covariance: Float[np.ndarray, "2 2"],
) -> Float[np.ndarray, "rivals 3"]:
    """Other positions that explain the pilot nearly as well: separate local maxima. [m]."""
    chance = float(np.median(anchors.scores)) * len(anchors.scores)
    left = scores >= chance + RIVAL * (float(scores.max()) - chance)
    apart = RIVAL_APART * float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    apart += SAMPLES_PER_CELL * anchors.step
    rivals: list[np.ndarray] = []
    centre = place
    while True:
        left = left & (np.linalg.norm(cells - centre, axis=-1) > apart)
        if not left.any():
            return np.array(rivals).reshape(-1, 3)
        centre = cells[int(np.argmax(np.where(left, scores, -np.inf)))]
        climbed = _refined(anchors, centre)
        if climbed is not None and np.linalg.norm(climbed[0] - centre) < apart:
            rivals.append(np.append(climbed[0], 0.0))
