import runpy
from pathlib import Path

import matplotlib as mpl
import pytest


def test_the_example_images_a_numpy_array(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mpl.use("agg")
    monkeypatch.chdir(tmp_path)
    script = Path(__file__).parents[1] / "examples" / "image_a_numpy_array.py"
    names = runpy.run_path(str(script))
    peak = abs(names["image"]).argmax()
    place = names["grid"].points.reshape(-1, 3)[peak]
    assert place == pytest.approx([0.03, 0.4, 0.0], abs=0.25e-3)  # half a pixel
    assert (tmp_path / "image.png").stat().st_size > 0
