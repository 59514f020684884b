"""Imaging of hidden targets over a wall: the mirror, and the targets' unfolded positions."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from estimator.array.resolution import cell_at
from estimator.geometry.wall_2d import mirrored
from estimator.localization.pipeline import locate
from estimator.measurement.model import Echo, Measurement
from estimator.results.estimate import Estimate, Image
from scenes.scenario import Scenario
from scenes.schema.objects import Cylinder
from simulator.simulation import simulate
from validation.figures import figures_2d, views
from validation.figures.resolution_bars import draw_resolution_bars
from validation.figures.scenario_plan import outline
from validation.harness.claim import Row
from validation.harness.row_table import conclude_with_figure
from validation.metrics.errors import WallError, wall_error
from validation.metrics.target_association import compare_targets
from validation.metrics.truth import Truth, front_face, truth_from_dataset

RANGE_LIMIT = 1.5e-3
"""Largest error of an unfolded front face along its line of sight: the null-to-peak range cell c/2B
of 100 GHz, the thesis' range resolution. [m]"""
FALSE_DB = -10.0
"""Least level of a counted false target, relative to the weakest true one: brighter ones look like
another object in a figure. [dB]"""
ANGLE_LIMIT = np.degrees(1e-3 / 2 / 0.6)
"""Largest error of the mirror's angle: it moves a target 0.6 m behind it by 1 mm. [°]"""
OFFSET_LIMIT = 0.5e-3
"""Largest error of the mirror's offset: at 45° it moves an unfolded target by √2 as much along its
line of sight, half of :data:`RANGE_LIMIT`. [m]"""
PEAK_WITHIN = 8e-3
"""Radius around a true front face in which the corrected image's peak is searched: two cells.
[m]"""


@dataclass(frozen=True, kw_only=True)
class HiddenTarget:
    """One hidden object: errors of its position against its true front face."""

    name: str
    range_error: float  # along the last leg of the path from the array, + too far [m]
    across_error: float  # across that, unsigned [m]
    ghost_error: float  # of the ghost in the raw image, from the true mirror image [m]
    image_range_error: float  # range error of the corrected image's brightest pixel there [m]
    cell_across: float  # -3 dB, at the ghost [m]
    level_db: float  # over an ideal unit point's [dB]


@dataclass(frozen=True, kw_only=True)
class HiddenImaging:
    """Result of one realisation."""

    scenario: Scenario
    seed: int
    mirror: WallError
    targets: tuple[HiddenTarget, ...]
    missed: tuple[str, ...]  # names of objects that were not found
    false_levels_db: tuple[float, ...]  # over the weakest true target [dB]
    pixel: float  # of the images [m]
    estimate: Estimate
    echo: Echo

    @property
    def false(self) -> int:
        """Number of false targets above :data:`FALSE_DB`."""
        return sum(level > FALSE_DB for level in self.false_levels_db)


@runtime_checkable
class MeasureSeed(Protocol):
    """Function that simulates and images one realisation."""

    def __call__(self, *, seed: int) -> HiddenImaging:
        """Simulate and image the realisation of a seed."""


def measure_hidden(scenario: Scenario, *, seed: int, wall: str) -> HiddenImaging:
    """Simulate a scenario, image and unfold it, and compare with the truth.

    Parameters
    ----------
    scenario
        With one wall, and targets that are visible only over it.
    seed
        Of roughness and noise.
    wall
        Name of the wall.

    Raises
    ------
    RuntimeError
        If no mirror is found.
    """
    simulation = simulate(scenario, seed=seed)
    truth = truth_from_dataset(simulation.truth)
    return compare_hidden(scenario, simulation.measurement, truth, seed=seed, wall=wall)


