"""Layouts of other people's recorders: each gives one point's echo, or the reason why not."""

# Over 400 lines: every layout holds the same echo of one point.

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from estimator.measurement.model import Echo, MeasurementError
from mmslam.formats.import_measured import Import

FREQUENCIES = np.linspace(30e9, 34e9, 21)  # [Hz]
X, Z = 1e-3 * np.array([-9.0, -5.0, -1.0, 3.0, 7.0]), 1e-3 * np.array([-4.0, 0.0, 4.0, 8.0])

FREQUENCY = 'frequency = { start = 30.0, stop = 34.0, points = 21, unit = "GHz" }\n'

EXACT = 1e-12
"""Relative: a sum of some hundred turns in double precision."""


def plane() -> np.ndarray:
    """Positions of the grid, x fastest. [m]."""
    z, x = np.meshgrid(Z, X, indexing="ij")
    return np.stack([x.ravel(), 0 * x.ravel(), z.ravel()], axis=1)


@pytest.fixture
def assert_is_the_point(echo_of: Callable[..., np.ndarray]) -> Callable[..., None]:
    """Compares an echo with that of the point."""

    def compare(echo: Echo, *, tolerance: float = EXACT) -> None:
        expected = echo_of(echo.positions, echo.frequencies)
        np.testing.assert_allclose(echo.samples, expected, rtol=0, atol=0.1 * tolerance)

    return compare


@pytest.fixture
def grid(echo_of: Callable[..., np.ndarray]) -> Callable[[], np.ndarray]:
    """Samples by z, x, frequency."""
    return lambda: echo_of(plane()).reshape(4, 5, 21)


def test_first_and_step_reach_over_every_axis_of_a_grid(
    tmp_path: Path,
    take: Callable[[Path, str, str], Import],
    taken: Callable[[Path, str, str], Echo],
    grid: Callable[[], np.ndarray],
    assert_is_the_point: Callable[..., None],
) -> None:
    np.save(tmp_path / "s.npy", grid().transpose(2, 1, 0))
    steps = 'positions = { first = [-9.0, 0.0, -4.0], step = [4.0, 0.0, 4.0], unit = "mm" }\n'
    order = 'echo = { axes = ["frequency", "x", "z"] }'
    echo = taken(tmp_path, "s.npy", FREQUENCY + steps + order)
    assert len(np.unique(echo.positions, axis=0)) == 20
    assert_is_the_point(echo)
    flat = steps.replace("[4.0, 0.0, 4.0]", "[4.0, 0.0, 0.0]")
    with pytest.raises(MeasurementError, match="give a step along each of these axes"):
        take(tmp_path, "s.npy", FREQUENCY + flat + order)


def test_i_and_q_along_an_axis_are_taken_with_the_converters_zero_and_scale(
    tmp_path: Path,
    take: Callable[[Path, str, str], Import],
    taken: Callable[[Path, str, str], Echo],
    grid: Callable[[], np.ndarray],
    assert_is_the_point: Callable[..., None],
) -> None:
    exact = grid()
    counts = np.stack([np.round(2048 + 15000 * exact.imag), np.round(2050 + 15000 * exact.real)])
    np.save(tmp_path / "iq.npy", counts.astype(np.uint16))
    mapping = FREQUENCY + (
        'positions = { first = [-9.0, 0.0, -4.0], step = [4.0, 0.0, 4.0], unit = "mm" }\n[echo]\n'
        'axes = ["iq", "z", "x", "frequency"]\nreal = { take = { iq = 1 } }\n'
        f"imaginary = {{ take = {{ iq = 0 }} }}\noffset = [2050, 2048]\nscale = {1 / 15000!r}\n"
    )
    echo = taken(tmp_path, "iq.npy", mapping)
    # Half a count in each part, over the amplitude of 1500 counts.
    assert_is_the_point(echo, tolerance=np.sqrt(0.5) / 1500)
    without = mapping.replace("real = { take = { iq = 1 } }", 'real = "a"')
    with pytest.raises(MeasurementError, match=r"leave variable out|take one entry"):
        take(tmp_path, "iq.npy", without)


