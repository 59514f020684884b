"""Figures of a volume: its projections, and maps of a pilot over both angles."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes

from estimator.results.estimate import DirectionMap, Estimate, Image, UserEstimate
from validation.figures import figures_2d

LABELS = ("x, along the array [m]", "y, boresight [m]", "z, up [m]")


@dataclass(frozen=True, kw_only=True)
class Projection:
    """A direction of projection, by the world's axes that point right and up."""

    name: str
    right: int
    up: int

    @property
    def along(self) -> int:
        """The axis of projection."""
        return 3 - self.right - self.up


TOP = Projection(name="from above", right=0, up=1)
FRONT = Projection(name="from the array", right=0, up=2)
SIDE = Projection(name="from the side", right=1, up=2)
VIEWS = (TOP, FRONT, SIDE)


@dataclass(frozen=True, kw_only=True)
class Box:
    """The region of space that is shown."""

    low: Float[np.ndarray, " 3"]  # [m]
    high: Float[np.ndarray, " 3"]  # [m]

    def sides(self, view: Projection) -> tuple[float, float]:
        """Return width and height of a view. [m]."""
        size = self.high - self.low
        return float(size[view.right]), float(size[view.up])


def box_around(points: Float[np.ndarray, "points 3"], *, margin: float = 0.05) -> Box:
    """Return the box that contains all points, with a margin relative to its largest side [-]."""
    low, high = points.min(axis=0), points.max(axis=0)
    size = max(float((high - low).max()), 1e-3)
    half = np.maximum(high - low, 0.3 * size) / 2 + margin * size
    middle = (low + high) / 2
    return Box(low=middle - half, high=middle + half)


def draw_projection(
    ax: Axes,
    image: Image,
    view: Projection,
    box: Box,
    *,
    floor_db: float = figures_2d.FLOOR_DB,
    bar: bool = False,
) -> Axes:
    """Draw the brightest voxel along one axis, in decibels below the volume's peak.

    Parameters
    ----------
    ax
        Is given equal axes in metres.
    image
        A volume.
    view, box
        What is shown.
    floor_db
        The darkest level.
    bar
        Whether to add a bar of levels.
    """
    grids = (image.grid.x, image.grid.y, image.grid.z)
    magnitude = np.abs(image.values).reshape([axis.size for axis in grids])
    shown = magnitude.max(axis=view.along)
    if view.right > view.up:
        shown = shown.T
    level = figures_2d.decibels(shown, float(magnitude.max()), floor_db)
    right, up = grids[view.right], grids[view.up]
    half = [0.5 * (axis[1] - axis[0]) if axis.size > 1 else 5e-4 for axis in (right, up)]
    mesh = ax.imshow(
        level.T,
        origin="lower",
        extent=(right[0] - half[0], right[-1] + half[0], up[0] - half[1], up[-1] + half[1]),
        cmap="magma",
        vmin=floor_db,
        vmax=0.0,
        interpolation="nearest",
    )
    ax.set_facecolor("black")
    if bar:
        figures_2d.level_bar(ax, mesh, "magnitude relative to the peak [dB]")
    return _framed(ax, view, box)


def draw_plan(
    ax: Axes,
    estimate: Estimate,
    positions: Float[np.ndarray, "positions 3"],
    view: Projection,
    box: Box,
    *,
    colour: str = figures_2d.MIRROR,
    array_colour: str = figures_2d.ARRAY,
    true_positions: Sequence[Float[np.ndarray, " 3"]] = (),
    users: bool = True,
) -> Axes:
    """Draw walls, targets, paths and users in projection along one axis.

    Parameters
    ----------
    ax
        Is given equal axes in metres.
    estimate
        The estimate.
    positions
        Of the aperture. [m]
    view, box
        What is shown.
    colour, array_colour
        Of walls and targets, and of the array.
    true_positions
        True positions of users, if known. [m]
    users
        Whether paths and users are drawn.
    """
    right, up = view.right, view.up
    for index, mirror in enumerate(estimate.mirrors):
        if mirror.corners is None:
            continue
        around = np.vstack([mirror.corners, mirror.corners[:1]])
        ax.plot(around[:, right], around[:, up], "--", color=colour, lw=1.2)
        middle = mirror.corners.mean(axis=0)
        _label(ax, middle[[right, up]], f"mirror {index}", colour)
    for index, target in enumerate(estimate.targets):
        place = target.position[[right, up]]
        ax.plot(*place, "s", mfc="none", mec=colour, ms=6, mew=1.1)
        _label(ax, place, str(index), colour)
    low, high = (bound(positions[:, [right, up]], axis=0) for bound in (np.min, np.max))
    ax.plot(
        [low[0], high[0], high[0], low[0], low[0]],
        [low[1], low[1], high[1], high[1], low[1]],
        color=array_colour,
        lw=1.6,
    )
    if users:
        _draw_users(ax, estimate.users, view)
    for place in true_positions:
        ax.plot(*place[[right, up]], "o", mfc="none", mec=figures_2d.INK, ms=14, mew=1.3, zorder=7)
    return _framed(ax, view, box)


