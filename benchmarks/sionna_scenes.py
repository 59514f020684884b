"""The scenes that Sionna RT ships: whether they simulate, in what time, and how near its solver.

    python -m benchmarks.sionna_scenes                      # all scenes, each in its own process
    python -m benchmarks.sionna_scenes box --ghz 60         # one of them, here

One user, an array of 8 elements half a wavelength apart, 41 frequencies over the 0.4 GHz below the
given one (marble is known up to 60 GHz), no transmission through slabs in either program. The
difference is the norm of the pilots' difference over that of Sionna's pilot: its path solver's
coefficients at the middle of the band, summed with their delays.
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from typing import Any

import numpy as np
from jaxtyping import Complex

from scenes.meshes.foreign_scene import sionna_scenes
from scenes.scenario import Scenario, ScenarioError, parse_scenario

LONGEST = 120.0
"""Time after which a scene is given up. [s]"""

MEMORY = 16 * 2**30
"""Address space that a scene may take. [byte]"""

PLACES = {
    "box": ([0.5, -2.0, 1.5], [1.3, 2.1, 1.2]),
    "box_knife": ([0.5, -2.0, 1.5], [1.3, 2.1, 1.2]),
    "box_one_screen": ([0.5, -2.0, 1.5], [1.3, 2.1, 1.2]),
    "box_two_screens": ([0.5, -3.7, 1.5], [1.3, 3.1, 1.2]),
    "double_reflector": ([-6.0, -3.0, 3.0], [-4.0, 3.0, 2.0]),
    "etoile": ([0.0, 0.0, 60.0], [30.0, -12.0, 1.6]),
    "floor_wall": ([-1.0, -1.2, 1.5], [1.2, 0.4, 1.1]),
    "florence": ([0.0, 0.0, 130.0], [20.0, 0.0, 1.6]),
    "munich": ([8.5, 21.0, 27.0], [44.0, 94.0, 1.6]),
    "san_francisco": ([0.0, 0.0, 180.0], [20.0, 0.0, 1.6]),
    "simple_reflector": ([-0.3, -0.5, 2.0], [0.4, 0.4, 1.5]),
    "simple_street_canyon": ([-30.0, 0.5, 12.0], [24.0, 2.0, 1.6]),
    "simple_street_canyon_with_cars": ([-30.0, 0.5, 12.0], [24.0, 2.0, 1.6]),
    "simple_wedge": ([20.0, 8.0, 1.0], [5.0, 6.0, -1.0]),
    "triple_reflector": ([-6.0, -3.0, 3.0], [-4.0, 3.0, 2.0]),
}
"""Of the base station and of the user. [m]"""


def scenario(name: str, ghz: float, bounces: int) -> Scenario:
    """Put an array and a user into a scene of Sionna RT."""
    station, user = PLACES[name]
    return parse_scenario(
        {
            "name": name,
            "dimensions": 3,
            "max_bounces": bounces,
            "radio": {"start_ghz": ghz - 0.4, "stop_ghz": ghz, "points": 41},
            "base_station": {
                "elements": [8, 1],
                "spacing_mm": 150.0 / ghz,
                "position_m": station,
            },
            "geometry": {"sionna": name},
            "users": {"user": {"position_m": user}},
            "effects": {"transmission": False},
        }
    )


def row(name: str, ghz: float, bounces: int) -> dict[str, Any]:
    """Simulate one scene, and compare it."""
    told: dict[str, Any] = {"scene": name, "ghz": ghz, "max_bounces": bounces}
    started = time.perf_counter()
    try:
        made = scenario(name, ghz, bounces)
        told["load_s"] = round(time.perf_counter() - started, 1)
        from simulator.simulation import simulate

        pilots = simulate(made, seed=0).measurement.uplinks
    except ScenarioError as error:
        return told | {"refused": str(error)[:300]}
    told["all_s"] = round(time.perf_counter() - started, 1)
    usage = resource.getrusage(resource.RUSAGE_SELF)
    told |= {
        "cpu_s": round(usage.ru_utime + usage.ru_stime, 1),
        "gib": round(usage.ru_maxrss / 2**20, 2),
    }
    theirs, paths = sionna_pilot(made, name, bounces)
    if not pilots:
        return told | {"paths": paths, "difference": "nothing received"}
    ours = pilots[0].samples
    level = np.linalg.norm(theirs)
    if level == 0:
        return told | {"paths": paths, "difference": "Sionna finds no path"}
    return told | {
        "paths": paths,
        "difference": round(float(np.linalg.norm(ours - theirs) / level), 4),
        "level_db": round(float(20 * np.log10(np.linalg.norm(ours) / level)), 3),
    }


def sionna_pilot(
    made: Scenario, name: str, bounces: int
) -> tuple[Complex[np.ndarray, "elements freqs"], int]:
    """Sum what Sionna's path solver finds in its own scene; count the first element's paths."""
    import sionna.rt as rt

    scene = rt.load_scene(getattr(rt.scene, name), merge_shapes=False)
    centre = made.radio.centre_frequency
    scene.frequency = centre
    scene.tx_array = scene.rx_array = rt.PlanarArray(
        num_rows=1, num_cols=1, pattern="iso", polarization="V"
    )
    scene.add(rt.Transmitter("user", made.users["user"].position.tolist()))
    elements = made.base_station.element_positions
    for index, place in enumerate(elements):
        scene.add(rt.Receiver(f"element {index}", place.tolist()))
    found = rt.PathSolver(deterministic=True)(
        scene, max_depth=bounces, refraction=False, synthetic_array=False, seed=0
    )
    gains, delays = found.cir(normalize_delays=False, out_type="numpy")
    gains = gains.reshape(len(elements), -1)
    delays = delays.reshape(len(elements), -1)
    pilot = np.zeros((len(elements), made.radio.frequencies.size), dtype=np.complex128)
    for index, (gain, delay) in enumerate(zip(gains, delays, strict=True)):
        some = delay >= 0
        turns = np.outer(delay[some], made.radio.frequencies - centre)
        pilot[index] = gain[some] @ np.exp(-2j * np.pi * turns)
    return pilot, int(np.count_nonzero(delays[0] >= 0))


def main() -> None:
    """Print a row for each scene."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", nargs="?", choices=sorted(PLACES))
    parser.add_argument("--ghz", type=float, default=28.0)
    parser.add_argument("--bounces", type=int, default=2)
    given = parser.parse_args()
    if given.scene:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        print(json.dumps(row(given.scene, given.ghz, given.bounces)))
        return
    for name in sorted(set(PLACES) & set(sionna_scenes())):
        command = [sys.executable, "-m", "benchmarks.sionna_scenes", name]
        command += ["--ghz", str(given.ghz), "--bounces", str(given.bounces)]
        try:
            made = subprocess.run(
                command, capture_output=True, text=True, timeout=LONGEST, check=False
            )
        except subprocess.TimeoutExpired:
            print(json.dumps({"scene": name, "ghz": given.ghz, "failed": f"over {LONGEST:g} s"}))
            continue
        lines = made.stdout.splitlines() or [made.stderr[-300:]]
        print(lines[-1], flush=True)


if __name__ == "__main__":
    main()
