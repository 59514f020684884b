import numpy as np
import pytest
from scipy.constants import speed_of_light

from scenes.files.loading import load_scenario
from scenes.scenario import ScenarioError
from simulator.materials.fresnel_slab import Dielectric
from simulator.materials.gas_absorption import attenuation_db_km, refractive_index
from simulator.scene.air import in_air, longest_path
from simulator.scene.radio_scene import scenario_materials
from simulator.simulation import simulate

ALONE = ["base_station.elements=2", "noise.snr_db=inf", "max_bounces=0"]


def test_a_pilot_in_air_is_slower_and_weaker_as_its_length_says() -> None:
    room = load_scenario(
        "los_user", [*ALONE, "radio.start_ghz=300", "radio.stop_ghz=340", "radio.points=21"]
    )
    moist = room.model_copy(
        update={"air": load_scenario("los_user", ["air.humidity_percent=80.0"]).air}
    )
    (vacuum,), (air,) = (simulate(one, seed=0).measurement.uplinks for one in (room, moist))
    (user,) = room.users.values()
    length = np.linalg.norm(user.position - air.positions, axis=-1)[:, None]
    assert moist.air is not None
    late = (refractive_index(moist.air) - 1) * length / speed_of_light
    faint = 10 ** (-attenuation_db_km(moist.air, air.frequencies) * length / 1000 / 20)
    # A free-space link's amplitude is the medium's wavelength over 4πR.
    wanted = np.exp(-2j * np.pi * air.frequencies * late) * faint / refractive_index(moist.air)
    # An amplitude that falls as λ counts as λ/2π of length: 0.15 mm × 12 /km in nepers, 2e-6.
    np.testing.assert_allclose(air.samples / vacuum.samples, wanted, atol=2e-6)


def test_a_slab_keeps_its_own_wavelength_in_air() -> None:
    glass = load_scenario(
        "slam_2d",
        [
            "objects.wall.material={permittivity=[6.0,0.1],thickness_mm=4.0}",
            "air.temperature_c=20.0",
        ],
    )
    made, _ = in_air(glass)
    (material,) = scenario_materials(made).values()
    (own,) = scenario_materials(glass).values()
    assert isinstance(material, Dielectric)
    assert isinstance(own, Dielectric)
    index = refractive_index(glass.air)
    f = glass.radio.frequencies
    inside, expected = (
        g * np.sqrt(one.permittivity(g)) for one, g in ((material, f * index), (own, f))
    )
    np.testing.assert_allclose(inside, expected, rtol=1e-12)


def test_vacuum_is_not_touched() -> None:
    room = load_scenario("slam_2d")
    made, completed = in_air(room)
    assert made is room
    samples = np.ones((1, 2), dtype=complex)
    assert completed(samples) is samples


def test_the_wall_in_air_is_the_wall_in_vacuum() -> None:
    room = load_scenario("slam_2d", ["air.temperature_c=20.0"])
    made, _ = in_air(room)
    assert made.facet_spacing("wall") == room.facet_spacing("wall")


def test_absorption_beyond_the_recommendation_is_refused() -> None:
    beyond = ["air.absorption=true", "radio.start_ghz=990", "radio.stop_ghz=1010"]
    with pytest.raises(ScenarioError, match=r"air\.absorption = true: .* 1 to 1000 GHz"):
        in_air(load_scenario("los_user", beyond))


def test_too_many_frequencies_are_refused_before_the_work() -> None:
    large = ["air.absorption=true", "radio.points=2", "users.user.position_m=[0.0, 900.0]"]
    with pytest.raises(ScenarioError, match=r"air\.absorption = true: paths of up to"):
        in_air(load_scenario("los_user", large))


def test_no_path_is_longer_than_the_longest() -> None:
    room = load_scenario("slam_2d")
    assert longest_path(room) > 4 * 1.8
