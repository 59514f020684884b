"""The command line. Heavy packages are imported by the commands that need them."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from mmslam.failures import BAD_INPUT, FALLS_SHORT, stdout_kept_clean, told_clearly

app = typer.Typer(
    name="mmslam",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,  # a bug's traceback is best read whole and plain
    context_settings={"help_option_names": ["-h", "--help"]},
)

ScenarioName = Annotated[
    str, typer.Argument(metavar="SCENARIO", help="A built-in name, or the path of a TOML file.")
]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Override a key by its dotted path, e.g. `objects.wall.angle_deg=35`. Repeatable.",
    ),
]
Seed = Annotated[int, typer.Option(min=0, help="Of roughness and noise.")]
AsJson = Annotated[
    bool, typer.Option("--json", help="Print one JSON document on stdout, and nothing else.")
]
OutFolder = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Folder for the results.")
]
WorkerCount = Annotated[
    int | None,
    typer.Option(
        min=0, help="Processes of one thread each [one for each core]; 0: none but this one."
    ),
]
SchedulerAddress = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS", help="A Dask scheduler whose workers are used in place of --workers."
    ),
]
DryRun = Annotated[
    bool,
    typer.Option("--dry-run", help="Only say how many, how long and how large, by one of them."),
]
OutFile = Annotated[
    Path, typer.Option("--output", "-o", metavar="FILE.zarr", help="Measurement file to write.")
]


def _print_version(asked: bool | None) -> None:
    if asked:
        from importlib.metadata import version

        typer.echo(f"mmslam {version('mmslam')}")
        raise typer.Exit


@app.callback()
def main(
    backend: Annotated[
        Literal["llvm", "cuda"] | None,
        typer.Option(help="Where to compute; by default CUDA if there is one, else LLVM."),
    ] = None,
    version: Annotated[
        bool | None,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version."),
    ] = None,
) -> None:
    """Radio SLAM at mmWave and THz: image the room, find its mirrors, locate the users.

    Start with `mmslam run slam_2d`.
    """
    if backend is not None:
        os.environ["MMSLAM_BACKEND"] = backend


@app.command()
def scenes(
    name: Annotated[
        str | None, typer.Argument(help="A built-in name, or the path of a TOML file.")
    ] = None,
    overrides: Overrides = None,
    show: Annotated[
        bool,
        typer.Option("--show", help="Draw NAME, from above and in 3-D, with its specular paths."),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE.png", help="Where to draw it [out/NAME.png]."),
    ] = None,
    export: Annotated[
        Path | None,
        typer.Option(
            "--export",
            metavar="DIR",
            help="Write NAME to DIR: TOML, and Mitsuba XML with PLY meshes for Sionna and Blender. "
            "Without NAME, the TOML of all.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the roughness in the exported facets.")] = 0,
    schema: Annotated[
        bool, typer.Option("--schema", help="Print the JSON schema of scenario files.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """List the built-in scenarios, or look at, draw or export one."""
    with told_clearly():
        from mmslam import scenario_commands as commands
        from scenes.library import load_scenario, scenario_schema

        if schema:
            _print_json(scenario_schema())
        elif name is None:
            if show or overrides:
                raise typer.BadParameter("--show and --set need the NAME of a scenario")
            commands.list_scenarios(export=export, as_json=as_json)
        else:
            scenario = load_scenario(name, overrides or [])
            commands.show_scenario(
                scenario,
                picture=_picture(show, out, scenario.name),
                export=export,
                seed=seed,
                as_json=as_json,
            )


@app.command()
def run(
    scenario: ScenarioName,
    overrides: Overrides = None,
    seed: Seed = 0,
    out: OutFolder = None,
    as_json: AsJson = False,
) -> None:
    """Simulate a scenario, image it, fold the ghosts back, locate the users, and report.

    Writes to `--out` (default `out/SCENARIO-SEED/`) the result, the measurement, the figures
    and a report. What an earlier run wrote there is replaced; a foreign folder is refused.
    """
    with told_clearly():
        from mmslam.progress import StageProgress
        from scenes.library import load_scenario

        loaded = load_scenario(scenario, overrides or [])
        folder = out or Path("out") / f"{loaded.name}-{seed}"
        with stdout_kept_clean(), StageProgress() as progress:
            from mmslam.pipeline import run_scenario

            outcome = run_scenario(loaded, seed=seed, folder=folder, progress=progress)
        _print_outcome(outcome.result, outcome.folder, as_json)


@app.command()
def simulate(
    scenario: ScenarioName,
    output: OutFile,
    overrides: Overrides = None,
    seed: Seed = 0,
    as_json: AsJson = False,
) -> None:
    """Simulate the measurement of a scenario, and write it with its truth to one file."""
    with told_clearly():
        from mmslam.progress import StageProgress
        from scenes.library import load_scenario

        loaded = load_scenario(scenario, overrides or [])
        with stdout_kept_clean(), StageProgress() as progress:
            from mmslam.measurement_files import simulate_to_file

            measurement = simulate_to_file(loaded, seed=seed, path=output, progress=progress)
        _print_written(output, measurement, as_json)


@app.command()
def locate(
    measurement: Annotated[Path, typer.Argument(metavar="FILE.zarr", help="The measurement.")],
    sample: Annotated[
        int | None, typer.Option(min=0, help="Which sample, if the file is a dataset.")
    ] = None,
    out: OutFolder = None,
    as_json: AsJson = False,
) -> None:
    """Locate the users of any measurement: simulated, imported or your own.

    Writes to `--out` (default `out/SCENARIO-SEED-located/`) what `run` writes, but for the
    measurement. A truth in the file is opened after the estimate only, to compare.
    """
    with told_clearly():
        from mmslam.progress import StageProgress

        with stdout_kept_clean(), StageProgress() as progress:
            from mmslam.pipeline import locate_measurement

            outcome = locate_measurement(measurement, sample=sample, folder=out, progress=progress)
        _print_outcome(outcome.result, outcome.folder, as_json)


def _print_mapping_schema(asked: bool | None) -> None:
    if asked:
        from mmslam.sweep_mapping import mapping_schema

        _print_json(mapping_schema())
        raise typer.Exit


@app.command(name="import")
def import_(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="A folder of Touchstone files, or a .mat, HDF5, NetCDF, .csv, .npz or .npy file.",
        ),
    ],
    output: OutFile,
    mapping: Annotated[
        Path | None,
        typer.Option(
            "--mapping",
            "-m",
            metavar="FILE.toml",
            help="Says what in SOURCE is what [SOURCE/mapping.toml, if there is one].",
        ),
    ] = None,
    uplink: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Of a full-wave .npz without mapping: its pilot [uplink_beam, else the first].",
        ),
    ] = None,
    schema: Annotated[
        bool | None,
        typer.Option(
            "--schema",
            callback=_print_mapping_schema,
            is_eager=True,
            help="Print the JSON schema of mapping files.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Import measured data into a measurement file, as a mapping file says what is what.

    Without a mapping, SOURCE is a full-wave reference: an .npz with `echo` and `uplink_…`
    (positions x frequencies, complex), `aperture_position` [m] and `frequency` [Hz]; if known,
    `user_position` and `wall_profile`.
    """
    with told_clearly():
        from mmslam import measurement_files

        mapping = mapping or measurement_files.mapping_beside(source)
        if mapping is None:
            if source.is_dir() or (source.exists() and source.suffix.lower() != ".npz"):
                raise typer.BadParameter(
                    f"{source}: measured data needs --mapping FILE.toml; its keys are listed by "
                    "`mmslam import --schema`"
                )
            measurement = measurement_files.import_to_file(source, uplink=uplink, path=output)
        else:
            if uplink is not None:
                raise typer.BadParameter("--uplink is for data without a mapping; leave it out")
            with stdout_kept_clean():
                imported = measurement_files.import_measured_to_file(
                    source, mapping=mapping, path=output
                )
            measurement = imported.measurement
            for note in imported.notes:
                typer.echo(f"mmslam: note: {note}", err=True)
        _print_written(output, measurement, as_json)


