"""Import of files that a test wrote, and the echo that those of one point hold."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.measurement.model import Echo
from mmslam.formats.import_measured import Import, import_measured
from mmslam.formats.mapping import load_mapping

TARGET = np.array([0.013, 0.21, -0.008])  # [m]
FREQUENCIES = np.linspace(30e9, 34e9, 21)  # [Hz]


@pytest.fixture
def take() -> Callable[[Path, str, str], Import]:
    """Import a file or folder by the text of its mapping."""
    return _take


@pytest.fixture
def taken() -> Callable[[Path, str, str], Echo]:
    """Import a file or folder by the text of its mapping; its echo."""

    def echo(folder: Path, name: str, mapping: str) -> Echo:
        found = _take(folder, name, mapping).measurement.echo
        assert found is not None
        return found

    return echo


@pytest.fixture
def echo_of() -> Callable[..., np.ndarray]:
    """The echo of one point at positions [m] and, if given, frequencies [Hz]."""

    def echo(positions: np.ndarray, frequencies: np.ndarray = FREQUENCIES) -> np.ndarray:
        distance = np.linalg.norm(positions - TARGET, axis=1)[:, None]
        return np.asarray(0.1 * np.exp(-4j * np.pi * frequencies * distance / speed_of_light))

    return echo


def _take(folder: Path, name: str, mapping: str) -> Import:
    (folder / "mapping.toml").write_text(mapping, encoding="utf-8")
    return import_measured(folder / name, load_mapping(folder / "mapping.toml"), base=folder)
