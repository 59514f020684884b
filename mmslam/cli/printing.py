"""What commands print on stdout."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import typer

from mmslam.plain_text import json_text, visible


def print_json(document: Mapping[str, Any]) -> None:
    """Print one JSON document."""
    typer.echo(json_text(document))


def print_outcome(result: Mapping[str, Any], folder: Path, as_json: bool) -> None:
    """Print the result of a run or an estimate, as text or as one JSON document."""
    if as_json:
        print_json(result)
        return
    from mmslam.terminal.summary import summary_lines

    for line in summary_lines(result, folder):
        typer.echo(visible(line))


def print_written(path: Path, measurement: Any, as_json: bool, notes: Sequence[str] = ()) -> None:
    """Print a summary of a measurement file and the notes about its data."""
    from mmslam.terminal.summary import measurement_summary

    summary = measurement_summary(measurement)
    if as_json:
        print_json({"file": str(path), **summary, **({"notes": list(notes)} if notes else {})})
    else:
        told = [f"{key} {value}" for key, value in summary.items() if value is not None]
        typer.echo(visible(f"{path}: {', '.join(told)}"))
        for note in notes:
            typer.echo(visible(f"note: {note}"))
