r"""Scattered fields of a two-dimensional scene at one frequency, by a direct solver.

The incident fields of sources and receivers far from the bodies have a much lower rank than their
number: some positions are chosen and solved for, all others are interpolated from them. With the
right-hand sides :math:`B_J` and the receivers' responses :math:`H_J` of the chosen positions, and
the interpolation :math:`T`,

.. math:: u_{sr} = t_s^T (B_J^T A^{-T} H_J)\, t_r

Each solution is checked by its residual in some rows of the equations.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Int

from validation.full_wave.boundary_equations import BoundaryProblem
from validation.full_wave.hodlr_solver import chosen_columns, compress, solve
from validation.full_wave.line_source import LineSource

TOLERANCE = 1e-7
"""Relative tolerance of ranks; the error of fields is some 1e-6. [-]"""

LEAF = 160
"""Most unknowns of a block that is stored in full. [-]"""

SAMPLINGS = ((160, 96), (480, 288))
"""Unknowns next to a division that are sampled, and for each doubling of the distance from it; if
the residual with the first is too large, the next is tried. [-]"""

CHECKED, MOST_RESIDUAL = 200, 1e-4
"""Rows in which a solution is checked, and the largest residual over the incident field. [-]"""

THINNED = 64
"""Rows by which positions are chosen, in addition to twice the number of positions. [-]"""


class FullWaveError(RuntimeError):
    """A solution does not satisfy its equation."""


@dataclass(frozen=True, kw_only=True)
class Lit:
    """Positions in the scene: the chosen ones, and the interpolation of the others."""

    chosen: Int[np.ndarray, " rank"]
    spread: Complex[np.ndarray, "rank places"]


def link_fields(
    problem: BoundaryProblem, sources: Sequence[LineSource], receivers: Sequence[LineSource]
) -> Complex[np.ndarray, "sources receivers"]:
    """Solve for the scattered field of each source at each receiver.

    Parameters
    ----------
    problem
        The scene.
    sources, receivers
        Outside of the bodies.

    Raises
    ------
    FullWaveError
        If the solution does not satisfy the equation.
    """
    sent, heard = _lit(problem, sources), _lit(problem, receivers)
    between = _between(problem, _some(sources, sent), _some(receivers, heard))
    return np.asarray(sent.spread.T @ between @ heard.spread)


def array_fields(
    problem: BoundaryProblem, array: Sequence[LineSource], users: Sequence[LineSource]
) -> Complex[np.ndarray, "ways places"]:
    """Solve for an array's monostatic echo, and for each user's pilot at the array.

    Parameters
    ----------
    problem
        The scene.
    array, users
        Outside of the bodies.

    Returns
    -------
    First the echo, then each user's scattered field, at all places of the array.

    Raises
    ------
    FullWaveError
        If the solution does not satisfy the equation.
    """
    lit = _lit(problem, array)
    some = _some(array, lit)
    between = _between(problem, [*some, *users], some)
    own, sent = between[: len(some)], between[len(some) :]
    echo = np.einsum("rp,rs,sp->p", lit.spread, own, lit.spread, optimize=True)
    return np.concatenate([echo[None], sent @ lit.spread])


def echo_fields(
    problem: BoundaryProblem, places: Sequence[LineSource]
) -> Complex[np.ndarray, " places"]:
    """Solve for each source's scattered field at its own position; see :func:`link_fields`."""
    return np.asarray(array_fields(problem, places, [])[0])


def _some(ends: Sequence[LineSource], lit: Lit) -> list[LineSource]:
    return [ends[index] for index in lit.chosen]


def _lit(problem: BoundaryProblem, ends: Sequence[LineSource]) -> Lit:
    count = min(problem.size, 2 * len(ends) + THINNED)
    rows = np.unique(np.linspace(0, problem.size - 1, count).astype(np.int64))
    sample = np.concatenate([problem.sides(ends, rows), problem.heard(ends, rows)])
    chosen, spread = chosen_columns(sample, TOLERANCE)
    return Lit(chosen=chosen, spread=spread)


def _between(
    problem: BoundaryProblem, sources: Sequence[LineSource], receivers: Sequence[LineSource]
) -> Complex[np.ndarray, "sources receivers"]:
    sides = problem.sides(sources)
    checked = np.unique(np.linspace(0, problem.size - 1, CHECKED).astype(np.int64))
    rows = problem.entries(checked, np.arange(problem.size))
    for sampling in SAMPLINGS:
        matrix = compress(
            problem.entries,
            0,
            problem.size,
            leaf=LEAF,
            tolerance=TOLERANCE,
            symmetric=problem.symmetric,
            sampling=sampling,
        )
        solution = solve(matrix, sides)
        left = rows @ solution - sides[checked]
        worst = float((np.linalg.norm(left, axis=0) / np.linalg.norm(sides[checked], axis=0)).max())
        if worst < MOST_RESIDUAL:
            return np.asarray(solution.T @ problem.heard(receivers))
    raise FullWaveError(
        f"at a wavelength of {2e3 * np.pi / problem.wavenumber:.6g} mm the solution errs by "
        f"{worst:.1e} of the incident field, more than {MOST_RESIDUAL:g}; does a contour cross "
        "itself or touch another?"
    )
