"""Figures of random rooms: the estimates, over the true walls and users."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from estimator.localization.pipeline import locate
from simulator.simulation import simulate
from validation.figures.figures_2d import draw_localization
from validation.figures.views import estimate_points, view_around
from validation.metrics.truth import truth_from_dataset
from validation.random_rooms.prior import SEEDS, Purpose, draw_room


def draw_rooms(figure: Figure, kind: str, numbers: Sequence[int], *, purpose: Purpose) -> None:
    """Locate and draw rooms of a two-dimensional set side by side."""
    for index, number in enumerate(numbers):
        axes = figure.add_subplot(1, len(numbers), index + 1)
        scenario = draw_room(kind, number, purpose=purpose)
        simulated = simulate(scenario, seed=SEEDS[purpose], sample=number)
        estimate, truth = locate(simulated.measurement), truth_from_dataset(simulated.truth)
        positions = simulated.measurement.uplinks[0].positions
        walls = [np.stack([truth.wall_start[n], truth.wall_end[n]]) for n in truth.wall_start]
        users = list(truth.user_position.values())
        points = [estimate_points(estimate, positions), np.stack(users), *walls]
        draw_localization(
            axes,
            estimate,
            positions,
            view=view_around(np.concatenate(points)),
            true_positions=users,
            true_walls=walls,
        )
        axes.set_title(f"{kind} {number}: {estimate.users[0].status}", fontsize=9)
