"""A wheel of this checkout, installed in an environment of its own, from another folder."""

import json
import os
import shutil
import subprocess
import sys
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("uv") is None, reason="uv builds the wheel"),
]


@pytest.fixture(scope="module")
def python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install the wheel; what it depends on is that of this environment."""
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        ["uv", "build", "--wheel", "--quiet", "--out-dir", str(folder), str(ROOT)], check=True
    )
    (wheel,) = folder.glob("*.whl")
    place = folder / "environment"
    venv.create(place, symlinks=True, with_pip=True)
    python = place / "bin" / "python"
    subprocess.run(
        [str(python), "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", str(wheel)],
        check=True,
    )
    (packages,) = (place / "lib").glob("python*/site-packages")
    # A .pth file found there is not read, so that the checkout itself stays out.
    (packages / "dependencies.pth").write_text(str(Path(pytest.__file__).parents[1]))
    # LLVM and what it needs, which wheels put beside the packages.
    for library in (Path(sys.prefix) / "lib").iterdir():
        if not library.name.startswith("python"):
            (place / "lib" / library.name).symlink_to(library)
    return python


def run(python: Path, folder: Path, *command: str) -> str:
    plain = {
        key: value
        for key, value in os.environ.items()
        if key not in ("PYTHONPATH", "DRJIT_LIBLLVM_PATH")
    }
    done = subprocess.run(
        [str(python), *command], cwd=folder, env=plain, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_installed_command_locates_a_user(python: Path, tmp_path: Path) -> None:
    told = run(python.with_name("mmslam"), tmp_path, "run", "slam_2d", "--json", "--out", "out")
    result = json.loads(told)
    assert result["scenario"] == "slam_2d"
    (user,) = result["users"]
    assert user["status"] == "found"
    assert user["error_m"] < 1e-3  # what every seed has to stay below
    assert (tmp_path / "out" / "report.html").is_file()


def test_sionna_may_be_imported_before(python: Path, tmp_path: Path) -> None:
    told = run(
        python,
        tmp_path,
        "-c",
        "import sionna.rt as rt; rt.load_scene(rt.scene.simple_reflector); import mmslam;"
        "small = {'radio.points': 11, 'base_station.elements': 4};"
        "scenario = mmslam.load_scenario('los_user', small);"
        "print(mmslam.__file__, len(mmslam.simulate(scenario, seed=0).uplinks))",
    )
    place, pilots = told.split()[-2:]
    assert Path(place).is_relative_to(python.parents[1])
    assert int(pilots) == 1
