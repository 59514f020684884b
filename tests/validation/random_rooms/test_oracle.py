"""What an oracle says can be answered."""

import numpy as np
import pytest
from scipy.constants import speed_of_light

from scenes.scenario import Scenario, parse_scenario
from simulator.simulation import simulate
from validation.metrics.truth import Truth, truth_from_dataset
from validation.random_rooms.oracle import (
    Answerable,
    ask_oracle,
    imaged_sector,
    shown_walls,
    true_paths,
)
from validation.trials.drawn_echoes import draw_echo


def room(user: tuple[float, float], *, length: float = 0.2, rms: float = 0.05) -> Scenario:
    return parse_scenario(
        {
            "name": "room",
            "dimensions": 2,
            "max_bounces": 1,
            "radio": {"start_ghz": 220.0, "stop_ghz": 295.0, "points": 201},
            "base_station": {"elements": 64, "spacing_mm": 0.5},
            "objects": {
                "wall": {
                    "kind": "plate",
                    "material": "metal",
                    "centre_m": [0.0, 0.3],
                    "angle_deg": 30.0,
                    "length_m": length,
                    "roughness": {"rms_mm": rms, "correlation_mm": 0.5, "spectrum": "gaussian"},
                }
            },
            "users": {"user": {"position_m": list(user)}},
            "noise": {"snr_db": 10.0},
        }
    )


def asked(scenario: Scenario) -> Answerable:
    simulated = simulate(scenario, seed=1)
    (uplink,) = simulated.measurement.uplinks
    truth = truth_from_dataset(simulated.truth)
    return ask_oracle(scenario, "user", simulated.measurement.echo, uplink, truth)


def test_a_user_in_sight_can_be_answered_and_its_wall_is_shown() -> None:
    said = asked(room((0.05, 0.25)))
    assert said.answerable
    assert said.shown == ("wall",)
    assert said.paths[0].walls == ()
    # What the wall scatters diffusely is the rest; the noise's mean power scatters by 1 %.
    assert 0.8 < sum(path.share for path in said.paths) < 1.03
    assert said.deviation is not None
    assert said.deviation < 1e-3


def test_a_user_behind_the_wall_cannot_be_answered() -> None:
    said = asked(room((0.0, 0.5)))
    assert not said.answerable
    assert said.why == "no specular path"


def test_the_energy_of_a_path_is_that_of_free_space() -> None:
    scenario = room((0.05, 0.25))
    simulated = simulate(scenario, seed=1)
    (uplink,) = simulated.measurement.uplinks
    direct = next(path for path in true_paths(scenario, "user", uplink) if not path.walls)
    f = scenario.radio.frequencies
    elements = scenario.base_station.element_positions
    far = np.linalg.norm(np.array([0.05, 0.25, 0.0]) - elements, axis=-1)
    expected = np.mean((speed_of_light / (4 * np.pi * far[:, None] * f)) ** 2)
    signal = np.mean(np.abs(uplink.samples) ** 2) / (1 + 1 / 10)
    # The noise's mean power scatters by 1/sqrt(64 · 201) = 0.9 %.
    assert direct.share == pytest.approx(expected / signal, rel=0.03)


def test_a_row_of_speckle_is_shown_and_a_wall_that_is_not_there_is_not() -> None:
    drawn = draw_echo("wall", np.random.default_rng(5))
    (start, end) = drawn.walls[0]
    beside = np.array([0.15, 0.0, 0.0])
    truth = Truth(
        wall_start={"real": start, "imagined": start - beside},
        wall_end={"real": end, "imagined": end - beside},
    )
    assert shown_walls(drawn.echo, imaged_sector(drawn.echo), truth) == ("real",)


def test_a_wall_that_goes_on_beyond_the_unambiguous_range_stops_no_oracle() -> None:
    # 201 frequencies are unambiguous up to 400 mm, and the wall reaches 412 mm from the array.
    said = asked(room((0.05, 0.25), length=0.34))
    assert said.answerable
    assert said.shown == ("wall",)
