r"""Users' places, mirrors and the clock from all explained paths: joint least squares.

A path over a chain shows the image p of the user; with its direction ŝ and length r,

.. math:: \frac{|p| - b - r}{\sigma_r}, \qquad
          \frac{1}{\sigma_\theta} (1 - \hat s \hat s^T) \frac{p}{|p|}

are left over, where b is by how much lengths are longer than listed: the speed of light times the
clock's offset.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.linalg import null_space

from estimator.path_consensus.flat_mirrors import Mirrors, chains_of
from estimator.path_consensus.listed_paths import ListedPaths

MOST_STEPS = 20
"""Evaluations of the residuals, with their slopes each; from good guesses a handful does. [-]"""
RIDGE = 1e-9
"""What is added to the normal equations, over their largest entry: mirrors or a clock that nothing
tells get a large variance in place of none. [-]"""


@dataclass(frozen=True, kw_only=True)
class JointFit:
    """All that was solved for, and its covariance."""

    users: Float[np.ndarray, "places axes"]  # NaN where no path is explained [m]
    mirrors: Mirrors
    offset: float  # [m]
    user_covariance: Float[np.ndarray, "places axes axes"]  # [m²]
    mirror_covariance: Float[np.ndarray, "mirrors axes axes"]
    """Of (turns of the normal, offset) about each mirror's foot. [rad], [m]"""
    offset_deviation: float  # 0 where it was not solved for [m]
    chi_square: float  # [-]
    freedom: int
    log_volume: float
    """Logarithm of the volume of mirrors and clocks that explain as well. [-]"""


def nothing_fitted(paths: ListedPaths, mirrors: Mirrors, offset: float) -> JointFit:
    """Return that no user has a place."""
    axes = paths.axes
    return JointFit(
        users=np.full((paths.places, axes), np.nan),
        mirrors=mirrors,
        offset=offset,
        user_covariance=np.full((paths.places, axes, axes), np.nan),
        mirror_covariance=np.full((len(mirrors), axes, axes), np.nan),
        offset_deviation=0.0,
        chi_square=0.0,
        freedom=0,
        log_volume=0.0,
    )


