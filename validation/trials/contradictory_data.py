"""Measurements that contradict themselves; :mod:`validation.trials.contradictions` tries them.

Each contradiction is a fault of an instrument, of a mapping or of a recording, applied to a clean
measurement: a function of the measurement, of a size and of a random generator. The room stays as
it was, so that the truth does too. Scenes of reduced size, as in
:mod:`validation.trials.trap_rooms`: one estimate takes seconds.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from estimator.measurement.model import Echo, Measurement, Uplink
from validation.trials.trap_rooms import BEAM, HALF_SIZE, OPEN, post, user, wall

Data = TypeVar("Data", Echo, Uplink)
Fault = Callable[[Measurement, float, np.random.Generator], Measurement]

SCENES: dict[str, tuple[str, tuple[str, ...]]] = {
    "over a wall": (BEAM, (*HALF_SIZE, *user(0.45, 0.4))),
    "in sight": (OPEN, (*HALF_SIZE, *user(0.1, 0.2))),
    "posts": (
        OPEN,
        (*HALF_SIZE, *wall(-0.1, 0.36, 45.0, 0.16), *post("left", -0.12, 0.2, 0.003),
         *post("middle", 0.05, 0.32, 0.003), *user(0.12, 0.27)),
    ),
}  # fmt: skip
"""A user over a mirror, one in plain sight beside it, and one among posts."""


@dataclass(frozen=True, kw_only=True)
class Contradiction:
    """A fault, and the sizes that are tried."""

    fault: Fault
    sizes: tuple[float, ...]
    unit: str


def _echo(change: Callable[[Echo, float, np.random.Generator], Echo]) -> Fault:
    def fault(data: Measurement, size: float, rng: np.random.Generator) -> Measurement:
        assert data.echo is not None  # all scenes have one
        return replace(data, echo=change(data.echo, size, rng))

    return fault


def _pilot(change: Callable[[Uplink, float, np.random.Generator], Uplink]) -> Fault:
    def fault(data: Measurement, size: float, rng: np.random.Generator) -> Measurement:
        return replace(data, uplinks=tuple(change(one, size, rng) for one in data.uplinks))

    return fault


def _both(*faults: Fault) -> Fault:
    def fault(data: Measurement, size: float, rng: np.random.Generator) -> Measurement:
        for one in faults:
            data = one(data, size, rng)
        return data

    return fault


def _level(data: Echo | Uplink) -> float:
    """Root mean square of the samples. [-]."""
    return float(np.sqrt(np.mean(np.abs(data.samples) ** 2)))


def _noise(data: Echo | Uplink, shape: tuple[int, ...], rng: np.random.Generator) -> np.ndarray:
    """Draw complex noise of the data's own root mean square."""
    drawn = rng.standard_normal((2, *shape)) / np.sqrt(2)
    return np.asarray(_level(data) * (drawn[0] + 1j * drawn[1]))


def delayed(data: Data, nanoseconds: float, rng: np.random.Generator) -> Data:
    """Leave the delay of a cable in the samples."""
    return replace(
        data, samples=data.samples * np.exp(-2e-9j * np.pi * nanoseconds * data.frequencies)
    )


def scaled(data: Data, factor: float, rng: np.random.Generator) -> Data:
    """State the positions too far apart."""
    middle = data.positions.mean(axis=0)
    return replace(data, positions=middle + factor * (data.positions - middle))


def conjugated(data: Data, size: float, rng: np.random.Generator) -> Data:
    """Record with the other time convention."""
    return replace(data, samples=data.samples.conj())


def thinned(data: Data, step: float, rng: np.random.Generator) -> Data:
    """Keep every so many positions only."""
    kept = slice(None, None, int(step))
    return replace(data, samples=data.samples[kept], positions=data.positions[kept])


