import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import skrf  # type: ignore[import-untyped]
from typer.testing import CliRunner

from estimator.measurement.model import Echo, Measurement, Uplink
from estimator.measurement.store import read_measurement, write_measurement
from mmslam.cli import app
from mmslam.formats.export_touchstone import export_touchstone
from mmslam.formats.import_measured import import_measured
from mmslam.formats.mapping import load_mapping

CHECKOUT = Path(__file__).resolve().parents[3]
FREQUENCIES = np.linspace(220e9, 221e9, 7)


def noise(rng: np.random.Generator, rows: int) -> np.ndarray:
    return np.asarray(1e-4 * (rng.normal(size=(rows, 7)) + 1j * rng.normal(size=(rows, 7))))


def line(rng: np.random.Generator, count: int) -> np.ndarray:
    """Positions that no short decimal number tells."""
    return np.asarray(np.arange(count)[:, None] * [0.0005, 0, 0] + 1e-5 * rng.normal(size=(1, 3)))


@pytest.fixture
def full() -> Measurement:
    """Everything that a measurement can hold: two horns, two users, a clock, a boresight."""
    rng = np.random.default_rng(5)
    aperture, elements = line(rng, 5), line(rng, 4)
    return Measurement(
        echo=Echo(
            samples=noise(rng, 5),
            positions=aperture,
            frequencies=FREQUENCIES,
            transmit_positions=aperture + rng.normal(size=3) * 0.01,
        ),
        uplinks=tuple(
            Uplink(samples=noise(rng, 4), positions=elements, frequencies=FREQUENCIES, user=name)
            for name in ("ann", 'a "b" / c')
        ),
        waves="cylindrical",
        boresight=np.array([0.6, 0.8, 0.0]),
        clock_offset=1.25e-9,
        scenario="hall",
        seed=3,
    )


def assert_equal_bits(found: Echo | Uplink, expected: Echo | Uplink) -> None:
    for key in ("samples", "positions", "frequencies"):
        np.testing.assert_array_equal(getattr(found, key), getattr(expected, key))


def test_an_exported_measurement_comes_back_bit_for_bit(full: Measurement, tmp_path: Path) -> None:
    assert export_touchstone(full, tmp_path / "out") == 5 + 4 + 4
    mapping = load_mapping(tmp_path / "out" / "mapping.toml")
    back = import_measured(tmp_path / "out", mapping, base=tmp_path / "out").measurement
    assert back.echo is not None
    assert full.echo is not None
    assert_equal_bits(back.echo, full.echo)
    assert back.echo.transmit_positions is not None
    np.testing.assert_array_equal(back.echo.transmit_positions, full.echo.transmit_positions)
    for mine, theirs in zip(back.uplinks, full.uplinks, strict=True):
        assert mine.user == theirs.user
        assert_equal_bits(mine, theirs)
    assert (back.waves, back.scenario) == (full.waves, full.scenario)
    np.testing.assert_array_equal(back.boresight, full.boresight)
    # Nanoseconds and back: two roundings.
    assert back.clock_offset == pytest.approx(1.25e-9, rel=2**-52)


def test_another_program_reads_what_was_exported(full: Measurement, tmp_path: Path) -> None:
    export_touchstone(full, tmp_path / "out")
    network = skrf.Network(str(tmp_path / "out" / "uplink_0" / "00002.s2p"))
    np.testing.assert_array_equal(network.f, FREQUENCIES)
    np.testing.assert_array_equal(network.s[:, 1, 0], full.uplinks[0].samples[2])
    np.testing.assert_array_equal(network.s[:, 0, 1], full.uplinks[0].samples[2])


def test_a_new_export_replaces_its_own_folder_and_no_foreign_one(
    full: Measurement, tmp_path: Path
) -> None:
    write_measurement(tmp_path / "m.zarr", full)
    arguments = ["export", str(tmp_path / "m.zarr"), "--touchstone", str(tmp_path / "out")]
    for _ in range(2):
        done = CliRunner().invoke(app, [*arguments, "--json"])
        assert done.exit_code == 0, done.output
        assert json.loads(done.output)["files"] == 13
    (tmp_path / "out" / "mapping.toml").write_text("# mine\n")
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 2
    assert "will not be replaced" in done.output
    assert (tmp_path / "out" / "mapping.toml").read_text() == "# mine\n"


