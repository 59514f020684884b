r"""A wall's plane below the resolution cell, and how far it is seen to extend.

As for a line (:mod:`estimator.walls.line_fit_image`) the magnitude of the image summed over the
plane,

.. math:: J(a, b, \rho) = \sum_i |I(p_i + (\rho + a s_i + b t_i)\, n)| ,

is maximised over two tilts and the offset. Each point's magnitude is sampled along the normal
and replaced by the parabola that fits best over most of a cell; the sum of parabolas is a
paraboloid in the three unknowns, and its maximum follows in closed
form. Off the plane the samples are taken along each resolution cell's own oblique axis, not
along n: otherwise every change of the brightness along the wall would shift the maximum. The
covariance is the cluster-robust one ("sandwich") over tiles of the wall with independent speckle.
"""

from dataclasses import dataclass, field, replace

import numpy as np
import scipy.ndimage
from jaxtyping import Float
from scipy.spatial import ConvexHull, QhullError
from scipy.special import gammaincc

from estimator.array.resolution_cell import Resolution
from estimator.geometry.wall_3d import PlaneWall, within
from estimator.imaging.focusing import Focus
from estimator.imaging.peak_detection import DYNAMIC_RANGE, mean_background

SUMMIT = 0.6
"""Half the width over which a parabola is fitted: the main lobe, sin x/x in magnitude, departs from
the best one by 1 % of its peak there. [cells]"""
FIRST_WIDTH = 1.5
"""Half the width of the first search, by a grid: what consensus leaves is within it. [cells]"""
GRID = np.linspace(-1.0, 1.0, 9)
"""Tilts and offsets of that search, at the edges: a quarter of a cell apart, within the summit.
[cells]"""
DEPTHS = 9
"""Samples of a parabola; the first search has three times as many. [-]"""
CELLS_CUT = 1.5
"""Cells left out around the rim, whose sidelobes lean: the main lobe of sin x/x ends at 1, and its
first sidelobe, −13 dB, peaks at 1.43. [cells]"""
MOST_CUT = 0.2
"""Most that is left out of a small wall at each side, over its least extent: a third of its area is
left at least. [-]"""
FEWEST_POINTS = 9
"""Points on a plane that three unknowns are fitted to: each counts three times. [-]"""
MOST_POINTS = 3000
"""Points on the plane that are focused: more add time, but no cells. [-]"""
UPRIGHT = 1e-6
"""Sine of a normal's angle from the vertical below which no horizontal axis is told: rounding.
[-]"""
SPACING = 0.5
"""Distance of places on a plane: two a cell sample the intensity as the sampling theorem asks.
[cells]"""
LEAST_EXTENT = 1e-6
"""Least extent of the places on a plane that is divided by: a single row has none. [m]"""
ROUNDS = 3
"""Paraboloids fitted one after the other, each about the summit of the one before. [-]"""
LEAN = np.array([0.01, 0.01, 0.005])
"""Deviations of the edges by the tilts, and of the offset, that no average over the wall takes
away: cells have sidelobes on other parts of the wall, which are brighter or darker. Under a beam of
18° on a wall at 1.65 m and 25°, speckle in closed form let expect a turn of 0.026°, and 0.030° was
found in the mean over six realisations (0.01 cells at the edges), and 0.004 cells of offset.
[cells]"""
CELLS_PER_TILE = 4.0
"""Side of a tile whose speckle counts as independent of the others'. [cells]"""
TILES = (3, 8)
"""Fewest and most tiles along each axis: fewer leave no freedom beside three unknowns, more add no
precision to a covariance. [-]"""
BESIDE = np.array([-12.0, -10.0, -8.0, -6.0, 6.0, 8.0, 10.0, 12.0])
"""Parallel planes that tell the local background. [cells]"""
CONTRAST = 4.0
"""Smoothed intensity over the local background's that counts as wall: the mean over nine
half-cell pixels, 2 to 3 independent ones, of pure background exceeds it once in a thousand; and
a wall must hang together over many. [-]"""
SMOOTHED = 3
"""Half-cell pixels along either axis that are averaged before :data:`CONTRAST`. [-]"""
FARTHEST = 2.5
"""Distance to which a plane is followed, over that of its farthest known corner, for time. With
half and twice of it the answers in two rooms in space are the same (``python -m
validation.experiments.thresholds space``). [-]"""
MOST_STEPS = 150
"""Steps of the grid on which it is followed, on either side, for time: 90 000 places. They are half
a cell (:data:`SPACING`) for arrays of up to some 23 λ: :data:`FARTHEST` times its distance are
5 D/λ cells λR/2D, which the survey's taper widens 1.54 times. Of larger arrays they are longer.
[-]"""
MOST_CORNERS = 8
"""Corners of the polygon that is reported: where a rectangular wall and the imaged sector, two
convex quadrilaterals, overlap, they share one of at most eight corners. [-]"""
FEWEST_CELLS = 12.0
"""Smallest area of a wall: independent cells in which background alone passes :data:`CONTRAST`
together with a probability of e⁻⁴⁸. [cells²]"""
LEAST_LENGTH = FEWEST_CELLS / 4
"""Least extent of a wall along either axis. [cells]"""


