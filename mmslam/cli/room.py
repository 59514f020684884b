"""Commands about one room: its scenario, its measurement, its estimate."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import mmslam
from mmslam.cli.options import (
    AsJson,
    MaxRange,
    MinRange,
    OutFile,
    OutFolder,
    Overrides,
    Pixel,
    RegionX,
    RegionY,
    RegionZ,
    ScenarioName,
    Seed,
)
from mmslam.cli.printing import print_json, print_outcome, print_written
from mmslam.plain_text import visible
from mmslam.terminal.exit_codes import stdout_kept_clean, told_clearly

if TYPE_CHECKING:  # scenarios' models take long to import
    from scenes.scenario import Scenario


def scenes(
    name: Annotated[
        str | None, typer.Argument(help="A built-in name, or the path of a TOML file.")
    ] = None,
    overrides: Overrides = None,
    show: Annotated[
        bool,
        typer.Option("--show", help="Draw NAME, from above and in 3-D, with its specular paths."),
    ] = False,
    in_space: Annotated[
        bool,
        typer.Option("--3d", help="With --show: a page (HTML) in which NAME is turned in 3-D."),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="FILE", help="Where to draw it [out/NAME.png; with --3d .html]."
        ),
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
    new: Annotated[
        Path | None,
        typer.Option("--new", metavar="FILE.toml", help="Write a scenario of your own, commented."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """List the built-in scenarios, or look at, draw or export one, or begin a new one."""
    with told_clearly():
        from mmslam.commands import scenarios as commands
        from scenes.files.loading import scenario_schema

        if in_space and not show:
            raise typer.BadParameter("--3d says how NAME is drawn; add --show")
        if schema:
            print_json(scenario_schema())
        elif new is not None:
            if name is not None or show or overrides or export is not None:
                raise typer.BadParameter("--new writes a file of its own: nothing else with it")
            commands.write_new(new, as_json=as_json)
        elif name is None:
            if show or overrides:
                raise typer.BadParameter("--show and --set need the NAME of a scenario")
            commands.list_scenarios(export=export, as_json=as_json)
        else:
            scenario = mmslam.load_scenario(name, overrides or [])
            commands.show_scenario(
                scenario,
                picture=_picture(show, out, f"{scenario.name}.{'html' if in_space else 'png'}"),
                in_space=in_space,
                export=export,
                seed=seed,
                as_json=as_json,
            )


def run(
    scenario: ScenarioName,
    overrides: Overrides = None,
    seed: Seed = 0,
    out: OutFolder = None,
    as_json: AsJson = False,
) -> None:
    """Simulate a scenario, image it, unfold the ghosts, locate the users, and report.

    Writes to `--out` (default `out/SCENARIO-SEED/`) the result, the measurement, the figures
    and a report. What an earlier run wrote there is replaced; a foreign folder is refused.
    """
    with told_clearly():
        from mmslam.terminal.stage_progress import StageProgress

        loaded = mmslam.load_scenario(scenario, overrides or [])
        _tell_ranges(loaded)
        folder = out or Path("out") / f"{loaded.name}-{seed}"
        with stdout_kept_clean(), StageProgress() as progress:
            from mmslam.pipeline import run_scenario

            outcome = run_scenario(loaded, seed=seed, folder=folder, progress=progress)
        print_outcome(outcome.result, outcome.folder, as_json)


def simulate(
    scenario: ScenarioName,
    output: OutFile,
    overrides: Overrides = None,
    seed: Seed = 0,
    full_wave: Annotated[
        bool,
        typer.Option(
            "--full-wave",
            help="Solve the wave equation by integral equations in place of tracing rays: small "
            "2-D scenes in cylindrical waves. Says first what it takes.",
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Simulate the measurement of a scenario, and write it with its truth to one file."""
    with told_clearly():
        from mmslam.terminal.stage_progress import StageProgress

        loaded = mmslam.load_scenario(scenario, overrides or [])
        _tell_ranges(loaded)
        notes: tuple[str, ...] = ()
        with stdout_kept_clean(), StageProgress() as progress:
            if full_wave:
                from mmslam.full_wave import solve_to_file

                measurement = solve_to_file(
                    loaded,
                    seed=seed,
                    path=output,
                    tell=lambda told: typer.echo(told, err=True),
                    progress=progress,
                )
            else:
                from mmslam.pipeline import simulate_to_file
                from simulator.scene.left_out import model_lines
                from simulator.scene.model_limits import model_notes

                measurement = simulate_to_file(loaded, seed=seed, path=output, progress=progress)
                told = measurement.truth_dataset
                lines = model_lines(told.attrs) if told is not None else ()
                notes = (*model_notes(loaded, seed=seed), *lines)
        print_written(output, measurement, as_json, notes)


def _tell_ranges(scenario: "Scenario") -> None:
    """Print notes on a frequency grid too coarse for the scene, before any long work."""
    from simulator.scene.unambiguous_range import range_notes

    for note in range_notes(scenario):
        typer.echo(f"note: {note}", err=True)


