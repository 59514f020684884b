r"""Two-dimensional method of moments for perfect conductors, the electric field along z (TM_z).

The scattered field is that of the current on the conductors,

.. math:: u_s(\mathbf r) = \int G(\mathbf r, \mathbf r')\, q(\mathbf r')\,ds'

so with :math:`q = -\partial u/\partial n`, and the total field is 0 on them. Open strips take
the electric-field equation (EFIE), closed contours the combined one (CFIE), whose solution is
unique also where the interior of the contour resonates:

.. math:: S q = -u_i, \qquad
          \bigl(\tfrac12 + K' + j\eta S\bigr) q = -\partial_n u_i - j\eta u_i, \quad
          \eta = k

with :math:`S` the integral above on the conductor and :math:`K'` its normal derivative.

Nyström's method on the grids of :mod:`validation.full_wave.conducting_contour`: the trapezoidal
rule, corrected near the diagonal (:mod:`validation.full_wave.log_quadrature`) by the coefficients
of the logarithm, :math:`-J_0(kR)/2\pi` in :math:`S` and :math:`kJ_1(kR)\,\hat n\cdot\hat R/2\pi` in
:math:`K'`. At the edge of a strip the parameter reverses, and the correction is reflected.

Unknowns and right-hand sides are weighted by the square root of the arc length, which makes
the EFIE's matrix symmetric and its norm that of the function space.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Complex, Float, Int
from scipy.linalg import lu_factor, lu_solve
from scipy.special import j0, j1

from validation.full_wave.conducting_contour import Contour
from validation.full_wave.line_source import LineSource, greens_function, radial_derivative
from validation.full_wave.log_quadrature import log_weights


def strip_entries(
    strip: Contour,
    wavenumber: float,
    rows: Int[np.ndarray, " rows"],
    columns: Int[np.ndarray, " columns"],
) -> Complex[np.ndarray, "rows columns"]:
    r"""Evaluate a block of the weighted EFIE matrix :math:`w_i^{1/2} S_{ij} w_j^{1/2}`.

    Parameters
    ----------
    strip
        Open or closed.
    wavenumber
        [rad/m].
    rows, columns
        Indices of points.
    """
    # Positions as complex numbers: one subtraction and one absolute value give distances.
    place = strip.points @ np.array([1.0, 1.0j])
    root = np.sqrt(strip.weights)
    apart = np.abs(place[rows, None] - place[columns])
    same = rows[:, None] == columns
    block = greens_function(wavenumber * np.where(same, 1.0, apart))
    if same.any():
        diagonal = strip.speeds[rows] * (0.5 * wavenumber * strip.step)
        limit = -0.25j - (np.log(diagonal) + np.euler_gamma) / (2 * np.pi)
        block[same] = np.broadcast_to(limit[:, None], block.shape)[same]
    _add_corrections(strip, rows, columns, block, wavenumber * apart)
    block *= root[rows, None]
    block *= root[columns]
    return block


def _add_corrections(
    contour: Contour,
    rows: Int[np.ndarray, " rows"],
    columns: Int[np.ndarray, " columns"],
    block: Complex[np.ndarray, "rows columns"],
    phase: Float[np.ndarray, "rows columns"],
) -> None:
    for inside, weight in _corrections(contour, rows, columns):
        block[inside] -= weight * j0(phase[inside]) / (2 * np.pi)


def _corrections(
    contour: Contour, rows: Int[np.ndarray, " rows"], columns: Int[np.ndarray, " columns"]
) -> list[tuple[tuple[Int[np.ndarray, " n"], Int[np.ndarray, " n"]], Float[np.ndarray, " n"]]]:
    """Find the pairs that are neighbours on the periodic grid, and the weights of each."""
    weights = log_weights()
    reach, count = weights.size - 1, contour.count
    steps = rows[:, None] - columns
    if contour.closed:
        around = np.abs((steps + count // 2) % count - count // 2)
        separations = [around]
    else:
        turned = rows[:, None] + columns + 1
        separations = [np.abs(steps), turned, 2 * count - turned]
    found = []
    for separation in separations:
        row, column = np.nonzero(separation <= reach)
        if row.size:
            found.append(((row, column), weights[separation[row, column]]))
    return found


def combined_entries(contour: Contour, wavenumber: float) -> Complex[np.ndarray, "points points"]:
    r"""Evaluate the weighted CFIE matrix :math:`\tfrac12 + K' + jkS` of one closed contour."""
    every = np.arange(contour.count)
    root = np.sqrt(contour.weights)
    away = contour.points[:, None] - contour.points
    apart = np.hypot(away[..., 0], away[..., 1])
    np.fill_diagonal(apart, 1.0)
    facing = np.einsum("ijx,ix->ij", away, contour.normals) / apart
    normal = wavenumber * facing * radial_derivative(wavenumber * apart)
    for inside, weight in _corrections(contour, every, every):
        bessel = j1(wavenumber * apart[inside])
        normal[inside] += weight * wavenumber * facing[inside] * bessel / (2 * np.pi)
    # G falls with R, and n·(r − r')/R² tends to half the curvature.
    np.fill_diagonal(normal, -contour.curvatures / (4 * np.pi))
    matrix = normal * root[:, None] * root
    matrix += 1j * wavenumber * strip_entries(contour, wavenumber, every, every)
    matrix[every, every] += 0.5
    return np.asarray(matrix)


def conductors_matrix(
    contours: Sequence[Contour], wavenumber: float
) -> Complex[np.ndarray, "points points"]:
    """Evaluate the weighted matrix of several conductors: EFIE on strips, CFIE on closed ones.

    Parameters
    ----------
    contours
        Separated by several steps of their grids.
    wavenumber
        [rad/m].
    """
    return np.block(
        [
            [
                _own_block(one, wavenumber) if one is other else _far_block(one, other, wavenumber)
                for other in contours
            ]
            for one in contours
        ]
    )


def incident(
    contours: Sequence[Contour], source: LineSource, wavenumber: float
) -> Complex[np.ndarray, " points"]:
    """Evaluate the weighted right-hand side of a source for :func:`conductors_matrix`."""
    sides = []
    for contour in contours:
        field = source.field(contour.points, wavenumber)
        side = -field
        if contour.closed:
            gradient = source.gradient(contour.points, wavenumber)
            side = -np.einsum("ix,ix->i", contour.normals, gradient) - 1j * wavenumber * field
        sides.append(np.sqrt(contour.weights) * side)
    return np.concatenate(sides)


def received(
    contours: Sequence[Contour], receiver: LineSource, wavenumber: float
) -> Complex[np.ndarray, " points"]:
    """Return a receiver's response to each weighted unknown; a beam receives as it transmits."""
    return np.concatenate(
        [
            np.sqrt(contour.weights) * receiver.field(contour.points, wavenumber)
            for contour in contours
        ]
    )