@dataclass(frozen=True, kw_only=True)
class FittedPlane:
    """A polygon in the array's frame, with the statistics of its plane."""

    wall: PlaneWall
    level: float  # mean intensity on it [-]
    background: float  # mean intensity of parallel planes beside it [-]
    area: float  # that is seen [cells]
    confidence: float  # one minus the probability that background alone does this
    orders: Float[np.ndarray, " orders"] = field(default_factory=lambda: np.ones(1))
    """How probable it is that it stands there, or farther by c/2Δf, 2 c/2Δf, ... [-]"""


def plane_axes(normal: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "2 3"]:
    """Return a horizontal axis in a plane and the one across it; their product is the normal."""
    first = np.cross([0.0, 0.0, 1.0], normal)
    if np.linalg.norm(first) < UPRIGHT:
        first = np.array([1.0, 0.0, 0.0])
    first = first - (first @ normal) * normal
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])


def towards_array(
    centre: Float[np.ndarray, " 3"], normal: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, " 3"]:
    """Turn a plane's normal to the array's side, the origin's."""
    return normal if normal @ centre < 0 else -normal


def refine_plane(focus: Focus, wall: PlaneWall, resolution: Resolution) -> PlaneWall | None:
    """Move a plane to the maximum of J over its polygon.

    Parameters
    ----------
    focus
        Focuses the echo on points.
    wall
        Good to about a cell.
    resolution
        Of what is focused.

    Returns
    -------
    The plane with its covariance; ``None`` if J has no maximum nearby.
    """
    for width in (FIRST_WIDTH, *[SUMMIT] * ROUNDS):
        cell = float(resolution.cell(wall.centre, wall.normal))
        places, points = points_on(wall, resolution)
        if len(points) < FEWEST_POINTS:
            return None
        scale = np.array([*(1 / np.maximum(np.abs(places).max(axis=0), LEAST_EXTENT)), 1.0]) * cell
        depths = width * cell * np.linspace(-1, 1, DEPTHS if width <= SUMMIT else 3 * DEPTHS)
        off = _conjugate(points, wall.normal, resolution)
        magnitude = np.abs(focus(points[:, None] + depths[:, None] * off[:, None]))
        rise = np.column_stack([places, np.ones(len(places))]) * scale
        if width > SUMMIT:
            change = _highest(magnitude, depths, rise)
            wall = wall.moved(change * scale)
            continue
        basis = np.stack([np.ones_like(depths), depths, depths**2 / 2], axis=-1)
        _, slope, bend = np.einsum("id,cd->ci", magnitude, np.linalg.pinv(basis))
        hessian = np.einsum("i,ix,iy->xy", bend, rise, rise)
        if np.linalg.eigvalsh(hessian)[-1] >= 0:
            return None
        step = np.clip(-np.linalg.solve(hessian, (slope[:, None] * rise).sum(axis=0)), -1.0, 1.0)
        scores = slope[:, None] * rise + bend[:, None] * rise * (rise @ step)[:, None]
        covariance = _sandwich(hessian, scores, places, wall, resolution)
        covariance += np.diag(LEAN**2)
        wall = replace(wall.moved(step * scale), covariance=covariance * np.outer(scale, scale))
    return wall


