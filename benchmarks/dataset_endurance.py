"""A dataset made under attack equals one made in peace, byte for byte.

Run as ``python -m benchmarks.dataset_endurance [CONFIG] [--count 1000] [--folder DIR]``. The
dataset is made once in a quiet run. Then again, while a worker is killed (SIGKILL to its process)
at 15, 30 and 60 % of the samples, and the whole run interrupted (Ctrl-C) at 45 and 75 % and taken
up by the same command. Prints what happened and compares all bytes; 1 if they differ.
"""

import argparse
import filecmp
import os
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Sequence
from pathlib import Path

CONFIG = Path(__file__).parents[1] / "examples" / "datasets" / "small_rooms.toml"

ATTACKS = ((0.15, "kill"), (0.30, "kill"), (0.45, "interrupt"), (0.60, "kill"), (0.75, "interrupt"))
"""Share of the samples at which something happens, and what."""


def command(config: Path, store: Path, workers: int) -> list[str]:
    """Return the command that makes a dataset."""
    program = [sys.executable, "-m", "mmslam", "dataset", str(config), "-o", str(store)]
    return [*program, "--workers", str(workers)]


def worker_processes(parent: int) -> list[int]:
    """Return the processes that a run has started to make samples."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                status = (entry / "stat").read_text()
                line = (entry / "cmdline").read_bytes()
            except OSError:  # it has ended
                continue
            if int(status.rpartition(")")[2].split()[1]) == parent and b"spawn_main" in line:
                found.append(int(entry.name))
    return sorted(found)


def done(store: Path) -> int:
    """Count the samples that are done, by their files."""
    folder = store.with_name(store.name + ".unfinished")
    try:
        waiting = sum(1 for _ in (folder / "samples").glob("*.npz"))
        blocks = sum(1 for _ in (folder / "blocks").glob("*.npz"))
        return waiting + (blocks * block_size(store) if blocks else 0)
    except OSError:  # not begun, or finished in the meantime
        return 0


def block_size(store: Path) -> int:
    """Return the samples in one file of the echo, as the store says."""
    import zarr

    folder = store.with_name(store.name + ".unfinished") / "store"
    echo = zarr.open_group(folder, mode="r")["echo"]
    assert isinstance(echo, zarr.Array)
    assert echo.shards is not None
    return int(echo.shards[0])


def attacked(config: Path, store: Path, *, count: int, workers: int) -> None:
    """Make a dataset while workers are killed and the run is interrupted."""
    attacks = list(ATTACKS)
    while True:
        run = subprocess.Popen(
            command(config, store, workers),
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=_hear_interruptions,
        )
        while run.poll() is None:
            time.sleep(0.05)
            if not attacks or done(store) < attacks[0][0] * count:
                continue
            _, what = attacks[0]
            if what == "interrupt":
                attacks.pop(0)
                began = time.perf_counter()
                run.send_signal(signal.SIGINT)
                _, told = run.communicate(timeout=120)
                took = time.perf_counter() - began
                print(f"interrupted: exit code {run.returncode} after {took:.1f} s")
                print("  " + told.strip().splitlines()[-1])
                assert run.returncode == 130, told
            elif victims := worker_processes(run.pid):
                attacks.pop(0)
                os.kill(victims[0], signal.SIGKILL)
                print(f"killed worker {victims[0]} at {done(store)} of {count} samples", flush=True)
        if run.returncode != 130:
            assert run.returncode == 0, run.communicate()[1]
            assert not attacks, f"the run ended before {attacks}"
            return


def _hear_interruptions() -> None:
    # A job in the background is deaf to them, and so would be what it starts.
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def differing(one: Path, other: Path) -> list[str]:
    """Return what differs between two folders: files that only one has, or with other bytes."""
    names = [
        {str(p.relative_to(top)) for p in top.rglob("*") if p.is_file()} for top in (one, other)
    ]
    _, wrong, errors = filecmp.cmpfiles(one, other, sorted(names[0] & names[1]), shallow=False)
    return sorted(names[0] ^ names[1]) + wrong + errors


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the dataset in peace and under attack, and compare."""
    parser = argparse.ArgumentParser(description="A dataset made under attack.")
    parser.add_argument("config", nargs="?", type=Path, default=CONFIG)
    parser.add_argument("--count", type=int, help="samples [as CONFIG says]")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--folder", type=Path, help="keep the datasets there")
    options = parser.parse_args(arguments)
    text = options.config.read_text(encoding="utf-8")
    table = tomllib.loads(text)
    count = options.count or table["count"]
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        config = folder / "config.toml"
        config.write_text(text.replace(f"count = {table['count']}", f"count = {count}"))
        began = time.perf_counter()
        peace, war = folder / "peace.zarr", folder / "war.zarr"
        subprocess.run(command(config, peace, options.workers), check=True)
        print(f"in peace: {count} samples in {time.perf_counter() - began:.0f} s", flush=True)
        began = time.perf_counter()
        attacked(config, war, count=count, workers=options.workers)
        print(f"under attack: {time.perf_counter() - began:.0f} s")
        wrong = differing(peace, war)
        files = sum(1 for path in war.rglob("*") if path.is_file())
        print(f"{files} files: " + (f"DIFFERENT: {wrong[:5]}" if wrong else "the same bytes"))
        left = [path.name for path in folder.iterdir() if "unfinished" in path.name]
        print(f"left behind: {left or 'nothing'}")
    return int(bool(wrong or left))


if __name__ == "__main__":
    raise SystemExit(main())
