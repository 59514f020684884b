"""The result in a few lines of plain text, for a terminal."""

from collections.abc import Iterator, Mapping
from math import degrees, sqrt
from pathlib import Path
from typing import Any

from estimator.measurement.model import Measurement
from mmslam import own_results


def summary_lines(result: Mapping[str, Any], folder: Path) -> Iterator[str]:
    """Yield the lines of a result: users, mirrors and targets, notes, and the report's path.

    Parameters
    ----------
    result
        The document of ``result.json``.
    folder
        Where it was written.
    """
    yield from (_user(user) for user in result["users"])
    comparisons = result["comparison"]["mirrors"]
    for index, (mirror, error) in enumerate(zip(result["mirrors"], comparisons, strict=True)):
        yield _mirror(index, mirror, error)
    if not result["mirrors"]:
        yield "no mirror found"
    for index, target in enumerate(result["targets"]):
        yield f"target {index}: at {_point(target['position_m'])}"
    for name in result["comparison"]["walls_missed"]:
        yield f"not found: the true wall {name!r}"
    yield from (f"note: {note}" for note in result["notes"])
    seconds = sum(result["timings_s"].values())
    yield f"{seconds:.1f} s; open {folder / own_results.REPORT}"


def measurement_summary(measurement: Measurement) -> dict[str, Any]:
    """Count what a measurement holds."""
    measured = measurement.echo or next(iter(measurement.uplinks), None)
    return {
        "scenario": measurement.scenario,
        "seed": measurement.seed,
        "positions": len(measurement.places),
        "frequencies": 0 if measured is None else len(measured.frequencies),
        "echo": measurement.echo is not None,
        "users": [
            *(uplink.user for uplink in measurement.uplinks),
            *(listed.user for listed in measurement.path_lists),
        ],
    }


def _user(user: Mapping[str, Any]) -> str:
    status = str(user["status"]).replace("_", " ")
    if user["estimate_m"] is None:
        return f"{user['name']}: {status}" + (f" ({user['reason']})" if user["reason"] else "")
    line = f"{user['name']}: {status} at {_point(user['estimate_m'])}"
    if user["covariance_m2"] is not None:
        spread = sqrt(sum(user["covariance_m2"][axis][axis] for axis in range(3)))
        line += f" ± {1e3 * spread:.3f} mm"
    if user["aoa_deg"] is not None:
        line += f", angle {user['aoa_deg']:.3f}°, path {user['range_m']:.4f} m"
    if user["bounces"] is not None:
        line += f", {user['bounces']} bounce{'' if user['bounces'] == 1 else 's'}"
    if user.get("probability") is not None:
        line += f", probability {user['probability']:.4f}"
    if user["error_m"] is not None:
        line += f"; {1e3 * user['error_m']:.3f} mm from the truth"
    return line + (f" ({user['reason']})" if user["reason"] else "")


def _mirror(index: int, mirror: Mapping[str, Any], error: Mapping[str, Any]) -> str:
    angle, offset = (mirror["covariance"][axis][axis] for axis in (0, -1))
    line = (
        f"mirror {index}: {_point(mirror['start_m'])} to {_point(mirror['end_m'])}, "
        f"± {degrees(sqrt(angle)):.4f}° and {1e3 * sqrt(offset):.3f} mm"
    )
    if error["truth_name"] is not None:
        line += (
            f"; {error['angle_error_deg']:.4f}° and {1e3 * abs(error['offset_error_m']):.3f} mm "
            f"from {error['truth_name']!r}"
        )
    return line


def _point(point: list[float]) -> str:
    return "(" + ", ".join(f"{value:.4f}" for value in point) + ") m"
