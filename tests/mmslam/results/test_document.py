import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from estimator.measurement.model import Measurement
from estimator.results.estimate import Estimate
from mmslam.results.document import dimensions, result_document, to_json, versions
from mmslam.terminal.summary import summary_lines
from validation.metrics.truth import Truth


def numbers_of(value: Any) -> list[float]:
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        return [number for item in value for number in numbers_of(item)]
    return [value] if isinstance(value, float) else []


def test_the_document_is_what_the_design_says(
    measurement: Measurement, estimate: Estimate, truth: Truth
) -> None:
    document = json.loads(to_json(result_document(measurement, estimate, truth)))
    assert document["format"] == 1
    assert document["scenario"] == "hall"
    assert document["seed"] == 3
    assert document["dimensions"] == 2
    (user,) = document["users"]
    assert user["estimate_m"] == [1.003, 0.796, 0.0]
    assert user["aoa_deg"] == pytest.approx(90.0)
    assert user["range_m"] == 1.8
    assert user["bounces"] == 1
    assert user["truth_m"] == [1.0, 0.8, 0.0]
    assert user["error_m"] == pytest.approx(0.005)  # 3, 4, 5 mm
    assert user["path_m"][1] == [0.0, 0.8, 0.0]
    assert document["mirrors"][0]["seen_through"] == []
    assert document["targets"][0]["seen_through"] == [0]
    assert document["comparison"]["mirrors"][0]["truth_name"] == "door"
    assert document["comparison"]["walls_missed"] == []
    assert document["timings_s"] == {"image": 0.25}


def test_what_is_unknown_is_null_and_no_number_is_nan(
    measurement: Measurement, nothing_found: Estimate
) -> None:
    bad = replace(nothing_found, timings={"image": float("nan")})
    document = json.loads(to_json(result_document(measurement, bad, Truth())))
    (user,) = document["users"]
    assert user["status"] == "not_found"
    assert user["reason"] == "no peak above the noise"
    for key in ("estimate_m", "covariance_m2", "aoa_deg", "range_m", "truth_m", "error_m"):
        assert user[key] is None
    assert document["timings_s"]["image"] is None
    assert np.isfinite(numbers_of(document)).all()


def test_a_user_that_was_never_heard_is_listed_as_not_found(
    measurement: Measurement, estimate: Estimate, truth: Truth
) -> None:
    truth.user_position["bob"] = np.array([2.0, 2.0, 0.0])
    users = result_document(measurement, estimate, truth)["users"]
    assert [(user["name"], user["status"]) for user in users] == [
        ("ann", "found"),
        ("bob", "not_found"),
    ]


def test_a_wall_without_a_mirror_is_listed_as_missed(
    measurement: Measurement, nothing_found: Estimate, truth: Truth
) -> None:
    document = result_document(measurement, nothing_found, truth)
    assert document["comparison"]["walls_missed"] == ["door"]


def test_a_planar_aperture_answers_in_three_dimensions(measurement: Measurement) -> None:
    assert dimensions(measurement) == 2
    assert measurement.echo is not None
    raised = measurement.echo.positions.copy()
    raised[3, 2] = 1e-3
    assert dimensions(replace(measurement, echo=replace(measurement.echo, positions=raised))) == 3


def test_a_single_element_answers_in_a_plane_like_a_line(measurement: Measurement) -> None:
    (uplink,) = measurement.uplinks
    single = replace(uplink, samples=uplink.samples[:1], positions=uplink.positions[:1])
    assert dimensions(Measurement(echo=None, uplinks=(single,))) == 2


def test_an_array_that_points_anywhere_still_answers_in_a_plane(measurement: Measurement) -> None:
    angle = 0.7
    turn = np.array([[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0]])
    assert measurement.echo is not None
    turned = measurement.echo.positions[:, :2] @ turn + 5.0
    echo = replace(measurement.echo, positions=turned)
    assert dimensions(Measurement(echo=echo, uplinks=())) == 2


def test_versions_name_python_and_every_package_that_can_change_a_result() -> None:
    found = versions()
    assert found["python"]
    assert found["numpy"] == np.__version__
    assert "drjit" in found


def test_the_summary_says_who_is_where_and_how_far_off(
    measurement: Measurement, estimate: Estimate, truth: Truth, nothing_found: Estimate
) -> None:
    from pathlib import Path

    folder = Path("out")
    text = "\n".join(summary_lines(result_document(measurement, estimate, truth), folder))
    assert "ann: found at (1.0030, 0.7960, 0.0000) m" in text
    assert "5.000 mm from the truth" in text
    assert "from 'door'" in text
    lost = "\n".join(summary_lines(result_document(measurement, nothing_found, truth), folder))
    assert "ann: not found (no peak above the noise)" in lost
    assert "no mirror found" in lost
