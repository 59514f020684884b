"""What was found in path lists, as results: mirrors where they were met, and each path's way."""

import numpy as np
from jaxtyping import Float

from estimator.path_consensus.flat_mirrors import Chain, Mirrors, chains_of
from estimator.path_consensus.listed_paths import ListedPaths
from estimator.path_consensus.room_search import Room
from estimator.results.estimate import Mirror, PathReport

SHORTEST = 0.1
"""Least extent that a mirror is drawn with, where all paths meet it at one place. [m]"""


def unfolded_path(
    user: Float[np.ndarray, " axes"], mirrors: Mirrors, chain: Chain
) -> Float[np.ndarray, "vertices axes"]:
    """Return the way from the base station over a chain to the user. [m]."""
    images = [user]
    for one in reversed(chain):
        last = images[-1]
        beyond = mirrors.offset[one] - mirrors.normal[one] @ last
        images.append(last + 2 * beyond * mirrors.normal[one])
    vertices = [np.zeros(user.size)]
    for one, image in zip(chain, images[:0:-1], strict=True):
        start = vertices[-1]
        ray = image - start
        share = (mirrors.offset[one] - mirrors.normal[one] @ start) / (mirrors.normal[one] @ ray)
        vertices.append(start + share * ray)
    return np.array([*vertices, user])


def mirror_of(paths: ListedPaths, room: Room, index: int, *, confidence: float) -> Mirror:
    """Return one mirror between the outermost places where paths met it."""
    fit, axes = room.fit, paths.axes
    normal, foot = fit.mirrors.normal[index], fit.mirrors.offset[index]
    chains = chains_of(len(fit.mirrors))
    met = []
    for row in np.flatnonzero(room.chain > 0):
        chain = chains[room.chain[row]]
        if index in chain:
            way = unfolded_path(fit.users[paths.place[row]], fit.mirrors, chain)
            met += [way[1 + step] for step, one in enumerate(chain) if one == index]
    points = np.array(met) if met else (foot * normal)[None]
    sides = _sides(normal)
    along = (points @ sides.T).reshape(-1, axes - 1)
    low, high = along.min(axis=0), along.max(axis=0)
    short = np.maximum(0.5 * (SHORTEST - (high - low)), 0.0)
    low, high = low - short, high + short

    def place(*coordinates: float) -> np.ndarray:
        point = foot * normal + np.array(coordinates) @ sides
        return np.append(point, np.zeros(3 - axes))

    middle = 0.5 * (low + high)
    corners = None
    if axes == 2:
        start, end = place(low[0]), place(high[0])
    else:
        start, end = place(low[0], middle[1]), place(high[0], middle[1])
        corners = np.array(
            [place(low[0], low[1]), place(high[0], low[1]), place(high[0], high[1]),
             place(low[0], high[1])]
        )  # fmt: skip
    return Mirror(
        start=start,
        end=end,
        normal=-np.append(normal, np.zeros(3 - axes)),
        covariance=fit.mirror_covariance[index],
        confidence=confidence,
        level_db=float("nan"),  # it was not imaged
        corners=corners,
    )


def path_reports(paths: ListedPaths, room: Room, place: int) -> tuple[PathReport, ...]:
    """Tell of each path of a place, first come first, over which mirrors it came."""
    rows = np.flatnonzero(paths.place == place)
    chains = chains_of(len(room.fit.mirrors))
    shares = np.full(rows.size, 1 / rows.size)
    if paths.level_db is not None:
        power = 10 ** (0.1 * (paths.level_db[rows] - paths.level_db[rows].max()))
        shares = power / power.sum()
    reports = []
    for row, share in sorted(zip(rows, shares, strict=True), key=lambda one: -one[1]):
        known = room.chain[row] >= 0
        ray = paths.direction[row]
        reports.append(
            PathReport(
                aoa=float(np.arccos(np.clip(ray[0], -1, 1))),
                elevation=float(np.arcsin(np.clip(ray[2], -1, 1))) if paths.axes == 3 else None,
                path_length=float(paths.length[row]),
                share=float(share),
                mirrors=chains[room.chain[row]] if known else None,
                used=bool(known),
                reason=None if known else "no chain of the mirrors explains it",
            )
        )
    return tuple(reports)


def _sides(normal: Float[np.ndarray, " axes"]) -> Float[np.ndarray, "sides axes"]:
    """Return unit vectors along a mirror: the first one level, if the mirror is not."""
    if normal.size == 2:
        return np.array([[-normal[1], normal[0]]])
    level = np.array([-normal[1], normal[0], 0.0])
    if np.linalg.norm(level) < 1e-6:
        level = np.array([1.0, 0.0, 0.0]) - normal[0] * normal
    level = level / np.linalg.norm(level)
    return np.stack([level, np.cross(normal, level)])
