"""Path lists of a sounder in rooms drawn at random: a user walks, the base station knows no room.

Rooms are convex, of three to five upright walls (in space with floor and ceiling), by the image
method over up to three of them; a screen that absorbs may stand in the room. The estimator shares
no code with it. What a list holds besides: scattered paths from anywhere, paths that are missed,
and errors of angles, delays and levels.
"""

from dataclasses import dataclass
from itertools import pairwise, product
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.measurement.path_list import PathList

RoomKind = Literal["open", "screen", "mirrored"]
KINDS: tuple[RoomKind, ...] = ("open", "screen", "mirrored")
"""``open``: nothing hides the user; ``screen``: an absorbing screen may; ``mirrored``: the base
station looks at one wall only, and sees all of the room over it."""

MARGIN = 0.3
"""Least distance of user and base station from walls. [m]"""
MOST_LISTED = 10
"""Strongest paths that a list holds. [-]"""
DYNAMIC_DB = 30.0
"""Level below the strongest from which paths are not listed. [dB]"""


@dataclass(frozen=True, kw_only=True)
class DrawnPaths:
    """Lists of all places, and the truth."""

    kind: RoomKind
    lists: tuple[PathList, ...]
    users: Float[np.ndarray, "places 3"]  # [m]
    direct: tuple[bool, ...]  # whether each list holds the direct path
    chains: tuple[tuple[tuple[int, ...], ...], ...]  # walls of each list's paths; −1: from anywhere
    normals: Float[np.ndarray, "walls 3"]  # away from the base station
    offsets: Float[np.ndarray, " walls"]  # [m]
    clock_offset: float  # of the user: delays seem shorter by it [s]


@dataclass(frozen=True, kw_only=True)
class SounderErrors:
    """What a sounder does to its lists."""

    angle: float = np.radians(2.0)  # [rad]
    delay: float = 0.3e-9  # [s]
    level_db: float = 1.0
    missed: float = 0.15  # share of the paths
    scattered: float = 1.0  # paths from anywhere, for each place


def drawn_paths(
    rng: np.random.Generator,
    kind: RoomKind,
    *,
    space: bool,
    clock_offset: float = 0.0,
    calibrated: bool = True,
    errors: SounderErrors | None = None,
) -> DrawnPaths:
    """Draw a room, a walk of 6 to 20 places half a metre apart, and its lists.

    Parameters
    ----------
    rng
        Source of all random numbers.
    kind
        Kind of room.
    space
        Whether elevations are listed, and there are floor and ceiling.
    clock_offset
        Of the user. [s]
    calibrated
        Whether levels are those of free space and reflections.
    errors
        Of the sounder.
    """
    errors = errors or SounderErrors()
    count = int(rng.integers(3, 6))
    turns = 2 * np.pi * (np.arange(count) + rng.uniform(-0.15, 0.15, count)) / count
    turns += rng.uniform(0, 2 * np.pi)
    normals = np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=-1)
    offsets = rng.uniform(1.5, 6.0, count)
    losses = rng.uniform(1.0, 12.0, count) * (rng.random(count) > 0.15)
    if space:
        normals = np.concatenate([normals, [[0, 0, 1.0], [0, 0, -1.0]]])
        offsets = np.concatenate([offsets, rng.uniform(0.8, 1.8, 2)])
        losses = np.concatenate([losses, rng.uniform(3.0, 12.0, 2)])
    users = _walk(rng, normals, offsets, int(rng.integers(6, 21)), space)
    screen = None
    if kind == "screen":
        middle, along = users.mean(axis=0)[:2] * rng.uniform(0.3, 0.8), rng.uniform(0, np.pi)
        half = rng.uniform(0.4, 1.2) * np.array([np.cos(along), np.sin(along)])
        screen = np.stack([middle - half, middle + half])
    only = int(rng.integers(count)) if kind == "mirrored" else None
    frequency = 60e9
    wavelength = speed_of_light / frequency
    lists, kept, direct, listed = [], [], [], []
    for number, user in enumerate(users):
        points, levels, chains = [], [], []
        for chain in _chains(len(normals)):
            if only is not None and (not chain or chain[0] != only):
                continue
            image = _image(user, normals, offsets, chain, screen)
            if image is None or (rng.random() < errors.missed):
                continue
            points.append(image)
            chains.append(chain)
            length = float(np.linalg.norm(image))
            loss = sum(losses[one] for one in chain)
            levels.append(20 * np.log10(wavelength / (4 * np.pi * length)) - loss)
        if not points:
            continue
        strongest, nearest = max(levels), min(float(np.linalg.norm(one)) for one in points)
        for _ in range(rng.poisson(errors.scattered)):
            ray = rng.normal(size=3) * [1, 1, float(space)]
            length = nearest * rng.uniform(1.05, 4.0)
            points.append(length * ray / np.linalg.norm(ray))
            chains.append((-1,))
            free = 20 * np.log10(wavelength / (4 * np.pi * length))
            levels.append(free - rng.uniform(8.0, 25.0))
        level = np.array(levels) + errors.level_db * rng.normal(size=len(levels))
        order = np.argsort(-level)[:MOST_LISTED]
        order = order[level[order] > strongest - DYNAMIC_DB]
        place = np.array(points)[order]
        length = np.linalg.norm(place, axis=1)
        azimuth = np.arctan2(place[:, 1], place[:, 0])
        elevation = np.arcsin(place[:, 2] / length) + errors.angle * rng.normal(size=length.size)
        azimuth = azimuth + errors.angle * rng.normal(size=length.size) / np.cos(elevation)
        delay = length / speed_of_light + errors.delay * rng.normal(size=length.size)
        lists.append(
            PathList(
                user=f"place {number}",
                azimuth=azimuth,
                elevation=np.clip(elevation, -1.57, 1.57) if space else None,
                delay=delay - clock_offset,
                gain_db=level[order],
                frequency=frequency if calibrated else None,
                angle_deviation=errors.angle,
                delay_deviation=errors.delay,
            )
        )
        kept.append(user)
        direct.append(any(not chains[i] for i in order))
        listed.append(tuple(chains[i] for i in order))
    if len(lists) < 3:
        return drawn_paths(
            rng,
            kind,
            space=space,
            clock_offset=clock_offset,
            calibrated=calibrated,
            errors=errors,
        )
    return DrawnPaths(
        kind=kind,
        lists=tuple(lists),
        users=np.array(kept),
        direct=tuple(direct),
        chains=tuple(listed),
        normals=normals,
        offsets=offsets,
        clock_offset=clock_offset,
    )