def shifted(data: Data, count: float, rng: np.random.Generator) -> Data:
    """Lose triggers halfway: later samples stand beside the positions of earlier ones."""
    lost, half = int(count), len(data.positions) // 2
    samples = np.concatenate([data.samples[:half], data.samples[half + lost :]])
    return replace(data, samples=samples, positions=data.positions[: len(samples)])


def toned(data: Data, decibels: float, rng: np.random.Generator) -> Data:
    """Add a tone at one frequency, with a phase that drifts from position to position."""
    samples = data.samples.copy()
    at = samples.shape[1] // 3
    phases = np.cumsum(0.5 * rng.standard_normal(len(samples)))
    samples[:, at] += _level(data) * 10 ** (decibels / 20) * np.exp(1j * phases)
    return replace(data, samples=samples)


def raised(data: Data, metres: float, rng: np.random.Generator) -> Data:
    """State positions that lie higher than the others' plane."""
    return replace(data, positions=data.positions + metres * np.array([0.0, 0.0, 1.0]))


def unequal_gains(data: Data, decibels: float, rng: np.random.Generator) -> Data:
    """Multiply each position by a gain of its own; 1 dB goes with 0.115 rad of phase."""
    nepers = decibels * np.log(10) / 20
    drawn = nepers * rng.standard_normal((2, len(data.samples)))
    return replace(data, samples=data.samples * np.exp(drawn[0] + 1j * drawn[1])[:, None])


def dead_positions(data: Data, share: float, rng: np.random.Generator) -> Data:
    """Let a share of the positions receive next to nothing."""
    bad = rng.random(len(data.samples)) < share
    samples = data.samples.copy()
    samples[bad] = 1e-3 * _noise(data, samples[bad].shape, rng)
    return replace(data, samples=samples)


def hot_positions(data: Data, share: float, rng: np.random.Generator) -> Data:
    """Add noise 20 dB over the signal to a share of the positions."""
    bad = rng.random(len(data.samples)) < share
    samples = data.samples.copy()
    samples[bad] += 10 * _noise(data, samples[bad].shape, rng)
    return replace(data, samples=samples)


def hot_frequencies(data: Data, share: float, rng: np.random.Generator) -> Data:
    """Add noise 20 dB over the signal to a share of the frequencies."""
    bad = rng.random(data.samples.shape[1]) < share
    samples = data.samples.copy()
    samples[:, bad] += 10 * _noise(data, samples[:, bad].shape, rng)
    return replace(data, samples=samples)


def clipped(data: Data, depth: float, rng: np.random.Generator) -> Data:
    """Clip real and imaginary part at the largest value of the record over a depth."""
    top = max(float(np.abs(data.samples.real).max()), float(np.abs(data.samples.imag).max()))
    limit = top / depth
    samples = data.samples.real.clip(-limit, limit) + 1j * data.samples.imag.clip(-limit, limit)
    return replace(data, samples=samples)


def nobody_sends(data: Uplink, decibels: float, rng: np.random.Generator) -> Uplink:
    """Record noise, and a leak with one phase for all frequencies that drifts."""
    noise = _noise(data, data.samples.shape, rng)
    phases = np.cumsum(0.3 * rng.standard_normal(len(noise)))
    leak = _level(data) * 10 ** (decibels / 20) * np.exp(1j * phases)
    return replace(data, samples=noise + leak[:, None])


def pilot_as_echo(data: Measurement, size: float, rng: np.random.Generator) -> Measurement:
    """Map the pilot's samples as the echo, too."""
    assert data.echo is not None
    return replace(data, echo=replace(data.echo, samples=data.uplinks[0].samples))


def clock_unknown(data: Measurement, size: float, rng: np.random.Generator) -> Measurement:
    """Leave the user's clock open."""
    return replace(data, clock_offset=None)


