"""Statistics of the echoes of random rough walls, compared with thresholds of wall detection.

The walls are those of :mod:`validation.trials.drawn_echoes`, whose true lines are known. Measured
are the statistics that thresholds bound (distances of peaks from the wall, their coherence, the
share of the echo explained by the wall's row), and the result of detection if one threshold is
changed and all others are kept.
"""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from estimator.array.linear_array import echo_reach, echo_resolution
from estimator.array.resolution_cell import coarse_resolution
from estimator.array.windows import survey_weights
from estimator.geometry.wall_2d import unit_normal
from estimator.imaging.backprojection import prepare
from estimator.imaging.focusing import focus_within
from estimator.imaging.range_compression import range_profiles
from estimator.imaging.survey_2d import Survey, survey
from estimator.walls import line_fit_image, line_relations, wall_detection_2d
from estimator.walls.fitted_line import FittedLine
from estimator.walls.line_fit_echo import fit_coherently
from estimator.walls.line_fit_image import fit_line
from estimator.walls.line_refinement import refine_by_echo
from estimator.walls.wall_detection_2d import detect_mirrors
from scenes.files.loading import load_scenario
from simulator.simulation import simulate
from validation.metrics.truth import truth_from_dataset
from validation.trials.drawn_echoes import DrawnEcho, Kind, Segment, draw_echo
from validation.trials.trap_rooms import FARTHER

NEAR = 6.0
"""Distance from a true wall within which peaks are attributed to it. [cells]"""
SAME_ANGLE = np.radians(2.0)
"""Largest angle between a detected line and the true wall that it represents. [rad]"""


@dataclass(frozen=True, kw_only=True)
class WallStatistics:
    """Statistics of one wall's echo; NaN if the wall was not detected."""

    beside: float  # distance from the line within which 99 % of its peaks are [cells]
    beyond_end: float  # of the farthest peak beyond an end of the detected line [cells]
    bent: float  # share of its peaks with an excess curvature [-]
    coherence: float  # median of its peaks [-]
    contrast: float  # level over background of the detected line [-]
    deviation: float  # stated, of its offset or its ends, the larger [cells]
    explained: float  # share of the echo that the row of scatterers explains [-]
    disagreement: float  # between the fits to image and echo, normalised square [-]
    turn: float  # angle between detected and true line [rad]
    tilt_share: float  # its square over the variance expected from speckle [-]
    offset_share: float  # the same of its offset [-]


@dataclass(frozen=True, kw_only=True)
class Surveyed:
    """A drawn echo with its survey."""

    drawn: DrawnEcho
    looked: Survey


def surveyed(kinds: Sequence[Kind], seed: int) -> tuple[Surveyed, ...]:
    """Draw and survey an echo for each kind in a list."""
    echoes = [
        draw_echo(kind, np.random.default_rng([seed, index])) for index, kind in enumerate(kinds)
    ]
    return tuple(Surveyed(drawn=one, looked=survey(one.echo)) for one in echoes)


WALLS: dict[str, tuple[str, ...]] = {
    "metal, 20 cm, 45°, 0.05 mm": (),
    "metal, 20 cm, 20°, 0.05 mm": ("objects.wall.angle_deg=20.0",),
    "metal, 40 cm, 45°, 0.05 mm": ("objects.wall.length_m=0.4",),
    "metal, 20 cm, 45°, 0.01 mm": ("objects.wall.roughness.rms_mm=0.01",),
    "metal, 20 cm, 45°, 0.1 mm": (
        "objects.wall.roughness.rms_mm=0.1",
        "objects.wall.roughness.correlation_mm=0.6",
    ),
    "drywall, 20 cm, 45°, 0.02 mm": (
        "objects.wall.material=drywall",
        "objects.wall.roughness.rms_mm=0.02",
    ),
}
"""Overrides of the wall of :data:`validation.trials.trap_rooms.FARTHER`. All of it is within the
unambiguous range: a part beyond would not be explained by the wall's row."""


