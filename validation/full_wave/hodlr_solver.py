r"""Direct solver for symmetric matrices whose off-diagonal blocks have low rank (HODLR).

Points in the order of a curve are halved again and again. Halves A and B of the same parent
interact by :math:`U_{AB} V_{AB}^T` of low rank, since waves between distant parts of a curve
have few degrees of freedom. Solving is exact then, by the Woodbury formula from the leaves
up [1]_:

.. math:: \begin{pmatrix} A & U V^T \\ V U^T & B \end{pmatrix}
          \begin{pmatrix} x \\ y \end{pmatrix} = \begin{pmatrix} f \\ g \end{pmatrix}

    (1 - U^T A^{-1} U\, V^T B^{-1} V)\, U^T x = U^T A^{-1} f - U^T A^{-1} U\, V^T B^{-1} g

Blocks are never formed. Their rank is read off a sample of their rows and columns, dense next
to the point where the halves meet and ever sparser away from it, and a block is interpolated
from the chosen rows and columns, :math:`M \approx M_{:J} M_{IJ}^{-1} M_{I:}` [2]_.

References
----------
.. [1] S. Ambikasaran, E. Darve, "An O(N log N) fast direct solver for partial hierarchically
   semi-separable matrices", J. Sci. Comput. 57, 2013.
.. [2] H. Cheng, Z. Gimbutas, P.-G. Martinsson, V. Rokhlin, "On the compression of low rank
   matrices", SIAM J. Sci. Comput. 26, 2005.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Int
from scipy.linalg import lu_factor, lu_solve, qr, solve_triangular

Entries = Callable[
    [Int[np.ndarray, " rows"], Int[np.ndarray, " columns"]],
    Complex[np.ndarray, "rows columns"],
]
"""Block of the matrix at the given rows and columns."""

LEAF = 80
"""Most points of a block that is kept whole. [-]"""

NEAR = 40
"""Points next to the meeting point that are all in the sample. [-]"""

PER_OCTAVE = 12
"""Samples for each doubling of the distance from there. [-]"""

TOLERANCE = 1e-8
"""Where the sample's pivoted QR decomposition is cut, over its first pivot. [-]"""


@dataclass(frozen=True, kw_only=True)
class HierarchicalMatrix:
    """A symmetric matrix of low-rank off-diagonal blocks: a leaf, or two halves and their link."""

    whole: Complex[np.ndarray, "n n"] | None = None  # of a leaf
    halves: "tuple[HierarchicalMatrix, HierarchicalMatrix] | None" = None
    left: Complex[np.ndarray, "first rank"] | None = None
    right: Complex[np.ndarray, "second rank"] | None = None

    @property
    def largest_rank(self) -> int:
        """Largest rank of a link."""
        if self.halves is None or self.left is None:
            return 0
        return max(int(self.left.shape[1]), *(half.largest_rank for half in self.halves))


def compress(
    entries: Entries, first: int, last: int, *, leaf: int = LEAF, tolerance: float = TOLERANCE
) -> HierarchicalMatrix:
    """Compress the part of a symmetric matrix between two indices.

    Parameters
    ----------
    entries
        Evaluates blocks of it.
    first, last
        The part; the last index is left out.
    leaf
        Most points of a block that is kept whole.
    tolerance
        Where ranks are cut. [-]
    """
    if last - first <= leaf:
        every = np.arange(first, last)
        return HierarchicalMatrix(whole=entries(every, every))
    middle = (first + last) // 2
    left, right = _link(entries, first, middle, last, tolerance)
    return HierarchicalMatrix(
        halves=(
            compress(entries, first, middle, leaf=leaf, tolerance=tolerance),
            compress(entries, middle, last, leaf=leaf, tolerance=tolerance),
        ),
        left=left,
        right=right,
    )


def solve(
    matrix: HierarchicalMatrix, sides: Complex[np.ndarray, "n sides"]
) -> Complex[np.ndarray, "n sides"]:
    """Solve for several right-hand sides."""
    if matrix.halves is None or matrix.left is None or matrix.right is None:
        assert matrix.whole is not None
        factors = lu_factor(matrix.whole, check_finite=False)
        return np.asarray(lu_solve(factors, sides, check_finite=False))
    split, count = len(matrix.left), sides.shape[1]
    # The links of this level are more right-hand sides of the halves: all goes up in one sweep.
    upper = solve(matrix.halves[0], np.concatenate([sides[:split], matrix.left], axis=1))
    lower = solve(matrix.halves[1], np.concatenate([sides[split:], matrix.right], axis=1))
    above, below = matrix.left.T @ upper, matrix.right.T @ lower
    rank = matrix.left.shape[1]
    coupling = np.eye(rank) - above[:, count:] @ below[:, count:]
    # U^T x, and V^T y from it.
    seen = np.linalg.solve(coupling, above[:, :count] - above[:, count:] @ below[:, :count])
    answered = below[:, :count] - below[:, count:] @ seen
    return np.concatenate(
        [
            upper[:, :count] - upper[:, count:] @ answered,
            lower[:, :count] - lower[:, count:] @ seen,
        ]
    )


def chosen_columns(
    sample: Complex[np.ndarray, "rows columns"], tolerance: float
) -> tuple[Int[np.ndarray, " rank"], Complex[np.ndarray, "rank columns"]]:
    """Choose columns of a matrix, and the coefficients that interpolate all from them.

    Parameters
    ----------
    sample
        Rows that stand for all.
    tolerance
        Where the pivoted QR decomposition is cut, over its first pivot. [-]
    """
    triangle, order = qr(sample, mode="r", pivoting=True, check_finite=False)
    pivots = np.abs(np.diagonal(triangle))
    rank = max(int(np.count_nonzero(pivots > tolerance * pivots[0])), 1)
    coefficients = np.empty((rank, sample.shape[1]), dtype=np.complex128)
    coefficients[:, order[:rank]] = np.eye(rank)
    coefficients[:, order[rank:]] = solve_triangular(
        triangle[:rank, :rank], triangle[:rank, rank:], check_finite=False
    )
    return order[:rank], coefficients


def _link(
    entries: Entries, first: int, middle: int, last: int, tolerance: float
) -> tuple[Complex[np.ndarray, "first rank"], Complex[np.ndarray, "second rank"]]:
    above = middle - 1 - _sampled(middle - first)
    below = middle + _sampled(last - middle)
    sample = entries(above, below)
    columns, _ = chosen_columns(sample, tolerance)
    rows, _ = chosen_columns(sample[:, columns].T, 0.0)
    cross = sample[np.ix_(rows, columns)]
    left = entries(np.arange(first, middle), below[columns])
    right = entries(above[rows], np.arange(middle, last))
    return np.linalg.solve(cross.T, left.T).T, right.T


def _sampled(count: int) -> Int[np.ndarray, " sampled"]:
    """Choose distances 0 … count − 1 from the meeting point."""
    if count <= 2 * NEAR:
        return np.arange(count)
    octaves = np.log2(count / NEAR)
    spread = NEAR * 2.0 ** np.linspace(0, octaves, int(np.ceil(PER_OCTAVE * octaves)))
    far = np.minimum(spread.astype(np.int64), count - 1)
    return np.unique(np.concatenate([np.arange(NEAR), far]))
