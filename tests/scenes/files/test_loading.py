import json
import math
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenes.files.loading import (
    load_scenario,
    override_scenario,
    scenario_names,
    scenario_schema,
    scenario_to_toml,
)
from scenes.files.toml_writer import toml_text
from scenes.scenario import GaussianBeam, Plate, ScenarioError

SMALL = """
[radio]
start_ghz = 220
stop_ghz = 295
points = 11
[base_station]
elements = 5
spacing_mm = 0.5
"""


def written(folder: Path, text: str, name: str = "mine.toml") -> str:
    path = folder / name
    path.write_text(text)
    return str(path)


def test_the_slam_scene_has_the_parameters_of_the_design() -> None:
    scenario = load_scenario("slam_2d")
    wall, user = scenario.objects["wall"], scenario.users["user"]
    assert isinstance(wall, Plate)
    assert (scenario.radio.start_ghz, scenario.radio.stop_ghz) == (220.0, 295.0)
    assert scenario.radio.points == 1001
    assert (scenario.base_station.elements, scenario.base_station.spacing_mm) == (260, 0.5)
    assert (wall.centre_m, wall.angle_deg, wall.length_m) == ((0.0, 0.8, 0.0), 45.0, 0.4)
    assert wall.material == "metal"
    assert wall.roughness is not None
    assert (wall.roughness.rms_mm, wall.roughness.correlation_mm) == (0.05, 0.3)
    assert wall.roughness.spectrum == "gaussian"
    assert user.position_m == (1.0, 0.8, 0.0)
    assert user.antenna == GaussianBeam(kind="gaussian_beam", sigma_rad=0.1, aim="wall")
    assert scenario.noise.snr_db == 20.0
    assert (scenario.dimensions, scenario.waves, scenario.max_bounces) == (2, "spherical", 3)


def test_the_slam_scene_reflects_the_boresight_ray_to_the_user() -> None:
    scenario = load_scenario("slam_2d")
    wall, user = scenario.objects["wall"], scenario.users["user"]
    image = user.position - 2 * ((user.position - wall.centre) @ wall.normal) * wall.normal
    np.testing.assert_allclose(image, 1.8 * scenario.base_station.boresight, atol=1e-15)


@pytest.mark.parametrize("name", scenario_names())
def test_every_scenario_of_the_library_loads_and_says_what_it_shows(name: str) -> None:
    scenario = load_scenario(name)
    assert scenario.name == name
    assert scenario.title


@pytest.mark.parametrize("name", scenario_names())
def test_a_scenario_written_and_loaded_again_is_the_same(name: str, tmp_path: Path) -> None:
    scenario = load_scenario(name)
    text = scenario_to_toml(scenario)
    again = load_scenario(written(tmp_path, text))
    assert again == scenario
    assert scenario_to_toml(again) == text


def test_a_scenario_with_everything_in_it_survives_writing(tmp_path: Path) -> None:
    text = SMALL.replace("elements = 5", "elements = [5, 3]").replace("= 0.5", "= [0.5, 1e-3]")
    path = written(
        tmp_path,
        'title = "a \\"quoted\\" \\\\ title\\twith ümlauts"\ndimensions = 3\n'
        + text
        + """
[base_station.antenna]
kind = "cosine"
exponent = 2
[objects."my wall"]
kind = "plate"
material = "absorber"
centre_m = [0.0, 1.0, 0.5]
length_m = 0.4
height_m = 0.3
[objects.post]
kind = "cylinder"
material = "metal"
centre_m = [0.5, 1.0]
radius_m = 5e-3
height_m = 0.3
roughness = {rms_mm = 0.01, correlation_mm = 0.3, spectrum = "exponential", inner_cutoff_mm = 0.1}
[users.ann]
position_m = [1, 2, 3]
antenna = {kind = "horn", gain_dbi = 23, aim_m = [0, 0, 1]}
[users.bob]
position_m = [1, 2.5]
""",
    )
    scenario = load_scenario(path)
    assert scenario.name == "mine"
    assert scenario.noise.snr_db == math.inf
    assert scenario.objects["my wall"].material == "absorber"
    again = load_scenario(written(tmp_path, scenario_to_toml(scenario), "again.toml"))
    assert again == scenario


