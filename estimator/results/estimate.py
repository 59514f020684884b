"""What the estimator answers: mirrors, targets, users, and the images behind them."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Complex, Float, Int

from estimator.results.deferred import Deferred
from estimator.results.pixel_grid import PixelGrid

Status = Literal["found", "not_found", "ambiguous"]

Method = Literal["paths", "diffuse"]
"""Mirror-like (or direct) paths, or what rough walls scatter."""

Progress = Callable[[str, int, int], None]
"""Called with the name of a stage, the steps done and the steps in all."""


@dataclass(frozen=True, kw_only=True)
class Image:
    """A complex SAR image on its grid; an ideal unit point target peaks at 1."""

    values: Complex[np.ndarray, "*grid"]
    grid: PixelGrid


@dataclass(frozen=True, kw_only=True)
class CorrectedImage(Image):
    """An image in which each pixel has the raw image's value from where it was seen."""

    chains: tuple[tuple[int, ...], ...]  # of mirrors, from the array outward
    chain: Int[np.ndarray, "*grid"]  # index of each pixel's chain; -1 where nothing is seen


@dataclass(frozen=True, kw_only=True)
class AngleRangeMap:
    """The spherical-wave matched filter of one user's pilot over angle and path length."""

    values: Complex[np.ndarray, "angles ranges"]
    aoa: Float[np.ndarray, " angles"]  # from the array's axis [rad]
    path_length: Float[np.ndarray, " ranges"]  # [m]
    user: str


@dataclass(frozen=True, kw_only=True)
class DirectionMap:
    """The same of a planar array, over two direction cosines and path length."""

    values: Complex[np.ndarray, "along up ranges"]  # 0 at lengths at which nothing arrives
    along: Float[np.ndarray, " along"]  # cosine from the array's horizontal axis [-]
    up: Float[np.ndarray, " up"]  # cosine from the array's axis across that [-]
    path_length: Float[np.ndarray, " ranges"]  # [m]
    user: str


@dataclass(frozen=True, kw_only=True)
class Mirror:
    """A flat wall of finite extent, at its true (unfolded) place.

    In space ``start`` and ``end`` are the midpoints of its left and right sides, ``corners``
    go around it, and the covariance is that of (turn of the horizontal axis, turn of the axis
    across [rad], offset at the corners' centre [m]).
    """

    start: Float[np.ndarray, " 3"]  # [m]
    end: Float[np.ndarray, " 3"]  # [m]
    normal: Float[np.ndarray, " 3"]  # unit vector towards the array
    covariance: Float[np.ndarray, "n n"]  # of (angle [rad], offset along the normal [m])
    confidence: float  # probability that the wall is not made of noise and clutter
    level_db: float  # mean intensity along it over the image's background
    seen_through: tuple[int, ...] = ()  # indices of mirrors, from the array outward
    corners: Float[np.ndarray, "corners 3"] | None = None  # in space, in order around it [m]


@dataclass(frozen=True, kw_only=True)
class Target:
    """An object that is no mirror."""

    position: Float[np.ndarray, " 3"]  # [m]
    ghost: Float[np.ndarray, " 3"]  # where the raw image shows it [m]
    seen_through: tuple[int, ...] = ()  # indices of mirrors, from the array outward
    covariance: Float[np.ndarray, "3 3"] | None = None  # of the position [m²]
    level_db: float | None = None  # intensity over that of an ideal unit point target [dB]
    ends: Float[np.ndarray, "2 3"] | None = None  # of what is wider than the resolution [m]


@dataclass(frozen=True, kw_only=True)
class PathReport:
    """One wave of a user's pilot, and what became of it."""

    aoa: float  # from the array's axis [rad]
    path_length: float  # as its delay says, on the array's clock [m]
    share: float  # of the pilot's energy, less the noise [-]
    mirrors: tuple[int, ...] | None  # met on the way, from the array outward; None: not known
    used: bool  # whether the answer rests on it
    reason: str | None = None  # why not
    elevation: float | None = None  # of a planar array: above its horizontal plane [rad]


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
    elevation: float | None = None  # of a planar array: above its horizontal plane [rad]
    alternatives: tuple["UserEstimate", ...] = ()
    line_of_sight: bool | None = None  # whether it is seen directly; None: cannot be said
    paths: tuple[PathReport, ...] = ()  # all waves of the pilot, strongest first
    method: Method = "paths"  # what the position rests on
    clock_offset: float | None = None  # as solved for; None: known, or it cannot be told [s]
    clock_deviation: float | None = None  # its standard deviation [s]
    probability: float | None = None
    """That the user is here, given map, paths and priors; None where none was worked out. [-]"""


@dataclass(frozen=True, kw_only=True)
class Check:
    """What a measurement tells twice, compared: delays and curvatures of the same waves."""

    user: str  # whose answer rests on it
    data: Literal["echo", "pilot"]
    shift: float  # by which the waves are later than their curvature says, one way [m]
    deviation: float  # [m]
    agrees: bool
    text: str  # what that is, and what would mend it


@dataclass(frozen=True, kw_only=True)
class Images:
    """The raw and the corrected image; without an echo there is neither."""

    raw: Image | None = None
    corrected: Image | None = None


def no_close_ups() -> tuple[AngleRangeMap, ...]:
    """Return none."""
    return ()


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """The whole answer to one measurement.

    Nothing in it rests on the images and the close-ups, which take as long as the answer: they are
    formed when they are first asked for.
    """

    users: tuple[UserEstimate, ...]
    mirrors: tuple[Mirror, ...]
    targets: tuple[Target, ...] = ()
    images: Deferred[Images] = field(default_factory=lambda: Deferred(Images))
    maps: tuple[AngleRangeMap, ...] = ()  # one for each user
    close_up_maps: Deferred[tuple[AngleRangeMap, ...]] = field(
        default_factory=lambda: Deferred(no_close_ups)
    )
    direction_maps: tuple[DirectionMap, ...] = ()  # one for each user of a planar array
    notes: tuple[str, ...] = ()  # what was assumed or could not be done
    checks: tuple[Check, ...] = ()  # what the data tell twice, compared
    timings: dict[str, float] = field(default_factory=dict)  # stage → duration [s]
    aperture: Float[np.ndarray, "positions 3"] | None = None  # that it was made from [m]

    @property
    def raw_image(self) -> Image | None:
        """The image as measured, formed when first asked for; None without an echo."""
        return self.images.value.raw

    @property
    def corrected_image(self) -> Image | None:
        """The image with ghosts unfolded, formed with the raw one; None without an echo."""
        return self.images.value.corrected

    @property
    def close_ups(self) -> tuple[AngleRangeMap, ...]:
        """The maps once more, finely around each one's answer or peak; when first asked for."""
        return self.close_up_maps.value
