"""Measurement files from a simulation, or from somebody else's data."""

from pathlib import Path
from typing import TYPE_CHECKING

from estimator.estimate import Progress
from estimator.measurement import Measurement
from estimator.storage import write_measurement
from mmslam import output
from mmslam.import_npz import import_npz
from mmslam.interruption import interruptions_held
from scenes.scenario import Scenario

if TYPE_CHECKING:
    from simulator.simulation import Simulation


def simulate_interruptibly(
    scenario: Scenario, *, seed: int, progress: Progress | None = None
) -> "Simulation":
    """Simulate a scenario; Ctrl-C takes effect between two steps of it."""
    with interruptions_held() as let_through:
        from simulator.simulation import simulate  # Sionna's import takes seconds

        def step(stage: str, done: int, total: int) -> None:
            let_through()
            if progress is not None:
                progress(stage, done, total)

        return simulate(scenario, seed=seed, progress=step)


def simulate_to_file(
    scenario: Scenario, *, seed: int, path: Path, progress: Progress | None = None
) -> Measurement:
    """Simulate a scenario and write the measurement and its truth to one store."""
    with output.replacing(path, output.refuse_foreign_store) as new:
        simulation = simulate_interruptibly(scenario, seed=seed, progress=progress)
        write_measurement(new, simulation.measurement, truth=simulation.truth)
    return simulation.measurement


def import_to_file(source: Path, *, uplink: str | None, path: Path) -> Measurement:
    """Convert a full-wave reference to a measurement store, its truth included."""
    with output.replacing(path, output.refuse_foreign_store) as new:
        imported = import_npz(source, uplink=uplink)
        write_measurement(new, imported.measurement, truth=imported.truth)
    return imported.measurement
