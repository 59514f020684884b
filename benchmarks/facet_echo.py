"""The echo of a rough wall of 640 000 triangles: time over bare rays, direct sums, and memory.

Run as ``python -m benchmarks.facet_echo``; each part runs in a process of its own, so that its
peak memory is its own. ``python -m benchmarks.facet_echo rays|direct|frequencies|memory`` runs
one part. The wall is 40 cm x 5 cm at 0.25 mm, 0.8 m away and turned by 45°; 260 positions,
1001 frequencies from 220 to 295 GHz. All times are of one run on one machine, in turns.
"""

import resource
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from estimator.compute import engine  # chooses the LLVM that Dr.Jit loads when it is imported

# isort: split
import drjit as dr
import mitsuba as mi
import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from scenes.scenario import parse_scenario
from simulator.antennas.ports import Ports, isotropic
from simulator.geometry.facets import Facets
from simulator.geometry.ray_scene import CLEARANCE, facets_visible
from simulator.response.single_bounce_3d import scattered_in_space
from simulator.scattering.physical_optics import facet_transform, scattered
from simulator.scene.array_antennas import array_group
from simulator.scene.radio_scene import RadioScene, radio_scene

POSITIONS = 260
DIRECT_FACETS, DIRECT_FREQUENCIES = 20_000, 101


def wall_scene(*, scale: float = 1.0, points: int = 1001) -> RadioScene:
    """Freeze the wall; both its sides grow with the scale."""
    wall = {
        "kind": "plate",
        "material": "metal",
        "centre_m": [0.0, 0.8],
        "angle_deg": 45.0,
        "length_m": 0.4 * scale,
        "height_m": 0.05 * scale,
        # Correlated over 1 mm, so that 0.25 mm facets follow it.
        "roughness": {"rms_mm": 0.15, "correlation_mm": 1.0},
    }
    scenario = parse_scenario(
        {
            "name": "wall",
            "dimensions": 3,
            "radio": {"start_ghz": 220.0, "stop_ghz": 295.0, "points": points},
            "base_station": {"elements": POSITIONS, "spacing_mm": 0.5},
            "objects": {"wall": wall},
        }
    )
    return radio_scene(scenario, seed=0, sample=0)


def wall_facets(scene: RadioScene) -> Facets:
    """Return the facets, which this scene has."""
    if scene.facets is None:
        raise RuntimeError("the wall scatters nothing; give it another material")
    return scene.facets


def echo(
    scene: RadioScene, positions: Float[np.ndarray, "positions 3"], facets: Facets | None = None
) -> tuple[Complex[np.ndarray, "positions freqs"], float]:
    """Trace visibility and sum the echo; and the seconds that visibility took."""
    facets = wall_facets(scene) if facets is None else facets
    begin = time.perf_counter()
    visible = facets_visible(scene.rays, facets, positions)
    traced = time.perf_counter() - begin
    array = Ports(positions=positions, pattern=isotropic, visible=visible)
    frequencies = scene.scenario.radio.frequencies
    return scattered(facets, array, array, frequencies, waves="spherical"), traced


def bare_rays(scene: RadioScene, positions: Float[np.ndarray, "positions 3"]) -> float:
    """Seconds of Mitsuba's ``ray_test`` alone, on rays that lie ready."""
    facets, seconds = wall_facets(scene), 0.0
    for position in positions:
        towards = position - facets.centres
        side = np.sign(np.einsum("fx,fx->f", towards, facets.normals))
        starts = facets.centres + CLEARANCE * side[:, None] * facets.normals
        lengths = np.linalg.norm(position - starts, axis=-1)
        directions = (position - starts) / lengths[:, None]
        ray: Any = mi.Ray3f(mi.Point3f(*_single(starts)), mi.Vector3f(*_single(directions)))
        ray.maxt = mi.Float((lengths - CLEARANCE).astype(np.float32))
        dr.eval(ray)
        dr.sync_thread()
        begin = time.perf_counter()
        dr.eval(scene.rays.scene.ray_test(ray))
        dr.sync_thread()
        seconds += time.perf_counter() - begin
    return seconds


def _single(vectors: Float[np.ndarray, "facets 3"]) -> list[mi.Float]:
    return [mi.Float(axis.astype(np.float32)) for axis in vectors.T]


def against_rays() -> None:
    """Compare (a) the whole echo, as the simulator makes it, with the bare rays of all facets."""
    begin = time.perf_counter()
    scene = wall_scene()
    built = time.perf_counter() - begin
    positions = scene.scenario.base_station.element_positions
    array = array_group(scene.scenario, positions)
    few = replace(array, positions=positions[:2])
    scattered_in_space(scene, few, few)  # compiles
    bare_rays(scene, positions[:2])
    # Half of the rays before and half after, as the machine's speed may drift.
    rays = bare_rays(scene, positions[::2])
    begin = time.perf_counter()
    scattered_in_space(scene, array, array)
    whole = time.perf_counter() - begin
    rays += bare_rays(scene, positions[1::2])
    count = wall_facets(scene).count
    print(f"(a) {count} facets, {POSITIONS} positions, 1001 frequencies")
    for name, seconds in {
        "bare ray_test": rays,
        "echo, whole: visibility and sums": whole,
        "building the scene, once (apart)": built,
    }.items():
        print(f"    {name:36s} {seconds:8.2f} s {seconds / rays:6.2f} x bare rays")
    print(f"    bare rays: {count * POSITIONS / rays / 1e6:.1f} million a second")


