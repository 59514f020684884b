import re
from dataclasses import replace
from pathlib import Path

import pytest

from estimator.measurement.model import Measurement
from estimator.results.estimate import Estimate
from mmslam.results.document import result_document
from mmslam.results.pictures_2d import write_pictures
from mmslam.results.report import radio_parameters, render_report
from scenes.files.loading import load_scenario, scenario_to_toml
from validation.metrics.truth import Truth


@pytest.fixture
def page(tmp_path: Path, measurement: Measurement, estimate: Estimate, truth: Truth) -> str:
    pictures = write_pictures(tmp_path, measurement, estimate, truth)
    result = result_document(measurement, estimate, truth)
    return render_report(
        result, measurement, pictures, scenario=scenario_to_toml(load_scenario("slam_2d"))
    )


def test_the_page_needs_no_other_file_and_no_network(page: str) -> None:
    sources = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert len(sources) == 4
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    assert "<script" not in page
    assert "@import" not in page
    assert "url(" not in page


def test_the_page_tells_users_mirrors_notes_and_the_scenario(page: str) -> None:
    assert "5.000 mm off" in page
    assert "door" in page
    assert "z = 0 and y &gt; 0 are assumed" in page
    assert "correlation_mm" in page
    assert "range resolution c/2B" in page


def test_a_hostile_name_cannot_become_part_of_the_page(
    tmp_path: Path, measurement: Measurement, nothing_found: Estimate
) -> None:
    evil = "<script>alert(1)</script>"
    (lost,) = nothing_found.users
    estimate = replace(nothing_found, users=(replace(lost, name=evil),))
    result = result_document(replace(measurement, scenario=evil), estimate, Truth())
    page = render_report(result, measurement, {})
    assert "<script" not in page
    assert "&lt;script&gt;" in page


def test_nothing_found_is_a_page_too(
    tmp_path: Path, measurement: Measurement, nothing_found: Estimate, truth: Truth
) -> None:
    pictures = write_pictures(tmp_path, measurement, nothing_found, truth)
    page = render_report(result_document(measurement, nothing_found, truth), measurement, pictures)
    assert "No mirror was found." in page
    assert "no peak above the noise" in page


def test_the_radio_is_described_by_its_resolution_and_reach(measurement: Measurement) -> None:
    described = radio_parameters(measurement)
    assert described["range resolution c/2B"] == "2.00 mm"  # c / (2 · 75 GHz) = 1.9986 mm
    assert described["unambiguous one-way path"] == "0.06 m"  # c / 5 GHz = 59.96 mm
    assert described["positions"] == "13 over 120.0 mm"
