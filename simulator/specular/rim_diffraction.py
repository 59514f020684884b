r"""Physical optics of a flat mirror as a sum round its rim: what of a mirrored wave it returns.

Kirchhoff's integral over an opening between a source and a receiver is a wave straight through it,
where it leads through, and a wave from the rim (A. Rubinowicz, "Die Beugungswelle in der
Kirchhoffschen Theorie der Beugungserscheinungen", Ann. Phys. 53 (1917) 257). For a flat mirror the
source is the antenna's image, and :math:`\cos\theta_i + \cos\theta_s` of physical optics is just
Kirchhoff's factor. With the azimuth :math:`\vartheta` of the rim's places about the straight line
of length L, the ways s and r over them, and the angle :math:`\gamma` by which these turn,

.. math:: F = \frac{1}{2\pi} \oint \left[1 - \frac{1 + \cos\gamma}{2} e^{-jk(s + r - L)}\right]
              d\vartheta

is the field over that of an endless mirror. The one under the integral counts whether the line
leads through; it takes away the rim wave's pole there, so that F is continuous: 1 far inside, one
half on the edge, and the side lobes of the plate where nothing is reflected specularly.
"""

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int
from scipy.constants import speed_of_light

from estimator.compute.engine import thread_count
from simulator.numerics.nufft_sum import FrequencySum, chebyshev_nodes, nodes_needed

PIECE_PHASE = 0.1
"""How much the phase bends over a piece of the rim, at most: what its mean slope leaves of that, a
twelfth, is a hundredth of the rim wave. [rad]"""

MOST_PIECES = 2_000
"""Pieces of one edge, at most. [-]"""

ACCURACY = 1e-4
"""Error of a piece's phase slope, interpolated over the band. [-]"""

NEAR = 1.5
"""Distance of a piece's middle from the rim's place nearest to the straight line, over its length,
below which its azimuth is taken from its middle. [-]"""

STEEPEST = 50.0
"""Azimuth of a near piece, at most: beyond, the line passes within a fiftieth of it, and what the
piece counts for is below 1e-3. [rad]"""


def rim_factor(
    sources: Float[np.ndarray, "links 3"],
    receivers: Float[np.ndarray, "links 3"],
    corners: Float[np.ndarray, "links corners 3"],
    frequencies: Float[np.ndarray, " freqs"],
) -> Complex[np.ndarray, "links freqs"]:
    """Return what flat openings let through, over what would come straight with nothing around.

    Parameters
    ----------
    sources, receivers
        On either side of the openings' planes, pairwise. [m]
    corners
        Of one flat opening for each link, in order around it, either way round; corners may be
        repeated, and all be one: then nothing comes through. [m]
    frequencies
        Uniform grid. [Hz]
    """
    factor = np.zeros((len(sources), frequencies.size), dtype=np.complex128)
    counts = _pieces(sources, receivers, corners, float(frequencies[-1]))
    if not counts.any():
        return factor
    rim = _cut(corners, counts)
    axis = receivers - sources
    length = np.sqrt(np.einsum("lx,lx->l", axis, axis))
    axis = axis / length[:, None]
    pieces = _pieces_of(sources, receivers, axis, length, rim)
    # In the sense in which the opening is gone round, seen along the line.
    sense = np.sign(np.einsum("lx,lx->l", _area(corners), axis))
    start, stop = float(frequencies[0]), float(frequencies[-1])
    spread = float(np.abs(pieces.slopes).max())
    nodes = chebyshev_nodes(start, stop, nodes_needed(spread, stop - start, accuracy=ACCURACY))
    total = FrequencySum(frequencies, nodes)

    def one(link: int) -> None:
        turns = pieces.turns[link]
        wave = total(
            pieces.delays[link],
            turns * pieces.oblique[link] * np.sinc(nodes[:, None] * pieces.slopes[link]),
        )
        factor[link] = sense[link] * (turns.sum() - wave) / (2 * math.pi)

    with ThreadPoolExecutor(thread_count()) as pool:  # each link is summed by one thread
        list(pool.map(one, range(len(sources))))
    return factor


@dataclass(frozen=True)
class _RimPieces:
    turns: Float[np.ndarray, "links pieces"]  # azimuths about the straight line [rad]
    oblique: Float[np.ndarray, "links pieces"]  # Kirchhoff's factor [-]
    delays: Float[np.ndarray, "links pieces"]  # of ways over them, beyond the straight one [s]
    slopes: Float[np.ndarray, "links pieces"]  # difference of these from end to end [s]


