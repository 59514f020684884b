from pathlib import Path

import numpy as np
import pytest

from estimator.measurement.model import MeasurementError
from mmslam.formats.import_full_wave import import_npz


@pytest.fixture
def arrays() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    shape = (4, 5)
    samples = {
        name: (rng.normal(size=shape) + 1j * rng.normal(size=shape)).astype(np.complex64)
        for name in ("echo", "uplink_isotropic", "uplink_beam")
    }
    along = np.linspace(-0.2, 0.2, 401)
    heights = 1e-4 * rng.normal(size=along.size)
    profile = np.stack([along - heights, 0.8 + along + heights, np.zeros_like(along)], axis=-1)
    return samples | {
        "aperture_position": np.stack([np.arange(4.0) * 1e-3, np.zeros(4), np.zeros(4)], axis=-1),
        "frequency": np.linspace(220e9, 222e9, 5),
        "user_position": np.array([1.0, 0.8, 0.0]),
        "wall_profile": profile,
    }


def write(folder: Path, arrays: dict[str, np.ndarray]) -> Path:
    path = folder / "reference.npz"
    np.savez(path, allow_pickle=False, **arrays)
    return path


def test_the_samples_are_taken_as_they_are_in_cylindrical_waves(
    tmp_path: Path, arrays: dict[str, np.ndarray]
) -> None:
    measurement = import_npz(write(tmp_path, arrays)).measurement
    assert measurement.waves == "cylindrical"
    assert measurement.clock_offset == 0.0
    assert measurement.echo is not None
    np.testing.assert_array_equal(measurement.echo.samples, arrays["echo"])
    np.testing.assert_array_equal(measurement.uplinks[0].samples, arrays["uplink_beam"])


def test_the_uplink_is_chosen_by_name(tmp_path: Path, arrays: dict[str, np.ndarray]) -> None:
    chosen = import_npz(write(tmp_path, arrays), uplink="uplink_isotropic").measurement
    np.testing.assert_array_equal(chosen.uplinks[0].samples, arrays["uplink_isotropic"])
    with pytest.raises(MeasurementError, match="there are: uplink_beam, uplink_isotropic"):
        import_npz(write(tmp_path, arrays), uplink="uplink_horn")


def test_a_reference_without_uplink_or_user_is_an_echo_alone(
    tmp_path: Path, arrays: dict[str, np.ndarray]
) -> None:
    for name in ("uplink_isotropic", "uplink_beam", "user_position", "wall_profile"):
        del arrays[name]
    imported = import_npz(write(tmp_path, arrays))
    assert imported.measurement.uplinks == ()
    assert imported.truth is None


def test_the_true_wall_is_the_mean_line_of_the_rough_profile(
    tmp_path: Path, arrays: dict[str, np.ndarray]
) -> None:
    truth = import_npz(write(tmp_path, arrays)).truth
    assert truth is not None
    start, end = truth["wall_start"].values[0], truth["wall_end"].values[0]
    direction = (end - start) / np.linalg.norm(end - start)
    # A line fit over n independent heights of rms h (across the wall) and length L has the
    # angle's deviation h √(12/n) / L, and the centre's h / √n; four of them.
    n, height, length = 401, 1e-4 * np.sqrt(2), 0.4 * np.sqrt(2)
    angle = np.arctan2(direction[1], direction[0])
    assert angle == pytest.approx(np.pi / 4, abs=4 * height * np.sqrt(12 / n) / length)
    across = np.array([-direction[1], direction[0], 0.0])
    centre = np.array([0.0, 0.8, 0.0]) - start
    assert across @ centre == pytest.approx(0.0, abs=4 * height / np.sqrt(n))
    assert np.linalg.norm(end - start) == pytest.approx(length, abs=4 * height)


@pytest.mark.parametrize("missing", ["frequency", "aperture_position"])
def test_a_missing_array_is_named(
    tmp_path: Path, arrays: dict[str, np.ndarray], missing: str
) -> None:
    del arrays[missing]
    with pytest.raises(MeasurementError, match=f"array '{missing}' is missing"):
        import_npz(write(tmp_path, arrays))


def test_neither_echo_nor_uplink_is_refused(tmp_path: Path, arrays: dict[str, np.ndarray]) -> None:
    for name in ("echo", "uplink_isotropic", "uplink_beam"):
        del arrays[name]
    with pytest.raises(MeasurementError, match="neither"):
        import_npz(write(tmp_path, arrays))


@pytest.mark.parametrize(
    ("name", "shape"),
    [
        ("echo", (5, 4)),
        ("uplink_beam", (4,)),
        ("aperture_position", (4, 2)),
        ("frequency", (5, 1)),
        ("user_position", (1, 3)),
    ],
)
def test_a_wrong_shape_is_named_with_the_right_one(
    tmp_path: Path, arrays: dict[str, np.ndarray], name: str, shape: tuple[int, ...]
) -> None:
    arrays[name] = np.zeros(shape, dtype=arrays[name].dtype)
    with pytest.raises(MeasurementError, match=rf"'{name}' has shape .* it must be"):
        import_npz(write(tmp_path, arrays))


def test_real_samples_are_refused(tmp_path: Path, arrays: dict[str, np.ndarray]) -> None:
    arrays["echo"] = arrays["echo"].real
    with pytest.raises(MeasurementError, match="must be complex"):
        import_npz(write(tmp_path, arrays))


def test_positions_that_are_not_finite_are_refused(
    tmp_path: Path, arrays: dict[str, np.ndarray]
) -> None:
    arrays["wall_profile"][3, 1] = np.nan
    with pytest.raises(MeasurementError, match="finite real numbers"):
        import_npz(write(tmp_path, arrays))


def test_an_uneven_frequency_grid_is_refused(tmp_path: Path, arrays: dict[str, np.ndarray]) -> None:
    arrays["frequency"][2] *= 1.001
    with pytest.raises(MeasurementError, match="not uniform"):
        import_npz(write(tmp_path, arrays))


def test_pickled_objects_are_never_loaded(tmp_path: Path) -> None:
    path = tmp_path / "evil.npz"
    np.savez(path, echo=np.array([{"a": 1}], dtype=object))
    with pytest.raises(MeasurementError, match="pickled objects are never loaded"):
        import_npz(path)


def test_what_is_no_archive_is_told_so(tmp_path: Path) -> None:
    with pytest.raises(MeasurementError, match="no such file"):
        import_npz(tmp_path / "absent.npz")
    (tmp_path / "text.npz").write_text("hello")
    with pytest.raises(MeasurementError, match=r"not a NumPy \.npz archive"):
        import_npz(tmp_path / "text.npz")
