"""The result as one JSON document: SI, null where unknown, the same bytes for the same run."""

import math
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from platform import python_version
from typing import Any

import numpy as np

from estimator.compute import engine
from estimator.measurement.model import Measurement
from estimator.results.estimate import Check, Estimate, Mirror, Target, UserEstimate
from mmslam.own_results import FORMAT
from mmslam.plain_text import json_text
from validation.metrics.errors import WallError, position_error, wall_errors
from validation.metrics.truth import Truth

PACKAGES = (
    "mmslam",
    "drjit",
    "finufft",
    "karellen-llvm-core",
    "mitsuba",
    "numpy",
    "scipy",
    "sionna-rt",
    "xarray",
    "zarr",
)
"""The packages whose version may change a result."""

_FLATNESS = 1e-9  # of an aperture, over its length: below it, rounding makes a plane of a line


def result_document(
    measurement: Measurement,
    estimate: Estimate,
    truth: Truth,
    *,
    timings: Mapping[str, float] | None = None,
) -> dict[str, Any]:
    """Return the estimate as a document, with its errors where the truth is known.

    Parameters
    ----------
    measurement
        What the estimate was made from.
    estimate
        What was found.
    truth
        What it is compared with; users in it that the measurement lacks are listed as not found.
    timings
        Stages besides the estimator's own. [s]
    """
    heard = {user.name for user in estimate.users}
    unheard = [
        UserEstimate(name=name, status="not_found", reason="the measurement holds no uplink of it")
        for name in truth.user_position
        if name not in heard
    ]
    errors = wall_errors(estimate.mirrors, truth)
    document = {
        "format": FORMAT,
        "scenario": measurement.scenario,
        "seed": measurement.seed,
        "dimensions": dimensions(measurement),
        "waves": measurement.waves,
        "backend": engine.backend(),
        "versions": versions(),
        "users": [_user(user, truth) for user in (*estimate.users, *unheard)],
        "mirrors": [_mirror(mirror) for mirror in estimate.mirrors],
        "targets": [_target(target) for target in estimate.targets],
        "comparison": {
            "mirrors": [_wall_error(error) for error in errors],
            "walls_missed": sorted(
                set(truth.wall_start) - {error.wall for error in errors if error is not None}
            ),
        },
        "checks": [_check(check) for check in estimate.checks],
        "notes": estimate.notes,
        "timings_s": {**(timings or {}), **estimate.timings},
    }
    return plain(document)


def plain(document: Mapping[str, Any]) -> dict[str, Any]:
    """Convert the values of a document to JSON types; NaN and infinity become null."""
    turned = _plain(document)
    assert isinstance(turned, dict)
    return turned


def to_json(document: Mapping[str, Any]) -> str:
    """Write a document as JSON text; NaN raises ValueError (:func:`plain` turns it into null)."""
    return json_text(document) + "\n"


def versions() -> dict[str, str | None]:
    """Return the versions of Python and of :data:`PACKAGES`, None where one is absent."""
    found: dict[str, str | None] = {"python": python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = None
    return found


def dimensions(measurement: Measurement) -> int:
    """Return 2 if the aperture is a line (its answer lies in the plane z = 0), else 3."""
    lists = measurement.path_lists
    if measurement.echo is None and not measurement.uplinks:
        return 2 if any(one.elevation is None for one in lists) else 3
    positions = np.concatenate(
        [part.positions for part in (measurement.echo, *measurement.uplinks) if part is not None]
    )
    sizes = np.linalg.svd(positions - positions.mean(axis=0), compute_uv=False)
    return 2 if len(sizes) < 2 or sizes[1] <= _FLATNESS * sizes[0] else 3


def _check(check: Check) -> dict[str, Any]:
    return {
        "user": check.user,
        "data": check.data,
        "late_m": check.shift,
        "late_deviation_m": check.deviation,
        "agrees": check.agrees,
        "text": check.text,
    }


def _user(user: UserEstimate, truth: Truth) -> dict[str, Any]:
    true_position = truth.user_position.get(user.name)
    return {
        "name": user.name,
        "status": user.status,
        "reason": user.reason,
        # Posterior probability of the position, given map, paths and priors; null if not computed.
        "probability": user.probability,
        "estimate_m": user.position,
        "covariance_m2": user.covariance,
        "line_of_sight": user.line_of_sight,
        "bounces": user.bounces,
        "method": user.method,
        "aoa_deg": None if user.aoa is None else math.degrees(user.aoa),
        "elevation_deg": None if user.elevation is None else math.degrees(user.elevation),
        "range_m": user.path_length,
        "path_m": user.path,
        "truth_m": true_position,
        "error_m": position_error(user.position, true_position),
        "clock_offset_s": user.clock_offset,
        "clock_deviation_s": user.clock_deviation,
        "paths": [
            {
                "aoa_deg": math.degrees(path.aoa),
                "elevation_deg": None if path.elevation is None else math.degrees(path.elevation),
                "range_m": path.path_length,
                "share": path.share,
                "mirrors": path.mirrors,
                "used": path.used,
                "reason": path.reason,
            }
            for path in user.paths
        ],
        "alternatives": [_user(other, truth) for other in user.alternatives],
    }


def _mirror(mirror: Mirror) -> dict[str, Any]:
    return {
        "start_m": mirror.start,
        "end_m": mirror.end,
        "corners_m": mirror.corners,
        "normal": mirror.normal,
        # Of the angle [rad] and the offset [m]; in 3-D of two angles and the offset.
        "covariance": mirror.covariance,
        "confidence": mirror.confidence,
        "level_db": mirror.level_db,
        "seen_through": mirror.seen_through,
    }


def _target(target: Target) -> dict[str, Any]:
    return {
        "position_m": target.position,
        "ghost_m": target.ghost,
        "seen_through": target.seen_through,
        "covariance_m2": target.covariance,
        "level_db": target.level_db,  # over an ideal unit point target
        "ends_m": target.ends,  # null: no wider than the resolution
    }


def _wall_error(error: WallError | None) -> dict[str, Any]:
    if error is None:
        return {"truth_name": None, "angle_error_deg": None, "offset_error_m": None}
    return {
        "truth_name": error.wall,
        "angle_error_deg": math.degrees(error.angle),
        "offset_error_m": error.offset,
        "covered": error.covered,
        "overhang_m": error.overhang,
    }


def _plain(value: Any) -> Any:
    """Turn arrays and tuples into lists, NumPy numbers into Python's, NaN and inf into None."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
