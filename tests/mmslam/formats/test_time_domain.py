"""Traces over time, beats of a chirp and recorders' files give the sweep of one point's echo."""

import struct
from collections.abc import Callable
from pathlib import Path

import h5py  # type: ignore[import-untyped]
import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.measurement.model import Echo, MeasurementError
from mmslam.formats.hdf5_files import hdf5_attribute
from mmslam.formats.import_measured import Import

TARGET = np.array([0.02, 0.35, 0.0])  # [m]
PLACES = np.stack([8e-3 * np.arange(9) - 0.032, np.zeros(9), np.zeros(9)], axis=1)  # [m]
DELAY = 2 * np.linalg.norm(PLACES - TARGET, axis=1)[:, None] / speed_of_light  # [s]
LINE = 'positions = { first = [-32.0, 0.0, 0.0], step = [8.0, 0.0, 0.0], unit = "mm" }\n'

CARRIER, WIDTH = 6e9, 0.25e-9
"""A Gaussian pulse exp(−t²/2w²) about a carrier: its spectrum is w√2π exp(−(2πw(f−f₀))²/2)."""


def turned_back(echo: Echo, delay: np.ndarray = DELAY) -> np.ndarray:
    """The echo without the point's delays, over its largest: what is left should be alike."""
    flat = echo.samples * np.exp(2j * np.pi * echo.frequencies * delay)
    return np.asarray(flat / np.abs(flat).max())


def pulse(times: np.ndarray) -> np.ndarray:
    return np.asarray(np.exp(-(times**2) / 2 / WIDTH**2) * np.cos(2 * np.pi * CARRIER * times))


@pytest.mark.parametrize("way", ["variable", "step", "columns"])
def test_the_spectrum_of_a_pulse_is_its_closed_form_and_delayed_by_the_point(
    tmp_path: Path, way: str, taken: Callable[[Path, str, str], Echo]
) -> None:
    first, step = -1.5e-9, 20e-12
    times = first + step * np.arange(500)
    traces = pulse(times - DELAY)
    band = "band_ghz = [5.2, 6.8]"
    if way == "variable":
        np.savez(tmp_path / "t.npz", s=traces.T, t=1e9 * times)
        mapping = f'time = {{ variable = "t", unit = "ns", {band} }}\n' + LINE
        mapping += 'echo = { variable = "s", axes = ["time", "position"] }'
        echo = taken(tmp_path, "t.npz", mapping)
    elif way == "step":
        np.save(tmp_path / "t.npy", traces)
        mapping = f'time = {{ step = 20.0, first = -1500.0, unit = "ps", {band} }}\n' + LINE
        echo = taken(tmp_path, "t.npy", mapping + "echo = {}")
    else:  # a terahertz spectrometer writes two columns for each position
        (tmp_path / "scan").mkdir()
        for x, trace in zip(PLACES[:, 0], traces, strict=True):
            rows = np.stack([1e12 * times, trace], axis=1)
            np.savetxt(tmp_path / "scan" / f"x{1e3 * x:.0f}.txt", rows, fmt="%.17g")
        mapping = f'time = {{ variable = "0", unit = "ps", {band} }}\n'
        mapping += 'positions = { files = "x{x}.txt", unit = "mm" }\necho = { variable = "1" }'
        echo = taken(tmp_path, "scan", mapping)
        order = np.argsort(echo.positions[:, 0])
        assert np.array_equal(order, np.arange(9))
    assert np.ptp(echo.frequencies) == pytest.approx(1.6e9, abs=1e-3)
    assert echo.frequencies[1] - echo.frequencies[0] == pytest.approx(1e9 / 10, rel=1e-9)
    flat = turned_back(echo)
    shape = np.exp(-((2 * np.pi * WIDTH * (echo.frequencies - CARRIER)) ** 2) / 2)
    # The pulse's tails at the trace's ends are exp(−6²/2) = 1e-8 of its middle.
    np.testing.assert_allclose(flat, np.broadcast_to(shape, flat.shape), atol=1e-6)


