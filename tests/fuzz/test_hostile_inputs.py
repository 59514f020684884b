"""Whatever a file holds, it is read or refused by one of our own errors: no traceback, no hang.

Each format has a valid document that is changed: bytes turned over, cut, doubled or put in, or a
value of a table replaced by one that nobody expects. By default some examples of each are tried,
always the same ones; ``MMSLAM_FUZZ_EXAMPLES`` sets their number for each of the formats, and
``pytest -m slow tests/fuzz`` tries 100 000 in all, others each time.
"""

# Over 400 lines: a strategy for each format, and one way to try them.

import copy
import io
import json
import os
import resource
import shutil
import signal
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import h5py  # type: ignore[import-untyped]
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import netcdf_file, savemat

from estimator.measurement.model import Echo, Measurement, MeasurementError, Uplink
from estimator.measurement.store import read_measurement, write_measurement
from mmslam.commands.track import _times
from mmslam.formats.array_files import ArrayFiles
from mmslam.formats.export_arrays import export_matlab
from mmslam.formats.mapping import checked_mapping, load_mapping
from mmslam.formats.numpy_files import npz_arrays
from mmslam.formats.touchstone_files import read_touchstone, touchstone_text
from mmslam.output import OutputError
from mmslam.plain_text import message
from scenes.files.loading import (
    ScenarioSource,
    load_scenario,
    scenario_source,
    scenario_to_toml,
)
from scenes.meshes.mesh_file import placed_mesh
from scenes.meshes.mitsuba_xml import read_mitsuba_xml
from scenes.sampling.sample_space import open_sample_space
from scenes.sampling.variations import Variations, load_variations
from scenes.scenario import ScenarioError
from scenes.schema.height_map import read_height_map
from scenes.schema.objects import MeshFile
from scenes.schema.permittivity_table import read_permittivity_table
from validation.metrics.truth import read_truth

EXAMPLES = int(os.environ.get("MMSLAM_FUZZ_EXAMPLES", "12"))
SLOW_EXAMPLES = 100_000

LONGEST = 20  # seconds that an input may take
LARGEST = 3 * 2**30  # bytes that the process may come to
WORDIEST = 20_000  # characters of a message

OURS = (ScenarioError, MeasurementError, OutputError)


@dataclass(frozen=True, kw_only=True)
class Format:
    """A kind of input, and what reads it."""

    name: str
    inputs: st.SearchStrategy[Any]
    read: Callable[[Path, Any], object]  # in a folder of its own


# What is put in the place of values


def hostile_values() -> st.SearchStrategy[object]:
    numbers = [0, -1, 2, 2**31, 2**63, 2**64, 10**30, 10**400, True]
    reals = [0.0, -0.0, 5e-324, 1e-300, 1e-9, 1e9, 1e300, -1e308, float("nan"), float("inf")]
    texts = ["", " ", "\0", "\u202e\x1b[2J", "x" * 300, "x" * 200_000, "../../etc/passwd"]
    texts += ["/dev/zero", "/dev/null", "/proc/self/mem", "a" * 4000 + ".toml", "$\\frac$", "ß/\\"]
    plain = st.sampled_from([*numbers, *reals, *texts, None])
    return st.one_of(
        plain,
        st.lists(plain, max_size=4),
        st.dictionaries(
            st.sampled_from(["kind", "file", "x" * 300, "\0", "a.b"]), plain, max_size=2
        ),
        st.sampled_from([[[0.0] * 3] * 5, [[]], {"kind": {"kind": {}}}, [1] * 70_000]),
        st.floats(),
        st.integers(),
        st.text(max_size=20),
    )


@st.composite
def changed_tables(draw: st.DrawFn, base: dict[str, Any]) -> dict[str, Any]:
    tables = copy.deepcopy(base)
    for _ in range(draw(st.integers(1, 3))):
        place: Any = tables
        while True:
            keys = list(place) if isinstance(place, dict) else list(range(len(place)))
            if not keys:
                break
            key = draw(st.sampled_from(keys))
            below = place[key]
            if isinstance(below, dict | list) and below and draw(st.booleans()):
                place = below
                continue
            if draw(st.integers(0, 4)) == 0 and isinstance(place, dict):
                del place[key]
            else:
                place[key] = draw(hostile_values())
            break
    return tables


