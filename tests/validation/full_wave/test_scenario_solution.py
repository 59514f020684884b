"""A scenario by full wave: posts by their series, plates beside the simulator, and refusals."""

from typing import Any

import numpy as np
import pytest
from scipy.constants import speed_of_light

import validation.full_wave.scenario_solution as module
from scenes.scenario import Scenario, ScenarioError, parse_scenario
from simulator.simulation import simulate
from validation.analytic.line_source_scattering import cylinder_field
from validation.full_wave.boundary_equations import Polarisation
from validation.full_wave.line_source import LineSource
from validation.full_wave.scenario_bodies import scenario_bodies
from validation.full_wave.scenario_solution import (
    FullWaveScenario,
    full_wave_scenario,
    noise_free_fields,
    solve_scenario,
)

POST = {"kind": "cylinder", "material": "metal", "centre_m": [0.01, 0.2], "radius_m": 0.003}
PLATE = {
    "kind": "plate",
    "material": "metal",
    "centre_m": [0.0, 0.2],
    "angle_deg": 45.0,
    "length_m": 0.03,
}


def small(objects: dict[str, Any], **changes: Any) -> Scenario:
    return parse_scenario(
        {
            "name": "small",
            "dimensions": 2,
            "waves": "cylindrical",
            "radio": {"start_ghz": 230.0, "stop_ghz": 250.0, "points": 5},
            "base_station": {"elements": 5, "spacing_mm": 4.0},
            "objects": objects,
            "users": {"user": {"position_m": [0.25, 0.21]}},
            "noise": {"snr_db": float("inf")},
            **changes,
        }
    )


def correlation(one: np.ndarray, other: np.ndarray) -> float:
    return float(abs(np.vdot(one, other)) / np.linalg.norm(one) / np.linalg.norm(other))


@pytest.mark.parametrize("polarisation", ["TM", "TE"])
@pytest.mark.parametrize("material", ["metal", {"permittivity": [2.0, 0.1], "thickness_mm": 1e999}])
def test_a_post_is_heard_as_its_series_says(polarisation: Polarisation, material: Any) -> None:
    scenario = small({"post": {**POST, "material": material}})
    ready = full_wave_scenario(scenario, seed=0, polarisation=polarisation, workers=1)
    fields = noise_free_fields(ready)
    assert fields.shape == (2, 5, 5)
    centre, user = np.array([0.01, 0.2]), np.array([0.25, 0.21])
    for index, place in ((0, ready.elements[0, :2]), (3, ready.elements[3, :2])):
        for row, frequency in ((0, 230e9), (4, 250e9)):
            wavenumber = 2 * np.pi * frequency / speed_of_light
            series = [
                cylinder_field(
                    LineSource(position=sender - centre),
                    place - centre,
                    wavenumber,
                    radius=0.003,
                    permittivity=None if material == "metal" else 2.0 - 0.1j,
                    polarisation=polarisation,
                )
                for sender in (place, user)
            ]
            direct = LineSource(position=user).field(place[None], wavenumber)[0]
            # 6.5 points per wavelength, and the links' tolerance.
            assert abs(fields[0, index, row] / series[0] - 1) < 1e-5
            assert abs(fields[1, index, row] - direct - series[1]) < 1e-5 * abs(series[1])


def test_few_frequencies_carry_the_band() -> None:
    radio = {"start_ghz": 230.0, "stop_ghz": 250.0, "points": 201}
    ready = full_wave_scenario(small({"post": POST}, radio=radio), seed=0, workers=1)
    assert ready.effort.solutions < 60
    told: list[tuple[int, int]] = []
    fields = noise_free_fields(ready, progress=lambda _, done, steps: told.append((done, steps)))
    assert told[-1] == (ready.effort.solutions, ready.effort.solutions)
    few = full_wave_scenario(small({"post": POST}, radio={**radio, "points": 5}), seed=0, workers=1)
    direct = noise_free_fields(few)
    assert np.linalg.norm(fields[..., ::50] - direct) < 1e-4 * np.linalg.norm(direct)


@pytest.mark.parametrize(
    ("material", "least", "most_db"),
    # Edges are left out of the simulator's theory, and make a fifth of so short a wall's echo.
    [("metal", 0.99, 0.5), ({"permittivity": [2.56, 0.5], "thickness_mm": 1.5}, 0.98, 1.0)],
)
def test_a_pilot_over_a_plate_is_about_as_the_simulator_says(
    material: Any, least: float, most_db: float
) -> None:
    beam = {"kind": "gaussian_beam", "sigma_rad": 0.05, "aim": "wall"}
    user = {"user": {"position_m": [0.25, 0.2], "antenna": beam}}
    wall = {**PLATE, "length_m": 0.015, "material": material, "roughness": None}
    radio = {"start_ghz": 230.0, "stop_ghz": 250.0, "points": 2}
    scenario = small({"wall": wall}, users=user, radio=radio)
    measurement, truth = solve_scenario(full_wave_scenario(scenario, seed=0, workers=1))
    simulated = simulate(scenario, seed=0).measurement
    found, expected = measurement.uplinks[0].samples, simulated.uplinks[0].samples
    assert correlation(found, expected) > least
    assert abs(20 * np.log10(np.linalg.norm(found) / np.linalg.norm(expected))) < most_db
    assert measurement.waves == "cylindrical"
    assert measurement.echo is not None
    assert list(truth["wall"].values) == ["wall"]