def test_complex_traces_about_a_carrier_keep_their_phase(
    tmp_path: Path, taken: Callable[[Path, str, str], Echo]
) -> None:
    times = 40e-12 * np.arange(250)
    late = times - DELAY - 1e-9
    envelope = np.exp(-(late**2) / 2 / WIDTH**2)
    np.save(tmp_path / "t.npy", envelope * np.exp(-2j * np.pi * CARRIER * (DELAY + 1e-9)))
    mapping = (
        'time = { step = 40.0, zero = 1000.0, unit = "ps", band_ghz = [5.5, 6.5], '
        "carrier_ghz = 6.0 }\n" + LINE + "echo = {}"
    )
    flat = turned_back(taken(tmp_path, "t.npy", mapping))
    shape = np.exp(-((2 * np.pi * WIDTH * np.linspace(-0.5e9, 0.5e9, 11)) ** 2) / 2)
    # The carrier turns by its own phase at the pulse's departure, the same at all positions.
    np.testing.assert_allclose(flat * np.conj(flat[0, 5]), np.broadcast_to(shape, flat.shape),
                               atol=1e-5)  # fmt: skip


def test_gprmax_and_gssi_files_tell_their_own_time_step(
    tmp_path: Path, taken: Callable[[Path, str, str], Echo]
) -> None:
    step, count = 20e-12, 512
    traces = pulse(step * np.arange(count) - DELAY - 1e-9)
    with h5py.File(tmp_path / "scan.out", "w") as file:
        file.attrs["dt"], file.attrs["Iterations"] = step, count
        file["rxs/rx1/Ez"] = traces.T
    band = 'unit = "ns", zero = 1.0, band_ghz = [5.2, 6.8]'
    echo = taken(
        tmp_path, "scan.out",
        f"time = {{ {band} }}\n{LINE}"
        'echo = { variable = "rxs/rx1/Ez", axes = ["time", "position"] }',
    )  # fmt: skip
    flat = turned_back(echo)
    shape = np.exp(-((2 * np.pi * WIDTH * (echo.frequencies - CARRIER)) ** 2) / 2)
    np.testing.assert_allclose(flat, flat[:1] * np.ones((9, 1)), atol=1e-6)
    np.testing.assert_allclose(np.abs(flat), np.broadcast_to(shape, flat.shape), atol=0.02)

    write_dzt(tmp_path / "scan.dzt", np.round(32768 + 30000 * traces).astype("<u2"), step)
    echo = taken(
        tmp_path, "scan.dzt", f'time = {{ {band} }}\n{LINE}echo = {{ axes = ["position", "time"] }}'
    )
    # A count is 1/30000 of the pulse's height, and its spectrum is summed over 512 samples.
    np.testing.assert_allclose(turned_back(echo), flat, atol=3e-3)


@pytest.mark.parametrize("damage", ["cut", "text", "two", "NaN", "none"])
def test_a_damaged_gprmax_file_is_told(
    tmp_path: Path, damage: str, take: Callable[[Path, str, str], Import]
) -> None:
    path = tmp_path / "scan.out"
    values = {"text": "2e-11", "two": [2e-11, 2e-11], "NaN": np.nan}
    with h5py.File(path, "w") as file:
        if damage != "none":
            file.attrs["dt"] = values.get(damage, 2e-11)
        file["rxs/rx1/Ez"] = np.ones((64, 9))
    if damage == "cut":
        path.write_bytes(path.read_bytes()[:-1000])
    with pytest.raises(MeasurementError, match=r"cannot be read as HDF5|has no attribute 'dt'"):
        take(
            tmp_path, "scan.out",
            f'time = {{ unit = "ns", band_ghz = [5.2, 6.8] }}\n{LINE}'
            'echo = { variable = "rxs/rx1/Ez", axes = ["time", "position"] }',
        )  # fmt: skip


def test_every_flipped_byte_of_a_gprmax_file_is_told_or_does_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "scan.out"
    with h5py.File(path, "w") as file:
        file.attrs["dt"] = 2e-11
        file["Ez"] = np.ones(3)
    whole = path.read_bytes()
    kinds = set()
    for at in range(len(whole)):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :])
        try:
            hdf5_attribute(path, "dt")
        except MeasurementError as error:
            kinds.add(type(error.__cause__))
    assert kinds > {OSError}  # HDF5 has others too: what catches this one alone ends in a traceback


def test_traces_without_power_in_the_band_are_told(
    tmp_path: Path, take: Callable[[Path, str, str], Import]
) -> None:
    np.save(tmp_path / "t.npy", np.zeros((9, 250)))
    mapping = 'time = { step = 20.0, unit = "ps", band_ghz = [5.2, 6.8] }\n' + LINE + "echo = {}"
    with pytest.raises(MeasurementError, match="all samples are zero; nothing was received"):
        take(tmp_path, "t.npy", mapping)


