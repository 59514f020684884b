"""What is lost by limits that bound the time of a search: each against one that does not bind.

A limit that decides nothing needs no finer choice. Where it binds, the difference is its error.
"""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from unittest.mock import patch

import numpy as np
from jaxtyping import Float

from estimator.array.linear_array import echo_resolution
from estimator.array.resolution_cell import coarse_resolution
from estimator.imaging.focusing import PreparedEcho
from estimator.mapping import diffuse_multipath
from estimator.mapping.diffuse_multipath import in_cloud
from estimator.measurement.model import Echo
from estimator.positioning import diffuse_positioning
from estimator.positioning.diffuse_positioning import search_diffuse
from estimator.positioning.wall_anchors import SeenWall
from estimator.walls import line_extent, ridge_detection, sources_aside
from estimator.walls.fitted_line import FittedLine
from estimator.walls.line_sampling import SAMPLES_PER_CELL
from estimator.walls.ridge_detection import find_ridges
from estimator.walls.sources_aside import without_sources_aside
from estimator.walls.wall_detection_2d import LEAST_COHERENCE, detect_mirrors
from validation.harness.claim import Row
from validation.trials.drawn_echoes import draw_echo, draw_wall
from validation.trials.room_answers import RoughPilot
from validation.trials.wall_statistics import Surveyed, changed

AMPLE = 4
"""Times a limit that does not bind. [-]"""
CLOUD_POINTS = 400
"""Points about a ghost of which is asked whether they are in its cloud. [-]"""
BEHIND = (0.05, 0.3)
"""Distance of targets behind a wall. [m]"""
ABOUT_GHOST = 0.15
"""Distance along the ray, and sine, within which the points are. [m], [-]"""


def _ample(module: object, name: str) -> AbstractContextManager[None]:
    """Raise a limit of a module so far that it does not bind."""
    assert isinstance(module, type(np))
    return changed(module.__name__, name, AMPLE * getattr(module, name))


def limit_rows(echoes: Sequence[Surveyed], aside: Echo, pilots: Sequence[RoughPilot]) -> list[Row]:
    """Compare all limits with ample ones.

    Parameters
    ----------
    echoes
        Of walls, posts and noise.
    aside
        With bright sources beyond the imaged sector.
    pilots
        Over rough walls.
    """
    return [
        *facets_of_a_cloud(np.random.default_rng(0)),
        *ridges_of_echoes(echoes),
        *shoulders_of_walls(echoes),
        *sources_of_echoes([aside]),
        *rounds_of_trilateration(pilots),
    ]


def facets_of_a_cloud(rng: np.random.Generator, *, draws: int = 20) -> list[Row]:
    """Compare clouds of few facets of a wall with those of :data:`AMPLE` times as many.

    Walls are those of :mod:`validation.trials.drawn_echoes`; each shows a target behind it, as if
    in a mirror.
    """
    resolution = coarse_resolution(echo_resolution(draw_echo("noise", rng).echo))
    kept = inside = 0
    for _ in range(draws):
        start, end = draw_wall(rng)
        door = FittedLine(
            start=start, end=end, covariance=np.zeros((2, 2)), level=1.0, background=0.0,
            confidence=1.0,
        )  # fmt: skip
        ghost = start + rng.uniform(0.2, 0.8) * (end - start)
        ghost = ghost * (1 + rng.uniform(*BEHIND) / np.linalg.norm(ghost))
        far = float(np.linalg.norm(ghost))
        reach = far + rng.uniform(-1, 1, CLOUD_POINTS) * ABOUT_GHOST
        sines = ghost[0] / far + rng.uniform(-1, 1, CLOUD_POINTS) * ABOUT_GHOST
        points = np.stack([reach * sines, reach * np.sqrt(1 - sines**2), 0 * reach], axis=-1)
        few = in_cloud(points, ghost, [door], resolution)
        with _ample(diffuse_multipath, "FACETS"):
            many = in_cloud(points, ghost, [door], resolution)
        kept, inside = kept + int((few & many).sum()), inside + int(many.sum())
    return [
        Row(
            name="diffuse_multipath.FACETS: points of clouds that are left out",
            stated="one or two in a hundred",
            measured=1 - kept / inside,
            high=0.03,
            origin="the constant",
        ),
        Row(
            name="diffuse_multipath.FACETS: share of the points drawn that are in a cloud",
            stated="some, not all: else nothing is compared",
            measured=inside / (draws * CLOUD_POINTS),
            low=0.05,
            high=0.95,
            origin="the draws",
        ),
    ]


