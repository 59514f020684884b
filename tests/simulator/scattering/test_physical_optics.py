"""Physical optics against closed forms; visibility is given here, not traced."""

# Over 400 lines: closed forms for the same few facets.

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jaxtyping import Bool, Complex, Float
from scipy.constants import speed_of_light
from scipy.spatial.transform import Rotation
from scipy.special import hankel2

from estimator.measurement.model import Waves
from scenes.realisations.object_surface import Surface
from scenes.surfaces.height_synthesis import rough_profile
from scenes.surfaces.shape import grid_triangles
from simulator.antennas.ports import Pattern, Ports
from simulator.geometry.facets import Facets, profile_surface, surface_facets
from simulator.scattering.physical_optics import facet_transform, scattered
from simulator.scattering.small_slope_2d import normal_component

BAND = np.linspace(220e9, 295e9, 76)
WAVENUMBERS = 2 * np.pi * BAND / speed_of_light
STEP = speed_of_light / 295e9 / 4

SUM_ERROR = 1e-5
"""What the non-uniform FFT and the interpolation over frequency add, relative. [-]"""


def isotropic(
    directions: Float[np.ndarray, "facets 3"],
    distances: Float[np.ndarray, " facets"],
    frequencies: Float[np.ndarray, " nodes"],
) -> Float[np.ndarray, "1 facets"]:
    return np.ones((1, len(distances)))


def windowed(
    port: Float[np.ndarray, " 3"], centre: Float[np.ndarray, " 3"], radius: float
) -> Pattern:
    """1 around a point of the surface, falling smoothly to 0 at a radius: hides the edges."""

    def pattern(
        directions: Float[np.ndarray, "facets 3"],
        distances: Float[np.ndarray, " facets"],
        frequencies: Float[np.ndarray, " nodes"],
    ) -> Float[np.ndarray, "1 facets"]:
        away = np.linalg.norm(port + distances[:, None] * directions - centre, axis=-1) / radius
        # A cosine roll-off has no jump in its slope, so that its ends scatter next to nothing.
        return np.where(away < 1, np.cos(np.pi / 2 * np.clip(2 * away - 1, 0, 1)) ** 2, 0.0)[None]

    return pattern


def ports(
    positions: Float[np.ndarray, "ports 3"],
    facets: Facets,
    *,
    pattern: Pattern = isotropic,
    visible: Bool[np.ndarray, "ports facets"] | None = None,
    nodes: int = 1,
) -> Ports:
    if visible is None:
        visible = np.ones((len(positions), facets.count), dtype=bool)
    return Ports(positions=positions, pattern=pattern, visible=visible, nodes=nodes)


def flat_wall(length: float, *, y: float = 0.0, step: float = STEP) -> Facets:
    """A line along x; seen from both sides."""
    count = int(np.ceil(length / step)) + 1
    profile = np.zeros((count, 3))
    profile[:, 0], profile[:, 1] = np.linspace(-length / 2, length / 2, count), y
    return surface_facets(profile_surface(profile))


def flat_plate(width: float, height: float, *, step: float, closed: bool = False) -> Facets:
    """A plate of triangles at y = 0, normal to y."""
    x, z = (
        np.linspace(-side / 2, side / 2, int(np.ceil(side / step)) + 1) for side in (width, height)
    )
    across, up = np.meshgrid(x, z, indexing="ij")
    vertices = np.stack([across.ravel(), np.zeros(across.size), up.ravel()], axis=-1)
    cells = grid_triangles(np.arange(across.size).reshape(across.shape))
    return surface_facets(
        Surface(
            name="plate",
            material="metal",
            vertices=vertices,
            mean_vertices=vertices,
            cells=cells,
            closed=closed,
        )
    )


def image_source(length: float, waves: Waves) -> Complex[np.ndarray, " freqs"]:
    """What a mirror returns over a path of that length: the field of its image, turned round."""
    if waves == "cylindrical":
        return np.asarray(0.25j * hankel2(0, WAVENUMBERS * length))
    return np.asarray(-np.exp(-1j * WAVENUMBERS * length) / (2 * WAVENUMBERS * length))


PAIRS = [
    ((-0.3, -0.5, 0.0), (0.3, -0.5, 0.0)),  # 62° from the wall
    ((-0.05, -0.8, 0.0), (0.3, -0.3, 0.0)),
    ((0.0, -0.6, 0.0), (0.001, -0.6, 0.0)),  # almost monostatic
]


