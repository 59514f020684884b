"""Inputs that once gave a traceback, hung, or took the memory: each is refused by a message."""

import json
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from estimator.measurement.model import Echo, Measurement, MeasurementError
from estimator.measurement.store import read_measurement, write_measurement
from mmslam.commands.track import _times
from mmslam.formats.array_files import ArrayFiles
from mmslam.formats.export_arrays import export_matlab
from mmslam.formats.file_pattern import fields_of_pattern
from mmslam.formats.mapping import checked_mapping
from mmslam.formats.matlab_elements import check_elements
from mmslam.formats.matlab_files import matlab_array
from mmslam.location import default_folder
from scenes.files.loading import load_scenario
from scenes.meshes.mitsuba_xml import read_mitsuba_xml
from scenes.sampling.distributions import InPolygon
from scenes.sampling.variations import Variations, load_variations
from scenes.scenario import ScenarioError
from scenes.schema.errors import did_you_mean, shown
from scenes.schema.permittivity_table import read_permittivity_table
from validation.metrics.truth import read_truth

MEASUREMENT = Measurement(
    echo=Echo(
        samples=np.ones((5, 7), dtype=np.complex128),
        positions=np.stack([np.linspace(-0.01, 0.01, 5), np.zeros(5), np.zeros(5)], axis=-1),
        frequencies=np.linspace(220e9, 290e9, 7),
    ),
    uplinks=(),
)


@pytest.mark.parametrize("kind", [8, 10, 19, 200, 0x7FFFFFFF])
def test_an_element_of_matlab_of_an_unknown_type_ends_no_process(kind: int, tmp_path: Path) -> None:
    # SciPy looks its type up in a table of twenty: a segmentation fault.
    path = tmp_path / "it.mat"
    savemat(path, {"echo": np.ones((3, 4)) + 1j})
    content = path.read_bytes()
    at = content.find(struct.pack("<II", 9, 96))  # the tag of twelve doubles
    path.write_bytes(content[:at] + struct.pack("<I", kind) + content[at + 4 :])
    with pytest.raises(MeasurementError, match="damaged"):
        matlab_array(path, "echo", largest=10**6)


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("deep", [False, True])
def test_sound_files_of_matlab_pass_the_check(packed: bool, deep: bool, tmp_path: Path) -> None:
    path = tmp_path / "it.mat"
    odd = np.arange(5, dtype=np.int8) * 1.0
    content = {"a": {"b": {"echo": odd, "n": "text"}}} if deep else {"echo": odd, "ü": [1, 2]}
    savemat(path, content, do_compression=packed)
    check_elements(path)
    if not deep:
        np.testing.assert_array_equal(matlab_array(path, "echo", largest=99).ravel(), odd)


def test_attributes_that_are_no_table_are_refused_by_every_reader(tmp_path: Path) -> None:
    store = tmp_path / "it.zarr"
    write_measurement(store, MEASUREMENT)
    at = store / "aperture_position" / "zarr.json"
    at.write_text(json.dumps(json.loads(at.read_text()) | {"attributes": 0}))
    with pytest.raises(MeasurementError, match="attributes in aperture_position"):
        export_matlab(store, tmp_path / "it.mat")
    with pytest.raises(MeasurementError, match="attributes in aperture_position"):
        read_measurement(store)


def test_a_mesh_name_that_no_file_system_takes_is_told_by_us(tmp_path: Path) -> None:
    scene = tmp_path / "it.xml"
    shape = '<shape type="ply" id="a"><string name="filename" value="{}"/></shape>'
    scene.write_text(f'<scene version="2.1.0">{shape.format("9" * 5000)}</scene>')
    with pytest.raises(ScenarioError, match="only PLY and OBJ") as refused:
        read_mitsuba_xml(scene)
    assert len(str(refused.value)) < 1000
    # Whether there is such a file is asked when its triangles are read.
    scene.write_text(f'<scene version="2.1.0">{shape.format("9" * 5000 + ".ply")}</scene>')
    assert len(read_mitsuba_xml(scene)) == 1


def test_of_a_list_of_thousands_of_wrong_items_some_are_told() -> None:
    with pytest.raises(MeasurementError, match="more problems") as refused:
        checked_mapping({"echo": {"variable": "echo", "axes": [1] * 9000}})
    assert len(str(refused.value)) < 20_000


def test_a_delay_of_400_digits_is_refused() -> None:
    with pytest.raises(MeasurementError, match="finite"):
        checked_mapping({"echo": {"variable": "echo", "cable_delay_ns": 10**400}})


