r"""The box that holds an echo's energy, and so is to be imaged: a coarse-to-fine search.

The range profiles of single positions tell how far away anything is. Within that, small parts of
the aperture and of the band are focused on a coarse grid, and their intensities added: a part that
is :math:`n` times as small resolves cells :math:`n` times as large, so that nothing falls between
the points of the grid. The box around what is bright is looked at again on a finer one.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator import false_alarm
from estimator.array.windows import SURVEY_TAPER, frequency_taper, survey_weights
from estimator.imaging.backprojection import Focuser, focus, prepare
from estimator.imaging.peak_detection import mean_background
from estimator.imaging.range_compression import range_profiles, repeated, unambiguous_path
from estimator.measurement.model import Echo

MOST_CHANNELS = 400
"""Positions whose range profiles, and whose directions to a point, are looked at. [-]"""
FAINTEST_RANGE = 1e-3
"""Intensity over the highest of all profiles from which a range holds something: −30 dB, what an
image shows. [-]"""
FAINTEST = 1e-3
"""The same of the coarse map. [-]"""
CONTRAST = 4.0
"""Intensity over the coarse map's background, which is a mean over the parts of the aperture and
varies by less than itself. [-]"""
STEPS = {2: 120, 3: 22}
"""Points of the coarse grid along each axis of a plane or of a volume: some 10 000 points. [-]"""
ROUNDS = 3
"""Grids, each within what the one before it showed. [-]"""
MOST_PARTS = 6
"""Parts of the aperture along an axis; more are not needed, since each round magnifies. [-]"""
MOST_BANDS = 8
"""Parts of the band. [-]"""
MOST_SUMMED = 9
"""Parts of the aperture that are focused: of more, some all over it. [-]"""
FEWEST = 2
"""Frequencies of a part of the band. [-]"""
MOST_COARSE = 3e8
"""Points times positions times parts of the band that a coarse map sums, some seconds of the
processor. Of larger parts of the aperture random positions are taken: where a map has 10 000
points, nine parts and eight bands, 400 of each, whose random sidelobes are at 1/400, −26 dB. [-]"""
TOLD = 0.5
"""Part of the unambiguous range within which everything lies, if the profiles tell ranges but for
the number of periods: of a scene that fills less than half of a period, the longest empty part of
it is longer than the scene, and tells where it begins. [-]"""
SHARPER = 1.5
"""Intensity of a peak over that of nearer periods from which a farther one is taken: a point out of
focus loses more, and where the curvature tells nothing both are equal. [-]"""
SMALLEST = 8.0
"""Least extent of a region along each axis, in cells: what is around a point shows that it is one.
[cells]"""


@dataclass(frozen=True, kw_only=True)
class Box:
    """A part of space, in the frame of the echo."""

    low: Float[np.ndarray, " 3"]  # [m]
    high: Float[np.ndarray, " 3"]  # [m]

    @property
    def middle(self) -> Float[np.ndarray, " 3"]:
        """Centre. [m]."""
        return np.asarray(0.5 * (self.low + self.high))


def cells_at(echo: Echo, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    r"""Return the resolution at points along x, y and z, of an aperture of any shape. [m].

    :math:`2 \pi / \Delta K_i`, with the extent of the wave vectors
    :math:`K = (2 \pi f / c)(\hat s_t + \hat s_r)` to all positions at both ends of the band: λ/2D
    times the range, c/2B, or the aperture's angle in the near field, whichever resolves.
    """
    chosen = evenly_chosen(len(echo.positions))
    ends = [echo.positions[chosen]]
    if echo.transmit_positions is not None:
        ends.append(echo.transmit_positions[chosen])
    rays = []
    for end in ends:
        ray = points[:, None] - end
        rays.append(ray / np.maximum(np.linalg.norm(ray, axis=-1, keepdims=True), 1e-12))
    total = sum(rays) if len(rays) > 1 else 2 * rays[0]
    waves = 2 * np.pi / speed_of_light * np.array([echo.frequencies[0], echo.frequencies[-1]])
    vectors = (waves[:, None, None, None] * total).transpose(1, 0, 2, 3).reshape(len(points), -1, 3)
    return np.asarray(2 * np.pi / np.maximum(np.ptp(vectors, axis=1), 1e-9))


def evenly_chosen(count: int, most: int = MOST_CHANNELS) -> np.ndarray:
    """Choose some of many channels, all over the array."""
    if count <= most:
        return np.arange(count)
    return np.sort(np.random.default_rng(0).choice(count, most, replace=False))


def middles(echo: Echo) -> Float[np.ndarray, "positions 3"]:
    """Return the phase centres: between both ends, where these stand apart. [m]."""
    if echo.transmit_positions is None:
        return echo.positions
    return np.asarray(0.5 * (echo.positions + echo.transmit_positions))


def farthest_told(echo: Echo, *, ahead: bool) -> float:
    r"""Return the distance up to which an image is unambiguous. [m].

    The unambiguous range c/2Δf; or, where the frequencies are few, the distance up to which the
    aperture alone resolves depths, :math:`\lambda / 2(1 - \cos \theta)` for the angle θ to its end,
    twice as finely as that range.
    """
    unambiguous = unambiguous_path(echo.frequencies) / 2
    share = speed_of_light / float(echo.frequencies.mean()) / unambiguous
    if not ahead or share >= 1:
        return unambiguous
    half = 0.5 * float(np.ptp(middles(echo), axis=0).max())
    return max(unambiguous, half / float(np.tan(np.arccos(1 - share))))


def focused(
    echo: Echo, points: Float[np.ndarray, "*n 3"], weights: Float[np.ndarray, "positions freqs"]
) -> Complex[np.ndarray, "*n"]:
    """Back-project onto points also beyond the unambiguous range, which repeats there."""
    return focus(focuser_for(echo, points, weights), points)


def focuser_for(
    echo: Echo, points: Float[np.ndarray, "*n 3"], weights: Float[np.ndarray, "positions freqs"]
) -> Focuser:
    """Prepare range profiles to be focused, several times, on points no farther than these."""
    profiles = range_profiles(echo, weights=weights)
    longest = 1.001 * _longest(echo, points) + 2 * profiles.cell
    return prepare(repeated(profiles, longest))


def energy_box(
    echo: Echo,
    *,
    ahead: bool,
    flat: bool,
    sine: float = 1.0,
    nearest: float | None = None,
    farthest: float | None = None,
) -> Box:
    """Find the box that holds what an echo shows.

    Parameters
    ----------
    echo
        In the frame of its image.
    ahead
        Whether only what lies at y > 0 is looked at.
    flat
        Whether only what lies at z = 0 is.
    sine
        Of the angle off the array's normal, beyond its edges, up to which is looked. [-]
    nearest, farthest
        Distances from the positions; ``None``: chosen by what the range profiles show. [m]
    """
    limit = farthest_told(echo, ahead=ahead)
    unambiguous = unambiguous_path(echo.frequencies) / 2
    near, reach, box = _within_range(echo, nearest, farthest)

    def shell(first: float, last: float) -> Box:
        box = _around(middles(echo), np.array([last]))
        return _magnified(echo, _seen(echo, first, box, ahead, flat, sine), flat=flat)

    if nearest is not None or farthest is not None:
        if max(nearest or 0.0, farthest or limit) > unambiguous:
            last = farthest or max(limit, (nearest or 0.0) + unambiguous)
            return shell(nearest or 0.0, last)
        return _magnified(echo, _seen(echo, near, box, ahead, flat, sine), flat=flat)
    if limit <= unambiguous:
        return _magnified(echo, _seen(echo, near, box, ahead, flat, sine), flat=flat)
    if reach - near > TOLD * unambiguous:  # the aperture alone tells ranges
        return shell(0.0, limit)
    best, strongest = box, 0.0
    for period in range(int(np.ceil((limit - near) / unambiguous))):
        turns = period * unambiguous
        first = box if not period else _around(middles(echo), np.array([reach + turns]))
        found = _magnified(echo, _seen(echo, near + turns, first, ahead, flat, sine), flat=flat)
        peak = _peak(echo, found, flat)
        if peak > SHARPER * strongest:
            best, strongest = found, peak
    return best


def _seen(echo: Echo, near: float, box: Box, ahead: bool, flat: bool, sine: float) -> Box:
    """Cut what is not looked at from a box."""
    low, high = box.low.copy(), box.high.copy()
    if ahead:
        ends = middles(echo)
        beyond = sine * float(high[1] - ends[:, 1].max())
        for axis in (0, 2):
            low[axis] = max(low[axis], ends[:, axis].min() - beyond)
            high[axis] = min(high[axis], ends[:, axis].max() + beyond)
        shortest = speed_of_light / float(echo.frequencies[-1])
        low[1] = max(0.5 * shortest, near * np.sqrt(max(1 - sine**2, 0.0)) if sine < 1 else 0.0)
        high[1] = max(high[1], 2 * low[1])
    if flat:
        low[2] = high[2] = 0.0
    return Box(low=low, high=high)


def _peak(echo: Echo, box: Box, flat: bool) -> float:
    """Return the highest intensity in a box, focused with some of the positions. [-]."""
    axes = _axes(echo, box, flat)
    part = some_positions(echo, evenly_chosen(len(echo.positions)))
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return float((np.abs(focused(part, points, survey_weights(part))) ** 2).max())


def _around(ends: Float[np.ndarray, "positions 3"], last: Float[np.ndarray, " #positions"]) -> Box:
    """Return what all positions see up to their ranges; or any, where these do not meet."""
    box = Box(low=(ends - last[:, None]).max(axis=0), high=(ends + last[:, None]).min(axis=0))
    if np.any(box.high <= box.low):  # the energy of different positions is of different things
        reach = float(last.max())
        box = Box(low=(ends - reach).max(axis=0), high=(ends + reach).min(axis=0))
    if np.any(box.high <= box.low):
        box = Box(low=ends.min(axis=0) - reach, high=ends.max(axis=0) + reach)
    return box


def _within_range(
    echo: Echo, nearest: float | None, farthest: float | None
) -> tuple[float, float, Box]:
    """Return the ranges between which something is, and the box that all positions see. [m]."""
    chosen = evenly_chosen(len(echo.positions))
    part = some_positions(echo, chosen)
    taper = frequency_taper(echo.frequencies, SURVEY_TAPER)[None, :]
    profiles = range_profiles(part, weights=taper)
    intensity = np.abs(profiles.coefficients[..., 0]) ** 2
    unit = profiles.cell * profiles.passes / 2 if profiles.passes == 1 else profiles.cell / 2
    ranges = unit * np.arange(intensity.shape[1])
    limit = unambiguous_path(echo.frequencies) / 2
    floor = false_alarm.threshold(false_alarm.TARGET, cells=intensity.size)
    least = max(FAINTEST_RANGE * float(intensity.max()), floor * mean_background(intensity))
    allowed = (ranges >= (nearest or 0.0)) & (ranges <= (farthest or limit))
    if max(nearest or 0.0, farthest or 0.0) > limit:  # repeated: any range may be from there
        allowed = np.ones(ranges.shape, dtype=bool)
    holds = (intensity > least) & allowed
    if not holds.any():
        holds = np.broadcast_to(allowed, intensity.shape)
    last = ranges[intensity.shape[1] - 1 - np.argmax(holds[:, ::-1], axis=1)]
    shown = holds.any(axis=1)  # noise may hide from one position what others show
    last = np.where(shown, last, last[shown].max()) + 2 * unit
    last = np.minimum(last, min(farthest or limit, limit))
    box = _around(middles(part), last)
    return float(ranges[np.argmax(holds.any(axis=0))]), float(last.max()), box


def some_positions(echo: Echo, chosen: np.ndarray, band: slice = slice(None)) -> Echo:
    """Take a part of an echo's positions, and of its band."""
    apart = echo.transmit_positions
    return replace(
        echo,
        samples=echo.samples[chosen][:, band],
        positions=echo.positions[chosen],
        frequencies=echo.frequencies[band],
        transmit_positions=None if apart is None else apart[chosen],
    )


