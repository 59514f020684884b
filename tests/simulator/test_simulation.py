"""From a scenario to its measurement: echo, uplink, noise and truth, on small scenes."""

from typing import Any

import drjit as dr
import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.compute import engine
from estimator.measurement.model import Measurement
from scenes.scenario import Scenario, ScenarioError, parse_scenario
from simulator.scene.radio_scene import radio_scene
from simulator.scene.truth import scenario_truth
from simulator.simulation import simulate

WALL = {
    "kind": "plate",
    "material": "metal",
    "centre_m": [0.0, 0.4],
    "angle_deg": 45.0,
    "length_m": 0.2,
}
ROUGH = {**WALL, "roughness": {"rms_mm": 0.05, "correlation_mm": 0.3}}
BEAM = {"kind": "gaussian_beam", "sigma_rad": 0.1, "aim": "wall"}
HIDDEN = {"position_m": [0.5, 0.4], "antenna": BEAM}  # looks at the wall: not seen directly
PLAIN = {"position_m": [0.25, 0.3]}  # in plain sight


def scenario(**tables: Any) -> Scenario:
    return parse_scenario(
        {
            "name": "small",
            "radio": {"start_ghz": 220.0, "stop_ghz": 295.0, "points": 101},
            "base_station": {"elements": 16, "spacing_mm": 0.5},
            **tables,
        }
    )


def measured(scene: Scenario, *, seed: int = 3, sample: int = 0) -> Measurement:
    return simulate(scene, seed=seed, sample=sample).measurement


def samples(measurement: Measurement) -> list[np.ndarray]:
    echo = [] if measurement.echo is None else [measurement.echo.samples]
    return echo + [uplink.samples for uplink in measurement.uplinks]


@pytest.fixture
def restored_threads() -> Any:
    count = dr.thread_count()
    yield
    dr.set_thread_count(count)


@pytest.mark.skipif("engine.backend() != 'llvm'")
@pytest.mark.usefixtures("restored_threads")
def test_the_same_seed_gives_the_same_bytes_on_one_thread_and_on_two() -> None:
    scene = scenario(
        objects={"wall": ROUGH}, users={"a": HIDDEN, "b": PLAIN}, noise={"snr_db": 20.0}
    )
    runs = []
    for threads in (1, 2, 1, 2):
        dr.set_thread_count(threads)
        assert engine.thread_count() == threads
        runs.append([values.tobytes() for values in samples(measured(scene))])
    assert len(runs[0]) == 3
    assert all(run == runs[0] for run in runs)


def test_another_seed_or_sample_is_another_wall_and_other_noise() -> None:
    scene = scenario(objects={"wall": ROUGH}, noise={"snr_db": 20.0})
    echoes = [
        samples(measured(scene, seed=seed, sample=sample))[0]
        for seed, sample in ((3, 0), (4, 0), (3, 1))
    ]
    for one, other in ((0, 1), (0, 2), (1, 2)):
        a, b = echoes[one].ravel(), echoes[other].ravel()
        assert abs(np.vdot(a, b)) < 0.9 * np.linalg.norm(a) * np.linalg.norm(b)


def test_a_new_user_or_another_noise_level_does_not_redraw_the_wall() -> None:
    silent = samples(measured(scenario(objects={"wall": ROUGH})))[0]
    more = samples(measured(scenario(objects={"wall": ROUGH}, users={"a": HIDDEN})))
    np.testing.assert_array_equal(more[0], silent)
    # The noise is the same too, only scaled: 20 dB is a tenth of the amplitude.
    loud, faint = (
        samples(measured(scenario(objects={"wall": ROUGH}, noise={"snr_db": snr})))[0]
        for snr in (10.0, 30.0)
    )
    np.testing.assert_allclose(faint - silent, 0.1 * (loud - silent), atol=1e-12 * abs(loud).max())


def test_a_new_user_does_not_redraw_anothers_noise() -> None:
    first = scenario(objects={"wall": ROUGH}, users={"a": HIDDEN}, noise={"snr_db": 20.0})
    second = scenario(
        objects={"wall": ROUGH}, users={"b": PLAIN, "a": HIDDEN}, noise={"snr_db": 20.0}
    )
    alone, together = measured(first), measured(second)
    assert [uplink.user for uplink in together.uplinks] == ["b", "a"]
    np.testing.assert_array_equal(together.uplinks[1].samples, alone.uplinks[0].samples)


