"""``mmslam track`` on pilots in closed form."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner, Result

from estimator.measurement.model import Measurement, Uplink
from estimator.measurement.store import measurement_to_dataset
from mmslam.cli import app
from mmslam.results.page.single_file import can_draw
from validation.analytic.point_scatterer import complex_noise, point_uplink

FREQUENCIES = np.linspace(220e9, 295e9, 101)  # 0.4 m of unambiguous path
POSITIONS = np.stack([np.arange(-16, 16) * 0.5e-3, np.zeros(32), np.zeros(32)], axis=1)
WAY = np.array([[0.02 + 0.02 * index, 0.25, 0.0] for index in range(4)])  # 0.2 m/s
SILENT = 2


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four times, at one of which nothing is sent, with the truth."""
    rng = np.random.default_rng(0)
    samples = []
    for index, place in enumerate(WAY):
        clean = point_uplink(
            place[None], positions=POSITIONS, frequencies=FREQUENCIES, user="ann"
        ).samples
        variance = 0.01 * float(np.mean(np.abs(clean) ** 2))  # 20 dB
        sent = np.zeros_like(clean) if index == SILENT else clean
        uplink = Uplink(
            samples=sent + complex_noise(clean.shape, variance, rng),
            positions=POSITIONS,
            frequencies=FREQUENCIES,
            user="ann",
        )
        samples.append(
            measurement_to_dataset(Measurement(echo=None, uplinks=(uplink,), clock_offset=0.0))
        )
    dataset = xr.concat(samples, "sample", data_vars=["uplink"], join="exact")
    dataset["time"] = ("sample", 0.1 * np.arange(4))
    path = tmp_path_factory.mktemp("track") / "walk.zarr"
    dataset.to_zarr(path, mode="w", zarr_format=3, consolidated=False)
    return path


@pytest.fixture(autouse=True)
def away(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def track(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["track", *arguments])


def test_a_walk_is_told_written_and_drawn(store: Path) -> None:
    result = track(str(store))
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    assert len(lines) == len(WAY) + 1
    assert "(bridged)" in lines[SILENT]
    assert "(ambiguous)" in lines[0]  # no echo: mirrors are unknown
    document = json.loads(Path("out/walk-track/track.json").read_text(encoding="utf-8"))
    (ann,) = document["tracks"]
    assert [point["candidate"] for point in ann["points"]] == [0, 0, None, 0]
    for point, place in zip(ann["points"], WAY, strict=True):
        off = (np.array(point["position_m"]) - place)[:2]
        spread = np.array(point["covariance"])[:2, :2]
        assert off @ np.linalg.solve(spread, off) < 30  # once in three million
        assert point["truth_m"] is None
    assert Path("out/walk-track/track.png").stat().st_size > 10_000
    if can_draw():
        page = Path("out/walk-track/track.html").read_text(encoding="utf-8")
        (data,) = re.findall(r'id="page-data">(.*?)</script>', page, flags=re.DOTALL)
        shown = json.loads(data)
        assert shown["times"] == pytest.approx([0.0, 0.1, 0.2, 0.3])
        moments = shown["tracks"][0]["moments"]
        assert [moment["point"]["bridged"] for moment in moments] == [False, False, True, False]
        assert lines[-1] == "open out/walk-track/track.html"
    # The same again replaces what it wrote; anything else stays.
    assert track(str(store)).exit_code == 0
    Path("out/walk-track/mine.txt").write_text("mine", encoding="utf-8")
    refused = track(str(store))
    assert refused.exit_code == 2
    assert "mine.txt" in refused.stderr


def test_the_step_goes_before_what_the_file_says(store: Path) -> None:
    result = track(str(store), "--step", "0.2", "--json", "--out", "slow")
    document = json.loads(result.stdout)
    assert [fix["time_s"] for fix in document["tracks"][0]["fixes"]] == pytest.approx(
        [0.0, 0.2, 0.4, 0.6]
    )
    speed = document["tracks"][0]["points"][-1]["velocity_m_s"][0]
    assert speed == pytest.approx(0.1, abs=0.03)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--step", "0"), "step = 0 s"),
        (("--step", "inf"), "step = inf s"),
        (("--acceleration", "-1"), "acceleration = -1 m²/s³"),
    ],
)
def test_wrong_options_are_refused_before_any_work(
    store: Path, options: tuple[str, ...], told: str
) -> None:
    result = track(str(store), *options)
    assert result.exit_code == 2
    assert told in result.stderr
    assert not Path("out").exists()


def test_a_single_measurement_is_no_track(store: Path) -> None:
    alone = Path("alone.zarr")
    xr.open_zarr(store, consolidated=False).isel(sample=0).drop_vars("time").to_zarr(
        alone, zarr_format=3, consolidated=False
    )
    result = track(str(alone))
    assert result.exit_code == 2
    assert "use `mmslam locate`" in " ".join(result.stderr.split())