def _draw_users(ax: Axes, users: Iterable[UserEstimate], view: Projection) -> None:
    for user in users:
        if user.path is not None:
            ax.plot(user.path[:, view.right], user.path[:, view.up], color=figures_2d.PATH, lw=1.4)
        if user.position is None:
            continue
        place = user.position[[view.right, view.up]]
        ax.plot(*place, "o", color=figures_2d.USER, mec="white", ms=7, mew=1.1, zorder=6)
        _label(ax, place, user.name, figures_2d.USER, bold=True)


def draw_directions(
    ax: Axes,
    heard: DirectionMap,
    user: UserEstimate | None,
    *,
    floor_db: float = figures_2d.FLOOR_DB,
) -> Axes:
    """Draw the matched filter over both angles, the strongest of all lengths."""
    shown = np.abs(heard.values).max(axis=2)
    _draw_map(
        ax, shown, np.degrees(np.arcsin(heard.along)), np.degrees(np.arcsin(heard.up)), floor_db
    )
    for estimate in _answers(user):
        if estimate.aoa is not None and estimate.elevation is not None:
            aside, above = 90 - np.degrees(estimate.aoa), np.degrees(estimate.elevation)
            ax.plot(aside, above, "o", mfc="none", mec=figures_2d.ON_DARK, ms=14, mew=1.4)
            _label(
                ax,
                np.array([aside, above]),
                f"{aside:.2f}°, {above:.2f}°",
                figures_2d.ON_DARK,
                lift=14.0,
            )
    ax.set_xlabel("angle off the boresight along the array, arcsin u [°]")
    ax.set_ylabel("angle up, arcsin w [°]")
    return ax


def draw_lengths(
    ax: Axes,
    heard: DirectionMap,
    user: UserEstimate | None,
    *,
    floor_db: float = figures_2d.FLOOR_DB,
) -> Axes:
    """Draw the matched filter over one angle and path length, the strongest over the other."""
    shown = np.abs(heard.values).max(axis=1)
    _draw_map(ax, shown, np.degrees(np.arcsin(heard.along)), heard.path_length, floor_db, bar=True)
    for estimate in _answers(user):
        if estimate.aoa is not None and estimate.path_length is not None:
            aside = 90 - np.degrees(estimate.aoa)
            ax.plot(
                aside, estimate.path_length, "o", mfc="none", mec=figures_2d.ON_DARK, ms=14, mew=1.4
            )
            place = np.array([aside, estimate.path_length])
            _label(ax, place, f"{estimate.path_length:.4f} m", figures_2d.ON_DARK, lift=14.0)
    busy = np.flatnonzero(shown.max(axis=0) > 10 ** (floor_db / 20) * shown.max())
    if busy.size:
        low, high = heard.path_length[busy[[0, -1]]]
        margin = max(0.15 * float(high - low), 0.3)
        ax.set_ylim(max(float(low) - margin, 0.0), float(high) + margin)
    ax.set_xlabel("angle off the boresight along the array, arcsin u [°]")
    ax.set_ylabel("path length [m]")
    return ax


def _answers(user: UserEstimate | None) -> tuple[UserEstimate, ...]:
    return () if user is None else (user, *user.alternatives)


def _draw_map(
    ax: Axes,
    magnitude: Float[np.ndarray, "a b"],
    first: Float[np.ndarray, " a"],
    second: Float[np.ndarray, " b"],
    floor_db: float,
    *,
    bar: bool = False,
) -> None:
    level = figures_2d.decibels(magnitude, float(magnitude.max()), floor_db)
    mesh = ax.pcolormesh(
        first,
        second,
        level.T,
        cmap="magma",
        vmin=floor_db,
        vmax=0.0,
        shading="nearest",
        rasterized=True,
    )
    if bar:
        figures_2d.level_bar(ax, mesh, "matched filter relative to the peak [dB]")


def _label(
    ax: Axes,
    place: Float[np.ndarray, " 2"],
    text: str,
    colour: str,
    *,
    bold: bool = False,
    lift: float = 6.0,
) -> None:
    ax.annotate(
        text,
        (float(place[0]), float(place[1])),
        xytext=(0, lift),
        textcoords="offset points",
        ha="center",
        color=colour,
        fontsize=8,
        fontweight="bold" if bold else "normal",
        annotation_clip=True,
    )


def _framed(ax: Axes, view: Projection, box: Box) -> Axes:
    ax.set(
        xlim=(box.low[view.right], box.high[view.right]),
        ylim=(box.low[view.up], box.high[view.up]),
        aspect="equal",
        xlabel=LABELS[view.right],
        ylabel=LABELS[view.up],
    )
    ax.set_title(view.name, fontsize=10)
    return ax
