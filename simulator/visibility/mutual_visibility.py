"""Which facets of two faces see each other: it depends neither on antennas nor on frequency."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool

from scenes.schema.errors import ScenarioError
from simulator.geometry.faces import Face
from simulator.geometry.ray_scene import RAYS_AT_ONCE, RayScene, blocked

MOST_PAIRS = 2**30
"""Most pairs of facets of two surfaces: 1 GiB. [-]"""


@dataclass(frozen=True)
class MutualVisibility:
    """Tells which facets of two faces see each other; each pair of faces is traced once."""

    rays: RayScene
    faces: Sequence[Face]  # whole
    _traced: dict[tuple[int, int], np.ndarray] = field(default_factory=dict)

    def __call__(self, one: Face, other: Face) -> Bool[np.ndarray, "one other"]:
        """Look up some facets of two faces; points within a facet see what its centre sees."""
        (first, rows), (second, columns) = self._whole(one), self._whole(other)
        if (second, first) in self._traced:
            return np.asarray(self._traced[second, first].T[np.ix_(rows, columns)])
        if (first, second) not in self._traced:
            self._traced[first, second] = facets_see_each_other(
                self.rays, self.faces[first], self.faces[second]
            )
        return np.asarray(self._traced[first, second][np.ix_(rows, columns)])

    def _whole(self, part: Face) -> tuple[int, np.ndarray]:
        """Which face it is a part of, and which facets of that face it has."""
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
        What may stand between them, themselves included.
    one, other
        The two faces.

    Returns
    -------
    Whether both normals look to the other facet, and nothing is between.

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
