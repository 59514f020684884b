"""Parts of a linear array, and the sines on which their images are sampled.

See :mod:`estimator.imaging.polar_image`.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int
from scipy.constants import speed_of_light
from scipy.special import i0

from estimator.imaging.backprojection import FLAT, Focuser
from estimator.imaging.range_compression import CELLS_PER_SAMPLE

OVERSAMPLING = 1.3
"""Coarse sines over those that the bandwidth asks for: the transition of the interpolator. [-]"""
PARTS = (4, 8, 16, 32, 64)
"""Parts of the array among which the cheapest is chosen. [-]"""
OF_A_SUM = 1.5
"""Time to turn and add one part's image at a pixel, over that to add one channel. [-]"""
OF_A_TAP = 1 / 48
"""Time for one coarse sine in the matrix product, over that to add one channel. [-]"""
OF_A_CALL = 2e5
"""Time to start a part's kernels, over that to add one channel at one pixel. [-]"""
PROBES = 9
"""Sines at which the bandwidth of a part's image is looked up; it varies smoothly. [-]"""
COLUMNS = 128
"""Fine sines that are interpolated together, from the coarse ones about them. [-]"""


@dataclass(frozen=True, eq=False)
class PolarGrid:
    """Ranges from the array's centre, and sines off its normal towards its axis, at equal steps."""

    ranges: Float[np.ndarray, " ranges"]  # rising [m]
    sines: Float[np.ndarray, " sines"]


@dataclass(frozen=True, eq=False)
class Line:
    """A linear array whose channels are travelled once, or out and back."""

    centre: Float[np.ndarray, " 3"]  # where ranges are counted from [m]
    axis: Float[np.ndarray, " 3"]
    along: Float[np.ndarray, " channels"]  # [m]
    wavenumbers: Float[np.ndarray, " 3"]  # first, carrier's, last; of a length one way [rad/m]


@dataclass(frozen=True, eq=False)
class Plan:
    """Parts for a range of distances, with the step of the sines on which each is imaged."""

    edges: Int[np.ndarray, " edges"]  # the first channel of each part, and the one after the last
    centres: Float[np.ndarray, " parts"]  # along the array [m]
    steps: Float[np.ndarray, " parts"]
    taps: int  # half the coarse sines that a fine one is interpolated from
    sines: Float[np.ndarray, " fine"]

    @property
    def cost(self) -> float:
        """Work at a pixel, over that of one channel; less that of the calls. [-]."""
        columns = self.sines.size
        coarse = float(np.ptp(self.sines)) / self.steps + 2 * self.taps
        channels = np.diff(self.edges)
        together = np.minimum(coarse, COLUMNS * coarse / columns + 2 * self.taps)
        return float(np.sum(channels * coarse / columns + OF_A_SUM + OF_A_TAP * together))

    @cached_property
    def coarse(self) -> list[Float[np.ndarray, " coarse"]]:
        """The sines of each part's image, as far beyond the rim as the interpolator reaches."""
        low, span = self.sines[0], float(np.ptp(self.sines))
        return [
            low + step * np.arange(-self.taps, int(np.ceil(span / step)) + self.taps + 1)
            for step in self.steps
        ]

    @cached_property
    def interpolators(self) -> list[list[tuple[slice, slice, Float[np.ndarray, "coarse fine"]]]]:
        """For each part and some fine sines: the coarse ones about them, and their weights."""
        shape = kaiser_shape(self.taps, OVERSAMPLING)
        tap = np.arange(1 - self.taps, self.taps + 1)[:, None]
        every = []
        for coarse, step in zip(self.coarse, self.steps, strict=True):
            places = (self.sines - coarse[0]) / step
            nearest = np.clip(np.floor(places).astype(int) + tap, 0, coarse.size - 1)
            away = places - nearest
            window = i0(shape * np.sqrt(np.maximum(1 - (away / self.taps) ** 2, 0.0))) / i0(shape)
            weights = (np.sinc(away) * window).astype(np.float32)
            of_part = []
            for start in range(0, self.sines.size, COLUMNS):
                fine = slice(start, min(start + COLUMNS, self.sines.size))
                first, after = int(nearest[0, start]), int(nearest[-1, fine.stop - 1]) + 1
                matrix = np.zeros((after - first, fine.stop - start), dtype=np.float32)
                np.put_along_axis(matrix, nearest[:, fine] - first, weights[:, fine], axis=0)
                of_part.append((slice(first, after), fine, matrix))
            every.append(of_part)
        return every


