r"""Range profiles in the memory of the device that reads them, one polynomial per cell.

Cubics over the cells of :mod:`estimator.imaging.range_compression` are exact to -67 dB and better,
but one reading gathers four numbers, and on a CPU without fast gathers these cost more than the
rest of back-projection. A fine table divides each cell into :data:`FINER` and holds a straight line
over each, value and slope as four whole numbers of 16 bits in one number of 64: one gather, half
the time. It costs about as much as reading each of its entries once, and serves many points.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from estimator.compute import engine
from estimator.compute.integer_division import row_and_column
from estimator.imaging.range_compression import CELLS_PER_SAMPLE, RangeProfiles
from estimator.measurement.model import MeasurementError

GUARD = 2
"""Cells repeated past the unambiguous range, for lengths that round up to it. [cells]"""
FINER = 10
r"""Fine cells in each cell.

A line at Chebyshev's nodes errs by at most (π/40)²/4 (-56 dB) for the outermost frequency, and by a
third of it in the mean over the band: with the cubics' error below -60 dB of the peak of a point
target in one position, and less over several, as their paths lie differently in their cells. [-]"""
MOST_ENTRIES = 2**27
"""Largest fine table, of 1 GiB: larger ones would be most of a small machine's memory. [-]"""
POINTS_PER_CELL = 8.0
"""Points of one call, over cells, from which on a fine table is made. It takes as long as to read
some five points for each cell from the cubics, and halves the time of the reading: measured on an
array of 260 positions, in one run. [-]"""
_LARGEST = 32767  # of 16 bits with a sign
_BETWEEN = 2**0.5
"""Largest value between samples at twice the Nyquist rate, over the largest sample. [-]"""


@dataclass(frozen=True, eq=False)
class CubicTable:
    """The cubic of each cell: four complex numbers of two floats."""

    entries: Any  # UInt64: a complex coefficient in each, four for each channel and cell
    cells: int  # for each channel
    order: int  # coefficients of a polynomial
    finer: int = 1  # entries of the table to a cell of the profiles
    scale: float = 1.0  # what a value read is to be multiplied by

    def read(self, arrays: Any, row: Any, cell: Any, part: Any) -> tuple[Any, Any]:
        """Evaluate the polynomial of a cell of the table at -½ … ½ from its middle."""
        entry = self.order * (row + cell)
        re, im = arrays.Float(0), arrays.Float(0)
        for i in reversed(range(self.order)):
            # Both parts in one load; a packet of all four would cost a call on the CPU.
            pair = dr.gather(arrays.UInt64, self.entries, entry + i)
            low, high = _halves(arrays, pair)
            re = dr.fma(re, part, dr.reinterpret_array(arrays.Float, low))
            im = dr.fma(im, part, dr.reinterpret_array(arrays.Float, high))
        return re, im


@dataclass(frozen=True, eq=False)
class FineTable:
    """The line over each fine cell: value and slope, complex, as whole numbers of 16 bits."""

    entries: Any  # UInt64: slope in the upper half, value in the lower; real above imaginary
    cells: int  # for each channel
    steepest: Any  # Float: unit of the slopes over that of the values
    finer: int
    scale: float  # what a value read is to be multiplied by

    def read(self, arrays: Any, row: Any, cell: Any, part: Any) -> tuple[Any, Any]:
        """Evaluate the line of a fine cell at -½ … ½ from its middle."""
        low, high = _halves(arrays, dr.gather(arrays.UInt64, self.entries, row + cell))
        value, slope = arrays.Int32(low), arrays.Int32(high)
        part = part * self.steepest
        # The lower half below the real part was allowed for when it was rounded.
        re = dr.fma(arrays.Float(slope), part, arrays.Float(value))
        im = dr.fma(arrays.Float(slope << 16), part, arrays.Float(value << 16))
        return re, im


ProfileTable = CubicTable | FineTable