@pytest.mark.parametrize("snr_db", [20.0, -3.0])
def test_the_noise_stands_at_its_ratio_to_each_arrays_mean_power(snr_db: float) -> None:
    tables = {"objects": {"wall": ROUGH}, "users": {"a": HIDDEN, "b": PLAIN}}
    clean = samples(measured(scenario(**tables)))
    noisy = samples(measured(scenario(**tables, noise={"snr_db": snr_db})))
    for truth, values in zip(clean, noisy, strict=True):
        noise = values - truth
        level = np.mean(np.abs(truth) ** 2) * 10 ** (-snr_db / 10)
        # The mean of n exponential variables: 4 standard deviations of 1/sqrt(n).
        assert np.mean(np.abs(noise) ** 2) == pytest.approx(level, rel=4 / np.sqrt(noise.size))
        # Circular: the mean of noise² vanishes, to the same 4 deviations.
        assert abs(np.mean(noise**2)) <= 4 * level * np.sqrt(2 / noise.size)


def test_a_user_in_free_space_is_a_spherical_wave_and_there_is_no_echo() -> None:
    found = measured(scenario(users={"a": PLAIN}))
    assert found.echo is None
    (uplink,) = found.uplinks
    distances = np.linalg.norm(np.array([0.25, 0.3, 0.0]) - uplink.positions, axis=-1)
    wavelengths = speed_of_light / uplink.frequencies
    expected = wavelengths / (4 * np.pi * distances[:, None])
    expected = expected * np.exp(-2j * np.pi * distances[:, None] / wavelengths)
    # 1e3 turns of phase in double precision.
    np.testing.assert_allclose(uplink.samples, expected, rtol=1e-11)


def test_with_noise_a_silent_echo_has_the_noise_of_the_quietest_array() -> None:
    # The receiver is the same: the noise on the echo is that on the quietest heard array.
    found = measured(
        scenario(users={"a": PLAIN, "b": {"position_m": [0.5, 0.9]}}, noise={"snr_db": 20.0})
    )
    assert found.echo is not None
    clean = measured(scenario(users={"a": PLAIN, "b": {"position_m": [0.5, 0.9]}}))
    quietest = min(np.mean(np.abs(uplink.samples) ** 2) for uplink in clean.uplinks)
    power = np.mean(np.abs(found.echo.samples) ** 2)
    assert power == pytest.approx(0.01 * quietest, rel=4 / np.sqrt(found.echo.samples.size))


def test_a_user_that_nothing_reaches_is_left_out_or_is_noise() -> None:
    shade = {"kind": "plate", "material": "absorber", "length_m": 0.48}
    tables = {
        "objects": {
            "wall": {**WALL, "centre_m": [-0.3, 0.4]},
            "beside": {**shade, "centre_m": [0.3, 0.2], "angle_deg": 90.0},
            "above": {**shade, "centre_m": [0.3, 0.45]},
        },
        "users": {"a": {"position_m": [0.5, 0.3]}},
    }
    assert measured(scenario(**tables)).uplinks == ()
    noisy = measured(scenario(**tables, noise={"snr_db": 20.0}))
    assert noisy.echo is not None
    level = 0.01 * np.mean(np.abs(noisy.echo.samples) ** 2)
    power = np.mean(np.abs(noisy.uplinks[0].samples) ** 2)
    # 1 % of the echo is its own noise.
    assert power == pytest.approx(level, rel=0.01 + 4 / np.sqrt(noisy.echo.samples.size))


@pytest.mark.parametrize(
    "tables",
    [
        pytest.param({}, id="nothing"),
        pytest.param({"objects": {"wall": {**WALL, "material": "absorber"}}}, id="absorber"),
        pytest.param({"noise": {"snr_db": 20.0}}, id="noise"),
    ],
)
def test_where_nothing_is_received_there_is_no_measurement(tables: dict[str, Any]) -> None:
    with pytest.raises(
        ScenarioError, match=r"'small'.*nothing is received; add an object or a user"
    ):
        simulate(scenario(**tables), seed=0)


def test_over_a_smooth_mirror_the_pilot_comes_from_the_users_image() -> None:
    pilot = samples(measured(scenario(objects={"wall": WALL}, users={"a": HIDDEN})))[1]
    elements = scenario(objects={"wall": WALL}).base_station.element_positions
    image = np.array([0.0, 0.9, 0.0])  # of (0.5, 0.4) in the line y = x + 0.4
    lengths = np.linalg.norm(image - elements, axis=-1)[:, None]
    wavelengths = speed_of_light / np.linspace(220e9, 295e9, 101)
    # The ray to an element leaves the user off the beam's axis as it does its image.
    gain = np.exp(-0.5 * (np.arctan2(elements[:, 0], 0.9) / 0.1) ** 2)[:, None]
    expected = -gain * wavelengths / (4 * np.pi * lengths)
    expected = expected * np.exp(-2j * np.pi * lengths / wavelengths)
    # Both ends of the wall are 7 cm off the beam's axis, 1.4 standard widths: 0.37 of its field.
    # Either adds its Fresnel ripple, 1/(√2·π·v) with v = 0.07·√(2(1/0.5 + 1/0.4)/λ) = 5.9: 1.4 %.
    # The width of the beam itself turns the phase by 1/(2k·0.5·0.1²·(1 + 0.5/0.4)) = 0.9 %.
    error = np.linalg.norm(pilot - expected) / np.linalg.norm(expected)
    assert error <= 2 * 0.014 + 0.009


