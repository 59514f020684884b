"""The command line. Heavy packages are imported by the commands that need them."""

import os
from typing import Annotated, Literal

import typer

from mmslam.cli import about, batch, benchmarking, data, room
from mmslam.cli.overriding_command import OverridingCommand

app = typer.Typer(
    name="mmslam",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,  # an internal error prints Python's plain, complete traceback
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
app.command(cls=OverridingCommand)(room.scenes)
app.command(cls=OverridingCommand)(room.run)
app.command(cls=OverridingCommand)(room.simulate)
app.command()(room.locate)
app.command()(room.image)
app.command()(room.track)
app.command()(room.view)
app.command(name="import")(data.import_)
app.command()(data.export)
app.command()(batch.dataset)
app.command()(batch.sweep)
app.command()(benchmarking.benchmark)
app.command()(about.validate)
app.command()(about.design)
app.command()(about.info)