def test_full_wave_hears_the_simulator_s_own_realisation() -> None:
    rough = {"rms_mm": 0.15, "correlation_mm": 1.0}
    scenario = small({"wall": {**PLATE, "roughness": rough}})
    echoes = []
    for seed in (0, 1):
        measured, _ = solve_scenario(full_wave_scenario(scenario, seed=seed, workers=1))
        simulated = simulate(scenario, seed=seed).measurement
        assert measured.echo is not None
        assert simulated.echo is not None
        echoes.append((measured.echo.samples, simulated.echo.samples))
    # The trust map has 0.99 for this roughness; edges count more on 3 cm than on its 8 cm.
    assert all(correlation(*pair) > 0.93 for pair in echoes)
    assert correlation(echoes[0][0], echoes[1][1]) < 0.8


def test_noise_is_drawn_as_in_the_simulator() -> None:
    quiet, noisy = (small({"post": POST}, noise={"snr_db": level}) for level in (1e999, 20.0))
    fields = [
        solve_scenario(full_wave_scenario(one, seed=3, workers=1))[0] for one in (quiet, noisy)
    ]
    added = fields[1].uplinks[0].samples - fields[0].uplinks[0].samples
    level = np.linalg.norm(added) / np.linalg.norm(fields[0].uplinks[0].samples)
    assert level == pytest.approx(0.1, rel=0.4)  # 25 samples


def test_boxes_and_rough_posts_become_contours() -> None:
    rough = {"rms_mm": 0.05, "correlation_mm": 0.5}
    box = {
        "kind": "box",
        "material": "metal",
        "centre_m": [0.1, 0.2],
        "angle_deg": 20.0,
        "length_m": 0.01,
        "depth_m": 0.006,
        "roughness": rough,
    }
    scenario = small({"post": {**POST, "roughness": rough}, "box": box})
    post, sides = (body.contour for body in scenario_bodies(scenario, seed=0).at(240e9))
    length = np.hypot(*(post.points - [0.01, 0.2]).T)
    assert 0.5e-4 < length.std() * 2 < 2e-4
    assert length.mean() == pytest.approx(0.003, abs=1e-4)
    area = 0.5 * np.sum(
        np.einsum("ix,ix->i", sides.points - [0.1, 0.2], sides.normals) * sides.weights
    )
    assert area == pytest.approx(6e-5, rel=0.03)
    smooth = scenario_bodies(small({"box": {**box, "roughness": None}}), seed=0).at(240e9)[0]
    assert smooth.contour.weights.sum() == pytest.approx(0.032, rel=1e-6)


def refused(scenario: Scenario, match: str) -> None:
    with pytest.raises(ScenarioError, match=match):
        full_wave_scenario(scenario, seed=0)


def test_what_full_wave_cannot_do_is_refused_with_its_remedy(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    refused(small({"post": POST}, waves="spherical"), "--set waves=cylindrical")
    refused(small({"wall": {**PLATE, "material": "absorber"}}), "no wave equation has a perfect")
    refused(small({"wall": {**PLATE, "material": "cardboard"}}), "give it a thickness_mm")
    refused(small({"post": {**POST, "material": "drywall"}}), "thickness_mm = inf")
    refused(small({}), "nothing to solve for")
    horn = {"kind": "horn", "gain_dbi": 20.0, "aim": "post"}
    station = {"elements": 5, "spacing_mm": 4.0, "antenna": {**horn, "aim": None, "aim_deg": 90.0}}
    refused(small({"post": POST}, base_station=station), "full wave takes an isotropic array")
    user = {"user": {"position_m": [0.25, 0.21], "antenna": horn}}
    refused(small({"post": POST}, users=user), "users.user.antenna.kind = 'horn'")
    offset = {"elements": 5, "spacing_mm": 4.0, "transmit_offset_m": [0.01, 0.0]}
    apart = small({"post": POST}, base_station=offset, max_bounces=1)
    refused(apart, "remove these keys")
    points = {"one": {"position_m": [0.0, 0.1]}}
    refused(small({"post": POST}, points=points, waves="spherical"), "give a small cylinder")
    near = {**POST, "centre_m": [0.0165, 0.2]}
    refused(small({"post": POST, "near": near}), "mm apart or cross; full wave needs")
    within = {"user": {"position_m": [-0.0035, 0.2035]}}  # 5 mm behind a board of 12.7 mm
    board = small({"wall": {**PLATE, "material": "drywall"}}, users=within)
    refused(board, "users.user is within objects.wall")
    monkeypatch.setattr(module, "MOST_UNKNOWNS", 50)
    refused(small({"post": POST}), "make objects smaller, objects.post first")


def test_what_it_takes_is_told_beforehand(monkeypatch: pytest.MonkeyPatch) -> None:
    ready = full_wave_scenario(small({"post": POST, "wall": PLATE}), seed=0, workers=2)
    assert isinstance(ready, FullWaveScenario)
    counts = [body.contour.count for body in ready.bodies.at(250e9)]
    assert ready.effort.unknowns == sum(counts)
    assert "5 of 5 frequencies, 2 at once; about" in str(ready.effort)
    monkeypatch.setattr(module, "MOST_BYTES", 1)
    assert full_wave_scenario(small({"post": POST}), seed=0, workers=2).effort.workers == 1


def test_neither_workers_nor_the_run_change_a_bit() -> None:
    scenario = small({"post": POST, "wall": PLATE})
    one, other = (
        noise_free_fields(full_wave_scenario(scenario, seed=0, workers=count)) for count in (1, 2)
    )
    np.testing.assert_array_equal(one, other)