def test_several_arrays_in_one_npy_file_are_told_apart_by_number(
    tmp_path: Path,
    take: Callable[[Path, str, str], Import],
    taken: Callable[[Path, str, str], Echo],
    grid: Callable[[], np.ndarray],
    assert_is_the_point: Callable[..., None],
) -> None:
    with (tmp_path / "two.npy").open("wb") as stream:
        np.save(stream, grid().real)
        np.save(stream, grid().imag)
    mapping = FREQUENCY + (
        'positions = { first = [-9.0, 0.0, -4.0], step = [4.0, 0.0, 4.0], unit = "mm" }\n'
        'echo = { real = "0", imaginary = "1", axes = ["z", "x", "frequency"] }'
    )
    assert_is_the_point(taken(tmp_path, "two.npy", mapping))
    with pytest.raises(MeasurementError, match=r'another array follows .* variable = "0"'):
        take(tmp_path, "two.npy", mapping.replace('real = "0", imaginary = "1", ', ""))
    with pytest.raises(MeasurementError, match="no array 2; choose a lower number"):
        take(tmp_path, "two.npy", mapping.replace('"1"', '"2"'))


def test_a_header_that_promises_more_than_the_file_holds_is_refused_unread(
    tmp_path: Path, take: Callable[[Path, str, str], Import], grid: Callable[[], np.ndarray]
) -> None:
    np.save(tmp_path / "s.npy", grid())
    content = (tmp_path / "s.npy").read_bytes()
    (tmp_path / "s.npy").write_bytes(content[:-16])
    with pytest.raises(MeasurementError, match="its header promises 6720 bytes"):
        take(
            tmp_path, "s.npy", FREQUENCY + 'positions = { x = "x.npy", unit = "m" }\n'
            'echo = { axes = ["z", "x", "frequency"] }',
        )  # fmt: skip


@pytest.mark.parametrize("indexing", ["ij", "xy"])
def test_meshes_of_coordinates_are_unfolded_in_the_order_of_the_samples(
    tmp_path: Path,
    indexing: str,
    taken: Callable[[Path, str, str], Echo],
    grid: Callable[[], np.ndarray],
    assert_is_the_point: Callable[..., None],
) -> None:
    if indexing == "ij":
        mesh_x, mesh_z = np.meshgrid(X, Z, indexing="ij")
        samples, axes = grid().transpose(1, 0, 2), '["x", "z", "frequency"]'
    else:
        mesh_x, mesh_z = np.meshgrid(X, Z)
        samples, axes = grid(), '["z", "x", "frequency"]'
    np.savez(tmp_path / "mesh.npz", s=samples, mx=mesh_x, mz=mesh_z)
    mapping = FREQUENCY + (
        'positions = { x = "mx", z = "mz", unit = "m" }\n'
        f'echo = {{ variable = "s", axes = {axes} }}'
    )
    assert_is_the_point(taken(tmp_path, "mesh.npz", mapping))


def test_a_mesh_that_lies_across_the_samples_is_refused_with_the_order(
    tmp_path: Path, take: Callable[[Path, str, str], Import], grid: Callable[[], np.ndarray]
) -> None:
    line = X[:4]
    mesh_x, mesh_z = np.meshgrid(line, Z)  # square: shapes cannot tell
    np.savez(tmp_path / "mesh.npz", s=grid()[:, :4], mx=mesh_x, mz=mesh_z)
    mapping = FREQUENCY + (
        'positions = { x = "mx", z = "mz", unit = "m" }\n'
        'echo = { variable = "s", axes = ["x", "z", "frequency"] }'
    )
    with pytest.raises(MeasurementError, match=r"varies along another axis .* \['z', 'x'\]"):
        take(tmp_path, "mesh.npz", mapping)