def test_a_mesh_file_is_found_beside_its_scenario(tmp_path: Path) -> None:
    (tmp_path / "it.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n")
    path = written(
        tmp_path, "dimensions = 3\n" + SMALL + '[objects.it]\nkind = "mesh"\nfile = "it.obj"\n'
        'material = "metal"\ncentre_m = [0, 1, 0]\nscale = 0.01\n',
    )  # fmt: skip
    scenario = load_scenario(path)
    np.testing.assert_allclose(scenario.object_centre("it"), [0.005, 1, 0.005])


# ---- overrides


def test_an_override_is_a_toml_literal_or_else_a_string() -> None:
    scenario = load_scenario(
        "slam_2d",
        [
            "objects.wall.angle_deg=35",
            "users.user.position_m = [1, 0.75]",
            "noise.snr_db=inf",
            "title=Another title",
            'waves="cylindrical"',
            "radio.points=101",
            "radio.points=201",
        ],
    )
    assert scenario.objects["wall"].angle_deg == 35.0
    assert scenario.users["user"].position_m == (1.0, 0.75, 0.0)
    assert scenario.noise.snr_db == math.inf
    assert scenario.title == "Another title"
    assert scenario.waves == "cylindrical"
    assert scenario.radio.points == 201


def test_overrides_may_add_what_the_model_knows() -> None:
    scenario = load_scenario(
        "slam_2d",
        [
            "objects.wall2.kind=plate",
            "objects.wall2.material=metal",
            "objects.wall2.length_m=0.3",
            "objects.wall2.centre_m=[0.9, 1.5]",
            "objects.wall2.roughness.rms_mm=0.1",
            "objects.wall2.roughness.correlation_mm=1",
            "users.ann={position_m = [0.5, 0.2]}",
        ],
    )
    assert list(scenario.objects) == ["wall", "wall2"]
    assert list(scenario.users) == ["user", "ann"]


def test_overriding_a_scenario_changes_nothing_else() -> None:
    scenario = load_scenario("slam_2d")
    changed = override_scenario(scenario, ["objects.wall.length_m=0.5"])
    assert changed == load_scenario("slam_2d", ["objects.wall.length_m=0.5"])
    assert override_scenario(scenario, []) == scenario


BAD_OVERRIDES = [
    ("radio", r"^--set 'radio': must be KEY=VALUE with a dotted KEY, such as objects\.wall\.angle"),
    ("=3", r"^--set '=3': must be KEY=VALUE"),
    ("radio..points=3", r"must be KEY=VALUE"),
    (
        "radio.points.x=3",
        r"^--set 'radio\.points\.x=3': radio\.points = 1001 is a value, not a table; set radio\.po",
    ),
    (
        "objects.wal.angle_deg=3",
        r"^--set objects\.wal: no such name \(did you mean 'wall'\?\); known: wall; to add one, "
        r"set objects\.wal\.kind as well",
    ),
    ("users.usr.antenna.aim=wall", r"users\.usr: no such name \(did you mean 'user'\?\)"),
    ("objets.wall.angle_deg=3", r"^slam_2d: objets: unknown key \(did you mean 'objects'\?\)"),
    ("radio.points=many", r"^slam_2d: radio\.points = 'many': must be a valid integer"),
    ("radio.points=1\nformat=2", r"^slam_2d: radio\.points = '1\\nformat=2': must be a valid"),
    ("objects=3", r"^slam_2d: objects = 3: must be a table"),
    (
        "users.user.antenna.kind=isotropic",
        r"antenna\.sigma_rad: unknown key; known for kind 'isotropic': polarization, "
        r"cross_polar_db, kind; to change the kind, r",
    ),
]


