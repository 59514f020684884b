"""Thesis figures 4.14 to 4.17: locating a user over two drywalls, as in the laboratory.

Run as ``python -m validation.experiments.fig04_14_lab_two_walls [FILE.png [SEEDS]]``; some two
minutes of one core for each seed.

4.14 is the set-up, 4.15 the image with both walls, 4.16 the angle/range map, 4.17 the localization.
The scenario is ``lab_two_walls``. What the thesis leaves open, and what was chosen (more of it in
the scenario's header): the walls' lengths (0.40 m and 0.30 m), permittivity (ITU-R P.2040-4) and
roughness (0.02 mm rms, correlation length 0.3 mm); one antenna for each position in place of two
horns side by side; where the absorber stands; noise (20 dB per channel sample). The thesis measured
one case and marked both mirrors by hand; here they are found.

Corrections: 220-329.98 GHz are 110 GHz, not 100, and resolve 1.36 mm, not 1.5 mm; the cross-range
of 2.6 cm at 2.8 m should be 0.886 λR/D = 20.8 mm.

There is no quick form: at half the size the second wall has half as many resolution cells along its
length, and the claims would differ.

Claims that are asserted: both walls at their true place, the second one first at its ghost's,
behind the first, and then unfolded; the map's -3 dB widths are theory's; the user within 3 mm in
the median, 5 mm at worst.
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from scenes.files.loading import load_scenario
from scenes.scenario import Scenario
from validation.figures import figures_2d, views
from validation.figures.scenario_plan import draw_scenario
from validation.harness.claim import Row, Tell
from validation.harness.row_table import conclude_with_figure
from validation.trials.hidden_user import (
    UserTrial,
    draw_map,
    draw_plan,
    first_user,
    hidden_user,
    user_rows,
    wall_rows,
)

WALLS = ("drywall_1", "drywall_2")
MEDIAN, WORST = 3e-3, 5e-3
BEHIND = (1.98, 1.08)
"""Length of the remaining path behind each wall. [m]"""
OFFSET = 1.36e-3
"""Largest offset of the walls: the null-to-peak range cell c/2B of the image. [m]"""


@dataclass(frozen=True, kw_only=True)
class LabTwoWalls:
    """All realisations; the first with what its figures show."""

    scenario: Scenario
    trials: tuple[UserTrial, ...]


def measure(*, seed: int = 0, seeds: int = 1, tell: Tell | None = None) -> LabTwoWalls:
    """Simulate and locate several realisations.

    Parameters
    ----------
    seed
        First seed.
    seeds
        Number of seeds.
    tell
        Called after each realisation.
    """
    scenario = load_scenario("lab_two_walls")
    trials: list[UserTrial] = []
    for index in range(seeds):
        trial = hidden_user(scenario, seed=seed + index, walls=WALLS)
        trials.append(replace(trial, seen=trial.seen if index == 0 else None))
        if tell is not None:
            tell(index + 1, seeds)
    return LabTwoWalls(scenario=scenario, trials=tuple(trials))


def rows(result: LabTwoWalls) -> tuple[Row, ...]:
    """Return the figures with their limits."""
    angles = [MEDIAN / (2 * length) for length in BEHIND]
    origin = "turns the user by 3 mm over the way behind it; range cell c/2B"
    ghost = "as the first wall's angle, which mirrors it; two range cells"
    return (
        *wall_rows(result.trials, 0, angle=angles[0], offset=OFFSET, origin=origin),
        *wall_rows(
            result.trials, 1, angle=2 * angles[0], offset=2 * OFFSET, origin=ghost, as_seen=True
        ),
        *wall_rows(result.trials, 1, angle=angles[1], offset=OFFSET, origin=origin),
        *user_rows(
            result.trials,
            median=MEDIAN,
            worst=WORST,
            thesis="thesis: about 3 mm, one case",
            across="thesis: 26 mm",
        ),
    )


def draw(figure: Figure, result: LabTwoWalls) -> None:
    """Draw 4.14 to 4.17 of the first realisation."""
    trial = result.trials[0]
    if trial.seen is None:
        raise RuntimeError("the first realisation's images were not kept; nothing can be drawn")
    estimate, positions = trial.seen.estimate, trial.seen.measurement.uplinks[0].positions
    raw, corrected = estimate.raw_image, estimate.corrected_image
    if raw is None or corrected is None:
        raise RuntimeError("no image was formed; nothing can be drawn")
    axes = figure.subplots(2, 3)
    draw_scenario(axes[0, 0], result.scenario)
    axes[0, 0].set_title("4.14: the set-up")
    shown = [views.estimate_points(estimate, positions), views.ghost_points(estimate)]
    view = views.view_around(np.concatenate([*shown, views.bright_points(raw)]))
    for ax, image, unfolded in ((axes[0, 1], raw, False), (axes[0, 2], corrected, True)):
        figures_2d.draw_image(ax, image, view=view, floor_db=-60.0)
        figures_2d.overlay_array(ax, positions, colour=figures_2d.ON_DARK)
        mirrors = estimate.mirrors if unfolded else estimate.mirrors[:1]
        figures_2d.overlay_mirrors(ax, mirrors, line=False)
    axes[0, 1].set_title("4.15: raw, the second wall behind the first")
    figures_2d.overlay_paths(axes[0, 2], estimate.users, width=1.0)
    axes[0, 2].set_title("4.15: unfolded")
    draw_map(axes[1, 0], trial)
    axes[1, 0].set_title(f"4.16: {axes[1, 0].get_title()}", fontsize=10)
    draw_plan(axes[1, 1], trial)
    axes[1, 1].set_title("4.17: what was found")
    user = first_user(trial)
    if user.position is None:
        axes[1, 2].set_axis_off()
    else:
        figures_2d.draw_close_up(axes[1, 2], user, trial.seen.truth.user_position[user.name])
        axes[1, 2].legend(fontsize=8)


def main(arguments: list[str]) -> None:
    """Simulate, draw, print the figures and check them."""
    path = Path(arguments[0] if arguments else "fig04_14_lab_two_walls.png")
    seeds = int(arguments[1]) if len(arguments) > 1 else 1
    result = measure(seeds=seeds, tell=lambda done, count: print(f"{done} of {count}", flush=True))
    conclude_with_figure(path, (16, 10.5), lambda figure: draw(figure, result), rows(result))


if __name__ == "__main__":
    main(sys.argv[1:])