def _magnified(echo: Echo, box: Box, *, flat: bool) -> Box:
    for _ in range(ROUNDS):
        axes = _axes(echo, box, flat)
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        intensity = _coarse_map(echo, points, axes)
        least = max(FAINTEST * float(intensity.max()), CONTRAST * mean_background(intensity))
        bright = intensity > min(least, 0.5 * float(intensity.max()))
        low, high = box.low.copy(), box.high.copy()
        for axis, places in enumerate(axes):
            if places.size < 2:
                continue
            other = tuple(i for i in range(3) if i != axis)
            used = np.flatnonzero(bright.any(axis=other))
            step = places[1] - places[0]
            low[axis] = max(low[axis], places[used[0]] - 1.5 * step)
            high[axis] = min(high[axis], places[used[-1]] + 1.5 * step)
        shrunk = np.prod((high - low)[: 2 if flat else 3]) / np.prod(
            (box.high - box.low)[: 2 if flat else 3]
        )
        box = Box(low=low, high=high)
        if shrunk > 0.7:
            break
    return _widened(echo, box, flat)


def _widened(echo: Echo, box: Box, flat: bool) -> Box:
    """Leave room around what is seen: some cells."""
    least = SMALLEST * cells_at(echo, box.middle[None])[0]
    grow = np.maximum(0.5 * (least - (box.high - box.low)), 0.0)
    if flat:
        grow[2] = 0.0
    low, high = box.low - grow, box.high + grow
    if box.low[1] > 0:
        low[1] = max(low[1], 0.2 * box.low[1])
    return Box(low=low, high=high)