def test_the_echo_of_a_symmetric_scene_is_symmetric_whatever_the_antenna() -> None:
    # The array's antennas look at one point, not each element from where it stands.
    face_on = {**WALL, "angle_deg": 0.0}
    for antenna in ({"kind": "isotropic"}, {"kind": "horn", "gain_dbi": 23.0, "aim": "wall"}):
        scene = scenario(
            objects={"wall": face_on},
            base_station={"elements": 9, "spacing_mm": 12.0, "antenna": antenna},
            users={"a": {"position_m": [0.0, 0.2]}},
        )
        for values in samples(measured(scene)):
            error = np.linalg.norm(values - values[::-1]) / np.linalg.norm(values)
            assert error <= 1e-5, antenna


def test_an_absorber_hides_the_wall_and_the_user() -> None:
    shade = {"kind": "plate", "material": "absorber", "centre_m": [0.0, 0.1], "length_m": 0.2}
    users = {"a": {"position_m": [0.0, 0.2]}}
    with pytest.raises(ScenarioError, match="nothing is received"):
        simulate(scenario(objects={"wall": WALL, "shade": shade}, users=users), seed=0)


def test_cylindrical_and_spherical_waves_differ_by_the_spread_of_the_length() -> None:
    # Each facet's spherical wave is √(λ/L)·exp(jπ/4) times its cylindrical one; at one range
    # that is one factor, exact for a short wall.
    wall = {**WALL, "length_m": 2e-3, "angle_deg": 0.0}
    ball, tube = (
        samples(measured(scenario(objects={"wall": wall}, waves=waves)))[0]
        for waves in ("spherical", "cylindrical")
    )
    positions = scenario(objects={"wall": wall}).base_station.element_positions
    lengths = 2 * np.linalg.norm(np.array([0.0, 0.4, 0.0]) - positions, axis=-1)
    wavelengths = speed_of_light / np.linspace(220e9, 295e9, 101)
    factor = np.sqrt(wavelengths / lengths[:, None]) * np.exp(0.25j * np.pi)
    # The wall is ±1 mm wide: L varies by less than 1e-4 over it; 1e-5 is the sums' error.
    np.testing.assert_allclose(ball / tube, factor, rtol=1e-4)


def test_two_plates_shade_each_other_and_both_echo() -> None:
    near = {**WALL, "angle_deg": 0.0, "centre_m": [0.0, 0.2], "length_m": 0.1}
    far = {**WALL, "angle_deg": 0.0, "centre_m": [0.0, 0.4], "length_m": 0.1}
    alone = samples(measured(scenario(objects={"near": near})))[0]
    both = samples(measured(scenario(objects={"near": near, "far": far})))[0]
    # From 8 mm of array, all of the far plate lies behind the near one.
    np.testing.assert_allclose(both, alone, atol=1e-5 * np.abs(alone).max())


def test_the_progress_counts_every_position_of_every_stage() -> None:
    told: list[tuple[str, int, int]] = []
    simulate(
        scenario(objects={"wall": WALL}, users={"a": PLAIN}),
        seed=0,
        progress=lambda *one: told.append(one),
    )
    for stage in ("echo", "uplink of a"):
        steps = [(done, total) for name, done, total in told if name == stage]
        assert sorted(steps) == [(step, 16) for step in range(1, 17)]


def test_the_measurement_says_how_it_was_made() -> None:
    scene = scenario(
        objects={"wall": WALL},
        users={"a": PLAIN},
        base_station={"elements": 16, "spacing_mm": 0.5, "boresight_deg": 60.0},
    )
    found = measured(scene, seed=7)
    assert (found.scenario, found.seed, found.clock_offset) == ("small", 7, 0.0)
    assert found.waves == "spherical"
    np.testing.assert_allclose(found.boresight, [0.5, np.sqrt(0.75), 0.0], atol=1e-15)
    assert found.echo is not None
    np.testing.assert_array_equal(found.echo.frequencies, scene.radio.frequencies)


