"""What a simulation tells of what it leaves out."""

from typing import Any

import numpy as np
import pytest

from scenes.scenario import Scenario, parse_scenario
from simulator.scene.left_out import (
    effects_told,
    left_out,
    model_lines,
    model_told,
)


def scene(objects: dict[str, Any], **more: Any) -> Scenario:
    return parse_scenario(
        {
            "name": "made",
            "max_bounces": 1,
            "radio": {"start_ghz": 59.5, "stop_ghz": 60.5, "points": 3},
            "base_station": {"elements": 1, "spacing_mm": 1.0},
            "objects": objects,
            "users": {"user": {"position_m": [0.0, 2.0]}},
            **more,
        }
    )


def test_on_the_shadow_boundary_half_the_field_is_left_out() -> None:
    # A screen whose end just covers the straight way: Fresnel's knife edge has -6 dB there. The
    # only other path, over a long mirror 1 m to the side, is √8 m long; the straight one 2 m.
    screen = {
        "kind": "plate", "material": "absorber", "centre_m": [-0.25, 1.0], "length_m": 0.5002,
    }  # fmt: skip
    mirror = {
        "kind": "plate", "material": "metal", "centre_m": [1.0, 1.0], "angle_deg": 90.0,
        "length_m": 1.0,
    }  # fmt: skip
    found = {one.what: one.level_db for one in left_out(scene({"s": screen, "mirror": mirror}))}
    expected = 20 * np.log10(0.5 * np.sqrt(8) / 2)
    # 0.1 mm into the shadow v = 0.003, a field of 1 % less.
    assert found["diffraction round edges"] == pytest.approx(expected, abs=0.1)


def test_effects_that_are_off_are_told_with_the_level_they_would_have() -> None:
    pane = {
        "kind": "plate", "material": {"permittivity": [4.0, 0.0], "thickness_mm": 1.0},
        "centre_m": [0.0, 1.0], "length_m": 1.0,
    }  # fmt: skip
    off = scene({"pane": pane}, effects={"transmission": False})
    assert "transmission off" in effects_told(off)
    (through, *_) = left_out(off)
    assert through.what == "transmission through slabs"
    assert through.level_db > 100  # nothing else arrives
    assert not any(one.what == through.what for one in left_out(scene({"pane": pane})))
    told = model_told(off)
    assert "transmission through slabs" in next(iter(model_lines(told)))
