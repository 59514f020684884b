import numpy as np
import pytest
from jaxtyping import Float

from estimator.channel.relax import refine_paths
from estimator.measurement.model import Uplink
from scenes.files.loading import load_scenario
from scenes.realisations.object_surface import object_surface, plate_segment
from scenes.scenario import Scenario
from simulator.response.uplink import simulate_uplink
from simulator.scene.radio_scene import facet_ports, radio_scene
from validation.bounds.roughness_floor import roughness_floor

SMALL = (
    "base_station.elements=64",
    "radio.points=41",
    "objects.wall.centre_m=[0.0, 0.4]",
    "objects.wall.length_m=0.2",
    "users.user.position_m=[0.45, 0.4]",
)


def scene(rms_mm: float, *more: str) -> Scenario:
    return load_scenario("slam_2d", (*SMALL, f"objects.wall.roughness.rms_mm={rms_mm}", *more))


def found_position(scenario: Scenario, seed: int) -> Float[np.ndarray, " 2"]:
    """Fit one wave to the noise-free pilot, and unfold it over the known wall y = x + 0.4."""
    ready = radio_scene(scenario, seed=seed, sample=0)
    assert ready.facets is not None
    array = facet_ports(ready, ready.facets, scenario.base_station.antenna, ready.elements)
    samples = simulate_uplink(ready, scenario.users["user"], array, advance=lambda: None)
    pilot = Uplink(
        samples=samples,
        positions=ready.elements,
        frequencies=scenario.radio.frequencies,
        user="user",
    )
    (path,) = refine_paths(pilot, np.array([[np.pi / 2, 0.85]]))
    x, y = path.path_length * np.array([np.cos(path.aoa), np.sin(path.aoa)])
    return np.array([y - 0.4, x + 0.4])


def heights(
    scenario: Scenario, seed: int, places: Float[np.ndarray, " places"]
) -> Float[np.ndarray, " places"]:
    """Interpolate the heights of a realisation, towards the array."""
    start, end = plate_segment(scenario.objects["wall"])  # type: ignore[arg-type]
    along = (end - start) / np.linalg.norm(end - start)
    normal = np.array([along[1], -along[0], 0.0])
    normal *= -np.sign(normal @ (start + end))
    vertices = object_surface(scenario, "wall", seed=seed, sample=0).vertices - (start + end) / 2
    order = np.argsort(vertices @ along)
    found = np.interp(places, (vertices @ along)[order], (vertices @ normal)[order])
    return np.asarray(found)


def test_the_known_heights_of_a_wall_move_the_user_as_the_response_says() -> None:
    rough, smooth = scene(0.002), found_position(scene(0.0), 0)
    floor = roughness_floor(rough, "user", "wall")
    step = floor.places[1] - floor.places[0]
    measured = np.array([found_position(rough, seed) - smooth for seed in range(6)])
    predicted = np.array(
        [heights(rough, seed, floor.places) @ floor.response * step for seed in range(6)]
    )
    left = np.linalg.norm(measured - predicted) / np.linalg.norm(measured)
    # The response knows no edges' diffraction and no uneven gain over the array; heights of
    # 2 µm are a phase of 0.015 rad, so that what is left is these, and not the second order.
    assert left < 0.2
    # Both axes by themselves: across the ray the errors are thirty times those along it.
    for axis in range(2):
        assert np.corrcoef(measured[:, axis], predicted[:, axis])[0, 1] > 0.95


def test_the_floor_goes_with_the_rms_height() -> None:
    fine, coarse = (roughness_floor(scene(rms), "user", "wall") for rms in (0.01, 0.03))
    np.testing.assert_allclose(coarse.covariance, 9 * fine.covariance, rtol=1e-9)
    assert coarse.phase == pytest.approx(3 * fine.phase, rel=1e-9)
    # Twice the height, by cos 45°, at 257.5 GHz.
    assert fine.phase == pytest.approx(2 * np.pi / 1.16424e-3 * 1e-5 * np.sqrt(2), rel=2e-3)


def test_finer_roughness_bends_less_as_the_root_of_its_correlation_length() -> None:
    fine, coarse = (
        roughness_floor(
            scene(0.01, f"objects.wall.roughness.correlation_mm={length}"), "user", "wall"
        ).deviation
        for length in (0.3, 0.6)
    )
    # Both are far below the Fresnel zone √(λR/2)/cosθ of some 15 mm: only the sum of C counts.
    assert coarse / fine == pytest.approx(np.sqrt(2), rel=0.02)


def test_the_floor_of_the_whole_scene_is_that_of_its_realisations() -> None:
    floor = roughness_floor(load_scenario("slam_2d"), "user", "wall")
    # The design's median of 40 realisations, 0.16 mm: that scatters by 13 %.
    assert floor.median == pytest.approx(0.16e-3, rel=0.3)


def test_what_has_no_floor_is_refused() -> None:
    with pytest.raises(ValueError, match="no rough plate"):
        roughness_floor(scene(0.0), "user", "wall")
    with pytest.raises(ValueError, match="3 dimensions"):
        roughness_floor(load_scenario("room_3d"), "far", "floor")
    with pytest.raises(ValueError, match="no object 'door'"):
        roughness_floor(scene(0.05), "user", "door")
    behind = scene(0.05, "users.user.position_m=[-0.45, 0.4]")
    with pytest.raises(ValueError, match="does not face both"):
        roughness_floor(behind, "user", "wall")
