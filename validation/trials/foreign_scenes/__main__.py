"""Print the table of foreign scenes, each row made in a process of its own.

python -m validation.trials.foreign_scenes                        the scenes that Sionna RT ships
python -m validation.trials.foreign_scenes munich --ghz 60        one of them
python -m validation.trials.foreign_scenes ROOM.toml FOLDER       scenarios with a foreign scene
"""

import argparse
import json
import resource
import subprocess
import sys
from pathlib import Path

from scenes.meshes.foreign_scene import sionna_scenes
from validation.trials.foreign_scenes.shipped_scenes import PLACES
from validation.trials.foreign_scenes.table import row_json, table_row

LONGEST = 400.0
"""Time after which a scene is given up, where several programs share the cores. [s]"""

MEMORY = 10 * 2**30
"""Address space that a scene may take; 6 GiB are allowed, and LLVM reserves more. [byte]"""

COLUMNS = (
    "scene", "ghz", "loads", "simulates", "load_cpu_s", "cpu_s", "wall_s", "gib", "echo_db",
    "pilot", "paths", "alone", "length_um", "level_db", "told",
)  # fmt: skip


def main() -> None:
    """Print a row for each scene."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", nargs="*", help="names, TOML files, folders of these")
    parser.add_argument("--ghz", type=float, nargs="*", default=[28.0, 60.0])
    parser.add_argument("--bounces", type=int, default=2)
    parser.add_argument("--here", action="store_true", help="one scene, in this process, as JSON")
    given = parser.parse_args()
    if given.here:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        row = table_row(given.scenes[0], ghz=given.ghz[0], bounces=given.bounces)
        print(json.dumps(row_json(row)))
        return
    print(" | ".join(COLUMNS), flush=True)
    for scene in _listed(given.scenes or sorted(set(PLACES) & set(sionna_scenes()))):
        for ghz in given.ghz if scene in PLACES else given.ghz[:1]:
            print(" | ".join(_told(scene, ghz, given.bounces)), flush=True)


def _listed(scenes: list[str]) -> list[str]:
    found = []
    for scene in scenes:
        path = Path(scene)
        found += sorted(map(str, path.rglob("*.toml"))) if path.is_dir() else [scene]
    return found


def _told(scene: str, ghz: float, bounces: int) -> list[str]:
    command = [sys.executable, "-m", "validation.trials.foreign_scenes", "--here", scene]
    command += ["--ghz", str(ghz), "--bounces", str(bounces)]
    try:
        made = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST, check=False)
    except subprocess.TimeoutExpired:
        return [scene, str(ghz), f"over {LONGEST:g} s"]
    # Mitsuba tells its warnings on the same way, before the row or after it.
    lines = [line for line in made.stdout.splitlines() if line.startswith('{"scene"')]
    if made.returncode != 0 or not lines:
        return [scene, str(ghz), "failed", *made.stderr.splitlines()[-1:]]
    row = json.loads(lines[-1])
    return ["" if row[key] is None else str(row[key]) for key in COLUMNS]


if __name__ == "__main__":
    main()
