"""What a scenario may be made of: names, slabs, and the roughness that comes with a name."""

import math
from pathlib import Path
from typing import Any

import pytest

from scenes.files.loading import load_scenario, override_scenario
from scenes.scenario import Scenario, ScenarioError, parse_scenario
from scenes.schema.materials import MATERIALS, TEXTURES, Slab

GYPSUM = "frequency_ghz,eps_real,eps_imag\n110,2.56,0.01\n330,2.56,0.02\n"


def scenario(**plate: Any) -> Scenario:
    body = {"kind": "plate", "centre_m": [0, 0.8], "length_m": 0.1, **plate}
    return parse_scenario(
        {
            "name": "one",
            "radio": {"start_ghz": 220.0, "stop_ghz": 330.0, "points": 11},
            "base_station": {"elements": 4, "spacing_mm": 0.5},
            "objects": {"it": body},
        }
    )


@pytest.mark.parametrize("name", MATERIALS)
def test_a_named_material_stays_its_name(name: str) -> None:
    assert scenario(material=name).objects["it"].material == name


@pytest.mark.parametrize(
    ("name", "rms", "length"), [("drywall", 0.02, 0.3), ("cardboard", 0.05, 0.3)]
)
@pytest.mark.parametrize("form", ["name", "slab"])
def test_drywall_and_cardboard_are_rough_by_themselves(
    name: str, rms: float, length: float, form: str
) -> None:
    material = name if form == "name" else {"name": name, "thickness_mm": 9.5}
    rough = scenario(material=material).objects["it"].roughness
    assert rough is not None
    assert (rough.rms_mm, rough.correlation_mm, rough.spectrum) == (rms, length, "gaussian")


def test_all_other_materials_are_smooth() -> None:
    for name in set(MATERIALS) - set(TEXTURES):
        assert scenario(material=name).objects["it"].roughness is None


def test_a_roughness_that_is_given_counts() -> None:
    smooth = scenario(material="drywall", roughness={"rms_mm": 0.0, "correlation_mm": 1.0})
    rough = smooth.objects["it"].roughness
    assert rough is not None
    assert rough.rms_mm == 0.0


def test_a_slab_has_a_permittivity_and_a_thickness() -> None:
    body = scenario(material={"permittivity": [2, 0.1], "thickness_mm": 3.0}).objects["it"]
    assert isinstance(body.material, Slab)
    assert body.material.permittivity == (2.0, 0.1)
    assert body.material.thickness == pytest.approx(3e-3)
    assert str(body.material) == "ε 2 − 0.1j, 3 mm"
    opaque = scenario(material={"name": "glass", "thickness_mm": math.inf}).objects["it"].material
    assert isinstance(opaque, Slab)
    assert math.isinf(opaque.thickness)
    assert str(opaque) == "glass, opaque"


@pytest.mark.parametrize(
    "material",
    [
        "drywall",
        {"name": "drywall", "thickness_mm": 9.5},
        {"permittivity": [2, 0.1], "thickness_mm": math.inf},
        {"file": "gypsum.csv", "thickness_mm": 12.7},
    ],
)
def test_a_scenario_of_a_material_is_written_and_read_back_equal(
    material: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("gypsum.csv").write_text(GYPSUM)
    scene = scenario(material=material)
    assert override_scenario(scene, []) == scene


def test_a_table_of_permittivity_is_looked_for_beside_the_scenario(tmp_path: Path) -> None:
    text = """
format = 1
[radio]
start_ghz = 220.0
stop_ghz = 330.0
points = 11
[base_station]
elements = 4
spacing_mm = 0.5
[objects.it]
kind = "plate"
centre_m = [0, 0.8]
length_m = 0.1
[objects.it.material]
file = "tables/gypsum.csv"
thickness_mm = 12.7
"""
    (tmp_path / "mine.toml").write_text(text)
    (tmp_path / "tables").mkdir()
    (tmp_path / "tables/gypsum.csv").write_text(GYPSUM)
    material = load_scenario(str(tmp_path / "mine.toml")).objects["it"].material
    assert isinstance(material, Slab)
    assert material.file == str((tmp_path / "tables/gypsum.csv").resolve())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, r"gypsum\.csv: cannot be read as a CSV table .*; give the path of one"),
        ("GHz,e\n", r"the first line lacks frequency_ghz, eps_real, eps_imag; it must be"),
        (GYPSUM + "340,2.7\n", r"gypsum\.csv, line 4: not three numbers; write frequency_ghz"),
        (GYPSUM + "300,2.7,0.1\n", r"3 frequencies; a table needs .* increasing: sort the rows"),
        (GYPSUM + "400,inf,0.1\n", r"inf - 0\.1j is no permittivity of a passive dielectric"),
        (
            GYPSUM.replace("330", "300"),
            r"covers 110-300 GHz, but the radio uses 220-330 GHz; narrow the band or give a wider",
        ),
    ],
)
def test_a_bad_table_is_refused_when_the_scenario_is_loaded(
    text: str | None, message: str, tmp_path: Path
) -> None:
    path = tmp_path / "gypsum.csv"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ScenarioError, match=rf"objects\.it\.material\.file: .*{message}"):
        scenario(material={"file": str(path), "thickness_mm": 12.7})


def test_a_table_as_large_as_a_film_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "film.csv"
    with path.open("wb") as file:
        file.truncate(2**33)
    with pytest.raises(ScenarioError, match="8589934592 bytes are more than a table's 10485760"):
        scenario(material={"file": str(path), "thickness_mm": 12.7})


BAD = [
    ("dry", r" = 'dry': unknown material \(did you mean 'drywall'\?\).*or a table"),
    (3, r" = 3: must be a valid string"),
    ({"thickness_mm": 1.0}, r": has neither .*give exactly one of"),
    ({"permittivity": [2, 0], "file": "a", "thickness_mm": 1.0}, r"has permittivity and file"),
    ({"permittivity": [2, 0]}, r"\.thickness_mm: missing; give the thickness"),
    ({"permittivity": [0.9, 0], "thickness_mm": 1.0}, r"permittivity\.0 = 0\.9: must be greater"),
    ({"permittivity": [2, -0.1], "thickness_mm": 1.0}, r"permittivity\.1 = -0\.1: must be gr"),
    ({"permittivity": [2, 0], "thickness_mm": 0.0}, r"thickness_mm = 0\.0: must be greater than 0"),
    ({"permittivity": [2, 0], "thickness_mm": math.nan}, r"thickness_mm = nan"),
    ({"name": "metal", "thickness_mm": 1.0}, r"\.name = 'metal': not a slab"),
    ({"nam": "wood", "thickness_mm": 1.0}, r"\.nam: unknown key \(did you mean 'name'\?\)"),
]


@pytest.mark.parametrize(("material", "message"), BAD)
def test_a_material_that_cannot_be_is_refused(material: Any, message: str) -> None:
    with pytest.raises(ScenarioError, match=r"objects\.it\.material.*" + message):
        scenario(material=material)
