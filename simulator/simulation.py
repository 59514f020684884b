"""From a scenario to a measurement: frozen surfaces, echo, uplink, noise, and the truth."""

from collections.abc import Callable
from dataclasses import dataclass

import xarray as xr

from estimator.measurement.model import Echo, Measurement, Uplink
from scenes.scenario import Scenario
from simulator.antennas.ports import Ports
from simulator.multibounce.chain_count import check_chains
from simulator.receiver.receiver import received
from simulator.response.echo import simulate_echo
from simulator.response.multistatic import multistatic_echo, multistatic_scene
from simulator.response.point_targets import point_echo, point_uplink
from simulator.response.uplink import simulate_uplink
from simulator.scene.air import in_air, measured_air
from simulator.scene.array_antennas import in_space
from simulator.scene.radio_scene import facet_ports, radio_scene
from simulator.scene.truth import scenario_truth

Progress = Callable[[str, int, int], None]
"""Called with the name of a stage, the steps done and the steps in all."""


@dataclass(frozen=True, kw_only=True)
class Simulation:
    """A simulated measurement and its ground truth."""

    measurement: Measurement
    truth: xr.Dataset


def simulate(
    scenario: Scenario,
    *,
    seed: int,
    sample: int = 0,
    realisation: int | None = None,
    progress: Progress | None = None,
) -> Simulation:
    """Simulate the measurement of a scenario.

    Parameters
    ----------
    scenario
        Radio, base station, objects, users, noise.
    seed, sample
        Which realisation of roughness and noise; each has its own random stream.
    realisation
        Sample whose roughness it has, in a frozen room; None: its own.
    progress
        Called with a stage, the steps done and the steps in all.

    Raises
    ------
    ScenarioError
        If nothing is received, or paths of ``max_bounces`` bounces are too many to compute.
    """
    station, frequencies = scenario.base_station, scenario.radio.frequencies
    simulated, completed = in_air(scenario)
    flaws = scenario.impairments
    # The measurement reports nominal positions, without the jitter.
    elements = station.element_positions
    advance = _counter("echo", len(elements), progress)
    array: Ports | None = None
    if station.multistatic and scenario.dimensions == 3:
        apart = multistatic_scene(simulated, seed=seed, sample=sample, realisation=realisation)
        scene, echo = apart.radio, multistatic_echo(apart, advance=advance)
    else:
        scene = radio_scene(simulated, seed=seed, sample=sample, realisation=realisation)
        if scene.facets is not None and not station.multistatic and not in_space(scenario):
            check_chains(
                scene.mutual_visibility.faces,
                max_bounces=scenario.max_bounces,
                elements=len(elements),
                users=len(scenario.users),
            )
            array = facet_ports(scene, scene.facets, station.antenna, scene.elements)
        echo = simulate_echo(
            scene,
            array,
            advance=advance,
            over_several=_teller("echo over several surfaces", progress),
        )
    signals = {"echo": completed(echo + point_echo(scene))}
    for name, user in scenario.users.items():
        advance = _counter(f"uplink of {name}", len(elements), progress)
        uplink = simulate_uplink(
            scene,
            user,
            array,
            advance=advance,
            over_several=_teller(f"uplink of {name} over several surfaces", progress),
        )
        signals[f"uplink/{name}"] = completed(uplink + point_uplink(scene, user))
    recorded = received(signals, scenario, seed=seed, sample=sample)
    measurement = Measurement(
        echo=Echo(
            samples=recorded["echo"],
            positions=elements,
            frequencies=frequencies,
            transmit_positions=station.transmit_positions(elements),
        )
        if "echo" in recorded
        else None,
        uplinks=tuple(
            Uplink(samples=pilot, positions=elements, frequencies=frequencies, user=name)
            for name in scenario.users
            if (pilot := recorded.get(f"uplink/{name}")) is not None
        ),
        waves=scenario.waves,
        boresight=station.boresight,
        clock_offset=flaws.clock_offset if flaws.clock_known else None,
        scenario=scenario.name,
        seed=seed,
        air=measured_air(scenario.air),
    )
    return Simulation(measurement=measurement, truth=scenario_truth(scenario))


def _teller(stage: str, progress: Progress | None) -> Callable[[int, int], None]:
    def tell(done: int, steps: int) -> None:
        if progress is not None:
            progress(stage, done, steps)

    return tell


def _counter(stage: str, steps: int, progress: Progress | None) -> Callable[[], None]:
    done = 0

    def advance() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(stage, done, steps)

    return advance