def line_of(
    focuser: Focuser, centre: Float[np.ndarray, " 3"], axis: Float[np.ndarray, " 3"]
) -> Line | None:
    """Describe a linear array; ``None`` if it is none, or transmitters stand apart."""
    profiles = focuser.profiles
    if len(profiles.legs) > 1 or not len(focuser.legs[0].axes):
        return None
    offsets = profiles.legs[0] - centre
    along = offsets @ axis
    if np.abs(offsets - along[:, None] * axis).max() > FLAT or np.ptp(np.sign(np.diff(along))):
        return None  # no line, or not one after the other
    half = 0.5 * speed_of_light / profiles.cell / CELLS_PER_SAMPLE
    band = np.array([profiles.carrier - half, profiles.carrier, profiles.carrier + half])
    wavenumbers = 2 * np.pi * profiles.passes / speed_of_light * band
    return Line(centre=centre, axis=axis, along=along, wavenumbers=wavenumbers)


def kaiser_taps(error: float, oversampling: float) -> int:
    """Half the samples that an interpolator needs, after Kaiser's formula. [-]."""
    transition = 2 * np.pi * (1 - 1 / oversampling)
    return max(2, int(np.ceil((-20 * np.log10(error) - 8) / (2.285 * transition) / 2)))


def kaiser_shape(taps: int, oversampling: float) -> float:
    """Return the parameter of Kaiser's window over twice so many samples. [-]."""
    attenuation = 8 + 2.285 * 2 * np.pi * (1 - 1 / oversampling) * 2 * taps
    return float(0.1102 * max(attenuation - 8.7, 0.0))


def cheapest_plan(focuser: Focuser, line: Line, grid: PolarGrid, error: float) -> Plan | None:
    """Choose parts for a grid whose ranges are treated alike; ``None``: exact sums are as fast."""
    best, least = None, float(len(line.along))
    for count in PARTS if error > 0 else ():
        if 2 * count > len(line.along):
            break
        edges = np.linspace(0, len(line.along), count + 1).round().astype(int)
        centres = np.add.reduceat(line.along, edges[:-1]) / np.diff(edges)
        steps = _steps(line, grid, edges, centres)
        plan = Plan(edges, centres, steps, kaiser_taps(error, OVERSAMPLING), grid.sines)
        cost = plan.cost + count * OF_A_CALL / (grid.sines.size * grid.ranges.size)
        if cost < least and _is_readable(focuser, line, grid, plan):
            best, least = plan, cost
        elif best is not None:
            break  # ever more parts cost ever more
    return best


def _steps(
    line: Line,
    grid: PolarGrid,
    edges: Int[np.ndarray, " edges"],
    centres: Float[np.ndarray, " parts"],
) -> Float[np.ndarray, " parts"]:
    """Return the step of the sines that sample each part's image."""
    ranges = grid.ranges[[0, -1]]
    sines = np.linspace(grid.sines[0], grid.sines[-1], PROBES)
    own = line.wavenumbers[1] * _slopes(ranges, sines, centres)
    ends = (line.along[edges[:-1]], line.along[edges[1:] - 1])
    at_ends = [_slopes(ranges, sines, end) for end in ends]
    beside = [k * slopes - own for k in line.wavenumbers[[0, 2]] for slopes in at_ends]
    return np.asarray(np.pi / (np.abs(beside).max(axis=(0, 2, 3)) * OVERSAMPLING))


def _slopes(
    ranges: Float[np.ndarray, " ranges"],
    sines: Float[np.ndarray, " probes"],
    places: Float[np.ndarray, " parts"],
) -> Float[np.ndarray, "parts ranges probes"]:
    """Return how lengths from places along the line change with the sine. [m]."""
    reach, place = ranges[:, None], places[:, None, None]
    length = np.sqrt(np.maximum(reach**2 - 2 * reach * sines * place + place**2, FLAT**2))
    return np.asarray(-reach * place / length)


def _is_readable(focuser: Focuser, line: Line, grid: PolarGrid, plan: Plan) -> bool:
    """Tell whether all paths beyond the rim have a length, and an unambiguous one."""
    rim = float(np.abs(grid.sines).max() + (plan.taps + 1) * plan.steps.max())
    reach = float(np.abs(line.along).max())
    near, far = float(grid.ranges[0]), float(grid.ranges[-1])
    if near <= rim * reach or near**2 - 2 * near * rim * reach + reach**2 <= 0:
        return False
    longest = float(np.sqrt(far**2 + 2 * far * rim * reach + reach**2))
    return focuser.profiles.passes * longest < focuser.profiles.unambiguous
