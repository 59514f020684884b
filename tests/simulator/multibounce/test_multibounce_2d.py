"""Chains of surfaces against image sources, reciprocity, and their own sum at every frequency."""

from typing import Any

import drjit as dr
import numpy as np
import pytest
from jaxtyping import Bool, Float
from scipy.constants import speed_of_light

from estimator.compute import engine
from estimator.measurement.model import Waves
from scenes.realisations.object_surface import Surface
from simulator.antennas.ports import Pattern, Ports
from simulator.geometry.faces import scattering_faces
from simulator.geometry.facets import Facets, joined, profile_surface, surface_facets
from simulator.geometry.ray_scene import build_scene, facets_visible
from simulator.materials.fresnel_slab import Dielectric
from simulator.materials.permittivity import ConstantPermittivity
from simulator.multibounce.frequency_interpolation import CHAIN_ACCURACY, nodes_for_chain
from simulator.multibounce.multibounce_2d import ghost_echo, uplink_over_surfaces
from simulator.numerics.nufft_sum import chebyshev_nodes, lagrange_basis
from simulator.scattering.physical_optics import scattered
from simulator.visibility.mutual_visibility import MutualVisibility

BAND = np.linspace(220e9, 240e9, 4)
STEP = speed_of_light / 240e9 / 4


def line(start: tuple[float, float], end: tuple[float, float], name: str) -> Surface:
    ends = np.array([[*start, 0.0], [*end, 0.0]])
    count = int(np.ceil(np.linalg.norm(ends[1] - ends[0]) / STEP))
    profile = ends[0] + np.linspace(0, 1, count + 1)[:, None] * (ends[1] - ends[0])
    return profile_surface(profile, name=name)


def post(centre: tuple[float, float], radius: float, count: int = 80) -> Surface:
    angles = 2 * np.pi * np.arange(count) / count
    around = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=-1)
    vertices = np.array([*centre, 0.0]) + radius * around
    first = np.arange(count)
    return Surface(
        name="post",
        material="metal",
        vertices=vertices,
        mean_vertices=vertices,
        cells=np.stack([first, (first + 1) % count], axis=-1),
        closed=True,
    )


class Scene:
    """Surfaces with their facets, faces and rays."""

    def __init__(self, *surfaces: Surface, materials: tuple[Any, ...] | None = None) -> None:
        made = materials or (None,) * len(surfaces)
        parts = [surface_facets(one, of) for one, of in zip(surfaces, made, strict=True)]
        self.facets = joined(parts)
        self.firsts = np.cumsum([0, *(part.count for part in parts)])
        self.rays = build_scene(surfaces, mean=True)
        self.faces = scattering_faces(self.facets)
        self.sees = MutualVisibility(self.rays, self.faces)

    def of(self, surface: int) -> Bool[np.ndarray, " facets"]:
        """Facets of one surface."""
        index = np.arange(self.facets.count)
        return np.asarray((index >= self.firsts[surface]) & (index < self.firsts[surface + 1]))

    def ports(self, points: list[tuple[float, float]], pattern: "Pattern | None" = None) -> Ports:
        positions = np.array([[*point, 0.0] for point in points])
        visible = facets_visible(self.rays, self.facets, positions)
        return Ports(positions=positions, pattern=pattern or isotropic, visible=visible)


def isotropic(
    directions: Float[np.ndarray, "facets 3"],
    distances: Float[np.ndarray, " facets"],
    frequencies: Float[np.ndarray, " nodes"],
) -> Float[np.ndarray, "1 facets"]:
    return np.ones((1, len(distances)))


def beam(aim: tuple[float, float], *, flat: float, width: float) -> Pattern:
    """A flat-topped beam without side lobes: walls are lit smoothly, and have no ends."""
    axis = np.array([*aim, 0.0]) / np.hypot(*aim)

    def pattern(
        directions: Float[np.ndarray, "facets 3"],
        distances: Float[np.ndarray, " facets"],
        frequencies: Float[np.ndarray, " nodes"],
    ) -> Float[np.ndarray, "1 facets"]:
        off = np.arccos(np.clip(directions @ axis, -1, 1))
        return np.asarray(np.cos(np.pi / 2 * np.clip((off - flat) / width, 0, 1))[None] ** 4)

    return pattern


