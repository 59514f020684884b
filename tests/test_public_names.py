"""Each package offers its public names lazily, from the stub beside its ``__init__``."""

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[1]
PACKAGES = ("scenes", "simulator", "estimator", "validation", "mmslam")
STUBS = sorted(
    path.relative_to(CHECKOUT)
    for package in PACKAGES
    for path in (CHECKOUT / package).rglob("__init__.pyi")
)
FOLDERS = sorted(
    path.parent.relative_to(CHECKOUT)
    for package in PACKAGES
    for path in (CHECKOUT / package).rglob("__init__.py")
)

EAGER = {
    "mmslam/cli": "the command line itself",
    "validation/claims": "the list of all claims",
    "validation/experiments": "programs, run by their names",
    "validation/experiments/full_wave": "the same",
    "validation/reference": "two paths",
    "validation/trials/foreign_scenes": "a program, run by its name",
}
"""Packages without lazy names, and why."""

HEAVY = ("drjit", "matplotlib", "mitsuba", "sionna")
"""What takes seconds to import, or loads LLVM."""


def name_of(path: Path) -> str:
    return ".".join(path.parts)


def test_every_package_has_a_stub() -> None:
    with_stub = {path.parent for path in STUBS}
    assert {str(folder) for folder in FOLDERS if folder not in with_stub} == set(EAGER)


@pytest.mark.parametrize("folder", FOLDERS, ids=str)
def test_every_package_says_what_it_is_for(folder: Path) -> None:
    text = (CHECKOUT / folder / "__init__.py").read_text(encoding="utf-8")
    told = ast.get_docstring(ast.parse(text))
    assert told is not None
    assert len(told.split()) > 5


@pytest.mark.parametrize("stub", STUBS, ids=lambda stub: str(stub.parent))
def test_every_public_name_is_there(stub: Path) -> None:
    package = importlib.import_module(name_of(stub.parent))
    missing = []
    for name in package.__all__:
        try:
            getattr(package, name)
        except (AttributeError, ImportError) as error:
            missing.append(f"{name}: {error}")
    assert not missing


@pytest.mark.parametrize("stub", STUBS, ids=lambda stub: str(stub.parent))
def test_a_stub_lists_what_it_imports(stub: Path) -> None:
    tree = ast.parse((CHECKOUT / stub).read_text(encoding="utf-8"))
    imported = [
        alias.name for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names
    ]
    package = importlib.import_module(name_of(stub.parent))
    (listed,) = (node.value for node in tree.body if isinstance(node, ast.Assign))
    assert sorted(imported) == sorted(ast.literal_eval(listed)) == sorted(package.__all__)
    assert len(set(imported)) == len(imported)


@pytest.mark.parametrize("stub", STUBS, ids=lambda stub: str(stub.parent))
def test_no_public_name_is_that_of_a_module_beside_it(stub: Path) -> None:
    """Importing the module would put it in the function's place."""
    folder = CHECKOUT / stub.parent
    modules = {path.stem for path in folder.glob("*.py")} | {
        path.name for path in folder.iterdir() if (path / "__init__.py").is_file()
    }
    assert not modules & set(importlib.import_module(name_of(stub.parent)).__all__)


def loaded_by(statement: str) -> set[str]:
    """Name the modules that a fresh interpreter has loaded after a statement."""
    code = f"{statement}\nimport sys\nprint(*sys.modules, sep='\\n')"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=CHECKOUT, capture_output=True, text=True, check=True
    )
    return set(done.stdout.split())


def test_importing_mmslam_loads_neither_dr_jit_nor_sionna_nor_any_other_package() -> None:
    loaded = loaded_by("import mmslam; dir(mmslam); mmslam.__all__")
    assert not loaded & {*HEAVY, "numpy", "pydantic", "xarray", "zarr"}
    assert {name for name in loaded if name.partition(".")[0] in PACKAGES} == {"mmslam"}


def test_what_only_locates_loads_no_model_of_scenarios_and_no_ray_tracer() -> None:
    loaded = loaded_by("from mmslam.location import locate_measurement")
    assert not loaded & {"matplotlib", "mitsuba", "sionna", "pydantic", "scenes.scenario"}


def test_importing_any_package_that_needs_no_ray_tracer_stays_light() -> None:
    light = [
        name_of(folder)
        for folder in FOLDERS
        if folder.parts[0] != "simulator" and str(folder) not in EAGER
    ]
    loaded = loaded_by(f"import {', '.join(light)}")
    assert not loaded & {*HEAVY, "numpy", "pydantic", "xarray", "zarr"}


def test_the_types_of_the_front_door_load_no_ray_tracer() -> None:
    names = "Scenario, Measurement, Echo, Uplink, Estimate, load_scenario, scenarios, read, write"
    assert not loaded_by(f"from mmslam import {names}") & set(HEAVY)