def write_dzt(path: Path, scans: np.ndarray, step: float) -> None:
    head = bytearray(1024)
    struct.pack_into("<4H", head, 0, 0x00FF, 1024, scans.shape[1], 16)
    struct.pack_into("<f", head, 14, 125.0)
    struct.pack_into("<2f", head, 22, 0.0, 1e9 * step * scans.shape[1])
    struct.pack_into("<H", head, 52, 1)
    struct.pack_into("<f", head, 54, 6.0)
    path.write_bytes(bytes(head) + scans.tobytes())


@pytest.mark.parametrize("damage", ["cut", "tag", "bits", "short", "range"])
def test_a_damaged_gssi_file_is_told(
    tmp_path: Path, damage: str, take: Callable[[Path, str, str], Import]
) -> None:
    path = tmp_path / "scan.dzt"
    write_dzt(path, np.full((9, 64), 32768, dtype="<u2"), 1e-10)
    content = bytearray(path.read_bytes())
    match damage:
        case "cut":
            content = content[:-1]
        case "tag":
            content[0] = 0
        case "bits":
            content[6] = 12
        case "short":
            content = content[:100]
        case "range":
            content[26:30] = struct.pack("<f", float("nan"))
    path.write_bytes(bytes(content))
    with pytest.raises(MeasurementError, match=r"scan\.dzt: .*(whole scans|not a GSSI|header)"):
        take(
            tmp_path, "scan.dzt",
            f'time = {{ unit = "ns", band_ghz = [1.0, 2.0] }}\n{LINE}echo = {{}}',
        )  # fmt: skip


START, SLOPE, RATE, POINTS = 77e9, 70e12, 5e6, 256
TIMES = 6e-6 + np.arange(POINTS) / RATE
CHIRP = (
    "chirp = { start_ghz = 77.0, slope_mhz_per_us = 70.0, sample_rate_msps = 5.0, "
    "adc_start_us = 6.0 }\n"
)
NEAR = 'positions = { first = [-4.0, 0.0, 0.0], step = [1.0, 0.0, 0.0], unit = "mm" }\n'
CLOSE = np.stack([1e-3 * np.arange(9) - 4e-3, np.zeros(9), np.zeros(9)], axis=1)


def beats() -> tuple[np.ndarray, np.ndarray]:
    """Beats of the mixed echo, exp(+jωt) falling behind: and the delays of it."""
    delay = 2 * np.linalg.norm(CLOSE - np.array([0.0, 1.2, 0.0]), axis=1)[:, None] / speed_of_light
    phase = 2 * np.pi * ((START + SLOPE * TIMES) * delay - SLOPE * delay**2 / 2)
    return np.exp(1j * phase), delay


