"""The hierarchical solver against dense decomposition."""

import numpy as np
import pytest

from validation.full_wave.conducting_contour import open_strip
from validation.full_wave.hodlr_solver import chosen_columns, compress, solve
from validation.full_wave.method_of_moments import strip_entries


@pytest.mark.parametrize("roughness", [0.0, 0.15, 0.3])
def test_waves_along_a_rough_line_are_solved_for_as_by_a_dense_solver(roughness: float) -> None:
    # In wavelengths: 60 long, up to 0.3 high with slopes above 1.
    along = np.linspace(0, 60, 2401)
    heights = roughness * (np.sin(2.3 * along) + np.cos(4.1 * along + 1))
    strip = open_strip(np.stack([along, heights], axis=-1), spacing=1 / 8)

    def entries(rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        return strip_entries(strip, 2 * np.pi, rows, columns)

    matrix = compress(entries, 0, strip.count, tolerance=1e-8)
    every = np.arange(strip.count)
    dense = entries(every, every)
    sides = np.exp(-2j * np.pi * np.outer(strip.points[:, 0], [0.1, 0.7, 0.95]))
    expected = np.linalg.solve(dense, sides)
    found = solve(matrix, sides)
    # Each of three levels errs by the tolerance; the matrix's condition is some hundred.
    assert np.linalg.norm(found - expected) < 1e-5 * np.linalg.norm(expected)
    assert 10 < matrix.largest_rank < 45  # of blocks of 240 points and more


def test_a_small_matrix_is_kept_whole() -> None:
    rng = np.random.default_rng(1)
    whole = rng.standard_normal((20, 20)) + 1j * rng.standard_normal((20, 20))
    whole = whole + whole.T + 20 * np.eye(20)
    matrix = compress(lambda rows, columns: whole[np.ix_(rows, columns)], 0, 20)
    sides = rng.standard_normal((20, 2)) + 0j
    np.testing.assert_allclose(whole @ solve(matrix, sides), sides, atol=1e-12)
    assert matrix.largest_rank == 0


def test_columns_interpolate_a_matrix_of_low_rank() -> None:
    rng = np.random.default_rng(2)
    left, right = rng.standard_normal((50, 4)), rng.standard_normal((4, 30))
    matrix = (left @ right).astype(np.complex128)
    chosen, spread = chosen_columns(matrix, 1e-10)
    assert len(chosen) == 4
    np.testing.assert_allclose(matrix[:, chosen] @ spread, matrix, atol=1e-12)
