"""Conductors and dielectrics, TM and TE, against series, Airy, wedges and conservation."""

import numpy as np
import pytest
from scipy.special import jn_zeros, jnp_zeros

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

AIR = 2 * np.pi  # all lengths in wavelengths
BOARD = 2.56 - 0.13j  # plasterboard at 250 GHz
both = pytest.mark.parametrize("polarisation", ["TM", "TE"])


def source(x: float, y: float) -> LineSource:
    return LineSource(position=np.array([x, y]))


@both
@pytest.mark.parametrize("permittivity", [None, BOARD, 3.0 + 0j, 6.0 - 2.0j])
@pytest.mark.parametrize("radius", [0.3, 2.0])
def test_a_cylinder_scatters_as_its_series_says(
    polarisation: Polarisation, permittivity: complex | None, radius: float
) -> None:
    index = 1.0 if permittivity is None else np.sqrt(permittivity).real
    body = Body(
        contour=circle(np.zeros(2), radius, spacing=1 / 7 / index), permittivity=permittivity
    )
    sender, receiver = source(9.0, 0.0), source(7 * np.cos(2), 7 * np.sin(2))
    field = dense_fields(BoundaryProblem([body], polarisation, AIR), [sender], [receiver])[0, 0]
    expected = cylinder_field(
        sender,
        receiver.position,
        AIR,
        radius=radius,
        permittivity=permittivity,
        polarisation=polarisation,
    )
    # Seven points per wavelength: the rule's fit errs by 8e-8, and less in the mean.
    assert abs(field / expected - 1) < 5e-8


@pytest.mark.parametrize("zero", [jn_zeros(0, 5)[4], jnp_zeros(1, 5)[4]])
def test_resonances_of_the_interior_do_not_show_in_te(zero: float) -> None:
    radius, wavenumber = 2.0, float(zero) / 2.0
    body = Body(contour=circle(np.zeros(2), radius, spacing=AIR / wavenumber / 8))
    problem = BoundaryProblem([body], "TE", wavenumber)
    every = np.arange(problem.size)
    assert np.linalg.cond(problem.entries(every, every)) < 10
    sender, receiver = source(9.0, 0.0), source(7 * np.cos(2), 7 * np.sin(2))
    field = dense_fields(problem, [sender], [receiver])[0, 0]
    expected = cylinder_field(
        sender, receiver.position, wavenumber, radius=radius, permittivity=None, polarisation="TE"
    )
    assert abs(field / expected - 1) < 1e-8


@both
@pytest.mark.parametrize("permittivity", [BOARD, 3.5 + 0j])
def test_a_slab_reflects_and_transmits_as_airy_says(
    polarisation: Polarisation, permittivity: complex
) -> None:
    angle, thickness = np.deg2rad(35.0), 0.8
    to = np.array([-np.sin(angle), np.cos(angle)])
    beam = LineSource(position=8.0 * to, aim=-to, displacement=6.0)
    mirrored = 5.0 * to * [-1, 1]
    behind = -5.0 * to - [0, thickness]
    spacing = 1 / 7 / np.sqrt(permittivity).real
    body = box(np.array([0, -thickness / 2]), (26.0, thickness), 0.0, spacing=spacing)
    problem = BoundaryProblem([Body(contour=body, permittivity=permittivity)], polarisation, AIR)
    ends = [LineSource(position=mirrored), LineSource(position=behind)]
    found = link_fields(problem, [beam], ends)[0]
    expected = slab_fields(
        beam,
        mirrored,
        behind,
        AIR,
        permittivity=permittivity,
        thickness=thickness,
        polarisation=polarisation,
    )
    incident = beam.field(np.stack([mirrored * [1, -1], behind]), AIR)
    # The slab's nearer end is seen 36° off the beam's axis, where it is down to
    # exp(-kb(1 - cos ψ)) = 7e-4; there it is diffracted, by a third at most.
    assert np.abs(found - expected).max() < 2e-4 * np.abs(incident).min()
    assert abs(expected[0]) > 0.05 * abs(incident[0])


