"""Which of many sequences of mirrors lead from somewhere to somewhere, were nothing in the way.

A town has tens of thousands of mirrors, and rays meet as many sequences of them, of which a dozen
are paths. Here all sequences are unfolded at once; those that are left are few enough to be traced
one by one, with what stands in the way.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from simulator.geometry.mirrors import Mirrors, dot

SLACK = 1e-6
"""How far outside a mirror a path may meet it to be kept for the exact test. [m]"""

AT_ONCE = 50_000
"""Sequences that are unfolded in one go: some 10 MB for each quantity. [-]"""


def leading_sequences(
    mirrors: Mirrors,
    sequences: Sequence[tuple[int, ...]],
    starts: Float[np.ndarray, "links 3"],
    ends: Float[np.ndarray, "links 3"],
) -> list[tuple[int, ...]]:
    """Keep the sequences that have a specular path for at least one of some links.

    Parameters
    ----------
    mirrors
        All mirrors.
    sequences
        Of mirrors, from the starts onward, in any order.
    starts, ends
        Of the links, pairwise. [m]

    Returns
    -------
    Those that lead from a start to its end, in their order; paths within :data:`SLACK` of an edge
    count, and nothing blocks any.
    """
    lengths = np.array([len(one) for one in sequences], dtype=np.int64)
    kept = lengths == 0
    for length in np.unique(lengths[lengths > 0]).tolist():
        some = np.flatnonzero(lengths == length)
        for first in range(0, some.size, AT_ONCE):
            part = some[first : first + AT_ONCE]
            rows = np.array([sequences[index] for index in part.tolist()], dtype=np.int64)
            for start, end in zip(starts, ends, strict=True):
                kept[part] |= _leads(mirrors, rows, start, end)
    return [one for one, keep in zip(sequences, kept.tolist(), strict=True) if keep]


def _leads(
    mirrors: Mirrors,
    rows: Int[np.ndarray, "sequences bounces"],
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
) -> Bool[np.ndarray, " sequences"]:
    """Fold the line from the last image to the end back over each sequence."""
    latest = np.broadcast_to(start, (len(rows), 3))
    images = []
    for mirror in rows.T:
        heights = dot(latest - mirrors.corners[mirror, 0], mirrors.normals[mirror])
        latest = latest - 2.0 * heights[:, None] * mirrors.normals[mirror]
        images.append(latest)
    leads = np.ones(len(rows), dtype=bool)
    point = np.broadcast_to(end, (len(rows), 3))
    for mirror, image in zip(rows.T[::-1], images[::-1], strict=True):
        normals, origins = mirrors.normals[mirror], mirrors.corners[mirror, 0]
        here, behind = dot(point - origins, normals), dot(image - origins, normals)
        leads &= (here * behind < 0) & (mirrors.two_sided[mirror] | (here > 0))
        apart = np.where(leads, here - behind, 1.0)
        point = point + (here / apart)[:, None] * (image - point)
        inward = mirrors.inward[mirror]
        margins = dot(point[:, None] - mirrors.corners[mirror], inward)
        # A repeated corner has no edge there.
        margins = np.where(np.any(inward != 0.0, axis=-1), margins, np.inf)
        leads &= margins.min(axis=1) >= -SLACK
    return leads
