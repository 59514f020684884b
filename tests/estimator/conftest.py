"""A world of points in closed form: it shares no code with the simulator, and no physics."""

from collections.abc import Callable

import numpy as np
import pytest
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.imaging.survey_3d import VolumeSurvey
from estimator.measurement.model import Echo

BAND = np.linspace(220e9, 295e9, 251)  # 0.5 m of unambiguous echo range, 1 m of path

Points = Float[np.ndarray, "points 3"]


def linear_array(count: int = 96, spacing: float = 0.5e-3) -> Float[np.ndarray, "positions 3"]:
    positions = np.zeros((count, 3))
    positions[:, 0] = (np.arange(count) - (count - 1) / 2) * spacing
    return positions


def rough_line(
    middle: tuple[float, float],
    angle_deg: float,
    length: float,
    rng: np.random.Generator,
    *,
    count: int = 1000,
    rms: float = 0.05e-3,
) -> Points:
    """Points thrown on a line: several for each resolution cell of 2 to 3 mm make speckle."""
    along = np.array([np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg)), 0.0])
    normal = np.array([along[1], -along[0], 0.0])
    places = length * (rng.random(count) - 0.5)
    heights = rms * rng.standard_normal(count)
    centre = np.array([*middle, 0.0])
    return np.asarray(centre + places[:, None] * along + heights[:, None] * normal)


def noisy(
    samples: Complex[np.ndarray, "channels freqs"], snr_db: float, rng: np.random.Generator
) -> Complex[np.ndarray, "channels freqs"]:
    level = np.sqrt(np.mean(np.abs(samples) ** 2) / 2) * 10 ** (-snr_db / 20)
    parts = rng.standard_normal((2, *samples.shape))
    return np.asarray(samples + level * (parts[0] + 1j * parts[1]))


def echo_of_points(
    points: Points,
    rng: np.random.Generator,
    *,
    positions: Float[np.ndarray, "positions 3"] | None = None,
    frequencies: Float[np.ndarray, " freqs"] = BAND,
    snr_db: float = 20.0,
) -> Echo:
    """Echo of points of random strength, each 1/r² · exp(−2jkr), with noise."""
    places = linear_array() if positions is None else positions
    wavenumbers = 2 * np.pi * frequencies / speed_of_light
    strengths = rng.standard_normal(len(points)) + 1j * rng.standard_normal(len(points))
    samples = np.empty((len(places), frequencies.size), dtype=np.complex128)
    for row, place in zip(samples, places, strict=True):
        ranges = np.linalg.norm(points - place, axis=-1)
        waves = strengths / ranges**2 * np.exp(-2j * wavenumbers[0] * ranges)
        # The frequencies are uniform: one more step is one more turn of each wave.
        turns = np.exp(-2j * (wavenumbers[1] - wavenumbers[0]) * ranges)
        for column in range(frequencies.size):
            row[column] = waves.sum()
            waves *= turns
    return Echo(samples=noisy(samples, snr_db, rng), positions=places, frequencies=frequencies)


def pilot_of_point(
    source: Float[np.ndarray, " 3"],
    *,
    positions: Float[np.ndarray, "positions 3"] | None = None,
    frequencies: Float[np.ndarray, " freqs"] = BAND,
    extra: float = 0.0,
) -> Complex[np.ndarray, "positions freqs"]:
    """Pilot of an isotropic source, its phase delayed by an extra length before it. [m]"""
    places = linear_array() if positions is None else positions
    distances = np.linalg.norm(source - places, axis=-1)[:, None]
    wavelengths = speed_of_light / frequencies
    phase = np.exp(-2j * np.pi * (distances + extra) / wavelengths)
    return np.asarray(wavelengths / (4 * np.pi * distances) * phase)


def volume_of_a_blob(
    place: Float[np.ndarray, " 3"], width: float, ranges: Float[np.ndarray, " ranges"]
) -> VolumeSurvey:
    """A volume within 0.4 of broadside that shows one Gaussian blob of this width, and no noise."""
    cosines = np.linspace(-0.4, 0.4, 81)
    axes = np.meshgrid(ranges, cosines, cosines, indexing="ij")
    ahead = np.sqrt(1 - axes[1] ** 2 - axes[2] ** 2)
    points = axes[0][..., None] * np.stack([axes[1], ahead, axes[2]], axis=-1)
    spread = np.linalg.norm(points - place, axis=-1)
    return VolumeSurvey(
        values=np.exp(-((spread / width) ** 2)).astype(np.complex128),
        ranges=ranges,
        along=cosines,
        up=cosines,
        carrier=0.0,
        background=1e-9,
        peaks=place[None],
        lobes=np.zeros((0, 3)),
    )


class World:
    """What the tests of the estimator measure."""

    band: Float[np.ndarray, " freqs"] = BAND
    array: Callable[..., Float[np.ndarray, "positions 3"]] = staticmethod(linear_array)
    rough_line: Callable[..., Points] = staticmethod(rough_line)
    noisy: Callable[..., Complex[np.ndarray, "channels freqs"]] = staticmethod(noisy)
    echo: Callable[..., Echo] = staticmethod(echo_of_points)
    pilot: Callable[..., Complex[np.ndarray, "positions freqs"]] = staticmethod(pilot_of_point)
    volume: Callable[..., VolumeSurvey] = staticmethod(volume_of_a_blob)


@pytest.fixture(scope="session")
def world() -> World:
    return World()
