import base64
import zlib
from typing import Any

import numpy as np
import pytest

from mmslam.results.page.level_codes import coded_levels


def decoded(coded: dict[str, Any]) -> np.ndarray:
    """Return the levels as the page has them, first axis first. [dB]."""
    shape = [axis["count"] for axis in coded["axes"].values()]
    codes = np.frombuffer(zlib.decompress(base64.b64decode(coded["codes"])), dtype=np.uint8)
    levels = coded["floor_db"] * (255.0 - codes) / 254
    return np.where(codes == 0, np.nan, levels).reshape(shape, order="F")


def test_levels_come_back_to_half_a_step() -> None:
    rng = np.random.default_rng(1)
    values = rng.normal(size=(40, 30)) + 1j * rng.normal(size=(40, 30))
    axes = {"x": np.linspace(0, 1, 40), "y": np.linspace(2, 3, 30)}
    levels = decoded(coded_levels(values, axes, floor_db=-60.0, most=100))
    true = np.maximum(20 * np.log10(np.abs(values) / np.abs(values).max()), -60.0)
    np.testing.assert_allclose(levels, true, atol=0.5 * 60 / 254 * 1.001)


def test_a_point_survives_the_reduction_at_its_place() -> None:
    values = np.full((1000, 900, 5), 1e-3)
    values[603, 77, 2] = 1.0
    axes = {"x": np.arange(1000) * 0.001, "y": np.arange(900) * 0.001, "z": np.arange(5) * 0.1}
    coded = coded_levels(values, axes, floor_db=-60.0, most=100)
    levels = decoded(coded)
    assert levels.shape == (100, 100, 5)
    place = np.unravel_index(int(np.nanargmax(levels)), levels.shape)
    for name, index, true in zip("xyz", place, (0.603, 0.077, 0.2), strict=True):
        axis = coded["axes"][name]
        assert abs(axis["first"] + index * axis["step"] - true) <= 0.5 * axis["step"]


def test_where_nothing_was_imaged_there_is_no_level() -> None:
    values = np.array([[0.0, 1.0], [1e-9, 0.0]])
    axes = {"x": np.array([0.0, 1.0]), "y": np.array([0.0, 1.0])}
    levels = decoded(coded_levels(values, axes, floor_db=-60.0, most=9))
    np.testing.assert_equal(levels, [[np.nan, 0.0], [-60.0, np.nan]])


def test_an_empty_image_is_all_unknown() -> None:
    axes = {"x": np.array([0.0, 1.0]), "y": np.array([0.0])}
    coded = coded_levels(np.zeros((2, 1)), axes, floor_db=-60.0, most=9)
    assert coded["peak_db"] is None
    assert np.isnan(decoded(coded)).all()


def test_the_peak_is_told_over_a_unit_point() -> None:
    axes = {"x": np.array([0.0]), "y": np.array([0.0])}
    coded = coded_levels(np.array([[0.1]]), axes, floor_db=-60.0, most=9)
    assert coded["peak_db"] == pytest.approx(-20.0)
