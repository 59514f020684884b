import runpy
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest


@pytest.mark.slow  # a simulation, and seven estimates of a whole room
def test_the_example_tracks_a_user_around_the_corner(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mpl.use("agg")
    script = Path(__file__).parents[1] / "examples" / "track_a_user.py"
    monkeypatch.setattr(sys, "argv", [str(script), str(tmp_path)])
    names = runpy.run_path(str(script))
    points = names["ann"].track.points
    assert [point.candidate for point in points] == [0, 0, 0, None, 0, 0, 0]
    way = np.array([point.position[:2] for point in points])
    # 1 mm: what slam_2d promises of every seed.
    assert np.linalg.norm(way - names["places"], axis=1).max() < 1e-3
    assert (tmp_path / "track.png").stat().st_size > 0
