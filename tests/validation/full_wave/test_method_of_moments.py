"""The method of moments against closed forms, conservation laws and another author's code."""

import numpy as np
import pytest
from scipy.constants import speed_of_light
from scipy.special import hankel2, jn_zeros, jv

from validation.full_wave.conducting_contour import Contour, circle, closed_contour, open_strip
from validation.full_wave.line_source import LineSource, greens_function
from validation.full_wave.method_of_moments import (
    conductors_matrix,
    incident,
    received,
    scattered_fields,
    strip_entries,
)
from validation.reference import ROUGH_WALL

DATA = ROUGH_WALL.parent
WAVENUMBER = 2 * np.pi  # all lengths in wavelengths


def source(x: float, y: float) -> LineSource:
    return LineSource(position=np.array([x, y]))


def cylinder_series(radius: float, wavenumber: float, first: float, second: float) -> complex:
    """Field of a line source at one place over another 2 rad round a cylinder at the origin."""
    order = np.arange(-int(wavenumber * radius) - 40, int(wavenumber * radius) + 41)
    terms = jv(order, wavenumber * radius) / hankel2(order, wavenumber * radius)
    terms = terms * hankel2(order, wavenumber * first) * hankel2(order, wavenumber * second)
    return complex(0.25j * np.sum(terms * np.exp(2j * order)))


def flat_strip(length: float, spacing: float) -> Contour:
    along = np.linspace(-length / 2, length / 2, 50)
    return open_strip(np.stack([along, 0 * along], axis=-1), spacing=spacing)


def kite(count: int) -> Contour:
    """Kress' kite, three wavelengths wide: closed, and not convex."""

    def curve(angle: np.ndarray) -> np.ndarray:
        c, s, c2, s2 = np.cos(angle), np.sin(angle), np.cos(2 * angle), np.sin(2 * angle)
        points = np.stack([c + 0.65 * c2 - 0.65, 1.5 * s], axis=-1)
        slopes = np.stack([-s - 1.3 * s2, 1.5 * c], axis=-1)
        return np.stack([points, slopes, np.stack([-c - 2.6 * c2, -1.5 * s], axis=-1)])

    return closed_contour(curve, count)


@pytest.mark.parametrize("radius", [0.3, 5.0])
def test_a_cylinder_scatters_as_its_series_says(radius: float) -> None:
    sender, receiver = source(9.0, 0.0), source(7 * np.cos(2), 7 * np.sin(2))
    body = circle(np.zeros(2), radius, spacing=1 / 7)
    field = scattered_fields([body], [sender], [receiver], WAVENUMBER)[0, 0]
    expected = cylinder_series(radius, WAVENUMBER, 9.0, 7.0)
    # Seven points per wavelength: the rule's fit errs by 8e-8, and less in the mean.
    assert abs(field / expected - 1) < 1e-8


def test_a_resonance_of_the_interior_does_not_show() -> None:
    # J₀ vanishes on the contour: the electric-field equation alone has no unique current.
    radius, wavenumber = 2.0, float(jn_zeros(0, 5)[4]) / 2.0
    body = circle(np.zeros(2), radius, spacing=2 * np.pi / wavenumber / 8)
    every = np.arange(body.count)
    assert np.linalg.cond(strip_entries(body, wavenumber, every, every)) > 1e5
    assert np.linalg.cond(conductors_matrix([body], wavenumber)) < 10
    sender, receiver = source(9.0, 0.0), source(7 * np.cos(2), 7 * np.sin(2))
    field = scattered_fields([body], [sender], [receiver], wavenumber)[0, 0]
    assert abs(field / cylinder_series(radius, wavenumber, 9.0, 7.0) - 1) < 1e-8


