"""Points of rough walls as anchors: how far a pilot's source is from each of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Complex, Complex64, Float, Int
from scipy.constants import speed_of_light
from scipy.ndimage import spline_filter

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

LIT = 6.0
"""Intensity over the background from which a wall point counts as lit: speckle and noise pass
it in 1 of 60 points (ln 2 · 6 = 4.2 times their mean). [-]"""

STRETCHES = 12
"""Stretches of a wall whose distances are told apart. [-]"""


@dataclass(frozen=True, kw_only=True)
class SeenWall:
    """A wall as the array sees it, and where it is."""

    seen: Wall  # a ghost, if it is seen through others
    true: Wall
    through: tuple[int, ...]  # indices of the walls it is seen through


@dataclass(frozen=True, kw_only=True)
class Anchors:
    """What points of all walls tell about their distances to the user."""

    places: Float[np.ndarray, "points 2"]  # true ones [m]
    normals: Float[np.ndarray, "points 2"]  # to the side that is looked at
    wall: np.ndarray  # index of each point's wall
    scores: Float[np.ndarray, "points distances"]  # ln(1 + I/σ²)
    step: float  # of the distances [m]
    farthest: Float[np.ndarray, " points"]
    """Largest distance that is told apart: the whole path, to the point and on to the array, is
    known up to the unambiguous one only. What seems farther came sooner than over the wall. [m]"""

    @cached_property
    def splines(self) -> Float[np.ndarray, "points distances"]:
        """Coefficients of cubic splines through the scores. [-]."""
        return np.asarray(spline_filter(self.scores, order=3, mode="mirror"))


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
    # Phases are reduced to a turn first: single precision leaves the sums 1e-6.
    padded = np.zeros((len(uplink.positions), inner * inner), dtype=np.complex64)
    padded[:, :count] = uplink.samples * taper
    samples = padded.reshape(-1, inner, inner)
    outer_grid = frequencies[0] + step * inner * np.arange(inner)
    inner_grid = step * np.arange(inner)

    def focused(point: Float[np.ndarray, " 3"]) -> Complex[np.ndarray, " freqs"]:
        delays = np.linalg.norm(point - uplink.positions, axis=-1)[:, None] / speed_of_light
        coarse, fine = _phasor(delays * outer_grid), _phasor(delays * inner_grid)
        turned = coarse[:, :, None] * samples
        turned *= fine[:, None, :]
        return np.asarray(turned.sum(axis=0).ravel()[:count])

    spectra = np.stack([focused(point) for point in points]).astype(np.complex128)
    size = SAMPLES_PER_CELL * count
    profiles = np.fft.ifft(spectra, size, axis=1)
    return np.abs(profiles) ** 2, speed_of_light / (step * size)


def _phasor(turns: Float[np.ndarray, "*n"]) -> Complex64[np.ndarray, "*n"]:
    left = (2 * np.pi * (turns - np.rint(turns))).astype(np.float32)
    return np.asarray(np.cos(left) + 1j * np.sin(left), dtype=np.complex64)


def wall_anchors(uplink: Uplink, walls: Sequence[SeenWall]) -> Anchors:
    """Focus a pilot on points of all walls: two for each cross-range cell."""
    wavelength = speed_of_light / float(uplink.frequencies.mean())
    beam = wavelength / float(np.ptp(uplink.positions[:, 0]))
    places, normals, owner, scores, farthest = [], [], [], [], []
    step = 0.0
    for index, wall in enumerate(walls):
        along = wall.seen.end - wall.seen.start
        middle = 0.5 * (wall.seen.start + wall.seen.end)
        far = float(np.linalg.norm(middle))
        # What the wall's length looks like from the array, in beams.
        across = abs(along[0] * middle[1] - along[1] * middle[0]) / far**2
        count = max(STRETCHES, round(POINTS_PER_CELL * across / beam))
        shares = ((np.arange(count) + 0.5) / count)[:, None]
        points = wall.seen.start + shares * along
        intensity, step = further_distances(uplink, points)
        farthest.append(step * intensity.shape[1] - np.linalg.norm(points, axis=-1))
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
    return Anchors(
        places=np.concatenate(places),
        normals=np.concatenate(normals),
        wall=np.concatenate(owner),
        scores=np.concatenate(scores),
        step=step,
        farthest=np.concatenate(farthest),
    )


def _middle(wall: Wall) -> Float[np.ndarray, " 2"]:
    middle: np.ndarray = 0.5 * (wall.start + wall.end)[:2]
    return middle


def distances_from(
    anchors: Anchors, places: Float[np.ndarray, "n 2"]
) -> tuple[Float[np.ndarray, "points n"], Bool[np.ndarray, "points n"]]:
    """Distances of places from all wall points, and which points can scatter there."""
    apart = places - anchors.places[:, None]
    before = np.einsum("pnx,px->pn", apart, anchors.normals) > 0
    distance = np.linalg.norm(apart, axis=-1)
    return distance, before & (distance < anchors.farthest[:, None])


def score_indices(
    anchors: Anchors, places: Float[np.ndarray, "n 2"]
) -> tuple[Int[np.ndarray, "points n"], Bool[np.ndarray, "points n"]]:
    """Index the points' scores by their distances to places; tell which can scatter there."""
    distance, possible = distances_from(anchors, places)
    count = anchors.scores.shape[1]
    column = np.minimum(np.rint(distance / anchors.step).astype(np.intp), count - 1)
    return column + count * np.arange(len(distance))[:, None], possible


def score_at(
    anchors: Anchors, places: Float[np.ndarray, "n 2"]
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "points n"]]:
    """Sum of the points' scores at their distances to places; and each point's."""
    column, possible = score_indices(anchors, places)
    each = np.where(possible, anchors.scores.take(column), 0.0)
    return each.sum(axis=0), each


def most_lit(anchors: Anchors, each: Float[np.ndarray, "points n"]) -> Float[np.ndarray, " n"]:
    """Share of lit points of the wall of which most are, from the points' scores. [-]."""
    starts = np.flatnonzero(np.diff(anchors.wall, prepend=-1))
    counts = np.diff(starts, append=len(anchors.wall))
    lit = np.add.reduceat((each > np.log1p(LIT)).astype(np.intp), starts, axis=0)
    share: np.ndarray = (lit / counts[:, None]).max(axis=0)
    return share


def lit_points(anchors: Anchors, place: Float[np.ndarray, " 2"]) -> Bool[np.ndarray, " points"]:
    """Tell which points scatter what a user at a place sends."""
    lit: np.ndarray = score_at(anchors, place[None])[1][:, 0] > np.log1p(LIT)
    return lit
