"""The commands that :mod:`benchmarks.kill_points` kills, each with a small input."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

import numpy as np

from estimator.measurement.model import Echo, Measurement, Uplink
from estimator.measurement.store import write_measurement
from mmslam.output import reserved


@dataclass(frozen=True)
class Case:
    """A command, and what it writes."""

    name: str
    output: str  # name of its output
    run: Callable[[Path], None]  # in a folder, where the output is to be made
    earlier: bool  # whether an earlier output lies there, which it replaces


def measurement() -> Measurement:
    """Return a small measurement."""
    rng = np.random.default_rng(0)
    positions = np.stack([np.linspace(-0.01, 0.01, 5), np.zeros(5), np.zeros(5)], axis=-1)
    frequencies = np.linspace(220e9, 290e9, 7)
    samples = rng.normal(size=(5, 7)) + 1j * rng.normal(size=(5, 7))
    return Measurement(
        echo=Echo(samples=samples, positions=positions, frequencies=frequencies),
        uplinks=(
            Uplink(samples=samples, positions=positions, frequencies=frequencies, user="ann"),
        ),
        scenario="hall",
    )


CONFIG = """
base = "point_scatterers"
count = 6
seed = 5
set.base_station.elements = 4
set.radio.points = 4
set."users.ann.position_m" = [0.2, 0.5]
[vary]
"noise.snr_db" = { kind = "uniform", low = 10.0, high = 30.0 }
"""


def cases(inputs: Path) -> Iterator[Case]:
    """Yield the cases; their inputs are written to a folder first."""
    inputs.mkdir(exist_ok=True)
    measured = measurement()
    write_measurement(inputs / "it.zarr", measured)
    assert measured.echo is not None
    np.savez(
        inputs / "it.npz",
        echo=measured.echo.samples,
        aperture_position=measured.echo.positions,
        frequency=measured.echo.frequencies,
    )
    from mmslam.formats.export_arrays import export_matlab, export_netcdf
    from mmslam.measured_data import export_to_touchstone, import_to_file

    yield _dataset_case(inputs)
    yield _run_case(measured)
    yield _sweep_case()
    yield Case(
        "import",
        "made.zarr",
        lambda folder: _done(
            import_to_file(inputs / "it.npz", mapping=None, uplink=None, path=folder / "made.zarr")
        ),
        earlier=False,
    )
    yield Case(
        "export --touchstone",
        "made",
        lambda folder: _done(
            export_to_touchstone(inputs / "it.zarr", sample=None, folder=folder / "made")
        ),
        earlier=False,
    )
    # MATLAB files tell when they were written, NetCDF's library writes where Python hears nothing.
    yield Case(
        "export --matlab",
        "made.mat",
        lambda folder: _unless_there(
            folder / "made.mat", lambda file: _timeless(export_matlab, inputs / "it.zarr", file)
        ),
        earlier=False,
    )
    yield Case(
        "export --netcdf",
        "made.nc",
        lambda folder: _unless_there(
            folder / "made.nc", lambda file: _done(export_netcdf(inputs / "it.zarr", file))
        ),
        earlier=False,
    )


def _done(result: object) -> None:
    """Drop what a command returns."""


def _unless_there(file: Path, write: Callable[[Path], None]) -> None:
    """Write a file that is never replaced; a command that was killed at its end has written it."""
    if not file.exists():
        write(file)
        return
    with reserved(file):  # as any command on it, takes away what the killed one left beside it
        pass


def _timeless(export: Callable[[Path, Path], int], store: Path, file: Path) -> None:
    with mock.patch("time.asctime", return_value="then"):
        export(store, file)


def _dataset_case(inputs: Path) -> Case:
    from simulator.dataset import builder, layout
    from simulator.dataset.sample import make_row
    from simulator.dataset.task_runner import Workers

    layout.BLOCK_SAMPLES = 4
    (inputs / "config.toml").write_text(CONFIG, encoding="utf-8")
    job = builder.plan_dataset(inputs / "config.toml", inputs / "made.zarr")
    plan = builder._layout(job)
    rows = {sample: make_row(job.space, plan, sample) for sample in range(job.config.samples)}

    def run(folder: Path) -> None:
        here = builder.plan_dataset(inputs / "config.toml", folder / "made.zarr")
        with mock.patch.object(builder, "make_row", lambda space, plan, sample: dict(rows[sample])):
            builder.make_dataset(here, workers=Workers(processes=0))

    return Case("dataset", "made.zarr", run, earlier=False)


def _run_case(measured: Measurement) -> Case:
    from estimator.results.estimate import Estimate
    from mmslam import pipeline
    from mmslam.measurement import Measurement as WithTruth
    from mmslam.results.estimate import Estimate as Answer
    from scenes.files.loading import load_scenario

    scenario = load_scenario("slam_2d", ["base_station.elements=4", "radio.points=8"])
    simulated = WithTruth.of(measured)
    nothing = Answer.of(Estimate(users=(), mirrors=()), simulated)

    def pictures(folder: Path, *_: object) -> dict[str, Path]:
        (folder / "localization.png").write_bytes(bytes(5000))
        return {}

    def run(folder: Path) -> None:
        from mmslam.results import pictures_2d

        with (
            mock.patch.object(pipeline, "simulate", return_value=simulated),
            mock.patch.object(pipeline, "locate", return_value=nothing),
            mock.patch.object(pictures_2d, "write_pictures", pictures),
            mock.patch("time.perf_counter", return_value=0.0),
        ):
            pipeline.run_scenario(scenario, seed=0, folder=folder / "made")

    return Case("run", "made", run, earlier=True)


def _sweep_case() -> Case:
    from mmslam import output
    from mmslam.commands import sweep

    def run(folder: Path) -> None:
        with output.replacing(folder / "made", sweep.refuse_foreign_sweep) as new:
            new.mkdir()
            (new / sweep.TABLE).write_text("point,error\n" + "0,1\n" * 99, encoding="utf-8")
            write_measurement(new / sweep.STORE, measurement())
            (new / sweep.SUMMARY).write_text("{}", encoding="utf-8")

    return Case("sweep", "made", run, earlier=False)
