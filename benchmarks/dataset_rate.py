"""Datasets: samples per minute, what Dask costs, bytes per sample, memory against their number.

Run as ``python -m benchmarks.dataset_rate [--samples 60] [--many 1000] [--skip memory …]``:

- the rate of ``slam_2d`` as it is and of a small one (128 elements, 256 frequencies), with one and
  with two workers of one thread each, from the first sample on (so without their start), and the
  efficiency of the second worker;
- the overhead of Dask for each sample: tiny samples by one worker, against the same made in the
  same process;
- the bytes that a sample takes in the store, over those of its echo and uplinks;
- the peak memory of all processes together for 100 and for ``--many`` small samples, each run in
  processes of its own.
"""

import argparse
import importlib
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from simulator.dataset.builder import make_dataset, plan_dataset
from simulator.dataset.task_runner import Workers

psutil: Any = importlib.import_module("psutil")  # comes with Dask's scheduler, without types

BASE = """
base = "slam_2d"
count = {count}
[vary]
"objects.wall.angle_deg" = {{ kind = "uniform", low = 40.0, high = 50.0 }}
"noise.snr_db" = {{ kind = "uniform", low = 10.0, high = 30.0 }}
"""
SMALL = f"""{BASE}
[set]
"base_station.elements" = 128
"radio.stop_ghz" = 239.125
"radio.points" = 256
"""
TINY = """
base = "point_scatterers"
count = {count}
[set]
"base_station.elements" = 16
"radio.points" = 16
[vary]
"noise.snr_db" = {{ kind = "uniform", low = 10.0, high = 30.0 }}
"""


def rate(config: str, *, count: int, workers: int) -> tuple[float, Path, int]:
    """Return the time for each sample after the first ones, the store, and its raw bytes."""
    folder = Path(tempfile.mkdtemp())
    (folder / "config.toml").write_text(config.format(count=count))
    job = plan_dataset(folder / "config.toml", folder / "it.zarr")
    times: list[float] = []
    make_dataset(
        job, workers=Workers(processes=workers), tell=lambda *_: times.append(time.perf_counter())
    )
    first = 1 + 2 * max(workers, 1)  # each worker's first samples compile its kernels
    return (times[-1] - times[first]) / (len(times) - 1 - first), job.target, count


def stored(store: Path) -> tuple[int, int]:
    """Return the bytes of a store, and those of its echo and uplinks uncompressed."""
    import zarr

    root = zarr.open_group(store, mode="r")
    raw = 0
    for name in ("echo", "uplink"):
        if name in root:
            array = root[name]
            assert isinstance(array, zarr.Array)
            raw += array.nbytes
    return sum(path.stat().st_size for path in store.rglob("*") if path.is_file()), raw


def peak_memory(count: int, *, workers: int) -> int:
    """Return the most memory that a run and its workers hold together [byte]."""
    with tempfile.TemporaryDirectory() as folder:
        config = Path(folder) / "config.toml"
        config.write_text(SMALL.format(count=count))
        command = [sys.executable, "-m", "mmslam", "dataset", str(config)]
        command += ["-o", str(Path(folder) / "it.zarr"), "--workers", str(workers)]
        peak = 0
        with subprocess.Popen(command, stdout=subprocess.DEVNULL) as run:
            process = psutil.Process(run.pid)
            while run.poll() is None:
                try:
                    family = [process, *process.children(recursive=True)]
                    peak = max(peak, sum(one.memory_info().rss for one in family))
                except psutil.NoSuchProcess:
                    pass  # one has ended in between
                time.sleep(0.2)
        if run.returncode != 0:
            raise RuntimeError(f"{' '.join(command)} has ended with {run.returncode}")
        return peak


def main(arguments: Sequence[str] | None = None) -> int:
    """Print all figures."""
    parser = argparse.ArgumentParser(description="Rate, size and memory of datasets.")
    parser.add_argument("--samples", type=int, default=60, help="for the rates")
    parser.add_argument("--many", type=int, default=1000, help="for the memory")
    parser.add_argument(
        "--skip", nargs="*", default=[], choices=["small", "slam_2d", "dask", "memory"]
    )
    options = parser.parse_args(arguments)
    for name, config in (("small", SMALL), ("slam_2d", BASE)):
        if name in options.skip:
            continue
        alone, store, count = rate(config, count=options.samples, workers=1)
        both, _, _ = rate(config, count=options.samples, workers=2)
        size, raw = stored(store)
        print(f"{name}: one worker {60 / alone:.1f}/min ({alone:.3f} s each), ", end="")
        print(f"two {60 / both:.1f}/min, efficiency {100 * alone / both / 2:.0f} %")
        print(f"{name}: {size / count / 1e3:.0f} kB a sample, {size / raw:.3f} of raw", flush=True)
    if "dask" not in options.skip:
        count = 10 * options.samples
        within, _, _ = rate(TINY, count=count, workers=0)
        by_one, _, _ = rate(TINY, count=count, workers=1)
        told = f"{1e3 * within:.1f} ms here, {1e3 * by_one:.1f} ms by one worker"
        print(f"tiny samples: {told}: Dask costs {1e3 * (by_one - within):.1f} ms each", flush=True)
    if "memory" not in options.skip:
        few, many = (peak_memory(count, workers=2) for count in (100, options.many))
        told = f"{few / 2**20:.0f} MiB for 100 samples, {many / 2**20:.0f} for {options.many}"
        print(f"memory of all processes: {told}: {many / few:.2f} times")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