@app.command()
def export(
    measurement: Annotated[
        Path, typer.Argument(metavar="FILE.zarr", help="The measurement or dataset.")
    ],
    touchstone: Annotated[
        Path | None,
        typer.Option(
            "--touchstone", metavar="DIR", help="Folder to write: a file for each position."
        ),
    ] = None,
    netcdf: Annotated[
        Path | None, typer.Option("--netcdf", metavar="FILE.nc", help="NetCDF-4 file to write.")
    ] = None,
    matlab: Annotated[
        Path | None, typer.Option("--matlab", metavar="FILE.mat", help="MATLAB file to write.")
    ] = None,
    sample: Annotated[
        list[int] | None,
        typer.Option(
            min=0, help="Which sample, if the file is a dataset. Repeatable, but for --touchstone."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Write a measurement as Touchstone files, or a dataset's samples as NetCDF or MATLAB.

    Touchstone files come with the mapping that imports them again; what an earlier export wrote
    to DIR is replaced, a foreign folder refused. NetCDF and MATLAB hold all samples by default,
    with their truth.
    """
    with told_clearly():
        if sum(one is not None for one in (touchstone, netcdf, matlab)) != 1:
            raise typer.BadParameter("give one of --touchstone, --netcdf and --matlab")
        if touchstone is not None:
            from mmslam.measurement_files import export_to_touchstone

            if sample is not None and len(sample) > 1:
                raise typer.BadParameter("--touchstone takes one --sample at a time")
            count = export_to_touchstone(
                measurement, sample=sample[0] if sample else None, folder=touchstone
            )
            told: dict[str, Any] = {"folder": str(touchstone), "files": count}
            line = f"{touchstone}: {count} Touchstone files"
        else:
            from mmslam.export_arrays import export_matlab, export_netcdf

            if netcdf is not None:
                file, count = netcdf, export_netcdf(measurement, netcdf, samples=sample)
            else:
                assert matlab is not None
                file, count = matlab, export_matlab(measurement, matlab, samples=sample)
            told = {"file": str(file), "variables": count}
            line = f"{file}: {count} variables"
        if as_json:
            _print_json(told)
        else:
            typer.echo(line)


@app.command()
def dataset(
    config: Annotated[
        Path | None, typer.Argument(metavar="CONFIG", help="A TOML file: what varies, and how.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE.zarr", help="Dataset to write.")
    ] = None,
    workers: WorkerCount = None,
    scheduler: SchedulerAddress = None,
    dry_run: DryRun = False,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="Make samples again that have failed.")
    ] = False,
    schema: Annotated[
        bool, typer.Option("--schema", help="Print the JSON schema of CONFIG.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Simulate many variations of a scenario into one store, for training and testing.

    Sample n depends on the seed and n alone, whoever makes it. Interrupted or killed, the same
    command goes on; then, too, the store is the same to the byte. Exit code 1: samples failed.
    """
    with told_clearly():
        if schema:
            with stdout_kept_clean():
                from simulator.dataset_config import DatasetConfig
            _print_json(DatasetConfig.model_json_schema())
            return
        if config is None or output is None:
            raise typer.BadParameter("needs CONFIG and --output FILE.zarr")
        with stdout_kept_clean():
            from mmslam import dataset_command as commands

            where = commands.chosen_workers(workers, scheduler)
            if dry_run:
                found = commands.look_ahead(config, output, workers=max(where.processes, 1))
            else:
                found = commands.make(config, output, workers=where, retry_failed=retry_failed)
        if as_json:
            _print_json(found)
        else:
            commands.print_lines(
                commands.forecast_lines(found) if dry_run else commands.lines(found)
            )
        if found.get("failed"):
            raise typer.Exit(FALLS_SHORT)


@app.command()
def sweep(
    config: Annotated[
        Path | None,
        typer.Argument(metavar="CONFIG", help="A TOML file: what is swept, and how often."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Folder for tables and figures [out/CONFIG]."),
    ] = None,
    cache: Annotated[
        Path | None,
        typer.Option(
            "--cache", metavar="DIR", help="Where what was computed is kept [out/sweep_cache]."
        ),
    ] = None,
    workers: WorkerCount = None,
    scheduler: SchedulerAddress = None,
    dry_run: DryRun = False,
    schema: Annotated[
        bool, typer.Option("--schema", help="Print the JSON schema of CONFIG.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Locate users over a grid of a scenario's keys: error tables, and figures with the bound.

    What was computed before is not computed again, also after Ctrl-C. Exit code 1: points failed.
    """
    with told_clearly():
        if schema:
            with stdout_kept_clean():
                from validation.sweep import SweepConfig
            _print_json(SweepConfig.model_json_schema())
            return
        if config is None:
            raise typer.BadParameter("needs CONFIG")
        with stdout_kept_clean():
            from mmslam import sweep_command as commands
            from mmslam.dataset_command import chosen_workers, print_lines

            where = chosen_workers(workers, scheduler)
            kept = cache or commands.DEFAULT_CACHE
            if dry_run:
                found = commands.look_ahead(config, cache=kept, workers=max(where.processes, 1))
            else:
                folder = out or Path("out") / config.stem
                found = commands.run(config, folder, cache=kept, workers=where)
        if as_json:
            _print_json(found)
        else:
            say = commands.forecast_lines if dry_run else commands.lines
            print_lines(say(found))
        if found.get("failed"):
            raise typer.Exit(FALLS_SHORT)


@app.command()
def validate(
    quick: Annotated[
        bool, typer.Option("--quick", help="Fewer seeds and points, within three minutes.")
    ] = False,
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="KEY", help="A claim alone. Repeatable.")
    ] = None,
    out: OutFolder = None,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Measure again what an earlier run has measured.")
    ] = False,
    listed: Annotated[bool, typer.Option("--list", help="List the claims, and end.")] = False,
    record: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Keep the figures there, and make the page of results."),
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Fail if figures kept there no longer hold."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Check every claim: our figure beside the thesis' or the theory's, with its limit.

    Writes each claim's numbers and figure to `--out` (default `out/validate/` or
    `out/validate-quick/`). Interrupted, the same command goes on where it was.
    """
    with told_clearly():
        from mmslam import validate_command as commands

        keys = only or []
        if listed:
            for claim in commands.chosen_claims(keys, quick=quick):
                form = "quick" if claim.quick else "full only"
                typer.echo(f"{claim.key:<20} {form:<10} {claim.minutes:4g} min  {claim.title}")
            return
        folder = out or Path("out") / ("validate-quick" if quick else "validate")
        commands.refuse_impossible(keys, quick=quick, record=record, against=against)
        with commands.console_on_stdout() as console, stdout_kept_clean():
            found = commands.check_claims(
                keys,
                quick=quick,
                folder=folder,
                fresh=fresh,
                shown=(lambda table: None) if as_json else console.print,
            )
        gone = [] if against is None else commands.drift(found, against)
        if record is not None:
            commands.record_run(found, record, folder)
        if as_json:
            _print_json({**found, "drifted": gone})
        else:
            for line in gone:
                typer.echo(f"no longer holds: {line}")
            typer.echo(commands.summary_line(found))
            typer.echo(f"figures: {folder}")
        if gone or not found["passed"]:
            raise typer.Exit(FALLS_SHORT)


@app.command()
def design(
    scenario: Annotated[
        str,
        typer.Argument(metavar="[SCENARIO]", help="Whose radio and array: a name or a TOML file."),
    ] = "slam_2d",
    start_ghz: Annotated[float | None, typer.Option(help="Lower end of the band.")] = None,
    stop_ghz: Annotated[float | None, typer.Option(help="Upper end of the band.")] = None,
    points: Annotated[int | None, typer.Option(help="Frequencies in the band.")] = None,
    elements: Annotated[int | None, typer.Option(help="Positions of the linear array.")] = None,
    spacing_mm: Annotated[float | None, typer.Option(help="Between positions.")] = None,
    distance_m: Annotated[float, typer.Option(help="Of target and user.")] = 1.0,
    angle_deg: Annotated[float, typer.Option(help="Largest angle off broadside.")] = 0.0,
    as_json: AsJson = False,
) -> None:
    """Print resolutions, unambiguous ranges, needed steps and field regions of a radio."""
    with told_clearly():
        from mmslam.design import design_document, design_lines, design_rows, scenario_radio
        from scenes.library import load_scenario

        given = {
            "start_ghz": start_ghz,
            "stop_ghz": stop_ghz,
            "points": points,
            "elements": elements,
            "spacing_mm": spacing_mm,
        }
        options = scenario_radio(load_scenario(scenario))
        options |= {key: value for key, value in given.items() if value is not None}
        options |= {"distance_m": distance_m, "angle_deg": angle_deg}
        rows = design_rows(**options)
        if as_json:
            _print_json(design_document(options, rows))
            return
        for line in design_lines(rows):
            typer.echo(line)


@app.command()
def info(as_json: AsJson = False) -> None:
    """Show the backend, LLVM, threads and versions that this installation uses."""
    with told_clearly():
        from mmslam.system import system_information

        with stdout_kept_clean():
            found = system_information()
        if as_json:
            _print_json(found)
        else:
            for key, value in found.items():
                if isinstance(value, Mapping):
                    for package, number in value.items():
                        typer.echo(f"{package:<20} {number or 'not installed'}")
                elif value is not None:
                    typer.echo(f"{key.replace('_', ' '):<20} {value}")
        if found["backend"] is None:
            raise typer.Exit(BAD_INPUT)


def _picture(show: bool, out: Path | None, name: str) -> Path | None:
    if not show:
        if out is not None:
            raise typer.BadParameter("--out says where the picture goes; add --show")
        return None
    return out or Path("out") / f"{name}.png"


def _print_json(document: Mapping[str, Any]) -> None:
    typer.echo(json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False))


def _print_outcome(result: Mapping[str, Any], folder: Path, as_json: bool) -> None:
    if as_json:
        _print_json(result)
        return
    from mmslam.summary import summary_lines

    for line in summary_lines(result, folder):
        typer.echo(line)


def _print_written(path: Path, measurement: Any, as_json: bool) -> None:
    from mmslam.summary import measurement_summary

    summary = measurement_summary(measurement)
    if as_json:
        _print_json({"file": str(path), **summary})
    else:
        told = [f"{key} {value}" for key, value in summary.items() if value is not None]
        typer.echo(f"{path}: {', '.join(told)}")
