r"""Factorised back-projection of a linear array onto a polar grid, in range and sine.

Back-projection sums all channels at every pixel. But a part of the array sees angles less sharply
than the whole: less the carrier's phase to its centre :math:`c_p`, its image

.. math:: A_p(R, s) = e^{-j k_c \rho_p} \sum_{m \in p} \sum_n s_{mn} e^{+j k_n \rho_m},
          \qquad \rho_m = \sqrt{R^2 - 2 R s q_m + q_m^2}

(k for the passes that a length is travelled) varies with the sine s no faster than
:math:`\psi_p = \max |k_n \partial_s \rho_m - k_c \partial_s \rho_p|`. It is formed on as many
sines as that needs, interpolated to all of them by a product with a matrix, and the image is

.. math:: I(R, s) = \sum_p e^{+j k_c \rho_p}\, (A_p U_p)(R, s) .

All parts share the grid of the whole array, so that only one coordinate is interpolated; what is
left of the range's walk over the whole array sets how coarse their sines may be. Sines beyond ±1,
which the interpolation needs at the sector's rim, are none of any place, but the sum is as smooth
there. This is the fast back-projection of Yegulalp [1]_ with the grid of the whole array.

References
----------
.. [1] A. F. Yegulalp, "Fast backprojection algorithm for synthetic aperture radar", IEEE Radar
       Conference 1999, doi:10.1109/NRC.1999.767270
"""

from typing import Any

import drjit as dr
import numpy as np
from jaxtyping import Complex, Float, Int
from scipy.constants import speed_of_light

from estimator.compute import engine
from estimator.compute.blas_threads import one_blas_thread
from estimator.compute.integer_division import row_and_column
from estimator.compute.sincos import sincos_of_turns
from estimator.imaging.aperture_parts import Line, Plan, PolarGrid, cheapest_plan, line_of
from estimator.imaging.backprojection import (
    POINTS_PER_LANE,
    Focuser,
    focus,
    point_state,
    sum_over_channels,
)
from estimator.imaging.profile_tables import ProfileTable, is_worth_it
from estimator.imaging.range_compression import refuse_points_out_of_range

ERROR = 1e-3
"""Error that is allowed by default, over the peak of a point target: -60 dB. [-]"""
MOST_VALUES = 2**22
"""Pixels times parts that are held at once: 32 MB. [-]"""
DEEPEST = 2.0
"""Farthest over nearest range of the rows that are treated alike: nearer ones need finer sines. [-]
"""


def polar_points(
    grid: PolarGrid, centre: Float[np.ndarray, " 3"], axis: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "ranges sines 3"]:
    """Return a grid's places in the plane z = const. through a linear array, on its left. [m]."""
    left = np.array([-axis[1], axis[0], 0.0])
    across = np.sqrt(np.maximum(1 - grid.sines**2, 0.0))
    directions = grid.sines[:, None] * axis + across[:, None] * left
    return np.asarray(centre + grid.ranges[:, None, None] * directions)


@one_blas_thread()
def focus_polar(
    focuser: Focuser,
    grid: PolarGrid,
    *,
    centre: Float[np.ndarray, " 3"],
    axis: Float[np.ndarray, " 3"],
    error: float = ERROR,
    carrier: bool = True,
) -> Complex[np.ndarray, "ranges sines"]:
    """Focus prepared range profiles on a polar grid about a linear array.

    Parameters
    ----------
    focuser
        Of an array on a line through the centre.
    grid
        Ranges and sines.
    centre
        Where ranges are counted from. [m]
    axis
        Unit vector to which sines are counted.
    error
        Of the interpolation, over the peak of a point target; 0: all channels are added. [-]
    carrier
        Whether the carrier's phase over the range is in the image; without it the image is smooth.

    Returns
    -------
    Complex amplitudes; exact ones if the array is no line, or transmits elsewhere. [-]

    Raises
    ------
    MeasurementError
        If a pixel lies beyond the unambiguous range.
    """
    line = line_of(focuser, centre, axis)
    per_metre = focuser.profiles.passes * focuser.profiles.carrier / speed_of_light
    if line is None:
        ways = len(focuser.profiles.legs)
        image = focus(focuser, polar_points(grid, centre, axis))
        sign = 0.0 if carrier else -1.0
    else:
        ways, sign = 1, 1.0 if carrier else 0.0
        ends = PolarGrid(grid.ranges[-1:], grid.sines[[0, -1]])
        corners = polar_points(ends, centre, axis).reshape(-1, 3).T
        refuse_points_out_of_range(focuser.profiles, corners)
        image = _sum_of_parts(focuser, line, grid, error)
    turns = sign * ways * per_metre * grid.ranges
    image *= np.exp(2j * np.pi * (turns - np.round(turns)))[:, None]
    return image


