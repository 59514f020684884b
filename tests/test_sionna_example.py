import runpy
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest


def test_sionnas_solver_and_renderer_run_on_a_scenario(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mpl.use("agg")
    monkeypatch.setattr(sys, "argv", ["example", "slam_2d", str(tmp_path)])
    script = Path(__file__).parents[1] / "examples" / "sionna_on_a_scenario.py"
    names = runpy.run_path(str(script))
    lengths = names["lengths"][names["lengths"] > 0]
    np.testing.assert_allclose(np.sort(lengths)[-1], 1.8, atol=1e-6)  # single precision
    for picture in ("sionna_paths.png", "sionna_radio_map.png"):
        assert (tmp_path / picture).stat().st_size > 10_000
