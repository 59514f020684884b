"""One row of the table of foreign scenes."""

import resource
import time
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.constants import speed_of_light

from scenes.files.loading import load_scenario
from scenes.meshes.foreign_scene import sionna_scenes
from scenes.scenario import Scenario, ScenarioError
from validation.trials.foreign_scenes.shipped_scenes import PLACES, shipped_scenario

FAINT_DB = 30.0
"""Level below the strongest path from which on paths are not compared. [dB]"""

SAME = 1e-3
"""Largest difference of the lengths of two paths that are one, if their levels are alike. [m]"""


@dataclass(frozen=True, kw_only=True)
class Row:
    """What a scene gave."""

    scene: str
    ghz: float | None = None  # highest frequency [GHz]
    loads: bool = False
    simulates: bool = False
    told: str = ""  # why not, or what cannot be compared
    load_cpu_s: float | None = None
    cpu_s: float | None = None  # of loading and simulating
    wall_s: float | None = None
    gib: float | None = None  # at most, Sionna's path solver left aside
    echo_db: float | None = None  # mean level
    pilot: float | None = None  # largest difference of a user's pilot over Sionna's [-]
    paths: int | None = None  # within FAINT_DB, that both have, of all users
    alone: int | None = None  # within FAINT_DB, that one of the two has
    length_um: float | None = None  # largest difference of a path's length
    level_db: float | None = None  # largest difference of a path's level


def table_row(scene: str, *, ghz: float, bounces: int) -> Row:
    """Simulate one scene and compare it.

    Parameters
    ----------
    scene
        A name of Sionna RT's own, or a TOML file.
    ghz, bounces
        Highest frequency and most reflections, for scenes of Sionna RT's own. [GHz]
    """
    started, shipped = time.perf_counter(), scene in PLACES
    told: dict[str, Any] = {"scene": scene if shipped else _short(Path(scene))}
    try:
        made = shipped_scenario(scene, ghz, bounces) if shipped else load_scenario(scene)
        told |= {"loads": True, "load_cpu_s": _cpu(), "ghz": made.radio.stop_ghz}
        from simulator.simulation import simulate

        measured = simulate(made, seed=0).measurement
    except ScenarioError as error:
        return Row(**told | {"told": str(error).splitlines()[0][:200], "cpu_s": _cpu()})
    told |= {
        "simulates": True,
        "cpu_s": _cpu(),
        "wall_s": round(time.perf_counter() - started, 1),
        "gib": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20, 2),
    }
    if measured.echo is not None and measured.echo.samples.any():
        level = 10 * np.log10(np.mean(np.abs(measured.echo.samples) ** 2))
        told["echo_db"] = round(float(level), 2)
    file = sionna_scenes()[scene] if shipped else _scene_file(Path(scene))
    if file is None or not made.users:
        return Row(**told)
    pilots = {pilot.user: pilot.samples for pilot in measured.uplinks}
    return Row(**told | _compared(made, pilots, file))


def _short(path: Path) -> str:
    return str(Path(path.parent.name) / path.name)


def _cpu() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return round(usage.ru_utime + usage.ru_stime, 1)


def _scene_file(path: Path) -> Path | None:
    """Return the XML file of a scenario's table [geometry], if it has one."""
    file = tomllib.loads(path.read_text(encoding="utf-8")).get("geometry", {}).get("file")
    return path.parent / file if file else None


def _compared(made: Scenario, pilots: Mapping[str, np.ndarray], file: Path) -> dict[str, Any]:
    from validation.trials.foreign_scenes.path_solver import solved_pilots

    # The ends and the middle of the band; paths are compared in the middle.
    picks = [0, made.radio.points - 1, made.radio.points // 2]
    frequencies = made.radio.frequencies[picks]
    try:
        theirs = solved_pilots(made, file, frequencies)
    except (RuntimeError, ValueError) as error:
        return {"told": f"Sionna RT: {error}".splitlines()[0][:200]}
    from simulator.scene.user_paths import user_paths

    first = made.base_station.element_positions[0]
    ours_by_user = user_paths(made, frequency=float(frequencies[-1]), place=first)
    differences, matches = [0.0], []
    for name, solved in theirs.items():
        level = float(np.linalg.norm(solved.samples))
        ours = pilots.get(name, np.zeros((len(solved.samples), made.radio.points), dtype=complex))
        apart = float(np.linalg.norm(ours[:, picks] - solved.samples))
        differences.append(apart / level if level > 0 else (np.inf if apart > 0 else 0.0))
        paths = [(one.length, abs(one.gain)) for one in ours_by_user[name]]
        matches.append(_matched(paths, solved.delays[0], solved.gains[0]))
    return {
        "pilot": round(max(differences), 4),
        "paths": sum(len(one) for one, _ in matches),
        "alone": sum(alone for _, alone in matches),
        "length_um": round(1e6 * max((p[0] for one, _ in matches for p in one), default=0.0), 1),
        "level_db": round(max((p[1] for one, _ in matches for p in one), default=0.0), 3),
    }


def _matched(
    ours: list[tuple[float, float]], delays: np.ndarray, gains: np.ndarray
) -> tuple[list[tuple[float, float]], int]:
    """Pair the paths to the first element; return differences of lengths and levels, and the rest.

    Levels are in dB, lengths in m. Sionna finds a path over an edge of two triangles twice.
    """
    theirs = [
        (float(d) * speed_of_light, abs(complex(g))) for d, g in zip(delays, gains, strict=True)
    ]
    strongest = max((level for _, level in [*ours, *theirs]), default=0.0)
    least = strongest * 10 ** (-FAINT_DB / 20)
    matched, alone = [], 0
    free = list(ours)
    for length, level in sorted(theirs, key=lambda one: -one[1]):
        near = [one for one in free if abs(one[0] - length) < SAME]
        if near:
            best = min(near, key=lambda one: abs(np.log(one[1] / level)) if level > 0 else 0.0)
            free.remove(best)
            if level >= least:
                matched.append((abs(best[0] - length), abs(20 * np.log10(best[1] / level))))
        elif level >= least:
            alone += 1
    return matched, alone + sum(level >= least for _, level in free)


def row_json(row: Row) -> dict[str, Any]:
    """Return a row as JSON holds it: no infinity."""
    return {
        key: (None if isinstance(value, float) and not np.isfinite(value) else value)
        for key, value in asdict(row).items()
    }
