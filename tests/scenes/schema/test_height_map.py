"""Measured heights: three kinds of files, their statistics, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scenes.realisations.object_surface import object_surface
from scenes.scenario import ScenarioError, parse_scenario
from scenes.schema.errors import ScenarioError as Refused
from scenes.schema.height_map import read_height_map
from scenes.surfaces.height_synthesis import rough_profile, rough_sheet, slope_share

STEP, RMS, LENGTH = 2e-5, 1.5e-5, 3e-4


def sheet(first: int = 300, second: int = 250) -> np.ndarray:
    return rough_sheet(
        lengths=(STEP * (first - 1), STEP * (second - 1)), counts=(first, second), rms=RMS,
        correlation_length=LENGTH, spectrum="gaussian", inner_cutoff=0.0,
        rng=np.random.default_rng(2),
    )  # fmt: skip


def written(folder: Path, kind: str, heights: np.ndarray) -> Path:
    """Write heights in millimetres."""
    path = folder / f"heights.{kind}"
    match kind:
        case "csv":
            np.savetxt(path, 1e3 * heights, delimiter=",")
        case "npz":
            np.savez(path, heights=1e3 * heights, step=1e3 * STEP)
        case _:
            Image.fromarray((1e3 * heights).astype(np.float32)).save(path)
    return path


@pytest.mark.parametrize("kind", ["csv", "npz", "tif"])
def test_a_map_comes_back_from_its_file_without_its_mean_plane(tmp_path: Path, kind: str) -> None:
    heights = sheet()
    tilted = heights + 1e-4 + 2e-3 * STEP * np.arange(300)[:, None]
    read = read_height_map(written(tmp_path, kind, tilted), step=STEP, unit=1e-3)
    assert read.heights.shape == heights.shape
    # What is left is the drawn surface less its own plane: a few correlation lengths' worth.
    apart = read.heights - heights
    assert np.abs(np.diff(apart, 2, axis=0)).max() < 1e-6 * RMS + 1e-7 * 1e-3
    assert read.rms == pytest.approx(np.std(heights), rel=0.1)


def test_the_correlation_length_of_a_long_profile_is_that_it_was_drawn_with() -> None:
    from scenes.schema.height_map import HeightMap

    count = 60_001
    line = rough_profile(
        length=STEP * (count - 1), count=count, rms=RMS, correlation_length=LENGTH,
        spectrum="gaussian", inner_cutoff=0.0, rng=np.random.default_rng(5),
    )  # fmt: skip
    made = HeightMap(line[:, None], STEP)
    lengths = STEP * count / LENGTH  # 4000 independent pieces
    assert made.correlation_length == pytest.approx(LENGTH, rel=5 / np.sqrt(lengths))
    assert made.rms == pytest.approx(RMS, rel=5 / np.sqrt(lengths))


def plate(tmp_path: Path, **roughness: object) -> dict[str, object]:
    return {
        "format": 1, "name": "one", "dimensions": 3, "max_bounces": 1,
        "radio": {"start_ghz": 220, "stop_ghz": 230, "points": 5},
        "base_station": {"position_m": [0.0, 0.0], "elements": 2, "spacing_mm": 1.0},
        "objects": {
            "wall": {
                "kind": "plate", "material": "metal", "centre_m": [0.0, 0.3], "length_m": 0.004,
                "height_m": 0.003,
                "roughness": {
                    "profile": "file", "file": str(tmp_path / "heights.npz"), **roughness,
                },
            }
        },
    }  # fmt: skip


def test_a_wall_has_the_heights_that_were_measured(tmp_path: Path) -> None:
    heights = sheet()
    path = written(tmp_path, "npz", heights)
    scenario = parse_scenario(plate(tmp_path))
    surface = object_surface(scenario, "wall", seed=1, spacing=STEP)
    body = scenario.objects["wall"]
    found = np.einsum("vx,x->v", surface.vertices - surface.mean_vertices, body.normal)
    read = read_height_map(path, step=None, unit=1e-3)
    np.testing.assert_allclose(found.reshape(201, 151), read.heights[:201, :151], atol=1e-12)
    other = object_surface(scenario, "wall", seed=2, spacing=STEP)
    np.testing.assert_array_equal(other.vertices, surface.vertices)  # no seed changes a measurement
    assert body.roughness is not None
    assert body.roughness.rms == pytest.approx(read.rms)


def test_smoothing_leaves_of_a_map_what_it_leaves_of_its_spectrum(tmp_path: Path) -> None:
    from scenes.schema.roughness import Roughness

    path = written(tmp_path, "npz", sheet(900, 800))
    read = read_height_map(path, step=None, unit=1e-3)
    expected = slope_share(Roughness(rms_mm=1e3 * RMS, correlation_mm=1e3 * LENGTH), 2e-4)
    pieces = 900 * 800 * (STEP / LENGTH) ** 2
    assert read.slope_share(2e-4) == pytest.approx(expected, rel=5 / np.sqrt(pieces))


def test_what_a_file_cannot_be_is_told(tmp_path: Path) -> None:
    written(tmp_path, "npz", sheet(100, 90))
    for roughness, message in (
        ({}, r"roughness\.file = .*covers 1\.98 x 1\.78 mm, and a face has 4 x 3 mm; measure more"),
        ({"rms_mm": 1.0}, r"rms_mm = 1\.0 and the file's is .*; leave it out"),
        ({"second": {"rms_mm": 0.1, "correlation_mm": 1.0}}, "takes the heights as they are"),
        ({"file": str(tmp_path / "none.npz")}, r"none\.npz: cannot be read"),
        ({"file": str(tmp_path / "heights.txt")}, r"heights\.txt: cannot be read"),
    ):
        with pytest.raises(ScenarioError, match=message):
            parse_scenario(plate(tmp_path, **roughness))
    parse_scenario(plate(tmp_path, repeat=True))
    (tmp_path / "rough.csv").write_text("0,1\n1,2\n3,4\n", encoding="utf-8")
    with pytest.raises(Refused, match="must rise in equal steps"):
        read_height_map(tmp_path / "rough.csv", step=None, unit=1e-3)
    np.savez(tmp_path / "wrong.npz", height=np.zeros((20, 20)))
    with pytest.raises(Refused, match="holds height and no array 'heights'"):
        read_height_map(tmp_path / "wrong.npz", step=1e-5, unit=1e-3)
    np.savez(tmp_path / "flat.npz", heights=np.zeros((20, 20)))
    with pytest.raises(Refused, match="lie in one plane"):
        read_height_map(tmp_path / "flat.npz", step=1e-5, unit=1e-3)
    np.savez(tmp_path / "stepless.npz", heights=np.ones((20, 20)))
    with pytest.raises(Refused, match="holds no distance"):
        read_height_map(tmp_path / "stepless.npz", step=None, unit=1e-3)
    Image.fromarray(np.zeros((20, 20, 3), dtype=np.uint8)).save(tmp_path / "colour.tif")
    with pytest.raises(Refused, match="3 colours, no height map"):
        read_height_map(tmp_path / "colour.tif", step=1e-5, unit=1e-3)


@pytest.mark.parametrize("text", ["", "\n", "place,height\n", "# nothing\n"])
def test_a_profile_without_a_number_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "heights.csv"
    path.write_text(text)
    with pytest.raises(ScenarioError, match=r"heights\.csv: no table of numbers with commas"):
        read_height_map(path, step=STEP, unit=1e-3)
