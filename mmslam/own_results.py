"""Recognition of folders that mmslam wrote, which new results may replace."""

import json
from pathlib import Path
from typing import Any

RESULT = "result.json"
MEASUREMENT = "measurement.zarr"
REPORT = "report.html"
TRACK = "track.json"
TRACK_FIGURE = "track.png"
TRACK_PAGE = "track.html"
IMAGE = "image.json"
FORMAT = 1

FIGURES = ("raw_image.png", "corrected_image.png", "angle_range_map.png", "localization.png")


IMAGE_PARTS = ("image.npz", "image.png", "cuts.png")


def refuse_foreign_results(folder: Path) -> str | None:
    """Say why a folder may not be replaced by new results; None if an earlier run made it."""
    return _refuse_foreign(
        folder, RESULT, {"users", "mirrors", "versions"}, {MEASUREMENT, REPORT, *FIGURES}
    )


def refuse_foreign_track(folder: Path) -> str | None:
    """Say why a folder may not be replaced by a new track; None if an earlier one is in it."""
    return _refuse_foreign(folder, TRACK, {"tracks", "versions"}, {TRACK_FIGURE, TRACK_PAGE})


def refuse_foreign_image(folder: Path) -> str | None:
    """Say why a folder may not be replaced by a new image; None if an earlier one is in it."""
    return _refuse_foreign(folder, IMAGE, {"pixels", "peak_m", "method"}, set(IMAGE_PARTS))


def _refuse_foreign(folder: Path, main: str, keys: set[str], beside: set[str]) -> str | None:
    names = {entry.name for entry in folder.iterdir()}
    if not names:
        return None
    document = _json(folder / main)
    if document.get("format") != FORMAT or not keys <= document.keys():
        return f"it is not empty and no earlier run of mmslam made it (no {main} of ours in it)"
    foreign = sorted(name for name in names - {main, *beside} if not name.startswith("."))
    if foreign:
        return f"it holds what mmslam did not write ({', '.join(foreign[:3])})"
    return None


def refuse_foreign_store(folder: Path) -> str | None:
    """Say why a folder may not be replaced by a new measurement; None if it is one of ours."""
    if not any(folder.iterdir()):
        return None
    root = _json(folder / "zarr.json")
    if "mmslam_format" not in (root.get("attributes") or {}):
        return "it is not a measurement that mmslam wrote"
    return None


def _json(path: Path) -> dict[str, Any]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return document if isinstance(document, dict) else {}