def against_direct_sum() -> None:
    """Compare (b) a part of the wall, by an exponential per facet and frequency in NumPy."""
    scene = wall_scene(points=DIRECT_FREQUENCIES)
    facets, positions = wall_facets(scene), scene.scenario.base_station.element_positions[:2]
    frequencies = scene.scenario.radio.frequencies
    chosen = np.random.default_rng(0).choice(facets.count, DIRECT_FACETS, replace=False)
    part = replace(
        facets,
        centres=facets.centres[chosen],
        normals=facets.normals[chosen],
        sizes=facets.sizes[chosen],
        edges=facets.edges[chosen],
        two_sided=facets.two_sided[chosen],
        material=None,
    )
    visible = facets_visible(scene.rays, part, positions)
    array = Ports(positions=np.repeat(positions, 10, axis=0), pattern=isotropic,
                  visible=np.repeat(visible, 10, axis=0))  # fmt: skip
    fast = scattered(part, array, array, frequencies, waves="spherical")[::10]
    exact = direct_sum(part, positions, visible, frequencies)
    begin = time.perf_counter()
    direct_sum(part, positions, visible, frequencies, shapes=False)
    direct = (time.perf_counter() - begin) / (DIRECT_FACETS * DIRECT_FREQUENCIES * len(positions))
    error = np.linalg.norm(fast - exact) / np.linalg.norm(exact)
    whole = wall_scene()
    every = whole.scenario.base_station.element_positions[:12]
    echo(whole, every[:2])
    begin = time.perf_counter()
    _, traced = echo(whole, every)
    sums = time.perf_counter() - begin - traced
    fast_each = sums / (wall_facets(whole).count * 1001 * len(every))
    print("(b) against direct summation, a term being one facet at one frequency")
    print(f"    direct sum {direct * 1e9:8.2f} ns a term ({DIRECT_FACETS} facets, 101 frequencies)")
    print(f"    mmslam     {fast_each * 1e9:8.4f} ns a term (640 000 facets, 1001 frequencies)")
    print(f"    {direct / fast_each:.0f} times as fast, relative error {error:.1e}")


def direct_sum(
    facets: Facets,
    positions: Float[np.ndarray, "positions 3"],
    visible: np.ndarray,
    frequencies: Float[np.ndarray, " freqs"],
    *,
    shapes: bool = True,
) -> Complex[np.ndarray, "positions freqs"]:
    """Sum the facets' echoes, frequency by frequency, in double precision.

    Without the shapes' transforms it is the plainest direct sum: an exponential a term.
    """
    rows = []
    for position, seen in zip(positions, visible, strict=True):
        towards = position - facets.centres
        distance = np.sqrt(np.einsum("fx,fx->f", towards, towards))
        unit = towards / distance[:, None]
        cosine = np.abs(np.einsum("fx,fx->f", unit, facets.normals))
        amplitude = seen * cosine * facets.sizes / (4 * np.pi * distance**2)
        slopes = 2 * np.einsum("fx,fsx->fs", unit, facets.edges)
        row = []
        for frequency in frequencies:
            wavenumber = 2 * np.pi * frequency / speed_of_light
            shape = facet_transform(wavenumber * slopes[None])[0] if shapes else 1.0
            row.append(np.sum(amplitude * shape * np.exp(-2j * wavenumber * distance)))
        rows.append(-1j * np.array(row))
    return np.stack(rows)


def against_frequencies() -> None:
    """Time (c) the whole echo of 24 positions at 1001 and at 5500 frequencies, in turns."""
    scenes = {points: wall_scene(points=points) for points in (1001, 5500)}
    best = dict.fromkeys(scenes, (np.inf, 0.0))
    for turn in range(4):
        for points, scene in scenes.items():
            positions = scene.scenario.base_station.element_positions[: 24 if turn else 2]
            begin = time.perf_counter()
            _, traced = echo(scene, positions)
            seconds = time.perf_counter() - begin
            if turn:  # the first compiles
                best[points] = min(best[points], (seconds, seconds - traced))
    print("(c) 640 000 facets, 24 positions")
    for points, (seconds, sums) in best.items():
        print(f"    {points} frequencies: {seconds:.2f} s, without visibility {sums:.2f} s")
    whole, sums = (best[5500][part] / best[1001][part] for part in (0, 1))
    print(f"    5500 over 1001: {whole:.2f} x, without visibility {sums:.2f} x")


def peak_memory(scale: float) -> None:
    """Measure (d) the most memory that this process ever held, over all positions of a wall."""
    scene = wall_scene(scale=scale)
    array = array_group(scene.scenario, scene.scenario.base_station.element_positions)
    begin = time.perf_counter()
    scattered_in_space(scene, array, array)
    seconds = time.perf_counter() - begin
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(
        f"(d) {wall_facets(scene).count} facets, {POSITIONS} positions: {peak:.2f} GiB, "
        f"{seconds:.1f} s"
    )


PARTS: dict[str, Callable[[], None]] = {
    "rays": against_rays,
    "direct": against_direct_sum,
    "frequencies": against_frequencies,
    "memory": lambda: peak_memory(1.0),
    "memory-4": lambda: peak_memory(2.0),
}


def main() -> int:
    """Run one part here, or each in a process of its own."""
    if len(sys.argv) > 1:
        if sys.argv[1] not in PARTS:
            print(f"{sys.argv[1]!r}: no such part; use one of {', '.join(PARTS)}", file=sys.stderr)
            return 2
        PARTS[sys.argv[1]]()
        return 0
    print(f"backend {engine.backend()}, {engine.thread_count()} threads", flush=True)
    for part in PARTS:
        subprocess.run([sys.executable, "-m", "benchmarks.facet_echo", part], check=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
