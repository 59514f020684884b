"""A part of a wall that another does not see gets no wave from it."""

import numpy as np

from scenes.scenario import parse_scenario
from simulator.simulation import simulate


def test_dielectric_plates_that_see_each_other_in_part_give_finite_echoes() -> None:
    # Plates that turn their edges to each other: blocks of one see nothing of the other.
    plate = {"kind": "plate", "material": "drywall", "length_m": 0.1}
    scenario = parse_scenario(
        {
            "name": "edges",
            "dimensions": 2,
            "max_bounces": 2,
            "radio": {"start_ghz": 220.0, "stop_ghz": 222.0, "points": 5},
            "base_station": {"elements": 4, "spacing_mm": 0.5},
            "objects": {
                "one": {**plate, "centre_m": [0.0, 0.4], "angle_deg": 12.0},
                "two": {**plate, "centre_m": [0.14, 0.43], "angle_deg": 12.3},
            },
        }
    )
    echo = simulate(scenario, seed=3).measurement.echo
    assert echo is not None
    assert np.isfinite(echo.samples).all()
