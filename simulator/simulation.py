"""From a scenario to a measurement: frozen surfaces, echo, uplink, noise, and the truth."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import xarray as xr
from jaxtyping import Complex

from estimator.measurement import Echo, Measurement, Uplink
from scenes.random_streams import random_stream
from scenes.scenario import Scenario, ScenarioError
from simulator.echo import simulate_echo
from simulator.impairments import thermal_noise
from simulator.radio_scene import facet_ports, radio_scene
from simulator.truth import scenario_truth
from simulator.uplink import simulate_uplink

Progress = Callable[[str, int, int], None]
"""Called with the name of a stage, the steps done and the steps in all."""


@dataclass(frozen=True, kw_only=True)
class Simulation:
    """A simulated measurement and the truth behind it."""

    measurement: Measurement
    truth: xr.Dataset


def simulate(
    scenario: Scenario, *, seed: int, sample: int = 0, progress: Progress | None = None
) -> Simulation:
    """Simulate the measurement of a scenario.

    Parameters
    ----------
    scenario
        The truth: radio, base station, objects, users, noise.
    seed, sample
        Which realisation of roughness and noise; each of them is a stream of its own.
    progress
        Called with a stage, the steps done and the steps in all.

    Raises
    ------
    ScenarioError
        If nothing at all is received.
    """
    scene = radio_scene(scenario, seed=seed, sample=sample)
    station, frequencies = scenario.base_station, scenario.radio.frequencies
    elements = station.element_positions
    array = facet_ports(scene, scene.facets, station.antenna, elements) if scene.facets else None
    echo = simulate_echo(scene, array, advance=_counter("echo", len(elements), progress))
    signals = {"echo": echo}
    for name, user in scenario.users.items():
        advance = _counter(f"uplink of {name}", len(elements), progress)
        signals[f"uplink/{name}"] = simulate_uplink(scene, user, array, advance=advance)
    received = _received(signals, scenario, seed=seed, sample=sample)
    measurement = Measurement(
        echo=Echo(samples=received["echo"], positions=elements, frequencies=frequencies)
        if "echo" in received
        else None,
        uplinks=tuple(
            Uplink(samples=pilot, positions=elements, frequencies=frequencies, user=name)
            for name in scenario.users
            if (pilot := received.get(f"uplink/{name}")) is not None
        ),
        waves=scenario.waves,
        boresight=station.boresight,
        clock_offset=0.0,
        scenario=scenario.name,
        seed=seed,
    )
    return Simulation(measurement=measurement, truth=scenario_truth(scenario))


def _received(
    signals: dict[str, Complex[np.ndarray, "channels freqs"]],
    scenario: Scenario,
    *,
    seed: int,
    sample: int,
) -> dict[str, Complex[np.ndarray, "channels freqs"]]:
    """Add the noise; a silent array gets that of the quietest other, or is left out without.

    Noise relative to no signal has no level of its own, but all arrays share a receiver.
    """
    powers = {name: float(np.mean(np.abs(values) ** 2)) for name, values in signals.items()}
    heard = {name: power for name, power in powers.items() if power > 0}
    if not heard:
        raise ScenarioError(
            f"scenario {scenario.name!r}: no object of metal and no user is seen by the array, "
            "so nothing is received; add an object or a user, or move what blocks them"
        )
    snr_db = scenario.noise.snr_db
    if np.isinf(snr_db):
        return {name: signals[name] for name in heard}
    received = {}
    for name, values in signals.items():
        rng = random_stream(seed, sample, f"noise/{name}")
        if name in heard:
            received[name] = thermal_noise(values, snr_db=snr_db, rng=rng)
        else:
            level = np.full(values.shape, np.sqrt(min(heard.values())), dtype=np.complex128)
            received[name] = thermal_noise(level, snr_db=snr_db, rng=rng) - level
    return received


def _counter(stage: str, steps: int, progress: Progress | None) -> Callable[[], None]:
    done = 0

    def advance() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(stage, done, steps)

    return advance
