"""Constants of the estimator that are scanned, with half and twice their value where that can be.

Each is changed alone, in every module that imports it
(:func:`validation.trials.wall_statistics.changed`); the answers are counted by
:mod:`validation.trials.room_answers`, the tables printed by
:mod:`validation.experiments.thresholds`.
"""

from dataclasses import dataclass

from validation.trials.room_answers import BODIES, PATHS, WALLS_IN_WALLS


@dataclass(frozen=True, kw_only=True)
class Scan:
    """A constant, the neighbouring values, and for whole answers the rooms."""

    module: str
    name: str
    values: tuple[float, float] | tuple[tuple[float, ...], tuple[float, ...]]
    rooms: tuple[str, ...] = ()  # keys of :data:`validation.trials.trap_rooms.TRAPS`


ANSWER_SCANS = (
    Scan(module="estimator.channel.path", name="LEAST_SHARE", values=(0.025, 0.1), rooms=PATHS),
    Scan(module="estimator.channel.path", name="CURVATURE_SLACK", values=(0.05, 0.2), rooms=PATHS),
    Scan(module="estimator.mapping.wall_unfolding", name="SAME_PLACE", values=(1.5, 6.0),
         rooms=WALLS_IN_WALLS),
    Scan(module="estimator.mapping.target_detection", name="WIDE", values=(1.0, 4.0),
         rooms=BODIES),
    Scan(module="estimator.mapping.target_detection", name="WINDOW", values=(20.0, 80.0),
         rooms=BODIES),
    Scan(module="estimator.mapping.diffuse_multipath", name="FACETS", values=(24.0, 96.0),
         rooms=BODIES),
    Scan(module="estimator.walls.ridge_detection", name="SAMPLES", values=(16.0, 64.0),
         rooms=BODIES),
    Scan(module="estimator.walls.ridge_detection", name="MOST_RIDGES", values=(4.0, 16.0),
         rooms=BODIES),
    Scan(module="estimator.walls.line_extent", name="CELLS_AT_END", values=(6.0, 24.0),
         rooms=WALLS_IN_WALLS),
    Scan(module="estimator.walls.sources_aside", name="MOST_SOURCES", values=(4.0, 16.0),
         rooms=BODIES),
)  # fmt: skip
"""Constants that decide on paths, walls and targets, with half and twice their value."""
RIVAL_SCAN = Scan(
    module="estimator.positioning.diffuse_positioning", name="RIVAL", values=(0.8, 0.95)
)
"""The same for positions by diffuse scattering, with twice and half its distance from 1."""

DECISIONS = (
    "plain",
    "in sight and over it",
    "corner, over two walls",
    "parallel, over both",
    "two walls, both sides",
    "unknown clock, two paths",
    "behind, past an end",
    "edge-on, hides the user",
    "wall turned away",
    "wall turned far away",
)
"""Rooms in which users are placed over one wall, two walls, in line of sight, through a wall, by
scattering, and on an unknown clock."""


def _decision(module: str, name: str, low: float, high: float) -> Scan:
    return Scan(module=f"estimator.positioning.{module}", name=name, values=(low, high))


DECISION_SCANS = (
    _decision("blockage", "USER_SIZE", 0.025, 0.1),
    _decision("los_check", "LONGEST_UNSEEN", 0.25, 1.0),
    _decision("los_check", "CLOUD", 3.0, 12.0),
    _decision("unseen_mirrors", "EDGE_ON_TILT", 0.075, 0.3),
    _decision("unknown_clock", "RIVAL", 0.125, 0.5),
    _decision("weighted_least_squares", "ITERATIONS", 10.0, 40.0),
    _decision("through_walls", "LEVEL_UNKNOWN", 5e-5, 2e-4),
    _decision("posterior", "FEEBLE", 0.125, 0.5),
    _decision("posterior", "USUAL", 0.25, 0.9),
    _decision("diffuse_positioning", "PARALLEL", 0.94, 0.996),
    _decision("diffuse_positioning", "ROUNDS", 2.0, 8.0),
    _decision("diffuse_fallback", "MOST_ENERGY", 0.25, 0.9),
    _decision("diffuse_fallback", "TOGETHER", 0.999, 0.99975),
    _decision("level_likelihood", "LEAST_DB", -80.0, -20.0),
    _decision("level_likelihood", "MOST_DB", 12.5, 50.0),
    _decision("level_likelihood", "BLOCKED", 0.1, 0.4),
    _decision("level_likelihood", "AIMED_THROUGH", 5e-4, 2e-3),
)
"""Constants that decide on users. Cosines and probabilities near 1 have half and twice their
distance from 1."""

IMAGE_SCANS = (
    Scan(module="estimator.mapping.image_targets", name="WINDOW", values=(30.0, 120.0)),
    Scan(module="estimator.mapping.image_targets", name="BROADER", values=(1.5, 6.0)),
    Scan(module="estimator.mapping.image_targets", name="SHADOW_CELLS", values=(1.0, 4.0)),
    Scan(module="estimator.mapping.image_targets", name="REPEATED_WITHIN", values=(1.0, 4.0)),
    Scan(module="estimator.mapping.image_targets", name="MOST_TARGETS", values=(12.0, 48.0)),
    Scan(module="estimator.imaging.energy_region", name="TOLD", values=(0.25, 0.75)),
    Scan(module="estimator.walls.shared_constant", name="FEWEST", values=(4.0, 16.0)),
)
"""Constants of targets in images of scans, with half and twice their value."""

SPACE_SCANS = (
    Scan(module="estimator.walls.plane_fit", name="CELLS_CUT", values=(0.75, 3.0)),
    Scan(module="estimator.walls.plane_fit", name="FARTHEST", values=(1.25, 5.0)),
    Scan(module="estimator.walls.plane_fit", name="MOST_STEPS", values=(75.0, 300.0)),
    Scan(module="estimator.walls.plane_fit", name="MOST_CORNERS", values=(4.0, 16.0)),
    Scan(module="estimator.walls.wall_detection_3d", name="FLASHES", values=(3.0, 12.0)),
    Scan(module="estimator.walls.wall_detection_3d", name="MOST_VOXELS", values=(100.0, 400.0)),
    Scan(module="estimator.walls.wall_detection_3d", name="SKIRT", values=(1.25, 5.0)),
    Scan(module="estimator.walls.wall_detection_3d", name="GATE_CELLS", values=(2.0, 8.0)),
    Scan(module="estimator.mapping.map_3d", name="TARGET_LEVEL", values=(5e-4, 2e-3)),
    Scan(module="estimator.mapping.map_3d", name="MOST_TARGETS", values=(12.0, 48.0)),
)
"""Constants of walls and targets in space, with half and twice their value."""

LIST_SCANS = (
    Scan(module="estimator.path_consensus.consensus", name="UNSEEN_TOO", values=(0.25, 0.75)),
    Scan(module="estimator.path_consensus.consensus", name="BY_CHANCE", values=(0.025, 0.1)),
    Scan(module="estimator.path_consensus.explanations", name="BY_ORDER",
         values=((0.25, 0.25, 0.25, 0.25), (0.4, 0.3, 0.2, 0.1))),
)  # fmt: skip
"""Priors of path lists; of :data:`estimator.path_consensus.explanations.BY_ORDER` another order and
none at all."""