def simulated_wall(overrides: Sequence[str], seed: int) -> Surveyed:
    """Simulate the echo of ``slam_2d`` at half its size, with its one wall, and survey it."""
    simulation = simulate(load_scenario("slam_2d", [*FARTHER, *overrides]), seed=seed)
    truth, echo = truth_from_dataset(simulation.truth), simulation.measurement.echo
    assert echo is not None
    wall = truth.wall_start["wall"], truth.wall_end["wall"]
    return Surveyed(drawn=DrawnEcho(kind="wall", echo=echo, walls=(wall,)), looked=survey(echo))


def wall_statistics(one: Surveyed) -> WallStatistics:
    """Measure the statistics of the single wall of an echo."""
    (wall,) = one.drawn.walls
    echo, looked = one.drawn.echo, one.looked
    fine = echo_resolution(echo)
    coarse = coarse_resolution(fine)
    along = (wall[1] - wall[0]) / np.linalg.norm(wall[1] - wall[0])
    normal = unit_normal(*wall)
    beside = np.abs((looked.peaks - wall[0]) @ normal) / coarse.cell(looked.peaks, normal)
    cells = coarse.cell(looked.peaks, along)
    places = (looked.peaks - wall[0]) @ along
    length = float(np.linalg.norm(wall[1] - wall[0]))
    own = (beside < NEAR) & (places > -NEAR * cells) & (places < length + NEAR * cells)
    coherent = np.maximum(looked.as_point, looked.as_mirror)
    line = _match(wall, detect_mirrors(echo, looked))
    beyond = contrast = deviation = explained = disagreement = turn = np.nan
    tilt_share = offset_share = np.nan
    if line is not None:
        off = np.abs((looked.peaks[own] - line.middle) @ line.direction) - 0.5 * line.length
        beyond = float(np.max(off / cells[own]))
        contrast = line.level / line.background
        spread = np.sqrt(np.diag(line.covariance)) * [0.5 * line.length, 1.0]
        deviation = float(np.max(spread) / float(fine.cell(line.middle, line.normal)))
        turn = _turn(wall, line)
        expected = np.diag(line.covariance) / [
            line_fit_image.TILT_SHARE,
            line_fit_image.OFFSET_SHARE,
        ]
        tilt_share = turn**2 / expected[0]
        offset_share = float(((line.middle - wall[0]) @ normal) ** 2 / expected[1])
        row = fit_coherently(
            echo,
            line.start,
            line.end,
            cell_along=float(fine.cell(line.middle, line.direction)),
            cell_across=float(fine.cell(line.middle, line.normal)),
        )
        if row is not None:
            explained = row.explained
            starts = float((row.start - line.start) @ line.normal)
            ends = float((row.end - line.end) @ line.normal)
            change = np.array([(starts - ends) / line.length, 0.5 * (starts + ends)])
            both = line.covariance + row.covariance
            disagreement = float(change @ np.linalg.solve(both, change))
    return WallStatistics(
        beside=float(np.quantile(beside[own], 0.99)),
        beyond_end=beyond,
        bent=float(np.mean(looked.bent[own])),
        coherence=float(np.median(coherent[own])),
        contrast=contrast,
        deviation=deviation,
        explained=explained,
        disagreement=disagreement,
        turn=turn,
        tilt_share=tilt_share,
        offset_share=offset_share,
    )


@dataclass(frozen=True, kw_only=True)
class Detection:
    """Result of detection on several echoes."""

    walls: int  # true ones
    found: int  # of them
    false: int  # lines that are not walls
    median_turn: float  # error of angle of those found [rad]


def detection(echoes: Sequence[Surveyed]) -> Detection:
    """Detect the walls of echoes, refine them by the whole echo, and compare with the truth."""
    turns: list[float] = []
    false = 0
    for one in echoes:
        lines = list(
            refine_by_echo(one.drawn.echo, one.looked, detect_mirrors(one.drawn.echo, one.looked))
        )
        for wall in one.drawn.walls:
            line = _match(wall, lines)
            if line is not None:
                turns.append(_turn(wall, line))
        false += sum(
            all(_match(wall, [line]) is None for wall in one.drawn.walls) for line in lines
        )
    return Detection(
        walls=sum(len(one.drawn.walls) for one in echoes),
        found=len(turns),
        false=false,
        median_turn=float(np.median(turns)) if turns else np.nan,
    )


