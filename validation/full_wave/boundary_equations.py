r"""Boundary integral equations of conductors and dielectrics in two dimensions, TM and TE.

The field :math:`u` is :math:`E_z` (TM) or :math:`H_z` (TE). Outside of all bodies

.. math:: u = u_i + \sum (D\,u - S\,\partial_n u)

with the operators of :mod:`validation.full_wave.layer_potentials`. Unknowns are :math:`u` and
:math:`q = -\partial_n u / k` on the bodies, unless they vanish:

============ ======== ======================================================================
body         unknown  equation, with :math:`f = D u + k S q` and :math:`g = (N u + k K' q)/k`
============ ======== ======================================================================
strip, TM    q        :math:`f = -u_i` (EFIE)
strip, TE    u (jump) :math:`g = -\partial_n u_i/k` (hypersingular)
closed, TM   q        :math:`\tfrac12 q + g + jf = -\partial_n u_i/k - j u_i` (CFIE)
closed, TE   u        :math:`-\tfrac12 u + f - jg = -u_i + j\,\partial_n u_i/k` (CFIE)
dielectric   u and q  Müller's [1]_
============ ======== ======================================================================

In a dielectric of permittivity :math:`\varepsilon` the field's slope is :math:`\rho` times that
outside, :math:`\rho = 1` (TM) or :math:`\varepsilon` (TE). Outer and inner equations are added,
the inner ones times :math:`1/\rho` and 1, so that the poles of :math:`S` (both) and :math:`N`
cancel:

.. math:: f_e - \tfrac1\rho (D_i u + \rho k S_i q) - \tfrac12 (1 + \tfrac1\rho) u = -u_i

.. math:: g_e - (N_i u + \rho k K'_i q)/k + \tfrac12 (1 + \rho) q = -\partial_n u_i / k

Rows and unknowns are weighted by the square root of the arc length; on TE conductors, where N would
be unbounded towards a corner, by the arc length over its largest step. They are ordered along the
scene's longest direction, so that a division between them is a cross-section of the bodies.

References
----------
.. [1] C. Müller, "Foundations of the Mathematical Theory of Electromagnetic Waves", Springer,
   1969; V. Rokhlin, "Solution of acoustic scattering problems by means of second kind integral
   equations", Wave Motion 5, 1983.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Complex, Int

from validation.full_wave.conducting_contour import Contour
from validation.full_wave.layer_potentials import Block, CurveOperators
from validation.full_wave.line_source import LineSource

Polarisation = Literal["TM", "TE"]
"""TM: the electric field along z; TE: the magnetic field along z."""

Matrix = Complex[np.ndarray, "rows columns"]


@dataclass(frozen=True, kw_only=True)
class Body:
    """A conductor, or a closed body of a homogeneous dielectric, in air."""

    contour: Contour
    permittivity: complex | None = None  # ε' - jε''; None: a perfect conductor [-]

    def __post_init__(self) -> None:
        """Refuse an open dielectric, or one with gain."""
        if self.permittivity is None:
            return
        if not self.contour.closed:
            raise ValueError("a dielectric needs a closed contour; give the strip a thickness")
        if not (self.permittivity.real > 0 and self.permittivity.imag <= 0):
            raise ValueError(
                f"permittivity = {self.permittivity} needs a positive real part and, with "
                "exp(+jωt), an imaginary part of 0 or below"
            )


class BoundaryProblem:
    """The matrix of a scene, evaluated by blocks, and its source and receiver vectors.

    Parameters
    ----------
    bodies
        Separated by several steps of their grids.
    polarisation
        TM or TE.
    wavenumber
        In air. [rad/m]
    """

    def __init__(
        self, bodies: Sequence[Body], polarisation: Polarisation, wavenumber: float
    ) -> None:
        self.wavenumber = wavenumber
        self._parts = [_Part(body, polarisation, wavenumber) for body in bodies]
        owner = np.repeat(np.arange(len(bodies)), [part.size for part in self._parts])
        point = np.concatenate([part.points for part in self._parts])
        component = np.concatenate([part.components for part in self._parts])
        places = np.concatenate([part.body.contour.points[part.points] for part in self._parts])
        spread = places - places.mean(axis=0)
        axis = np.linalg.eigh(spread.T @ spread)[1][:, -1]
        # A stable sort keeps the components of a point together.
        order = np.argsort(spread @ axis, kind="stable")
        self._owner, self._point, self._component = owner[order], point[order], component[order]

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self._owner)

    @property
    def symmetric(self) -> bool:
        """Whether the matrix is symmetric: it is for open strips alone."""
        return all(not part.body.contour.closed for part in self._parts)

    def entries(
        self, rows: Int[np.ndarray, " rows"], columns: Int[np.ndarray, " columns"]
    ) -> Matrix:
        """Evaluate a block of the matrix."""
        block = np.empty((len(rows), len(columns)), dtype=np.complex128)
        to, source = self._groups(rows), self._groups(columns)
        for here, one in to:
            for there, other in source:
                block[np.ix_(here, there)] = self._pair(
                    self._parts[one], self._parts[other], rows[here], columns[there]
                )
        return block

    def sides(
        self, sources: Sequence[LineSource], rows: Int[np.ndarray, " rows"] | None = None
    ) -> Complex[np.ndarray, "rows sources"]:
        """Evaluate the right-hand side of each source, at all rows or at some."""
        return self._ends(sources, rows, _Part.incident)

    def heard(
        self, receivers: Sequence[LineSource], rows: Int[np.ndarray, " rows"] | None = None
    ) -> Complex[np.ndarray, "rows receivers"]:
        """Return each receiver's response to the unknowns; a beam receives as it transmits."""
        return self._ends(receivers, rows, _Part.received)

    def _ends(
        self,
        ends: Sequence[LineSource],
        rows: Int[np.ndarray, " rows"] | None,
        of: "Callable[[_Part, LineSource, np.ndarray], np.ndarray]",
    ) -> Complex[np.ndarray, "rows ends"]:
        rows = np.arange(self.size) if rows is None else rows
        found = np.empty((len(rows), len(ends)), dtype=np.complex128)
        for here, one in self._groups(rows):
            points, inverse = np.unique(self._point[rows[here]], return_inverse=True)
            component = self._component[rows[here]]
            for column, end in enumerate(ends):
                found[here, column] = of(self._parts[one], end, points)[component, inverse]
        return found

    def _groups(self, rows: Int[np.ndarray, " rows"]) -> list[tuple[Int[np.ndarray, " n"], int]]:
        owners = self._owner[rows]
        return [(np.flatnonzero(owners == one), int(one)) for one in np.unique(owners)]

    def _pair(
        self,
        to: "_Part",
        source: "_Part",
        rows: Int[np.ndarray, " rows"],
        columns: Int[np.ndarray, " columns"],
    ) -> Matrix:
        here, row = np.unique(self._point[rows], return_inverse=True)
        there, column = np.unique(self._point[columns], return_inverse=True)
        whole = to.coupling(source, here, there)
        test, density = self._component[rows], self._component[columns]
        return np.asarray(whole[test[:, None], density, row[:, None], column])


