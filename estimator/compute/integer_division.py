"""From a lane's number to the row and column that it works on, in Dr.Jit kernels."""

from typing import Any

import drjit as dr

from estimator.compute import engine


def row_and_column(number: Any, columns: int) -> tuple[Any, Any]:
    """Divide 32-bit numbers with remainder, by way of float64.

    Vector units have no division of integers: it would run lane by lane, and cost more than
    all else in a short kernel.
    """
    arrays = engine.arrays()
    reciprocal = dr.opaque(arrays.Float64, 1.0 / columns)
    # Half a unit keeps whole quotients from rounding down; 32 bits leave it room.
    row = arrays.UInt32(dr.floor((arrays.Float64(number) + 0.5) * reciprocal))
    return row, number - row * dr.opaque(arrays.UInt32, columns)
