"""Errors of estimates: of users in metres, of walls by angle, offset and extent."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from estimator.results.estimate import Mirror
from validation.metrics.truth import Truth


@dataclass(frozen=True, kw_only=True)
class WallError:
    """An estimated mirror compared with the true wall nearest to it."""

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

    The offset is taken at the true wall's centre, so that it does not include the error of the
    angle.
    """
    length = float(np.linalg.norm(end - start))
    direction = (end - start) / length
    found = mirror.end - mirror.start
    # atan2 of sine and cosine: arccos alone does not resolve angles below 1e-8 rad.
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
    """Return the name of the true wall nearest to an estimated mirror, None without walls.

    The distance is the mean over the mirror's ends and centre from the wall's segment, so that
    a wall crossed at a right angle is not the nearest.
    """
    names = [name for name in truth.wall_start if name in truth.wall_end]
    if not names:
        return None
    points = np.stack([mirror.start, (mirror.start + mirror.end) / 2, mirror.end])
    distances = [
        float(np.mean(distances_from_segment(points, truth.wall_start[name], truth.wall_end[name])))
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


def distances_from_segment(
    points: Float[np.ndarray, "points 3"],
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
) -> Float[np.ndarray, " points"]:
    """Return the distances of points from the nearest point of a segment [m]."""
    along = end - start
    share = np.clip((points - start) @ along / (along @ along), 0.0, 1.0)
    distances: np.ndarray = np.linalg.norm(points - (start + share[:, None] * along), axis=-1)
    return distances


@dataclass(frozen=True, kw_only=True)
class ErrorSummary:
    """Position errors of many trials; those without a position have an infinite error."""

    errors: Float[np.ndarray, " found"]  # of the positions found, in ascending order [m]
    trials: int  # in all, with those without a position [-]

    @property
    def missing(self) -> int:
        """Number of trials without a position."""
        return self.trials - len(self.errors)

    @property
    def median(self) -> float:
        """Error not exceeded in half of all trials. [m]."""
        return self.within(0.5)

    @property
    def ninth_decile(self) -> float:
        """Error not exceeded in 90 % of all trials. [m]."""
        return self.within(0.9)

    @property
    def worst(self) -> float:
        """Error not exceeded in any trial. [m]."""
        return self.within(1.0)

    @property
    def rms(self) -> float:
        """Root mean square of the errors of positions found; NaN without any. [m]."""
        return float(np.sqrt(np.mean(self.errors**2))) if self.errors.size else float("nan")

    def within(self, share: float) -> float:
        """Return the least error not exceeded in a share of all trials; inf if there is none. [m].

        It is the smallest of the errors whose rank is at least that share, without interpolation.
        """
        rank = max(int(np.ceil(share * self.trials - 1e-9)), 1)
        return float(self.errors[rank - 1]) if rank <= len(self.errors) else float("inf")

    def cdf(self, limits: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Return the share of all trials whose error does not exceed each limit. [-]."""
        counts = np.searchsorted(self.errors, limits, side="right")
        return np.asarray(counts / self.trials)


def error_summary(errors: Sequence[float | None]) -> ErrorSummary:
    """Summarise the position errors of trials; ``None`` is a trial without a position.

    Raises
    ------
    ValueError
        If there is no trial, or an error is negative or NaN.
    """
    if not errors:
        raise ValueError("no trials to sum up; give at least one error, or None for no answer")
    found = np.sort(np.array([error for error in errors if error is not None], dtype=np.float64))
    if np.any(~(found >= 0)):
        raise ValueError(f"errors = {found.tolist()}: a distance cannot be negative or NaN")
    return ErrorSummary(errors=found, trials=len(errors))
