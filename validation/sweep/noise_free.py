"""Cache of noise-free measurements: the part independent of noise is simulated once.

A measurement consists of the received fields (the scene, its roughness, true antenna positions)
and the receiver's impairments (noise, drift, clock, converter). The former take seconds and are
stored under a digest of all that they depend on, code included; the latter are drawn each time.
Together they equal the result of :func:`simulator.simulation.simulate`, bit for bit.
"""

import fcntl
import hashlib
import json
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from estimator.measurement.model import Echo, Measurement, MeasurementError, Uplink
from estimator.measurement.store import read_measurement, write_measurement
from scenes.files.loading import scenario_to_toml
from scenes.scenario import Noise, Scenario
from scenes.schema.impairments import Impairments
from simulator.dataset.config import content_text
from simulator.dataset.provenance import code_digest, package_versions
from simulator.receiver.receiver import received


def without_receiver(scenario: Scenario) -> Scenario:
    """Return the scenario with an ideal receiver, and the same true antenna positions."""
    jitter = scenario.impairments.position_jitter_mm
    quiet = {"noise": Noise(), "impairments": Impairments(position_jitter_mm=jitter)}
    return scenario.model_copy(update=quiet)


def noise_free_key(scenario: Scenario, *, seed: int, sample: int) -> str:
    """Return a digest of all that a noise-free measurement depends on."""
    return content_key(
        without_receiver(scenario), seed=seed, sample=sample, packages=("scenes", "simulator")
    )


def content_key(scenario: Scenario, *, seed: int, sample: int, packages: tuple[str, ...]) -> str:
    """Return a digest of a scenario, its files, the realisation and the code that computes.

    Parameters
    ----------
    scenario, seed, sample
        Of the computation.
    packages
        Our packages on whose code it depends.
    """
    content = {
        "scenario": content_text(tomllib.loads(scenario_to_toml(scenario))),
        "seed": seed,
        "sample": sample,
        "versions": package_versions(),
        "code": code_digest(packages),
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:32]


def noise_free(scenario: Scenario, *, seed: int, sample: int, folder: Path) -> Measurement:
    """Return a scenario's noise-free measurement, from the cache if it is there.

    Parameters
    ----------
    scenario, seed, sample
        As for :func:`simulator.simulation.simulate`; the receiver's part is left out.
    folder
        The cache. A store that cannot be read is simulated again; if two processes need the same
        one, only one simulates it.
    """
    path = folder / f"{noise_free_key(scenario, seed=seed, sample=sample)}.zarr"
    with _locked(path.with_suffix(".lock")):
        if path.exists():
            try:
                return read_measurement(path)
            except MeasurementError:
                pass  # for instance, incomplete after a power failure
        from simulator.simulation import simulate  # Sionna's import takes seconds

        made = simulate(without_receiver(scenario), seed=seed, sample=sample).measurement
        write_measurement(path, made)
        return made


def with_receiver(quiet: Measurement, scenario: Scenario, *, seed: int, sample: int) -> Measurement:
    """Add the impairments of the scenario's receiver to a noise-free measurement.

    Parameters
    ----------
    quiet
        As :func:`noise_free` returns it.
    scenario, seed, sample
        As given there; noise, drift, clock and converter are the scenario's.
    """
    elements, frequencies = scenario.base_station.element_positions, scenario.radio.frequencies
    silent = np.zeros((len(elements), len(frequencies)), dtype=np.complex128)
    pilots = {uplink.user: uplink.samples for uplink in quiet.uplinks}
    signals = {"echo": silent if quiet.echo is None else quiet.echo.samples}
    signals |= {f"uplink/{name}": pilots.get(name, silent) for name in scenario.users}
    recorded = received(signals, scenario, seed=seed, sample=sample)
    flaws = scenario.impairments
    echo = quiet.echo
    if "echo" in recorded:
        echo = Echo(
            samples=recorded["echo"],
            positions=elements,
            frequencies=frequencies,
            transmit_positions=scenario.base_station.transmit_positions(elements),
        )
    return replace(
        quiet,
        echo=echo,
        uplinks=tuple(
            Uplink(samples=pilot, positions=elements, frequencies=frequencies, user=name)
            for name in scenario.users
            if (pilot := recorded.get(f"uplink/{name}")) is not None
        ),
        clock_offset=flaws.clock_offset if flaws.clock_known else None,
    )


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
