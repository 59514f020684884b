import subprocess
import sys
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[3]

CONFIG = """
base = "point_scatterers"
count = 300
seed = 5
[set]
"base_station.elements" = 128
"radio.points" = 256
"users.ann.position_m" = [0.2, 0.5]
[vary]
"points.near.position_m" = { kind = "in_box", low_m = [-0.1, 0.4], high_m = [0.1, 0.5] }
"noise.snr_db" = { kind = "uniform", low = 10.0, high = 30.0 }
"""


@pytest.mark.slow
def test_workers_killed_and_runs_interrupted_leave_the_same_bytes(tmp_path: Path) -> None:
    config = tmp_path / "config.toml"
    config.write_text(CONFIG, encoding="utf-8")
    command = [sys.executable, "-m", "benchmarks.dataset_endurance", str(config)]
    done = subprocess.run(
        [*command, "--folder", str(tmp_path / "made")],
        cwd=CHECKOUT,
        capture_output=True,
        text=True,
        timeout=1200,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("killed worker") == 3
    assert done.stdout.count("interrupted: exit code 130") == 2
    assert "the same bytes" in done.stdout
