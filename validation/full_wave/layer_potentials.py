r"""The four boundary operators of the Helmholtz equation on the grids of curves.

For a wavenumber :math:`k`, real or of a lossy medium, with :math:`G = -\tfrac j4 H_0^{(2)}(kR)`,
:math:`\mathbf R = \mathbf r - \mathbf r'`, and normals :math:`\hat n` at the receiving and
:math:`\hat n'` at the sending point,

.. math:: S = G, \quad D = \partial_{n'} G, \quad K' = \partial_n G, \quad
          N = \partial_n \partial_{n'} G

are written with :math:`E = G'(z)/z + 1/2\pi z^2`, :math:`z = kR`, which has no pole. So the static
part is separate, and cancels exactly in differences of two media:

.. math:: D = \frac{\hat n' \cdot \mathbf R}{2\pi R^2} - k^2 E\, \hat n' \cdot \mathbf R, \qquad
          K' = -\frac{\hat n \cdot \mathbf R}{2\pi R^2} + k^2 E\, \hat n \cdot \mathbf R

.. math:: N = \frac{c}{2\pi R^2} - k^2 (E c - G\, \hat n \cdot \hat R\, \hat n' \cdot \hat R),
          \qquad c = \hat n \cdot \hat n' - 2\, \hat n \cdot \hat R\, \hat n' \cdot \hat R

On a curve's own points the trapezoidal rule is corrected. The logarithm of :math:`G` has the
coefficient :math:`-J_0(z)/2\pi`, that of :math:`E` :math:`J_1(z)/2\pi z`
(:mod:`validation.full_wave.log_quadrature`). The pole :math:`1/2\pi R^2` is integrated as
Hadamard's finite part: over the step :math:`h` of the parameter, a wave of phase :math:`\omega`
from point to point gets
:math:`\sum_{n \ne 0} e^{j\omega n}/n^2 = \pi^2/3 - \pi|\omega| + \omega^2/2` from the rule and
should get :math:`-\pi|\omega|`, so

.. math:: \Delta N_{ii} = -\frac{\pi}{6 w_i} + \frac{h^2 S_i}{12 \pi w_i}
          + \frac{w_i \kappa_i^2}{24\pi}, \qquad
          \Delta N_{ij} = \frac{d_{|i-j|}}{4\pi w_i}

with the arc length :math:`w = h\,ds/d\theta` of a point's step, the Schwarzian derivative
:math:`S` of the arc length over the parameter, the curvature :math:`\kappa`, and the second
difference :math:`d`, of 14 neighbours, whose response to a wave is :math:`-\omega^2`. On a closed
curve the diagonal is determined instead by a constant density, whose static field is constant
inside and 0 outside; this is valid at corners, too.

Matrices are weighted, :math:`w_i^{1/2} A_{ij} w_j^{1/2}`.
"""

import functools

import numpy as np
from jaxtyping import Complex, Float, Int
from scipy.special import hankel2, j0, j1, jv, y0, y1

from validation.full_wave.conducting_contour import Contour
from validation.full_wave.line_source import FAR
from validation.full_wave.log_quadrature import log_weights

SMALL = 0.3
"""Argument below which E is evaluated by its series, without subtraction of the pole. [-]"""

DIFFERENCE_BAND, DIFFERENCE_REACH = 2.0, 14
"""Phase from point to point up to which the error of the second difference is 2e-9 (a density at
three points per wavelength), and its number of neighbours. [rad], [-]"""

ROWS_AT_ONCE = 512
"""Rows of a closed curve's static field that are summed in one batch. [-]"""

Matrix = Complex[np.ndarray, "rows columns"] | Float[np.ndarray, "rows columns"]


