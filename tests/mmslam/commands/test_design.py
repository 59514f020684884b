import json

import pytest
from typer.testing import CliRunner

from mmslam.cli import app

runner = CliRunner()


def test_the_design_of_slam_2d_has_the_thesis_cross_range() -> None:
    found = runner.invoke(app, ["design", "--distance-m", "1.8", "--json"])
    assert found.exit_code == 0
    document = json.loads(found.stdout)
    values = {row["name"]: row["value"] for row in document["rows"]}
    # 0.886 λ_c R/(nD): 14.3 mm at 1.8 m over one way, half of it for the echo.
    assert values["cross-range cell, uplink"] == pytest.approx(14.3, abs=0.05)
    assert values["cross-range cell, echo"] == pytest.approx(7.15, abs=0.03)
    # c/2Δf and c/Δf of 75 MHz.
    assert values["unambiguous range, echo"] == pytest.approx(1.9986, abs=1e-4)


def test_the_table_names_every_figure_with_its_unit() -> None:
    found = runner.invoke(app, ["design"])
    assert found.exit_code == 0
    assert "far field from" in found.stdout
    assert " MHz" in found.stdout


def test_options_override_the_scenario() -> None:
    found = runner.invoke(app, ["design", "--stop-ghz", "330", "--json"])
    assert json.loads(found.stdout)["options"]["stop_ghz"] == 330.0


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (["--points", "1"], "at least 2"),
        (["--stop-ghz", "100"], "below the stop"),
    ],
)
def test_an_impossible_radio_is_refused(option: list[str], message: str) -> None:
    found = runner.invoke(app, ["design", *option])
    assert found.exit_code == 2
    assert message in found.stderr
