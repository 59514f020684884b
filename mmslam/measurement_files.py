"""Measurement files from a simulation, or from somebody else's data."""

from pathlib import Path

import xarray as xr

from estimator.measurement.model import Measurement
from estimator.measurement.store import read_measurement, write_measurement
from estimator.results.estimate import Progress
from mmslam import output
from mmslam.formats.export_touchstone import MAPPING, export_touchstone, refuse_foreign_touchstone
from mmslam.formats.import_full_wave import import_npz
from mmslam.formats.import_measured import Import, import_measured
from mmslam.formats.mapping import load_mapping
from mmslam.terminal.interruption import interruptions_held
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


def import_measured_to_file(source: Path, *, mapping: Path, path: Path) -> Import:
    """Convert measured data to a measurement store, as a mapping file tells."""
    told = load_mapping(mapping)
    with output.replacing(path, output.refuse_foreign_store) as new:
        imported = import_measured(source, told, base=mapping.parent)
        write_measurement(new, imported.measurement)
    return imported


def mapping_beside(source: Path) -> Path | None:
    """Return the mapping file that lies in a folder of measured data, if one does."""
    beside = source / MAPPING
    return beside if beside.is_file() else None


def export_to_touchstone(source: Path, *, sample: int | None, folder: Path) -> int:
    """Write a measurement store as a folder of Touchstone files; return their number."""
    measurement = read_measurement(source, sample=sample)
    with output.replacing(folder, refuse_foreign_touchstone) as new:
        return export_touchstone(measurement, new)
