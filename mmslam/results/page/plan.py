"""What the page of a result draws: images, what was found, the truth, and the user's prediction."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from estimator.array.array_frame import ArrayFrame, array_frame
from estimator.array.planar_array import planar_frame
from estimator.measurement.model import Measurement, MeasurementError
from estimator.prediction.wall_reflection import (
    ASSUMED_DB,
    ASSUMED_DEVIATION_DB,
    wall_reflections,
)
from estimator.results.estimate import Estimate, Image, Mirror, Target, UserEstimate
from mmslam.results.document import plain
from mmslam.results.page.level_codes import coded_levels
from validation.figures import views
from validation.metrics.truth import Truth

FLOOR_DB = -60.0
"""Lowest level of the colour scale, below the peak: that of a strong mirror's sidelobes. [dB]"""

MOST_PIXELS = 640
"""Along one side of a plane's image: what a screen shows of a plan. [-]"""

MOST_VOXELS = 96
"""Along one side of a volume. [-]"""

MOST_POSITIONS = 4096
"""Of the array that are drawn; of more, evenly chosen ones. [-]"""

DIGITS = 6
"""Of drawn coordinates in metres: a micrometre. [-]"""

MOST_BOUNCES = 3
"""Of the chains that a dragged user is predicted over. [-]"""

MOST_CHAINS = 20_000
"""Chains of mirrors that a browser tries while a user is dragged, in some 20 ms. [-]"""

HEADROOM = 0.5
"""Above and below all that was found, for a user that is moved. [m]"""

_REGION = 5.99  # χ² of two coordinates that holds 95 %
_CIRCLE = np.linspace(0, 2 * np.pi, 61)


def plan_document(
    measurement: Measurement, estimate: Estimate, truth: Truth, *, dimensions: int
) -> dict[str, Any]:
    """Lay out what the page draws, in the world's frame and metres.

    Parameters
    ----------
    measurement
        What the estimate was made from.
    estimate
        What was found.
    truth
        Is drawn where it is known.
    dimensions
        2 for a linear array, 3 for a planar one.
    """
    positions = measurement.places
    view = _view(estimate, truth, positions)
    document = {
        "dimensions": dimensions,
        "view": {"x": [view.left, view.right], "y": [view.bottom, view.top]},
        "images": _images(estimate, view),
        "volumes": _volumes(estimate),
        "array": drawn_positions(positions),
        "mirrors": [
            mirror_document(index, mirror) for index, mirror in enumerate(estimate.mirrors)
        ],
        "targets": [_target(index, target) for index, target in enumerate(estimate.targets)],
        "users": [_user(user) for user in estimate.users],
        "truth": {
            "walls": [
                {"name": name, "line": [start.tolist(), truth.wall_end[name].tolist()]}
                for name, start in truth.wall_start.items()
                if name in truth.wall_end
            ],
            "users": _named(truth.user_position),
            "targets": _named(truth.target_position),
        },
        "prediction": prediction_document(measurement, estimate, dimensions=dimensions),
        "heights": _heights(estimate, positions),
        "assumed_db": ASSUMED_DB,
        "assumed_deviation_db": ASSUMED_DEVIATION_DB,
    }
    return plain(document)


def prediction_document(
    measurement: Measurement, estimate: Estimate, *, dimensions: int
) -> dict[str, Any] | None:
    """Lay out the map over which ``predicted_paths.js`` predicts a user's paths.

    Parameters
    ----------
    measurement, estimate, dimensions
        As in :func:`plan_document`.

    Returns
    -------
    The document; None where no frame of a linear or planar array, or no frequency, is known.
    """
    measured = measurement.echo or next(iter(measurement.uplinks), None)
    frame = None if measured is None else _frame(measurement, dimensions)
    if measured is None or frame is None:
        return None
    mirrors = estimate.mirrors
    known = wall_reflections(len(mirrors))
    return {
        "dimensions": dimensions,
        "frame": {"origin": frame.origin.tolist(), "axes": frame.axes.tolist()},
        "frequency_hz": float(np.mean(measured.frequencies)),
        "mirrors": [_outline(mirror) for mirror in mirrors],
        "screens": [target.ends.tolist() for target in estimate.targets if target.ends is not None],
        "level_db": known.level_db.tolist(),
        "deviation_db": np.sqrt(np.diag(known.covariance)).tolist(),
        "max_bounces": _bounces(estimate),
    }


def mirror_document(index: int, mirror: Mirror) -> dict[str, Any]:
    """Lay out a mirror, with what the pointer is told of it.

    Parameters
    ----------
    index
        Its number in the estimate.
    mirror
        Of a linear or a planar array.
    """
    return {
        "name": f"mirror {index}",
        "line": [mirror.start.tolist(), mirror.end.tolist()],
        "corners": None if mirror.corners is None else mirror.corners.tolist(),
        "confidence": mirror.confidence,
        "level_db": mirror.level_db if np.isfinite(mirror.level_db) else None,
        "offset_deviation_m": float(np.sqrt(max(mirror.covariance[-1, -1], 0.0))),
        "seen_through": list(mirror.seen_through),
    }


