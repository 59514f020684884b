"""Lines and reflections in random rooms: what true walls have, against the thresholds that ask it.

The closed-form walls of :mod:`validation.trials.wall_statistics` stand alone. In random rooms
posts, panes and other walls are as far away as a wall, and put their sidelobes on it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from estimator.array.linear_array import echo_resolution
from estimator.imaging.survey_2d import Survey, survey
from estimator.walls import wall_detection_2d
from estimator.walls.fitted_line import FittedLine
from estimator.walls.line_evidence import depth_of
from estimator.walls.wall_detection_2d import detect_mirrors
from validation.harness.claim import Row
from validation.metrics.truth import Truth
from validation.trials.room_answers import SimulatedRoom

ON_WALL = 4e-3
"""Distance from a true wall within which a peak is attributed to it: two cells. [m]"""
ON_LINE = 6e-3
"""Distance of both ends of a line from a true wall that it represents: three cells. [m]"""
ABOUT_FOOT = 0.04
"""Distance along a wall from the array's foot on it within which it reflects some of the array:
half an array of 64 mm, and two cells. [m]"""
BEYOND_END = 0.03
"""How far the foot may be beyond a wall's end, so that a part of the array is reflected. [m]"""


@dataclass(frozen=True, kw_only=True)
class RoomLines:
    """What one room shows of its walls."""

    facing: tuple[int, int]  # peaks where a wall faces the array: reflections, all [-]
    aside: tuple[int, int]  # the same of peaks elsewhere on walls [-]
    explained: Float[np.ndarray, " lines"]  # share of the echo of lines on true walls [-]
    depth: Float[np.ndarray, " lines"]  # extent in range [cells]
    false: int  # certain lines that are on no true wall [-]


def room_lines(room: SimulatedRoom) -> RoomLines:
    """Detect the lines of a room in the plane, and compare them with its walls."""
    echo = room.measurement.echo
    assert echo is not None
    looked, resolution = survey(echo), echo_resolution(echo)
    # Faint lines are explained by no row.
    certain = [line for line in detect_mirrors(echo, looked) if line.explained > 0]
    true = [line for line in certain if _is_true(line, room.truth)]
    facing, on_wall = _on_walls(looked, room.truth)
    return RoomLines(
        facing=(int(looked.reflected[facing].sum()), int(facing.sum())),
        aside=(int(looked.reflected[on_wall & ~facing].sum()), int((on_wall & ~facing).sum())),
        explained=np.array([line.explained for line in true]),
        depth=np.array([depth_of(line, resolution) for line in true]),
        false=len(certain) - len(true),
    )


def _on_walls(
    looked: Survey, truth: Truth
) -> tuple[Bool[np.ndarray, " peaks"], Bool[np.ndarray, " peaks"]]:
    """Return which peaks are where a wall faces the array, and which are on walls."""
    facing = np.zeros(len(looked.peaks), dtype=bool)
    on_wall = facing.copy()
    for name, start in truth.wall_start.items():
        away, along = _beside(looked.peaks, start, truth.wall_end[name])
        length = float(np.linalg.norm(truth.wall_end[name] - start))
        foot = float(_beside(np.zeros((1, 3)), start, truth.wall_end[name])[1][0])
        on = (np.abs(away) < ON_WALL) & (along > 0) & (along < length)
        on_wall |= on
        if -BEYOND_END < foot < length + BEYOND_END:
            facing |= on & (np.abs(along - foot) < ABOUT_FOOT)
    return facing, on_wall


def _is_true(line: FittedLine, truth: Truth) -> bool:
    ends = np.stack([line.start, line.end])
    return any(
        bool(np.abs(_beside(ends, start, truth.wall_end[name])[0]).max() < ON_LINE)
        for name, start in truth.wall_start.items()
    )


def _beside(
    points: Float[np.ndarray, "points 3"],
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
) -> tuple[Float[np.ndarray, " points"], Float[np.ndarray, " points"]]:
    """Return the distance of points from a wall's line, and their place along it. [m]."""
    along = (end - start) / np.linalg.norm(end - start)
    normal = np.array([-along[1], along[0], 0.0])
    return (points - start) @ normal, (points - start) @ along


def room_line_rows(rooms: Sequence[SimulatedRoom]) -> list[Row]:
    """Compare what the walls of rooms have with the thresholds of wall detection."""
    seen = [room_lines(room) for room in rooms]
    explained = np.concatenate([one.explained for one in seen])
    deep = np.concatenate([one.depth for one in seen]) >= wall_detection_2d.DEEP
    (facing, of_facing), (aside, of_aside) = (
        np.sum([getattr(one, key) for one in seen], axis=0) for key in ("facing", "aside")
    )
    return [
        Row(name="survey_2d.FLATTER: reflections among peaks elsewhere on walls",
            stated="one of 1139", measured=aside / max(of_aside, 1), high=0.05,
            origin="six rooms hold some 60 such peaks: three of them"),
        Row(name="survey_2d.FLATTER: reflections among peaks where a wall faces the array",
            stated="34 of 155", measured=facing / max(of_facing, 1), low=0.05,
            origin="the constant's docstring; 12 rooms hold some 20 such peaks"),
        Row(name="wall_detection_2d.EXPLAINED: of a wall over many ranges, the least",
            stated="0.53", measured=float(explained[deep].min(initial=1.0)),
            low=wall_detection_2d.EXPLAINED, origin="the constant"),
        Row(name="wall_detection_2d.WELL_EXPLAINED: of a wall over few ranges, the least",
            stated="0.85", measured=float(explained[~deep].min(initial=1.0)),
            low=wall_detection_2d.WELL_EXPLAINED, origin="the constant"),
        Row(name="certain lines on no wall, of all", stated="8 of 226",
            measured=sum(one.false for one in seen) / max(explained.size, 1), high=0.1,
            origin="thrice as many as in 200 rooms: a few rooms hold few lines"),
    ]  # fmt: skip