def test_help_and_refusals_load_no_measurement_library(tmp_path: Path) -> None:
    code = (
        "import sys\n"
        "from typer.testing import CliRunner\n"
        "from mmslam.cli import app\n"
        "assert CliRunner().invoke(app, ['import', '--help']).exit_code == 0\n"
        f"done = CliRunner().invoke(app, ['import', {str(tmp_path)!r}, '-o', 'x.zarr'])\n"
        "assert done.exit_code == 2, done.output\n"
        "print([name for name in ('skrf', 'h5py', 'scipy.io', 'sionna') if name in sys.modules])\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=CHECKOUT, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


SMALL = [
    "slam_2d",
    "--set=base_station.elements=101",
    "--set=radio.points=501",
    "--set=objects.wall.centre_m=[0.0, 0.4]",
    "--set=objects.wall.length_m=0.2",
    "--set=users.user.position_m=[0.5, 0.4]",
]
"""The thesis' scene at half its distances, a third of its array."""


def mmslam(*arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "mmslam", *arguments], cwd=CHECKOUT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def located(store: Path) -> tuple[list[float], list[list[float]]]:
    out = store.with_suffix(".located")
    result = json.loads(mmslam("locate", str(store), "--json", "--out", str(out)))
    (user,) = result["users"]
    assert user["status"] == "found"
    return user["estimate_m"], [mirror["start_m"] for mirror in result["mirrors"]]


@pytest.mark.slow
def test_a_simulated_scan_is_located_alike_after_touchstone_and_after_another_layout(
    tmp_path: Path,
) -> None:
    store, folder, again = (tmp_path / name for name in ("a.zarr", "touchstone", "b.zarr"))
    mmslam("simulate", *SMALL, "-o", str(store))
    mmslam("export", str(store), "--touchstone", str(folder))
    mmslam("import", str(folder), "-o", str(again))
    user, mirrors = located(store)
    user_again, mirrors_again = located(again)
    assert user_again == user
    assert mirrors_again == mirrors
    # Another program's layout: the other sign, single precision, millimetres and gigahertz,
    # a cable of 3 ns in the way. Single precision turns a sample by 6e-8 rad, some 1e-11 m of
    # path at a wavelength of 1.2 mm; the asked-for 1e-6 m are far above.
    measured = read_measurement(store)
    assert measured.echo is not None
    (pilot,) = measured.uplinks
    cable = np.exp(-2j * np.pi * measured.echo.frequencies * 3e-9)
    np.savez(
        tmp_path / "c.npz",
        s11=np.conj(measured.echo.samples * cable).T.astype(np.complex64),
        s21=np.conj(pilot.samples * cable).T.astype(np.complex64),
        f=measured.echo.frequencies / 1e9,
        x=measured.echo.positions[:, 0] * 1e3,
    )
    (tmp_path / "c.toml").write_text("""
        time_convention = "exp(-jwt)"
        clock_offset_ns = 0.0
        frequency_rounded_to_hz = 1e-3
        frequency = { variable = "f", unit = "GHz" }
        positions = { x = "x", unit = "mm" }
        echo = { variable = "s11", axes = ["frequency", "position"], cable_delay_ns = 3.0 }
        [uplinks.user]
        variable = "s21"
        axes = ["frequency", "position"]
        cable_delay_ns = 3.0
    """)
    mmslam(
        "import", str(tmp_path / "c.npz"), "-m", str(tmp_path / "c.toml"),
        "-o", str(tmp_path / "c.zarr"),
    )  # fmt: skip
    assert np.abs(np.subtract(located(tmp_path / "c.zarr")[0], user)).max() < 1e-6
