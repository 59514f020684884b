"""What cannot be is refused before anything slow is loaded, with what to do about it."""

import json
import subprocess
import sys

import pytest
import trimesh

SLOW = ("drjit", "matplotlib", "mitsuba", "sionna", "trimesh")
"""Packages whose import alone takes most of a second, or more; without them a refusal takes some
0.6 s of the processor, once Python has compiled the package."""

COMMAND = f"""
import json, runpy, sys
for arguments in json.loads(sys.stdin.read()):
    sys.argv = ["mmslam", *arguments]
    try:
        runpy.run_module("mmslam", run_name="__main__", alter_sys=True)
    except SystemExit as ended:
        loaded = sorted(set({SLOW!r}) & set(sys.modules))
        print("code:", ended.code, "loaded:", *loaded, file=sys.stderr)
        print("=" * 9, file=sys.stderr, flush=True)
"""

POST = {"objects.post.kind": "cylinder", "objects.post.material": "metal"}
BOX = {
    "objects.box.kind": "box", "objects.box.material": "metal", "objects.box.centre_m": "[1, 2]",
    "objects.box.length_m": "0.2", "objects.box.depth_m": "0.2",
}  # fmt: skip


CASES: dict[str, tuple[str, dict[str, str], str]] = {
    "overlap": (
        "slam_2d",
        {**POST, **BOX, "objects.post.centre_m": "[1, 2.05]", "objects.post.radius_m": "0.1"},
        "overlaps objects.post; solids may touch (to 1 µm), not overlap; move or shrink",
    ),
    "overlapping meshes": (
        "bench_3d",
        {"objects.sphere.scale": "0.05", "objects.sphere.centre_m": "[0, 0.38, 0]"},
        "objects.sphere.centre_m = [0.0, 0.38]: the solid overlaps objects.letter; solids",
    ),
    "mesh facets": (
        "bench_3d",
        {"objects.sphere.scale": "1.0", "objects.sphere.centre_m": "[0, 30, 0]"},
        "objects.sphere: needs 7.78e+08 facets at a spacing of 0.254 mm, all objects 92.7 GiB, "
        "more than 16 GiB; make it smaller, lower radio.stop_ghz, or raise",
    ),
    "facets": (
        "slam_2d",
        {"objects.wall.length_m": "1000", "objects.wall.roughness.correlation_mm": "1e-4"},
        "more than 16 GiB; make it smaller",
    ),
    "material": (
        "bench_3d",
        {"objects.sphere.material": "drywal"},
        "objects.sphere.material = 'drywal': unknown material (did you mean 'drywall'?); use",
    ),
    "missing": (
        "bench_3d",
        {"objects.sphere.file": "none.ply"},
        "No such file or directory; give the path of a mesh, relative to the scenario's file",
    ),
    "empty": (
        "bench_3d",
        {"objects.sphere.file": "FOLDER/empty.ply"},
        "a file of 1 byte to 2 GiB is needed, this has 0 bytes; export the mesh again",
    ),
    "open": (
        "bench_3d",
        {"objects.sphere.file": "FOLDER/open.ply", "objects.sphere.solid": "true"},
        "of its edges do not belong to exactly two triangles, and solid = true needs a "
        "watertight mesh; close its holes and export it again, or set solid = false",
    ),
    "table": (
        "slam_2d",
        {"objects.wall.material": '{file = "FOLDER/table.csv", thickness_mm = 5}'},
        "table.csv: 0.5 - 0j is no permittivity of a passive dielectric; the real part must",
    ),
}
"""A scenario, what is changed in it, and what the refusal says."""


@pytest.fixture(scope="module")
def refusals(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What a command says to each case: one process tries them all, so that it starts once."""
    folder = tmp_path_factory.mktemp("refused")
    (folder / "empty.ply").touch()
    (folder / "table.csv").write_text("frequency_ghz,eps_real,eps_imag\n220,0.5,0\n330,2,0\n")
    sphere = trimesh.creation.icosphere(subdivisions=4)
    sphere.update_faces([*range(0, len(sphere.faces), 2)])
    sphere.export(folder / "open.ply")
    commands = []
    for scenario, overrides, _ in CASES.values():
        command = ["simulate", scenario, "-o", str(folder / "none.zarr")]
        for key, value in overrides.items():
            command += ["--set", f"{key}={value.replace('FOLDER', str(folder))}"]
        commands.append(command)
    done = subprocess.run(
        [sys.executable, "-c", COMMAND],
        input=json.dumps(commands), capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout == ""
    assert not (folder / "none.zarr").exists()
    return dict(zip(CASES, done.stderr.split("=" * 9 + "\n"), strict=False))


@pytest.mark.parametrize("case", CASES)
def test_what_cannot_be_is_refused_before_anything_slow_is_loaded(
    case: str, refusals: dict[str, str]
) -> None:
    assert CASES[case][2] in " ".join(refusals[case].split())
    assert refusals[case].splitlines()[-1] == "code: 2 loaded:"
