"""From noise-free signals to what the radio records: its gain, clock, noise and converter."""

import numpy as np
from jaxtyping import Complex

from scenes.random_streams import random_stream
from scenes.scenario import Scenario, ScenarioError
from simulator.receiver.impairments import (
    clock_offset,
    complex_noise,
    gain_ripple,
    limited_dynamic_range,
    phase_noise,
    thermal_noise,
)

Signals = dict[str, Complex[np.ndarray, "channels freqs"]]
"""Samples of each array: ``echo`` and ``uplink/<user>``."""


def received(signals: Signals, scenario: Scenario, *, seed: int, sample: int) -> Signals:
    """Record the signals: ripple, phase noise, clock, thermal noise, dynamic range, in turn.

    A silent array gets the noise of the quietest other, or is left out where there is none:
    noise relative to no signal has no level of its own, but all arrays share a receiver. A noise
    floor is the same for all arrays.

    Parameters
    ----------
    signals
        Noise-free samples of each array. [-]
    scenario
        Says what the radio adds.
    seed, sample
        Which realisation; each impairment of each array has a stream of its own.

    Raises
    ------
    ScenarioError
        If nothing at all is received.
    """
    signals = {
        name: _distorted(name, values, scenario, seed=seed, sample=sample)
        for name, values in signals.items()
    }
    recorded = _noisy(signals, scenario, seed=seed, sample=sample)
    limit = scenario.impairments.dynamic_range_db
    if limit is None:
        return recorded
    return {
        name: limited_dynamic_range(values, dynamic_range_db=limit)
        for name, values in recorded.items()
    }


def _distorted(
    name: str,
    values: Complex[np.ndarray, "channels freqs"],
    scenario: Scenario,
    *,
    seed: int,
    sample: int,
) -> Complex[np.ndarray, "channels freqs"]:
    radio, flaws = scenario.radio, scenario.impairments
    if flaws.gain_ripple_db > 0 and flaws.gain_ripple_ghz is not None:
        # One line for all arrays: the same stream, and so the same phase.
        values = gain_ripple(
            values,
            radio.frequencies,
            peak_db=flaws.gain_ripple_db,
            period=flaws.gain_ripple_ghz * 1e9,
            rng=random_stream(seed, sample, "gain_ripple"),
        )
    if flaws.phase_noise_deg > 0:
        values = phase_noise(
            values,
            rms=float(np.radians(flaws.phase_noise_deg)),
            correlation=flaws.phase_noise_samples,
            rng=random_stream(seed, sample, f"phase_noise/{name}"),
        )
    if name != "echo" and flaws.clock_offset != 0:
        values = clock_offset(values, radio.frequencies, offset=flaws.clock_offset)
    return values


def _noisy(signals: Signals, scenario: Scenario, *, seed: int, sample: int) -> Signals:
    powers = {name: float(np.mean(np.abs(values) ** 2)) for name, values in signals.items()}
    heard = {name: power for name, power in powers.items() if power > 0}
    if not heard:
        raise ScenarioError(
            f"scenario {scenario.name!r}: no reflecting object and no user is seen by the array, "
            "so nothing is received; add an object or a user, or move what blocks them"
        )
    floor = scenario.noise.floor
    if floor is not None:  # the same receiver for all, also where nothing is heard
        return {
            name: values
            + complex_noise(values.shape, floor, random_stream(seed, sample, f"noise/{name}"))
            for name, values in signals.items()
        }
    snr_db = scenario.noise.snr_db
    if np.isinf(snr_db):
        return {name: signals[name] for name in heard}
    recorded = {}
    for name, values in signals.items():
        rng = random_stream(seed, sample, f"noise/{name}")
        if name in heard:
            recorded[name] = thermal_noise(values, snr_db=snr_db, rng=rng)
        else:
            variance = min(heard.values()) / 10 ** (snr_db / 10)
            recorded[name] = complex_noise(values.shape, variance, rng)
    return recorded
