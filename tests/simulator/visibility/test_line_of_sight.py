"""The direct path, in closed form and against Sionna RT's own paths in single precision."""

import mitsuba as mi
import numpy as np
import pytest
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light
from scipy.special import hankel2

from estimator.compute import engine
from scenes.realisations.object_surface import Surface
from simulator.geometry.facets import profile_surface
from simulator.geometry.ray_scene import RayScene, build_scene
from simulator.specular.free_space import direct_wave
from simulator.visibility.line_of_sight import in_line_of_sight

mi.set_variant(engine.mitsuba_variant())

import sionna.rt as rt  # noqa: E402  the variant has to be chosen first

FREQUENCIES = np.linspace(220e9, 295e9, 31)
USER = np.array([0.7, 1.1, 0.0])
ELEMENTS = np.stack([np.linspace(-0.065, 0.065, 14), np.zeros(14), np.zeros(14)], axis=-1)

LENGTH_ERROR = 0.4e-6
"""Single precision: path lengths were within 0.33 µm over 2 m (design, section 7). [m]"""


def wall(start: tuple[float, float], end: tuple[float, float], name: str = "wall") -> Surface:
    return profile_surface(np.array([[*start, 0.0], [*end, 0.0]]), name=name)


def sionna_paths(
    rays: RayScene, user: Float[np.ndarray, " 3"], *, max_depth: int
) -> tuple[Complex[np.ndarray, "elements paths"], Float[np.ndarray, "elements paths"]]:
    """Coefficients at the scene's frequency, and path lengths [m]; NaN where there is none."""
    scene = rays.scene
    scene.frequency = float(FREQUENCIES[15])
    array = rt.PlanarArray(num_rows=1, num_cols=1, pattern="iso", polarization="V")
    scene.tx_array = scene.rx_array = array
    scene.add(rt.Transmitter("source", position=rays.about_centre(user).tolist()))
    for index, element in enumerate(rays.about_centre(ELEMENTS)):
        scene.add(rt.Receiver(f"at-{index}", position=element.tolist()))
    paths = rt.PathSolver(deterministic=True)(
        scene,
        max_depth=max_depth,
        los=True,
        specular_reflection=max_depth > 0,
        synthetic_array=False,
        refraction=False,
        samples_per_src=10_000,
    )
    real, imaginary = (np.asarray(part.numpy(), dtype=np.float64) for part in paths.a)
    valid = np.asarray(paths.valid.numpy(), dtype=bool).reshape(len(ELEMENTS), -1)
    field = (real + 1j * imaginary).reshape(valid.shape)
    lengths = np.asarray(paths.tau.numpy(), dtype=np.float64).reshape(valid.shape) * speed_of_light
    return np.where(valid, field, np.nan), np.where(valid, lengths, np.nan)


def test_a_spherical_link_is_the_wavelength_over_four_pi_times_the_distance() -> None:
    distances = np.array([0.01, 0.447, 1.8, 100.0])
    wave = direct_wave(distances, FREQUENCIES, waves="spherical")
    expected = speed_of_light / FREQUENCIES / (4 * np.pi * distances[:, None])
    np.testing.assert_allclose(np.abs(wave), expected, rtol=1e-14)
    delays = distances[:, None] / speed_of_light
    turned = wave * np.exp(2j * np.pi * FREQUENCIES * delays)
    # 1e5 turns at 100 m, each to double precision.
    np.testing.assert_allclose(np.angle(turned), 0, atol=1e-9)


def test_a_cylindrical_link_is_the_field_of_a_line_source() -> None:
    distances = np.array([0.3, 1.0, 1.8])
    wave = direct_wave(distances, FREQUENCIES, waves="cylindrical")
    wavenumbers = 2 * np.pi * FREQUENCIES / speed_of_light
    exact = -0.25j * hankel2(0, wavenumbers * distances[:, None])
    error = np.abs(wave / exact - 1)
    assert np.all(error <= 1.01 / (8 * wavenumbers * distances[:, None]) + 1e-11)


def test_the_direct_wave_is_that_of_the_path_solver() -> None:
    field, lengths = sionna_paths(build_scene([]), USER, max_depth=0)
    distances = np.linalg.norm(USER - ELEMENTS, axis=-1)
    assert np.abs(lengths[:, 0] - distances).max() <= LENGTH_ERROR
    ours = direct_wave(distances, FREQUENCIES[15:16], waves="spherical")[:, 0]
    # Sionna's coefficient leaves the delay's phase to tau.
    theirs = field[:, 0] * np.exp(-2j * np.pi * FREQUENCIES[15] * distances / speed_of_light)
    np.testing.assert_allclose(theirs, ours, rtol=1e-5)  # single precision


def test_over_a_flat_mirror_the_path_solver_finds_the_distance_of_the_image_source() -> None:
    # The user before a mirror that the array does not look through: direct and reflected path.
    mirror = wall((-0.5, 1.5), (1.5, 1.5))
    _, lengths = sionna_paths(build_scene([mirror]), USER, max_depth=1)
    image = USER * [1, -1, 1] + [0, 3.0, 0]
    direct, reflected = (np.linalg.norm(end - ELEMENTS, axis=-1) for end in (USER, image))
    found = np.sort(lengths, axis=1)[:, :2]
    np.testing.assert_allclose(found, np.stack([direct, reflected], axis=-1), atol=LENGTH_ERROR)
    # 2.2 and 2.0 m of path: somewhat longer than those that 0.33 µm was measured on.


def test_a_plate_blocks_the_elements_behind_it_and_no_other() -> None:
    # A screen whose shadow ends at x = 0 on the array: from the user over its right end.
    share = 0.5
    end = share * USER
    screen = wall((float(end[0]) - 0.3, float(end[1])), (float(end[0]), float(end[1])))
    seen = in_line_of_sight(build_scene([screen]), USER, ELEMENTS)
    np.testing.assert_array_equal(seen, ELEMENTS[:, 0] > 0)


def test_in_free_space_every_element_sees_the_user() -> None:
    assert in_line_of_sight(build_scene([]), USER, ELEMENTS).all()


def test_looking_twice_and_at_several_users_leaves_the_scene_as_it_was() -> None:
    scene = build_scene([wall((-0.2, 0.5), (0.2, 0.5))])
    users = [USER, np.array([0.0, 1.0, 0.0])]
    first = [in_line_of_sight(scene, user, ELEMENTS) for user in users]
    again = [in_line_of_sight(scene, user, ELEMENTS) for user in users]
    np.testing.assert_array_equal(first, again)
    assert not first[1].any()
    assert not scene.scene.transmitters
    assert not scene.scene.receivers


def test_a_user_half_a_centimetre_away_is_seen() -> None:
    assert in_line_of_sight(build_scene([]), np.array([0.0, 5e-3, 0.0]), ELEMENTS).all()


@pytest.mark.parametrize("name", ["user", "element-0"])
def test_an_object_may_have_any_name(name: str) -> None:
    scene = build_scene([wall((-0.2, 2.0), (0.2, 2.0), name=name)])
    assert in_line_of_sight(scene, USER, ELEMENTS).all()


def test_an_object_may_be_called_conductor() -> None:
    build_scene([wall((-0.2, 2.0), (0.2, 2.0), name="conductor")])
