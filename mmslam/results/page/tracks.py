"""What the page of tracks draws: the room, the users' ways, and where each is at a time."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from estimator.results.estimate import Mirror
from estimator.tracking.multi_hypothesis import TrackPoint
from mmslam.moving_users import MovingUser
from mmslam.results.page.plan import drawn_positions, mirror_document
from validation.figures import views
from validation.metrics.errors import position_error

SCRIPTS_TRACK = ("plan.js", "track.js")
"""Of ``track.html.j2``."""

MOST_TIMES = 2000
"""Times that the page holds, evenly chosen: one for each pixel of the slider. [-]"""

_REGION = 5.99  # χ² of two coordinates that holds 95 %

Truths = Sequence[Mapping[str, Float[np.ndarray, " 3"]]]


def tracks_document(
    users: Sequence[MovingUser],
    truths: Truths,
    mirrors: Sequence[Mirror],
    positions: Float[np.ndarray, "positions 3"],
) -> dict[str, Any]:
    """Lay out what the page draws, in the world's frame, metres and seconds.

    Parameters
    ----------
    users
        Tracked through the same times.
    truths
        Where users truly are, at each time; empty where it is not known.
    mirrors
        Of the room, as the last measurement shows it.
    positions
        Of the array. [m]
    """
    times = users[0].times if users else ()
    step = max(-(-len(times) // MOST_TIMES), 1)
    kept = range(0, len(times), step)
    view = views.view_around(np.concatenate([positions, *_places(users, truths, mirrors)]))
    return {
        "title": ", ".join(user.name for user in users) or "nobody",
        "dimensions": 3 if any(mirror.corners is not None for mirror in mirrors) else 2,
        "view": {"x": [view.left, view.right], "y": [view.bottom, view.top]},
        "array": drawn_positions(positions),
        "mirrors": [mirror_document(index, mirror) for index, mirror in enumerate(mirrors)],
        "times": [times[index] for index in kept],
        "left_out": len(times) - len(kept),
        "tracks": [
            _track(user, [truths[index].get(user.name) for index in kept], kept) for user in users
        ],
    }


def _track(
    user: MovingUser, truths: Sequence[Float[np.ndarray, " 3"] | None], kept: Sequence[int]
) -> dict[str, Any]:
    points = {point.time: point for point in user.track.points}
    moments = []
    for index, truth in zip(kept, truths, strict=True):
        answer, point = user.answers[index], points.get(user.times[index])
        moments.append(
            {
                "status": answer.status.replace("_", " "),
                "located": _listed(answer.position),
                "truth": _listed(truth),
                "point": None if point is None else _point(point, truth),
            }
        )
    return {"name": user.name, "moments": moments}


def _point(point: TrackPoint, truth: Float[np.ndarray, " 3"] | None) -> dict[str, Any]:
    values, axes = np.linalg.eigh(point.covariance[:2, :2])
    radii = np.sqrt(_REGION * np.maximum(values, 0.0))
    return {
        "position": point.position.tolist(),
        "ellipse": [*radii.tolist(), float(np.arctan2(axes[1, 0], axes[0, 0]))],
        "deviation_m": float(np.sqrt(max(float(np.trace(point.covariance[:3, :3])), 0.0))),
        "speed_m_s": float(np.linalg.norm(point.velocity)),
        "bridged": point.candidate is None,
        "alternative": point.candidate or 0,
        "error_m": position_error(point.position, truth),
    }


def _places(
    users: Sequence[MovingUser], truths: Truths, mirrors: Sequence[Mirror]
) -> list[Float[np.ndarray, "places 3"]]:
    places = [np.array([point.position for point in user.track.points]) for user in users]
    places += [np.array(list(truth.values())) for truth in truths if truth]
    places += [np.stack([mirror.start, mirror.end]) for mirror in mirrors]
    return [some for some in places if len(some)]


def _listed(place: Float[np.ndarray, " 3"] | None) -> list[float] | None:
    listed: list[float] | None = None if place is None else place.tolist()
    return listed
