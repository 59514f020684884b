import tomllib
from pathlib import Path

import pytest
from pydantic import ValidationError
from typer.testing import CliRunner

from estimator.measurement.model import MeasurementError
from mmslam.cli import app
from mmslam.formats.mapping import SweepMapping, load_mapping, mapping_schema

GOOD = """
[frequency]
variable = "f"
unit = "GHz"
[positions]
x = "x"
unit = "mm"
[echo]
variable = "s11"
[uplinks.user]
variable = "s21"
"""


def load(folder: Path, text: str) -> SweepMapping:
    (folder / "mapping.toml").write_text(text, encoding="utf-8")
    return load_mapping(folder / "mapping.toml")


def test_what_is_not_said_is_a_spherical_wave_of_an_analyser_with_unknown_clock(
    tmp_path: Path,
) -> None:
    mapping = load(tmp_path, GOOD)
    assert (mapping.time_convention, mapping.waves) == ("exp(+jwt)", "spherical")
    assert mapping.boresight == [0.0, 1.0, 0.0]
    assert mapping.clock_offset_ns is None


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('unit = "GHz"', "", r"frequency\.unit: missing; give the unit of the numbers"),
        ('unit = "mm"', "", r"positions\.unit: missing; give the unit of the numbers"),
        ('"mm"', '"inch"', r"positions\.unit = 'inch': must be 'm', 'cm', 'mm', 'um',"),
        ('"GHz"', '"ghz"', r"frequency\.unit = 'ghz': must be"),
        ("variable = \"s11\"", "variabel = \"s11\"", r"echo\.variabel: unknown key \(did you mean"),
        ("[echo]", "[echos]", r"echos: unknown key \(did you mean 'echo'\?\)"),
        ('x = "x"', "", "give one of files, csv, variable .*found: none"),
        ('x = "x"', 'x = "x"\nvariable = "p"', "found: variable .* and x, y, z"),
        ('x = "x"', "first = [0.0, 0.0, 0.0]", "first and step belong together"),
        ('x = "x"', 'files = "scan.s2p"', r"use \{x\}, \{y\} and \{z\}, or \{index\}"),
        ('x = "x"', 'files = "{n}.s2p"', r"use \{x\}, \{y\} and \{z\}, or \{index\}"),
        ('x = "x"', 'files = "{index}.s2p"', "needs first and step"),
        ('x = "x"', 'files = "{x}.s2p"\ncsv = "a.csv"', "leave csv out"),
        ('variable = "f"', "start = 220", "start, stop and points belong together"),
        ('variable = "f"', 'variable = "f"\npoints = 3', "give either variable"),
        ('variable = "s11"', 'real = "re"', "real needs imaginary"),
        ('variable = "s11"', 'variable = "a"\nreal = "re"\nimaginary = "im"', "give one of"),
        ('variable = "s11"', 'magnitude = "m"\nmagnitude_db = "m"', "not both"),
        ('variable = "s11"', 'parameter = "T21"', r"echo\.parameter = 'T21'"),
        ('variable = "s11"', "cable_delay_ns = nan", r"echo\.cable_delay_ns = nan"),
        ('[positions]\nx = "x"\nunit = "mm"', "", r"no \[positions\] for echo"),
        ("[echo]", 'time_convention = "exp(jwt)"\n[echo]', "unknown key|must be"),
    ],
)  # fmt: skip
def test_a_key_that_cannot_be_is_named_with_the_remedy(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    assert old in GOOD
    with pytest.raises(MeasurementError, match=message) as refusal:
        load(tmp_path, GOOD.replace(old, new, 1))
    assert str(refusal.value).startswith(str(tmp_path / "mapping.toml"))


def test_a_mapping_without_a_signal_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MeasurementError, match=r"neither \[echo\] nor \[uplinks\.NAME\]"):
        load(tmp_path, 'positions = { x = "x", unit = "mm" }')


def test_a_file_that_is_no_mapping_is_told(tmp_path: Path) -> None:
    path = tmp_path / "mapping.toml"
    with pytest.raises(MeasurementError, match=r"cannot be read .* --mapping"):
        load_mapping(path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(MeasurementError, match="not text in UTF-8"):
        load_mapping(path)
    with pytest.raises(MeasurementError, match="not valid TOML"):
        load(tmp_path, "this is prose")
    with pytest.raises(MeasurementError, match="cannot be read"):
        load_mapping(tmp_path)


def test_the_schema_knows_every_table_and_the_command_prints_it() -> None:
    schema = mapping_schema()
    assert set(schema["properties"]) == set(SweepMapping.model_fields)
    done = CliRunner().invoke(app, ["import", "--schema"])
    assert done.exit_code == 0
    assert '"time_convention"' in done.output


def test_a_table_in_the_place_of_a_number_is_refused() -> None:
    data = tomllib.loads(GOOD) | {"clock_offset_ns": {"value": 1}}
    with pytest.raises(ValidationError):
        SweepMapping.model_validate(data)