def scattered_fields(
    contours: Sequence[Contour],
    sources: Sequence[LineSource],
    receivers: Sequence[LineSource],
    wavenumber: float,
) -> Complex[np.ndarray, "sources receivers"]:
    """Solve for the scattered field of each source at each receiver, by dense decomposition.

    Parameters
    ----------
    contours
        The conductors.
    sources, receivers
        Outside of them.
    wavenumber
        [rad/m].
    """
    factors = lu_factor(conductors_matrix(contours, wavenumber), check_finite=False)
    sides = np.stack([incident(contours, one, wavenumber) for one in sources], axis=-1)
    heard = np.stack([received(contours, one, wavenumber) for one in receivers], axis=-1)
    return np.asarray(lu_solve(factors, sides, check_finite=False).T @ heard)


def _own_block(contour: Contour, wavenumber: float) -> Complex[np.ndarray, "points points"]:
    if contour.closed:
        return combined_entries(contour, wavenumber)
    every = np.arange(contour.count)
    return strip_entries(contour, wavenumber, every, every)


def _far_block(
    to: Contour, source: Contour, wavenumber: float
) -> Complex[np.ndarray, "points others"]:
    away = to.points[:, None] - source.points
    phase = wavenumber * np.hypot(away[..., 0], away[..., 1])
    block = greens_function(phase)
    if to.closed:
        facing = np.einsum("ijx,ix->ij", away, to.normals) / phase
        block = wavenumber**2 * facing * radial_derivative(phase) + 1j * wavenumber * block
    return np.asarray(block * np.sqrt(to.weights)[:, None] * np.sqrt(source.weights))