def locate(
    measurement: Annotated[Path, typer.Argument(metavar="FILE.zarr", help="The measurement.")],
    sample: Annotated[
        int | None, typer.Option(min=0, help="Which sample, if the file is a dataset.")
    ] = None,
    x: RegionX = None,
    y: RegionY = None,
    z: RegionZ = None,
    pixel: Pixel = None,
    min_range: MinRange = None,
    max_range: MaxRange = None,
    out: OutFolder = None,
    as_json: AsJson = False,
) -> None:
    """Locate the users of any measurement: simulated, imported or your own.

    Writes to `--out` (default `out/SCENARIO-SEED-located/`) what `run` writes, but for the
    measurement. A truth in the file is opened after the estimate only, to compare.

    With a region (`--x`, `--y`, `--z`, `--min-range`, `--max-range`) or a `--pixel`, targets are
    looked for in an image of it, and no walls.
    """
    with told_clearly():
        from mmslam.terminal.stage_progress import StageProgress

        with stdout_kept_clean(), StageProgress() as progress:
            from mmslam.location import locate_measurement
            from mmslam.region import ANY

            outcome = locate_measurement(
                measurement,
                sample=sample,
                folder=out,
                progress=progress,
                x=x or ANY,
                y=y or ANY,
                z=z or ANY,
                pixel=pixel,
                min_range=min_range,
                max_range=max_range,
            )
        print_outcome(outcome.result, outcome.folder, as_json)


def image(
    measurement: Annotated[Path, typer.Argument(metavar="FILE.zarr", help="The measurement.")],
    sample: Annotated[
        int | None, typer.Option(min=0, help="Which sample, if the file is a dataset.")
    ] = None,
    x: RegionX = None,
    y: RegionY = None,
    z: RegionZ = None,
    pixel: Pixel = None,
    min_range: MinRange = None,
    max_range: MaxRange = None,
    out: OutFolder = None,
    as_json: AsJson = False,
) -> None:
    """Focus a measurement to an image, of any array; no search for walls or users.

    What is not given is chosen by where the energy is. Writes to `--out` (default
    `out/NAME-image/`) the image (`image.npz`), what was chosen (`image.json`), and its pictures:
    the brightest voxels from three sides, and three planes through the brightest one.
    """
    with told_clearly():
        with stdout_kept_clean():
            from mmslam.commands.focus import image_lines, image_to_folder
            from mmslam.region import ANY

            document, folder = image_to_folder(
                measurement,
                sample=sample,
                folder=out,
                x=x or ANY,
                y=y or ANY,
                z=z or ANY,
                pixel=pixel,
                min_range=min_range,
                max_range=max_range,
            )
        if as_json:
            print_json(document)
            return
        for line in image_lines(document, folder):
            typer.echo(visible(line))


def track(
    measurements: Annotated[
        Path, typer.Argument(metavar="FILE.zarr", help="A dataset whose samples are times.")
    ],
    step: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Time between samples [what `time` in FILE says]."),
    ] = None,
    acceleration: Annotated[
        float | None,
        typer.Option(
            metavar="M2_S3",
            help="How freely users move: spectral density [0.5, of somebody who walks].",
        ),
    ] = None,
    out: OutFolder = None,
    as_json: AsJson = False,
) -> None:
    """Follow users that move: locate them at each time, and join the answers to tracks.

    Outliers are dropped, ambiguous answers decided, times without one bridged. Writes the tracks
    and their figure to `--out` (default `out/FILE-track/`).
    """
    with told_clearly():
        from mmslam.terminal.stage_progress import StageProgress

        with stdout_kept_clean(), StageProgress() as progress:
            from mmslam.commands.track import track_lines, track_to_folder

            tracked = track_to_folder(
                measurements, folder=out, step=step, acceleration=acceleration, progress=progress
            )
        if as_json:
            print_json(tracked.document)
            return
        for line in track_lines(tracked.document, tracked.folder):
            typer.echo(visible(line))


def view(
    place: Annotated[
        Path,
        typer.Argument(
            metavar="OUT", help="A folder that run, locate, track or image wrote, or a page."
        ),
    ],
    as_json: AsJson = False,
) -> None:
    """Open the page of a result in the browser; without a display, print where it is."""
    with told_clearly():
        from mmslam.commands.view import opened, page_of

        page = page_of(place)
        with stdout_kept_clean():
            seen = opened(page)
        if as_json:
            print_json({"page": str(page), "opened": seen})
        else:
            typer.echo(visible(f"{'opened' if seen else 'open'} {page}"))


def _picture(show: bool, out: Path | None, name: str) -> Path | None:
    if not show:
        if out is not None:
            raise typer.BadParameter("--out says where the picture goes; add --show")
        return None
    return out or Path("out") / name
