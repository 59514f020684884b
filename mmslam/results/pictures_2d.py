"""The pictures of one result, composed of the figures' parts and saved as PNG."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from estimator.measurement.model import Measurement
from estimator.results.estimate import Estimate, Image
from mmslam import own_results
from mmslam.plain_text import drawn_plainly
from mmslam.results import pictures_3d
from validation.figures import figures_2d, views
from validation.figures.resolution_bars import draw_resolution_bars
from validation.metrics.truth import Truth

DOTS_PER_INCH = 150
_DEEPEST_DB = -100.0  # lowest level of the colour scale
_NEAR = 0.01  # radius around a target in which its image level is read [m]
_CLOSE_UPS = 3  # users shown enlarged; more would be too small to read


def write_pictures(
    folder: Path, measurement: Measurement, estimate: Estimate, truth: Truth
) -> dict[str, Path]:
    """Draw what an estimate holds and save it.

    Parameters
    ----------
    folder
        Where the files go.
    measurement, estimate, truth
        What is drawn; the truth is marked only if it is known.

    Returns
    -------
    The files by their names; what was not measured (no echo, no uplink) has no picture.
    """
    positions = aperture(measurement)
    if pictures_3d.in_space(estimate):
        return _saved(folder, _drawn_in_space(estimate, positions, truth))
    drawn: dict[str, Figure] = {}
    for name, image in zip(
        own_results.FIGURES[:2], (estimate.raw_image, estimate.corrected_image), strict=True
    ):
        if image is not None:
            drawn[name] = image_figure(
                image,
                estimate,
                positions,
                corrected="corrected" in name,
                frequencies=measurement.echo.frequencies if measurement.echo else None,
            )
    if estimate.maps:
        drawn["angle_range_map.png"] = angle_range_figure(estimate)
    drawn["localization.png"] = localization_figure(estimate, positions, truth)
    return _saved(folder, drawn)


def _drawn_in_space(
    estimate: Estimate, positions: Float[np.ndarray, "positions 3"], truth: Truth
) -> dict[str, Figure]:
    drawn: dict[str, Figure] = {}
    for name, image in zip(
        own_results.FIGURES[:2], (estimate.raw_image, estimate.corrected_image), strict=True
    ):
        if image is not None:
            drawn[name] = pictures_3d.volume_figure(
                image, estimate, positions, corrected="corrected" in name
            )
    if estimate.direction_maps:
        drawn["angle_range_map.png"] = pictures_3d.directions_figure(estimate)
    drawn["localization.png"] = pictures_3d.space_figure(estimate, positions, truth)
    return drawn


def _saved(folder: Path, drawn: dict[str, Figure]) -> dict[str, Path]:
    paths = {}
    for name, figure in drawn.items():
        paths[name] = folder / name
        save(figure, paths[name])
    return paths


def save(figure: Figure, path: Path) -> None:
    """Save a figure as PNG, the same bytes for the same figure and versions."""
    drawn_plainly(figure)
    figure.savefig(path, dpi=DOTS_PER_INCH, format="png", metadata={"Software": None})


def aperture(measurement: Measurement) -> Float[np.ndarray, "positions 3"]:
    """Return the phase centres of the echo, else of the first uplink, else the base station [m]."""
    return measurement.places


def image_figure(
    image: Image,
    estimate: Estimate,
    positions: Float[np.ndarray, "positions 3"],
    *,
    corrected: bool,
    frequencies: Float[np.ndarray, " freqs"] | None = None,
) -> Figure:
    """Draw a SAR image: raw with the mirrors marked, corrected with all that was found.

    Both show the same part of the plane, to be looked at side by side. With the echo's
    frequencies, bars tell the resolution.
    """
    images = [shown for shown in (estimate.raw_image, estimate.corrected_image) if shown]
    bright = [views.bright_points(shown) for shown in images]
    ghosts = views.ghost_points(estimate)
    shown = [views.estimate_points(estimate, positions), ghosts, *bright]
    view = views.view_around(np.concatenate(shown))
    figure = _figure(view, extra_width=1.1)
    floor_db = _floor_db(image, estimate, ghosts, corrected=corrected)
    ax = figures_2d.draw_image(figure.subplots(), image, view=view, floor_db=floor_db)
    figures_2d.overlay_mirrors(ax, estimate.mirrors, line=corrected)
    figures_2d.overlay_array(ax, positions, colour=figures_2d.ON_DARK)
    if frequencies is not None:
        draw_resolution_bars(ax, view, _brightest_point(image), positions, frequencies)
    if corrected:
        figures_2d.overlay_targets(ax, estimate.targets)
        figures_2d.overlay_paths(ax, estimate.users, width=1.2)
        figures_2d.overlay_users(ax, estimate.users)
    ax.set_title(
        "Image with ghosts unfolded" if corrected else "Raw image: walls and ghosts as seen"
    )
    return figure


def _floor_db(
    image: Image,
    estimate: Estimate,
    ghosts: Float[np.ndarray, "points 3"],
    *,
    corrected: bool,
) -> float:
    """Return the lowest level of the colour scale, so that all detections are visible [dB]."""
    middles = [0.5 * (mirror.start + mirror.end) for mirror in estimate.mirrors]
    places = [target.position for target in estimate.targets]
    things = np.array([*middles, *places]).reshape(-1, 3) if corrected else ghosts
    faintest = views.faintest_db(image, things, within=_NEAR)
    if faintest is None:
        return figures_2d.FLOOR_DB
    return float(np.clip(10 * np.floor((faintest - 10) / 10), _DEEPEST_DB, figures_2d.FLOOR_DB))


def _brightest_point(image: Image) -> Float[np.ndarray, " 3"]:
    place = np.unravel_index(int(np.argmax(np.abs(image.values))), image.values.shape)
    return np.asarray(image.grid.points[place])


def angle_range_figure(estimate: Estimate) -> Figure:
    """Draw the angle/range map of every user, whole and enlarged about what was found."""
    users = {user.name: user for user in estimate.users}
    figure = Figure(figsize=(11.5, 4.6 * len(estimate.maps)), layout="constrained")
    axes = figure.subplots(len(estimate.maps), 2, squeeze=False)
    for row, whole, part in zip(axes, estimate.maps, estimate.close_ups, strict=True):
        user = users.get(whole.user)
        figures_2d.draw_angle_range_map(row[0], whole, user)
        row[0].set_title(f"Uplink of {whole.user}")
        peak = max(float(np.abs(shown.values).max()) for shown in (whole, part))
        figures_2d.draw_angle_range_map(row[1], part, user, peak=peak)
        row[1].set_title("enlarged")
    return figure


def localization_figure(
    estimate: Estimate, positions: Float[np.ndarray, "positions 3"], truth: Truth
) -> Figure:
    """Draw the plan of what was found, and each user enlarged with its error ellipse."""
    true_positions = list(truth.user_position.values())
    true_walls = [
        np.stack([start, truth.wall_end[name]])
        for name, start in truth.wall_start.items()
        if name in truth.wall_end
    ]
    points = np.concatenate(
        [
            views.estimate_points(estimate, positions),
            *(place[None] for place in true_positions),
            *true_walls,
        ]
    )
    found = [user for user in estimate.users if user.position is not None][:_CLOSE_UPS]
    view = views.view_around(points)
    figure = _figure(view, extra_width=3.6 if found else 0.0, extra_height=0.5)
    columns = figure.add_gridspec(1, 2 if found else 1, width_ratios=[2.1, 1][: 1 + bool(found)])
    ax = figures_2d.draw_localization(
        figure.add_subplot(columns[0]),
        estimate,
        positions,
        view=view,
        true_positions=true_positions,
        true_walls=true_walls,
    )
    ax.set_title("What was found")
    if found:
        rows = columns[1].subgridspec(len(found), 1)
        for row, user in enumerate(found):
            figures_2d.draw_close_up(
                figure.add_subplot(rows[row]), user, truth.user_position.get(user.name)
            )
    silent = [
        f"{user.name}: {user.status.replace('_', ' ')}"
        for user in estimate.users
        if user.position is None
    ]
    if silent:
        ax.text(
            0.02, 0.98, "\n".join(silent), transform=ax.transAxes, va="top", color=figures_2d.USER
        )
    figure.legend(
        handles=list(_legend(estimate, bool(true_positions or true_walls))),
        loc="outside lower center",
        ncols=6,
        frameon=False,
        fontsize=9,
    )
    return figure


def _legend(estimate: Estimate, truth_known: bool) -> Iterable[Line2D]:
    if estimate.mirrors:
        yield Line2D([], [], color=figures_2d.MIRROR, ls="--", lw=1.8, label="mirror")
    if any(user.path is not None for user in estimate.users):
        yield Line2D([], [], color=figures_2d.PATH, lw=1.6, label="path")
    if any(user.position is not None for user in estimate.users):
        yield Line2D([], [], color=figures_2d.USER, marker="o", ls="", label="user, 1σ and 2σ")
    if truth_known:
        yield Line2D(
            [], [], color=figures_2d.INK, marker="o", mfc="none", ms=9, ls="", label="true user"
        )
        yield Line2D([], [], color="#c9d1d6", lw=7, label="true wall")


def _figure(view: views.View, *, extra_width: float = 0.0, extra_height: float = 0.0) -> Figure:
    """Make a figure whose main axes fit the view's shape without white borders."""
    width = 6.4 if view.aspect >= 1 else max(6.4 * view.aspect, 3.2)
    height = width / view.aspect
    return Figure(
        figsize=(width + 0.9 + extra_width, min(height, 9.0) + 0.9 + extra_height),
        layout="constrained",
    )