@pytest.mark.parametrize(("override", "message"), BAD_OVERRIDES)
def test_a_bad_override_is_refused(override: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        load_scenario("slam_2d", [override])


# ---- files


def test_an_unknown_name_suggests_a_known_one() -> None:
    message = r"^scenario 'slam2d': no such name \(did you mean 'slam_2d'\?\); known: .*slam_2d"
    with pytest.raises(ScenarioError, match=message):
        load_scenario("slam2d")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"none\.toml: cannot be read \(No such file"):
        load_scenario(str(tmp_path / "none.toml"))
    with pytest.raises(ScenarioError, match=r"cannot be read \(Is a directory"):
        load_scenario(str(tmp_path))


def test_broken_toml_is_named_with_its_line(tmp_path: Path) -> None:
    path = written(tmp_path, "format = 1\nname = \n")
    with pytest.raises(ScenarioError, match=r"mine\.toml: not valid TOML: .*line 2.*correct it"):
        load_scenario(path)


def test_bytes_that_are_no_text_are_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_bytes(b"name = '\xff'")
    with pytest.raises(ScenarioError, match=r"mine\.toml: not text in UTF-8 \(byte 8\)"):
        load_scenario(str(tmp_path / "mine.toml"))


def test_a_file_nested_without_end_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path, "x = " + "[" * 100_000)
    with pytest.raises(ScenarioError, match="nested too deeply"):
        load_scenario(path)


def test_a_huge_file_is_refused(tmp_path: Path) -> None:
    with (tmp_path / "mine.toml").open("wb") as file:
        file.truncate(2**24)
    with pytest.raises(ScenarioError, match="16777216 bytes are more than a scenario's 10485760"):
        load_scenario(str(tmp_path / "mine.toml"))


def test_every_problem_of_a_file_names_the_file(tmp_path: Path) -> None:
    path = written(tmp_path, SMALL.replace("11", "1") + "[noise]\nsnr_db = -99\n")
    with pytest.raises(ScenarioError) as caught:
        load_scenario(path)
    lines = str(caught.value).splitlines()
    assert len(lines) == 2
    assert all(line.startswith(f"{path}: ") for line in lines)


# ---- schema and writer


def test_the_schema_is_json_and_names_every_key() -> None:
    schema = scenario_schema()
    text = json.dumps(schema, allow_nan=False)
    assert set(schema["required"]) == {"name", "radio", "base_station"}
    for key in ("start_ghz", "boresight_deg", "correlation_mm", "sigma_rad", "depth_m", "snr_db"):
        assert f'"{key}"' in text
    position = schema["$defs"]["User"]["properties"]["position_m"]
    assert (position["minItems"], position["maxItems"]) == (2, 3)


words = st.text(min_size=1, max_size=8)
values = st.one_of(
    st.integers(-(2**63), 2**63 - 1), st.floats(allow_nan=False), st.booleans(), words,
    st.lists(st.floats(allow_nan=False), max_size=3),
)  # fmt: skip
nested = st.recursive(
    st.dictionaries(words, values, max_size=4),
    lambda inner: st.dictionaries(words, st.one_of(values, inner), max_size=4),
    max_leaves=6,
)


@given(nested)
def test_what_is_written_as_toml_reads_back_equal(table: dict[str, Any]) -> None:
    assert tomllib.loads(toml_text(table)) == table


def test_empty_tables_are_written_and_nothing_is_left_out() -> None:
    assert toml_text({"a": {}, "b": None, "c": {"d": {}}}) == "[a]\n\n[c.d]\n"


def test_what_toml_does_not_know_is_refused() -> None:
    with pytest.raises(TypeError, match="TOML has no complex"):
        toml_text({"a": 1j})


def test_loading_a_scenario_imports_neither_trimesh_nor_a_ray_tracer() -> None:
    code = (
        "import sys; from scenes.files.loading import load_scenario; "
        "from scenes.realisations.object_surface import *; "
        "object_surface(load_scenario('slam_2d'), 'wall', seed=0); load_scenario('bench_3d'); "
        "print(sorted({'trimesh', 'mitsuba', 'drjit', 'sionna', 'matplotlib', 'xarray'} "
        "& set(sys.modules)))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"
