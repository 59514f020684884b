"""Processor time of simulating several rough walls and posts, which echoes cross in turn.

Run as ``python -m benchmarks.several_surfaces [--bounces N] [--limit SECONDS]``: one to three metal
walls of 30 cm and none or two posts before an array of 128 elements, 501 points over 220 to
295 GHz, a user among them. Each in a process of its own, killed after the limit.
"""

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Sequence

from scenes.scenario import Scenario, parse_scenario

WALLS = (
    {"centre_m": [0.0, 0.5], "angle_deg": 10.0},
    {"centre_m": [-0.3, 0.35], "angle_deg": 70.0},
    {"centre_m": [0.3, 0.4], "angle_deg": 120.0},
)
POSTS = ([0.1, 0.3], [-0.12, 0.25])


def room(walls: int, posts: int, *, bounces: int) -> Scenario:
    """Return a room of some walls and posts in the plane."""
    objects: dict[str, object] = {
        f"wall{index}": {
            "kind": "plate",
            "material": "metal",
            "length_m": 0.3,
            "roughness": {"rms_mm": 0.1, "correlation_mm": 1.0},
            **WALLS[index],
        }
        for index in range(walls)
    }
    for index in range(posts):
        objects[f"post{index}"] = {
            "kind": "cylinder",
            "material": "metal",
            "radius_m": 0.006,
            "centre_m": POSTS[index],
        }
    return parse_scenario(
        {
            "name": "several_surfaces",
            "max_bounces": bounces,
            "radio": {"start_ghz": 220.0, "stop_ghz": 295.0, "points": 501},
            "base_station": {"elements": 128, "spacing_mm": 0.5},
            "objects": objects,
            "users": {"user": {"position_m": [0.2, 0.2]}},
        }
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a row for each number of walls and posts."""
    parser = argparse.ArgumentParser(description="Time of walls and posts in turn.")
    parser.add_argument("--bounces", type=int, default=2)
    parser.add_argument("--limit", type=float, default=600.0, help="for each [600 s]")
    parser.add_argument("--one", type=int, nargs=2, help="walls and posts, in this process")
    given = parser.parse_args(arguments)
    if given.one:
        from simulator.simulation import simulate

        begin, used = time.perf_counter(), time.process_time()
        simulate(room(given.one[0], given.one[1], bounces=given.bounces), seed=0)
        print(
            f"{given.one[0]:>5} {given.one[1]:>5} {time.process_time() - used:>7.1f} "
            f"{time.perf_counter() - begin:>7.1f} {os.getloadavg()[0]:>5.1f}"
        )
        return
    print("walls posts   CPU/s  time/s  load", flush=True)
    for walls in (1, 2, 3):
        for posts in (0, 2):
            command = [sys.executable, "-m", "benchmarks.several_surfaces"]
            command += ["--one", str(walls), str(posts), "--bounces", str(given.bounces)]
            try:
                subprocess.run(command, timeout=given.limit, check=True)
            except subprocess.TimeoutExpired:
                print(f"{walls:>5} {posts:>5}    over {given.limit:g} s", flush=True)


if __name__ == "__main__":
    main()
