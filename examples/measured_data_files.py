"""Write one small measurement in every format that `mmslam import` reads, each with its mapping.

Run as ``python examples/measured_data_files.py [FOLDER]``. The numbers are closed forms: the echo
of one point and the pilot of one user, 16 positions and 41 frequencies, with the antennas' cross
talk and a cable's delay on top. Each format has another layout, unit and sign, as instruments and
programs have; imported by its mapping, each gives the same measurement.
"""

import csv
import sys
from pathlib import Path

import h5py  # type: ignore[import-untyped]  # it has no stubs
import numpy as np
import scipy.io
from scipy.constants import speed_of_light

from mmslam.formats.touchstone_files import touchstone_text

CABLE_NS = 2.5
CROSS_TALK = 3e-4

frequency_ghz = np.linspace(220.0, 224.0, 41)
x_mm = 0.5 * np.arange(16) - 3.75
target, user = np.array([0.02, 0.40, 0.0]), np.array([-0.10, 0.50, 0.0])  # [m]

frequency = frequency_ghz * 1e9
position = np.stack([x_mm / 1e3, np.zeros(16), np.zeros(16)], axis=-1)
wavelength = speed_of_light / frequency


def free_space(point: np.ndarray, ways: int) -> np.ndarray:
    """Return what an ideal radio measures of a point: λ/(4πR) there, or there and back."""
    distance = np.linalg.norm(point - position, axis=1)[:, None]
    delay = ways * distance / speed_of_light
    amplitude = (wavelength / (4 * np.pi * distance)) ** ways
    return np.asarray(amplitude * np.exp(-2j * np.pi * frequency * delay))


echo, pilot = free_space(target, 2), free_space(user, 1)
cable = np.exp(-2j * np.pi * frequency * CABLE_NS * 1e-9)
cross_talk = CROSS_TALK * np.exp(-2j * np.pi * frequency * 0.1e-9) * np.ones((16, 1))
s11, s11_empty, s21 = (echo + cross_talk) * cable, cross_talk * cable, pilot * cable


def touchstone(folder: Path) -> None:
    """Write a folder with a file for each position, as a network analyser saves them."""
    for kind, echoes, pilots in (("scan", s11, s21), ("empty", s11_empty, None)):
        (folder / kind).mkdir(parents=True)
        for x, row in zip(x_mm, range(16), strict=True):
            if pilots is None:
                text = touchstone_text(frequency, echoes[row], ports=1, comment="no target")
                (folder / kind / f"x{x:+.2f}.s1p").write_text(text)
                continue
            columns = (echoes[row], pilots[row], pilots[row], np.zeros(41))
            lines = ["! one position of the scan", "# GHz S RI R 50"]
            for index, ghz in enumerate(frequency_ghz):
                numbers = [f"{s[index].real!r} {s[index].imag!r}" for s in map(plain, columns)]
                lines.append(f"{float(ghz)!r} {' '.join(numbers)}")
            (folder / kind / f"x{x:+.2f}.s2p").write_text("\n".join(lines) + "\n")
    (folder / "mapping.toml").write_text(
        f"""\
clock_offset_ns = 0.0

[positions]
files = "x{{x}}.s*p"
unit = "mm"

[echo]
folder = "scan"
parameter = "S11"
background = {{ folder = "empty" }}
cable_delay_ns = {CABLE_NS}

[uplinks.user]
folder = "scan"
parameter = "S21"
cable_delay_ns = {CABLE_NS}
"""
    )


def plain(values: np.ndarray) -> list[complex]:
    """Return Python's own numbers, which print without NumPy's type."""
    return [complex(value) for value in values]


def matlab(folder: Path) -> None:
    """Write a structure, frequency first, in the physicists' sign (exp(-jωt))."""
    sweep = {
        "S11": np.conj(s11).T,
        "S21": np.conj(s21).T,
        "empty": np.conj(s11_empty[:1]).T,
        "f": frequency_ghz,
        "x": x_mm,
    }
    scipy.io.savemat(folder / "sweep.mat", {"sweep": sweep})
    mapping = f"""\
time_convention = "exp(-jwt)"
clock_offset_ns = 0.0
frequency = {{ variable = "sweep.f", unit = "GHz" }}
positions = {{ x = "sweep.x", unit = "mm" }}

[echo]
variable = "sweep.S11"
axes = ["frequency", "position"]
cable_delay_ns = {CABLE_NS}
background = {{ variable = "sweep.empty", axes = ["frequency", "position"] }}

[uplinks.user]
variable = "sweep.S21"
axes = ["frequency", "position"]
cable_delay_ns = {CABLE_NS}
"""
    (folder / "sweep.mat.toml").write_text(mapping)
    # MATLAB's `save -v7.3`: HDF5 after 512 bytes of its own, axes turned round.
    with h5py.File(folder / "sweep_v73.mat", "w", userblock_size=512) as file:
        group = file.create_group("sweep")
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, values in sweep.items():
            array = np.atleast_2d(values)
            if np.iscomplexobj(array):
                pair = np.empty(array.T.shape, dtype=[("real", "<f8"), ("imag", "<f8")])
                pair["real"], pair["imag"] = array.T.real, array.T.imag
                array = pair.T
            group.create_dataset(name, data=array.T).attrs["MATLAB_class"] = np.bytes_("double")
    with (folder / "sweep_v73.mat").open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, written by an example of mmslam".ljust(124))
        stream.write(b"\x00\x02IM")
    (folder / "sweep_v73.mat.toml").write_text(mapping)


