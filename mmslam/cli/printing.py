"""What commands print on stdout."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import typer


def print_json(document: Mapping[str, Any]) -> None:
    """Print one JSON document."""
    typer.echo(json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False))


def print_outcome(result: Mapping[str, Any], folder: Path, as_json: bool) -> None:
    """Print what a run or an estimate gave."""
    if as_json:
        print_json(result)
        return
    from mmslam.terminal.summary import summary_lines

    for line in summary_lines(result, folder):
        typer.echo(line)


def print_written(path: Path, measurement: Any, as_json: bool) -> None:
    """Print what a measurement file holds."""
    from mmslam.terminal.summary import measurement_summary

    summary = measurement_summary(measurement)
    if as_json:
        print_json({"file": str(path), **summary})
    else:
        told = [f"{key} {value}" for key, value in summary.items() if value is not None]
        typer.echo(f"{path}: {', '.join(told)}")