def compare_hidden(
    scenario: Scenario, measurement: Measurement, truth: Truth, *, seed: int, wall: str
) -> HiddenImaging:
    """Image and unfold a measurement of the scenario, and compare with the truth."""
    estimate, echo = locate(measurement), measurement.echo
    if echo is None or not estimate.mirrors or estimate.corrected_image is None:
        raise RuntimeError(f"{scenario.name}, seed {seed}: no mirror is found in the echo")
    start, end = truth.wall_start[wall], truth.wall_end[wall]
    centre = echo.positions.mean(axis=0)
    image = mirrored(centre, start, end)
    cells = {
        name: cell_at(
            mirrored(front_face(truth, name, image), start, end),
            positions=echo.positions,
            frequencies=echo.frequencies,
        ).across
        for name in truth.target_position
    }
    compared = compare_targets(
        estimate.targets,
        truth,
        mirrors=estimate.mirrors,
        aperture=centre,
        cutoff=2 * max(cells.values()),
    )
    found = []
    for target, name in zip(estimate.targets, compared.names, strict=True):
        if name is None:
            continue
        face = front_face(truth, name, image)
        ahead = (face - image) / np.linalg.norm(face - image)
        error = target.position - face
        brightest = _brightest(estimate.corrected_image, face)
        found.append(
            HiddenTarget(
                name=name,
                range_error=float(error @ ahead),
                across_error=float(np.linalg.norm(error - (error @ ahead) * ahead)),
                ghost_error=float(np.linalg.norm(target.ghost - mirrored(face, start, end))),
                image_range_error=float((brightest - face) @ ahead),
                cell_across=cells[name],
                level_db=float(target.level_db if target.level_db is not None else np.nan),
            )
        )
    weakest = min((one.level_db for one in found), default=np.nan)
    false = [
        float((target.level_db or 0.0) - weakest)
        for target, name in zip(estimate.targets, compared.names, strict=True)
        if name is None
    ]
    return HiddenImaging(
        scenario=scenario,
        seed=seed,
        mirror=wall_error(estimate.mirrors[0], wall, start, end),
        targets=tuple(sorted(found, key=lambda one: one.name)),
        missed=compared.missed,
        false_levels_db=tuple(false),
        pixel=max(estimate.corrected_image.grid.spacing),
        estimate=estimate,
        echo=echo,
    )


def conclude_hidden(arguments: Sequence[str], name: str, measure: MeasureSeed) -> None:
    """Run an experiment from the command line: simulate, draw the first, print and check.

    Parameters
    ----------
    arguments
        The figure's file and the number of realisations, both optional.
    name
        Of the experiment; the file's default.
    measure
        Function that simulates and images a realisation by its seed.
    """
    path = Path(arguments[0] if arguments else f"{name}.png")
    seeds = int(arguments[1]) if len(arguments) > 1 else 1
    results = [measure(seed=seed) for seed in range(seeds)]
    conclude_with_figure(
        path, (12.5, 6.4), lambda figure: draw_hidden(figure, results[0]), hidden_rows(results)
    )


def hidden_rows(results: Sequence[HiddenImaging]) -> tuple[Row, ...]:
    """Return rows of the largest errors of several realisations."""
    targets = [target for one in results for target in one.targets]
    seeds = f"worst of {len(results)}" if len(results) > 1 else "one realisation"
    pixel = max(one.pixel for one in results)
    return (
        Row(
            name=f"mirror's angle, {seeds}",
            stated="found without help; marked by hand in the thesis",
            measured=float(np.degrees(max(one.mirror.angle for one in results))),
            unit="°",
            high=float(ANGLE_LIMIT),
            origin="1 mm at a target 0.6 m behind the mirror",
        ),
        Row(
            name=f"mirror's offset, {seeds}",
            stated="found without help; marked by hand in the thesis",
            measured=1e3 * max((one.mirror.offset for one in results), key=abs),
            unit="mm",
            low=-1e3 * OFFSET_LIMIT,
            high=1e3 * OFFSET_LIMIT,
            origin="half of the range claim of unfolded targets",
        ),
        Row(
            name="objects missed",
            stated="every ghost folds back to its object",
            measured=float(sum(len(one.missed) for one in results)),
            high=0.0,
            origin="all of them are there in every realisation",
        ),
        Row(
            name=f"unfolded front faces along range, {seeds}",
            stated="thesis: at their places, range resolution 1.5 mm",
            measured=1e3 * _worst([abs(target.range_error) for target in targets]),
            unit="mm",
            high=1e3 * RANGE_LIMIT,
            origin="range cell c/2B of 100 GHz",
        ),
        Row(
            name=f"unfolded front faces across, over their cell, {seeds}",
            stated="thesis: at their places",
            measured=_worst([target.across_error / target.cell_across for target in targets]),
            high=1.0,
            origin="-3 dB cell 0.886 λR/2D at the ghost",
        ),
        Row(
            name=f"ghosts in the raw image, from the mirror images of the faces, {seeds}",
            stated="thesis: mirrored behind the wall",
            measured=1e3 * _worst([target.ghost_error for target in targets]),
            unit="mm",
            high=1e3 * max(target.cell_across for target in targets) if targets else 0.0,
            origin="-3 dB cell 0.886 λR/2D, the larger one",
        ),
        Row(
            name=f"peak of the corrected image along range, {seeds}",
            stated="thesis: at their places, range resolution 1.5 mm",
            measured=1e3 * _worst([abs(target.image_range_error) for target in targets]),
            unit="mm",
            high=1e3 * (RANGE_LIMIT + pixel),
            origin="range cell c/2B, and a pixel",
        ),
        Row(
            name=f"false targets above {FALSE_DB:g} dB of the weakest true one",
            stated="thesis' figure shows none",
            measured=float(sum(one.false for one in results)),
            high=0.0,
            origin="what an eye would take for an object",
        ),
    )