@pytest.mark.parametrize("waves", ["spherical", "cylindrical"])
@pytest.mark.parametrize(("source", "receiver"), PAIRS)
def test_a_long_mirror_gives_the_field_of_the_image_source(
    waves: Waves, source: tuple[float, ...], receiver: tuple[float, ...]
) -> None:
    wall = flat_wall(1.2)
    start, end = np.array(source), np.array(receiver)
    image = start * [1, -1, 1]
    specular = image + (end - image) * image[1] / (image[1] - end[1])
    window = windowed(start, specular, 0.25)
    field = scattered(
        wall, ports(start[None], wall, pattern=window), ports(end[None], wall), BAND, waves=waves
    )[0]
    length = float(np.linalg.norm(image - end))
    # Magnitude, sign and delay at once. The next order of stationary phase is 1/(k L) of the
    # field, 3e-4 at 0.8 m; the window's curvature adds L/(k·radius²), 3e-3, where it is not flat.
    error = np.abs(field / image_source(length, waves) - 1)
    assert error.max() <= 5e-4


@pytest.mark.parametrize("waves", ["spherical", "cylindrical"])
def test_a_finite_mirror_differs_from_the_image_source_by_its_edges(waves: Waves) -> None:
    half, start, end = 0.3, np.array([-0.3, -0.5, 0.0]), np.array([0.25, -0.4, 0.0])
    wall = flat_wall(2 * half)
    field = scattered(wall, ports(start[None], wall), ports(end[None], wall), BAND, waves=waves)[0]
    image = start * [1, -1, 1]
    length = float(np.linalg.norm(image - end))
    error = field / image_source(length, waves) - 1
    # An end of a stationary-phase integral of g·exp(-jkL(x)) adds g/(jk·dL/dx) there.
    bound = np.zeros(BAND.size)
    for x in (-half, half):
        to_start, to_end = start - [x, 0, 0], end - [x, 0, 0]
        r, s = np.linalg.norm(to_start), np.linalg.norm(to_end)
        obliquity = (abs(to_start[1]) / r + abs(to_end[1]) / s) / (8 * np.pi)
        spread = np.sqrt(2 * np.pi / WAVENUMBERS / (r + s)) if waves == "spherical" else 1.0
        slope = abs(to_start[0] / r + to_end[0] / s)
        bound += obliquity * spread / np.sqrt(r * s) / (WAVENUMBERS * slope)
    bound /= np.abs(image_source(length, waves))
    # 10 %: the edge's own next order; 1e-3: that of the mirror's middle.
    assert np.all(np.abs(error) <= 1.1 * bound + 1e-3)
    # And the ripple is there: half of the bound is reached somewhere in the band.
    assert np.abs(error).max() >= 0.5 * bound.max()


def test_a_conducting_plate_of_triangles_gives_the_field_of_the_image_source() -> None:
    frequencies = np.linspace(57e9, 64e9, 5)
    plate = flat_plate(0.26, 0.26, step=speed_of_light / 64e9 / 4)
    start, end = np.array([-0.03, -0.12, 0.01]), np.array([0.04, -0.10, -0.01])
    image = start * [1, -1, 1]
    specular = image + (end - image) * image[1] / (image[1] - end[1])
    window = windowed(start, specular, 0.125)
    field = scattered(
        plate,
        ports(start[None], plate, pattern=window),
        ports(end[None], plate),
        frequencies,
        waves="spherical",
    )[0]
    wavenumbers = 2 * np.pi * frequencies / speed_of_light
    length = float(np.linalg.norm(image - end))
    expected = -np.exp(-1j * wavenumbers * length) / (2 * wavenumbers * length)
    # 1/(kL) is 3e-3 here, once for each of the two dimensions of the plate.
    assert np.abs(field / expected - 1).max() <= 1e-2


RCS_BAND = np.linspace(57e9, 64e9, 4)
RCS_RANGE = 50.0  # 2D²/λ is 5 m for the plate's diagonal


