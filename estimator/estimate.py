"""What the estimator answers: mirrors, targets, users, and the images behind them."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Complex, Float

from estimator.pixel_grid import PixelGrid

Status = Literal["found", "not_found", "ambiguous"]

Progress = Callable[[str, int, int], None]
"""Called with the name of a stage, the steps done and the steps in all."""


@dataclass(frozen=True, kw_only=True)
class Image:
    """A complex SAR image on its grid; an ideal unit point target peaks at 1."""

    values: Complex[np.ndarray, "*grid"]
    grid: PixelGrid


@dataclass(frozen=True, kw_only=True)
class AngleRangeMap:
    """The spherical-wave matched filter of one user's pilot over angle and path length."""

    values: Complex[np.ndarray, "angles ranges"]
    aoa: Float[np.ndarray, " angles"]  # from the array's axis [rad]
    path_length: Float[np.ndarray, " ranges"]  # [m]
    user: str


@dataclass(frozen=True, kw_only=True)
class Mirror:
    """A flat wall of finite extent, at its true (folded) place."""

    start: Float[np.ndarray, " 3"]  # [m]
    end: Float[np.ndarray, " 3"]  # [m]
    normal: Float[np.ndarray, " 3"]  # unit vector towards the array
    covariance: Float[np.ndarray, "2 2"]  # of (angle [rad], offset along the normal [m])
    confidence: float  # probability that the wall is not made of noise and clutter
    level_db: float  # mean intensity along it over the image's background
    seen_through: tuple[int, ...] = ()  # indices of mirrors, from the array outward


@dataclass(frozen=True, kw_only=True)
class Target:
    """An object that is no mirror."""

    position: Float[np.ndarray, " 3"]  # [m]
    ghost: Float[np.ndarray, " 3"]  # where the raw image shows it [m]
    seen_through: tuple[int, ...] = ()


@dataclass(frozen=True, kw_only=True)
class UserEstimate:
    """Where one user is, or why that cannot be said."""

    name: str
    status: Status
    reason: str | None = None
    position: Float[np.ndarray, " 3"] | None = None  # [m]
    covariance: Float[np.ndarray, "3 3"] | None = None  # [m²]
    bounces: int | None = None
    aoa: float | None = None  # [rad]
    path_length: float | None = None  # [m]
    path: Float[np.ndarray, "vertices 3"] | None = None  # array → mirrors → user [m]
    alternatives: tuple["UserEstimate", ...] = ()


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """The whole answer to one measurement."""

    users: tuple[UserEstimate, ...]
    mirrors: tuple[Mirror, ...]
    targets: tuple[Target, ...] = ()
    raw_image: Image | None = None
    corrected_image: Image | None = None
    maps: tuple[AngleRangeMap, ...] = ()  # one for each user
    close_ups: tuple[AngleRangeMap, ...] = ()  # the same, finely around each map's answer or peak
    notes: tuple[str, ...] = ()  # what was assumed or could not be done
    timings: dict[str, float] = field(default_factory=dict)  # stage → duration [s]