@st.composite
def changed_bytes(draw: st.DrawFn, base: bytes) -> bytes:
    content = bytearray(base)
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, max(len(content) - 1, 0)))
        some = draw(st.binary(min_size=1, max_size=8) | st.sampled_from([b"\xff" * 8, b"9" * 5000]))
        match draw(st.sampled_from(["write", "put in", "cut", "leave out", "double"])):
            case "write":
                content[at : at + len(some)] = some
            case "put in":
                content[at:at] = some
            case "cut":
                del content[at:]
            case "leave out":
                del content[at : at + draw(st.integers(1, 64))]
            case "double":
                content[at:at] = content[at : at + draw(st.integers(1, 64))]
    return bytes(content)


# The valid documents


def measurement() -> Measurement:
    positions = np.stack([np.linspace(-0.01, 0.01, 5), np.zeros(5), np.zeros(5)], axis=-1)
    frequencies = np.linspace(220e9, 290e9, 7)
    samples = np.exp(1j * np.arange(35.0)).reshape(5, 7)
    echo = Echo(samples=samples, positions=positions, frequencies=frequencies)
    pilot = Uplink(samples=samples, positions=positions, frequencies=frequencies, user="ann")
    return Measurement(echo=echo, uplinks=(pilot,), scenario="hall", seed=3, clock_offset=0.0)


def of_bytes(write: Callable[[Any], object]) -> bytes:
    stream = io.BytesIO()
    write(stream)
    return stream.getvalue()


ECHO = np.exp(1j * np.arange(35.0)).reshape(5, 7)


def _hdf5(stream: Any) -> None:
    with h5py.File(stream, "w") as file:
        file["echo"] = ECHO
        file.create_dataset("packed", data=ECHO.real, compression="gzip", chunks=(2, 3))


def _netcdf_3() -> bytes:
    stream = io.BytesIO()
    file = netcdf_file(stream, "w")
    file.createDimension("n", 35)
    file.createVariable("echo", "d", ("n",))[:] = ECHO.real.ravel()
    file.flush()
    return stream.getvalue()


def _matlab(stream: Any) -> None:
    savemat(stream, {"echo": ECHO, "s": {"echo": ECHO, "note": "x", "cell": [1, "a"]}})


CSV = b"f,x,echo\n" + b"".join(b"%d,%d,0.5\n" % (f, x) for f in range(3) for x in range(3))

ARRAYS = {
    "npz": of_bytes(lambda stream: np.savez_compressed(stream, echo=ECHO, note=np.array("x"))),
    "npy": of_bytes(lambda stream: np.save(stream, ECHO)),
    "mat": of_bytes(_matlab),
    "h5": of_bytes(_hdf5),
    "nc": _netcdf_3(),
    "csv": CSV,
}

