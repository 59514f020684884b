r"""A wall's line from its whole echo: least squares over a row of unknown scatterers.

A straight rough wall is a row of scatterers of unknown strengths :math:`\gamma_i`, so its echo,
as range profiles of each antenna position, is

.. math:: d = A(\alpha, \rho)\, \gamma + \text{rest}, \qquad
          A_{(m,b),i} = D(r_b - r_{mi})\, e^{-j 4 \pi f_c r_{mi} / c}

with Dirichlet's kernel D of the sweep. Scatterers spaced more closely than a resolution cell can
represent any speckle, and yet span only a small part of the data space: a row that is turned or
moved by a fraction of a cell does not explain the echo. Least squares over strengths, angle and
offset together (variable projection, in Kaufman's approximation [1]_) have none of the errors of an
image's brightest line: each cell's speckle in its neighbours' sidelobes, levels that change along
the wall, and its ends.

The residual is noise, and the effect of the wall's own heights beyond first order; both are
independent from part to part of the wall, so that the covariance follows from the parts' scores
(:mod:`estimator.walls.cluster_robust_covariance`).

References
----------
.. [1] L. Kaufman, "A variable projection method for solving separable nonlinear least squares
       problems", BIT 15, 49-57 (1975), doi:10.1007/BF01932995
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float
from scipy.linalg import cho_solve

from estimator.geometry.lateness import Lateness
from estimator.geometry.wall_2d import unit_normal
from estimator.measurement.model import Echo
from estimator.walls.cluster_robust_covariance import cluster_robust_covariance
from estimator.walls.row_focus import focus_shift
from estimator.walls.scatterer_row import (
    adjoint,
    factorized,
    row_echoes,
    row_echoes_and_slopes,
    row_places,
    row_profiles,
    thinned,
)
from estimator.wavefronts.noise_variance import noise_variance

STEPS = 2
"""Gauss-Newton steps: from an error of a hundredth of a cell the first leaves less than a
thousandth. [-]"""
FARTHEST_STEP = 0.5
"""Largest displacement of an end from where the image has it: beyond, the row explains some other
echo. [cells]"""
FEWEST_CELLS = 7
"""Shortest line; a shorter one is the neighbourhood of a point. [cells]"""
PART = 3.0
"""Length of the parts of a wall whose scores are taken to be independent. Within a part they are
not: what the model leaves out (for instance, an antenna's pattern that weighs places differently at
each position) gives neighbouring places opposite scores. [cells]"""
DEPTH = 4e-6
"""Of a wall's surface, against where it reflects: the phase of a lossy material's reflection
changes with frequency as if it lay deeper. On drywall at 220 to 330 GHz 3 to 6 µm were measured;
metal has none. [m]"""


@dataclass(frozen=True, kw_only=True)
class CoherentLine:
    """A segment in the array's frame, with the statistics of its angle and offset."""

    start: Float[np.ndarray, " 3"]  # [m]
    end: Float[np.ndarray, " 3"]  # [m]
    covariance: Float[np.ndarray, "2 2"]  # of (angle [rad], offset [m]) at the midpoint
    explained: float  # share of the echo from its ranges that it and the others explain [-]
    late: Lateness  # by how much that echo is later than its wavefronts are curved


def fit_coherently(
    echo: Echo,
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
    *,
    cell_along: float,
    cell_across: float,
    beyond: tuple[float, float] = (0.0, 0.0),
    others: Float[np.ndarray, "others 3"] | None = None,
) -> CoherentLine | None:
    """Refine a wall's line that is known to a small part of a cell.

    Parameters
    ----------
    echo
        In the array's frame, of uniform frequencies; transmitters may stand apart.
    start, end
        The line. [m]
    cell_along, cell_across
        Resolution along the wall and across it, at half power. [m]
    beyond
        How much longer the wall may be than what is found of it, before its start and beyond
        its end: echo of a part that the row does not reach would turn the line. [m]
    others
        Scatterers at known places that send echoes from the same ranges, with unknown strengths
        of their own. [m]

    Returns
    -------
    The line, with the same length; ``None`` where it is too short, or where the echo is not that
    of a row of scatterers nearby.
    """
    length = float(np.linalg.norm(end - start))
    if length < FEWEST_CELLS * cell_along:
        return None
    places = row_places(echo, start, end, beyond)
    count, levers = places.size, 2 * places / length
    few = thinned(echo, start, end)
    profiles = row_profiles(few, start, end)
    beside = None
    if others is not None and len(others):
        beside = row_echoes(few, profiles, others)
    data = profiles.values.ravel()
    first = (start, end)
    for _ in range(STEPS):
        along = (end - start) / length
        row = 0.5 * (start + end) + places[:, None] * along
        echoes, slopes = row_echoes_and_slopes(few, profiles, row, unit_normal(start, end))
        if beside is not None:
            echoes = np.concatenate([echoes, beside], axis=1)
        solved = factorized(echoes)
        all_strengths = cho_solve(solved, adjoint(echoes, data))
        residual = data - echoes @ all_strengths
        strengths = all_strengths[:count]
        moved = slopes @ np.stack([strengths, strengths * levers], axis=-1)
        moved -= echoes @ cho_solve(solved, adjoint(echoes, moved))
        stiffness = (moved.conj().T @ moved).real
        step = np.linalg.solve(stiffness, (moved.conj().T @ residual).real)
        start, end = _moved(start, end, step)
        if max(np.linalg.norm(start - first[0]), np.linalg.norm(end - first[1])) > (
            FARTHEST_STEP * cell_across
        ):
            return None
    scores = (strengths.conj() * adjoint(slopes, residual)).real
    gains = (strengths.conj()[:, None] * adjoint(slopes, moved)).real
    designs = np.stack([np.ones_like(levers), levers], axis=-1)
    # Of (offset, displacement of the ends).
    by_step = cluster_robust_covariance(places, designs, scores, gains, part=PART * cell_along)
    # An end that moves along the normal by δ turns the line by −2δ over its length.
    to_angle = np.array([[0.0, -2.0 / length], [1.0, 0.0]])
    covariance = to_angle @ by_step @ to_angle.T
    covariance[1, 1] += DEPTH**2
    explained = _explained(data, residual, noise_variance(few.samples), parameters=echoes.shape[1])
    late = focus_shift(
        few, profiles, row, echoes, solved, slopes, moved, residual, strengths,
        places=places, levers=levers, part=PART * cell_along,
    )  # fmt: skip
    return CoherentLine(start=start, end=end, covariance=covariance, explained=explained, late=late)


def _explained(
    data: Complex[np.ndarray, " n"],
    residual: Complex[np.ndarray, " n"],
    noise: float,
    *,
    parameters: int,
) -> float:
    """Return the share of the echo, less the noise in it, that a fit explains. [-].

    Of an echo in noise no fit explains most; what counts is what it leaves over the noise.
    """
    left = float(np.vdot(residual, residual).real) - noise * (residual.size - parameters)
    whole = float(np.vdot(data, data).real) - noise * data.size
    return 1 - max(left, 0.0) / whole if whole > 0 else 0.0


def _moved(
    start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"], step: Float[np.ndarray, " 2"]
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Displace a line along its normal, and its ends by so much more and less."""
    normal = unit_normal(start, end)
    return start + (step[0] - step[1]) * normal, end + (step[0] + step[1]) * normal