def _pieces(
    sources: Float[np.ndarray, "links 3"],
    receivers: Float[np.ndarray, "links 3"],
    corners: Float[np.ndarray, "links corners 3"],
    highest: float,
) -> Int[np.ndarray, " edges"]:
    """Choose into how many pieces each edge is cut: as many for all links."""
    along = np.roll(corners, -1, axis=1) - corners
    squared = np.einsum("lcx,lcx->lc", along, along)
    bend = np.zeros(squared.shape)
    for ends in (sources, receivers):
        towards = ends[:, None] - corners
        share = np.einsum("lcx,lcx->lc", towards, along) / np.maximum(squared, 1e-30)
        nearest = towards - np.clip(share, 0.0, 1.0)[..., None] * along
        bend += 0.5 / np.sqrt(np.maximum(np.einsum("lcx,lcx->lc", nearest, nearest), 1e-12))
    needed = np.sqrt(squared * bend * (2 * math.pi * highest / speed_of_light / PIECE_PHASE))
    counts: Int[np.ndarray, " edges"] = np.ceil(needed.max(axis=0)).astype(np.int64)
    return np.asarray(np.minimum(counts, MOST_PIECES))


def _cut(
    corners: Float[np.ndarray, "links corners 3"], counts: Int[np.ndarray, " edges"]
) -> Float[np.ndarray, "links pieces 3"]:
    """Return where the pieces of rims begin."""
    along = np.roll(corners, -1, axis=1) - corners
    return np.concatenate(
        [
            corners[:, edge, None] + (np.arange(count) / count)[:, None] * along[:, edge, None]
            for edge, count in enumerate(counts.tolist())
            if count
        ],
        axis=1,
    )


def _pieces_of(
    sources: Float[np.ndarray, "links 3"],
    receivers: Float[np.ndarray, "links 3"],
    axis: Float[np.ndarray, "links 3"],
    length: Float[np.ndarray, " links"],
    rim: Float[np.ndarray, "links pieces 3"],
) -> _RimPieces:
    after = np.roll(rim, -1, axis=1)
    middle = (rim + after) / 2
    first, last, off = (
        _off_line(points - sources[:, None], axis) for points in (rim, after, middle)
    )
    swept = np.einsum("lpx,lx->lp", np.cross(first, last), axis)
    turns = np.arctan2(swept, np.einsum("lpx,lpx->lp", first, last))
    # Next to the line the azimuth runs off while the integrand vanishes as the distance squared:
    # their product is smooth, and the middle's azimuth per length stands for the piece.
    along = last - first
    near = np.abs(np.einsum("lpx,lpx->lp", off, along)) <= NEAR * np.einsum(
        "lpx,lpx->lp", along, along
    )
    squared = np.einsum("lpx,lpx->lp", off, off)
    beside = np.divide(swept, squared, out=np.zeros_like(swept), where=squared > 0)
    turns = np.where(near, np.clip(beside, -STEEPEST, STEEPEST), turns)
    s, r = (np.linalg.norm(ends[:, None] - middle, axis=-1) for ends in (sources, receivers))
    turned = (length[:, None] ** 2 - s**2 - r**2) / (2 * s * r)
    # s + r - L without the difference of large numbers.
    forward = np.einsum("lpx,lx->lp", middle - sources[:, None], axis)
    longer = squared / (s + forward) + squared / (r + (length[:, None] - forward))
    beyond = forward * (length[:, None] - forward) <= 0
    longer = np.where(beyond, s + r - length[:, None], longer)
    ends = sum(np.linalg.norm(place[:, None] - rim, axis=-1) for place in (sources, receivers))
    slopes = np.roll(ends, -1, axis=1) - ends
    return _RimPieces(
        turns,
        np.clip(0.5 * (1 + turned), 0.0, 1.0),
        longer / speed_of_light,
        slopes / speed_of_light,
    )


def _off_line(
    points: Float[np.ndarray, "links pieces 3"], axis: Float[np.ndarray, "links 3"]
) -> Float[np.ndarray, "links pieces 3"]:
    """Return the part of vectors across an axis."""
    along = np.einsum("lpx,lx->lp", points, axis)
    return np.asarray(points - along[..., None] * axis[:, None])


def _area(corners: Float[np.ndarray, "links corners 3"]) -> Float[np.ndarray, "links 3"]:
    """Return the vector area of polygons [m²]."""
    spokes = corners - corners[:, :1]
    doubled = np.cross(spokes, np.roll(spokes, -1, axis=1)).sum(axis=1)
    return np.asarray(doubled / 2)
