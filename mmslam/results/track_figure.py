"""The figure of users that move: the plan of the room with their tracks, and their errors."""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from estimator.results.estimate import Mirror
from mmslam.moving_users import MovingUser
from validation.figures import figures_2d, views

_CIRCLE = np.linspace(0, 2 * np.pi, 60)
_REGION = 5.99  # χ² of two coordinates that holds 95 %
_COLOURS = ("#d1495b", "#5c4d7d", "#e09f1f", "#30638e", "#0b7a75")


def track_figure(
    users: Sequence[MovingUser],
    truths: Sequence[Mapping[str, Float[np.ndarray, " 3"]]],
    mirrors: Sequence[Mirror],
    positions: Float[np.ndarray, "positions 3"],
) -> Figure:
    """Draw tracks in the plan, and enlarged; the truth is marked only where it is known.

    Parameters
    ----------
    users
        Tracked.
    truths
        Where users truly are, at each time.
    mirrors
        Of the room, as the last measurement shows it.
    positions
        Of the array. [m]
    """
    figure = Figure(figsize=(13, 6), layout="constrained")
    plan, near = figure.subplots(1, 2)
    draw_tracks(plan, users, truths, mirrors, positions)
    draw_tracks(near, users, truths)
    plan.set_title("Room and tracks")
    near.set_title("Tracks, smoothed, with their 95 % ellipses")
    near.legend(loc="best", fontsize=8)
    return figure


def draw_tracks(
    ax: Axes,
    users: Sequence[MovingUser],
    truths: Sequence[Mapping[str, Float[np.ndarray, " 3"]]],
    mirrors: Sequence[Mirror] = (),
    positions: Float[np.ndarray, "positions 3"] | None = None,
) -> Axes:
    """Draw tracks with their 95 % ellipses; with mirrors and array, the plan of the room.

    Parameters
    ----------
    ax
        Is given equal axes in metres.
    users, truths, mirrors, positions
        As in :func:`track_figure`.
    """
    points = [np.array([point.position for point in user.track.points]) for user in users]
    points += [np.array(list(truth.values())) for truth in truths if truth]
    points += [np.stack([mirror.start, mirror.end]) for mirror in mirrors]
    points += [] if positions is None else [positions]
    points = [some for some in points if len(some)]
    if points:
        figures_2d.in_metres(ax, views.view_around(np.concatenate(points)))
    for colour, user in zip(np.resize(_COLOURS, len(users)), users, strict=True):
        _draw_user(ax, user, truths, str(colour))
    figures_2d.overlay_mirrors(ax, mirrors, colour=figures_2d.MIRROR)
    if positions is not None:
        figures_2d.overlay_array(ax, positions)
    return ax


def _draw_user(
    ax: Axes,
    user: MovingUser,
    truths: Sequence[Mapping[str, Float[np.ndarray, " 3"]]],
    colour: str,
) -> None:
    true = [truth[user.name][:2] for truth in truths if user.name in truth]
    if true:
        ax.plot(*np.array(true).T, "o", mfc="none", mec=figures_2d.INK, ms=9, label="truth")
    located = [answer.position[:2] for answer in user.answers if answer.position is not None]
    if located:
        ax.plot(*np.array(located).T, "x", color="0.4", ms=7, zorder=5, label="located")
    points = user.track.points
    if not points:
        return
    way = np.array([point.position[:2] for point in points])
    ax.plot(*way.T, ".-", color=colour, zorder=6, label=f"track of {user.name}")
    for point in points:
        values, axes = np.linalg.eigh(point.covariance[:2, :2])
        radii = np.sqrt(_REGION * np.maximum(values, 0.0))
        circle = np.stack([np.cos(_CIRCLE), np.sin(_CIRCLE)]) * radii[:, None]
        ax.plot(*(point.position[:2, None] + axes @ circle), color=colour, lw=0.8)