def green_and_slope(
    phase: Float[np.ndarray, "*n"] | Complex[np.ndarray, "*n"],
) -> tuple[Complex[np.ndarray, "*n"], Complex[np.ndarray, "*n"]]:
    r"""Evaluate :math:`G` and :math:`E = G'(z)/z + 1/2\pi z^2`.

    Parameters
    ----------
    phase
        :math:`z = kR`, not 0, with an imaginary part of 0 or less. [rad]
    """
    size = np.abs(phase)
    clipped = np.where(size < FAR, FAR, phase)
    # Hankel's expansion, DLMF 10.17.5, for orders 0 and 1; the next terms are below 2e-10.
    inverse = 1.0 / (8.0 * clipped)
    square = inverse * inverse
    even = 1 - square * (4.5 - square * (11025 / 24 - square * (108056025 / 720)))
    odd = inverse * (1 - square * (37.5 - square * (893025 / 120)))
    even_1 = 1 + square * (7.5 - square * (14175 / 24 - square * (127702575 / 720)))
    odd_1 = inverse * (3 + square * (-52.5 + square * (1091475 / 120)))
    wave = 0.25 * np.sqrt(2 / np.pi / clipped) * np.exp(-1j * (clipped - 0.25 * np.pi))
    green = -1j * wave * (even + 1j * odd)
    # H₁ has a further phase of 90°.
    slope = 1j * wave * 1j * (even_1 - 1j * odd_1) / clipped
    slope += 1 / (2 * np.pi * clipped * clipped)
    near = size < FAR
    if near.any():
        green[near], slope[near] = _near(phase[near])
    return green, slope


def _near(
    phase: Float[np.ndarray, " n"] | Complex[np.ndarray, " n"],
) -> tuple[Complex[np.ndarray, " n"], Complex[np.ndarray, " n"]]:
    if np.iscomplexobj(phase):
        green = -0.25j * hankel2(0, phase)
        slope = 0.25j * hankel2(1, phase) / phase
    else:
        green = -0.25 * (y0(phase) + 1j * j0(phase))
        slope = 0.25 * (y1(phase) + 1j * j1(phase)) / phase
    slope = slope + 1 / (2 * np.pi * phase * phase)
    small = np.abs(phase) < SMALL
    if small.any():
        slope[small] = _slope_series(phase[small])
    return green, slope


def _slope_series(
    phase: Float[np.ndarray, " n"] | Complex[np.ndarray, " n"],
) -> Complex[np.ndarray, " n"]:
    """Evaluate E by DLMF 10.8.1; five terms leave 1e-13 at 0.3."""
    square = -0.25 * phase * phase
    term = np.full(phase.shape, 0.5 + 0j)
    bessel, rest = np.zeros_like(term), np.zeros_like(term)
    both = 1 - 2 * np.euler_gamma  # ψ(m + 1) + ψ(m + 2)
    for index in range(5):
        bessel += term
        rest += term * both
        both += 1 / (index + 1) + 1 / (index + 2)
        term = term * square / ((index + 1) * (index + 2))
    return np.asarray(bessel * (0.25j + np.log(0.5 * phase) / (2 * np.pi)) - rest / (4 * np.pi))


@functools.cache
def _difference_weights() -> tuple[float, ...]:
    spread = np.cos(np.pi * (np.arange(400) + 0.5) / 400)
    low = np.cos(DIFFERENCE_BAND)
    phase = np.arccos(0.5 * (1 + low) + 0.5 * (1 - low) * spread)
    waves = np.cos(phase[:, None] * np.arange(DIFFERENCE_REACH + 1))
    waves[:, 1:] *= 2
    return tuple(np.linalg.lstsq(waves, -(phase**2), rcond=None)[0].tolist())


def second_difference() -> Float[np.ndarray, " weights"]:
    """Return the weights of a point and of its neighbours in the second difference. [-]."""
    return np.array(_difference_weights())