def ridges_of_echoes(echoes: Sequence[Surveyed]) -> list[Row]:
    """Count the ridges that a search without a limit finds."""
    counts = []
    for one in echoes:
        looked = one.looked
        usable = np.maximum(looked.as_point, looked.as_mirror) >= LEAST_COHERENCE
        resolution = coarse_resolution(echo_resolution(one.drawn.echo))
        with _ample(ridge_detection, "MOST_RIDGES"):
            counts.append(len(find_ridges(looked, usable, resolution)))
    return [
        Row(
            name="ridge_detection.MOST_RIDGES: most ridges of an echo",
            stated="fewer than the limit, which does not bind",
            measured=float(max(counts)),
            low=1.0,
            high=ridge_detection.MOST_RIDGES - 1.0,
            origin="the constant",
        ),
    ]


def sources_of_echoes(echoes: Sequence[Echo]) -> list[Row]:
    """Measure the energy that more sources aside would take off, and how many are taken off."""
    left: list[float] = []
    counts: list[int] = []
    for echo in echoes:
        with patch.object(sources_aside, "_source_echo", wraps=sources_aside._source_echo) as taken:
            own = without_sources_aside(PreparedEcho(echo)).prepared.echo.samples
        counts.append(taken.call_count)
        with _ample(sources_aside, "MOST_SOURCES"):
            ample = without_sources_aside(PreparedEcho(echo)).prepared.echo.samples
        left.append(float(np.linalg.norm(own - ample) ** 2 / np.linalg.norm(echo.samples) ** 2))
    return [
        Row(
            name="sources_aside.MOST_SOURCES: energy left that more would take off, the most",
            stated="some hundredths of the echo's where it binds",
            measured=max(left),
            high=0.05,
            origin="the constant",
        ),
        Row(
            name="sources_aside.MOST_SOURCES: most that are taken off one echo",
            stated="as many as the limit: else nothing is compared",
            measured=float(max(counts)),
            low=float(sources_aside.MOST_SOURCES),
            origin="the rooms",
        ),
    ]


def rounds_of_trilateration(pilots: Sequence[RoughPilot]) -> list[Row]:
    """Measure how far more rounds of trilateration move a place, over its deviation."""
    moved = []
    for one in pilots:
        walls = [SeenWall(seen=one.wall, true=one.wall, through=())]
        own = search_diffuse(one.uplink, walls)
        with _ample(diffuse_positioning, "ROUNDS"):
            ample = search_diffuse(one.uplink, walls)
        if own is None or ample is None:
            continue
        away = float(np.linalg.norm(own.position - ample.position))
        moved.append(away / float(np.sqrt(np.linalg.eigvalsh(own.covariance)[-1])))
    return [
        Row(
            name="diffuse_positioning.ROUNDS: shift by more of them over the deviation, the worst",
            stated="a tenth at most",
            measured=max(moved, default=np.nan),
            high=0.1,
            origin="the constant",
        )
    ]


def shoulders_of_walls(echoes: Sequence[Surveyed]) -> list[Row]:
    """Measure how far from where they are looked for walls end, over what is searched."""
    away: list[float] = []
    end_of = line_extent.end_of

    def told(level_db: Float[np.ndarray, " places"], rough: int) -> int:
        place = end_of(level_db, rough)
        away.append(abs(place - rough) / (line_extent.CELLS_AT_END * SAMPLES_PER_CELL))
        return place

    with patch.object(line_extent, "end_of", told):
        for one in echoes:
            detect_mirrors(one.drawn.echo, one.looked)
    return [
        Row(
            name="line_extent.CELLS_AT_END: ends that are in the outer half of what is searched",
            stated="one in ten at most",
            measured=float(np.mean(np.array(away) > 0.5)),
            high=0.1,
            origin="the constant",
        ),
    ]