def test_exchanging_sender_and_receiver_changes_nothing() -> None:
    # The combined equation is not symmetric, so nothing forces this upon its solution.
    bodies = [
        flat_strip(6.0, 1 / 10),
        circle(np.array([1.0, 3.0]), 0.8, spacing=1 / 10),
        circle(np.array([-2.5, 1.5]), 0.4, spacing=1 / 10),
    ]
    ends = [source(-4.0, 5.0), source(6.0, 1.0)]
    fields = scattered_fields(bodies, ends, ends, WAVENUMBER)
    assert abs(fields[0, 1] / fields[1, 0] - 1) < 1e-7  # ten points per wavelength
    assert abs(fields[0, 1] - fields[0, 0]) > 0.1 * abs(fields[0, 0])


@pytest.mark.parametrize("shape", ["strip", "kite", "both"])
def test_what_is_radiated_is_what_the_source_gives(shape: str) -> None:
    # Conductors lose nothing: k∮|u|² over a far circle is the source's −Im u, its own ¼ included.
    kites = kite(160)
    strip = flat_strip(5.0, 1 / 10)
    moved = open_strip(strip.points[[0, 15, 30, -1]] + np.array([0.0, 3.0]), spacing=1 / 10)
    bodies = {"strip": [strip], "kite": [kites], "both": [kites, moved]}[shape]
    sender = source(3.5, 1.2)
    currents = np.linalg.solve(
        conductors_matrix(bodies, WAVENUMBER), incident(bodies, sender, WAVENUMBER)
    )
    own = received(bodies, sender, WAVENUMBER) @ currents
    angles = 2 * np.pi * np.arange(400) / 400
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    root = np.concatenate([np.sqrt(body.weights) for body in bodies])
    places = np.concatenate([body.points for body in bodies])
    far = np.exp(1j * WAVENUMBER * directions @ sender.position)
    far = far + np.exp(1j * WAVENUMBER * directions @ places.T) @ (root * currents)
    radiated = np.mean(np.abs(far) ** 2) / 4  # |G|² kR → 1/8π over 2π
    assert radiated == pytest.approx(0.25 - own.imag, rel=1e-6)
    assert abs(own.imag) > 0.005  # the bodies matter, far more than the tolerance


def test_the_current_at_an_edge_grows_as_the_inverse_square_root() -> None:
    strip = flat_strip(5.0, 1 / 80)
    sides = incident([strip], source(0.5, 20.0), WAVENUMBER)
    every = np.arange(strip.count)
    weighted = np.linalg.solve(strip_entries(strip, WAVENUMBER, every, every), sides)
    current = np.abs(weighted) / np.sqrt(strip.weights)
    for order in (slice(None), slice(None, None, -1)):
        place, near = strip.points[order, 0][:3], current[order][:3]
        distance = 2.5 - np.abs(place)
        assert distance.max() < 0.01
        slopes = np.diff(np.log(near)) / np.diff(np.log(distance))
        # The next term is kd smaller: 0.06 at most.
        np.testing.assert_allclose(slopes, -0.5, atol=0.03)


def test_a_long_strip_mirrors_as_the_image_source() -> None:
    strip = flat_strip(120.0, 1 / 7)
    field = scattered_fields([strip], [source(-2.0, 3.0)], [source(2.0, 3.0)], WAVENUMBER)[0, 0]
    image = -greens_function(np.array([WAVENUMBER * np.hypot(4.0, 6.0)]))[0]
    # A Dirichlet edge at 60 wavelengths sees a dipole: (h/d)² = 0.0025 of the field at 1/√2.
    assert abs(field / image - 1) < 2.5e-3


def test_refining_the_grid_of_a_rough_strip_changes_nothing() -> None:
    along = np.linspace(-10, 10, 801)
    heights = 0.15 * np.sin(2.1 * along + 0.3) + 0.1 * np.cos(4.7 * along)
    profile = np.stack([along, heights], axis=-1)
    ends = [source(-6.0, 12.0), source(9.0, 8.0)]
    coarse, fine = (
        scattered_fields([open_strip(profile, spacing=1 / n)], ends, ends, WAVENUMBER)
        for n in (7, 21)
    )
    # Seven points per wavelength leave the current's ripple 1e-5.
    assert np.linalg.norm(coarse - fine) < 3e-5 * np.linalg.norm(fine)


