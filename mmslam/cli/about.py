"""Commands ``validate``, ``design`` and ``info``: claims, radio design, this installation."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

import mmslam
from mmslam.cli.options import AsJson, OutFolder
from mmslam.cli.printing import print_json
from mmslam.terminal.exit_codes import BAD_INPUT, FALLS_SHORT, stdout_kept_clean, told_clearly


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
        from mmslam.commands import validate as commands

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
            print_json({**found, "drifted": gone})
        else:
            for line in gone:
                typer.echo(f"no longer holds: {line}")
            typer.echo(commands.summary_line(found))
            typer.echo(f"figures: {folder}")
        if gone or not found["passed"]:
            raise typer.Exit(FALLS_SHORT)


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
        found = mmslam.design(
            scenario,
            start_ghz=start_ghz,
            stop_ghz=stop_ghz,
            points=points,
            elements=elements,
            spacing_mm=spacing_mm,
            distance_m=distance_m,
            angle_deg=angle_deg,
        )
        if as_json:
            print_json(found.to_dict())
        else:
            typer.echo(repr(found))


def info(as_json: AsJson = False) -> None:
    """Show the backend, LLVM, threads and versions that this installation uses."""
    with told_clearly():
        from mmslam.commands.info import system_information

        with stdout_kept_clean():
            found = system_information()
        if as_json:
            print_json(found)
        else:
            for key, value in found.items():
                if isinstance(value, Mapping):
                    for package, number in value.items():
                        typer.echo(f"{package:<20} {number or 'not installed'}")
                elif value is not None:
                    typer.echo(f"{key.replace('_', ' '):<20} {value}")
        if found["backend"] is None:
            raise typer.Exit(BAD_INPUT)
