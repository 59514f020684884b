"""The command ``benchmark``."""

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from mmslam.cli.options import AsJson, WorkerCount
from mmslam.cli.printing import print_json
from mmslam.plain_text import visible
from mmslam.terminal.exit_codes import stdout_kept_clean, told_clearly


def benchmark(
    action: Annotated[
        Literal["tracks", "make", "baseline", "score"],
        typer.Argument(help="List the tracks, make parts, predict by a reference method, score."),
    ],
    track: Annotated[
        Literal["mirrors", "user", "channel"] | None, typer.Argument(metavar="TRACK")
    ] = None,
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE", help="baseline: the part's .zarr; score: predictions, .csv or .parquet."
        ),
    ] = None,
    part: Annotated[
        Literal["train", "validation", "test", "all"] | None,
        typer.Option(help="make: which one [all]; score: of what the predictions are [test]."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="make: the folder for the parts.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="baseline: predictions to write; score: its JSON [FILE.score.json].",
        ),
    ] = None,
    size: Annotated[
        int | None,
        typer.Option(min=1, help="The first samples of a part [as many as the recipe says]."),
    ] = None,
    method: Annotated[
        str, typer.Option(help="baseline: estimator, single_array, direct or chance.")
    ] = "estimator",
    workers: WorkerCount = None,
    as_json: AsJson = False,
) -> None:
    """Compare methods on a public benchmark: find mirrors, locate a user, predict a channel.

    `make` simulates the parts of a track from its frozen recipe, the same bytes wherever versions
    are the same; the test part holds no truth. `score` makes the truth and prints metrics with 95 %
    intervals. `baseline` writes predictions of a reference method.
    """
    with told_clearly():
        if action != "tracks" and track is None:
            raise typer.BadParameter(f"{action} needs a TRACK: mirrors, user or channel")
        with stdout_kept_clean():
            from mmslam.commands import benchmark as commands

            found: dict[str, Any]
            if action == "tracks":
                found = commands.tracks()
                told = list(commands.track_lines(found))
            elif action == "make":
                if out is None:
                    raise typer.BadParameter("make needs --out DIR")
                from mmslam.commands.dataset import chosen_workers

                parts = ["train", "validation", "test"] if part in (None, "all") else [str(part)]
                where = chosen_workers(workers, None)
                found = commands.make(str(track), parts, out, size=size, workers=where)
                told = [
                    f"{out}/{track}-{one['part']}.zarr: {one['samples']} samples, "
                    f"digest {one['digest'][:16]}"
                    for one in found["parts"]
                ]
            elif action == "baseline":
                if file is None or output is None:
                    raise typer.BadParameter(
                        "baseline needs the part's .zarr and --output FILE.csv"
                    )
                found = commands.predict_file(str(track), file, output, method=method)
                told = [f"{output}: {found['rows']} rows"]
            else:
                if file is None or part == "all":
                    raise typer.BadParameter("score needs a file of predictions, of one --part")
                found = commands.score_file(
                    str(track), file, part=part or "test", size=size, output=output
                )
                from mmslam.benchmark.scoring import lines

                told = [*lines(found), f"written to {found['file']}"]
        if as_json:
            print_json(found)
        else:
            for line in told:
                typer.echo(visible(line))
