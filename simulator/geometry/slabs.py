"""Flat faces of bodies that transmit waves, and the test of which of them straight lines cross.

A set of faces is an integer with one bit for each face; 0 is free space.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from simulator.geometry.mirrors import Mirrors
from simulator.materials.fresnel_slab import Dielectric
from simulator.materials.slab_insertion import Crossing

MOST_SLABS = 62
"""Most faces that transmit waves: the bits of a signed 64-bit integer. [-]"""

LINES_AT_ONCE = 4_000_000
"""Lines tested for crossings in one batch: some 500 MB. [-]"""


@dataclass(frozen=True, kw_only=True)
class Slabs:
    """Faces of bodies of a dielectric, each a slab with air on both sides."""

    faces: Mirrors
    owners: tuple[str, ...]  # name of the object that each face belongs to

    def __post_init__(self) -> None:
        """Refuse more faces than there are bits, and materials that are not slabs."""
        if len(self.faces) > MOST_SLABS:
            raise ValueError(
                f"{len(self.faces)} faces let waves through, more than {MOST_SLABS}; let some block"
            )
        if not all(isinstance(one, Dielectric) for one in self.faces.materials):
            raise ValueError("a conductor or an absorber lets nothing through; leave it out")

    def __len__(self) -> int:
        """Count the faces."""
        return len(self.faces)

    def crossings(self, crossed: int) -> tuple[Crossing, ...]:
        """Return the slabs of a set of faces."""
        return tuple(
            Crossing(material, self.faces.normals[face])
            for face, material in enumerate(self.faces.materials)
            if crossed >> face & 1 and isinstance(material, Dielectric)
        )

    def crossed(
        self, starts: Float[np.ndarray, "*n 3"], ends: Float[np.ndarray, "*n 3"]
    ) -> Int[np.ndarray, "*n"]:
        """Return the sets of faces that straight lines cross, without faces at a line's ends.

        Parameters
        ----------
        starts, ends
            [m]
        """
        found = np.zeros(starts.shape[:-1], dtype=np.int64)
        for face in range(len(self.faces)):
            before, after = self.faces.heights(starts, face), self.faces.heights(ends, face)
            some = np.nonzero(before * after < 0.0)
            share = (before[some] / (before[some] - after[some]))[:, None]
            hits = starts[some] + share * (ends[some] - starts[some])
            met = self.faces.margins(hits, face) >= 0.0
            found[tuple(axis[met] for axis in some)] |= 1 << face
        return found

    def crossed_between(
        self,
        points: Float[np.ndarray, "points 3"],
        places: Float[np.ndarray, "places 3"],
        *,
        off: float,
    ) -> Int[np.ndarray, "points places"]:
        """Return the sets of faces between each point and each place.

        Parameters
        ----------
        points, places
            [m]
        off
            Points within this distance of a face are on it: it is not in their way. [m]
        """
        found = np.zeros((len(points), len(places)), dtype=np.int64)
        rows = max(1, LINES_AT_ONCE // max(1, len(places)))
        for face in range(len(self.faces)):
            here, there = self.faces.heights(points, face), self.faces.heights(places, face)
            here, there = (np.where(np.abs(one) > off, one, 0.0) for one in (here, there))
            for first in range(0, len(points), rows):
                row, column = np.nonzero(here[first : first + rows, None] * there < 0.0)
                row += first
                share = (here[row] / (here[row] - there[column]))[:, None]
                hits = points[row] + share * (places[column] - points[row])
                met = self.faces.margins(hits, face) >= 0.0
                found[row[met], column[met]] |= 1 << face
        return found


def sets_among(crossed: Int[np.ndarray, "*n"], seen: Bool[np.ndarray, "*n"]) -> Iterable[int]:
    """Return the distinct sets of faces between points that see each other, without free space."""
    return [one for one in np.unique(crossed[seen]).tolist() if one]


def no_slabs() -> Slabs:
    """Return an empty set of slabs."""
    nothing = Mirrors(
        corners=np.empty((0, 4, 3)),
        materials=(),
        rms_heights=np.empty(0),
        two_sided=np.empty(0, dtype=bool),
    )
    return Slabs(faces=nothing, owners=())
