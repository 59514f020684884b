"""How far an estimate is from the truth: users in metres, walls by angle, offset and extent."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from estimator.estimate import Mirror
from validation.truth import Truth


@dataclass(frozen=True, kw_only=True)
class WallError:
    """An estimated mirror beside the true wall nearest to it."""

    wall: str
    angle: float  # between the two planes, unsigned [rad]
    offset: float  # of the true wall's centre from the estimated plane, + towards the array [m]
    covered: float  # share of the true wall's length that the estimate spans [-]
    overhang: float  # length of the estimate beyond the true wall's ends [m]


def position_error(
    estimate: Float[np.ndarray, " 3"] | None, truth: Float[np.ndarray, " 3"] | None
) -> float | None:
    """Return the distance of an estimate from the truth, None if one is unknown [m]."""
    if estimate is None or truth is None:
        return None
    return float(np.linalg.norm(estimate - truth))


def wall_error(
    mirror: Mirror,
    name: str,
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
) -> WallError:
    """Compare an estimated mirror with a true wall from ``start`` to ``end``.

    The offset is taken at the true wall's centre, so an error of the angle does not count
    in it twice.
    """
    length = float(np.linalg.norm(end - start))
    direction = (end - start) / length
    found = mirror.end - mirror.start
    # atan2 of sine and cosine: arccos alone resolves no angle below 1e-8 rad.
    sine = np.linalg.norm(np.cross(direction, found))
    angle = float(np.arctan2(sine, abs(direction @ found)))
    offset = float(mirror.normal @ ((start + end) / 2 - mirror.start))
    along = sorted(float(direction @ (point - start)) for point in (mirror.start, mirror.end))
    inside = max(min(along[1], length) - max(along[0], 0.0), 0.0)
    return WallError(
        wall=name,
        angle=angle,
        offset=offset,
        covered=inside / length,
        overhang=along[1] - along[0] - inside,
    )


def nearest_wall(mirror: Mirror, truth: Truth) -> str | None:
    """Name the true wall that an estimated mirror lies nearest to, None if none is known.

    Nearest by the mean distance of the mirror's ends and centre from the wall's segment,
    so that a wall crossed at a right angle does not win.
    """
    names = [name for name in truth.wall_start if name in truth.wall_end]
    if not names:
        return None
    points = np.stack([mirror.start, (mirror.start + mirror.end) / 2, mirror.end])
    distances = [
        float(np.mean(_from_segment(points, truth.wall_start[name], truth.wall_end[name])))
        for name in names
    ]
    return names[int(np.argmin(distances))]


def wall_errors(mirrors: Sequence[Mirror], truth: Truth) -> tuple[WallError | None, ...]:
    """Compare each estimated mirror with the true wall nearest to it."""
    names = (nearest_wall(mirror, truth) for mirror in mirrors)
    return tuple(
        None
        if name is None
        else wall_error(mirror, name, truth.wall_start[name], truth.wall_end[name])
        for mirror, name in zip(mirrors, names, strict=True)
    )


def _from_segment(
    points: Float[np.ndarray, "points 3"],
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
) -> Float[np.ndarray, " points"]:
    along = end - start
    share = np.clip((points - start) @ along / (along @ along), 0.0, 1.0)
    distances: np.ndarray = np.linalg.norm(points - (start + share[:, None] * along), axis=-1)
    return distances