def cubic_table(profiles: RangeProfiles) -> CubicTable:
    """Move range profiles to the device.

    Raises
    ------
    MeasurementError
        If they are too many for the device's 32-bit addresses.
    """
    arrays = engine.arrays()
    channels, cells, order = profiles.coefficients.shape
    if channels * (cells + GUARD) * order >= 2**32:
        raise MeasurementError(
            f"{channels} positions x {cells} range cells are more than 32-bit addresses reach; "
            "image the positions in parts and add the images"
        )
    # A path length that is rounded up to the unambiguous one reads the first cells again.
    source = arrays.UInt64(np.ascontiguousarray(profiles.coefficients).view(np.uint64).ravel())
    entry = dr.arange(arrays.UInt32, channels * (cells + GUARD) * order)
    row, column = row_and_column(entry, (cells + GUARD) * order)
    period = dr.opaque(arrays.UInt32, cells * order)
    column = dr.select(column < period, column, column - period)
    table = dr.gather(arrays.UInt64, source, row * period + column)
    dr.eval(table)
    return CubicTable(entries=table, cells=cells + GUARD, order=order)


def is_worth_it(profiles: RangeProfiles, points: int) -> bool:
    """Tell whether so many points are read faster from a fine table, its making included."""
    channels, cells, _ = profiles.coefficients.shape
    small = channels * (cells + GUARD) * FINER <= MOST_ENTRIES
    return bool(small and points >= POINTS_PER_CELL * cells)


def fine_table(profiles: RangeProfiles, cubic: CubicTable) -> FineTable:
    """Divide the cells of a table of cubics, and lay a line over each part."""
    arrays = engine.arrays()
    cells = cubic.cells * FINER
    row, fine = row_and_column(dr.arange(arrays.UInt32, len(profiles.coefficients) * cells), cells)
    cell = dr.minimum((fine + FINER // 2) // FINER, cubic.cells - 1)
    middle = arrays.Float(arrays.Int32(fine) - FINER * arrays.Int32(cell)) / FINER
    node = np.cos(np.pi / 4) / 2 / FINER  # Chebyshev's, of two points
    at = dr.opaque(arrays.UInt32, cubic.cells) * row
    before, after = (cubic.read(arrays, at, cell, middle + side) for side in (-node, node))
    # A band-limited function's slope is at most its largest value times its largest frequency.
    steepest = np.pi / (CELLS_PER_SAMPLE * FINER)
    largest = _BETWEEN * float(np.abs(profiles.coefficients[..., 0]).max(initial=0.0)) or 1.0
    unit = dr.opaque(arrays.Float, _LARGEST / largest)
    values = [(a + b) * (0.5 * unit) for a, b in zip(before, after, strict=True)]
    slope = unit / (2 * node * FINER * steepest)
    slopes = [(b - a) * slope for a, b in zip(before, after, strict=True)]
    table = arrays.UInt64(_packed(arrays, *slopes)) << 32 | arrays.UInt64(_packed(arrays, *values))
    dr.eval(table)
    return FineTable(
        entries=table,
        cells=cells,
        steepest=dr.opaque(arrays.Float, steepest),
        finer=FINER,
        scale=largest / _LARGEST / 2**16,
    )


def _halves(arrays: Any, pair: Any) -> tuple[Any, Any]:
    return arrays.UInt32(pair), arrays.UInt32(pair >> 32)


def _packed(arrays: Any, re: Any, im: Any) -> Any:
    """Round two numbers to 16 bits each, one above the other."""
    lower = arrays.UInt32(_whole(arrays, im)) & 0xFFFF
    # Read as one number of 32 bits, the real part has the imaginary one as its fraction.
    upper = arrays.UInt32(_whole(arrays, re - arrays.Float(lower) / 2**16))
    return upper << 16 | lower


def _whole(arrays: Any, value: Any) -> Any:
    return arrays.Int32(dr.round(dr.clip(value, -_LARGEST, _LARGEST)))
