from pathlib import Path

import h5py  # type: ignore[import-untyped]
import numpy as np
import pytest
import scipy.io

from estimator.measurement.model import MeasurementError
from mmslam.formats.array_files import ArrayFiles

VALUES = np.arange(6.0).reshape(2, 3)


def read(path: Path, name: str | None = "a") -> np.ndarray:
    return ArrayFiles(frequency="f", coordinates=("x",)).array(path, name)


@pytest.mark.parametrize("suffix", [".mat", ".h5", ".nc", ".npz"])
def test_text_for_binary_is_told(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"text{suffix}"
    path.write_text("frequency,x,y\n1,2,3\n")
    with pytest.raises(MeasurementError, match=r"text\.\w+: (not a|cannot be read as)"):
        read(path)


def test_text_for_npy_is_told_and_so_is_binary_for_csv(tmp_path: Path) -> None:
    (tmp_path / "text.npy").write_text("1,2,3")
    with pytest.raises(MeasurementError, match=r"text\.npy"):
        read(tmp_path / "text.npy", None)
    (tmp_path / "binary.csv").write_bytes(bytes(range(128, 256)))
    with pytest.raises(MeasurementError, match=r"binary\.csv: cannot be read as text"):
        read(tmp_path / "binary.csv")


def test_unknown_suffixes_and_missing_files_are_told(tmp_path: Path) -> None:
    (tmp_path / "sweep.xlsx").write_text("x")
    with pytest.raises(MeasurementError, match=r"unknown suffix '\.xlsx'; give a folder of"):
        read(tmp_path / "sweep.xlsx")
    with pytest.raises(MeasurementError, match="no such file"):
        read(tmp_path / "none.mat")


class Mark:
    """Leaves a file behind if it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, ...]:
        return (Path.touch, (self.path,))


def test_pickled_objects_are_never_loaded(tmp_path: Path) -> None:
    evil = np.array([Mark(tmp_path / "it_ran")], dtype=object)
    np.save(tmp_path / "evil.npy", evil, allow_pickle=True)
    np.savez(tmp_path / "evil.npz", a=evil)
    for name, variable in (("evil.npy", None), ("evil.npz", "a")):
        with pytest.raises(MeasurementError, match="pickled objects are never loaded"):
            read(tmp_path / name, variable)
    assert not (tmp_path / "it_ran").exists()


def test_a_truncated_file_is_told(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    noise = rng.normal(size=(50, 60))
    np.save(tmp_path / "a.npy", noise)
    np.savez(tmp_path / "a.npz", a=noise)
    scipy.io.savemat(tmp_path / "a.mat", {"a": noise}, do_compression=True)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["a"] = noise
    with scipy.io.netcdf_file(tmp_path / "a.nc", "w") as old:
        old.createDimension("x", noise.size)
        old.createVariable("a", "d", ("x",))[:] = noise.ravel()
    for suffix in ("npy", "npz", "mat", "h5", "nc"):
        path = tmp_path / f"a.{suffix}"
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
        with pytest.raises(MeasurementError, match=rf"a\.{suffix}: "):
            read(path, None if suffix == "npy" else "a")


def test_matlab_objects_structures_cells_and_text_are_refused(tmp_path: Path) -> None:
    content = np.empty((1, 1), dtype=[("field", object)])
    content["field"][0, 0] = np.ones(3)
    cell = np.empty(2, dtype=object)
    cell[:] = [np.ones(2), "text"]
    scipy.io.savemat(
        tmp_path / "objects.mat",
        {
            "object": scipy.io.matlab.MatlabObject(content, "radar"),
            "struct": {"inner": "text"},
            "cell": cell,
            "char": "text",
            "sparse": scipy.sparse.eye_array(3, format="csc"),
        },
    )
    for kind in ("object", "struct", "cell", "char", "sparse"):
        with pytest.raises(MeasurementError, match=f"'{kind}' is a MATLAB {kind}; only arrays"):
            read(tmp_path / "objects.mat", kind)
    with pytest.raises(MeasurementError, match=r"'struct\.inner' is no array of numbers"):
        read(tmp_path / "objects.mat", "struct.inner")
    with pytest.raises(MeasurementError, match="'object' is a MATLAB object"):
        read(tmp_path / "objects.mat", "object.field")


def test_a_matlab_7_3_cell_or_text_is_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "new.mat", "w", userblock_size=512) as file:
        file["text"] = np.array([104, 105], dtype=np.uint16)
        file["text"].attrs["MATLAB_class"] = np.bytes_("char")
        file.create_dataset("cell", shape=(2,), dtype=h5py.ref_dtype)
        file["cell"].attrs["MATLAB_class"] = np.bytes_("cell")
    for kind in ("char", "cell"):
        name = "text" if kind == "char" else "cell"
        with pytest.raises(MeasurementError, match=f"'{name}' is a MATLAB {kind}; only arrays"):
            read(tmp_path / "new.mat", name)


def test_hdf5_reads_no_other_file(tmp_path: Path) -> None:
    (tmp_path / "secret").write_bytes(VALUES.tobytes())
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["a"] = VALUES
    with h5py.File(tmp_path / "links.h5", "w") as file:
        file["external_link"] = h5py.ExternalLink("other.h5", "/a")
        file["soft_link"] = h5py.SoftLink("/external_link")
        file.create_dataset("raw", shape=(6,), dtype="f8", external=[(tmp_path / "secret", 0, 48)])
        layout = h5py.VirtualLayout(shape=(2, 3), dtype="f8")
        layout[:] = h5py.VirtualSource(tmp_path / "other.h5", "a", shape=(2, 3))
        file.create_virtual_dataset("virtual", layout)
        file["here"] = VALUES
    for name in ("external_link", "soft_link"):
        with pytest.raises(MeasurementError, match=r"is a link .* copy the data into this file"):
            read(tmp_path / "links.h5", name)
    for name in ("raw", "virtual"):
        with pytest.raises(MeasurementError, match="lies in another file"):
            read(tmp_path / "links.h5", name)
    np.testing.assert_array_equal(read(tmp_path / "links.h5", "here"), VALUES)


def test_hdf5_text_and_structures_are_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "odd.h5", "w") as file:
        file["text"] = ["one", "two"]
        file["pair"] = np.zeros(2, dtype=[("x", "f8"), ("y", "f8")])
        file["switch"] = np.array([True, False])
        file.create_dataset("huge", shape=(2**40,), dtype="f8", chunks=True)
        file.create_group("group")
    for name in ("text", "pair", "switch"):
        with pytest.raises(MeasurementError, match="only arrays of numbers are read"):
            read(tmp_path / "odd.h5", name)
    with pytest.raises(MeasurementError, match="it must hold numbers, at most"):
        read(tmp_path / "odd.h5", "huge")
    with pytest.raises(MeasurementError, match="is a group; name a dataset in it"):
        read(tmp_path / "odd.h5", "group")


@pytest.mark.parametrize("parts", [("real", "imag"), ("r", "i")])
def test_complex_numbers_of_hdf5_are_pairs_by_several_names(
    tmp_path: Path, parts: tuple[str, str]
) -> None:
    pair = np.zeros(3, dtype=[(part, "<f4") for part in parts])
    pair[parts[0]], pair[parts[1]] = [1, 2, 3], [-1, 0, 4]
    with h5py.File(tmp_path / "pair.h5", "w") as file:
        file["a"] = pair
    np.testing.assert_array_equal(read(tmp_path / "pair.h5"), [1 - 1j, 2, 3 + 4j])


def test_packed_netcdf_is_unpacked_and_its_missing_values_are_told(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "new.nc", "w") as file:
        file["a"] = np.array([1, 2, 3], dtype=np.int16)
        file["a"].attrs["scale_factor"], file["a"].attrs["add_offset"] = 0.5, 10.0
        file["hole"] = np.array([1, -99, 3], dtype=np.int16)
        file["hole"].attrs["_FillValue"] = np.int16(-99)
    with scipy.io.netcdf_file(tmp_path / "old.nc", "w") as old:
        old.createDimension("x", 3)
        for name in ("a", "hole"):
            old.createVariable(name, "h", ("x",))[:] = [1, -99 if name == "hole" else 2, 3]
        for name, key, value in (
            ("a", "scale_factor", 0.5),
            ("a", "add_offset", 10.0),
            ("hole", "_FillValue", np.int16(-99)),
        ):
            setattr(old.variables[name], key, value)
    for name in ("new.nc", "old.nc"):
        np.testing.assert_array_equal(read(tmp_path / name), [10.5, 11.0, 11.5])
        with pytest.raises(MeasurementError, match="1 of 3 values of 'hole' are NaN, infinite or"):
            read(tmp_path / name, "hole")


def test_netcdf_4_of_xarray_is_read(tmp_path: Path) -> None:
    pytest.importorskip("h5netcdf")
    import xarray as xr

    xr.Dataset({"a": (("x", "y"), VALUES)}).to_netcdf(tmp_path / "x.nc", engine="h5netcdf")
    np.testing.assert_array_equal(read(tmp_path / "x.nc"), VALUES)


def test_values_that_are_not_finite_are_told_in_every_format(tmp_path: Path) -> None:
    bad = np.array([1.0, np.nan, np.inf])
    np.save(tmp_path / "a.npy", bad)
    np.savez(tmp_path / "a.npz", a=bad)
    scipy.io.savemat(tmp_path / "a.mat", {"a": bad})
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["a"] = bad
    for suffix in ("npy", "npz", "mat", "h5"):
        with pytest.raises(MeasurementError, match=rf"a\.{suffix}: 2 of 3 values .* are NaN"):
            read(tmp_path / f"a.{suffix}", None if suffix == "npy" else "a")


def test_an_archive_that_promises_more_than_a_measurement_is_refused(tmp_path: Path) -> None:
    from mmslam.formats.numpy_files import npz_arrays

    np.savez_compressed(tmp_path / "bomb.npz", a=np.zeros(100_000))  # packs to some hundred bytes
    with pytest.raises(MeasurementError, match="800128 bytes unpacked, more than 16000"):
        npz_arrays(tmp_path / "bomb.npz", largest=1000)


def test_csv_rows_may_come_in_any_order_with_any_delimiter(tmp_path: Path) -> None:
    rows = ["2;20;220", "1;10;110", "2;10;210", "1;20;120"]
    (tmp_path / "a.csv").write_text("# a remark\nx;f;a\n" + "\n".join(rows) + "\n")
    np.testing.assert_array_equal(read(tmp_path / "a.csv"), [[210, 220], [110, 120]])
    np.testing.assert_array_equal(read(tmp_path / "a.csv", "f"), [10, 20])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x,f,a\n1,10,5\n1,20\n", "truncated|columns"),
        ("x,f,a\n1,10,5\n1,20,6\n2,10,7\n", "no row for x = 2, f = 20 .3 rows for 4 pairs"),
        ("x,f,a\n1,10,5\n2,20,6\n2,10,7\n", "no row for x = 1, f = 20"),
        ("x,f,a\n1,10,5\n1,20,6\n1,20,7\n", "2 rows for x = 1, f = 20"),
        ("x,f,a\n1,10,5\n1,20,nan\n", "row 2 after the header: a is nan"),
        ("x,f,a\n1,10,five\n", "could not convert string 'five'"),
        ("1,10,5\n1,20,6\n", r"names no column .* found: 0, 1, 2"),
        ("x,f,f\n1,10,5\n", "it must name the columns"),
        ("q,r,a\n1,10,5\n", r"names no column of frequency or position \(named: f, x; found"),
        ("", "it must name the columns"),
    ],
)
def test_a_table_that_fills_no_grid_is_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(MeasurementError, match=message):
        read(tmp_path / "a.csv")


def test_a_variable_must_be_named_but_for_npy(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", VALUES)
    np.savez(tmp_path / "a.npz", a=VALUES)
    with pytest.raises(MeasurementError, match="leave variable out"):
        read(tmp_path / "a.npy", "a")
    with pytest.raises(MeasurementError, match="which of its arrays"):
        read(tmp_path / "a.npz", None)
