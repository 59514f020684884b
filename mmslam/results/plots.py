"""Plots of what was simulated and found: each takes an Axes, or makes one, and returns it.

They draw what the pictures of ``mmslam run`` are composed of.
"""

import numpy as np
from matplotlib.axes import Axes

from estimator.results.estimate import AngleRangeMap, Estimate, Image, UserEstimate
from mmslam.results import pictures_3d
from scenes.scenario import Scenario
from validation.figures import figures_2d, figures_3d, views
from validation.figures.scenario_plan import draw_scenario
from validation.metrics.truth import Truth


def plot_scenario(scenario: Scenario, *, ax: Axes | None = None) -> Axes:
    """Draw a scenario from above: array, objects, users and where their antennas look.

    Examples
    --------
    >>> import mmslam
    >>> mmslam.plot_scenario(mmslam.load_scenario("slam_2d")).get_xlabel()
    'x, along the array [m]'
    """
    return draw_scenario(_axes(ax), scenario)


def plot_estimate(
    estimate: Estimate, *, truth: Truth | None = None, ax: Axes | None = None
) -> Axes:
    """Draw the plan of what was found: array, mirrors, targets, paths and users.

    Parameters
    ----------
    estimate
        Of a planar array, it is seen from above.
    truth
        What is drawn beside it: grey walls, and rings where users really are.
    ax
        Where to draw; None: on a new figure of pyplot.

    Raises
    ------
    ValueError
        If the estimate does not know its aperture.

    Examples
    --------
    >>> import numpy as np
    >>> from estimator import UserEstimate
    >>> ann = UserEstimate(name="ann", status="found", position=np.array([0.1, 0.3, 0.0]))
    >>> estimate = Estimate(users=(ann,), mirrors=(), aperture=np.array([[0.0, 0.0, 0.0]]))
    >>> plot_estimate(estimate).get_xlabel()
    'x, along the array [m]'
    """
    if estimate.aperture is None:
        raise ValueError(
            "this estimate does not know its aperture; plot one that mmslam.locate returned"
        )
    ax = _axes(ax)
    truth = truth or Truth()
    positions = estimate.aperture
    places = list(truth.user_position.values())
    if pictures_3d.in_space(estimate):
        box, view = pictures_3d.box_of(estimate, positions, places), figures_3d.TOP
        ax.grid(color="#dfe4e8", lw=0.6)
        ax.set_axisbelow(True)
        return figures_3d.draw_plan(ax, estimate, positions, view, box, true_positions=places)
    walls = [
        np.stack([start, truth.wall_end[name]])
        for name, start in truth.wall_start.items()
        if name in truth.wall_end
    ]
    points = [views.estimate_points(estimate, positions), *walls, *(p[None] for p in places)]
    return figures_2d.draw_localization(
        ax,
        estimate,
        positions,
        view=views.view_around(np.concatenate(points)),
        true_positions=places,
        true_walls=walls,
    )


def plot_user(user: UserEstimate, *, truth: Truth | None = None, ax: Axes | None = None) -> Axes:
    """Draw a user's position with its error ellipses, in millimetres about the truth.

    Raises
    ------
    ValueError
        If the user has no position.

    Examples
    --------
    >>> import numpy as np
    >>> ann = UserEstimate(name="ann", status="found", position=np.array([0.1, 0.3, 0.0]))
    >>> truth = Truth(user_position={"ann": np.array([0.1, 0.301, 0.0])})
    >>> plot_user(ann, truth=truth).get_title()
    'ann: 1.000 mm off'
    """
    known = None if truth is None else truth.user_position.get(user.name)
    return figures_2d.draw_close_up(_axes(ax), user, known)


def plot_image(image: Image, *, ax: Axes | None = None, floor_db: float = -40.0) -> Axes:
    """Draw an image's magnitude in decibels below its peak.

    Parameters
    ----------
    image
        In a plane; of a volume, the brightest voxel along z is shown.
    ax
        Where to draw; None: on a new figure of pyplot.
    floor_db
        The darkest level.

    Examples
    --------
    >>> import numpy as np
    >>> from estimator import Image, PixelGrid
    >>> grid = PixelGrid.spanning(x=(-0.1, 0.1), y=(0.3, 0.5), spacing=0.01)
    >>> image = Image(values=np.ones(grid.shape, dtype=complex), grid=grid)
    >>> plot_image(image).get_ylabel()
    'y, boresight [m]'
    """
    left, right, bottom, top = image.grid.extent
    view = views.View(left=left, right=right, bottom=bottom, top=top)
    return figures_2d.draw_image(_axes(ax), image, view=view, floor_db=floor_db)


def plot_angle_range_map(
    heard: AngleRangeMap, *, user: UserEstimate | None = None, ax: Axes | None = None
) -> Axes:
    """Draw a pilot's matched filter over angle and path length, and mark what was found.

    Examples
    --------
    >>> import numpy as np
    >>> heard = AngleRangeMap(
    ...     values=np.ones((5, 4), dtype=complex),
    ...     aoa=np.linspace(1.4, 1.7, 5),
    ...     path_length=np.linspace(1.7, 1.9, 4),
    ...     user="ann",
    ... )
    >>> plot_angle_range_map(heard).get_ylabel()
    'path length [m]'
    """
    return figures_2d.draw_angle_range_map(_axes(ax), heard, user)


def new_axes() -> Axes:
    """Return the axes of a new figure of pyplot, which a notebook shows by itself."""
    from matplotlib import pyplot as plt  # it keeps its figures until they are closed

    _, made = plt.subplots(layout="constrained")
    return made


def _axes(ax: Axes | None) -> Axes:
    return new_axes() if ax is None else ax