def _conjugate(
    points: Float[np.ndarray, "points 3"], normal: Float[np.ndarray, " 3"], resolution: Resolution
) -> Float[np.ndarray, "points 3"]:
    r"""Return the directions off a plane along which a cell stays over the same part of it. [-].

    A resolution cell is longer across the ray than along it, so it is oblique to a plane at oblique
    incidence: a cell displaced along the normal n is centred over another part of the plane. Where
    that part is brighter, the maximum of the magnitude lies off the plane; with an antenna beam,
    whose brightness decreases on all sides, the whole fitted plane is then tilted. The direction
    :math:`C n / (n^T C n)`, with the cell's squared half widths C, avoids both errors.
    """
    reach = np.linalg.norm(points, axis=-1, keepdims=True)
    ray = points / reach
    along = (ray @ normal)[:, None] * ray
    off = resolution.along_ray**2 * along + (resolution.across_ray * reach) ** 2 * (normal - along)
    return np.asarray(off / (off @ normal)[:, None])


def points_on(
    wall: PlaneWall, resolution: Resolution
) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, "n 3"]]:
    """Sample a wall's polygon at half a cell, counted from its centre. [m]."""
    corners = (wall.corners - wall.centre) @ wall.axes.T
    low, high = corners.min(axis=0), corners.max(axis=0)
    step = SPACING * np.array([float(resolution.cell(wall.centre, axis)) for axis in wall.axes])
    step *= max(1.0, np.sqrt(np.prod((high - low) / step) / MOST_POINTS))
    lines = [np.arange(a + s / 2, b, s) for a, b, s in zip(low, high, step, strict=True)]
    places = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)
    points = wall.centre + places @ wall.axes
    # Without the rim: the oblique sidelobes of the wall's ends would tilt the plane.
    rim = min(CELLS_CUT * float(np.max(2 * step)), MOST_CUT * float((high - low).min()))
    inside = within(points, wall, margin=-rim)
    return places[inside], points[inside]


def _highest(
    magnitude: Float[np.ndarray, "points depths"],
    depths: Float[np.ndarray, " depths"],
    rise: Float[np.ndarray, "points 3"],
) -> Float[np.ndarray, " 3"]:
    """Return the best of a grid of changes (in units of a cell at the edges)."""
    step = depths[1] - depths[0]
    best = (-np.inf, np.zeros(3))
    rows = np.arange(len(magnitude))
    for change in np.stack(np.meshgrid(GRID, GRID, GRID, indexing="ij"), -1).reshape(-1, 3):
        index = np.round((rise @ change - depths[0]) / step).astype(int)
        total = float(magnitude[rows, np.clip(index, 0, depths.size - 1)].sum())
        if total > best[0]:
            best = total, change
    return best[1]


def _sandwich(
    hessian: Float[np.ndarray, "3 3"],
    scores: Float[np.ndarray, "points 3"],
    places: Float[np.ndarray, "points 2"],
    wall: PlaneWall,
    resolution: Resolution,
) -> Float[np.ndarray, "3 3"]:
    sizes = np.ptp(places, axis=0)
    cells = [float(resolution.cell(wall.centre, axis)) for axis in wall.axes]
    index = np.zeros(len(places), dtype=np.int64)
    for column, size, cell in zip(places.T, sizes, cells, strict=True):
        count = int(np.clip(size / (CELLS_PER_TILE * cell), *TILES))
        share = (column - column.min()) / max(size, 1e-9)
        index = count * index + np.minimum((share * count).astype(np.int64), count - 1)
    tiles = np.unique(index, return_inverse=True)[1]
    sums = np.stack([np.bincount(tiles, weights=column) for column in scores.T], axis=-1)
    bread = np.linalg.inv(hessian)
    freedom = len(sums) / max(len(sums) - 3, 1)
    return np.asarray(freedom * bread @ (sums.T @ sums) @ bread)


