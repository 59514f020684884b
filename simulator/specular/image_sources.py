r"""Legs of an echo over mirrors: an antenna's image in them illuminates a target.

By the method of images, the wave of an antenna over a sequence of plane mirrors arrives as from
its image, times the mirrors' reflection and the coherent loss of their roughness. So the facets of
a target behind walls are summed like those in line of sight, from the images' positions, and
restricted by the mirrors' finite extents and by occlusion.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Complex, Float

from simulator.antennas.antenna_pattern import AntennaPattern
from simulator.antennas.beam_culling import LEVEL, AntennaGroup
from simulator.antennas.links import Links
from simulator.antennas.polarization import Polarization
from simulator.geometry.mirrors import Mirrors
from simulator.specular.image_method import unfolded_chain
from simulator.specular.path_field import Through, reflected_field

MOST_LEGS = 10_000
"""Most legs over mirrors that are listed without a test of what antennas see: tracing one from
every antenna takes some 10 ms; minutes in all. [-]"""


@dataclass(frozen=True, kw_only=True)
class Leg:
    """A leg over a sequence of mirrors; an empty sequence is the direct leg."""

    sequence: tuple[int, ...]  # mirrors from the antenna onward
    turn: Float[np.ndarray, "3 3"]  # orthogonal matrix that maps directions to the image's
    shift: Float[np.ndarray, " 3"]  # [m]

    @property
    def bounces(self) -> int:
        """Number of mirrors."""
        return len(self.sequence)

    def image(self, group: AntennaGroup) -> AntennaGroup:
        """Return the image of antennas: positions, aim and polarization mirrored."""
        if not self.sequence:
            return group
        pattern = AntennaPattern(
            group.pattern.antenna,
            np.einsum("xy,y->x", self.turn, group.pattern.aim),
            group.pattern.polarization.turned(self.turn),
        )
        places = np.einsum("xy,ny->nx", self.turn, group.positions) + self.shift
        return AntennaGroup(positions=places, pattern=pattern)

    def onward(self, mirrors: Mirrors, *sequence: int) -> "Leg":
        """Extend the leg by more mirrors."""
        leg = self
        for mirror in sequence:
            normal = mirrors.normals[mirror]
            turn = np.eye(3) - 2 * np.outer(normal, normal)
            base = 2 * float((mirrors.corners[mirror, 0] * normal).sum()) * normal
            leg = Leg(
                sequence=(*leg.sequence, mirror),
                turn=np.einsum("xy,yz->xz", turn, leg.turn),
                shift=np.einsum("xy,y->x", turn, leg.shift) + base,
            )
        return leg


DIRECT = Leg(sequence=(), turn=np.eye(3), shift=np.zeros(3))
"""The leg without mirrors."""


def legs_within_reach(
    mirrors: Mirrors, groups: Sequence[AntennaGroup], most: int
) -> tuple[Leg, ...] | None:
    """Find the legs over 1 to ``most`` mirrors that lie within antennas' patterns.

    Parameters
    ----------
    mirrors
        All mirrors of the scene.
    groups
        Antennas; a leg must be within the pattern of one group.
    most
        Most mirrors of a leg.

    Returns
    -------
    In the order of their mirrors, each leg before those that extend it; None if there are more
    than :data:`MOST_LEGS`.
    """
    centres = mirrors.corners.mean(axis=1)
    radii = np.linalg.norm(mirrors.corners - centres[:, None], axis=-1).max(axis=1)

    def grown(leg: Leg) -> Iterator[Leg]:
        images = [leg.image(group) for group in groups]
        bounds = np.max([image.at_most(centres, radii) for image in images], axis=0)
        for mirror in np.flatnonzero(bounds >= LEVEL).tolist():
            if leg.sequence and leg.sequence[-1] == mirror:
                continue
            if any(_reflects(mirrors, mirror, image) for image in images):
                yield leg.onward(mirrors, mirror)

    found: list[Leg] = []
    longest = [DIRECT]
    for _ in range(most):
        longer: list[Leg] = []
        for leg in longest:
            longer += grown(leg)
            if len(found) + len(longer) > MOST_LEGS:
                return None
        found, longest = found + longer, longer
    return tuple(sorted(found, key=lambda leg: leg.sequence))


def _reflects(mirrors: Mirrors, mirror: int, image: AntennaGroup) -> bool:
    """Return whether an image is on the reflecting side of a mirror."""
    heights = mirrors.heights(image.positions, mirror)
    return bool((np.abs(heights) if mirrors.two_sided[mirror] else heights).max() > 0)


@dataclass(frozen=True, kw_only=True)
class LegReflection:
    """Factor of both legs' mirrors in the sum over a patch, taken at the patch's centre.

    The component of the arriving field along the field of the antenna's image.
    """

    mirrors: Mirrors
    out: Leg
    back: Leg
    through: tuple[Through, Through] = ((), ())  # slabs on each part of either leg

    def __call__(
        self,
        links: Links,
        centres: Float[np.ndarray, "patches 3"],
        nodes: Float[np.ndarray, " nodes"],
    ) -> Complex[np.ndarray, "patches links nodes"]:
        """Return the factor for links between images. [-]."""
        out, back = (
            partial(self._over, leg, through, centres, nodes)
            if leg.sequence or any(through)
            else None
            for leg, through in zip((self.out, self.back), self.through, strict=True)
        )
        return links.product_over_legs(out, back, patches=len(centres), nodes=nodes.size)

    def _over(
        self,
        leg: Leg,
        through: Through,
        centres: Float[np.ndarray, "patches 3"],
        nodes: Float[np.ndarray, " nodes"],
        places: Float[np.ndarray, "some 3"],
        image: Polarization,
    ) -> Complex[np.ndarray, "patches some nodes"]:
        chain = unfolded_chain(self.mirrors, leg.sequence, places, centres)
        field = reflected_field(
            self.mirrors,
            chain,
            nodes,
            sent=image.turned(leg.turn.T),
            at_place=image,
            through=through,
        )
        return np.moveaxis(field.reshape(len(places), len(centres), -1), 0, 1)