CONTRADICTIONS: dict[str, Contradiction] = {
    "none": Contradiction(fault=lambda data, size, rng: data, sizes=(0.0,), unit=""),
    "echo delayed": Contradiction(fault=_echo(delayed), sizes=(0.003, 0.03, 0.1, 1.0), unit="ns"),
    "pilot delayed": Contradiction(fault=_pilot(delayed), sizes=(0.003, 0.03, 0.1, 1.0), unit="ns"),
    "positions scaled": Contradiction(
        fault=_both(_echo(scaled), _pilot(scaled)), sizes=(1.001, 1.01, 1.1), unit="times"
    ),
    "echo conjugated": Contradiction(fault=_echo(conjugated), sizes=(1.0,), unit=""),
    "pilot conjugated": Contradiction(fault=_pilot(conjugated), sizes=(1.0,), unit=""),
    "other time convention": Contradiction(
        fault=_both(_echo(conjugated), _pilot(conjugated)), sizes=(1.0,), unit=""
    ),
    "other convention, clock unknown": Contradiction(
        fault=_both(_echo(conjugated), _pilot(conjugated), clock_unknown), sizes=(1.0,), unit=""
    ),
    "positions dropped": Contradiction(
        fault=_both(_echo(thinned), _pilot(thinned)), sizes=(2.0, 4.0), unit="th kept"
    ),
    "echo's triggers lost": Contradiction(fault=_echo(shifted), sizes=(1.0, 8.0), unit="positions"),
    "pilot's triggers lost": Contradiction(
        fault=_pilot(shifted), sizes=(1.0, 8.0), unit="positions"
    ),
    "tone in the echo": Contradiction(fault=_echo(toned), sizes=(10.0, 30.0, 60.0), unit="dB"),
    "tone in the pilot": Contradiction(fault=_pilot(toned), sizes=(10.0, 30.0, 60.0), unit="dB"),
    "pilot's antennas higher": Contradiction(fault=_pilot(raised), sizes=(0.01, 0.1), unit="m"),
    "gains differ in the echo": Contradiction(
        fault=_echo(unequal_gains), sizes=(0.5, 2.0, 6.0), unit="dB"
    ),
    "gains differ in the pilot": Contradiction(
        fault=_pilot(unequal_gains), sizes=(0.5, 2.0, 6.0), unit="dB"
    ),
    "dead positions in the echo": Contradiction(
        fault=_echo(dead_positions), sizes=(0.02, 0.2, 0.5), unit="share"
    ),
    "dead positions in the pilot": Contradiction(
        fault=_pilot(dead_positions), sizes=(0.02, 0.2, 0.5), unit="share"
    ),
    "hot positions in the echo": Contradiction(
        fault=_echo(hot_positions), sizes=(0.02, 0.2), unit="share"
    ),
    "hot positions in the pilot": Contradiction(
        fault=_pilot(hot_positions), sizes=(0.02, 0.2), unit="share"
    ),
    "hot frequencies in the echo": Contradiction(
        fault=_echo(hot_frequencies), sizes=(0.02, 0.2), unit="share"
    ),
    "hot frequencies in the pilot": Contradiction(
        fault=_pilot(hot_frequencies), sizes=(0.02, 0.2), unit="share"
    ),
    "echo clipped": Contradiction(fault=_echo(clipped), sizes=(2.0, 10.0), unit="times"),
    "pilot clipped": Contradiction(fault=_pilot(clipped), sizes=(2.0, 10.0), unit="times"),
    "nobody sends": Contradiction(fault=_pilot(nobody_sends), sizes=(0.0, 20.0, 40.0), unit="dB"),
    "pilot mapped as echo": Contradiction(fault=pilot_as_echo, sizes=(1.0,), unit=""),
}
"""By name."""

BESIDE: dict[str, tuple[str, ...]] = {
    "pilot 10 mm beside": ("base_station.position_m=[0.01, 0.0]",),
    "pilot 20 mm in front": ("base_station.position_m=[0.0, 0.02]",),
}
"""Data that are right: a pilot received by elements that stand elsewhere than the echo's."""
