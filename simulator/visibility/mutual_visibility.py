"""Mutual visibility of the facets of two faces, independent of antennas and frequency."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Int

from scenes.schema.errors import ScenarioError
from simulator.geometry.faces import Face
from simulator.geometry.ray_scene import RAYS_AT_ONCE, RayScene, blocked
from simulator.geometry.slabs import Slabs, no_slabs, sets_among
from simulator.materials.slab_insertion import LEAST_LEVEL, Crossing, passage_level

MOST_PAIRS = 2**30
"""Most pairs of facets of two surfaces: 1 GiB. [-]"""


class Sight(NamedTuple):
    """Facets of two faces that see each other through the same set of slabs."""

    crossings: tuple[Crossing, ...]  # the slabs between them
    seen: Bool[np.ndarray, "one other"]


@dataclass(frozen=True)
class MutualVisibility:
    """Mutual visibility of facets of two faces; each pair of faces is traced once and cached."""

    rays: RayScene
    faces: Sequence[Face]  # whole
    slabs: Slabs = field(default_factory=no_slabs)
    band: tuple[float, float] = (0.0, 0.0)  # band over which slabs' transmission is judged [Hz]
    _traced: dict[tuple[int, int], np.ndarray] = field(default_factory=dict)
    _sets: list[int] = field(default_factory=lambda: [0])  # of slabs, in order of occurrence

    def __call__(self, one: Face, other: Face) -> Bool[np.ndarray, "one other"]:
        """Return it for some facets of two faces; a facet is represented by its centre."""
        return np.asarray(self._look_up(one, other) == 0)

    def sights(self, one: Face, other: Face) -> tuple[Sight, ...]:
        """Return which facets see each other directly, and which through which slabs.

        Slabs that transmit less than :data:`simulator.materials.slab_insertion.LEAST_LEVEL` are
        left out; so are sets of slabs between no two facets.
        """
        through = self._look_up(one, other)
        found = []
        for number, slabs in enumerate(self._sets):
            crossings = self.slabs.crossings(slabs)
            seen = np.asarray(through == number)
            if seen.any() and self._level(crossings) >= LEAST_LEVEL:
                found.append(Sight(crossings, seen))
        return tuple(found)

    def _level(self, crossings: tuple[Crossing, ...]) -> float:
        return passage_level(crossings, np.linspace(*self.band, 33)) if crossings else 1.0

    def _look_up(self, one: Face, other: Face) -> Int[np.ndarray, "one other"]:
        """Return the number of the set of slabs between two facets; -1: they are hidden."""
        (first, rows), (second, columns) = self._whole(one), self._whole(other)
        if (second, first) in self._traced:
            return np.asarray(self._traced[second, first].T[np.ix_(rows, columns)])
        if (first, second) not in self._traced:
            self._traced[first, second] = self._trace(self.faces[first], self.faces[second])
        return np.asarray(self._traced[first, second][np.ix_(rows, columns)])

    def _trace(self, one: Face, other: Face) -> Int[np.ndarray, "one other"]:
        seen = facets_see_each_other(self.rays, one, other)
        numbers = np.where(seen, np.int8(0), np.int8(-1))
        if not len(self.slabs):
            return numbers
        rows = max(1, RAYS_AT_ONCE // max(other.count, 1))
        for first in range(0, one.count, rows):
            block = slice(first, first + rows)
            crossed = self.slabs.crossed_between(
                _in_space(one.places[block]), _in_space(other.places), off=self.rays.clearance
            )
            for slabs in sets_among(crossed, seen[block]):
                if slabs not in self._sets:
                    self._sets.append(slabs)
                number = self._sets.index(slabs)
                numbers = numbers.astype(np.int16, copy=False)
                numbers[block][seen[block] & (crossed == slabs)] = number
        return numbers

    def _whole(self, part: Face) -> tuple[int, np.ndarray]:
        """Return the index of the whole face of a part, and the part's facets in it."""
        index = next(
            index
            for index, face in enumerate(self.faces)
            if (face.surface, face.side) == (part.surface, part.side)
        )
        return index, np.searchsorted(self.faces[index].source, part.source)


def facets_see_each_other(rays: RayScene, one: Face, other: Face) -> Bool[np.ndarray, "one other"]:
    """Trace a ray between each two facets that face each other.

    Parameters
    ----------
    rays
        The surfaces that may block, the two faces included.
    one, other
        The two faces.

    Returns
    -------
    Whether both facets face each other, and nothing is between.

    Raises
    ------
    ScenarioError
        If there are too many pairs.
    """
    if one.count * other.count > MOST_PAIRS:
        raise ScenarioError(
            f"max_bounces: two surfaces of {one.count} and {other.count} facets make "
            f"{one.count * other.count:.3g} pairs, more than {MOST_PAIRS:.3g}; make them shorter "
            "or less finely rough (roughness.correlation_mm), lower radio.stop_ghz, or set "
            "max_bounces = 1"
        )
    seen = np.zeros((one.count, other.count), dtype=bool)
    starts, ends = (face.places + rays.clearance * face.normals for face in (one, other))
    rows = max(1, RAYS_AT_ONCE // max(other.count, 1))
    for first in range(0, one.count, rows):
        block = slice(first, first + rows)
        apart = other.places - one.places[block, None]
        leaves = np.einsum("abx,ax->ab", apart, one.normals[block]) > 0
        arrives = np.einsum("abx,bx->ab", apart, other.normals) < 0
        some, others = np.nonzero(leaves & arrives)
        hidden = blocked(rays, _in_space(starts[block][some]), _in_space(ends[others]))
        seen[first + some, others] = ~hidden
    return seen


def _in_space(points: np.ndarray) -> np.ndarray:
    return np.concatenate([points, np.zeros((len(points), 1))], axis=-1)