def plate_cross_section(angles: Float[np.ndarray, " angles"]) -> Float[np.ndarray, "angles freqs"]:
    plate = flat_plate(0.1, 0.06, step=speed_of_light / 64e9 / 4)
    outward = np.stack([np.sin(angles), -np.cos(angles), 0 * angles], axis=-1)
    array = ports(RCS_RANGE * outward, plate)
    field = scattered(plate, array, array, RCS_BAND, waves="spherical")
    wavelengths = speed_of_light / RCS_BAND
    return np.asarray((4 * np.pi) ** 3 * RCS_RANGE**4 * np.abs(field / wavelengths) ** 2)


def test_a_plates_cross_section_is_four_pi_area_squared_over_wavelength_squared() -> None:
    area = 0.1 * 0.06
    expected = 4 * np.pi * (area * RCS_BAND / speed_of_light) ** 2
    error_db = 10 * np.log10(plate_cross_section(np.zeros(1))[0] / expected)
    # Residual quadratic phase k·D²/8R at the corners, twice: 0.03 rad, 0.002 dB.
    assert np.abs(error_db).max() <= 0.005


def test_off_specular_the_plates_echo_is_a_sinc_of_the_phase_along_it() -> None:
    angles = np.radians(np.linspace(-35.0, 35.0, 41))
    wavenumbers = 2 * np.pi * RCS_BAND / speed_of_light
    phase = wavenumbers * np.sin(angles)[:, None] * 0.1  # 2k·sin φ·a/2
    area = 0.1 * 0.06
    expected = np.cos(angles)[:, None] * np.sinc(phase / np.pi)
    measured = np.sqrt(plate_cross_section(angles) / (4 * np.pi)) * (2 * np.pi / wavenumbers) / area
    # As above, 0.03 rad of quadratic phase fills the nulls by a tenth of that.
    np.testing.assert_allclose(measured, np.abs(expected), atol=4e-3)


def random_facets(rng: np.random.Generator, kind: str) -> Facets:
    """A bumpy surface about 10 cm wide, at the origin, its normals about -y."""
    if kind == "line":
        count = 200
        profile = np.zeros((count, 3))
        profile[:, 0] = np.linspace(-0.03, 0.03, count)
        profile[:, 1] = 1e-4 * rng.standard_normal(count)
        return surface_facets(profile_surface(profile))
    plate = flat_plate(4e-3, 4e-3, step=0.25e-3)
    bumpy = plate.normals + 0.2 * rng.standard_normal(plate.normals.shape)
    return Facets(
        centres=plate.centres + 1e-4 * rng.standard_normal(plate.centres.shape),
        normals=bumpy / np.linalg.norm(bumpy, axis=-1, keepdims=True),
        sizes=plate.sizes,
        edges=plate.edges,
        two_sided=rng.random(plate.count) < 0.5,
    )


def beam(axis: Float[np.ndarray, " 3"]) -> Pattern:
    def pattern(
        directions: Float[np.ndarray, "facets 3"],
        distances: Float[np.ndarray, " facets"],
        frequencies: Float[np.ndarray, " nodes"],
    ) -> Float[np.ndarray, "1 facets"]:
        return np.asarray(np.exp(-3 * (1 - directions @ axis))[None])

    return pattern


