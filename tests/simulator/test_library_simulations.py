"""Every scenario of the library: byte for byte the same again, and open to other programs."""

import math
import os
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import pytest
import sionna.rt as rt

from estimator.compute import engine
from estimator.measurement.store import write_measurement
from scenes.files.loading import load_scenario, scenario_names
from scenes.meshes.mesh_file import placed_mesh
from scenes.scenario import MeshFile, Scenario
from scenes.surfaces.facet_spacing import facet_count, mesh_facet_count
from simulator.export.scene_files import exported_files
from simulator.simulation import simulate

AS_IT_IS = """
import sys
import drjit as dr
from estimator.compute import engine
engine.backend()
dr.set_thread_count(int(sys.argv[1]))
from estimator.measurement.store import write_measurement
from scenes.files.loading import load_scenario
from simulator.simulation import simulate
made = simulate(load_scenario(sys.argv[2], sys.argv[4:]), seed=7)
write_measurement(sys.argv[3], made.measurement, truth=made.truth)
"""


def facets(scenario: Scenario) -> int:
    """How many facets a scenario has, about."""
    count = 0
    for name, body in scenario.objects.items():
        spacing = scenario.facet_spacing(name)
        if isinstance(body, MeshFile):
            mesh = placed_mesh(body)
            count += mesh_facet_count(mesh.area, len(mesh.faces), spacing)
        else:
            count += facet_count(body, spacing)
    return count


def cut(name: str, *, points: int, elements: int, most_facets: int) -> list[str]:
    """Overrides that leave a scenario its kinds of surface, users and noise, but less of each."""
    whole = load_scenario(name)
    cuts = [f"radio.points={min(points, whole.radio.points)}"]
    along, up = whole.base_station.shape
    if isinstance(whole.base_station.elements, tuple):
        side = math.isqrt(elements)
        cuts.append(f"base_station.elements=[{min(side, along)}, {min(side, up)}]")
    elif whole.base_station.elements is not None:
        cuts.append(f"base_station.elements={min(elements, along)}")
    if whole.dimensions == 3 and len(whole.objects) > 4:
        cuts.append("max_bounces=1")  # chains of two over so many walls take a minute
    share = most_facets / max(facets(whole), 1)
    scale = min(1.0, share if whole.dimensions == 2 else math.sqrt(share))
    for key, body in whole.objects.items():
        cuts += [
            f"objects.{key}.{size}={scale * value}"
            for size in ("length_m", "depth_m", "height_m", "radius_m", "scale")
            if scale < 1 and isinstance(value := getattr(body, size, None), float)
        ]
    return cuts


def small(name: str) -> Scenario:
    return load_scenario(name, cut(name, points=7, elements=5, most_facets=600))


@cache
def exported(name: str) -> dict[str, bytes]:
    return dict(exported_files(small(name)))


def contents(store: Path) -> dict[str, bytes]:
    files = (path for path in store.rglob("*") if path.is_file())
    return {path.relative_to(store).as_posix(): path.read_bytes() for path in files}


@pytest.fixture
def restored_threads() -> Any:
    count = dr.thread_count()
    yield
    dr.set_thread_count(count)


@pytest.mark.skipif("engine.backend() != 'llvm'")
@pytest.mark.usefixtures("restored_threads")
@pytest.mark.parametrize("name", scenario_names())
def test_a_part_of_a_scenario_is_stored_as_the_same_bytes_again(name: str, tmp_path: Path) -> None:
    stores = []
    for run, threads in enumerate((1, 2)):
        dr.set_thread_count(threads)
        assert engine.thread_count() == threads
        made = simulate(small(name), seed=7)
        write_measurement(tmp_path / f"{run}.zarr", made.measurement, truth=made.truth)
        stores.append(contents(tmp_path / f"{run}.zarr"))
    assert any(file.startswith(("echo/c/", "uplink/c/")) for file in stores[0])
    assert stores[0] == stores[1]


@pytest.mark.slow
@pytest.mark.skipif("engine.backend() != 'llvm'")
@pytest.mark.parametrize("name", scenario_names())
def test_a_scenario_is_stored_as_the_same_bytes_by_one_thread_and_by_two(
    name: str, tmp_path: Path
) -> None:
    stores = []
    # Of each count twice; in a process of its own, so that NumPy's threads are counted, too.
    for run, threads in enumerate(("1", "2", "1", "2")):
        counts = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), threads)
        store = tmp_path / f"{run}.zarr"
        command = [sys.executable, "-c", AS_IT_IS, threads, name, str(store)]
        if load_scenario(name).dimensions == 3:  # in two dimensions, all is simulated
            command += cut(name, points=201, elements=256, most_facets=50_000)
        subprocess.run(command, check=True, env=os.environ | counts)
        stores.append(contents(store))
        assert stores[run] == stores[0]
    assert any(file.startswith(("echo/c/", "uplink/c/")) for file in stores[0])


@pytest.mark.parametrize("scene", ["", "_facets"])
@pytest.mark.parametrize("name", scenario_names())
def test_sionna_and_mitsuba_open_what_is_exported(name: str, scene: str, tmp_path: Path) -> None:
    for file, content in exported(name).items():
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).write_bytes(content)
    path = str(tmp_path / f"{name}{scene}.xml")
    objects = set(load_scenario(name).objects)
    opened = rt.load_scene(path, merge_shapes=False)
    assert set(opened.objects) == objects
    assert all(one.mi_mesh.face_count() > 0 for one in opened.objects.values())
    plain: Any = mi.load_file(path, optimize=False)  # else it joins shapes of one material
    assert {shape.id().removeprefix("mesh-") for shape in plain.shapes()} == objects