class CurveOperators:
    """The boundary operators among the points of one curve.

    Parameters
    ----------
    contour
        Open or closed.
    """

    def __init__(self, contour: Contour) -> None:
        self.contour = contour
        self.place = contour.points @ np.array([1.0, 1.0j])
        self.facing = contour.normals @ np.array([1.0, 1.0j])
        self.root = np.sqrt(contour.weights)

    @functools.cached_property
    def static_diagonal(self) -> Float[np.ndarray, " points"]:
        """Diagonal of the weighted static part of N."""
        contour, weights = self.contour, self.contour.weights
        if not contour.closed:
            if contour.schwarzian is None:
                raise ValueError("the open curve has no Schwarzian derivative; use open_strip")
            pole = -np.pi / 6 + contour.step**2 * contour.schwarzian / (12 * np.pi)
            return np.asarray(pole / weights + weights * contour.curvatures**2 / (24 * np.pi))
        found = np.empty(contour.count)
        every = np.arange(contour.count)
        # N of a constant density is 0, and so is its second difference.
        for first in range(0, contour.count, ROWS_AT_ONCE):
            rows = every[first : first + ROWS_AT_ONCE]
            static = static_hypersingular(self, self, rows, every)
            static[rows[:, None] == every] = 0.0
            found[rows] = -(static @ self.root) / self.root[rows]
        return found

    def pairs(
        self, rows: Int[np.ndarray, " rows"], columns: Int[np.ndarray, " columns"], reach: int
    ) -> list[tuple[Int[np.ndarray, " n"], Int[np.ndarray, " n"], Int[np.ndarray, " n"], int]]:
        """Find neighbours on the periodic grid.

        Returns
        -------
        Rows, columns, their distance in steps, and the sign of an odd density when the parameter
        reverses at an edge.
        """
        count = self.contour.count
        steps = rows[:, None] - columns
        if self.contour.closed:
            separations = [(np.abs((steps + count // 2) % count - count // 2), 1)]
        else:
            turned = rows[:, None] + columns + 1
            separations = [(np.abs(steps), 1), (turned, -1), (2 * count - turned, -1)]
        found = []
        for separation, sign in separations:
            row, column = np.nonzero(separation <= reach)
            if row.size:
                found.append((row, column, separation[row, column], sign))
        return found


class Block:
    r"""One block of the four operators, in one medium.

    Parameters
    ----------
    to, source
        The receiving and the source curve.
    rows, columns
        Points of either.
    wavenumber
        Of the medium; :math:`\operatorname{Im} k \le 0`. [rad/m]
    """

    def __init__(
        self,
        to: CurveOperators,
        source: CurveOperators,
        rows: Int[np.ndarray, " rows"],
        columns: Int[np.ndarray, " columns"],
        wavenumber: complex | float,
    ) -> None:
        self.wavenumber = complex(wavenumber)
        self._own = to is source
        self._geometry = _Geometry(to, source, rows, columns)
        geometry = self._geometry
        k = self.wavenumber
        phase = (k.real if k.imag == 0 else k) * geometry.apart
        self.green, self.slope = green_and_slope(phase)
        if self._own:
            self._correct(to, rows, columns, phase)
        self._weights = to.root[rows, None] * source.root[columns]

    def _correct(
        self,
        curve: CurveOperators,
        rows: Int[np.ndarray, " rows"],
        columns: Int[np.ndarray, " columns"],
        phase: Float[np.ndarray, "rows columns"] | Complex[np.ndarray, "rows columns"],
    ) -> None:
        same = self._geometry.same
        if same.any():
            arc = curve.contour.weights[rows]
            logarithm = np.log(0.5 * self.wavenumber * arc + 0j)
            green = -0.25j - (logarithm + np.euler_gamma) / (2 * np.pi)
            slope = 0.125j + (logarithm - 0.5 + np.euler_gamma) / (4 * np.pi)
            shape = same.shape
            self.green[same] = np.broadcast_to(green[:, None], shape)[same]
            self.slope[same] = np.broadcast_to(slope[:, None], shape)[same]
        weights, complex_ = log_weights(), np.iscomplexobj(phase)
        for row, column, steps, _ in curve.pairs(rows, columns, weights.size - 1):
            here = same[row, column]
            some = np.where(here, 1e-3, phase[row, column])
            zeroth, first = (jv(0, some), jv(1, some)) if complex_ else (j0(some), j1(some))
            self.green[row, column] -= weights[steps] * np.where(here, 1.0, zeroth) / (2 * np.pi)
            share = np.where(here, 0.5, first / some)
            self.slope[row, column] += weights[steps] * share / (2 * np.pi)

    def single(self) -> Matrix:
        """Evaluate S, weighted. [m]."""
        return np.asarray(self._weights * self.green)

    def double(self, static: complex | float = 1.0) -> Matrix:
        """Evaluate D, weighted, with a multiple of its static part. [-]."""
        facing = self._geometry.sending
        return self._facing(static * facing, -(self.wavenumber**2) * facing, static)

    def adjoint(self, static: complex | float = 1.0) -> Matrix:
        """Evaluate K', weighted, with a multiple of its static part. [-]."""
        facing = self._geometry.receiving
        return self._facing(-static * facing, self.wavenumber**2 * facing, static)

    def _facing(self, pole: Matrix, wave: Matrix, static: complex | float) -> Matrix:
        geometry = self._geometry
        pole = pole / (2 * np.pi * geometry.apart)
        if self._own:
            # n·(r − r')/R² tends to half the curvature, n'·(r − r')/R² to minus that.
            pole = np.where(geometry.same, -static * geometry.bend / (4 * np.pi), pole)
        return np.asarray(self._weights * (pole + self.slope * wave * geometry.apart))

    def hypersingular(self, *, static: bool = True) -> Matrix:
        """Evaluate N, weighted, with or without its static part. [1/m]."""
        geometry = self._geometry
        product = geometry.receiving * geometry.sending
        cosine = geometry.cosine - 2 * product
        whole = -(self.wavenumber**2) * (self.slope * cosine - self.green * product)
        whole = self._weights * whole
        if static:
            whole += geometry.static(self._weights)
        return np.asarray(whole)


class _Geometry:
    """Distances of points and the directions of their normals."""

    def __init__(
        self,
        to: CurveOperators,
        source: CurveOperators,
        rows: Int[np.ndarray, " rows"],
        columns: Int[np.ndarray, " columns"],
    ) -> None:
        self._to, self._source, self._rows, self._columns = to, source, rows, columns
        own = to is source
        self.same = (rows[:, None] == columns) if own else np.zeros((1, 1), dtype=bool)
        away = to.place[rows, None] - source.place[columns]
        apart = np.abs(away)
        self.apart = np.where(self.same, 1.0, apart) if own else apart
        away = away / self.apart
        here, there = to.facing[rows, None], source.facing[columns]
        self.receiving = here.real * away.real + here.imag * away.imag  # n·R/R, 0 on the diagonal
        self.sending = there.real * away.real + there.imag * away.imag
        self.cosine = here.real * there.real + here.imag * there.imag
        self.bend = to.contour.curvatures[rows, None]

    def static(
        self, weights: Float[np.ndarray, "rows columns"]
    ) -> Float[np.ndarray, "rows columns"]:
        """Evaluate the static part of N, weighted, with its finite part."""
        pole = (self.cosine - 2 * self.receiving * self.sending) / (2 * np.pi * self.apart**2)
        pole *= weights
        if self._to is not self._source:
            return np.asarray(pole)
        curve, rows, columns = self._to, self._rows, self._columns
        if self.same.any():
            row, column = np.nonzero(self.same)
            pole[row, column] = curve.static_diagonal[rows[row]]
        _add_difference(curve, rows, columns, pole)
        return np.asarray(pole)


def static_hypersingular(
    to: CurveOperators,
    source: CurveOperators,
    rows: Int[np.ndarray, " rows"],
    columns: Int[np.ndarray, " columns"],
) -> Float[np.ndarray, "rows columns"]:
    """Evaluate the static part of N, weighted, without its diagonal and its difference."""
    geometry = _Geometry(to, source, rows, columns)
    pole = (geometry.cosine - 2 * geometry.receiving * geometry.sending) / geometry.apart**2
    return np.asarray(pole * to.root[rows, None] * source.root[columns] / (2 * np.pi))


def _add_difference(
    curve: CurveOperators,
    rows: Int[np.ndarray, " rows"],
    columns: Int[np.ndarray, " columns"],
    block: Float[np.ndarray, "rows columns"],
) -> None:
    weights = second_difference()
    root = curve.root
    for row, column, steps, sign in curve.pairs(rows, columns, weights.size - 1):
        both = root[rows[row]] * root[columns[column]]
        block[row, column] += sign * weights[steps] / (4 * np.pi * both)
