"""Where the time of an estimate goes: imports, a first estimate, further ones, images, the command.

Run as ``python -m benchmarks.estimate [SCENARIO]`` (default: ``slam_2d``). Ratios are to a further
estimate without images, of the same run: they compare on a busy machine, times do not. Processor
time counts all threads; a first estimate also loads kernels and asks the system for memory, which
further ones have already.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
from typing import TypeVar

import mmslam
from mmslam.results.estimate import Estimate

REPEATS = 5

IMPORTS = "import mmslam.cli, mmslam.location, estimator.localization.pipeline"
"""What ``mmslam locate`` imports before its estimate."""

Result = TypeVar("Result")
Times = tuple[float, float]  # of the processor, on the clock [s]


def _taken(work: Callable[[], Result]) -> tuple[Result, Times]:
    begin = time.process_time(), time.perf_counter()
    result = work()
    return result, (time.process_time() - begin[0], time.perf_counter() - begin[1])


def _of_process(arguments: list[str]) -> Times:
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(arguments, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return used, time.perf_counter() - begin


def _shown(estimate: Estimate) -> None:
    """Have the images and the close-ups formed."""
    _ = estimate.raw_image, estimate.close_ups


def main() -> None:
    """Measure one scenario, and print a table."""
    name = sys.argv[1] if len(sys.argv) > 1 else "slam_2d"
    measurement = mmslam.simulate(mmslam.load_scenario(name))
    rows: dict[str, Times] = {}
    stages: dict[str, list[float]] = {}
    _, rows["first estimate"] = _taken(lambda: mmslam.locate(measurement, images=False))
    again, images = [], []
    for _ in range(REPEATS):
        estimate, times = _taken(lambda: mmslam.locate(measurement, images=False))
        again.append(times)
        for stage, seconds in estimate.timings.items():
            stages.setdefault(stage, []).append(seconds / times[1])
        whole = mmslam.locate(measurement)
        images.append(_taken(partial(_shown, whole))[1])
    rows["further estimate"] = _medians(again)
    rows["images and close-ups"] = _medians(images)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "measurement.zarr"
        mmslam.write(file, measurement)
        command = [sys.executable, "-m", "mmslam", "locate", str(file), "--out", f"{folder}/out"]
        rows["imports of the command"] = _of_process([sys.executable, "-c", IMPORTS])
        rows["mmslam locate"] = _of_process(command)
    print(f"{name}: {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}, medians of {REPEATS}")
    print(f"{'':24s} {'processor':>10s} {'clock':>9s} {'ratio':>7s}")
    for row, (used, passed) in rows.items():
        print(f"{row:24s} {used:8.2f} s {passed:7.2f} s {used / rows['further estimate'][0]:7.2f}")
    for stage, shares in stages.items():
        print(f"  of an estimate, {stage}: {100 * median(shares):.0f} %")


def _medians(times: list[Times]) -> Times:
    used, passed = zip(*times, strict=True)
    return median(used), median(passed)


if __name__ == "__main__":
    main()