def hdf5(folder: Path) -> None:
    """Write two runs of a scan, and the radio's response instead of a cable's length."""
    with h5py.File(folder / "sweep.h5", "w") as file:
        file["radar/echo"] = np.stack([0 * s11, s11])  # the second run is the good one
        file["radar/empty"] = s11_empty[0]
        file["radar/through"] = cable
        file["radio/pilot"] = s21
        file["frequency"] = frequency
        file["position"] = position.T
    (folder / "sweep.h5.toml").write_text(
        f"""\
clock_offset_ns = 0.0
frequency = {{ variable = "frequency", unit = "Hz" }}
positions = {{ variable = "position", axes = ["axis", "position"], unit = "m" }}

[echo]
variable = "radar/echo"
axes = ["run", "position", "frequency"]
take = {{ run = 1 }}
background = {{ variable = "radar/empty", axes = ["frequency"] }}
response = {{ variable = "radar/through" }}

[uplinks.user]
variable = "radio/pilot"
axes = ["position", "frequency"]
cable_delay_ns = {CABLE_NS}
"""
    )


def netcdf(folder: Path) -> None:
    """Write real and imaginary parts apart, as NetCDF has no complex numbers."""
    with scipy.io.netcdf_file(folder / "sweep.nc", "w") as file:
        file.createDimension("x", 16)
        file.createDimension("frequency", 41)
        for name, values in {"s11": s11, "s21": s21, "empty": s11_empty}.items():
            for part, numbers in (("re", values.real), ("im", values.imag)):
                file.createVariable(f"{name}_{part}", "d", ("x", "frequency"))[:] = numbers
        file.createVariable("x", "d", ("x",))[:] = x_mm
    (folder / "sweep.nc.toml").write_text(
        f"""\
clock_offset_ns = 0.0
frequency = {{ start = 220.0, stop = 224.0, points = 41, unit = "GHz" }}
positions = {{ x = "x", unit = "mm" }}

[echo]
real = "s11_re"
imaginary = "s11_im"
axes = ["x", "frequency"]
cable_delay_ns = {CABLE_NS}
background = {{ real = "empty_re", imaginary = "empty_im" }}

[uplinks.user]
real = "s21_re"
imaginary = "s21_im"
axes = ["x", "frequency"]
cable_delay_ns = {CABLE_NS}
"""
    )


def table(folder: Path) -> None:
    """Write a row for each sample: decibels and degrees, and the empty room in a second file."""
    for name, echoes in (("sweep.csv", s11), ("sweep_empty.csv", s11_empty)):
        with (folder / name).open("w", newline="") as stream:
            writer = csv.writer(stream)
            writer.writerow(["f_ghz", "x_mm", "s11_db", "s11_deg", "s21_re", "s21_im"])
            for at, x in enumerate(x_mm.tolist()):
                for step, ghz in enumerate(frequency_ghz.tolist()):
                    one, other = complex(echoes[at, step]), complex(s21[at, step])
                    level, phase = 20 * np.log10(abs(one)), np.degrees(np.angle(one))
                    writer.writerow([ghz, x, float(level), float(phase), other.real, other.imag])
    (folder / "sweep.csv.toml").write_text(
        f"""\
clock_offset_ns = 0.0
frequency = {{ variable = "f_ghz", unit = "GHz" }}
positions = {{ x = "x_mm", unit = "mm" }}

[echo]
magnitude_db = "s11_db"
phase_deg = "s11_deg"
cable_delay_ns = {CABLE_NS}
background = {{ file = "sweep_empty.csv" }}

[uplinks.user]
real = "s21_re"
imaginary = "s21_im"
cable_delay_ns = {CABLE_NS}
"""
    )


def numpy_archive(folder: Path) -> None:
    """Write an .npz archive, and the same as single .npy files."""
    arrays = {"s11": s11, "s21": s21, "empty": s11_empty, "freq": frequency, "pos": position}
    np.savez_compressed(folder / "sweep.npz", **arrays)
    (folder / "sweep.npz.toml").write_text(
        f"""\
clock_offset_ns = 0.0
frequency = {{ variable = "freq", unit = "Hz" }}
positions = {{ variable = "pos", unit = "m" }}

[echo]
variable = "s11"
background = {{ variable = "empty" }}
cable_delay_ns = {CABLE_NS}

[uplinks.user]
variable = "s21"
cable_delay_ns = {CABLE_NS}
"""
    )
    for name, values in arrays.items():
        np.save(folder / f"{name}.npy", values)
    (folder / "s11.npy.toml").write_text(
        f"""\
clock_offset_ns = 0.0
frequency = {{ file = "freq.npy", unit = "Hz" }}
positions = {{ first = [-3.75, 0.0, 0.0], step = [0.5, 0.0, 0.0], unit = "mm" }}

[echo]
background = {{ file = "empty.npy" }}
cable_delay_ns = {CABLE_NS}

[uplinks.user]
file = "s21.npy"
cable_delay_ns = {CABLE_NS}
"""
    )


out = Path(sys.argv[1] if len(sys.argv) > 1 else "measured")
touchstone(out / "touchstone")
for write in (matlab, hdf5, netcdf, table, numpy_archive):
    write(out)
print(f"{out}: a folder touchstone/ with its mapping.toml; SOURCE.toml beside each other SOURCE")
