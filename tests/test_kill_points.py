"""Commands that are killed or run out of space; in a process of their own, since they fork."""

import subprocess
import sys
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[1]


def attacked(*arguments: str, seconds: float) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.kill_points", *arguments],
        cwd=CHECKOUT,
        capture_output=True,
        text=True,
        timeout=seconds,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.skipif(sys.platform != "linux", reason="kills by signals of Linux")
def test_a_command_killed_at_some_steps_loses_nothing() -> None:
    told = attacked("--case", "run", "--case", "dataset", "--points", "1", seconds=600)
    assert told.count("nothing lost, same bytes") == 8
    assert told.endswith("8 attacks\n")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="kills by signals of Linux")
def test_commands_killed_at_200_steps_lose_nothing() -> None:
    told = attacked("--points", "200", seconds=7200)
    assert told.count("nothing lost, same bytes") == 28