PLY = b"""ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 4
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
0 0 1
3 0 2 1
3 0 1 3
3 1 2 3
3 0 3 2
"""
STL = bytes(80) + struct.pack("<I12fH", 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
MESHES = {
    "ply": PLY,
    "obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1/1 2//2 4\nf 2 3 4\nf -4 -1 -2\n",
    "off": b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
    "stl": STL,
}
XML = b"""<?xml version="1.0" encoding="utf-8"?>
<scene version="2.1.0">
  <bsdf type="itu-radio-material" id="mat-wall"><string name="type" value="concrete"/></bsdf>
  <shape type="ply" id="mesh-wall"><string name="filename" value="it.ply"/>
    <transform name="to_world"><rotate x="1" angle="90"/><scale value="2"/></transform>
    <ref id="mat-wall"/></shape>
</scene>
"""
MAPPING: dict[str, Any] = {
    "time_convention": "exp(+jwt)",
    "boresight": [0.0, 1.0, 0.0],
    "clock_offset_ns": 0.0,
    "frequency": {"unit": "GHz", "start": 220.0, "stop": 290.0, "points": 7},
    "positions": {"unit": "mm", "first": [0.0, 0.0, 0.0], "step": [0.5, 0.0, 0.0]},
    "echo": {"variable": "echo", "axes": ["position", "frequency"], "cable_delay_ns": 0.1},
    "uplinks": {"ann": {"real": "r", "imaginary": "i", "take": {"run": 0}}},
}
VARIED: dict[str, Any] = {
    "base": "point_scatterers",
    "count": 3,
    "attempts": 3,
    "set": {"base_station.elements": 4, "radio.points": 4},
    "vary": {
        "noise.snr_db": {"kind": "uniform", "low": 10.0, "high": 30.0},
        "points.near.position_m": {
            "kind": "in_polygon",
            "corners_m": [[0.0, 0.4], [0.1, 0.4], [0.0, 0.5]],
        },
        "points.far.rcs_m2": {"kind": "log_uniform", "low": 0.1, "high": 1.0},
        "radio.points": {"kind": "choice", "values": [4, 8], "weights": [1.0, 2.0]},
    },
    "number": {"posts": {"among": ["points.near", "points.far"], "least": 0}},
}


@dataclass(frozen=True)
class StoreChange:
    """One file of a store that is changed: its bytes, or a value of its metadata."""

    file: str
    content: bytes


def store_files() -> dict[str, bytes]:
    import tempfile

    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "it.zarr"
        write_measurement(path, measurement())
        return {
            str(file.relative_to(path)): file.read_bytes()
            for file in sorted(path.rglob("*"))
            if file.is_file()
        }


STORE = store_files()


@st.composite
def changed_stores(draw: st.DrawFn) -> StoreChange:
    file = draw(st.sampled_from(sorted(STORE)))
    if file.endswith("zarr.json") and draw(st.booleans()):
        tables = draw(changed_tables(json.loads(STORE[file])))
        return StoreChange(file, json.dumps(tables).encode())
    return StoreChange(file, draw(changed_bytes(STORE[file])))


# What reads them


def read_store(folder: Path, change: StoreChange) -> None:
    path = folder / "it.zarr"
    for name, content in STORE.items():
        (path / name).parent.mkdir(parents=True, exist_ok=True)
        (path / name).write_bytes(change.content if name == change.file else content)
    for read in (
        read_measurement,
        read_truth,
        lambda store: export_matlab(store, folder / "it.mat"),
        lambda store: _times(store, 0.1),
    ):
        with suppressed():
            read(path)


def read_arrays(kind: str) -> Callable[[Path, bytes], None]:
    def read(folder: Path, content: bytes) -> None:
        path = written(folder, f"it.{kind}", content)
        names = [None] if kind == "npy" else ["echo", "s.echo" if kind == "mat" else "packed"]
        for name in names:
            with suppressed():
                ArrayFiles(frequency="f", coordinates=("x",)).array(path, name)
        if kind == "npz":
            npz_arrays(path)

    return read


def read_mesh(kind: str) -> Callable[[Path, bytes], object]:
    def read(folder: Path, content: bytes) -> object:
        path = written(folder, f"it.{kind}", content)
        return placed_mesh(MeshFile(kind="mesh", file=str(path), material="metal", solid=False))

    return read


def read_variations(folder: Path, tables: dict[str, Any]) -> None:
    open_sample_space(load_variations(tables, Variations), folder).check()


def written(folder: Path, name: str, content: bytes) -> Path:
    (folder / name).write_bytes(content)
    return folder / name


def overrides() -> st.SearchStrategy[list[str]]:
    keys = [
        "objects.wall.angle_deg",
        "radio.points",
        "objects.new.kind",
        "users.user",
        "a",
        "..",
        "",
    ]
    values = ["1", "nan", "[", "{a=1}", "9" * 5000, "0x" + "f" * 5000, '"\\u0000"', "x" * 300]
    one = st.tuples(st.sampled_from(keys) | st.text(max_size=9), st.sampled_from(values))
    return st.lists(one.map("=".join) | st.text(max_size=30), min_size=1, max_size=3)


def _tiff(stream: Any) -> None:
    from PIL import Image

    Image.fromarray(HEIGHTS.astype(np.float32)).save(stream, format="TIFF")


HEIGHTS = np.sin(np.arange(400.0)).reshape(20, 20)
HEIGHT_MAPS = {
    "csv": of_bytes(lambda stream: np.savetxt(stream, HEIGHTS, delimiter=",")),
    "npz": of_bytes(lambda stream: np.savez_compressed(stream, heights=HEIGHTS, step=0.1)),
    "tif": of_bytes(_tiff),
}


def read_heights(kind: str) -> Callable[[Path, bytes], object]:
    def read(folder: Path, content: bytes) -> object:
        path = written(folder, f"it.{kind}", content)
        return read_height_map(path, step=1e-4, unit=1e-3)

    return read


SLAM = dict(scenario_source("slam_2d").tables)
SLAM_TEXT = scenario_to_toml(load_scenario("slam_2d")).encode()
TOUCHSTONE = touchstone_text(np.linspace(1e9, 2e9, 5), ECHO[0, :5], ports=2, comment="x").encode()
TABLE = b"frequency_ghz,eps_real,eps_imag\n100,2.5,0.1\n330,2.4,0.2\n"

FORMATS = [
    Format(
        name="scenario tables",
        inputs=changed_tables(SLAM),
        read=lambda folder, tables: ScenarioSource(
            origin="it", tables=tables, folder=folder
        ).variant(),
    ),
    Format(
        name="scenario files",
        inputs=changed_bytes(SLAM_TEXT),
        read=lambda folder, text: load_scenario(str(written(folder, "it.toml", text))),
    ),
    Format(
        name="overrides",
        inputs=overrides(),
        read=lambda folder, given: load_scenario("slam_2d", given),
    ),
    Format(name="names", inputs=st.text(), read=lambda folder, name: load_scenario(name)),
    Format(name="variations", inputs=changed_tables(VARIED), read=read_variations),
    Format(
        name="mappings",
        inputs=changed_tables(MAPPING),
        read=lambda folder, tables: checked_mapping(tables),
    ),
    Format(
        name="mapping files",
        inputs=changed_bytes(
            b'[frequency]\nunit = "GHz"\nvariable = "f"\n[echo]\nvariable = "e"\n'
        ),
        read=lambda folder, text: load_mapping(written(folder, "it.toml", text)),
    ),
    Format(name="stores", inputs=changed_stores(), read=read_store),
    *(
        Format(name=f".{kind}", inputs=changed_bytes(content), read=read_arrays(kind))
        for kind, content in ARRAYS.items()
    ),
    Format(
        name="touchstone",
        inputs=changed_bytes(TOUCHSTONE),
        read=lambda folder, text: read_touchstone(written(folder, "it.s2p", text)),
    ),
    *(
        Format(name=f".{kind}", inputs=changed_bytes(content), read=read_mesh(kind))
        for kind, content in MESHES.items()
    ),
    *(
        Format(name=f"heights .{kind}", inputs=changed_bytes(content), read=read_heights(kind))
        for kind, content in HEIGHT_MAPS.items()
    ),
    Format(
        name="xml",
        inputs=changed_bytes(XML),
        read=lambda folder, text: read_mitsuba_xml(written(folder, "it.xml", text)),
    ),
    Format(
        name="permittivity tables",
        inputs=changed_bytes(TABLE),
        read=lambda folder, text: read_permittivity_table(written(folder, "it.csv", text)),
    ),
]


@contextmanager
def suppressed() -> Iterator[None]:
    """Let our own errors pass, if they can be read."""
    try:
        yield
    except OURS as error:
        told = message(str(error))
        assert told
        assert len(told) < WORDIEST, f"{len(told)} characters: {told[:300]}"


class TooLongError(BaseException):
    """Not an Exception: whoever takes all of those for damage must not swallow it."""


@contextmanager
def within_limits() -> Iterator[None]:
    """Fail what takes too long, or more memory than a small machine has."""

    def too_long(number: int, frame: FrameType | None) -> None:
        raise TooLongError(f"longer than {LONGEST} s")

    before = signal.signal(signal.SIGVTALRM, too_long)
    signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST)  # of our own time: machines may be busy
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, before)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 < LARGEST


def taken_or_refused(form: Format, folder: Path, given: object) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    with within_limits(), suppressed():
        form.read(folder, given)


def fuzz(form: Format, folder: Path, *, examples: int, always_alike: bool) -> None:
    @settings(
        max_examples=examples,
        deadline=None,
        database=None,
        derandomize=always_alike,
        suppress_health_check=list(HealthCheck),
    )
    @given(form.inputs)
    def check(given: object) -> None:
        taken_or_refused(form, folder, given)

    check()


@pytest.mark.filterwarnings("ignore")  # what libraries say of damaged files
@pytest.mark.parametrize("form", FORMATS, ids=lambda form: form.name)
def test_whatever_it_holds_an_input_is_taken_or_refused(form: Format, tmp_path: Path) -> None:
    fuzz(form, tmp_path / "it", examples=EXAMPLES, always_alike=True)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("form", FORMATS, ids=lambda form: form.name)
def test_many_thousands_of_inputs_are_taken_or_refused(form: Format, tmp_path: Path) -> None:
    examples = -(-SLOW_EXAMPLES // len(FORMATS))
    fuzz(form, tmp_path / "it", examples=examples, always_alike=False)
