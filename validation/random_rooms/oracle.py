"""Oracle with the true walls and paths of a room: which users can be located.

The echo *shows* a wall if its image, smoothed over three cells along the wall, is at least
:data:`SHOWN_DB` above the background and :data:`BESIDE_DB` above the level four cells beside it on
either side, on at least :data:`SHOWN_CELLS` cells of it that are in the imaged sector and in line
of sight of the array: a line visible to the eye.

A user is *answerable* if the strongest specular path of its pilot is well above the noise, has a
large share of the pilot's energy, arrives from the imaged sector and is reflected only by walls
that the echo shows. This is an upper bound for an estimator without prior knowledge: the oracle
does not test whether other explanations can be excluded. The attainable accuracy is the Cramér-Rao
bound with all walls known and no roughness.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import uniform_filter1d

from estimator.array.linear_array import echo_reach, echo_resolution, imaged_sine
from estimator.array.planar_array import planar_array, planar_reach, planar_resolution
from estimator.array.resolution_cell import Resolution
from estimator.array.windows import survey_weights
from estimator.imaging.backprojection import backproject
from estimator.imaging.peak_detection import mean_background
from estimator.measurement.model import Echo, Uplink
from scenes.scenario import Scenario
from validation.bounds.no_bound import NoBound
from validation.bounds.scenario_bound import UserWaves, scenario_position_bound, user_waves
from validation.metrics.truth import Truth

SHOWN_DB = 10.0
"""Least mean intensity of a visible part of a wall, relative to the background. [dB]"""
BESIDE_DB = 3.0
"""The same relative to the levels beside it: a sidelobe of another object is as bright there.
[dB]"""
BESIDE_CELLS = 4.0
"""Distance to the side: the survey's taper has its first nulls at 2 to 3 cells. [cells]"""
SHOWN_CELLS = 7.0
"""Least number of visible cells of a wall. [-]"""
SMOOTHED = 3
"""Cells over which speckle is averaged. [-]"""
PLACES_PER_CELL = 2.0
FEWEST_PLACES, MOST_PLACES = 32, 2000
BACKGROUND_PLACES = 4000
"""Points of the sector whose median is the background, with an error of 2 %. [-]"""

LEAST_SNR_DB = 20.0
"""Least energy of a path over the noise's spectral density: the error of its angle is a tenth of a
cell. [dB]"""
LEAST_SHARE = 0.2
"""Least share of the pilot's energy in the strongest specular path. [-]"""


@dataclass(frozen=True, kw_only=True)
class TruePath:
    """A specular path of a user."""

    walls: tuple[str, ...]  # names, from the array outward
    share: float  # of the pilot's energy, less the noise [-]
    snr_db: float  # its energy over the noise's spectral density [dB]
    sine: float  # largest direction cosine across boresight at which it arrives [-]


@dataclass(frozen=True, kw_only=True)
class Answerable:
    """Result of the oracle for a room."""

    shown: tuple[str, ...]  # walls that the echo shows
    paths: tuple[TruePath, ...]  # strongest first
    answerable: bool
    why: str  # reason, if not
    deviation: float | None  # bound of the position's largest deviation; None without one [m]


def ask_oracle(
    scenario: Scenario, user: str, echo: Echo | None, uplink: Uplink, truth: Truth
) -> Answerable:
    """Return whether one user can be located, and how accurately.

    Parameters
    ----------
    scenario
        The true room, with the array at the origin and boresight along +y.
    user
        Its name.
    echo, uplink
        The measurement.
    truth
        Of the same room.
    """
    sector = imaged_sector(echo) if echo is not None else None
    shown = () if echo is None or sector is None else shown_walls(echo, sector, truth)
    paths = true_paths(scenario, user, uplink)
    why = "it can"
    if not paths:
        why = "no specular path"
    elif paths[0].share < LEAST_SHARE:
        why = "specular paths are a small part of the pilot"
    elif paths[0].snr_db < LEAST_SNR_DB:
        why = "too weak"
    elif sector is None or paths[0].sine > sector.widest:
        why = "it arrives from where nothing is imaged"
    elif not set(paths[0].walls) <= set(shown):
        why = "over a wall that the echo does not show"
    deviation = None
    if paths:
        try:
            bound = scenario_position_bound(scenario, user)
            deviation = float(np.sqrt(np.linalg.eigvalsh(bound.covariance)[-1]))
        except NoBound:
            pass
    return Answerable(
        shown=shown, paths=paths, answerable=why == "it can", why=why, deviation=deviation
    )


def true_paths(scenario: Scenario, user: str, uplink: Uplink) -> tuple[TruePath, ...]:
    """Return a user's specular paths with their share of its pilot, strongest first."""
    try:
        waves = user_waves(scenario, user)
    except NoBound:
        return ()
    measured = float(np.mean(np.abs(uplink.samples) ** 2))
    snr = 10 ** (scenario.noise.snr_db / 10)
    signal = measured / (1 + 1 / snr)
    found = []
    for mirrors, wave in zip(waves.paths, waves.waves, strict=True):
        power = float(np.mean(np.abs(wave) ** 2))
        found.append(
            TruePath(
                walls=tuple(waves.owners[index] for index in mirrors),
                share=power / signal,
                snr_db=float(10 * np.log10(wave.size * power * snr / signal)),
                sine=_arrival_sine(waves, mirrors, scenario.users[user].position),
            )
        )
    return tuple(sorted(found, key=lambda path: -path.share))


