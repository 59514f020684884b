"""Figures of images, maps and estimates in 2-D. Each function draws on an Axes and returns it."""

# Over 400 lines: one plan, with what is drawn on it.

from collections.abc import Iterable, Sequence

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.patches import Ellipse
from matplotlib.ticker import MaxNLocator

from estimator.results.estimate import AngleRangeMap, Estimate, Image, Mirror, Target, UserEstimate
from validation.figures.views import View, brightest_plane

FLOOR_DB = -40.0
"""Darkest level shown, below the peak. [dB]"""

INK = "#1b2733"
ARRAY = "#30638e"
MIRROR = "#0b7a75"
USER = "#d1495b"
PATH = "#e09f1f"
ON_DARK = "#8ff0e4"  # for overlays on an image

_MOST_PIXELS = 1200  # along one side of a figure; a finer image is reduced to it


def draw_image(ax: Axes, image: Image, *, view: View, floor_db: float = FLOOR_DB) -> Axes:
    """Draw an image's magnitude in decibels below its peak, with a colour bar.

    Parameters
    ----------
    ax
        Is given equal axes in metres.
    image
        In a plane, or a volume, whose brightest pixel along z is shown.
    view
        Region shown; the peak is the brightest pixel inside.
    floor_db
        The darkest level.
    """
    magnitude = np.abs(brightest_plane(image))
    x, columns = _inside(image.grid.x, view.left, view.right)
    y, rows = _inside(image.grid.y, view.bottom, view.top)
    magnitude, x, y = _brightest_of_blocks(magnitude[columns, rows], x, y)
    level = decibels(magnitude, magnitude.max(), floor_db)
    dx, dy = (_half_step(axis) for axis in (x, y))
    mesh = ax.imshow(
        level.T,
        origin="lower",
        extent=(x[0] - dx, x[-1] + dx, y[0] - dy, y[-1] + dy),
        cmap="magma",
        vmin=floor_db,
        vmax=0.0,
        interpolation="nearest",
    )
    ax.set_facecolor("black")
    level_bar(ax, mesh, "magnitude relative to the peak [dB]")
    return in_metres(ax, view)


def overlay_mirrors(
    ax: Axes,
    mirrors: Iterable[Mirror],
    *,
    colour: str = ON_DARK,
    width: float = 1.2,
    line: bool = True,
) -> Axes:
    """Draw the mirrors found: strokes at their ends, numbers and optionally a dashed line."""
    for index, mirror in enumerate(mirrors):
        ends = np.stack([mirror.start, mirror.end])
        angle = np.degrees(np.arctan2(ends[1, 1] - ends[0, 1], ends[1, 0] - ends[0, 0]))
        if line:
            ax.plot(ends[:, 0], ends[:, 1], "--", color=colour, lw=width)
        across = (2, 0, float(angle))  # a marker of two corners: a stroke across the wall
        ax.plot(ends[:, 0], ends[:, 1], ls="", marker=across, color=colour, ms=11, mew=width)
        behind = -10 * mirror.normal
        ax.annotate(
            f"mirror {index}",
            _xy(ends.mean(axis=0)),
            xytext=(behind[0], behind[1]),
            textcoords="offset points",
            rotation=(angle + 90) % 180 - 90,
            rotation_mode="anchor",
            ha="center",
            va="center",
            color=colour,
            fontsize=8,
        )
    return ax


def overlay_targets(ax: Axes, targets: Sequence[Target], *, colour: str = ON_DARK) -> Axes:
    """Mark the targets at their unfolded positions."""
    for index, target in enumerate(targets):
        ax.plot(*target.position[:2], "s", mfc="none", mec=colour, ms=7, mew=1.2)
        if target.ends is not None:
            ax.plot(*target.ends[:, :2].T, "-", color=colour, lw=1.2)
        ax.annotate(
            f"target {index}",
            _xy(target.position),
            xytext=(6, 4),
            textcoords="offset points",
            color=colour,
            fontsize=8,
        )
    return ax


def overlay_users(ax: Axes, users: Iterable[UserEstimate], *, colour: str = USER) -> Axes:
    """Mark each user that was found."""
    for user in users:
        if user.position is not None:
            mark_user(ax, user.name, user.position, colour=colour)
    return ax


def overlay_alternatives(ax: Axes, users: Iterable[UserEstimate], *, colour: str = USER) -> Axes:
    """Mark each user's alternative positions by hollow dots, with their probability if known."""
    for other in (one for user in users for one in user.alternatives):
        if other.position is None:
            continue
        ax.plot(*other.position[:2], "o", mfc="none", mec=colour, ms=8, mew=1.2, zorder=6)
        if other.probability is not None:
            ax.annotate(
                f"{other.probability:.2g}",
                _xy(other.position),
                xytext=(0, -16),
                textcoords="offset points",
                color=colour,
                ha="center",
                fontsize=8,
                annotation_clip=True,
            )
    return ax


