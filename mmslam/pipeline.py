"""From a scenario to a measurement, to an estimate, and to a folder of results."""

import time
from pathlib import Path

from estimator.results.estimate import Progress
from mmslam import output, own_results
from mmslam.location import Outcome, locate, write_results
from mmslam.measurement import Measurement
from mmslam.measurement_files import write
from mmslam.terminal.interruption import interruptions_held
from scenes.files.loading import scenario_to_toml
from scenes.scenario import Scenario, ScenarioError


def simulate(scenario: Scenario, *, seed: int = 0, progress: Progress | None = None) -> Measurement:
    """Simulate the measurement of a scenario, with the truth beside it.

    Ctrl-C takes effect between two steps.

    Parameters
    ----------
    scenario
        What :func:`mmslam.load_scenario` returns.
    seed
        Of roughness and noise: the same seed gives the same samples.
    progress
        Told each stage's steps.

    Raises
    ------
    ScenarioError
        If nothing at all is received.

    Examples
    --------
    >>> import mmslam
    >>> small = {"base_station.elements": 16, "radio.points": 16}
    >>> measurement = mmslam.simulate(mmslam.load_scenario("point_scatterers", small), seed=1)
    >>> measurement.echo.samples.shape
    (16, 16)
    >>> measurement.truth.target_position["near"]
    array([0. , 0.5, 0. ])
    """
    with interruptions_held() as let_through:
        from simulator import simulation  # Sionna's import takes seconds
        from simulator.scene.left_out import model_told

        def step(stage: str, done: int, total: int) -> None:
            let_through()
            if progress is not None:
                progress(stage, done, total)

        found = simulation.simulate(scenario, seed=seed, progress=step)
        truth = found.truth.assign_attrs(model_told(scenario))
    return Measurement.of(found.measurement, beside=truth)


def simulate_to_file(
    scenario: Scenario, *, seed: int, path: Path, progress: Progress | None = None
) -> Measurement:
    """Simulate a scenario to a measurement file; ``path`` is refused before any work."""
    with output.replacing(path, own_results.refuse_foreign_store) as new:
        measurement = simulate(scenario, seed=seed, progress=progress)
        write(new, measurement)
    return measurement


def run_scenario(
    scenario: Scenario, *, seed: int, folder: Path, progress: Progress | None = None
) -> Outcome:
    """Simulate a scenario, estimate what is in it, and write everything to a folder.

    Parameters
    ----------
    scenario
        What is simulated.
    seed
        Of roughness and noise.
    folder
        Is replaced as a whole once all is done; refused before any work if it is foreign.
    progress
        Told each stage's steps.

    Raises
    ------
    ScenarioError
        If the estimator could not take the measurement; said before it is simulated.
    """
    _refuse_what_cannot_be_located(scenario)
    with output.replacing(folder, own_results.refuse_foreign_results) as new:
        new.mkdir()
        started = time.perf_counter()
        measurement = simulate(scenario, seed=seed, progress=progress)
        timings = {"simulate": time.perf_counter() - started}
        started = time.perf_counter()
        write(new / own_results.MEASUREMENT, measurement)
        timings["write_measurement"] = time.perf_counter() - started
        estimate = locate(measurement, progress=progress)
        result = write_results(new, measurement, estimate, timings, scenario_to_toml(scenario))
    return Outcome(folder=folder, result=result)


def _refuse_what_cannot_be_located(scenario: Scenario) -> None:
    if scenario.base_station.multistatic:
        raise ScenarioError(
            f"scenario {scenario.name!r}: its antennas stand apart (base_station.receivers or "
            "transmitter); mirrors and users are located with a linear array that hears its own "
            "echo. `mmslam simulate` takes any antennas"
        )
    along, up = scenario.base_station.shape
    if along < 2:
        given = along if isinstance(scenario.base_station.elements, int) else [along, up]
        raise ScenarioError(
            f"base_station.elements = {given}: mirrors and users are located with a linear array "
            "of at least 2 elements, or a planar one of at least 2 × 2; give more elements. "
            "`mmslam simulate` takes any array"
        )
    if up > 1 and scenario.base_station.transmit_offset is not None:
        raise ScenarioError(
            "base_station.transmit_offset_m: a planar array images its own echo only; leave the "
            "offset out. `mmslam simulate` takes any antennas"
        )
