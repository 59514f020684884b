r"""Accuracy of the full-wave solver for both polarisations, dielectrics and edges.

Run as ``python -m validation.experiments.full_wave.bodies``; it takes half a minute.

Not in the thesis, whose solver is a commercial one. Closed forms are the references
(:mod:`validation.analytic.line_source_scattering`), lengths are in wavelengths. Claims that are
asserted, each for TM and TE:

- A cylinder of two wavelengths' radius, of a conductor, of plasterboard at 250 GHz
  (:math:`\varepsilon = 2.56 - 0.13j`), and of a lossless dielectric, scatters as its series says,
  to 1e-7.
- The reflection and transmission of a beam at 35° by a slab of plasterboard, 34 wavelengths wide
and
  1.3 thick, agree with Airy's formula to 1e-4 of the incident field; at the slab's ends the beam is
  down to 2e-4.
- The diffraction by the edges of a half plane and of a wedge of 90° agrees with their series: in TM
  to 1e-4, the error of the grid at the wedge's corner; in TE to 1.2e-2, since TE waves travel along
  the faces, 40 wavelengths long, and are reflected at their ends.
"""

from dataclasses import dataclass

import numpy as np

from validation.analytic.line_source_scattering import cylinder_field, slab_fields, wedge_field
from validation.full_wave.boundary_equations import (
    Body,
    BoundaryProblem,
    Polarisation,
    dense_fields,
)
from validation.full_wave.conducting_contour import circle, open_strip
from validation.full_wave.direct_solution import link_fields
from validation.full_wave.graded_contour import box, cornered_contour
from validation.full_wave.line_source import LineSource

WAVENUMBER = 2 * np.pi
POLARISATIONS: tuple[Polarisation, ...] = ("TM", "TE")

PLASTERBOARD = 2.56 - 0.13j
CYLINDERS = {"conductor": None, "plasterboard": PLASTERBOARD, "lossless dielectric": 3.0 + 0j}
PER_WAVELENGTH = 7.0
"""Grid points for each wavelength in the denser medium. [-]"""

MOST_SERIES_ERROR, MOST_AIRY_ERROR = 1e-7, 1e-4
MOST_EDGE_ERROR = {"TM": 1e-4, "TE": 1.2e-2}
FACE = 40.0
"""Length of an edge's faces, in wavelengths. [-]"""


@dataclass(frozen=True, kw_only=True)
class BodyError:
    """Error of one body's field against its closed form."""

    name: str
    error: float  # relative [-]
    most: float
    reference: str


def body_errors() -> tuple[BodyError, ...]:
    """Solve all bodies in both polarisations."""
    found = []
    for polarisation in POLARISATIONS:
        for name, permittivity in CYLINDERS.items():
            error = _cylinder_error(permittivity, polarisation)
            found.append((f"cylinder, {name}, {polarisation}", error, MOST_SERIES_ERROR, "series"))
        found.append(
            (
                f"slab of plasterboard, {polarisation}",
                _slab_error(polarisation),
                MOST_AIRY_ERROR,
                "Airy",
            )
        )
        for name, right in (("half plane", False), ("right wedge", True)):
            error = _edge_error(polarisation, right=right)
            most = MOST_EDGE_ERROR[polarisation]
            found.append((f"edge of a {name}, {polarisation}", error, most, "series"))
    return tuple(
        BodyError(name=name, error=error, most=most, reference=reference)
        for name, error, most, reference in found
    )


def _cylinder_error(permittivity: complex | None, polarisation: Polarisation) -> float:
    index = 1.0 if permittivity is None else float(np.sqrt(permittivity).real)
    contour = circle(np.zeros(2), 2.0, spacing=1 / PER_WAVELENGTH / index)
    problem = BoundaryProblem(
        [Body(contour=contour, permittivity=permittivity)], polarisation, WAVENUMBER
    )
    ends = [LineSource(position=np.array(place)) for place in ((9.0, 0.0), (-2.9, 6.4))]
    found = dense_fields(problem, ends[:1], ends[1:])[0, 0]
    expected = cylinder_field(
        ends[0],
        ends[1].position,
        WAVENUMBER,
        radius=2.0,
        permittivity=permittivity,
        polarisation=polarisation,
    )
    return float(abs(found / expected - 1))


def _slab_error(polarisation: Polarisation) -> float:
    angle, thickness = np.deg2rad(35.0), 1.3
    to = np.array([-np.sin(angle), np.cos(angle)])
    beam = LineSource(position=8.0 * to, aim=-to, displacement=6.0)
    mirrored, behind = 5.0 * to * [-1, 1], -5.0 * to - [0, thickness]
    spacing = 1 / PER_WAVELENGTH / float(np.sqrt(PLASTERBOARD).real)
    contour = box(np.array([0, -thickness / 2]), (34.0, thickness), 0.0, spacing=spacing)
    problem = BoundaryProblem(
        [Body(contour=contour, permittivity=PLASTERBOARD)], polarisation, WAVENUMBER
    )
    ends = [LineSource(position=mirrored), LineSource(position=behind)]
    found = link_fields(problem, [beam], ends)[0]
    expected = slab_fields(
        beam,
        mirrored,
        behind,
        WAVENUMBER,
        permittivity=PLASTERBOARD,
        thickness=thickness,
        polarisation=polarisation,
    )
    incident = beam.field(np.stack([mirrored * [1, -1], behind]), WAVENUMBER)
    return float(np.max(np.abs(found - expected) / np.abs(incident)))


def _edge_error(polarisation: Polarisation, *, right: bool) -> float:
    beam = LineSource(position=np.array([4.0, 5.5]), aim=np.array([-4.0, -5.5]), displacement=1.0)
    receiver = np.array([-1.2, 2.0])
    spacing = 1 / PER_WAVELENGTH
    if right:
        corners = np.array([[0.0, 0.0], [0.0, -FACE], [FACE, 0.0]])
        sides = [np.stack([corners[one], corners[(one + 1) % 3]]) for one in range(3)]
        contour = cornered_contour(sides, [spacing] * 3)
    else:
        along = np.linspace(0, FACE, 60)
        contour = open_strip(np.stack([along, 0 * along], axis=-1), spacing=spacing)
    problem = BoundaryProblem([Body(contour=contour)], polarisation, WAVENUMBER)
    found = link_fields(problem, [beam], [LineSource(position=receiver)])[0, 0]
    open_angle = 1.5 * np.pi if right else 2 * np.pi
    expected = wedge_field(
        beam, receiver, WAVENUMBER, open_angle=open_angle, polarisation=polarisation
    )
    return float(abs(found / expected - 1))


def check(errors: tuple[BodyError, ...]) -> None:
    """Raise if an error is too large.

    Raises
    ------
    RuntimeError
        If a claim does not hold.
    """
    for one in errors:
        if not one.error < one.most:
            raise RuntimeError(f"{one.name}: {one.error:.1e}; {one.most:.1e} is claimed")


def main() -> None:
    """Print all errors, and check the claims."""
    errors = body_errors()
    for one in errors:
        print(f"{one.name:40s} {one.error:.1e} off its {one.reference} (limit {one.most:.1e})")
    check(errors)


if __name__ == "__main__":
    main()
