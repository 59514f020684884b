"""Images alone: from Python, and to a folder by the command."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import mmslam
from estimator.measurement.model import Echo, Measurement, MeasurementError, Uplink
from mmslam.cli import app
from validation.analytic.point_scatterer import point_echo

PLACE = np.array([0.02, 0.12, -0.01])


@pytest.fixture(scope="module")
def scan() -> Measurement:
    places = (np.arange(17) - 8) * 5e-3
    x, z = np.meshgrid(places, places, indexing="ij")
    echo: Echo = point_echo(
        PLACE[None],
        positions=np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=-1),
        frequencies=np.linspace(20e9, 24e9, 17),
        radar_cross_section=np.ones(1),
    )
    return Measurement(echo=echo, uplinks=())


def test_an_image_is_formed_where_the_energy_is_and_where_it_is_asked_for(
    scan: Measurement,
) -> None:
    chosen = mmslam.image(scan)
    values = np.abs(chosen.values)
    brightest = chosen.grid.points[np.unravel_index(values.argmax(), values.shape)]
    # a pixel is half a cell of at least 6 mm across and 25 mm along the range
    assert np.abs(brightest - PLACE).max() < 0.5 * max(chosen.grid.spacing) + 1e-9
    asked = mmslam.image(scan, x=(-0.05, 0.05), y=(0.1, 0.14), z=(-0.02, 0.0), pixel=0.005)
    assert asked.grid.shape == (21, 9, 5)
    np.testing.assert_allclose(asked.grid.y[[0, -1]], [0.1, 0.14])
    with pytest.raises(MeasurementError, match=r"maximum range 0.1 m is not beyond the minimum"):
        mmslam.image(scan, min_range=0.2, max_range=0.1)
    with pytest.raises(MeasurementError, match=r"region: .* is empty"):
        mmslam.image(scan, x=(0.1, -0.1))


def test_the_command_writes_the_image_and_replaces_its_own_only(
    scan: Measurement, tmp_path: Path
) -> None:
    assert scan.echo is not None
    own = mmslam.Measurement.from_arrays(
        frequencies=scan.echo.frequencies, positions=scan.echo.positions, echo=scan.echo.samples
    )
    mmslam.write(tmp_path / "scan.zarr", own)
    folder = tmp_path / "image"
    arguments = ["image", str(tmp_path / "scan.zarr"), "--out", str(folder), "--y", "0.08", "0.16"]
    for _ in range(2):
        done = CliRunner().invoke(app, arguments)
        assert done.exit_code == 0, done.output
    assert {path.name for path in folder.iterdir()} == {
        "image.json",
        "image.npz",
        "image.png",
        "cuts.png",
    }
    document = json.loads((folder / "image.json").read_text())
    kept = np.load(folder / "image.npz")
    assert kept["values"].shape == tuple(document["pixels"][axis] for axis in "xyz")
    (folder / "mine.txt").write_text("not ours")
    refused = CliRunner().invoke(app, arguments)
    assert refused.exit_code == 2
    assert "mine.txt" in refused.output


def test_targets_are_looked_for_in_the_region_that_is_asked_for_only(
    scan: Measurement,
) -> None:
    assert scan.echo is not None
    estimate = mmslam.locate(scan, y=(0.08, 0.16), images=False)
    assert not estimate.mirrors
    # a tenth of the cell λ/2D · R of 10 mm; the sweep has no noise
    assert np.abs(estimate.targets[0].position - PLACE).max() < 1e-3
    assert any("a region was asked for" in note for note in estimate.notes)
    behind = mmslam.locate(scan, y=(0.3, 0.35), images=False)
    assert all(0.3 <= target.position[1] <= 0.35 for target in behind.targets)
    with pytest.raises(MeasurementError, match=r"maximum range 0.1 m is not beyond the minimum"):
        mmslam.locate(scan, min_range=0.2, max_range=0.1)
    pilot = Uplink(
        samples=scan.echo.samples,
        positions=scan.echo.positions,
        frequencies=scan.echo.frequencies,
        user="ann",
    )
    with pytest.raises(MeasurementError, match="no echo was measured: leave it out"):
        mmslam.locate(Measurement(echo=None, uplinks=(pilot,)), pixel=0.01)


def test_the_command_locates_in_a_region(scan: Measurement, tmp_path: Path) -> None:
    mmslam.write(tmp_path / "scan.zarr", mmslam.Measurement.of(scan))
    arguments = ["locate", str(tmp_path / "scan.zarr"), "--out", str(tmp_path / "out"), "--json"]
    done = CliRunner().invoke(app, [*arguments, "--y", "0.08", "0.16", "--x", "-0.05", "0.05"])
    assert done.exit_code == 0, done.output
    place = json.loads(done.stdout)["targets"][0]["position_m"]
    assert np.abs(np.array(place) - PLACE).max() < 1e-3