def test_the_truth_holds_users_and_conducting_walls_by_name() -> None:
    shade = {"kind": "plate", "material": "absorber", "centre_m": [0.9, 0.1], "length_m": 0.2}
    post = {"kind": "cylinder", "material": "metal", "centre_m": [0.5, 0.8], "radius_m": 0.01}
    truth = scenario_truth(
        scenario(
            objects={"wall": ROUGH, "shade": shade, "post": post}, users={"b": PLAIN, "a": HIDDEN}
        )
    )
    assert truth["user"].values.tolist() == ["b", "a"]
    assert truth["wall"].values.tolist() == ["wall"]
    np.testing.assert_allclose(truth["user_position"].values, [[0.25, 0.3, 0], [0.5, 0.4, 0]])
    half = 0.1 / np.sqrt(2)
    np.testing.assert_allclose(truth["wall_start"].values, [[-half, 0.4 - half, 0]], atol=1e-15)
    np.testing.assert_allclose(truth["wall_end"].values, [[half, 0.4 + half, 0]], atol=1e-15)


def test_the_truth_of_nothing_is_empty() -> None:
    truth = simulate(scenario(users={"a": PLAIN}), seed=0).truth
    assert truth["wall_start"].shape == (0, 3)
    assert truth["user_position"].shape == (1, 3)


def test_only_metal_has_facets_and_all_surfaces_stop_rays() -> None:
    shade = {"kind": "plate", "material": "absorber", "centre_m": [0.5, 0.1], "length_m": 0.2}
    scene = radio_scene(scenario(objects={"wall": WALL, "shade": shade}), seed=0, sample=0)
    assert set(scene.rays.objects) == {"wall", "shade"}
    assert scene.facets is not None
    assert scene.facets.sizes.sum() == pytest.approx(0.2)
    assert radio_scene(scenario(objects={"shade": shade}), seed=0, sample=0).facets is None


def test_a_transmitter_apart_is_told_and_its_echo_is_the_link() -> None:
    apart = {"elements": 4, "spacing_mm": 2.0, "transmit_offset_m": [0.06, 0.01]}
    scene = scenario(objects={"wall": ROUGH}, base_station=apart, max_bounces=1)
    found = measured(scene).echo
    assert found is not None
    assert found.transmit_positions is not None
    np.testing.assert_allclose(
        found.transmit_positions - found.positions, [[0.06, 0.01, 0.0]] * 4, atol=1e-15
    )
    # Reciprocity: exchanging all transmitters and receivers changes nothing.
    back = {**apart, "position_m": [0.06, 0.01], "transmit_offset_m": [-0.06, -0.01]}
    other = measured(scenario(objects={"wall": ROUGH}, base_station=back, max_bounces=1)).echo
    assert other is not None
    error = np.linalg.norm(other.samples - found.samples) / np.linalg.norm(found.samples)
    assert error <= 1e-6
    together = measured(
        scenario(objects={"wall": ROUGH}, base_station={**apart, "transmit_offset_m": None},
                 max_bounces=1)
    ).echo  # fmt: skip
    assert together is not None
    assert together.transmit_positions is None
    assert np.linalg.norm(together.samples - found.samples) > 0.5 * np.linalg.norm(found.samples)


@pytest.mark.parametrize(
    ("station", "message"),
    [
        ({}, r"transmit_offset_m = \[0\.1, 0\.0\]: with transmitter and .* set max_bounces = 1"),
        ({"transmit_offset_m": [0.1, 0.0, 0.1]}, r"transmit_offset_m = .*: z must be 0 in two"),
        ({"transmit_offset_m": [0.0, 0.4]}, r"the array is .* objects\.wall"),
    ],
)
def test_a_transmitter_that_cannot_stand_there_is_refused(
    station: dict[str, Any], message: str
) -> None:
    base = {"elements": 4, "spacing_mm": 2.0, "transmit_offset_m": [0.1, 0.0], **station}
    with pytest.raises(ScenarioError, match=message):
        scenario(objects={"wall": WALL}, base_station=base, max_bounces=1 if station else 3)


def test_a_point_is_seen_from_a_transmitter_apart_over_both_legs() -> None:
    apart = {"elements": 4, "spacing_mm": 2.0, "transmit_offset_m": [0.06, 0.01]}
    point = {"position_m": [0.1, 0.4], "rcs_m2": 1e-4}
    found = measured(scenario(points={"p": point}, base_station=apart, max_bounces=1)).echo
    assert found is not None
    assert found.transmit_positions is not None
    place = np.array([0.1, 0.4, 0.0])
    there = np.linalg.norm(place - found.transmit_positions, axis=-1)[:, None]
    back = np.linalg.norm(place - found.positions, axis=-1)[:, None]
    wavelengths = speed_of_light / found.frequencies
    expected = wavelengths * 1e-2 / ((4 * np.pi) ** 1.5 * there * back)
    expected = expected * np.exp(-2j * np.pi * (there + back) / wavelengths)
    # 1e3 turns of phase in double precision.
    np.testing.assert_allclose(found.samples, expected, rtol=1e-11)
