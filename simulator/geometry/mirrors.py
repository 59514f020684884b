"""Finite flat mirrors: convex quadrilaterals in space, or line segments of a 2-D scene."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float

from simulator.materials.fresnel_slab import Material

FLATNESS = 1e-6
"""Largest distance of a corner from the plane of its mirror: at 300 GHz 1 µm is 0.4° of
phase, and corners that were stored in single precision keep within it. [m]"""


def dot(
    first: Float[np.ndarray, "*#n 3"], second: Float[np.ndarray, "*#n 3"]
) -> Float[np.ndarray, "..."]:
    """Scalar products of vectors, broadcast.

    Not by matrix product, whose rounding depends on its size and the number of threads.
    """
    product: np.ndarray = (
        first[..., 0] * second[..., 0]
        + first[..., 1] * second[..., 1]
        + first[..., 2] * second[..., 2]
    )
    return product


SEAM = 1e-8
"""Displacement of a point before the test of which mirror it is on: far above rounding, far below
a wavelength. [m]"""

ASIDE = np.array([0.8, 0.5, 0.33])
"""Direction of that displacement: along it no edge of a scene is likely to run. [-]"""

LEAST_AREA = 1e-10
"""Smallest area of a mirror, that of a square of 10 µm. [m²]"""


@dataclass(frozen=True, kw_only=True)
class Mirrors:
    """Mean planes of the surfaces that reflect specularly.

    The normal is that of the right-hand rule around the corners. A triangle repeats a corner.
    """

    corners: Float[np.ndarray, "mirrors 4 3"]  # in order around the edge [m]
    materials: tuple[Material, ...]
    rms_heights: Float[np.ndarray, " mirrors"]  # of the roughness [m]
    two_sided: Bool[np.ndarray, " mirrors"]  # else only the side of the normal reflects

    def __post_init__(self) -> None:
        """Refuse mirrors that are not flat and convex."""
        if len(self.materials) != len(self.corners):
            raise ValueError(
                f"{len(self.corners)} mirrors have {len(self.materials)} materials; give one each"
            )
        doubled = np.linalg.norm(self._across, axis=-1)
        for index in np.flatnonzero(~(doubled > 2 * LEAST_AREA)):
            raise ValueError(
                f"mirror {index} has an area of {doubled[index] / 2:.2g} m², the limit is "
                f"{LEAST_AREA:g} m²; remove it, or give its corners in order around the edge"
            )
        heights = dot(self.corners - self.corners[:, :1], self.normals[:, None])
        for index in np.flatnonzero(np.abs(heights).max(axis=1) > FLATNESS):
            raise ValueError(
                f"mirror {index} is not flat: its corners lie {np.abs(heights[index]).max():.2g} m "
                f"off one plane, the limit is {FLATNESS:g} m; split it into flat mirrors"
            )
        along = np.roll(self.corners, -1, axis=1) - self.corners
        turns = dot(np.cross(along, np.roll(along, -1, axis=1)), self.normals[:, None])
        # A relative limit, like rounding: 1e-16 for straight angles.
        for index in np.flatnonzero(turns.min(axis=1) < -1e-9 * doubled):
            raise ValueError(
                f"mirror {index} is not convex; give its corners in order around the edge, "
                "or split it"
            )

    def __len__(self) -> int:
        """Count the mirrors."""
        return len(self.corners)

    @cached_property
    def normals(self) -> Float[np.ndarray, "mirrors 3"]:
        """Unit normals."""
        normals: np.ndarray = self._across / np.linalg.norm(self._across, axis=-1, keepdims=True)
        return normals

    @property
    def _across(self) -> Float[np.ndarray, "mirrors 3"]:
        """Normals with a length of twice the area. [m²]."""
        diagonals = self.corners[:, 2:] - self.corners[:, :2]
        return np.cross(diagonals[:, 0], diagonals[:, 1])

    @cached_property
    def inward(self) -> Float[np.ndarray, "mirrors 4 3"]:
        """Unit vectors in the mirror, across each edge (zero for a repeated corner)."""
        along = np.roll(self.corners, -1, axis=1) - self.corners
        lengths = np.linalg.norm(along, axis=-1, keepdims=True)
        along = np.divide(along, lengths, out=np.zeros_like(along), where=lengths > 0)
        return np.cross(self.normals[:, None], along)

    def heights(self, points: Float[np.ndarray, "*n 3"], mirror: int) -> Float[np.ndarray, "*n"]:
        """Signed distances in metres of points from a mirror's plane, along its normal."""
        return dot(points - self.corners[mirror, 0], self.normals[mirror])

    def images(self, points: Float[np.ndarray, "*n 3"], mirror: int) -> Float[np.ndarray, "*n 3"]:
        """Mirror points in the plane of one mirror."""
        heights = self.heights(points, mirror)
        image: np.ndarray = points - 2.0 * heights[..., None] * self.normals[mirror]
        return image

    def turned(
        self, directions: Float[np.ndarray, "*n 3"], mirror: int
    ) -> Float[np.ndarray, "*n 3"]:
        """Mirror directions in the plane of one mirror."""
        normal = self.normals[mirror]
        turned: np.ndarray = directions - 2.0 * dot(directions, normal)[..., None] * normal
        return turned

    def margins(self, points: Float[np.ndarray, "*n 3"], mirror: int) -> Float[np.ndarray, "*n"]:
        """Distances in metres of points on a mirror from its nearest edge; outside negative."""
        from_corners = points[..., None, :] - self.corners[mirror]
        distances = dot(from_corners, self.inward[mirror])
        # A repeated corner has no edge there.
        distances = np.where(np.any(self.inward[mirror] != 0.0, axis=-1), distances, np.inf)
        margin: np.ndarray = distances.min(axis=-1)
        return margin

    def reflects_at(self, points: Float[np.ndarray, "*n 3"], mirror: int) -> Bool[np.ndarray, "*n"]:
        """Return which points of its plane are on a mirror.

        If two mirrors of one plane share an edge, each of its points is on exactly one of them:
        it is displaced by :data:`SEAM` in the same direction for both.
        """
        normal = self.normals[mirror]
        step = SEAM * (ASIDE - float(ASIDE @ normal) * normal)
        return np.asarray(self.margins(points + step, mirror) >= 0.0)


def line_mirrors(
    starts: Float[np.ndarray, "mirrors 3"],
    ends: Float[np.ndarray, "mirrors 3"],
    *,
    materials: Sequence[Material],
    rms_heights: Float[np.ndarray, " mirrors"],
    two_sided: Bool[np.ndarray, " mirrors"],
    half_height: float = 1.0,
) -> Mirrors:
    """Return the mirrors of a 2-D scene: upright strips on line segments in the plane z = 0.

    The normal of a segment along +x points to -y. The height does not matter as long as all
    sources and receivers lie in the plane.
    """
    up = np.array([0.0, 0.0, half_height])
    return Mirrors(
        corners=np.stack([starts - up, ends - up, ends + up, starts + up], axis=1),
        materials=tuple(materials),
        rms_heights=rms_heights,
        two_sided=two_sided,
    )