@contextmanager
def changed(module: str, name: str, value: object) -> Iterator[None]:
    """Temporarily change a constant of the estimator, in every module that imports it.

    Parameters
    ----------
    module
        Module that defines it, such as ``estimator.walls.line_relations``.
    name
        Of the constant.
    value
        Temporary value.
    """
    before = getattr(sys.modules[module], name)
    holders = [
        one
        for key, one in sys.modules.items()
        if key.startswith("estimator.") and getattr(one, name, None) is before
    ]
    for one in holders:
        setattr(one, name, value)
    try:
        yield
    finally:
        for one in holders:
            setattr(one, name, before)


def crossing_overlap(rng: np.random.Generator, *, draws: int = 400) -> Float[np.ndarray, " draws"]:
    """Measure the share of a wall that lies on another one crossing it at 30° to 90°. [-]."""
    coarse = coarse_resolution(echo_resolution(draw_echo("noise", rng).echo))
    shares = []
    for _ in range(draws):
        middle = rng.uniform(0.3, 0.6) * np.array([0.0, 1.0, 0.0])
        first = np.radians(rng.uniform(-60, 60))
        angles = np.array([first, first + np.radians(rng.uniform(30, 90))])
        halves = 0.5 * rng.uniform(0.12, 0.25, 2)
        lines = [
            _exact(
                middle - half * np.array([np.cos(angle), np.sin(angle), 0.0]),
                middle + half * np.array([np.cos(angle), np.sin(angle), 0.0]),
            )
            for angle, half in zip(angles, halves, strict=True)
        ]
        places = np.linspace(lines[0].start, lines[0].end, line_relations.SAMPLES)
        shares.append(np.mean([line_relations.lies_on(p, lines[1], coarse) for p in places]))
    return np.array(shares)


def followed_overlap(one: Surveyed) -> float:
    """Fit a wall from either half, and measure the share of one line that lies on the other.

    Returns
    -------
    The smaller share of both; NaN if a half gives no line. [-]
    """
    (wall,) = one.drawn.walls
    echo, coarse = one.drawn.echo, coarse_resolution(echo_resolution(one.drawn.echo))
    middle = 0.5 * (wall[0] + wall[1])
    nearest, farthest = echo_reach(echo)
    plain, tapered = (
        focus_within(prepare(range_profiles(echo, weights=weights)), farthest)
        for weights in (None, survey_weights(echo))
    )
    fits = [
        fit_line(
            plain,
            tapered,
            half[0],
            half[1],
            echo_resolution(echo),
            reach=(wall_detection_2d.NEAREST * nearest, farthest),
            trials=one.looked.values.size,
        )
        for half in ((wall[0], middle), (middle, wall[1]))
    ]
    lines = [line for line in fits if line is not None]
    if len(lines) < 2:
        return np.nan
    shares = [
        np.mean(
            [
                line_relations.lies_on(place, other, coarse)
                for place in np.linspace(line.start, line.end, line_relations.SAMPLES)
            ]
        )
        for line, other in ((lines[0], lines[1]), (lines[1], lines[0]))
    ]
    return float(min(shares))


def _exact(start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"]) -> FittedLine:
    return FittedLine(
        start=start,
        end=end,
        covariance=np.zeros((2, 2)),
        level=1.0,
        background=1e-3,
        confidence=1.0,
    )


def _turn(wall: Segment, line: FittedLine) -> float:
    """Return the unsigned angle between a line and a wall. [rad]."""
    along = (wall[1] - wall[0]) / np.linalg.norm(wall[1] - wall[0])
    return float(np.arcsin(min(1.0, abs(float(np.cross(along, line.direction)[2])))))


def _match(wall: Segment, lines: Sequence[FittedLine]) -> FittedLine | None:
    """Return the line that represents a wall: middle on it, at least half as long; else None."""
    length = float(np.linalg.norm(wall[1] - wall[0]))
    along, normal = (wall[1] - wall[0]) / length, unit_normal(*wall)
    for line in sorted(lines, key=lambda one: -one.length):
        place = float((line.middle - wall[0]) @ along)
        beside = abs(float((line.middle - wall[0]) @ normal))
        if _turn(wall, line) < SAME_ANGLE and 0 < place < length and beside < 0.01 * length + 2e-3:
            if line.length > 0.5 * length:
                return line
    return None