@pytest.mark.parametrize(
    "form", ['"x.npy"', '{ file = "x.npy" }', '{ file = "c.npz", variable = "x" }']
)
def test_coordinates_may_lie_in_files_of_their_own(
    tmp_path: Path,
    form: str,
    taken: Callable[[Path, str, str], Echo],
    grid: Callable[[], np.ndarray],
    assert_is_the_point: Callable[..., None],
) -> None:
    np.save(tmp_path / "s.npy", grid())
    np.save(tmp_path / "x.npy", 1e3 * X)
    np.save(tmp_path / "z.npy", 1e3 * Z)
    np.savez(tmp_path / "c.npz", x=1e3 * X)
    mapping = FREQUENCY + (
        f'positions = {{ x = {form}, z = "z.npy", unit = "mm" }}\n'
        'echo = { axes = ["z", "x", "frequency"] }'
    )
    assert_is_the_point(taken(tmp_path, "s.npy", mapping))


@pytest.fixture
def csv_folder(tmp_path: Path, echo_of: Callable[..., np.ndarray]) -> None:
    """Tables of positions 4 mm apart, whose names count steps."""
    (tmp_path / "scan").mkdir()
    for z in (-1, 0, 1, 2):
        for x in (-2, -1, 0, 1):
            place = np.array([[4e-3 * x, 0.0, 4e-3 * z]])
            rows = zip(FREQUENCIES / 1e9, echo_of(place)[0], strict=True)
            lines = ['"Freq [GHz]","re(S(Rx_p1,Tx_p1)) []","im(S(Rx_p1,Tx_p1)) []"']
            lines += [f"{f!r},{s.real!r},{s.imag!r}" for f, s in
                      ((float(f), complex(s)) for f, s in rows)]  # fmt: skip
            (tmp_path / "scan" / f"h_{x}_v_{z}.csv").write_text("\n".join(lines) + "\n")


FOLDER = """
frequency = { variable = "Freq [GHz]", unit = "GHz" }
positions = { files = "h_{x}_v_{z}.csv", unit = "mm" }
[echo]
real = "re(S(Rx_p1,Tx_p1)) []"
imaginary = "im(S(Rx_p1,Tx_p1)) []"
"""


@pytest.mark.usefixtures("csv_folder")
def test_a_folder_of_quoted_tables_has_its_positions_in_the_names_times_a_step(
    tmp_path: Path,
    take: Callable[[Path, str, str], Import],
    taken: Callable[[Path, str, str], Echo],
    assert_is_the_point: Callable[..., None],
) -> None:
    steps = "first = [0.0, 0.0, 0.0], step = [4.0, 0.0, 4.0], unit"
    echo = taken(tmp_path, "scan", FOLDER.replace('unit = "mm" }\n[', f'{steps} = "mm" }}\n['))
    assert len(echo.positions) == 16
    assert_is_the_point(echo)
    one = take(
        tmp_path, "scan/h_0_v_1.csv",
        FOLDER.replace('files = "h_{x}_v_{z}.csv"', "x = 0, z = 4.0"),
    ).measurement.echo  # fmt: skip
    assert one is not None
    assert one.positions.tolist() == [[0.0, 0.0, 0.004]]
    assert_is_the_point(one)


@pytest.mark.usefixtures("csv_folder")
def test_numbers_in_file_names_that_count_steps_are_remarked_with_the_key(
    tmp_path: Path, take: Callable[[Path, str, str], Import]
) -> None:
    imported = take(tmp_path, "scan", FOLDER)
    assert imported.measurement.echo is not None
    assert len(imported.measurement.echo.positions) == 16
    assert any("rise by one" in note and "first and step" in note for note in imported.notes)


