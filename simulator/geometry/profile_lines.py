r"""Straight or slightly curved runs of line facets: their mean course, heights and ends.

A plate is one run, a box has four, a cylinder is one closed run. Heights are measured from the mean
course. A facet represents a cubic through its own and the neighbouring vertices: its centre is at
the cubic's mean, :math:`(-h_{-1} + 13 h_0 + 13 h_1 - h_2)/24`, and its slope is that of the best
fitting line, the chord's less a sixtieth of the chords' second difference. Chords alone would, for
facets of a quarter of a wavelength, lose a third of the Bragg wave at 45°.

The ends of runs are edges: of a plate, a half plane; where two runs of a closed body meet at a
convex angle, a wedge.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from scenes.realisations.object_surface import Surface

CORNER = np.radians(20.0)
"""Least angle between neighbouring facets of the mean course that is an edge: between the coarsest
facets of a cylinder it is 6°. [rad]"""

LEAST_HEIGHT = 1e-12
"""Bound of the rounding error in the heights of a smooth surface some metres away. [m]"""

EVEN = 0.01
"""Largest relative variation of the steps along a run that counts as evenly sampled. [-]"""


@dataclass(frozen=True, kw_only=True)
class Run:
    """Consecutive facets without a corner between them."""

    facets: Int[np.ndarray, " run"]  # in order, indices in the whole set
    heights: Float[np.ndarray, " run"]  # of the centres over the mean course [m]
    step: float  # along the mean course [m]
    closed: bool
    count: int = 0  # of the whole set

    @cached_property
    def places(self) -> Int[np.ndarray, " facets"]:
        """Index on this run of each facet of the whole set; -1: not on it."""
        places = np.full(self.count, -1, dtype=np.int64)
        places[self.facets] = np.arange(self.facets.size)
        return places

    @property
    def rough(self) -> bool:
        """Whether any height differs from the mean course."""
        return bool(np.any(np.abs(self.heights) > LEAST_HEIGHT))


@dataclass(frozen=True, kw_only=True)
class Edge:
    """The end of one run, or the corner of two: exterior angle and facets that meet there."""

    place: Float[np.ndarray, " 2"]  # [m]
    exterior: float  # exterior angle (in air) over π: 2 for a plate's end [-]
    facets: tuple[int, ...]  # the last facet of each run that meets here
    inward: Float[np.ndarray, "runs 2"]  # unit vectors from the edge along each run
    length: float = 0.0  # of the plate between two such edges [m]
    partner: int = -1  # index of the edge at the plate's other end; -1: none


@dataclass(frozen=True, kw_only=True)
class Outline:
    """Result of :func:`outline`: facets, runs and edges of a surface of lines."""

    centres: Float[np.ndarray, "facets 3"]  # [m]
    mean_centres: Float[np.ndarray, "facets 3"]  # [m]
    normals: Float[np.ndarray, "facets 3"]  # of the mean course where it is rough
    sizes: Float[np.ndarray, " facets"]  # along the mean course where it is rough [m]
    edges: Float[np.ndarray, "facets 1 3"]  # [m]
    runs: tuple[Run, ...]
    corners: tuple[Edge, ...]


def outline(surface: Surface, first: int = 0) -> Outline:
    """Return the facets, runs and edges of a surface of lines.

    Parameters
    ----------
    surface
        Its cells are lines.
    first
        Index of its first facet in the whole set.
    """
    cells = surface.cells
    ends, mean = surface.vertices[cells], surface.mean_vertices[cells]
    along = mean[:, 1] - mean[:, 0]
    steps = np.linalg.norm(along, axis=-1)
    tangents = along / steps[:, None]
    upright = _to_the_right(tangents)
    heights = np.einsum("fcx,fx->fc", ends - mean, upright)
    centres, edges = ends.mean(axis=1), ends[:, 1] - ends[:, 0]
    sizes = np.linalg.norm(edges, axis=-1)
    normals = _to_the_right(edges / sizes[:, None])
    parts, joints = _split(cells, tangents)
    runs = []
    for members, closed in parts:
        here, height = heights[members], np.zeros(len(members))
        step = float(steps[members].mean())
        if (
            np.any(np.abs(here) > LEAST_HEIGHT)
            and len(members) > 3
            and np.ptp(steps[members]) < EVEN * step
        ):
            height, slope = _fitted(here, closed)
            lifted = (height - here.mean(axis=1))[:, None]
            turned = (slope - (here[:, 1] - here[:, 0]))[:, None]
            centres[members] += lifted * upright[members]
            edges[members] += turned * upright[members]
            sizes[members], normals[members] = steps[members], upright[members]
        runs.append(Run(facets=members + first, heights=height, step=step, closed=closed))
    return Outline(
        centres=centres,
        mean_centres=mean.mean(axis=1),
        normals=normals,
        sizes=sizes,
        edges=edges[:, None],
        runs=tuple(runs),
        corners=_corners(surface, tangents, parts, joints, first),
    )


def _to_the_right(ways: Float[np.ndarray, "facets 3"]) -> Float[np.ndarray, "facets 3"]:
    return np.stack([ways[:, 1], -ways[:, 0], np.zeros(len(ways))], axis=-1)


def _split(
    cells: Int[np.ndarray, "cells 2"], tangents: Float[np.ndarray, "cells 3"]
) -> tuple[list[tuple[np.ndarray, bool]], list[tuple[int, int]]]:
    """Split cells into runs; return these, and the pairs of cells that meet at a corner."""
    count = len(cells)
    following = np.roll(np.arange(count), -1)
    joined = cells[:, 1] == cells[following, 0]
    if count == 1:
        joined[:] = False
    along = np.einsum("cx,cx->c", tangents, tangents[following])
    across = tangents[:, 0] * tangents[following, 1] - tangents[:, 1] * tangents[following, 0]
    smooth = joined & (np.abs(np.arctan2(across, along)) < CORNER)
    breaks = np.flatnonzero(~smooth)
    if breaks.size == 0:
        return [(np.arange(count), True)], []
    order = np.roll(np.arange(count), -(int(breaks[-1]) + 1))
    lasts = np.flatnonzero(~smooth[order])
    parts = [(part, False) for part in np.split(order, lasts[:-1] + 1)]
    corners = [(int(one), int(following[one])) for one in breaks if joined[one]]
    # A closed chain may begin in the middle of a run: join its last part to the first.
    for one in breaks[~joined[breaks]].tolist():
        meets = np.flatnonzero(cells[:, 0] == cells[one, 1])
        corners += [(one, int(other)) for other in meets if other != one]
    return parts, corners


def _fitted(
    ends: Float[np.ndarray, "run 2"], closed: bool
) -> tuple[Float[np.ndarray, " run"], Float[np.ndarray, " run"]]:
    """Return mean heights of the cubics, and rises of their best fitting lines. [m]."""
    rise = ends[:, 1] - ends[:, 0]
    if closed:
        before, after = np.roll(ends[:, 0], 1), np.roll(ends[:, 1], -1)
        bend = np.roll(rise, 1) - 2 * rise + np.roll(rise, -1)
    else:  # beyond its ends the profile continues point-symmetrically about them
        before = np.concatenate([[2 * ends[0, 0] - ends[0, 1]], ends[:-1, 0]])
        after = np.concatenate([ends[1:, 1], [2 * ends[-1, 1] - ends[-1, 0]]])
        padded = np.concatenate([rise[:1], rise, rise[-1:]])
        bend = padded[:-2] - 2 * rise + padded[2:]
    mean = (13 * (ends[:, 0] + ends[:, 1]) - before - after) / 24
    return mean, rise - bend / 60


def _corners(
    surface: Surface,
    tangents: Float[np.ndarray, "cells 3"],
    parts: list[tuple[np.ndarray, bool]],
    joints: list[tuple[int, int]],
    first: int,
) -> tuple[Edge, ...]:
    edges: list[Edge] = []
    vertices, cells = surface.vertices, surface.cells
    for before, after in joints:
        one, other = tangents[before], tangents[after]
        turn = float(np.arctan2(one[0] * other[1] - one[1] * other[0], one @ other))
        if surface.closed and turn > CORNER:  # counter-clockwise, so this is convex
            edges.append(
                Edge(
                    place=vertices[cells[after, 0], :2],
                    exterior=1 + turn / np.pi,
                    facets=(before + first, after + first),
                    inward=np.stack([-one[:2], other[:2]]),
                )
            )
    if surface.closed:
        return tuple(edges)
    met_before, met_after = {one for one, _ in joints}, {other for _, other in joints}
    for members, closed in parts:
        begin, end = int(members[0]), int(members[-1])
        if closed or begin in met_after or end in met_before:
            continue
        places = vertices[[cells[begin, 0], cells[end, 1]], :2]
        length = float(np.linalg.norm(places[1] - places[0]))
        for side, cell in enumerate((begin, end)):
            inward = tangents[cell, :2] * (1 - 2 * side)
            edges.append(
                Edge(
                    place=places[side],
                    exterior=2.0,
                    facets=(cell + first,),
                    inward=inward[None],
                    length=length,
                    partner=len(edges) + 1 - 2 * side,
                )
            )
    return tuple(edges)
