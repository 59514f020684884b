"""The command line. Heavy packages are imported by the commands that need them."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from mmslam.failures import BAD_INPUT, stdout_kept_clean, told_clearly

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
    measurement: Annotated[Path, typer.Argument(metavar="FILE.zarr", help="The measurement.")],
    touchstone: Annotated[
        Path,
        typer.Option(
            "--touchstone", metavar="DIR", help="Folder to write: a file for each position."
        ),
    ],
    sample: Annotated[
        int | None, typer.Option(min=0, help="Which sample, if the file is a dataset.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Write a measurement as Touchstone files, with the mapping that imports them again.

    What an earlier export wrote to DIR is replaced; a foreign folder is refused.
    """
    with told_clearly():
        from mmslam.measurement_files import export_to_touchstone

        count = export_to_touchstone(measurement, sample=sample, folder=touchstone)
        if as_json:
            _print_json({"folder": str(touchstone), "files": count})
        else:
            typer.echo(f"{touchstone}: {count} Touchstone files")


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