@pytest.mark.parametrize(
    ("header", "delimiter", "comma"),
    [
        ("f;x;re;im", ";", True),  # a table of a country with decimal commas
        ("f\tx\tre\tim", "\t", False),
        ('"f" "x" "re" "im"', " ", False),
        ("# an export\n#f  x  re  im\n#-----------", "   ", False),  # CST
    ],
)
def test_tables_of_several_programs_name_their_columns(
    tmp_path: Path,
    header: str,
    delimiter: str,
    comma: bool,
    taken: Callable[[Path, str, str], Echo],
    echo_of: Callable[..., np.ndarray],
    assert_is_the_point: Callable[..., None],
) -> None:
    places = plane()[:5]
    lines = [header]
    for place, row in zip(places, echo_of(places), strict=True):
        for frequency, sample in zip(FREQUENCIES, row, strict=True):
            numbers = (float(frequency) / 1e9, float(place[0]) * 1e3, sample.real, sample.imag)
            text = delimiter.join(f"{float(one)!r}" for one in numbers)
            lines.append(text.replace(".", ",") if comma else text)
    (tmp_path / "s.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    mapping = """
        frequency = { variable = "f", unit = "GHz" }
        positions = { x = "x", z = -4.0, unit = "mm" }
        echo = { real = "re", imaginary = "im" }
    """
    assert_is_the_point(taken(tmp_path, "s.txt", mapping), tolerance=1e-9)  # 1 ulp of 34 GHz


def test_magnitude_and_degrees_in_one_column_are_read(
    tmp_path: Path,
    taken: Callable[[Path, str, str], Echo],
    echo_of: Callable[..., np.ndarray],
    assert_is_the_point: Callable[..., None],
) -> None:
    """ADS writes polar numbers so."""
    places = plane()[:5]
    lines = ["xpos\tfreq\tS(1,1)"]
    for place, row in zip(places, echo_of(places), strict=True):
        for frequency, sample in zip(FREQUENCIES, row, strict=True):
            polar = f"{float(abs(sample))!r} / {float(np.degrees(np.angle(sample)))!r}"
            lines.append(f"{float(place[0])!r}\t{float(frequency)!r}\t{polar}")
    (tmp_path / "s.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    mapping = """
        frequency = { variable = "freq", unit = "Hz" }
        positions = { x = "xpos", z = -0.004, unit = "m" }
        echo = { variable = "S(1,1)" }
    """
    assert_is_the_point(taken(tmp_path, "s.txt", mapping), tolerance=1e-9)


@pytest.mark.parametrize("imaginary_unit", ["i", "j"])
def test_a_plain_matrix_of_text_needs_no_names(
    tmp_path: Path,
    imaginary_unit: str,
    taken: Callable[[Path, str, str], Echo],
    echo_of: Callable[..., np.ndarray],
    assert_is_the_point: Callable[..., None],
) -> None:
    samples = echo_of(plane()[:5]).T
    rows = (
        " ".join(f"{s.real:.17g}{s.imag:+.17g}{imaginary_unit}" for s in row) for row in samples
    )
    (tmp_path / "s.dat").write_text("\n".join(rows) + "\n")
    np.savetxt(tmp_path / "re.txt", samples.real)
    np.savetxt(tmp_path / "im.txt", samples.imag, delimiter=",")
    place = 'positions = { first = [-9.0, 0.0, -4.0], step = [4.0, 0.0, 0.0], unit = "mm" }\n'
    whole = 'echo = { axes = ["frequency", "position"] }'
    assert_is_the_point(taken(tmp_path, "s.dat", FREQUENCY + place + whole))
    parts = """[echo]
        real = { file = "re.txt" }
        imaginary = { file = "im.txt" }
        axes = ["frequency", "position"]
    """
    assert_is_the_point(taken(tmp_path, "s.dat", FREQUENCY + place + parts))


LINE = 'positions = { first = [-9.0, 0.0, -4.0], step = [4.0, 0.0, 0.0], unit = "mm" }\n'


def line() -> np.ndarray:
    return plane()[:5]


def test_falling_frequencies_are_turned_and_the_samples_with_them(
    tmp_path: Path,
    take: Callable[[Path, str, str], Import],
    echo_of: Callable[..., np.ndarray],
    assert_is_the_point: Callable[..., None],
) -> None:
    np.savez(tmp_path / "s.npz", s=echo_of(line())[:, ::-1], f=FREQUENCIES[::-1])
    imported = take(
        tmp_path, "s.npz",
        'frequency = { variable = "f", unit = "Hz" }\n' + LINE + 'echo = { variable = "s" }',
    )  # fmt: skip
    assert imported.measurement.echo is not None
    assert_is_the_point(imported.measurement.echo)
    assert any("the frequencies fall" in note for note in imported.notes)


def test_a_band_is_cut_out_of_a_sweep(
    tmp_path: Path,
    take: Callable[[Path, str, str], Import],
    taken: Callable[[Path, str, str], Echo],
    echo_of: Callable[..., np.ndarray],
    assert_is_the_point: Callable[..., None],
) -> None:
    np.savez(tmp_path / "s.npz", s=echo_of(line()))
    mapping = "band_ghz = [31.0, 32.4]\n" + FREQUENCY + LINE + 'echo = { variable = "s" }'
    echo = taken(tmp_path, "s.npz", mapping)
    assert (echo.frequencies[0], echo.frequencies[-1], echo.frequencies.size) == (31e9, 32.4e9, 8)
    assert_is_the_point(echo)
    with pytest.raises(MeasurementError, match=r"band_ghz = \[36.0, 37.0\] holds 0 of the freq"):
        take(tmp_path, "s.npz", mapping.replace("[31.0, 32.4]", "[36.0, 37.0]"))


def test_positions_are_left_out_by_number_or_where_nothing_was_measured(
    tmp_path: Path,
    take: Callable[[Path, str, str], Import],
    taken: Callable[[Path, str, str], Echo],
    echo_of: Callable[..., np.ndarray],
    assert_is_the_point: Callable[..., None],
) -> None:
    places = np.stack([4e-3 * np.arange(12), np.zeros(12), np.zeros(12)], axis=1)
    samples = echo_of(places)
    samples[7] = np.nan
    np.savez(tmp_path / "s.npz", s=samples, p=places)
    mapping = FREQUENCY + 'positions = { variable = "p", unit = "m" }\n[echo]\nvariable = "s"\n'
    imported = take(tmp_path, "s.npz", mapping)
    assert imported.measurement.echo is not None
    assert len(imported.measurement.echo.positions) == 11
    assert_is_the_point(imported.measurement.echo)
    assert any("1 of 12 positions hold no number" in note for note in imported.notes)
    samples[3:5] = np.nan
    np.savez(tmp_path / "s.npz", s=samples, p=places)
    with pytest.raises(MeasurementError, match=r"3 of 12 positions .* leave_out = \[3, 4, 7\]"):
        take(tmp_path, "s.npz", mapping)
    echo = taken(tmp_path, "s.npz", mapping + "leave_out = [3, 4, 7]\n")
    assert len(echo.positions) == 9
    assert_is_the_point(echo)
    samples[:] = echo_of(places)
    samples[2, 5] = np.nan
    np.savez(tmp_path / "s.npz", s=samples, p=places)
    with pytest.raises(MeasurementError, match=r"position 2 in part.*leave_out = \[2\]"):
        take(tmp_path, "s.npz", mapping)
    with pytest.raises(MeasurementError, match="leave_out = 12, but there are 12 positions"):
        take(tmp_path, "s.npz", mapping + "leave_out = [2, 12]\n")


def test_counts_of_a_converter_are_remarked_and_scaled_by_a_key(
    tmp_path: Path,
    take: Callable[[Path, str, str], Import],
    echo_of: Callable[..., np.ndarray],
    assert_is_the_point: Callable[..., None],
) -> None:
    np.savez(tmp_path / "s.npz", s=4e7 * echo_of(line()))
    mapping = FREQUENCY + LINE + '[echo]\nvariable = "s"\n'
    assert any("scale" in note for note in take(tmp_path, "s.npz", mapping).notes)
    scaled = take(tmp_path, "s.npz", mapping + "scale = 2.5e-8\n")
    assert not scaled.notes
    assert scaled.measurement.echo is not None
    assert_is_the_point(scaled.measurement.echo)


def test_a_sweep_below_a_gigahertz_is_remarked_and_imported(
    tmp_path: Path,
    take: Callable[[Path, str, str], Import],
    echo_of: Callable[..., np.ndarray],
    assert_is_the_point: Callable[..., None],
) -> None:
    low = np.linspace(0.4e9, 0.9e9, 21)
    places = np.stack([0.1 * np.arange(9), np.zeros(9), np.zeros(9)], axis=1)
    np.savez(tmp_path / "s.npz", s=echo_of(places, low), p=places, f=low)
    imported = take(
        tmp_path, "s.npz",
        """
        frequency = { variable = "f", unit = "Hz" }
        positions = { variable = "p", unit = "m" }
        echo = { variable = "s" }
        """,
    )  # fmt: skip
    assert imported.measurement.echo is not None
    assert_is_the_point(imported.measurement.echo)
    assert any("below 1 GHz" in note and "unit" in note for note in imported.notes)


@pytest.mark.parametrize("kind", ["logarithmic", "segmented"])
def test_unequal_frequencies_are_resampled_within_the_error_that_is_stated(
    tmp_path: Path,
    kind: str,
    take: Callable[[Path, str, str], Import],
    echo_of: Callable[..., np.ndarray],
) -> None:
    if kind == "logarithmic":
        found = np.geomspace(28e9, 36e9, 161)
    else:
        found = np.concatenate([np.arange(28e9, 32e9, 40e6), np.arange(32e9, 36e9, 55e6)])
    np.savez(tmp_path / "s.npz", s=echo_of(line(), found), f=found)
    mapping = 'frequency = { variable = "f", unit = "Hz" }\n' + LINE + 'echo = { variable = "s" }'
    imported = take(tmp_path, "s.npz", mapping)
    (note,) = imported.notes
    stated = float(note.split("error of ")[1].split(" dB")[0])
    echo = imported.measurement.echo
    assert echo is not None
    assert np.ptp(np.diff(echo.frequencies)) < 1e-3
    error = np.sqrt(np.mean(np.abs(echo.samples - echo_of(line(), echo.frequencies)) ** 2)) / 0.1
    # The stated error is a mean over the delays of the window; one delay of it stays within twice.
    assert 20 * np.log10(error) < stated + 6
    assert stated < -40
    with pytest.raises(MeasurementError, match="no rounding but another grid"):
        take(tmp_path, "s.npz", "frequency_rounded_to_hz = 3e7\n" + mapping)


def test_steps_that_are_too_unequal_are_refused_with_the_remedy(
    tmp_path: Path, take: Callable[[Path, str, str], Import], echo_of: Callable[..., np.ndarray]
) -> None:
    rng = np.random.default_rng(4)
    found = np.sort(rng.uniform(28e9, 36e9, 2100))
    np.savez(tmp_path / "s.npz", s=echo_of(line(), found), f=found)
    mapping = 'frequency = { variable = "f", unit = "Hz" }\n' + LINE + 'echo = { variable = "s" }'
    with pytest.raises(MeasurementError, match=r"2100 unequal steps; at most 2048 .* band_ghz"):
        take(tmp_path, "s.npz", mapping)


@pytest.mark.parametrize("axes", ["xy", "xz", "circle"])
def test_a_scan_over_x_and_y_looks_along_z_and_a_circle_keeps_its_boresight(
    tmp_path: Path,
    axes: str,
    take: Callable[[Path, str, str], Import],
    echo_of: Callable[..., np.ndarray],
) -> None:
    places = plane()
    if axes == "xy":
        places = places[:, [0, 2, 1]]
    if axes == "circle":
        turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
        places = 0.1 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    np.savez(tmp_path / "s.npz", s=echo_of(places), p=places)
    mapping = FREQUENCY + 'positions = { variable = "p", unit = "m" }\necho = { variable = "s" }\n'
    imported = take(tmp_path, "s.npz", mapping)
    expected = [0.0, 0.0, 1.0] if axes == "xy" else [0.0, 1.0, 0.0]
    np.testing.assert_allclose(imported.measurement.boresight, expected, atol=1e-9)
    assert any("boresight" in note for note in imported.notes) == (axes == "xy")
    if axes == "xy":
        with pytest.raises(MeasurementError, match="lies in the area of the positions"):
            take(tmp_path, "s.npz", "boresight = [0.0, 1.0, 0.0]\n" + mapping)
        other = take(tmp_path, "s.npz", "boresight = [0.0, 0.0, -1.0]\n" + mapping)
        np.testing.assert_allclose(other.measurement.boresight, [0.0, 0.0, -1.0])