def _sum_of_parts(
    focuser: Focuser, line: Line, grid: PolarGrid, error: float
) -> Complex[np.ndarray, "ranges sines"]:
    """Form the image by zones of ranges, each in the cheapest way, and by some rows at once."""
    image = np.empty((grid.ranges.size, grid.sines.size), dtype=np.complex128)
    worth = is_worth_it(focuser.profiles, image.size)
    table: ProfileTable = focuser.fine if worth else focuser.cubic
    scale = table.scale / focuser.profiles.gain
    everything = np.array([0, len(line.along)])
    first = 0
    while first < grid.ranges.size:
        farthest = DEEPEST * float(grid.ranges[first])
        zone = slice(first, max(first + 1, int(np.searchsorted(grid.ranges, farthest))))
        first = zone.stop
        plan = cheapest_plan(focuser, line, PolarGrid(grid.ranges[zone], grid.sines), error)
        held = 1 if plan is None else len(plan.centres)
        step = max(1, MOST_VALUES // (held * grid.sines.size))
        for start in range(zone.start, zone.stop, step):
            rows = slice(start, min(start + step, zone.stop))
            some = PolarGrid(grid.ranges[rows], grid.sines)
            if plan is None:
                own = _part_images(
                    focuser, table, line, some.ranges, [grid.sines], everything, np.zeros(1)
                )
                sums = own[..., : grid.sines.size]
            else:
                sums = _interpolated(focuser, table, line, plan, some)
            for plane, part in ((image.real, sums[0]), (image.imag, sums[1])):
                np.multiply(part, scale, out=plane[rows], dtype=np.float64)
    return image


def _interpolated(
    focuser: Focuser, table: ProfileTable, line: Line, plan: Plan, grid: PolarGrid
) -> Float[np.ndarray, "2 ranges sines"]:
    """Form each part's image on coarse sines, interpolate it, turn it and add it."""
    rows = 2 * grid.ranges.size
    fine = np.empty((len(plan.centres), rows, grid.sines.size), dtype=np.float32)
    own = _part_images(
        focuser, table, line, grid.ranges, plan.coarse, plan.edges, plan.centres
    ).reshape(rows, -1)
    first = 0
    for sines, some, out in zip(plan.coarse, plan.interpolators, fine, strict=True):
        values = own[:, first : first + sines.size]
        first += _padded(sines.size)
        for coarse, wanted, weights in some:
            np.matmul(values[:, coarse], weights, out=out[:, wanted])
    return _turned_sum(fine, line, plan.centres, grid)


def _padded(count: int) -> int:
    """Round up to a whole number of lanes."""
    return -(-count // POINTS_PER_LANE) * POINTS_PER_LANE


def _part_images(
    focuser: Focuser,
    table: ProfileTable,
    line: Line,
    ranges: Float[np.ndarray, " ranges"],
    sines: list[Float[np.ndarray, " _"]],
    edges: Int[np.ndarray, " edges"],
    centres: Float[np.ndarray, " parts"],
) -> Float[np.ndarray, "2 ranges padded"]:
    """Add up each part's channels, less the carrier's phase to its centre, on sines of its own.

    Returns
    -------
    Real and imaginary parts; beside each other the parts' sines, each rounded up to whole lanes.
    """
    arrays = engine.arrays()
    profiles = focuser.profiles
    lanes = [_padded(some.size) // POINTS_PER_LANE for some in sines]
    columns = sum(lanes)
    row, column = row_and_column(dr.arange(arrays.UInt32, ranges.size * columns), columns)
    by_column = arrays.Float(
        np.concatenate(
            [np.pad(some, (0, _padded(some.size) - some.size), mode="edge") for some in sines]
        ).astype(np.float32)
    )
    middle = dr.gather(
        arrays.Float, arrays.Float(np.repeat(centres, lanes).astype(np.float32)), column
    )
    first, after = (
        dr.gather(arrays.UInt32, arrays.UInt32(np.repeat(edge, lanes).astype(np.uint32)), column)
        for edge in (edges[:-1], edges[1:])
    )
    reach = dr.gather(arrays.Float, arrays.Float(ranges.astype(np.float32)), row)
    per_cell = dr.opaque(arrays.Float, profiles.passes / profiles.cell)
    turns = dr.opaque(arrays.Float, profiles.carrier * profiles.cell / speed_of_light)
    # The carrier's phase is that of path differences alone: float32 is enough for the rest.
    groups = []
    for i in range(POINTS_PER_LANE):
        x = reach * dr.gather(arrays.Float, by_column, POINTS_PER_LANE * column + i)
        square = dr.fma(middle, middle - 2 * x, reach * reach)
        distance = dr.sqrt(square)
        states = [(distance, square, 2 * (x - middle))]
        groups.append(point_state(arrays, states, distance * per_cell))
    along = arrays.Float(line.along.astype(np.float32))
    sums = sum_over_channels(
        arrays,
        table,
        groups,
        per_cell,
        turns,
        places=lambda channel: [[dr.gather(arrays.Float, along, channel) - middle]],
        channels=(first, after),
    )
    dr.eval(sums)  # together: one kernel
    image = np.empty((2, ranges.size * columns, POINTS_PER_LANE), dtype=np.float32)
    for i, values in enumerate(sums):
        for plane, value in zip(image, values, strict=False):
            plane[:, i] = value.numpy()
    return image.reshape(2, ranges.size, -1)


def _turned_sum(
    fine: Float[np.ndarray, "parts rows columns"],
    line: Line,
    centres: Float[np.ndarray, " parts"],
    grid: PolarGrid,
) -> Float[np.ndarray, "2 ranges sines"]:
    """Add the parts' images with the carrier's phase from the centre of each to the array's."""
    arrays: Any = engine.arrays()
    count = grid.ranges.size * grid.sines.size
    source = arrays.Float(fine.ravel())
    middles = arrays.Float(centres.astype(np.float32))
    lane = dr.arange(arrays.UInt32, count)
    row, column = row_and_column(lane, grid.sines.size)
    reach = dr.gather(arrays.Float64, arrays.Float64(grid.ranges), row)
    x = reach * dr.gather(arrays.Float64, arrays.Float64(grid.sines), column)
    double, square = arrays.Float(2 * x), arrays.Float(reach * reach)
    distance = arrays.Float(reach)
    per_metre = dr.opaque(arrays.Float, line.wavenumbers[1] / (2 * np.pi))
    end, size = dr.opaque(arrays.UInt32, centres.size), dr.opaque(arrays.UInt32, count)

    def add_part(part: Any, place: Any, re: Any, im: Any) -> tuple[Any, ...]:
        centre = dr.gather(arrays.Float, middles, part)
        excess = centre * (centre - double)
        length = dr.sqrt(dr.maximum(square + excess, 0.0))
        sine, cosine = sincos_of_turns(excess / (distance + length) * per_metre)
        a = dr.gather(arrays.Float, source, place)
        b = dr.gather(arrays.Float, source, place + size)
        re = dr.fma(a, cosine, dr.fma(-b, sine, re))
        im = dr.fma(a, sine, dr.fma(b, cosine, im))
        return part + 1, place + 2 * size, re, im

    start = (
        arrays.UInt32(0),
        lane,
        dr.zeros(arrays.Float, count),
        dr.zeros(arrays.Float, count),
    )
    _, _, re, im = dr.while_loop(start, lambda part, *_: part < end, add_part)
    dr.eval(re, im)
    return np.stack([re.numpy(), im.numpy()]).reshape(2, grid.ranges.size, grid.sines.size)
