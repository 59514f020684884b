"""Scans of scenes without walls, drawn in closed form: points, letters, soil, offsets.

For the estimates by :func:`estimator.localization.pipeline.locate`, a mirror of high confidence is
false, and so is a target far from all scatterers.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.measurement.model import Echo, Measurement
from simulator.receiver.impairments import complex_noise

ScanKind = Literal["points", "letter", "soil", "offset", "multiples"]
KINDS: tuple[ScanKind, ...] = ("points", "letter", "soil", "offset", "multiples")

STROKE = 0.2
"""Width of the letter's strokes over its height: that of the scenario ``bench_3d``. [-]"""


@dataclass(frozen=True, kw_only=True)
class DrawnScan:
    """A scan and its scatterers."""

    kind: ScanKind
    planar: bool
    measurement: Measurement
    scatterers: Float[np.ndarray, "scatterers 3"]  # [m]


def letter_points(height: float, step: float) -> Float[np.ndarray, "points 3"]:
    """Sample the flat letter F, facing −y, its middle at the origin. [m]."""
    places = np.arange(-height / 2, height / 2, step) + step / 2
    x, z = np.meshgrid(places, places, indexing="ij")
    along, up, stroke = x + 0.3 * height, z + 0.5 * height, STROKE * height
    inside = (along >= 0) & (along < stroke)
    inside |= (up > 4 * stroke) & (along >= 0) & (along < 3 * stroke)
    inside |= (up > 2 * stroke) & (up < 3 * stroke) & (along >= 0) & (along < 2.3 * stroke)
    return np.stack([x[inside], np.zeros(int(inside.sum())), z[inside]], axis=-1)


def facing_echo(
    points: Float[np.ndarray, "points 3"],
    strengths: Complex[np.ndarray, " points"],
    positions: Float[np.ndarray, "positions 3"],
    frequencies: Float[np.ndarray, " freqs"],
) -> Complex[np.ndarray, "positions freqs"]:
    r"""Sum the elements of a surface that faces −y: :math:`\sum a \cos\theta\, e^{-2jkr} / r^2`.

    Frequencies must be uniform: phases advance by a constant factor for each element.
    """
    samples = np.zeros((len(positions), frequencies.size), dtype=np.complex128)
    step = 4 * np.pi * float(frequencies[1] - frequencies[0]) / speed_of_light
    start = 4 * np.pi * float(frequencies[0]) / speed_of_light
    for block in np.array_split(np.arange(len(points)), max(1, len(points) // 64)):
        away = points[block] - positions[:, None]
        distance = np.linalg.norm(away, axis=-1)
        field = strengths[block] * (away[..., 1] / distance**3) * np.exp(-1j * start * distance)
        turn = np.exp(-1j * step * distance)
        for index in range(frequencies.size):
            samples[:, index] += field.sum(axis=1)
            field *= turn
    return samples


def drawn_scan(kind: ScanKind, rng: np.random.Generator, *, planar: bool) -> DrawnScan:
    """Draw a scan: band, aperture, distance, scatterers, and an SNR of 20 to 40 dB.

    Parameters
    ----------
    kind
        Kind of scene. ``soil``: 600 scatterers uniform in a volume; ``multiples``: points, and a
        repetition of each at twice the distance.
    rng
        Source of all random numbers.
    planar
        Whether positions lie on a square or on a line.
    """
    low = rng.uniform(8e9, 60e9)
    band = low * rng.uniform(0.05, 0.3)
    shortest = speed_of_light / (low + band)
    count = int(rng.integers(16, 28)) if planar else int(rng.integers(40, 90))
    places = (np.arange(count) - (count - 1) / 2) * shortest / 4
    frequencies = np.linspace(low, low + band, int(rng.integers(16, 64)))
    if planar:
        x, z = np.meshgrid(places, places, indexing="ij")
        positions = np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=-1)
    else:
        positions = np.stack([places, 0 * places, 0 * places], axis=-1)
    farthest = 0.45 * speed_of_light * (frequencies.size - 1) / (2 * band)
    aperture = float(np.ptp(places))
    distance = float(np.exp(rng.uniform(np.log(0.4 * aperture), np.log(6 * aperture))))
    distance = min(distance, farthest)
    width = 0.8 * aperture
    if kind == "letter":
        points = letter_points(width, shortest / 4)
        strengths = np.ones(len(points), dtype=np.complex128)
    elif kind == "soil":
        number = 600
        points = rng.uniform(-1, 1, (number, 3)) * [1.5 * aperture, 0.3 * distance, 1.5 * aperture]
        strengths = complex_noise((number,), 1.0, rng)
    else:
        number = int(rng.integers(1, 6))
        points = rng.uniform(-1, 1, (number, 3)) * [0.5 * width, 0.2 * distance, 0.5 * width]
        strengths = np.exp(2j * np.pi * rng.random(number))
    if not planar:
        points[:, 2] = 0.0
    points = points + np.array([0.0, distance, 0.0])
    samples = facing_echo(points, strengths, positions, frequencies)
    if kind == "multiples":
        again = points * [1.0, 2.0, 1.0]
        samples = samples + 0.3 * facing_echo(again, 4 * strengths, positions, frequencies)
        points = np.concatenate([points, again])
    level = float(np.sqrt(np.mean(np.abs(samples) ** 2)))
    if kind == "offset":
        ripple = 1 + rng.uniform(0, 0.5) * np.cos(
            2 * np.pi * (frequencies - low) / (band * rng.uniform(0.3, 3)) + rng.uniform(0, 6)
        )
        delay = rng.uniform(0.0, farthest)
        turns = 2 * frequencies * delay / speed_of_light
        size = level * 10 ** (rng.uniform(-10, 60) / 20)
        samples = samples + size * ripple * np.exp(-2j * np.pi * turns)
    noise = level * 10 ** (-rng.uniform(20, 40) / 20)
    samples = samples + noise * complex_noise(samples.shape, 1.0, rng)
    echo = Echo(samples=samples, positions=positions, frequencies=frequencies)
    return DrawnScan(
        kind=kind,
        planar=planar,
        measurement=Measurement(echo=echo, uplinks=()),
        scatterers=points,
    )
