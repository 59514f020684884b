import numpy as np
import pytest

from estimator.compute import engine
from estimator.compute.integer_division import row_and_column


@pytest.mark.parametrize("columns", [1, 3, 4, 2004, 65537, 2**31])
def test_rows_and_columns_are_those_of_integer_division(columns: int) -> None:
    edges = np.array([0, 1, columns - 1, columns, columns + 1, 2**32 - 1], dtype=np.uint64)
    multiples = np.arange(1, 2000, dtype=np.uint64) * np.uint64(columns)
    numbers = np.concatenate([edges, multiples, multiples - np.uint64(1)])
    numbers = numbers[numbers < 2**32].astype(np.uint32)
    row, column = row_and_column(engine.arrays().UInt32(numbers), columns)
    np.testing.assert_array_equal(row.numpy(), numbers // columns)
    np.testing.assert_array_equal(column.numpy(), numbers % columns)