def _arrival_sine(waves: UserWaves, mirrors: Sequence[int], user: Float[np.ndarray, " 3"]) -> float:
    image = user
    for index in reversed(mirrors):
        plane = waves.planes[index]
        image = image - 2 * float((image - plane.point) @ plane.normal) * plane.normal
    seen = image - waves.positions.mean(axis=0)
    ray = seen / np.linalg.norm(seen)
    return float(max(abs(ray[0]), abs(ray[2]))) if ray[1] > 0 else 1.0


@dataclass(frozen=True, kw_only=True)
class ImagedSector:
    """The sector imaged by an echo."""

    widest: float  # sine [-]
    nearest: float  # [m]
    farthest: float  # [m]
    resolution: Resolution
    flat: bool

    def holds(self, points: Float[np.ndarray, "points 3"]) -> Bool[np.ndarray, " points"]:
        """Return which points are in the sector."""
        far = np.linalg.norm(points, axis=-1)
        aside = np.maximum(np.abs(points[:, 0]), np.abs(points[:, 2])) / far
        held = (points[:, 1] > 0) & (aside <= self.widest)
        return np.asarray(held & (far >= self.nearest) & (far <= self.farthest))

    def scattered(self) -> Float[np.ndarray, "points 3"]:
        """Return points spread evenly over the sector. [m]."""
        rng = np.random.default_rng(0)
        sines = rng.uniform(-self.widest, self.widest, (BACKGROUND_PLACES, 2))
        if self.flat:
            sines[:, 1] = 0.0
        ahead = np.sqrt(np.maximum(1 - (sines**2).sum(axis=1), 0.0))
        far = rng.uniform(self.nearest, self.farthest, BACKGROUND_PLACES)
        return np.asarray(far[:, None] * np.stack([sines[:, 0], ahead, sines[:, 1]], axis=-1))


def imaged_sector(echo: Echo) -> ImagedSector:
    """Return the sector of a linear or planar array at the origin, with boresight along +y."""
    if np.ptp(echo.positions[:, 2]) == 0:
        nearest, farthest = echo_reach(echo)
        widest, resolution, flat = imaged_sine(echo), echo_resolution(echo), True
    else:
        array = planar_array(echo.positions)
        nearest, farthest = planar_reach(array, echo, passes=2)
        widest = array.unaliased(echo.frequencies, passes=2)
        resolution, flat = planar_resolution(array, echo), False
    return ImagedSector(
        widest=widest, nearest=nearest, farthest=farthest, resolution=resolution, flat=flat
    )


def shown_walls(echo: Echo, sector: ImagedSector, truth: Truth) -> tuple[str, ...]:
    """Return the names of the walls that the echo shows."""
    taper = survey_weights(echo)

    def intensity(points: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, " points"]:
        # Walls go on beyond the range up to which the echo is unambiguous.
        within = np.linalg.norm(points, axis=-1) <= sector.farthest
        values = np.zeros(len(points))
        values[within] = np.abs(backproject(echo, points[within], weights=taper)) ** 2
        return values

    background = mean_background(intensity(sector.scattered()))
    shown = []
    for name in truth.wall_start:
        start, end = truth.wall_start[name], truth.wall_end[name]
        length = float(np.linalg.norm(end - start))
        along = (end - start) / length
        normal = np.array([along[1], -along[0], 0.0])
        middle = 0.5 * (start + end)
        cells = length / float(sector.resolution.cell(middle[None], along)[0])
        count = int(np.clip(PLACES_PER_CELL * cells, FEWEST_PLACES, MOST_PLACES))
        points = start + ((np.arange(count) + 0.5) / count)[:, None] * (end - start)
        width = sector.resolution.cell(points, along)
        seen = sector.holds(points) & ~_hidden(points, name, truth)
        aside = BESIDE_CELLS * sector.resolution.cell(points, normal)[:, None] * normal
        step = length / count
        window = max(1, round(SMOOTHED * float(np.median(width)) / step))
        level, left, right = (
            uniform_filter1d(intensity(points + shift), window, mode="nearest")
            for shift in (0 * aside, aside, -aside)
        )
        lit = seen & (level >= 10 ** (SHOWN_DB / 10) * background)
        lit &= level >= 10 ** (BESIDE_DB / 10) * np.maximum(left, right)
        if float((step / width)[lit].sum()) >= SHOWN_CELLS:
            shown.append(name)
    return tuple(shown)


def _hidden(
    points: Float[np.ndarray, "points 3"], name: str, truth: Truth
) -> Bool[np.ndarray, " points"]:
    """Return which points are hidden from the origin by another wall or a body, in plan."""
    hidden = np.zeros(len(points), dtype=bool)
    for other in truth.wall_start:
        if other != name:
            hidden |= _crossed(points, truth.wall_start[other], truth.wall_end[other])
    for body, centre in truth.target_position.items():
        half = 0.5 * truth.target_size[body][:2]
        angle = truth.target_angle.get(body, 0.0)
        axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        for diagonal in (half, half * [1, -1]):
            offset = np.append(axes.T @ diagonal, 0.0)
            hidden |= _crossed(points, centre - offset, centre + offset)
    return hidden


def _crossed(
    points: Float[np.ndarray, "points 3"],
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
) -> Bool[np.ndarray, " points"]:
    """Return which straight lines from the origin cross a segment, in plan."""

    def turn(one: np.ndarray, other: np.ndarray) -> np.ndarray:
        return np.asarray(one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0])

    along = end - start
    apart = turn(points, start) * turn(points, end) < 0
    across = turn(along, -start) * turn(along, points - start) < 0
    return np.asarray(apart & across)