def _axes(echo: Echo, box: Box, flat: bool) -> list[np.ndarray]:
    steps = STEPS[2 if flat else 3]
    cells = cells_at(echo, box.middle[None])[0]
    axes = []
    for axis in range(3):
        size = float(box.high[axis] - box.low[axis])
        if flat and axis == 2:
            axes.append(np.array([box.low[2]]))
            continue
        count = int(np.clip(np.ceil(size / (0.4 * cells[axis])), 4, steps)) + 1
        axes.append(np.linspace(box.low[axis], box.high[axis], count))
    return axes


def _coarse_map(
    echo: Echo, points: Float[np.ndarray, "x y z 3"], axes: list[np.ndarray]
) -> Float[np.ndarray, "x y z"]:
    """Add the intensities of parts of aperture and band that resolve no finer than the grid."""
    steps = np.array([axis[1] - axis[0] if axis.size > 1 else 0.0 for axis in axes])
    cells = cells_at(echo, points[tuple(size // 2 for size in points.shape[:3])][None])[0]
    range_cell = speed_of_light / (2 * float(np.ptp(echo.frequencies)))
    parts = int(np.clip(np.ceil((steps / cells).max()), 1, MOST_PARTS))
    bands = int(np.clip(np.ceil(steps.max() / range_cell), 1, MOST_BANDS))
    bands = max(1, min(bands, echo.frequencies.size // FEWEST))
    total = np.zeros(points.shape[:-1])
    edges = np.linspace(0, echo.frequencies.size, bands + 1).astype(int)
    chosen = _parts(middles(echo), parts)
    most = max(MOST_CHANNELS, int(MOST_COARSE / (total.size * bands * len(chosen))))
    for members in chosen:
        kept = members[evenly_chosen(members.size, most)]
        for first, end in pairwise(edges):
            part = some_positions(echo, kept, slice(first, end))
            total += np.abs(focused(part, points, survey_weights(part))) ** 2
    return total


def _parts(positions: Float[np.ndarray, "positions 3"], count: int) -> list[np.ndarray]:
    """Split an aperture along its principal axes into parts of neighbours."""
    centred = positions - positions.mean(axis=0)
    along = centred @ np.linalg.svd(centred, full_matrices=False)[2].T
    index = np.zeros(len(positions), dtype=np.int64)
    extent = float(np.ptp(along[:, 0]))
    for column in along.T:
        size = float(np.ptp(column))
        pieces = max(1, round(count * size / max(extent, 1e-12)))
        share = (column - column.min()) / max(size, 1e-12)
        index = pieces * index + np.minimum((share * pieces).astype(np.int64), pieces - 1)
    parts = [np.flatnonzero(index == label) for label in np.unique(index)]
    parts = [part for part in parts if part.size > 1] or [np.arange(len(positions))]
    return [parts[i] for i in evenly_chosen(len(parts), MOST_SUMMED)]


def _longest(echo: Echo, points: Float[np.ndarray, "*n 3"]) -> float:
    """Bound the longest path to any point. [m]."""
    if not points.size:
        return 0.0
    flat = points.reshape(-1, 3)
    low, high = flat.min(axis=0), flat.max(axis=0)
    longest = 0.0
    for end in (echo.positions, echo.positions if _together(echo) else echo.transmit_positions):
        assert end is not None
        far = np.maximum(np.abs(high - end.min(axis=0)), np.abs(end.max(axis=0) - low))
        longest += float(np.linalg.norm(far))
    return longest


def _together(echo: Echo) -> bool:
    return echo.transmit_positions is None
