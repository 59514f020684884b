r"""How much farther a wall's echo arrives than its wavefronts are curved: a delay left in the echo.

With a delay of cables left in it, everything is imaged too far away, by the same
:math:`\delta`, and the wave that a place of a wall returns is rounder than one from there would
be. A row of unknown scatterers (:mod:`estimator.walls.line_fit_echo`) on the imaged line then
explains less of the echo: within one range cell, the defocused echo of a place comes from more
angles than the line has there. Speckle does not hide this, as the strengths of the row are free.
With the row moved nearer by :math:`\delta` along its rays, and its echo later by as much,

.. math:: \frac{\partial r_{mi}}{\partial \delta} = 1 - \hat u_i \cdot \hat u_{mi}

(:math:`\hat u_i` from the aperture's middle to a place, :math:`\hat u_{mi}` from each position),
and :math:`\delta` is found by the same least squares as the line, one step from 0. Positions that
are stated too near together or too far apart change the curvature as well: what is found is then
no delay, but a contradiction all the same.
"""

import numpy as np
from jaxtyping import Complex, Float
from scipy.linalg import cho_solve

from estimator.geometry.lateness import Lateness
from estimator.measurement.model import Echo
from estimator.walls.cluster_robust_covariance import sandwich
from estimator.walls.scatterer_row import RowProfiles, adjoint, row_slopes

STEP_ERROR = 0.1
"""Error of the one step over its length: delays of 0.1 ns, 2 rad at the ends of an aperture of
48 mm 0.3 m away, came out up to a sixth too long or too short. [-]"""


def focus_shift(
    echo: Echo,
    profiles: RowProfiles,
    row: Float[np.ndarray, "scatterers 3"],
    echoes: Complex[np.ndarray, "rows columns"],
    solved: tuple[Complex[np.ndarray, "columns columns"], bool],
    slopes: Complex[np.ndarray, "rows scatterers"],
    moved: Complex[np.ndarray, "rows 2"],
    residual: Complex[np.ndarray, " rows"],
    strengths: Complex[np.ndarray, " scatterers"],
    *,
    places: Float[np.ndarray, " scatterers"],
    levers: Float[np.ndarray, " scatterers"],
    part: float,
) -> Lateness:
    """Find by how much the echo of a row of scatterers is too late for its curvature.

    Parameters
    ----------
    echo, profiles
        In the array's frame, and its range profiles about the row.
    row
        Places of the scatterers. [m]
    echoes, solved
        Of the row and of what is beside it, and the factor of their Gram matrix.
    slopes
        Changes of the row's echoes along the line's normal. [1/m]
    moved
        What an offset of the line, and a displacement of its ends, changes beyond the row's own
        reach. [1/m]
    residual
        What the row does not explain.
    strengths
        Of the scatterers, as fitted.
    places, levers
        Of the scatterers along the line [m], and over half its length [-].
    part
        Length over which the errors of places are correlated. [m]
    """
    own = row_slopes(echo, profiles, row, _delay_rates(echo, row))
    delayed = own @ strengths
    delayed = delayed - echoes @ cho_solve(solved, adjoint(echoes, delayed))
    columns = np.concatenate([moved, delayed[:, None]], axis=1)
    stiffness = (columns.conj().T @ columns).real
    step = np.linalg.solve(stiffness, (columns.conj().T @ residual).real)
    rest = residual - columns @ step
    across, later = ((strengths.conj() * adjoint(table, rest)).real for table in (slopes, own))
    scores = np.stack([across, across * levers, later], axis=-1)
    across_gains, later_gains = (
        (strengths.conj()[:, None] * adjoint(table, columns)).real for table in (slopes, own)
    )
    gains = np.stack([across_gains, across_gains * levers[:, None], later_gains], axis=1)
    covariance = sandwich(places, scores, gains, normal=gains.sum(axis=0), part=part)
    return Lateness(
        shift=float(step[2]),
        deviation=float(np.hypot(np.sqrt(covariance[2, 2]), STEP_ERROR * step[2])),
        distance=float(np.linalg.norm(row.mean(axis=0) - echo.positions.mean(axis=0))),
    )


def _delay_rates(
    echo: Echo, row: Float[np.ndarray, "scatterers 3"]
) -> Float[np.ndarray, "positions scatterers"]:
    """Return how ranges grow with a delay that is made up for by a smaller distance. [-]."""
    ends = [echo.positions]
    ends.append(ends[0] if echo.transmit_positions is None else echo.transmit_positions)
    middle = 0.5 * (ends[0].mean(axis=0) + ends[1].mean(axis=0))
    ray = row - middle
    ray = ray / np.linalg.norm(ray, axis=-1, keepdims=True)
    nearer = np.zeros((len(echo.positions), len(row)))
    for end in ends:
        way = row[None] - end[:, None]
        nearer += 0.5 * np.einsum("mik,ik->mi", way, ray) / np.linalg.norm(way, axis=-1)
    return np.asarray(1 - nearer)
