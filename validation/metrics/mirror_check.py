"""Comparison of reported mirrors with the true walls on which they lie."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from estimator.results.estimate import Estimate, Mirror
from validation.metrics.coverage import normalised_square
from validation.metrics.errors import distances_from_segment, nearest_wall, wall_error
from validation.metrics.truth import Truth

ON_WALL = 0.01
"""Distance from a wall within which a point counts as on it: a cell λ/2D at 1 m. [m]"""
SHARE_ON_WALL = 0.8
"""Share of a mirror that must be on true walls: the error of its ends is some cells. [-]"""
TURNED = np.radians(1.0)
"""Angle from a wall beyond which a mirror may be false: at 0.5 m it moves a user by 2 cm. [rad]"""
DEVIATIONS = float(norm.isf(0.0005))
"""Error of the angle, in stated standard deviations, that a false mirror must exceed as well:
outside the 99.9 % interval. The stated deviation of a wall of some 20 cells, such as one of 7 cm,
is 1°. [-]"""


@dataclass(frozen=True, kw_only=True)
class SeenMirror:
    """A reported mirror compared with the truth."""

    wall: str | None  # the true wall it lies on; None: it is false
    angle: float  # from the true wall's [rad]
    offset: float  # of the true wall's centre from it [m]
    confidence: float


def seen_mirrors(estimate: Estimate, truth: Truth) -> tuple[SeenMirror, ...]:
    """Compare all reported mirrors with the true walls."""
    return tuple(_seen(mirror, truth) for mirror in estimate.mirrors)


def _seen(mirror: Mirror, truth: Truth) -> SeenMirror:
    name = nearest_wall(mirror, truth)
    if name is None:
        return SeenMirror(wall=None, angle=np.nan, offset=np.nan, confidence=mirror.confidence)
    nearest = wall_error(mirror, name, truth.wall_start[name], truth.wall_end[name])
    places = np.linspace(mirror.start, mirror.end, 41)
    distances = [
        distances_from_segment(places, truth.wall_start[one], truth.wall_end[one])
        for one in truth.wall_start
    ]
    on_walls = np.mean(np.min(distances, axis=0) < ON_WALL)
    known_to = DEVIATIONS * float(np.sqrt(mirror.covariance[0, 0]))
    right = on_walls >= SHARE_ON_WALL and nearest.angle < max(TURNED, known_to)
    return SeenMirror(
        wall=name if right else None,
        angle=nearest.angle,
        offset=nearest.offset,
        confidence=mirror.confidence,
    )


def wall_square(mirror: Mirror, truth: Truth, name: str) -> float:
    """Return the square of a wall's errors of angle and offset, over their covariance. [-]."""
    along = (mirror.end - mirror.start)[:2]
    along = along / np.linalg.norm(along)
    true = (truth.wall_end[name] - truth.wall_start[name])[:2]
    true = true * np.sign(along @ true) / np.linalg.norm(true)
    tilt = float(np.arcsin(true[0] * along[1] - true[1] * along[0]))
    middle = 0.5 * (mirror.start + mirror.end)
    away = (middle - truth.wall_start[name])[:2]
    error = np.array([tilt, away[0] * true[1] - away[1] * true[0]])
    return normalised_square(error, mirror.covariance)
