"""Echoes of random rough walls and posts in closed form, independent of simulator and estimator.

A rough wall is a row of points of random amplitude and phase, several per resolution cell, which
gives speckle; posts are single points. There is no multiple scattering: ghosts and diffuse clouds
need the simulator (:mod:`validation.trials.trap_rooms`). The array is half the library's: 128
elements of 0.5 mm, 220 to 295 GHz, 501 frequencies (unambiguous to 1 m).
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.measurement.model import Echo
from validation.analytic.point_scatterer import complex_noise, point_echo

FREQUENCIES = np.linspace(220e9, 295e9, 501)  # [Hz]
ELEMENTS = 128
SPACING = 0.5e-3  # [m]
POINTS_PER_CELL = 2
"""Points of a wall for each c/2B along it. [-]"""
SNR_DB = 20.0
"""Signal-to-noise ratio of a sample of the echo, as in the library. [dB]"""

Kind = Literal["wall", "corner", "posts", "noise"]
KINDS: tuple[Kind, ...] = ("wall", "corner", "posts", "noise")

Segment = tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]


@dataclass(frozen=True, kw_only=True)
class DrawnEcho:
    """An echo and its true walls."""

    kind: Kind
    echo: Echo
    walls: tuple[Segment, ...]  # start and end in the array's frame [m]


def array_positions() -> Float[np.ndarray, "positions 3"]:
    """Return the array's elements, along x about the origin. [m]."""
    positions = np.zeros((ELEMENTS, 3))
    positions[:, 0] = (np.arange(ELEMENTS) - (ELEMENTS - 1) / 2) * SPACING
    return positions


def draw_echo(kind: Kind, rng: np.random.Generator) -> DrawnEcho:
    """Draw an echo.

    Parameters
    ----------
    kind
        ``wall``: one wall 12 to 25 cm long, 0.3 to 0.6 m away within 20° of boresight, turned by
        up to 60°; ``corner``: a second one, 12 cm long, joins it at one end at 60° to 120°, both
        in line of sight; ``posts``: six posts anywhere in that region; ``noise``: noise only.
    rng
        Source of all random numbers.
    """
    walls: list[Segment] = []
    points = np.zeros((0, 3))
    if kind == "posts":
        azimuth = np.radians(rng.uniform(-20, 20, 6))
        distance = rng.uniform(0.3, 0.6, 6)
        points = np.stack([distance * np.sin(azimuth), distance * np.cos(azimuth), 0 * azimuth], -1)
    elif kind != "noise":
        walls.append(draw_wall(rng))
        if kind == "corner":
            walls.append(_joined(walls[0], rng))
        points = np.concatenate([_row(wall, rng) for wall in walls])
    positions = array_positions()
    strengths = rng.exponential(size=len(points)) if walls else np.ones(len(points))
    clean = np.zeros((ELEMENTS, FREQUENCIES.size), dtype=np.complex128)
    if len(points):
        clean = point_echo(
            points,
            positions=positions,
            frequencies=FREQUENCIES,
            radar_cross_section=strengths,
            phase=rng.uniform(0, 2 * np.pi, len(points)),
        ).samples
    power = float(np.mean(np.abs(clean) ** 2)) or 1.0
    noise = complex_noise(clean.shape, power * 10 ** (-SNR_DB / 10), rng)
    echo = Echo(samples=clean + noise, positions=positions, frequencies=FREQUENCIES)
    return DrawnEcho(kind=kind, echo=echo, walls=tuple(walls))


def draw_wall(rng: np.random.Generator) -> Segment:
    """Draw the ends of a wall; see :func:`draw_echo`. [m]."""
    azimuth, distance = np.radians(rng.uniform(-20, 20)), rng.uniform(0.3, 0.6)
    middle = distance * np.array([np.sin(azimuth), np.cos(azimuth), 0.0])
    turn, half = np.radians(rng.uniform(-60, 60)) - azimuth, 0.5 * rng.uniform(0.12, 0.25)
    along = np.array([np.cos(turn), np.sin(turn), 0.0])
    return middle - half * along, middle + half * along


def _joined(wall: Segment, rng: np.random.Generator) -> Segment:
    """Draw a wall that begins at the end of another, with neither in front of the other."""
    along = (wall[1] - wall[0]) / np.linalg.norm(wall[1] - wall[0])
    while True:
        turn = rng.choice([-1, 1]) * np.radians(rng.uniform(60, 120))
        direction = np.array(
            [
                np.cos(turn) * along[0] - np.sin(turn) * along[1],
                np.sin(turn) * along[0] + np.cos(turn) * along[1],
                0.0,
            ]
        )
        begin = wall[int(rng.integers(2))]
        other = begin, begin + 0.12 * direction
        if not (_shares_directions(wall, other) or other[1][1] < 0.2):
            return other


def _shares_directions(wall: Segment, other: Segment) -> bool:
    """Return whether two adjoining walls overlap in direction from the origin."""
    (low, high), (first, last) = (
        sorted(float(end[0] / end[1]) for end in one) for one in (wall, other)
    )
    return min(high, last) - max(low, first) > 1e-9


def _row(wall: Segment, rng: np.random.Generator) -> Float[np.ndarray, "points 3"]:
    length = float(np.linalg.norm(wall[1] - wall[0]))
    cell = speed_of_light / (2 * float(np.ptp(FREQUENCIES)))
    places = rng.uniform(0, 1, int(POINTS_PER_CELL * length / cell))
    return np.asarray(wall[0] + places[:, None] * (wall[1] - wall[0]))
