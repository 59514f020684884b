"""From the lines that an image shows to walls at their true place, with their joint covariance.

A line that is seen over mirrors is mirrored back about each of them. Its place then depends on
theirs: an error of a mirror's angle turns the unfolded wall twice, and the errors of both are
correlated.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from estimator.array.resolution_cell import Resolution
from estimator.geometry.specular_chains import LONGEST_CHAIN, Chain, unfolded
from estimator.geometry.wall_2d import Wall, crossing, mirrored
from estimator.geometry.wall_covariance import joint_covariance
from estimator.mapping.diffuse_multipath import between
from estimator.walls.fitted_line import FittedLine

SAMPLES = 9
"""Places along a line at which it is asked what stands before them, or lies on another: a
share of them is told to a ninth, and most of them from a half. [-]"""
SAME_PLACE = 3.0
"""Distance within which an unfolded line and a wall that is seen otherwise are one: both lines are
off by a cell, and mirroring doubles a mirror's error. ``python -m
validation.experiments.thresholds answers``: with 1.5 and 6 the answers in three rooms of two walls
are the same: six of six walls found, none false, and four false targets. [cells]"""
MOST = 0.5
"""Share of a line from which most of it is meant. [-]"""
IN_A_MIRROR = 0.9
"""Most confidence in a wall that is seen over others only: through a pane it would look the same,
unless it would hide the pane. In 150 random rooms, four of five without second reflections, two
walls were seen so, both through glass; in rooms of conductors all were reflections. [-]"""
NEARER = 0.02
"""Part of a distance by which a wall must be nearer to stand before another: walls that meet are
known to a cell or two. [-]"""
MIXED_SAMPLES = 65
"""Places along a wall whose two views are mixed: closer than the cells of the mixture. [-]"""


@dataclass(frozen=True, kw_only=True)
class UnfoldedWalls:
    """Walls at their true place; those seen directly first, the strongest first."""

    lines: tuple[FittedLine, ...]  # as the image shows them
    walls: tuple[Wall, ...]
    seen_through: tuple[Chain, ...]
    covariance: Float[np.ndarray, "parameters parameters"]
    """Of all walls' (angle [rad], offset [m]), one wall after the other."""
    views: tuple[tuple[FittedLine, Wall, FittedLine], ...]
    """Every line that is seen over mirrors, with its true place and the mirror that is nearest to
    the array: also those that are left out, as another view of a wall."""


def confidence_of(fitted: float, seen_through: Chain) -> float:
    """Return the confidence in a wall as it is reported, from that in its line or plane. [-]."""
    return min(fitted, IN_A_MIRROR) if seen_through else fitted


def unfold_lines(lines: Sequence[FittedLine], resolution: Resolution) -> UnfoldedWalls:
    """Unfold each line over the mirrors that the array sees it through.

    Parameters
    ----------
    lines
        As the image shows them, the strongest first.
    resolution
        Of the image: which lines are two views of one wall.

    Returns
    -------
    The walls; a line that is another view of a wall is left out, and so is one that cannot be a
    reflection: what is seen through a pane is later than it is far, by an unknown length.
    """
    kept: list[FittedLine] = []
    walls: list[Wall] = []
    seen: list[Chain] = []
    views: list[tuple[FittedLine, Wall, FittedLine]] = []
    for line in _from_the_array_outward(lines):
        chain = _chain_before(line, walls)
        unfolding = _unfolded(line, walls, chain)
        if chain and _stands_in_the_way(line, unfolding, walls, chain, seen):
            continue  # seen through the other wall, which is a pane
        if chain:
            views.append((line, unfolding, kept[chain[0]]))
        same = any(_is_one(line, unfolding, wall, resolution) for wall in walls)
        if len(chain) == LONGEST_CHAIN or same:
            continue
        kept.append(line)
        walls.append(unfolding)
        seen.append(chain)
    order = sorted(range(len(kept)), key=lambda i: (len(seen[i]), -kept[i].level))
    place = {old: new for new, old in enumerate(order)}
    lines = tuple(kept[i] for i in order)
    chains = tuple(tuple(place[i] for i in seen[old]) for old in order)
    nominal = [walls[i] for i in order]
    seen_walls = [
        Wall(start=line.start, end=line.end, covariance=line.covariance) for line in lines
    ]
    joint = joint_covariance(seen_walls, chains, nominal, reflected=_reflected, change=_change)
    return UnfoldedWalls(
        lines=lines,
        walls=tuple(
            replace(wall, covariance=joint[2 * i : 2 * i + 2, 2 * i : 2 * i + 2])
            for i, wall in enumerate(nominal)
        ),
        seen_through=chains,
        covariance=joint,
        views=tuple(views),
    )


def unfold_seen_lines(lines: Sequence[FittedLine], resolution: Resolution) -> UnfoldedWalls:
    """Unfold lines as :func:`unfold_lines` does, without those that are two views of a wall mixed.

    What goes out over a mirror and comes back directly shows a wall that is seen both ways a third
    time, halfway between the two views, as sharply as they are.
    """
    unfolding = unfold_lines(lines, resolution)
    seen = [line for line in lines if not _is_mixed(line, unfolding, resolution)]
    return unfolding if len(seen) == len(lines) else unfold_lines(seen, resolution)