def fitted(
    paths: ListedPaths,
    chain: Int[np.ndarray, " paths"],
    mirrors: Mirrors,
    users: Float[np.ndarray, "places axes"],
    offset: float,
    *,
    clock_known: bool,
) -> JointFit:
    """Fit everything to the paths whose chain is not −1.

    Parameters
    ----------
    paths, chain
        The paths, and the index of each one's chain in :func:`chains_of`.
    mirrors, users, offset
        Where to begin.
    clock_known
        Whether the offset is held.
    """
    axes, count = paths.axes, len(mirrors)
    rows = np.flatnonzero(chain >= 0)
    placed = np.unique(paths.place[rows])
    if not rows.size:
        return nothing_fitted(paths, mirrors, offset)
    number = np.full(paths.places, -1)
    number[placed] = np.arange(placed.size)
    tangents = [null_space(normal[None]) for normal in mirrors.normal]
    sides = [null_space(direction[None]) for direction in paths.direction[rows]]
    side = np.array(sides).reshape(rows.size, axes, axes - 1)
    chains = chains_of(count)
    groups = [np.flatnonzero(chain[rows] == index) for index in range(len(chains))]
    start = np.concatenate(
        [users[placed].ravel(), np.zeros(count * axes), [] if clock_known else [offset]]
    )
    first = placed.size * axes

    def split(values: np.ndarray) -> tuple[np.ndarray, Mirrors, float]:
        moved = values[first : first + count * axes].reshape(count, axes)
        normals = np.array(
            [
                normal + tangent @ turn[:-1]
                for normal, tangent, turn in zip(mirrors.normal, tangents, moved, strict=True)
            ]
        ).reshape(count, axes)
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        where = Mirrors(normal=normals, offset=mirrors.offset + moved[:, -1])
        return values[:first].reshape(-1, axes), where, offset if clock_known else values[-1]

    def images(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, Mirrors, float]:
        places, where, late = split(values)
        turn, shift = where.images
        here = places[number[paths.place[rows]]]
        return (
            np.einsum("pij,pj->pi", turn[chain[rows]], here) + shift[chain[rows]],
            here,
            where,
            late,
        )

    def left(values: np.ndarray) -> np.ndarray:
        image, _, _, late = images(values)
        distance = np.linalg.norm(image, axis=1)
        along = (distance - late - paths.length[rows]) / paths.length_deviation
        ray = image / np.maximum(distance, 1e-9)[:, None]
        across = np.einsum("pia,pi->pa", side, ray) / paths.angle_deviation
        return np.concatenate([along, across.ravel()])

    def slopes(values: np.ndarray) -> np.ndarray:
        image, here, where, _ = images(values)
        turn, shift = where.images
        distance = np.maximum(np.linalg.norm(image, axis=1), 1e-9)
        ray = image / distance[:, None]
        flat = (np.eye(axes) - ray[:, :, None] * ray[:, None, :]) / distance[:, None, None]
        by_image = np.concatenate(  # (along, across) by the image
            [
                ray[:, None, :] / paths.length_deviation,
                np.einsum("pia,pij->paj", side, flat) / paths.angle_deviation,
            ],
            axis=1,
        )
        made = np.zeros((rows.size, axes, values.size))
        at = axes * number[paths.place[rows]][:, None] + np.arange(axes)
        every = np.arange(rows.size)
        by_place = by_image @ turn[chain[rows]]
        made[every[:, None], :, at] = by_place.swapaxes(1, 2)
        for index, group in enumerate(groups):
            if not group.size or not index:
                continue
            inner, way = here[group], chains[index]
            for step, one in reversed(list(enumerate(way))):
                outer = np.eye(axes)
                for before in way[:step]:
                    outer = outer @ turn[1 + before]
                normal, height = where.normal[one], where.offset[one]
                ahead = height - inner @ normal
                by_normal = 2 * (
                    ahead[:, None, None] * np.eye(axes) - normal[:, None] * inner[:, None, :]
                )
                by_offset = np.broadcast_to(2 * normal[:, None], (group.size, axes, 1))
                by_wall = np.concatenate([by_normal @ tangents[one], by_offset], axis=2)
                begin = first + one * axes
                made[group, :, begin : begin + axes] += by_image[group] @ outer @ by_wall
                inner = inner @ turn[1 + one].T + shift[1 + one]
        if not clock_known:
            made[:, 0, -1] = -1 / paths.length_deviation
        return np.concatenate([made[:, 0], made[:, 1:].reshape(-1, values.size)])

    from scipy.optimize import least_squares  # takes long to import

    solved = least_squares(
        left, start, jac=slopes, method="trf", x_scale="jac", max_nfev=MOST_STEPS
    )
    slope = slopes(solved.x)
    normal_matrix = slope.T @ slope
    ridge = RIDGE * max(float(np.diag(normal_matrix).max(initial=0.0)), 1e-300)
    spread = np.linalg.inv(normal_matrix + ridge * np.eye(len(start)))
    places, where, late = split(solved.x)
    everywhere = np.full((paths.places, axes), np.nan)
    everywhere[placed] = places
    around = np.full((paths.places, axes, axes), np.nan)
    for index, place in enumerate(placed):
        part = slice(index * axes, (index + 1) * axes)
        around[place] = spread[part, part]
    of_mirrors = [
        spread[first + i * axes : first + (i + 1) * axes, first + i * axes : first + (i + 1) * axes]
        for i in range(count)
    ]
    rest = spread[first:, first:]
    log_volume = 0.5 * float(np.linalg.slogdet(2 * np.pi * rest)[1]) if len(rest) else 0.0
    return JointFit(
        users=everywhere,
        mirrors=where,
        offset=float(late),
        user_covariance=around,
        mirror_covariance=np.array(of_mirrors).reshape(count, axes, axes),
        offset_deviation=0.0 if clock_known else float(np.sqrt(spread[-1, -1])),
        chi_square=float(2 * solved.cost),
        freedom=int(solved.fun.size - start.size),
        log_volume=log_volume,
    )