def extent_of_plane(
    focus: Focus,
    wall: PlaneWall,
    resolution: Resolution,
    *,
    reach: tuple[float, float],
    sine: float,
    peak: float,
    trials: int,
) -> FittedPlane | None:
    """Follow a plane from where it is known as far as it is seen.

    Parameters
    ----------
    focus
        Focuses the echo, with low sidelobes.
    wall
        The plane and a part of its extent.
    resolution
        Of what is focused.
    reach
        Nearest and farthest distance that is imaged. [m]
    sine
        Largest direction cosine that is imaged, along x and z. [-]
    peak
        Highest intensity in the image: what is far below it may be its sidelobe. [-]
    trials
        How many planes were looked at, for the confidence.
    """
    cells = np.array([float(resolution.cell(wall.centre, axis)) for axis in wall.axes])
    across = float(resolution.cell(wall.centre, wall.normal))
    farthest = min(reach[1], FARTHEST * float(np.linalg.norm(wall.corners, axis=1).max()))
    step = np.maximum(SPACING * cells, farthest / MOST_STEPS)
    lines = [np.arange(-int(farthest / s), int(farthest / s) + 1) * s for s in step]
    places = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)
    points = wall.centre + places @ wall.axes
    distance = np.linalg.norm(points, axis=-1)
    shown = (distance > reach[0]) & (distance < farthest) & (points[..., 1] > 0)
    shown &= np.all(np.abs(points[..., ::2]) < sine * distance[..., None], axis=-1)
    if not shown.any():
        return None
    offsets = np.concatenate([[0.0], BESIDE * across])
    columns = points[shown][:, None, :] + offsets[:, None] * wall.normal
    focused = np.abs(focus(columns)) ** 2
    stacked = np.zeros((offsets.size, *shown.shape))
    stacked[:, shown] = focused.T
    covered = scipy.ndimage.uniform_filter(shown.astype(float), size=SMOOTHED, mode="constant")
    smooth = scipy.ndimage.uniform_filter(stacked, size=(1, SMOOTHED, SMOOTHED), mode="constant")
    smooth = smooth / np.maximum(covered, 1e-9)
    background = np.median(smooth[1:], axis=0)
    floor = max(DYNAMIC_RANGE * peak, float(np.median(background[shown])))
    bright = shown & (smooth[0] > CONTRAST * np.maximum(background, floor / CONTRAST))
    patches = scipy.ndimage.label(bright, structure=np.ones((3, 3)))[0]
    known = within(points[shown], wall)
    votes = np.bincount(patches[shown][known], minlength=patches.max() + 1)
    if patches.max() == 0 or votes[1:].max(initial=0) == 0:
        return None
    seen = patches == 1 + int(np.argmax(votes[1:]))
    corners = _polygon(places[seen], step)
    area = float(seen.sum() * np.prod(step) / np.prod(cells))
    lengths = np.ptp(corners, axis=0) / cells
    if area < FEWEST_CELLS or lengths.min() < LEAST_LENGTH:
        return None
    centre = wall.centre + places[seen].mean(axis=0) @ wall.axes
    level = float(stacked[0][seen].mean())
    beside = mean_background(stacked[1:, seen])
    false = float(gammaincc(area, area * level / max(beside, 1e-300))) * trials
    moved = PlaneWall(
        corners=wall.centre + corners @ wall.axes,
        centre=centre,
        axes=wall.axes,
        covariance=_carried(wall, centre),
    )
    return FittedPlane(
        wall=moved,
        level=level,
        background=beside,
        area=area,
        confidence=float(np.clip(1 - false, 0.0, 1.0)),
    )


def _carried(wall: PlaneWall, centre: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    """Carry the covariance to another centre: the offset there contains the tilts' lever."""
    lever = wall.axes @ (centre - wall.centre)
    change = np.eye(3)
    change[2, :2] = lever
    return np.asarray(change @ wall.covariance @ change.T)


def _polygon(
    places: Float[np.ndarray, "n 2"], step: Float[np.ndarray, " 2"]
) -> Float[np.ndarray, "corners 2"]:
    """Return the convex hull of pixels, less its least corners where there are too many."""
    half = 0.5 * step * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
    spread = (places[:, None, :] + half).reshape(-1, 2)
    try:
        corners = spread[ConvexHull(spread).vertices]
    except QhullError:
        return np.asarray(spread[:4])
    while len(corners) > MOST_CORNERS:
        before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
        one, two = corners - before, after - before
        areas = np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])
        corners = np.delete(corners, int(np.argmin(areas)), axis=0)
    return np.asarray(corners)
