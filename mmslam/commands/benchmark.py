"""The command ``benchmark``: parts, reference predictions and scores, and their messages."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from mmslam.benchmark import scoring
from mmslam.benchmark.making import make_part
from mmslam.benchmark.recipe import TRACKS, load_recipe
from mmslam.benchmark.reference_methods import METHODS, predict
from mmslam.output import OutputError, reserved
from mmslam.plain_text import json_text
from mmslam.terminal.interruption import ResumableInterruption
from mmslam.terminal.task_progress import WorkProgress
from simulator.dataset.task_runner import WorkError, Workers


def tracks() -> dict[str, Any]:
    """Return what tracks there are, as a document."""
    found = {}
    for track in TRACKS:
        recipe = load_recipe(track)
        found[track] = {
            "title": recipe.title,
            "version": recipe.version,
            "recipe": recipe.digest,
            "inputs": list(recipe.inputs),
            "parts": {part: one.samples for part, one in recipe.parts.items()},
            "methods": list(METHODS[track]),
        }
    return found


def track_lines(document: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines that describe the document of :func:`tracks`."""
    for track, one in document.items():
        parts = ", ".join(f"{part} {count}" for part, count in one["parts"].items())
        yield f"{track} {one['version']}: {one['title']}"
        yield f"  inputs {', '.join(one['inputs'])}; samples: {parts}; recipe {one['recipe'][:12]}"


def make(
    track: str, parts: list[str], folder: Path, *, size: int | None, workers: Workers
) -> dict[str, Any]:
    """Make parts with their progress on stderr; return the document for JSON."""
    made = []
    try:
        for part in parts:
            with WorkProgress("samples") as progress:
                made.append(
                    make_part(track, part, folder, size=size, workers=workers, tell=progress)
                )
    except WorkError as error:
        raise OutputError(str(error)) from error
    except KeyboardInterrupt:
        raise ResumableInterruption("interrupted: the same command goes on") from None
    return {"folder": str(folder), "parts": made}


def score_file(
    track: str, predictions: Path, *, part: str, size: int | None, output: Path | None
) -> dict[str, Any]:
    """Score predictions and write the document beside them; return it."""
    target = output or predictions.with_suffix(".score.json")
    if target.exists() and not _is_score(target):
        raise OutputError(f"{target} exists and is no score; move it away or choose another file")
    found = scoring.score(track, predictions, part=part, size=size)
    with reserved(target):
        new = target.with_name(f"{target.name}.part")
        new.write_text(json_text(found) + "\n", encoding="utf-8")
        new.replace(target)
    return {**found, "file": str(target)}


def predict_file(track: str, store: Path, file: Path, *, method: str) -> dict[str, Any]:
    """Write the predictions of a reference method, with progress; return the document."""
    with WorkProgress("samples") as progress:
        rows = predict(
            track, store, file, method=method, tell=lambda done, total: progress(done, 0, total)
        )
    return {"file": str(file), "track": track, "method": method, "rows": rows}


def _is_score(path: Path) -> bool:
    """Tell whether a file is an earlier score, which may be replaced."""
    try:
        return "benchmark" in json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, TypeError):
        return False