def drawn_positions(positions: Float[np.ndarray, "positions 3"]) -> list[list[float]]:
    """Return the array's positions, at most :data:`MOST_POSITIONS` of them. [m].

    Parameters
    ----------
    positions
        Phase centres. [m]
    """
    chosen = positions[:: -(-len(positions) // MOST_POSITIONS)]
    listed: list[list[float]] = np.round(chosen, DIGITS).tolist()
    return listed


def ellipse(
    place: Float[np.ndarray, " 3"], covariance: Float[np.ndarray, "n n"]
) -> list[list[float]]:
    """Return a closed line round the 95 % region of a position in the plan. [m].

    Parameters
    ----------
    place
        Its middle. [m]
    covariance
        Of x, y and maybe more. [m²]
    """
    values, axes = np.linalg.eigh(covariance[:2, :2])
    radii = np.sqrt(_REGION * np.maximum(values, 0.0))
    circle = axes @ (radii[:, None] * np.stack([np.cos(_CIRCLE), np.sin(_CIRCLE)]))
    line: list[list[float]] = (place[:2, None] + circle).T.tolist()
    return line


def _view(
    estimate: Estimate, truth: Truth, positions: Float[np.ndarray, "positions 3"]
) -> views.View:
    points = [views.estimate_points(estimate, positions), views.ghost_points(estimate)]
    points += [np.stack(list(some.values())) for some in _places(truth) if some]
    points += [mirror.corners for mirror in estimate.mirrors if mirror.corners is not None]
    points += [
        views.bright_points(image)
        for image in (estimate.raw_image, estimate.corrected_image)
        if image is not None and np.any(image.values)
    ]
    return views.view_around(np.concatenate(points))


def _places(truth: Truth) -> Sequence[dict[str, Float[np.ndarray, " 3"]]]:
    return truth.user_position, truth.wall_start, truth.wall_end, truth.target_position


def _images(estimate: Estimate, view: views.View) -> dict[str, Any]:
    """Code both images within the view; of volumes, the brightest pixel along z."""
    found = {"raw": estimate.raw_image, "corrected": estimate.corrected_image}
    return {name: _plane(image, view) for name, image in found.items() if image is not None}


def _plane(image: Image, view: views.View) -> dict[str, Any]:
    columns = _within(image.grid.x, view.left, view.right)
    rows = _within(image.grid.y, view.bottom, view.top)
    axes = {"x": image.grid.x[columns], "y": image.grid.y[rows]}
    values = views.brightest_plane(image)[columns, rows]
    return coded_levels(values, axes, floor_db=FLOOR_DB, most=MOST_PIXELS)


def _within(axis: Float[np.ndarray, " _"], first: float, last: float) -> slice:
    start, stop = np.searchsorted(axis, [first, last])
    start = min(int(start), axis.size - 1)
    return slice(start, max(int(stop), start + 1))


def _volumes(estimate: Estimate) -> dict[str, Any]:
    found = {"raw": estimate.raw_image, "corrected": estimate.corrected_image}
    return {
        name: coded_levels(
            image.values,
            {"x": image.grid.x, "y": image.grid.y, "z": image.grid.z},
            floor_db=FLOOR_DB,
            most=MOST_VOXELS,
        )
        for name, image in found.items()
        if image is not None and image.values.ndim == 3
    }


def _outline(mirror: Mirror) -> list[list[float]]:
    corners = np.stack([mirror.start, mirror.end]) if mirror.corners is None else mirror.corners
    line: list[list[float]] = corners.tolist()
    return line


def _target(index: int, target: Target) -> dict[str, Any]:
    spread = target.covariance
    return {
        "name": f"target {index}",
        "position": target.position.tolist(),
        "ghost": target.ghost.tolist(),
        "seen_through": list(target.seen_through),
        "level_db": target.level_db,
        "ends": None if target.ends is None else target.ends.tolist(),
        "ellipse": None if spread is None else ellipse(target.position, spread),
    }


def _user(user: UserEstimate) -> dict[str, Any]:
    return {
        "name": user.name,
        "status": user.status.replace("_", " "),
        "position": None if user.position is None else user.position.tolist(),
        "path": None if user.path is None else user.path.tolist(),
        "ellipse": None
        if user.position is None or user.covariance is None
        else ellipse(user.position, user.covariance),
        "deviation_m": None
        if user.covariance is None
        else float(np.sqrt(max(float(np.trace(user.covariance)), 0.0))),
        "alternatives": [_user(other) for other in user.alternatives],
    }


def _named(places: dict[str, Float[np.ndarray, " 3"]]) -> list[dict[str, Any]]:
    return [{"name": name, "position": place.tolist()} for name, place in places.items()]


def _heights(estimate: Estimate, positions: Float[np.ndarray, "positions 3"]) -> list[float]:
    """Return the lowest, the highest and the first height of a user that is moved. [m]."""
    points = [views.estimate_points(estimate, positions)]
    points += [mirror.corners for mirror in estimate.mirrors if mirror.corners is not None]
    heights = np.concatenate(points)[:, 2]
    found = [user.position[2] for user in estimate.users if user.position is not None]
    first = float(found[0] if found else positions[:, 2].mean())
    return [float(heights.min()) - HEADROOM, float(heights.max()) + HEADROOM, first]


def _frame(measurement: Measurement, dimensions: int) -> ArrayFrame | None:
    find = array_frame if dimensions == 2 else planar_frame
    try:
        return find(measurement.places, measurement.boresight)
    except MeasurementError:
        return None


def _bounces(estimate: Estimate) -> int:
    """Return the most mirrors of a chain that the estimate holds: 1 to :data:`MOST_BOUNCES`."""
    count = len(estimate.mirrors)
    chains = [mirror.seen_through for mirror in estimate.mirrors]
    chains += [target.seen_through for target in estimate.targets]
    answers = [other for user in estimate.users for other in (user, *user.alternatives)]
    met = [len(chain) for chain in chains] + [answer.bounces or 0 for answer in answers]
    most = min(max([1, *met]), MOST_BOUNCES)
    while most > 1 and count * max(count - 1, 1) ** (most - 1) > MOST_CHAINS:
        most -= 1
    return most
