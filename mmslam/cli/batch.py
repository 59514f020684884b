"""Commands that make many samples: datasets and sweeps."""

from pathlib import Path
from typing import Annotated

import typer

from mmslam.cli.options import AsJson, DryRun, SchedulerAddress, WorkerCount
from mmslam.cli.printing import print_json
from mmslam.terminal.exit_codes import FALLS_SHORT, stdout_kept_clean, told_clearly


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
                from simulator.dataset.config import DatasetConfig
            print_json(DatasetConfig.model_json_schema())
            return
        if config is None or output is None:
            raise typer.BadParameter("needs CONFIG and --output FILE.zarr")
        with stdout_kept_clean():
            from mmslam.commands import dataset as commands

            where = commands.chosen_workers(workers, scheduler)
            if dry_run:
                found = commands.look_ahead(config, output, workers=max(where.processes, 1))
            else:
                found = commands.make(config, output, workers=where, retry_failed=retry_failed)
        if as_json:
            print_json(found)
        else:
            commands.print_lines(
                commands.forecast_lines(found) if dry_run else commands.lines(found)
            )
        if found.get("failed"):
            raise typer.Exit(FALLS_SHORT)


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
                from validation.sweep.sweep import SweepConfig
            print_json(SweepConfig.model_json_schema())
            return
        if config is None:
            raise typer.BadParameter("needs CONFIG")
        with stdout_kept_clean():
            from mmslam.commands import sweep as commands
            from mmslam.commands.dataset import chosen_workers, print_lines

            where = chosen_workers(workers, scheduler)
            kept = cache or commands.DEFAULT_CACHE
            if dry_run:
                found = commands.look_ahead(config, cache=kept, workers=max(where.processes, 1))
            else:
                folder = out or Path("out") / config.stem
                found = commands.run(config, folder, cache=kept, workers=where)
        if as_json:
            print_json(found)
        else:
            say = commands.forecast_lines if dry_run else commands.lines
            print_lines(say(found))
        if found.get("failed"):
            raise typer.Exit(FALLS_SHORT)
