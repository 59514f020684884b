r"""Association of estimated with true points: pairs, missed and false ones.

The optimal subpattern assignment (OSPA) metric of order p and cut-off c [1]_,

.. math:: \left[ \frac{1}{n} \left( \min_\pi \sum_i \min(d_{i \pi(i)}, c)^p
          + c^p\, |n_e - n_t| \right) \right]^{1/p}, \qquad n = \max(n_e, n_t) ,

with the best assignment π of the smaller set to the larger one.

References
----------
.. [1] Schuhmacher, Vo, Vo, "A consistent metric for performance evaluation of multi-object
   filters", IEEE Trans. Signal Process. 56 (2008), doi:10.1109/TSP.2008.920469
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.optimize import linear_sum_assignment

from estimator.results.estimate import Mirror, Target
from validation.metrics.errors import distances_from_segment
from validation.metrics.truth import Truth, front_face


@dataclass(frozen=True, kw_only=True)
class Association:
    """Pairs within the cut-off, and unpaired points."""

    pairs: tuple[tuple[int, int], ...]  # (estimate, truth), nearest first
    distances: Float[np.ndarray, " pairs"]  # of these pairs [m]
    missed: tuple[int, ...]  # truths without an estimate
    false: tuple[int, ...]  # estimates without a truth
    ospa: float  # metric of both sets; 0 if both are empty [m]
    localization: float  # part of the metric by distances within the cut-off [m]
    cardinality: float  # part by missed, false or more distant points [m]


def associate(
    estimates: Float[np.ndarray, "estimates axes"],
    truths: Float[np.ndarray, "truths axes"],
    *,
    cutoff: float,
    order: float = 2.0,
) -> Association:
    """Assign estimated points to true ones at the least total distance.

    Parameters
    ----------
    estimates, truths
        Points. [m]
    cutoff
        Largest distance of a pair, and the cost of an unpaired point. [m]
    order
        The metric's p, 1 or more. [-]

    Returns
    -------
    The assignment; of the metric's p-th power, ``localization`` and ``cardinality`` are the two
    parts, as p-th roots.

    Raises
    ------
    ValueError
        If cut-off or order are out of range.
    """
    apart = np.linalg.norm(estimates[:, None] - truths[None], axis=-1)
    return associate_distances(apart, cutoff=cutoff, order=order)


def associate_distances(
    apart: Float[np.ndarray, "estimates truths"], *, cutoff: float, order: float = 2.0
) -> Association:
    """Assign as :func:`associate`, from the distances of all estimates from all truths [m]."""
    if not (cutoff > 0 and order >= 1):
        raise ValueError(f"cutoff = {cutoff:g} m, order = {order:g}; give > 0 and ≥ 1")
    most = max(apart.shape)
    if most == 0:
        return Association(
            pairs=(),
            distances=np.zeros(0),
            missed=(),
            false=(),
            ospa=0.0,
            localization=0.0,
            cardinality=0.0,
        )
    rows, columns = linear_sum_assignment(np.minimum(apart, cutoff) ** order)
    near = apart[rows, columns] < cutoff
    rows, columns = rows[near], columns[near]
    distances = apart[rows, columns]
    by_distance = np.argsort(distances, kind="stable")
    pairs = tuple((int(rows[i]), int(columns[i])) for i in by_distance)
    local = float((distances**order).sum()) / most
    missing = (most - len(pairs)) * cutoff**order / most
    return Association(
        pairs=pairs,
        distances=distances[by_distance],
        missed=tuple(sorted(set(range(apart.shape[1])) - {truth for _, truth in pairs})),
        false=tuple(sorted(set(range(apart.shape[0])) - {found for found, _ in pairs})),
        ospa=(local + missing) ** (1 / order),
        localization=local ** (1 / order),
        cardinality=missing ** (1 / order),
    )


@dataclass(frozen=True, kw_only=True)
class TargetComparison:
    """An estimate's targets compared with the true ones, by name."""

    names: tuple[str | None, ...]  # of the true target of each estimated one; None: false
    errors: tuple[float | None, ...]  # from the nearest point of its front face [m]
    missed: tuple[str, ...]
    ospa: float  # [m]


def compare_targets(
    targets: Sequence[Target],
    truth: Truth,
    *,
    mirrors: Sequence[Mirror],
    aperture: Float[np.ndarray, " 3"],
    cutoff: float,
    order: float = 2.0,
) -> TargetComparison:
    """Compare estimated targets with the true ones' front faces, where images show them.

    Parameters
    ----------
    targets
        The estimated targets.
    truth
        With the true targets.
    mirrors
        Estimated mirrors; targets seen through them face the aperture's image.
    aperture
        Centre of the array. [m]
    cutoff, order
        See :func:`associate`.
    """
    names = tuple(truth.target_position)
    apart = np.zeros((len(targets), len(names)))
    for row, target in enumerate(targets):
        seen_from = aperture
        for mirror in (mirrors[index] for index in target.seen_through):
            height = float(mirror.normal @ (seen_from - mirror.start))
            seen_from = seen_from - 2 * height * mirror.normal
        for column, name in enumerate(names):
            face = front_face(truth, name, seen_from)
            apart[row, column] = np.linalg.norm(target.position - face)
    found = associate_distances(apart, cutoff=cutoff, order=order)
    owners: list[str | None] = [None] * len(targets)
    errors: list[float | None] = [None] * len(targets)
    for row, column in found.pairs:
        owners[row], errors[row] = names[column], float(apart[row, column])
    return TargetComparison(
        names=tuple(owners),
        errors=tuple(errors),
        missed=tuple(names[index] for index in found.missed),
        ospa=found.ospa,
    )


def target_distances(
    targets: Sequence[Target], truth: Truth
) -> tuple[Float[np.ndarray, " targets"], Float[np.ndarray, " targets"]]:
    """Return the distances of targets from the nearest wall or body, and from walls alone. [m]."""
    places = np.array([one.position for one in targets]).reshape(-1, 3)
    walls = [
        distances_from_segment(places, truth.wall_start[name], truth.wall_end[name])
        for name in truth.wall_start
    ]
    bodies = [
        np.array([np.linalg.norm(place - front_face(truth, name, place)) for place in places])
        for name in truth.target_position
    ]
    nothing = np.full(len(places), np.inf)
    on_walls = np.min([nothing, *walls], axis=0)
    return np.min([on_walls, *bodies], axis=0), on_walls