def restricted(ports: Ports, mask: Bool[np.ndarray, " facets"]) -> Ports:
    return Ports(positions=ports.positions, pattern=ports.pattern, visible=ports.visible & mask)


def relative(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


MIRROR = line((-0.4, 0.5), (0.7, 0.5), "mirror")
ARRAY = [(-0.01, 0.0), (0.0, 0.0), (0.013, 0.0)]


POST = (0.25, 0.2)  # not in the beam that lights the mirror
SPECULAR = (0.156, 0.5)  # 17° off the boresight; the beam ends 31° to either side, on the mirror


def behind_the_mirror() -> Scene:
    return Scene(MIRROR, post(POST, 4e-3))


@pytest.mark.parametrize("waves", ["spherical", "cylindrical"])
def test_the_ghost_behind_a_long_mirror_is_the_echo_of_the_mirrored_array(waves: Waves) -> None:
    scene = behind_the_mirror()
    pattern = beam(SPECULAR, flat=0.25, width=0.3)
    array = restricted(scene.ports(ARRAY, pattern), scene.of(0))
    ghost = ghost_echo(scene.faces, scene.sees, array, BAND, waves=waves)
    image = Scene(post(POST, 4e-3))
    mirrored = image.ports([(x, 1.0 - y) for x, y in ARRAY])
    expected = scattered(image.facets, mirrored, mirrored, BAND, waves=waves)
    # Twice the mirror, sign and all. Stationary phase is off by 1/(k r) = 1/(4600 · 0.3) for each
    # pass; the curvature of the beam and of the edge of light on the post add some of the same.
    assert relative(ghost, expected) <= 5e-3


def corner(length: float = 0.3) -> Scene:
    half = length / np.sqrt(2)
    return Scene(
        line((0.0, 0.5), (half, 0.5 - half), "one"), line((-half, 0.5 - half), (0.0, 0.5), "two")
    )


def test_a_corner_returns_its_double_bounce_once() -> None:
    # Two mirrors at a right angle send everything back: the field of one image, point-mirrored
    # in the corner. Both orders together make it; counting both twice would double it.
    scene = corner()
    array = scene.ports([(0.0, 0.0), (0.005, 0.0)], beam((0.0, 1.0), flat=0.12, width=0.15))
    echo = ghost_echo(scene.faces, scene.sees, array, BAND, waves="spherical", max_bounces=2)
    lengths = 2 * np.linalg.norm(array.positions - [0, 0.5, 0], axis=-1)[:, None]
    wavelengths = speed_of_light / BAND
    expected = wavelengths / (4 * np.pi * lengths) * np.exp(-2j * np.pi * lengths / wavelengths)
    # Each order stops at the corner, where the other goes on. The edge wave of such a stop is
    # √(λ/R) of the field, 5 %, and the two cancel but for the facets within λ/2π of each other.
    assert relative(echo, expected) <= np.sqrt(speed_of_light / BAND[0] / 0.5)


def test_the_order_of_the_surfaces_changes_nothing() -> None:
    # Over two surfaces either may be the target: the same double sum.
    scene = behind_the_mirror()
    array = scene.ports(ARRAY)
    one, other = (
        ghost_echo(faces, scene.sees, array, BAND, waves="spherical", max_bounces=2)
        for faces in (scene.faces, scene.faces[::-1])
    )
    assert np.linalg.norm(one) > 0
    assert relative(one, other) <= 0.01  # the phase over facets is averaged in another way


def test_one_bounce_adds_nothing_and_a_surface_alone_has_no_ghosts() -> None:
    scene = behind_the_mirror()
    array, user = scene.ports(ARRAY), scene.ports([(0.3, 0.1)])
    for bounces in (0, 1):
        assert not ghost_echo(
            scene.faces, scene.sees, array, BAND, waves="spherical", max_bounces=bounces
        ).any()
        assert not uplink_over_surfaces(
            scene.faces, scene.sees, user, array, BAND, waves="spherical", max_bounces=bounces
        ).any()
    alone = Scene(MIRROR)
    ports = alone.ports(ARRAY)
    assert not ghost_echo(alone.faces, alone.sees, ports, BAND, waves="spherical").any()


def test_a_third_bounce_adds_what_the_second_lacks() -> None:
    # Two bounces: over the mirror one way. Three: both ways, as if nothing were seen directly.
    scene = behind_the_mirror()
    array = scene.ports(ARRAY)
    two, three = (
        ghost_echo(scene.faces, scene.sees, array, BAND, waves="spherical", max_bounces=bounces)
        for bounces in (2, 3)
    )
    both_ways = sum(
        ghost_echo(
            scene.faces, scene.sees, restricted(array, scene.of(wall)), BAND, waves="spherical"
        )
        for wall in (0, 1)
    )
    assert np.linalg.norm(both_ways) > 0.01 * np.linalg.norm(two)
    assert np.linalg.norm(three - two - both_ways) <= 1e-5 * np.linalg.norm(three)


MIRRORS = (line((-0.15, 0.25), (0.15, 0.55), "one"), line((0.45, 0.55), (0.75, 0.25), "two"))
ELEMENTS = [(-0.01, 0.0), (0.0, 0.0), (0.01, 0.0)]


@pytest.mark.parametrize("waves", ["spherical", "cylindrical"])
def test_over_two_mirrors_the_pilot_comes_from_the_image_of_the_image(waves: Waves) -> None:
    scene = Scene(*MIRRORS)
    array = restricted(scene.ports(ELEMENTS), scene.of(0))
    user = restricted(
        scene.ports([(0.6, 0.0)], beam((0.0, 1.0), flat=0.06, width=0.08)), scene.of(1)
    )
    pilot = uplink_over_surfaces(scene.faces, scene.sees, user, array, BAND, waves=waves)
    # (0.6, 0) in x + y = 1: (1, 0.4); that in y = x + 0.4: (0, 1.4).
    lengths = np.linalg.norm(array.positions - [0, 1.4, 0], axis=-1)[:, None]
    wavelengths = speed_of_light / BAND
    phase = np.exp(-2j * np.pi * lengths / wavelengths)
    if waves == "spherical":
        expected = wavelengths / (4 * np.pi * lengths) * phase
    else:
        expected = np.sqrt(wavelengths / lengths) / (4 * np.pi) * np.exp(-0.25j * np.pi) * phase
    # The beam fades to nothing 0.14 rad off its axis, 14 cm where the first mirror ends at 15 cm;
    # its curvature, 1/(2k L (0.1 rad)²) at L = 1 m, is 1 % of the field, and so is the error of
    # the phase over facets.
    assert relative(pilot, expected) <= 0.02


def test_exchanging_user_and_element_changes_nothing() -> None:
    scene = Scene(line((-0.05, 0.35), (0.05, 0.45), "one"), line((0.5, 0.5), (0.6, 0.4), "two"))
    one, other = scene.ports([(0.0, 0.0)]), scene.ports([(0.55, 0.0)])
    for bounces in (2, 3):
        there, back = (
            uplink_over_surfaces(
                scene.faces, scene.sees, *ends, BAND[:2], waves="spherical", max_bounces=bounces
            )
            for ends in ((one, other), (other, one))
        )
        assert np.linalg.norm(there) > 0
        # The phase over facets is followed by points on walls, by its mean slope on targets.
        assert relative(there, back) <= 0.01


WIDE = np.linspace(220e9, 295e9, 257)


def test_few_frequencies_carry_the_band() -> None:
    scene = Scene(line((-0.1, 0.5), (0.1, 0.5), "mirror"), post((0.1, 0.2), 4e-3))
    array, user = scene.ports(ARRAY[:2]), scene.ports([(0.3, 0.1)])
    for few, every in (
        [
            ghost_echo(
                scene.faces, scene.sees, array, WIDE, waves="spherical", interpolate=interpolate
            )
            for interpolate in (True, False)
        ],
        [
            uplink_over_surfaces(
                scene.faces,
                scene.sees,
                user,
                array,
                WIDE,
                waves="spherical",
                max_bounces=2,
                interpolate=interpolate,
            )
            for interpolate in (True, False)
        ],
    ):
        assert np.linalg.norm(every) > 0
        # Of the sum of the contributions' strengths; a coherent sum is some tenth of that.
        assert relative(few, every) <= 10 * CHAIN_ACCURACY


@pytest.mark.parametrize("spread", [0.0, 1e-12, 5e-11, 1e-9])
def test_the_nodes_suffice_for_delays_within_the_spread_and_are_few(spread: float) -> None:
    start, stop = 220e9, 330e9
    count = nodes_for_chain(spread, (), start, stop)
    points = np.linspace(start, stop, 997)
    basis = lagrange_basis(chebyshev_nodes(start, stop, count), points)
    for delay in (spread / 2, -spread / 2, spread / 3):
        wave = np.exp(-2j * np.pi * chebyshev_nodes(start, stop, count) * delay)
        error = np.abs(wave @ basis - np.exp(-2j * np.pi * points * delay)).max()
        assert error <= CHAIN_ACCURACY
    # Nyquist's count, times π/2 for the nodes' crowding at the ends, and some for the accuracy.
    assert count <= np.pi / 2 * spread * (stop - start) * 1.25 + 15


def test_a_slab_as_the_mirror_multiplies_the_ghost_by_its_reflection_twice() -> None:
    half_space = Dielectric(permittivity=ConstantPermittivity(value=4.0 - 0.1j), thickness=np.inf)
    pattern = beam(SPECULAR, flat=0.25, width=0.3)
    ghosts = []
    for material in (None, half_space):
        scene = Scene(MIRROR, post(POST, 4e-3), materials=(material, None))
        array = restricted(scene.ports(ARRAY, pattern), scene.of(0))
        ghosts.append(ghost_echo(scene.faces, scene.sees, array, BAND, waves="spherical"))
    cosine = 0.8 / np.hypot(0.8, 0.25)  # mirrored array to post: (0, 1) to (0.25, 0.2)
    inner = np.sqrt(4.0 - 0.1j - (1 - cosine**2))
    fresnel = (cosine - inner) / (cosine + inner)
    # The coefficient follows the angle over the Fresnel zone, √(λr) = 2 cm or 3°, by 0.5 %.
    assert relative(ghosts[1], fresnel**2 * ghosts[0]) <= 0.01


def test_what_stands_between_two_surfaces_hides_them() -> None:
    shade = line((0.17, 0.35), (0.33, 0.35), "shade")
    free = behind_the_mirror()
    hidden = Scene(MIRROR, post(POST, 4e-3), shade)
    wall, post_face = free.faces[0], free.faces[2]
    if not free.sees(wall, post_face).any():
        wall = free.faces[1]
    seen, shaded = free.sees(wall, post_face), hidden.sees(wall, post_face)
    assert seen.any()
    assert not (shaded & ~seen).any()
    # The line from a wall's facet to the post crosses y = 0.35 at ±8 cm.
    level = (0.35 - post_face.centres[None, :, 1]) / (0.5 - post_face.centres[None, :, 1])
    crossing = post_face.centres[None, :, 0] + level * (
        wall.centres[:, None, 0] - post_face.centres[None, :, 0]
    )
    clear = np.abs(np.abs(crossing - 0.25) - 0.08) > 1e-5  # single precision of the rays
    np.testing.assert_array_equal(shaded[clear], (seen & (np.abs(crossing - 0.25) > 0.08))[clear])


@pytest.fixture
def restored_threads() -> Any:
    count = dr.thread_count()
    yield
    dr.set_thread_count(count)


@pytest.mark.skipif("engine.backend() != 'llvm'")
@pytest.mark.usefixtures("restored_threads")
def test_one_thread_and_two_give_the_same_bytes() -> None:
    scene = behind_the_mirror()
    array, user = scene.ports(ARRAY), scene.ports([(0.3, 0.1)])
    found = []
    for threads in (1, 2):
        dr.set_thread_count(threads)
        assert engine.thread_count() == threads
        echo = ghost_echo(scene.faces, scene.sees, array, BAND, waves="spherical")
        pilot = uplink_over_surfaces(
            scene.faces, scene.sees, user, array, BAND, waves="spherical", max_bounces=2
        )
        found.append((echo.tobytes(), pilot.tobytes()))
    assert found[0] == found[1]


def test_an_open_surface_has_two_faces_and_a_closed_one_its_outer() -> None:
    scene = behind_the_mirror()
    assert [face.surface for face in scene.faces] == [0, 0, 1]
    np.testing.assert_array_equal(scene.faces[0].normals, -scene.faces[1].normals)
    outward = scene.faces[2].centres - POST
    assert np.all(np.sum(outward * scene.faces[2].normals, axis=-1) > 0)
    assert isinstance(scene.facets, Facets)
