"""The pictures of a result in space: projections of the volume, and both angles of a pilot."""

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from estimator.results.estimate import Estimate, Image
from validation.figures import figures_2d, figures_3d, views
from validation.metrics.truth import Truth

_CLOSE_UPS = 3


def in_space(estimate: Estimate) -> bool:
    """Tell whether an estimate is one of a planar array."""
    if any(mirror.corners is not None for mirror in estimate.mirrors):
        return True
    if estimate.maps or estimate.direction_maps:
        return bool(estimate.direction_maps)
    image = estimate.raw_image
    return image is not None and image.values.ndim == 3


def volume_figure(
    image: Image,
    estimate: Estimate,
    positions: Float[np.ndarray, "positions 3"],
    *,
    corrected: bool,
) -> Figure:
    """Draw a volume from above, from the array and from the side, cropped to its bright voxels."""
    box = figures_3d.box_around(np.concatenate([_bright(image), *_found(estimate)]))
    figure, grid = _three_views(box)
    for view, cell in zip(figures_3d.VIEWS, grid, strict=True):
        ax = figure.add_subplot(cell)
        figures_3d.draw_projection(ax, image, view, box, bar=view is figures_3d.SIDE)
        figures_3d.draw_plan(
            ax,
            estimate,
            positions,
            view,
            box,
            colour=figures_2d.ON_DARK,
            array_colour=figures_2d.ON_DARK,
            users=corrected,
        )
    figure.suptitle(
        "Brightest voxel, ghosts unfolded" if corrected else "Brightest voxel, as measured"
    )
    return figure


def directions_figure(estimate: Estimate) -> Figure:
    """Draw each user's pilot over both angles, and over one angle and path length."""
    users = {user.name: user for user in estimate.users}
    maps = estimate.direction_maps
    figure = Figure(figsize=(12.0, 4.8 * len(maps)), layout="constrained")
    axes = figure.subplots(len(maps), 2, squeeze=False)
    for row, heard in zip(axes, maps, strict=True):
        figures_3d.draw_directions(row[0], heard, users.get(heard.user))
        row[0].set_title(f"Uplink of {heard.user}, strongest of all lengths")
        figures_3d.draw_lengths(row[1], heard, users.get(heard.user))
        row[1].set_title("strongest of all elevations")
    return figure


def space_figure(
    estimate: Estimate, positions: Float[np.ndarray, "positions 3"], truth: Truth
) -> Figure:
    """Draw what was found from three sides, and each user enlarged from above."""
    true_positions = list(truth.user_position.values())
    box = box_of(estimate, positions, true_positions)
    found = [user for user in estimate.users if user.position is not None][:_CLOSE_UPS]
    figure, grid = _three_views(box, extra=3.6 if found else 0.0)
    for view, cell in zip(figures_3d.VIEWS, grid, strict=False):
        ax = figure.add_subplot(cell)
        ax.grid(color="#dfe4e8", lw=0.6)
        ax.set_axisbelow(True)
        figures_3d.draw_plan(ax, estimate, positions, view, box, true_positions=true_positions)
    if found:
        rows = grid[-1].subgridspec(len(found), 1)
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
        figure.text(0.01, 0.99, "\n".join(silent), va="top", color=figures_2d.USER)
    figure.suptitle("What was found (rings: where users really are)")
    return figure


def box_of(
    estimate: Estimate,
    positions: Float[np.ndarray, "positions 3"],
    true_positions: list[Float[np.ndarray, " 3"]],
) -> figures_3d.Box:
    """Return the part of space that shows all that was found, and all true positions [m]."""
    points = [views.estimate_points(estimate, positions), *_found(estimate)]
    return figures_3d.box_around(np.concatenate([*points, *(p[None] for p in true_positions)]))


def _found(estimate: Estimate) -> list[Float[np.ndarray, "points 3"]]:
    corners = [mirror.corners for mirror in estimate.mirrors if mirror.corners is not None]
    return corners + [target.position[None] for target in estimate.targets]


def _bright(image: Image, *, threshold_db: float = -30.0) -> Float[np.ndarray, "2 3"]:
    """Return two corners of the box around all voxels that are bright."""
    magnitude = np.abs(image.values)
    bright = magnitude > 10 ** (threshold_db / 20) * magnitude.max()
    corners = np.zeros((2, 3))
    for axis, coordinate in enumerate((image.grid.x, image.grid.y, image.grid.z)):
        used = np.flatnonzero(bright.any(axis=tuple(a for a in range(3) if a != axis)))
        corners[:, axis] = coordinate[used[[0, -1]]]
    return corners


def _three_views(box: figures_3d.Box, *, extra: float = 0.0) -> tuple[Figure, list[SubplotSpec]]:
    """Make room for three views at one scale; more to the right of them, if asked."""
    widths = [box.sides(view)[0] for view in figures_3d.VIEWS]
    height = max(box.sides(view)[1] for view in figures_3d.VIEWS)
    scale = min(11.0 / sum(widths), 7.0 / height)
    sizes = [max(width * scale, 2.2) for width in widths] + ([extra] if extra else [])
    figure = Figure(
        figsize=(sum(sizes) + 3.0, max(height * scale, 3.0) + 1.6), layout="constrained"
    )
    spec = figure.add_gridspec(1, len(sizes), width_ratios=sizes)
    return figure, [spec[0, column] for column in range(len(sizes))]