@pytest.mark.parametrize("name", ["x" * 5000, "a\0b", "a\0b.toml", "/" + "x" * 5000])
def test_a_name_longer_than_the_file_system_takes_is_no_scenario(name: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        load_scenario(name)
    assert len(str(refused.value)) < 1500


def test_a_file_without_an_end_is_no_scenario() -> None:
    with pytest.raises(ScenarioError, match="are more than a configuration's"):
        load_variations(Path("/dev/zero"), Variations)
    with pytest.raises(ScenarioError, match="are more than a scenario's"):
        load_scenario("/dev/zero")
    with pytest.raises(ScenarioError, match="not a file"):
        read_permittivity_table(Path("/dev/zero"))


@pytest.mark.parametrize(
    "override",
    [
        "objects.wall.roughness.correlation_mm=5e-324",
        "base_station.elements=" + "9" * 5000,
        "base_station.elements=0x" + "f" * 5000,
        "objects.wall.material.file='a\\u0000b'",
        "x" * 200_000 + "=1",
        "objects." + "x" * 200_000 + ".kind=plate",
    ],
)
def test_numbers_and_names_that_cannot_be_are_refused_in_few_words(override: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        load_scenario("slam_2d", [override])
    assert len(str(refused.value)) < 2000


def test_a_mesh_that_no_file_can_be_called_is_refused(tmp_path: Path) -> None:
    override = 'objects.new={kind="mesh", material="metal", file="a\\u0000b.ply"}'
    with pytest.raises(ScenarioError, match="null"):
        load_scenario("bench_3d", [override])


@pytest.mark.parametrize("encoding", ["utf-7", "none-such", "utf-16", "shift_jis", "iso-2022-jp"])
def test_an_xml_parsers_own_errors_are_told(encoding: str, tmp_path: Path) -> None:
    path = tmp_path / "it.xml"
    path.write_text(f'<?xml version="1.0" encoding="{encoding}"?><scene/>')
    with pytest.raises(ScenarioError, match="scene file"):
        read_mitsuba_xml(path)


def test_a_polygon_that_is_gone_round_twice_has_no_inside_to_draw_from() -> None:
    square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
    with pytest.raises(ValueError, match=r"enclose \(almost\) nothing"):
        InPolygon.model_validate({"kind": "in_polygon", "corners_m": square * 2})
    once = InPolygon.model_validate({"kind": "in_polygon", "corners_m": square})
    assert 0 < once.draw(np.random.default_rng(0))[0] < 1


def test_a_member_of_an_archive_that_is_no_array_is_named(tmp_path: Path) -> None:
    path = tmp_path / "it.npz"
    with zipfile.ZipFile(path, "w") as packed:
        packed.writestr("echo", b"plain bytes")
    with pytest.raises(MeasurementError, match=r"'echo' is no array|no array 'echo'"):
        ArrayFiles(frequency=None, coordinates=()).array(path, "echo")


def test_a_pattern_whose_matching_would_take_for_ever_is_refused() -> None:
    with pytest.raises(ValueError, match="at most 2 stars"):
        fields_of_pattern("*1*1*1*{x}.s2p")
    assert fields_of_pattern("scan*_{x}_*.s2p") == ["x"]


def test_huge_numbers_and_long_words_are_shown_in_few_signs() -> None:
    assert len(shown(10**5000)) < 100
    assert did_you_mean("x" * 10**6, ["x" * 10**6]) == ""


@pytest.fixture
def store(tmp_path: Path) -> Path:
    write_measurement(tmp_path / "it.zarr", MEASUREMENT)
    return tmp_path / "it.zarr"


@pytest.mark.parametrize("damage", [b"", b"\xff\xfe", b"[]", b'{"zarr_format": 3}', b"{" * 10**5])
def test_export_and_track_refuse_a_damaged_store_as_locate_does(store: Path, damage: bytes) -> None:
    (store / "echo" / "zarr.json").write_bytes(damage)
    with pytest.raises(MeasurementError, match=r"it\.zarr"):
        export_matlab(store, store.with_name("it.mat"))
    with pytest.raises(MeasurementError, match=r"it\.zarr"):
        _times(store, 0.1)
    assert not store.with_name("it.mat").exists()


def test_a_chunk_that_cannot_be_unpacked_is_no_export(store: Path) -> None:
    (store / "echo" / "c" / "0" / "0").write_bytes(b"\x28\xb5\x2f\xfd" + bytes(40))
    with pytest.raises(MeasurementError, match="the store cannot be read"):
        export_matlab(store, store.with_name("it.mat"))
    assert [path.name for path in store.parent.iterdir()] == ["it.zarr"]


def test_a_truth_of_words_is_told(store: Path) -> None:
    import xarray as xr

    words = np.array(["north"], dtype=np.dtypes.StringDType())
    xr.Dataset({"target_angle": ("target", words)}).to_zarr(
        store, group="truth", mode="a", zarr_format=3, consolidated=False
    )
    with pytest.raises(MeasurementError, match="truth"):
        read_truth(store)


def test_a_scenarios_name_in_a_measurement_leads_nowhere(store: Path) -> None:
    path = store / "zarr.json"
    metadata = json.loads(path.read_text())
    metadata["attributes"]["scenario"] = "../../../etc/\x1b]0;cron.d\u202e" + "x" * 5000
    path.write_text(json.dumps(metadata))
    from mmslam.measurement_files import read

    folder = default_folder(read(store), store, None)
    assert folder.parent == Path("out")
    assert folder.name.isprintable()
    assert len(folder.name.encode()) < 255