def _is_mixed(line: FittedLine, unfolding: UnfoldedWalls, resolution: Resolution) -> bool:
    """Tell whether most of a line is halfway between another's place and its wall's."""
    points = np.linspace(line.start, line.end, SAMPLES)
    for other, wall, door in unfolding.views:
        # A mirror is halfway between what is seen over it and its wall, whatever that is.
        if line is other or line is door:
            continue
        places = [np.linspace(one.start, one.end, MIXED_SAMPLES) for one in (other, wall)]
        mixed = [
            between(points, seen, true, resolution) for seen, true in zip(*places, strict=True)
        ]
        if np.mean(np.any(mixed, axis=0)) > MOST:
            return True
    return False


def _from_the_array_outward(lines: Sequence[FittedLine]) -> list[FittedLine]:
    """Order lines so that each comes after those between it and the array."""
    ordered: list[FittedLine] = []
    pending = list(lines)
    while pending:
        hidden = [sum(_stands_before(b, a) for b in pending if b is not a) for a in pending]
        # Lines that cross may hide each other: the one that is hidden least comes first.
        first = min(
            range(len(pending)),
            key=lambda i: (hidden[i], float(np.linalg.norm(pending[i].middle))),
        )
        ordered.append(pending.pop(first))
    return ordered


def _stands_before(line: FittedLine, other: FittedLine) -> bool:
    far = float(np.linalg.norm(other.middle))
    hit = crossing(np.zeros(3), other.middle / far, line.start, line.end)
    return hit is not None and hit[0] < far


def _chain_before(line: FittedLine, walls: Sequence[Wall]) -> Chain:
    """Return the mirrors over which most of a line is seen."""
    met = unfolded(_places(line), walls)[1]
    chains = Counter(tuple(int(i) for i in row if i >= 0) for row in met)
    return chains.most_common(1)[0][0]


def _unfolded(line: FittedLine, walls: Sequence[Wall], chain: Chain) -> Wall:
    ends = np.stack([line.start, line.end])
    for index in chain:
        ends = mirrored(ends, walls[index].start, walls[index].end)
    return Wall(start=ends[0], end=ends[1], covariance=line.covariance)


def _stands_in_the_way(
    line: FittedLine,
    unfolding: Wall,
    walls: Sequence[Wall],
    chain: Chain,
    seen: Sequence[Chain],
) -> bool:
    """Tell whether an unfolded wall would hide its own mirror, or most of what is seen directly."""
    ways: list[tuple[FittedLine | Wall, Wall]] = [(line, walls[chain[0]])]
    ways += [(wall, wall) for wall, through in zip(walls, seen, strict=True) if not through]
    return any(
        np.mean([_is_crossed(point, before, unfolding) for point in _places(along)]) > MOST
        for along, before in ways
    )


def _places(along: FittedLine | Wall) -> Float[np.ndarray, "places 3"]:
    shares = (np.arange(SAMPLES) + 0.5) / SAMPLES
    return np.asarray(along.start + shares[:, None] * (along.end - along.start))


def _is_crossed(point: Float[np.ndarray, " 3"], before: Wall, wall: Wall) -> bool:
    """Tell whether a wall crosses the ray to a point before the ray meets another wall."""
    far = float(np.linalg.norm(point))
    limit = crossing(np.zeros(3), point / far, before.start, before.end)
    hit = crossing(np.zeros(3), point / far, wall.start, wall.end)
    return hit is not None and hit[0] < (far if limit is None else limit[0]) * (1 - NEARER)


def _is_one(line: FittedLine, unfolding: Wall, other: Wall, resolution: Resolution) -> bool:
    """Tell whether most of a line, once unfolded, lies on another wall, within a few cells."""
    along = (other.end - other.start) / np.linalg.norm(other.end - other.start)
    points = np.linspace(unfolding.start, unfolding.end, SAMPLES)
    # The cell is that of the image, where the line is farther away.
    images = np.linspace(line.start, line.end, SAMPLES)
    cells = resolution.cell(images, line.normal)
    beside = np.abs((points - other.start) @ other.normal) < SAME_PLACE * cells
    place = (points - other.start) @ along
    inside = (place > 0) & (place < np.linalg.norm(other.end - other.start))
    return bool(np.mean(beside & inside) > MOST)


def _reflected(wall: Wall, mirror: Wall) -> Wall:
    ends = mirrored(np.stack([wall.start, wall.end]), mirror.start, mirror.end)
    return Wall(start=ends[0], end=ends[1], covariance=wall.covariance)


def _change(new: Wall, old: Wall) -> Float[np.ndarray, " 2"]:
    """Return by what a wall was turned, and moved along its normal at its midpoint."""
    along = (old.end - old.start) / np.linalg.norm(old.end - old.start)
    turned = (new.end - new.start) / np.linalg.norm(new.end - new.start)
    tilt = along[0] * turned[1] - along[1] * turned[0]
    return np.array([tilt, float((new.start - 0.5 * (old.start + old.end)) @ new.normal)])