@both
@pytest.mark.parametrize("inner", [0.0, 60.0, 90.0, 126.0])
def test_an_edge_diffracts_as_its_wedge_does(polarisation: Polarisation, inner: float) -> None:
    length, turned = 40.0, np.deg2rad(inner)
    beam = LineSource(position=np.array([4.0, 5.5]), aim=-np.array([4.0, 5.5]), displacement=1.0)
    receiver = np.array([-1.2, 2.0])
    if inner == 0:
        along = np.linspace(0, length, 60)
        contour = open_strip(np.stack([along, 0 * along], axis=-1), spacing=1 / 8)
    else:
        edge, end = np.zeros(2), np.array([length, 0.0])
        far = length * np.array([np.cos(turned), -np.sin(turned)])
        sides = [np.stack(one) for one in ((edge, far), (far, end), (end, edge))]
        contour = cornered_contour(sides, [1 / 8] * 3)
    problem = BoundaryProblem([Body(contour=contour)], polarisation, AIR)
    field = link_fields(problem, [beam], [LineSource(position=receiver)])[0, 0]
    expected = wedge_field(
        beam, receiver, AIR, open_angle=2 * np.pi - turned, polarisation=polarisation
    )
    # TE waves run along the faces, and come back from their ends diffracted: 1/√(2πkL) = 0.025
    # there, as much again on the way back, and up to 16 times that along a blunt wedge's long
    # sides; in TM they vanish at the faces, and the sharpest corner's grid errs by 1e-4.
    assert abs(field / expected - 1) < (1.2e-2 if polarisation == "TE" else 3e-4)


@both
def test_exchanging_sender_and_receiver_changes_nothing(polarisation: Polarisation) -> None:
    along = np.linspace(-3, 3, 50)
    bodies = [
        Body(contour=open_strip(np.stack([along, 0.1 * np.sin(3 * along)], -1), spacing=0.1)),
        Body(contour=box(np.array([1.0, 3.0]), (1.4, 0.6), 0.3, spacing=0.1)),
        Body(contour=circle(np.array([-2.5, 1.5]), 0.4, spacing=0.06), permittivity=BOARD),
    ]
    ends = [source(-4.0, 5.0), source(6.0, 1.0)]
    fields = dense_fields(BoundaryProblem(bodies, polarisation, AIR), ends, ends)
    # None of the equations but the strip's is symmetric. Corners and edges err by some 2e-5.
    assert abs(fields[0, 1] / fields[1, 0] - 1) < 5e-5
    assert abs(fields[0, 1] - fields[0, 0]) > 0.1 * abs(fields[0, 0])


@both
@pytest.mark.parametrize("lossless", [True, False])
def test_only_a_lossy_dielectric_keeps_power(polarisation: Polarisation, lossless: bool) -> None:
    permittivity = 3.0 + 0j if lossless else 3.0 - 0.3j
    bodies = [
        Body(contour=box(np.array([0.5, 0.0]), (1.5, 0.7), 0.4, spacing=0.07),
             permittivity=permittivity),
        Body(contour=box(np.array([-1.0, 0.6]), (0.8, 0.5), 0.9, spacing=0.1)),
    ]  # fmt: skip
    problem = BoundaryProblem(bodies, polarisation, AIR)
    sender = source(1.5, 2.2)
    own = dense_fields(problem, [sender], [sender])[0, 0]
    # k∮|u|² over a far circle is the source's −Im u, its own ¼ included.
    turns = 2 * np.pi * np.arange(240) / 240
    distance = 4e4
    ring = [source(distance * np.cos(turn), distance * np.sin(turn)) for turn in turns]
    scattered = dense_fields(problem, [sender], ring)[0]
    direct = sender.field(np.stack([one.position for one in ring]), AIR)
    radiated = 2 * np.pi * distance * AIR * np.mean(np.abs(scattered + direct) ** 2)
    kept = 0.25 - own.imag - radiated
    assert abs(own.imag) > 0.005
    if lossless:
        assert abs(kept) < 1e-4 * 0.25  # corners
    else:
        assert kept > 0.01


def test_a_dielectric_of_air_does_nothing() -> None:
    body = Body(contour=box(np.zeros(2), (2.0, 1.0), 0.2, spacing=0.12), permittivity=1.0 + 0j)
    for polarisation in ("TM", "TE"):
        problem = BoundaryProblem([body], polarisation, AIR)
        assert abs(dense_fields(problem, [source(3.0, 3.0)], [source(-2.0, 4.0)])[0, 0]) < 1e-8


def test_what_cannot_be_a_dielectric_is_refused() -> None:
    along = np.linspace(-1, 1, 9)
    strip = open_strip(np.stack([along, 0 * along], axis=-1), spacing=0.1)
    with pytest.raises(ValueError, match="needs a closed contour"):
        Body(contour=strip, permittivity=2.0 + 0j)
    with pytest.raises(ValueError, match="imaginary part of 0 or below"):
        Body(contour=circle(np.zeros(2), 1.0, spacing=0.1), permittivity=2.0 + 0.1j)