def _walk(
    rng: np.random.Generator, normals: np.ndarray, offsets: np.ndarray, count: int, space: bool
) -> Float[np.ndarray, "places 3"]:
    def inside(place: np.ndarray) -> bool:
        room = bool(np.all(normals @ place < offsets - MARGIN))
        return room and 0.7 < float(np.linalg.norm(place)) < 12.0

    while True:
        place = np.append(rng.uniform(-6, 6, 2), rng.uniform(-0.5, 0.5) if space else 0.0)
        if not inside(place):
            continue
        heading, walk = rng.uniform(0, 2 * np.pi), [place]
        for _ in range(50 * count):
            heading += 0.5 * rng.normal()
            step = walk[-1] + 0.5 * np.array([np.cos(heading), np.sin(heading), 0.0])
            if inside(step):
                walk.append(step)
            else:
                heading = rng.uniform(0, 2 * np.pi)
            if len(walk) == count:
                return np.array(walk)


def _chains(count: int) -> list[tuple[int, ...]]:
    every: list[tuple[int, ...]] = [()]
    for order in (1, 2, 3):
        every += [
            chain
            for chain in product(range(count), repeat=order)
            if all(a != b for a, b in pairwise(chain))
        ]
    return every


def _image(
    user: np.ndarray,
    normals: np.ndarray,
    offsets: np.ndarray,
    chain: tuple[int, ...],
    screen: np.ndarray | None,
) -> np.ndarray | None:
    """Return the user's image over a chain; None if a wall's end or the screen hides it. [m]."""
    images = [user]
    for one in reversed(chain):
        last = images[-1]
        images.append(last + 2 * (offsets[one] - normals[one] @ last) * normals[one])
    place = np.zeros(3)
    for one, image in zip(chain, images[:0:-1], strict=True):
        ray = image - place
        slope = float(normals[one] @ ray)
        if slope <= 0:
            return None
        step = place + (offsets[one] - normals[one] @ place) / slope * ray
        others = np.arange(len(offsets)) != one
        if np.any(normals[others] @ step > offsets[others]) or _hidden(place, step, screen):
            return None
        place = step
    return None if _hidden(place, user, screen) else images[-1]


def _hidden(start: np.ndarray, end: np.ndarray, screen: np.ndarray | None) -> bool:
    """Tell whether a leg crosses the upright screen."""
    if screen is None:
        return False
    leg, along = (end - start)[:2], screen[1] - screen[0]
    system = np.stack([leg, -along], axis=-1)
    if abs(np.linalg.det(system)) < 1e-12:
        return False
    shares = np.linalg.solve(system, screen[0] - start[:2])
    return bool(np.all((shares > 0) & (shares < 1)))