class _Part:
    """One body's unknowns and equations."""

    def __init__(self, body: Body, polarisation: Polarisation, wavenumber: float) -> None:
        self.body, self.wavenumber = body, wavenumber
        self.curve = CurveOperators(body.contour)
        self.densities: tuple[str, ...]
        closed, magnetic = body.contour.closed, polarisation == "TE"
        self.inside: complex | None = None
        self.slope_ratio = 1.0 + 0j
        self.tests: tuple[tuple[complex, complex], ...]  # of field and slope
        if body.permittivity is not None:
            self.inside = wavenumber * np.sqrt(complex(body.permittivity))
            self.slope_ratio = complex(body.permittivity) if magnetic else 1.0 + 0j
            self.densities, self.tests = ("u", "q"), ((1, 0), (0, 1))
            ratio = self.slope_ratio
            self.identity: tuple[complex, ...] = (-0.5 * (1 + 1 / ratio), 0.5 * (1 + ratio))
        elif magnetic:
            self.densities = ("u",)
            self.tests = ((1, -1j),) if closed else ((0, 1),)
            self.identity = (-0.5,) if closed else (0,)
        else:
            self.densities = ("q",)
            self.tests = ((1j, 1),) if closed else ((1, 0),)
            self.identity = (0.5,) if closed else (0,)
        count = body.contour.count
        self.scale = np.ones(count)
        if magnetic and body.permittivity is None:
            # Towards a corner or an edge, N grows as the inverse of the step.
            self.scale = np.sqrt(body.contour.weights / body.contour.spacing)
        self.size = count * len(self.tests)
        self.points = np.repeat(np.arange(count), len(self.tests))
        self.components = np.tile(np.arange(len(self.tests)), count)

    def coupling(
        self,
        source: "_Part",
        here: Int[np.ndarray, " rows"],
        there: Int[np.ndarray, " columns"],
    ) -> Complex[np.ndarray, "tests densities rows columns"]:
        """Evaluate the equations at some points for densities at some points of a part."""
        outside = Block(self.curve, source.curve, here, there, self.wavenumber)
        shape = (len(self.tests), len(source.densities), len(here), len(there))
        whole = np.zeros(shape, dtype=np.complex128)
        own = source is self
        if own and self.inside is not None:
            self._own_dielectric(whole, outside, here, there)
        else:
            needs_field = any(field for field, _ in self.tests)
            needs_slope = any(slope for _, slope in self.tests)
            for index, density in enumerate(source.densities):
                k = self.wavenumber
                if density == "u":
                    field = outside.double() if needs_field else 0.0
                    slope = outside.hypersingular() / k if needs_slope else 0.0
                else:
                    field = k * outside.single() if needs_field else 0.0
                    slope = outside.adjoint() if needs_slope else 0.0
                for test, (of_field, of_slope) in enumerate(self.tests):
                    whole[test, index] = of_field * field + of_slope * slope
        if own:
            row, column = np.nonzero(here[:, None] == there)
            for component, identity in enumerate(self.identity):
                whole[component, component, row, column] += identity
        return np.asarray(whole * self.scale[here, None] * source.scale[there])

    def _own_dielectric(
        self,
        whole: Complex[np.ndarray, "2 2 rows columns"],
        outside: Block,
        here: Int[np.ndarray, " rows"],
        there: Int[np.ndarray, " columns"],
    ) -> None:
        assert self.inside is not None
        k, ratio = self.wavenumber, self.slope_ratio
        inside = Block(self.curve, self.curve, here, there, self.inside)
        # The static parts of two media cancel, and are not evaluated.
        whole[0, 0] = outside.double(1 - 1 / ratio) - inside.double(0.0) / ratio
        whole[0, 1] = k * (outside.single() - inside.single())
        hyper = outside.hypersingular(static=False) - inside.hypersingular(static=False)
        whole[1, 0] = hyper / k
        whole[1, 1] = outside.adjoint(1 - ratio) - ratio * inside.adjoint(0.0)

    def incident(
        self, source: LineSource, points: Int[np.ndarray, " points"]
    ) -> Complex[np.ndarray, "tests points"]:
        """Evaluate the right-hand sides of a source, weighted."""
        field, slope = self._lit(source, points)
        sides = np.stack([-(one * field + other * slope) for one, other in self.tests])
        return np.asarray(self.scale[points] * sides)

    def received(
        self, receiver: LineSource, points: Int[np.ndarray, " points"]
    ) -> Complex[np.ndarray, "densities points"]:
        """Return a receiver's response to the densities, weighted."""
        field, slope = self._lit(receiver, points)
        k = self.wavenumber
        heard = np.stack([k * (slope if one == "u" else field) for one in self.densities])
        return np.asarray(self.scale[points] * heard)

    def _lit(
        self, source: LineSource, points: Int[np.ndarray, " points"]
    ) -> tuple[Complex[np.ndarray, " points"], Complex[np.ndarray, " points"]]:
        places, normals = self.body.contour.points[points], self.body.contour.normals[points]
        root = self.curve.root[points]
        field = root * source.field(places, self.wavenumber)
        gradient = source.gradient(places, self.wavenumber)
        slope = root * np.einsum("ix,ix->i", normals, gradient) / self.wavenumber
        return np.asarray(field), np.asarray(slope)


def dense_fields(
    problem: BoundaryProblem, sources: Sequence[LineSource], receivers: Sequence[LineSource]
) -> Complex[np.ndarray, "sources receivers"]:
    """Solve for the scattered field of each source at each receiver, by dense decomposition."""
    every = np.arange(problem.size)
    solution = np.linalg.solve(problem.entries(every, every), problem.sides(sources))
    return np.asarray(solution.T @ problem.heard(receivers))