def mark_user(ax: Axes, name: str, place: Float[np.ndarray, " 3"], *, colour: str = USER) -> Axes:
    """Mark one user by a named dot."""
    ax.plot(*place[:2], "o", color=colour, mec="white", ms=8, mew=1.2, zorder=6)
    ax.annotate(
        name,
        _xy(place),
        xytext=(0, 12),
        textcoords="offset points",
        color=colour,
        ha="center",
        fontsize=9,
        fontweight="bold",
    )
    return ax


def overlay_paths(ax: Axes, users: Iterable[UserEstimate], *, width: float = 1.6) -> Axes:
    """Draw the propagation path of each user."""
    for user in users:
        if user.path is not None:
            ax.plot(user.path[:, 0], user.path[:, 1], color=PATH, lw=width, zorder=3)
    return ax


def overlay_array(
    ax: Axes, positions: Float[np.ndarray, "positions 3"], *, colour: str = ARRAY
) -> Axes:
    """Mark the aperture."""
    ax.plot(positions[:, 0], positions[:, 1], color=colour, lw=4, solid_capstyle="butt", zorder=5)
    ax.annotate(
        "array",
        _xy(positions.mean(axis=0)),
        xytext=(0, -12),
        textcoords="offset points",
        color=colour,
        ha="center",
        fontsize=9,
        annotation_clip=False,
    )
    return ax


def draw_angle_range_map(
    ax: Axes,
    heard: AngleRangeMap,
    user: UserEstimate | None,
    *,
    peak: float | None = None,
    floor_db: float = FLOOR_DB,
) -> Axes:
    """Draw the matched filter of a pilot over angle and path length, and mark its peak.

    Parameters
    ----------
    ax
        Its axes are in degrees and metres.
    heard
        The map, or a part of it.
    user
        User whose angle and path length are marked, if found.
    peak
        Magnitude of 0 dB, for a part that is compared with the whole; by default the highest
        magnitude in it. A part is drawn smoothly, and marked at the peak itself.
    floor_db
        The darkest level, below the peak.
    """
    enlarged = peak is not None
    magnitude, aoa, length = _brightest_of_blocks(
        np.abs(heard.values), np.degrees(heard.aoa), heard.path_length
    )
    level = decibels(magnitude, magnitude.max() if peak is None else peak, floor_db)
    # A mesh, not an image: angles are spaced evenly in their cosine.
    mesh = ax.pcolormesh(
        aoa,
        length,
        level.T,
        cmap="magma",
        vmin=floor_db,
        vmax=0.0,
        shading="gouraud" if enlarged else "nearest",
        rasterized=True,
    )
    level_bar(ax, mesh, "matched filter relative to the peak [dB]")
    for estimate in () if user is None else (user, *user.alternatives):
        if estimate.aoa is None or estimate.path_length is None:
            continue
        angle = float(np.degrees(estimate.aoa))
        chosen = estimate is user
        if not aoa[0] <= angle <= aoa[-1] or not length[0] <= estimate.path_length <= length[-1]:
            continue
        if enlarged:
            ax.plot(angle, estimate.path_length, "+", mec=MIRROR, ms=12, mew=1.5)
        else:
            ax.plot(angle, estimate.path_length, "o", mfc="none", mec=ON_DARK, ms=14, mew=1.5)
        on_right = angle > (aoa[0] + aoa[-1]) / 2
        ax.annotate(
            f"{angle:.3f}°, {estimate.path_length:.4f} m" if chosen else "alternative",
            (angle, estimate.path_length),
            xytext=(-14 if on_right else 14, 12),
            textcoords="offset points",
            ha="right" if on_right else "left",
            color=ON_DARK,
            fontsize=9,
        )
    ax.set_xlabel("angle of arrival from the array's axis [°]")
    ax.set_ylabel("path length [m]")
    return ax


def draw_localization(
    ax: Axes,
    estimate: Estimate,
    positions: Float[np.ndarray, "positions 3"],
    *,
    view: View,
    true_positions: Sequence[Float[np.ndarray, " 3"]] = (),
    true_walls: Sequence[Float[np.ndarray, "2 3"]] = (),
) -> Axes:
    """Draw the plan of an estimate: array, mirrors, paths, users.

    Parameters
    ----------
    ax
        Is given equal axes in metres.
    estimate
        The estimate.
    positions
        Of the aperture. [m]
    view
        Region shown.
    true_positions, true_walls
        True positions of users and walls; empty if unknown. [m]
    """
    ax.set_facecolor("white")
    ax.grid(color="#dfe4e8", lw=0.6)
    ax.set_axisbelow(True)
    for wall in true_walls:
        ax.plot(wall[:, 0], wall[:, 1], color="#c9d1d6", lw=7, solid_capstyle="butt", zorder=1)
    overlay_array(ax, positions)
    overlay_mirrors(ax, estimate.mirrors, colour=MIRROR, width=1.8)
    overlay_targets(ax, estimate.targets, colour=MIRROR)
    overlay_paths(ax, estimate.users)
    for place in true_positions:
        ax.plot(*place[:2], "o", mfc="none", mec=INK, ms=15, mew=1.4, zorder=7)
    overlay_users(ax, estimate.users)
    overlay_alternatives(ax, estimate.users)
    return in_metres(ax, view)


