"""Time and peak memory of simulating each scenario of the library.

Run as ``python -m benchmarks.scenarios [NAME or FILE.toml]… [--limit SECONDS]``; without names,
for the whole library. Each is one ``mmslam simulate`` in a process of its own, so that the
times hold the start of Python and Sionna (some seconds) and the peak is its own.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from scenes.files.loading import load_scenario, scenario_names


@dataclass(frozen=True, kw_only=True)
class Cost:
    """What a simulation took."""

    code: int  # exit status; negative if it was killed for its time
    seconds: float  # on the wall's clock [s]
    processor: float  # of all threads [s]
    memory: int  # most that was resident at once [byte]
    stored: int  # of the measurement's store [byte]


def cost(scenario: str, *, limit: float) -> Cost:
    """Simulate a scenario in a process of its own, and kill it after ``limit`` seconds."""
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder) / "it.zarr"
        command = [sys.executable, "-m", "mmslam", "simulate", scenario, "-o", str(store)]
        begin = time.perf_counter()
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as run:
            assert run.stderr is not None
            killer = threading.Timer(limit, run.kill)
            killer.start()
            told = run.stderr.read()
            _, status, used = os.wait4(run.pid, 0)
            seconds = time.perf_counter() - begin
            killer.cancel()
            run.returncode = os.waitstatus_to_exitcode(status)
        if run.returncode > 0:
            print(told.decode(errors="replace")[-2000:], file=sys.stderr)
        return Cost(
            code=run.returncode,
            seconds=seconds,
            processor=used.ru_utime + used.ru_stime,
            memory=used.ru_maxrss * 1024,
            stored=sum(path.stat().st_size for path in store.rglob("*") if path.is_file()),
        )


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a table, a line for each scenario; 1 if one of them failed or took too long."""
    parser = argparse.ArgumentParser(description="Time and peak memory of each scenario.")
    parser.add_argument("scenarios", nargs="*", help="names or files [the whole library]")
    parser.add_argument("--limit", type=float, default=1800.0, help="for each [1800 s]")
    options = parser.parse_args(arguments)
    names = options.scenarios or list(scenario_names())
    width = max(len(name) for name in names)
    print(f"{'scenario':<{width}}  {'channels':>8} {'points':>6} {'users':>5} ", end="")
    print(f"{'time/s':>7} {'CPU/s':>7} {'peak/GiB':>8} {'file/MiB':>8}", flush=True)
    failed = False
    for name in names:
        scenario = load_scenario(name)
        used = cost(name, limit=options.limit)
        failed |= used.code != 0
        print(
            f"{name:<{width}}  {scenario.base_station.element_count:>8} "
            f"{scenario.radio.points:>6} {len(scenario.users):>5}  {used.seconds:>7.1f} "
            f"{used.processor:>7.1f} {used.memory / 2**30:>8.2f} {used.stored / 2**20:>8.1f}"
            + ("" if used.code == 0 else "  failed" if used.code > 0 else "  stopped: too long"),
            flush=True,
        )
    return int(failed)


if __name__ == "__main__":
    raise SystemExit(main())
