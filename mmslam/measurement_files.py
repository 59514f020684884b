"""Measurement files from a simulation, or from somebody else's data."""

from pathlib import Path

import xarray as xr

from estimator.estimate import Progress
from estimator.measurement import Measurement
from estimator.storage import write_measurement
from mmslam import output
from mmslam.import_npz import import_npz
from mmslam.interruption import interruptions_held
from scenes.scenario import Scenario


def simulate_interruptibly(
    scenario: Scenario, *, seed: int, progress: Progress | None = None
) -> tuple[Measurement, xr.Dataset]:
    """Simulate a measurement and the truth behind it; Ctrl-C takes effect between two steps."""
    with interruptions_held() as let_through:
        from simulator.simulation import simulate  # Sionna's import takes seconds

        def step(stage: str, done: int, total: int) -> None:
            let_through()
            if progress is not None:
                progress(stage, done, total)

        simulation = simulate(scenario, seed=seed, progress=step)
    return simulation.measurement, simulation.truth


def simulate_to_file(
    scenario: Scenario, *, seed: int, path: Path, progress: Progress | None = None
) -> Measurement:
    """Simulate a scenario and write the measurement and its truth to one store."""
    with output.replacing(path, output.refuse_foreign_store) as new:
        measurement, truth = simulate_interruptibly(scenario, seed=seed, progress=progress)
        write_measurement(new, measurement, truth=truth)
    return measurement


def import_to_file(source: Path, *, uplink: str | None, path: Path) -> Measurement:
    """Convert a full-wave reference to a measurement store, its truth included."""
    with output.replacing(path, output.refuse_foreign_store) as new:
        imported = import_npz(source, uplink=uplink)
        write_measurement(new, imported.measurement, truth=imported.truth)
    return imported.measurement