def _worst(values: list[float]) -> float:
    return max(values, default=float("nan"))


def _brightest(image: Image, place: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 3"]:
    """Return the image's brightest pixel near a place. [m]."""
    points = image.grid.points.reshape(-1, 3)
    near = np.linalg.norm(points - place, axis=1) <= PEAK_WITHIN
    chosen = points[near]
    return np.asarray(chosen[int(np.argmax(np.abs(image.values).reshape(-1)[near]))])


def _silhouette(scenario: Scenario, name: str) -> Float[np.ndarray, "corners 3"]:
    """Return the closed outline of a body seen from above. [m]."""
    body = scenario.objects[name]
    if isinstance(body, Cylinder):
        angles = np.linspace(0, 2 * np.pi, 61)
        ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(61)], axis=-1)
        return np.asarray(body.centre + body.radius_m * ring)
    corners = outline(scenario, name)
    return np.concatenate([corners, corners[:1]])


def draw_hidden(figure: Figure, result: HiddenImaging) -> None:
    """Draw the raw image with its ghosts, and the corrected one with mirror and targets.

    The truth is drawn in white; the true places of ghosts in the raw image are dotted.
    """
    raw, corrected = result.estimate.raw_image, result.estimate.corrected_image
    if raw is None or corrected is None:
        raise RuntimeError("the estimate holds no images to draw")
    wall = outline(result.scenario, result.mirror.wall)
    bodies = {target.name: _silhouette(result.scenario, target.name) for target in result.targets}
    ghosts = {name: mirrored(line, wall[0], wall[1]) for name, line in bodies.items()}
    everything = np.concatenate(
        [
            result.echo.positions,
            wall,
            *bodies.values(),
            *ghosts.values(),
            views.estimate_points(result.estimate, result.echo.positions),
        ]
    )
    view = views.view_around(everything, margin=0.11)
    left, right = figure.subplots(1, 2)
    figures_2d.draw_image(left, raw, view=view, floor_db=-50.0)
    figures_2d.draw_image(right, corrected, view=view, floor_db=-50.0)
    for line in ghosts.values():
        left.plot(line[:, 0], line[:, 1], ":", color="white", lw=0.9)
    for line in bodies.values():
        right.plot(line[:, 0], line[:, 1], "-", color="white", lw=0.9)
    for ax in (left, right):
        figures_2d.overlay_array(ax, result.echo.positions, colour=figures_2d.ON_DARK)
    figures_2d.overlay_mirrors(left, result.estimate.mirrors[:1], line=False)
    figures_2d.overlay_mirrors(right, result.estimate.mirrors[:1])
    figures_2d.overlay_targets(right, result.estimate.targets)
    nearest = result.estimate.targets[0].ghost if result.estimate.targets else wall.mean(axis=0)
    draw_resolution_bars(left, view, nearest, result.echo.positions, result.echo.frequencies)
    left.set_title(
        "Raw image: ghosts behind the wall (dotted: mirror images of the true outlines)", fontsize=9
    )
    right.set_title("Ghosts unfolded (lines: true outlines)", fontsize=9)