def draw_close_up(
    ax: Axes, user: UserEstimate, truth: Float[np.ndarray, " 3"] | None = None
) -> Axes:
    """Draw a user's estimate with its error ellipses, in millimetres about the truth.

    Parameters
    ----------
    ax
        Set to equal scales in millimetres, about the truth or else the estimate.
    user
        With a position.
    truth
        True position of the user, if known. [m]

    Raises
    ------
    ValueError
        If the user has no position.
    """
    if user.position is None:
        raise ValueError(f"user {user.name!r} has no position to draw; its status is {user.status}")
    centre = user.position if truth is None else truth
    x, y = 1e3 * (user.position - centre)[:2]
    reach = 1.4 * float(np.hypot(x, y))
    ax.axhline(0, color="#dfe4e8", lw=0.8, zorder=0)
    ax.axvline(0, color="#dfe4e8", lw=0.8, zorder=0)
    if user.covariance is not None:
        variances, axes = np.linalg.eigh(1e6 * user.covariance[:2, :2])
        deviations = np.sqrt(np.maximum(variances, 0.0))
        angle = float(np.degrees(np.arctan2(axes[1, 1], axes[0, 1])))
        for factor, alpha in ((2.0, 0.10), (1.0, 0.22)):
            minor, major = 2 * factor * deviations
            ax.add_patch(Ellipse((x, y), major, minor, angle=angle, color=USER, alpha=alpha, lw=0))
        reach = max(reach, float(np.hypot(x, y)) + 2.2 * float(deviations.max()))
    ax.plot(x, y, "o", color=USER, ms=7, mec="white", label="estimate, 1σ and 2σ")
    if truth is not None:
        ax.plot(0, 0, "o", mfc="none", mec=INK, ms=12, mew=1.4, label="truth")
        error = 1e3 * float(np.linalg.norm(user.position - truth))
        ax.set_title(f"{user.name}: {error:.3f} mm off", fontsize=10)
    else:
        ax.set_title(f"{user.name}: truth not known", fontsize=10)
    reach = max(reach, 0.01)
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    about = "estimate" if truth is None else "truth"
    ax.set_xlabel(f"x from the {about} [mm]")
    ax.set_ylabel("y [mm]")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MaxNLocator(3))
    return ax


def decibels(
    magnitude: Float[np.ndarray, "x y"], peak: float, floor_db: float
) -> Float[np.ndarray, "x y"]:
    """Return a magnitude in decibels over a peak, no lower than a floor."""
    lowest = 10 ** (floor_db / 20) * peak
    if lowest <= 0:  # an empty image
        return np.full_like(magnitude, floor_db)
    level: np.ndarray = 20 * np.log10(np.maximum(magnitude, lowest) / peak)
    return level


def level_bar(ax: Axes, mesh: ScalarMappable, label: str) -> None:
    """Add a colour bar beside a drawing, of the same height."""
    figure = ax.get_figure()
    if figure is not None:  # inset: as high as the drawing, whatever its aspect
        beside = ax.inset_axes((1.02, 0.0, 0.03, 1.0))
        figure.colorbar(mesh, cax=beside, label=label)


def _xy(point: Float[np.ndarray, " 3"]) -> tuple[float, float]:
    return float(point[0]), float(point[1])


def in_metres(ax: Axes, view: View) -> Axes:
    """Give the axes the view's limits, equal scales and labels in metres."""
    ax.set(
        xlim=(view.left, view.right),
        ylim=(view.bottom, view.top),
        aspect="equal",
        xlabel="x, along the array [m]",
        ylabel="y, boresight [m]",
    )
    return ax


def _inside(
    axis: Float[np.ndarray, " n"], first: float, last: float
) -> tuple[Float[np.ndarray, " m"], slice]:
    start = int(np.searchsorted(axis, first))
    stop = int(np.searchsorted(axis, last, side="right"))
    start, stop = min(start, axis.size - 1), max(stop, 1)
    chosen = slice(start, max(stop, start + 1))
    return axis[chosen], chosen


def _brightest_of_blocks(
    magnitude: Float[np.ndarray, "x y"],
    x: Float[np.ndarray, " x"],
    y: Float[np.ndarray, " y"],
) -> tuple[Float[np.ndarray, "u v"], Float[np.ndarray, " u"], Float[np.ndarray, " v"]]:
    """Reduce an image by the maxima of blocks, so that thin bright lines stay visible."""
    for axis in (0, 1):
        size = magnitude.shape[axis]
        factor = -(-size // _MOST_PIXELS)
        if factor == 1:
            continue
        whole = size - size % factor
        moved = np.moveaxis(magnitude, axis, 0)[:whole]
        reduced = moved.reshape(whole // factor, factor, -1).max(axis=1)
        magnitude = np.moveaxis(reduced, 0, axis)
        if axis == 0:
            x = x[:whole].reshape(-1, factor).mean(axis=1)
        else:
            y = y[:whole].reshape(-1, factor).mean(axis=1)
    return magnitude, x, y


def _half_step(axis: Float[np.ndarray, " n"]) -> float:
    return float(axis[-1] - axis[0]) / (axis.size - 1) / 2 if axis.size > 1 else 0.5e-3