@pytest.mark.parametrize(
    ("kind", "waves"), [("line", "spherical"), ("line", "cylindrical"), ("triangle", "spherical")]
)
@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 10_000))
def test_exchanging_transmitter_and_receiver_changes_nothing(
    kind: str, waves: Waves, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    facets = random_facets(rng, kind)
    flat = np.array([1, 1, 0 if kind == "line" else 1])
    one, other = rng.uniform([-0.4, -0.5, -0.3], [0.4, -0.1, 0.3], (2, 3)) * flat
    axes = -one / np.linalg.norm(one), -other / np.linalg.norm(other)
    seen = rng.random((2, 1, facets.count)) < 0.8
    first = ports(one[None], facets, pattern=beam(axes[0]), visible=seen[0])
    second = ports(other[None], facets, pattern=beam(axes[1]), visible=seen[1])
    there = scattered(facets, first, second, BAND, waves=waves)
    back = scattered(facets, second, first, BAND, waves=waves)
    assert np.linalg.norm(there) > 0
    assert np.linalg.norm(there - back) <= 1e-6 * np.linalg.norm(there)


@settings(deadline=None, max_examples=15)
@given(
    angle=st.floats(-np.pi, np.pi), x=st.floats(-5, 5), y=st.floats(-5, 5), seed=st.integers(0, 99)
)
def test_moving_the_whole_scene_changes_nothing(
    angle: float, x: float, y: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    facets = random_facets(rng, "triangle")
    turn, shift = Rotation.from_euler("z", angle).as_matrix(), np.array([x, y, 0.3])
    moved = Facets(
        centres=facets.centres @ turn.T + shift,
        normals=facets.normals @ turn.T,
        sizes=facets.sizes,
        edges=facets.edges @ turn.T,
        two_sided=facets.two_sided,
    )
    array = rng.uniform([-0.1, -0.6, -0.1], [0.1, -0.5, 0.1], (3, 3))
    here = ports(array, facets)
    there = ports(array @ turn.T + shift, moved)
    still = scattered(facets, here, here, BAND, waves="spherical")
    gone = scattered(moved, there, there, BAND, waves="spherical")
    assert np.linalg.norm(gone - still) <= SUM_ERROR * np.linalg.norm(still)


def test_a_monostatic_echo_is_the_link_of_two_equal_ports() -> None:
    facets = random_facets(np.random.default_rng(5), "line")
    places = np.array([[-0.1, -0.5, 0.0], [0.1, -0.4, 0.0]])
    same = ports(places, facets)
    echo = scattered(facets, same, same, BAND, waves="spherical")
    pairs = scattered(facets, ports(places, facets), ports(places, facets), BAND, waves="spherical")
    # Between directions of the grid, echoes interpolate products of what pairs interpolate apart.
    assert np.linalg.norm(echo - pairs) <= 1e-3 * np.linalg.norm(echo)


def test_finer_facets_change_nothing() -> None:
    start, end = np.array([[-0.1, -0.4, 0.0]]), np.array([[0.2, -0.3, 0.0]])
    coarse, fine = (flat_wall(0.2, step=step) for step in (STEP, STEP / 5))
    fields = [
        scattered(wall, ports(start, wall), ports(end, wall), BAND, waves="spherical")
        for wall in (coarse, fine)
    ]
    # The phase over a facet is not quite linear: k·(λ/4)²/8·(1/r + 1/s)/2, 1e-4 rad at the ends.
    error = np.linalg.norm(fields[0] - fields[1]) / np.linalg.norm(fields[1])
    assert error <= 2e-4


@pytest.mark.parametrize(
    "corners",
    [
        pytest.param([[0, 0, 0], [0.25e-3, 0, 0], [0, 0, 0.25e-3]], id="right"),
        pytest.param([[0, 0, 0], [0.2e-3, 0, 0.02e-3], [-0.2e-3, 0, 0.02e-3]], id="obtuse"),
    ],
)
def test_a_facets_spectrum_is_its_transform_at_each_frequency(corners: list[list[float]]) -> None:
    # Seen obliquely its phase slopes most; the obtuse one's longest side is not among its edges.
    vertices = np.array(corners)
    facets = surface_facets(
        Surface(
            name="facet",
            material="metal",
            vertices=vertices,
            mean_vertices=vertices,
            cells=np.array([[0, 1, 2]]),
            closed=False,
        )
    )
    port = facets.centres + 0.5 * np.array([[0.95, -np.sqrt(1 - 0.95**2), 0.0]])
    frequencies = np.linspace(220e9, 330e9, 23)
    array = ports(port, facets)
    field = scattered(facets, array, array, frequencies, waves="spherical")[0]
    towards = port[0] - facets.centres[0]
    distance = float(np.linalg.norm(towards))
    wavenumbers = 2 * np.pi * frequencies / speed_of_light
    advances = 2 * wavenumbers[:, None, None] * (facets.edges[None, 0] @ (towards / distance))
    amplitude = -1j * 2 * abs(towards[1]) / distance * facets.sizes[0] / (8 * np.pi * distance**2)
    exact = amplitude * np.exp(-2j * wavenumbers * distance) * facet_transform(advances)[:, 0]
    error = np.linalg.norm(field - exact) / np.linalg.norm(exact)
    assert error <= SUM_ERROR


def test_both_ends_must_see_the_same_side_of_a_plate() -> None:
    wall = flat_wall(0.1)
    before, behind = np.array([[0.0, -0.3, 0.0]]), np.array([[0.0, 0.3, 0.0]])
    through = scattered(wall, ports(before, wall), ports(behind, wall), BAND, waves="spherical")
    assert not through.any()
    either = [
        scattered(wall, ports(side, wall), ports(side, wall), BAND, waves="spherical")
        for side in (before, behind)
    ]
    assert np.linalg.norm(either[0]) > 0
    error = np.linalg.norm(either[0] - either[1]) / np.linalg.norm(either[0])
    assert error <= SUM_ERROR  # a plate has no front


def test_the_inside_of_a_closed_body_scatters_nothing() -> None:
    plate = flat_plate(4e-3, 4e-3, step=0.25e-3, closed=True)
    outside, inside = (np.array([[0.0, y, 0.0]]) for y in (-0.3, 0.3))
    normal = float(np.sign(plate.normals[0, 1]))
    front, back = (outside, inside) if normal < 0 else (inside, outside)
    assert scattered(plate, ports(front, plate), ports(front, plate), BAND, waves="spherical").any()
    assert not scattered(
        plate, ports(back, plate), ports(back, plate), BAND, waves="spherical"
    ).any()


def test_what_neither_or_only_one_end_sees_scatters_nothing() -> None:
    wall = flat_wall(0.1)
    here = np.array([[0.0, -0.3, 0.0]])
    left = wall.centres[None, :, 0] < 0
    one, other = ports(here, wall, visible=left), ports(here, wall, visible=~left)
    assert not scattered(wall, one, other, BAND, waves="spherical").any()
    halves = [scattered(wall, half, half, BAND, waves="spherical") for half in (one, other)]
    whole = scattered(wall, ports(here, wall), ports(here, wall), BAND, waves="spherical")
    assert np.linalg.norm(sum(halves) - whole) <= SUM_ERROR * np.linalg.norm(whole)


def test_a_pattern_that_turns_over_frequency_is_followed() -> None:
    # A phase centre 1 mm behind the port: its pattern is a delay of 1 mm, 1.6 rad over the band.
    def delayed(
        directions: Float[np.ndarray, "facets 3"],
        distances: Float[np.ndarray, " facets"],
        frequencies: Float[np.ndarray, " nodes"],
    ) -> Complex[np.ndarray, "nodes facets"]:
        turned = np.exp(-2j * np.pi * frequencies / speed_of_light * 1e-3)
        return turned[:, None] * np.ones((1, len(distances)))

    wall = flat_wall(0.1)
    here = np.array([[0.0, -0.3, 0.0]])
    plain = scattered(wall, ports(here, wall), ports(here, wall), BAND, waves="spherical")
    slow = scattered(
        wall,
        ports(here, wall, pattern=delayed, nodes=8),
        ports(here, wall),
        BAND,
        waves="spherical",
    )
    expected = plain * np.exp(-1j * WAVENUMBERS * 1e-3)
    assert np.linalg.norm(slow - expected) <= SUM_ERROR * np.linalg.norm(expected)


def test_one_transmitter_serves_all_receivers_and_each_link_is_told() -> None:
    wall = flat_wall(0.05)
    source, receivers = np.array([[0.0, -0.3, 0.0]]), np.array([[0.1, -0.2, 0], [0, -0.2, 0]])
    done: list[int] = []
    tell: Callable[[], None] = lambda: done.append(1)  # noqa: E731
    together = scattered(
        wall, ports(source, wall), ports(receivers, wall), BAND, waves="spherical", advance=tell
    )
    assert len(done) == 2
    for index in range(2):
        alone = scattered(
            wall, ports(source, wall), ports(receivers[index : index + 1], wall), BAND,
            waves="spherical",
        )  # fmt: skip
        np.testing.assert_array_equal(together[index], alone[0])


def test_roughness_takes_the_coherent_loss_from_the_mean_field() -> None:
    # Gaussian heights: the mean field is that of the mean line times exp(-½(k·rms·Q)²), and what
    # waves along the line take, the mean of the small-slope approximation's second order:
    # 1 - ½k²Q·rms²·<q(t_i + ξ) + q(t_s + ξ) - Q> over the heights' spectrum.
    rms, correlation, draws = 0.12e-3, 0.8e-3, 240
    smooth = flat_wall(0.2, step=0.2e-3)
    start, end = np.array([[-0.25, -0.25, 0.0]]), np.array([[0.25, -0.25, 0.0]])
    frequencies = np.array([220e9, 257.5e9, 295e9])

    def field(facets: Facets) -> Complex[np.ndarray, " freqs"]:
        return np.asarray(
            scattered(
                facets, ports(start, facets), ports(end, facets), frequencies, waves="spherical"
            )[0]
        )

    rng, flat = np.random.default_rng(6), field(smooth)
    profile = np.zeros((smooth.count + 1, 3))
    profile[:, 0] = np.linspace(-0.1, 0.1, len(profile))
    ratios = []
    for _ in range(draws):
        profile[:, 1] = rough_profile(
            length=0.2, count=len(profile), rms=rms, correlation_length=correlation,
            spectrum="gaussian", inner_cutoff=0.0, rng=rng,
        )  # fmt: skip
        ratios.append(field(surface_facets(profile_surface(profile))) / flat)
    mean = np.mean(ratios, axis=0)
    spread = np.std(ratios, axis=0) / np.sqrt(draws)
    wavenumbers = 2 * np.pi * frequencies / speed_of_light
    expected = np.exp(-0.5 * (wavenumbers * rms * np.sqrt(2)) ** 2) + 0j
    waves = np.linspace(-8, 8, 2001) / correlation
    spectrum = np.exp(-((waves * correlation) ** 2) / 4)
    for index, wavenumber in enumerate(wavenumbers):
        between = np.sqrt(0.5) + waves / wavenumber
        both = 2 * normal_component(between) - np.sqrt(2)
        mean_both = np.sum(spectrum * both) / np.sum(spectrum)
        expected[index] *= 1 - 0.5 * (wavenumber * rms) ** 2 * np.sqrt(2) * mean_both
    # Four standard errors, the real and the imaginary part together.
    assert np.all(np.abs(mean - expected) <= 4 * spread)
    assert np.all(4 * spread < 0.6 * np.abs(1 - expected))  # so that no loss at all would fail


def test_a_line_facet_averages_its_phase_to_a_sinc() -> None:
    phases = np.array([0.0, 1e-9, 0.3, 1.0, np.pi, 5.0])
    transform = facet_transform(phases[None, :, None])
    places, weights = np.polynomial.legendre.leggauss(40)
    exact = [np.sum(weights / 2 * np.exp(0.5j * phase * places)) for phase in phases]
    np.testing.assert_allclose(transform[0], np.real(exact), atol=1e-14)
    assert transform[0, 0] == 1


def triangle_average(first: float, second: float) -> complex:
    """The mean of exp(j·phase) over a triangle, by Gauss-Legendre on a square folded onto it."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    nodes, weights = (nodes + 1) / 2, weights / 2
    u = nodes[:, None]
    v = nodes[None, :] * (1 - u)
    phase = u * first + v * second - (first + second) / 3
    return complex(np.sum(2 * weights[:, None] * weights * (1 - u) * np.exp(1j * phase)))


@settings(deadline=None, max_examples=100)
@given(corners=st.tuples(*[st.floats(-1, 1)] * 3), largest=st.floats(0, np.pi))
def test_a_triangle_averages_its_phase_as_quadrature_does(
    corners: tuple[float, float, float], largest: float
) -> None:
    # The series promises its accuracy up to a phase of π at a corner, from the centroid.
    phases = np.array(corners) - np.mean(corners)
    phases *= largest / max(np.abs(phases).max(), 1e-12)
    first, second = phases[1] - phases[0], phases[2] - phases[0]
    transform = facet_transform(np.array([[[first, second]]]))[0, 0]
    assert abs(transform - triangle_average(first, second)) <= 5e-9


def test_a_triangle_without_a_phase_slope_and_one_that_is_a_line_have_their_limits() -> None:
    assert facet_transform(np.zeros((1, 1, 2)))[0, 0] == 1
    # Two corners at one phase: ∫ 2(1 - u) exp(j·a·(u - 1/3)) du.
    a = 2.0
    exact = 2 * (np.exp(1j * a) - 1 - 1j * a) / (1j * a) ** 2 * np.exp(-1j * a / 3)
    assert facet_transform(np.array([[[a, 0.0]]]))[0, 0] == pytest.approx(exact, abs=1e-9)
