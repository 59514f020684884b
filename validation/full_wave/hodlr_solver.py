r"""Direct solver for matrices whose off-diagonal blocks have low rank (HODLR).

Points in the order of a curve are bisected recursively. Halves A and B of the same parent interact
by :math:`U V^T` and :math:`W Z^T` of low rank, since waves between distant parts of a curve have
few degrees of freedom; in a symmetric matrix :math:`W = V`, :math:`Z = U`. The compressed system is
solved exactly, by the Woodbury formula from the leaves up [1]_:

.. math:: \begin{pmatrix} A & U V^T \\ W Z^T & B \end{pmatrix}
          \begin{pmatrix} x \\ y \end{pmatrix} = \begin{pmatrix} f \\ g \end{pmatrix}

    (1 - Z^T A^{-1} U\, V^T B^{-1} W)\, Z^T x = Z^T A^{-1} f - Z^T A^{-1} U\, V^T B^{-1} g

Blocks are never formed. Their rank is determined from a sample of their rows and columns, dense
next to the point where the halves meet and sparser away from it, and a block is interpolated from
the chosen rows and columns, :math:`M \approx M_{:J} M_{IJ}^{-1} M_{I:}` [2]_.

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
"""Most points of a block that is stored in full. [-]"""

NEAR = 40
"""Points next to the meeting point, all of which are sampled. [-]"""

PER_OCTAVE = 12
"""Samples for each doubling of the distance from the meeting point. [-]"""

MOST_FILLED = 0.6
"""Largest ratio of rank to sample size at which the sample counts as sufficient. [-]"""

TOLERANCE = 1e-8
"""Least pivot of the sample's pivoted QR decomposition that is kept, over the first one. [-]"""


@dataclass(frozen=True, kw_only=True)
class Link:
    """Two halves' blocks of low rank: the upper right and the lower left one."""

    left: Complex[np.ndarray, "first rank"]  # U
    right: Complex[np.ndarray, "second rank"]  # V
    lower_left: Complex[np.ndarray, "second back"]  # W
    lower_right: Complex[np.ndarray, "first back"]  # Z

    @property
    def rank(self) -> int:
        """The larger of both blocks' ranks."""
        return int(max(self.left.shape[1], self.lower_left.shape[1]))


@dataclass(frozen=True, kw_only=True)
class HierarchicalMatrix:
    """A matrix of low-rank off-diagonal blocks: a leaf, or two halves and their link."""

    whole: Complex[np.ndarray, "n n"] | None = None  # of a leaf
    halves: "tuple[HierarchicalMatrix, HierarchicalMatrix] | None" = None
    link: Link | None = None

    @property
    def largest_rank(self) -> int:
        """Largest rank of a link."""
        if self.halves is None or self.link is None:
            return 0
        return max(self.link.rank, *(half.largest_rank for half in self.halves))


def compress(
    entries: Entries,
    first: int,
    last: int,
    *,
    leaf: int = LEAF,
    tolerance: float = TOLERANCE,
    symmetric: bool = True,
    sampling: tuple[int, int] = (NEAR, PER_OCTAVE),
) -> HierarchicalMatrix:
    """Compress the part of a matrix between two indices.

    Parameters
    ----------
    entries
        Evaluates blocks of it.
    first, last
        The part; the last index is left out.
    leaf
        Most points of a block that is stored in full.
    tolerance
        Relative tolerance of ranks. [-]
    symmetric
        Whether the lower left blocks are the upper right ones' transposes.
    sampling
        In place of :data:`NEAR` and :data:`PER_OCTAVE`. [-]
    """
    if last - first <= leaf:
        every = np.arange(first, last)
        return HierarchicalMatrix(whole=entries(every, every))
    middle = (first + last) // 2
    left, right = _link(entries, first, middle, last, tolerance, sampling)
    lower_left, lower_right = right, left
    if not symmetric:
        # The transpose's upper right block is this one's lower left.
        lower_right, lower_left = _link(
            lambda rows, columns: entries(columns, rows).T,
            first,
            middle,
            last,
            tolerance,
            sampling,
        )
    ends = ((first, middle), (middle, last))
    upper, lower = (
        compress(
            entries, *part, leaf=leaf, tolerance=tolerance, symmetric=symmetric, sampling=sampling
        )
        for part in ends
    )
    return HierarchicalMatrix(
        halves=(upper, lower),
        link=Link(left=left, right=right, lower_left=lower_left, lower_right=lower_right),
    )


def solve(
    matrix: HierarchicalMatrix, sides: Complex[np.ndarray, "n sides"]
) -> Complex[np.ndarray, "n sides"]:
    """Solve for several right-hand sides."""
    if matrix.halves is None or matrix.link is None:
        assert matrix.whole is not None
        factors = lu_factor(matrix.whole, check_finite=False)
        return np.asarray(lu_solve(factors, sides, check_finite=False))
    link = matrix.link
    split, count = len(link.left), sides.shape[1]
    # The links of this level are further right-hand sides of the halves: one upward sweep.
    upper = solve(matrix.halves[0], np.concatenate([sides[:split], link.left], axis=1))
    lower = solve(matrix.halves[1], np.concatenate([sides[split:], link.lower_left], axis=1))
    above, below = link.lower_right.T @ upper, link.right.T @ lower
    coupling = np.eye(len(above)) - above[:, count:] @ below[:, count:]
    # Z^T x, and V^T y from it.
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
        Rows that represent all.
    tolerance
        Least pivot of the pivoted QR decomposition that is kept, over the first one. [-]
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
    entries: Entries,
    first: int,
    middle: int,
    last: int,
    tolerance: float,
    sampling: tuple[int, int],
) -> tuple[Complex[np.ndarray, "first rank"], Complex[np.ndarray, "second rank"]]:
    near, per_octave = sampling
    while True:
        above = middle - 1 - _sampled(middle - first, near, per_octave)
        below = middle + _sampled(last - middle, near, per_octave)
        sample = entries(above, below)
        columns, _ = chosen_columns(sample, tolerance)
        whole = len(above) == middle - first and len(below) == last - middle
        # A sample of almost full rank does not show the block's rank: take a denser one.
        if whole or len(columns) < MOST_FILLED * min(sample.shape):
            break
        near, per_octave = 2 * near, 2 * per_octave
    rows, _ = chosen_columns(sample[:, columns].T, 0.0)
    cross = sample[np.ix_(rows, columns)]
    left = entries(np.arange(first, middle), below[columns])
    right = entries(above[rows], np.arange(middle, last))
    return np.linalg.solve(cross.T, left.T).T, right.T


def _sampled(count: int, near: int, per_octave: int) -> Int[np.ndarray, " sampled"]:
    """Return sampled distances from the meeting point, within 0 … count − 1."""
    if count <= 2 * near:
        return np.arange(count)
    octaves = np.log2(count / near)
    spread = near * 2.0 ** np.linspace(0, octaves, int(np.ceil(per_octave * octaves)))
    far = np.minimum(spread.astype(np.int64), count - 1)
    return np.unique(np.concatenate([np.arange(near), far]))