def test_too_coarse_a_grid_does_change_the_field() -> None:
    along = np.linspace(-10, 10, 801)
    profile = np.stack([along, 0.15 * np.sin(2.1 * along)], axis=-1)
    ends = [source(-6.0, 12.0)]
    coarse, fine = (
        scattered_fields([open_strip(profile, spacing=1 / n)], ends, ends, WAVENUMBER)
        for n in (2.5, 12)
    )
    assert np.linalg.norm(coarse - fine) > 1e-3 * np.linalg.norm(fine)


def test_a_grid_point_stands_for_its_arc() -> None:
    body = circle(np.array([1.0, 2.0]), 0.5, spacing=0.05)
    assert body.weights.sum() == pytest.approx(np.pi, rel=1e-12)
    np.testing.assert_allclose(body.curvatures, 2.0)
    np.testing.assert_allclose(body.points + 0.5 * -body.normals, [[1.0, 2.0]] * body.count)
    strip = flat_strip(5.0, 0.1)
    # Without the edges' singularity the rule is a midpoint rule, of error (π/N)²/24 at the ends.
    assert strip.weights.sum() == pytest.approx(5.0, rel=1e-3)
    assert strip.spacing < 0.1 * (1 + 1e-9)
    assert np.all(np.diff(strip.points[:, 0]) > 0)


def test_curves_that_cannot_be_sampled_are_refused() -> None:
    line = np.stack([np.linspace(0, 1, 5), np.zeros(5)], axis=-1)
    with pytest.raises(ValueError, match="at least four points"):
        open_strip(line[:3], spacing=0.1)
    with pytest.raises(ValueError, match="at least four points"):
        open_strip(line[[0, 1, 1, 2, 3]], spacing=0.1)
    with pytest.raises(ValueError, match="must be positive"):
        open_strip(line, spacing=0.0)
    with pytest.raises(ValueError, match="must be positive"):
        circle(np.zeros(2), 1.0, spacing=-1.0)

    def clockwise(angle: np.ndarray) -> np.ndarray:
        points = np.stack([np.cos(angle), -np.sin(angle)], axis=-1)
        slopes = np.stack([-np.sin(angle), -np.cos(angle)], axis=-1)
        return np.stack([points, slopes, -points])

    with pytest.raises(ValueError, match="clockwise"):
        closed_contour(clockwise, 50)


@pytest.mark.slow
def test_hidden_cylinders_are_those_of_another_author_s_code() -> None:
    wall = np.load(DATA / "rough_wall_decimated.npz")
    two = np.load(DATA / "two_cylinders_decimated.npz")
    frequency = float(two["frequency"][0])
    wavenumber = 2 * np.pi * frequency / speed_of_light
    spacing = speed_of_light / frequency / 8
    strip = open_strip(wall["wall_profile"], spacing=spacing)
    posts = [
        circle(centre[:2], float(radius), spacing=spacing)
        for centre, radius in zip(two["cylinder_centre"], two["cylinder_radius"], strict=True)
    ]
    matrix = conductors_matrix([strip, *posts], wavenumber)
    array = [source(*place[:2]) for place in two["aperture_position"]]
    unlit = np.zeros((len(matrix) - strip.count, len(array)))  # no direct link with the posts
    sides = np.stack([incident([strip], one, wavenumber) for one in array], axis=-1)
    currents = np.linalg.solve(matrix, np.concatenate([sides, unlit]))
    echo = -np.sum(sides * currents[: strip.count], axis=0)
    # That code errs by 4e-6 itself, and its file is complex64.
    assert np.linalg.norm(echo - two["echo"][:, 0]) < 1e-5 * np.linalg.norm(echo)
    alone = wall["echo"][:, 0].astype(np.complex128)
    ghosts = two["echo"][:, 0] - alone
    assert np.linalg.norm(echo - alone - ghosts) < 2e-5 * np.linalg.norm(ghosts)
