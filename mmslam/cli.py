"""The command line. Heavy packages are imported by the commands that need them."""

import os
from typing import Annotated, Literal

import typer

from mmslam import cli_data, cli_facts, cli_many, cli_room

app = typer.Typer(
    name="mmslam",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,  # a bug's traceback is best read whole and plain
    context_settings={"help_option_names": ["-h", "--help"]},
)


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


# In the order in which the help lists them.
app.command()(cli_room.scenes)
app.command()(cli_room.run)
app.command()(cli_room.simulate)
app.command()(cli_room.locate)
app.command()(cli_room.track)
app.command(name="import")(cli_data.import_)
app.command()(cli_data.export)
app.command()(cli_many.dataset)
app.command()(cli_many.sweep)
app.command()(cli_facts.validate)
app.command()(cli_facts.design)
app.command()(cli_facts.info)