@pytest.mark.parametrize("layout", ["IIQQ", "IQ", "axis", "mat"])
def test_beats_of_a_radar_chip_become_the_sweep_of_the_point(
    tmp_path: Path,
    layout: str,
    take: Callable[[Path, str, str], Import],
    taken: Callable[[Path, str, str], Echo],
) -> None:
    found, delay = beats()
    counts = np.round(8000 * found)
    sign = 'time_convention = "exp(-jwt)"\n' + CHIRP + NEAR
    if layout == "mat":
        import scipy.io

        scipy.io.savemat(tmp_path / "beats.mat", {"adc": counts.T})
        echo = taken(
            tmp_path, "beats.mat",
            sign + 'echo = { variable = "adc", axes = ["sample", "position"] }',
        )  # fmt: skip
    else:
        parts = np.stack([counts.real, counts.imag], axis=-1)  # position, sample, part
        two = np.stack([0 * parts, parts], axis=1)  # the second receiver is ours
        if layout == "IIQQ":  # the DCA1000 with two lanes
            two = two.reshape(9, 2, POINTS // 2, 2, 2).swapaxes(-1, -2)
        axes, pairs = '["position", "rx", "sample"]', f'pairs = "{layout}"'
        shape = f"[9, 2, {POINTS}]"
        entries = "take = { rx = 1 }\n"
        if layout == "axis":
            axes, pairs = '["position", "rx", "sample", "iq"]', 'pairs = "none"'
            shape = f"[9, 2, {POINTS}, 2]"
            entries += "real = { take = { iq = 0 } }\nimaginary = { take = { iq = 1 } }\n"
        two.astype("<i2").tofile(tmp_path / "adc.bin")
        mapping = (
            sign + f'[echo]\naxes = {axes}\n{entries}raw = {{ type = "int16", shape = {shape}, '
            f"{pairs} }}\n"
        )
        echo = taken(tmp_path, "adc.bin", mapping)
        (tmp_path / "adc.bin").write_bytes((tmp_path / "adc.bin").read_bytes()[:-2])
        with pytest.raises(MeasurementError, match=r"18430 bytes, but echo\.raw\.shape .* 18432"):
            take(tmp_path, "adc.bin", mapping)
    # The residual video phase of 1.2 m, πKτ² = 0.014 rad, is gone but for the ends of the chirp,
    # where a delay between two cells leaks; half a count is 6e-5.
    assert echo.frequencies[0] == pytest.approx(START + SLOPE * 6e-6)
    flat = echo.samples * np.exp(2j * np.pi * echo.frequencies * delay) / 8000
    assert np.abs(np.angle(flat[:, 20:-20])).max() < 2e-3


def test_a_single_mixers_beat_becomes_its_analytic_signal(
    tmp_path: Path,
    take: Callable[[Path, str, str], Import],
    taken: Callable[[Path, str, str], Echo],
) -> None:
    found, delay = beats()
    np.save(tmp_path / "beats.npy", found.real)
    echo = taken(tmp_path, "beats.npy", CHIRP + NEAR + 'echo = { axes = ["position", "sample"] }')
    flat = echo.samples * np.exp(2j * np.pi * echo.frequencies * delay)
    # The mirror image at −τ is cut at the sweep's ends and leaks by 1/2πn at n turns from them:
    # 20 samples of 256, of 29 turns, are 2.2 turns.
    assert np.abs(flat[:, 20:-20] - 1).max() < 1 / (2 * np.pi * 2.2)

    frequencies = np.linspace(30e9, 34e9, 401)
    turns = frequencies * DELAY
    np.savez(tmp_path / "real.npz", s=np.cos(2 * np.pi * turns), f=frequencies)
    mapping = 'frequency = { variable = "f", unit = "Hz" }\n' + LINE + '[echo]\nvariable = "s"\n'
    with pytest.raises(MeasurementError, match=r"is real; .* analytic = true.* \[time\]"):
        take(tmp_path, "real.npz", mapping)
    echo = taken(tmp_path, "real.npz", mapping + "analytic = true\n")
    flat = echo.samples * np.exp(2j * np.pi * turns)
    # Here 40 of 400 steps, of 9.3 turns, are 0.93.
    assert np.abs(flat[:, 40:-40] - 1).max() < 1 / (2 * np.pi * 0.93)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[5.2, 6.8]", "[24.0, 26.0]", r"samples 20 ps apart tell frequencies of 0 … 25 GHz"),
        ("[5.2, 6.8]", "[6.01, 6.02]", r"holds 0 of the frequencies, 0.1 GHz apart"),
        ("[5.2, 6.8]", "[6.8, 5.2]", "band_ghz must rise"),
        ("step = 20.0, ", "", "nothing tells the times; give time.variable, or time.step"),
        ('unit = "ps"', 'unit = "ps", carrier_ghz = 6.0', "the traces are real: give complex"),
        ('"time"', '"frequency"', r'axes = .* give "time"'),
        ("time = {", 'frequency = { file = "f.npy", unit = "GHz" }\ntime = {',
         r"give one of \[frequency\], \[time\] and \[chirp\]"),
    ],
)  # fmt: skip
def test_a_mapping_of_traces_that_cannot_be_is_told(
    tmp_path: Path, old: str, new: str, message: str, take: Callable[[Path, str, str], Import]
) -> None:
    np.save(tmp_path / "t.npy", pulse(20e-12 * np.arange(500) - DELAY))
    mapping = 'time = { step = 20.0, unit = "ps", band_ghz = [5.2, 6.8] }\n' + LINE
    mapping += 'echo = { axes = ["position", "time"] }'
    assert old in mapping
    with pytest.raises(MeasurementError, match=message):
        take(tmp_path, "t.npy", mapping.replace(old, new))
