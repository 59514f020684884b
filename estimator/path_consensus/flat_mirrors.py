r"""Flat mirrors without ends, and images over one to three of them.

A mirror is the line or plane :math:`n \cdot x = d` with the unit normal n away from the base
station at the origin, d > 0; it takes x to :math:`x + 2 (d - n \cdot x) n`. Three
reflections pass for one mirror, where the user moves little: over a, b and a again they are the
reflection about b's own image in a.
"""

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from jaxtyping import Bool, Float

Chain = tuple[int, ...]
"""Indices of mirrors, from the base station outward."""


MOST_TRIPLES = 6
"""Mirrors up to which all chains of three are followed, 150 of them; of more, only those that come
back to the first one. [-]"""


@dataclass(frozen=True, kw_only=True)
class Mirrors:
    """Some mirrors."""

    normal: Float[np.ndarray, "mirrors axes"]
    offset: Float[np.ndarray, " mirrors"]  # distance from the base station [m]

    def __len__(self) -> int:
        """Count them."""
        return self.offset.size

    @property
    def images(
        self,
    ) -> tuple[Float[np.ndarray, "chains axes axes"], Float[np.ndarray, "chains axes"]]:
        """Matrices Q and shifts t of all chains: the image of x is Q x + t. [-], [m]."""
        axes = self.normal.shape[1]
        own = np.eye(axes) - 2 * self.normal[:, :, None] * self.normal[:, None, :]
        shift = 2 * self.offset[:, None] * self.normal
        turns, shifts = [np.eye(axes)], [np.zeros(axes)]
        for chain in chains_of(len(self))[1:]:
            turn, moved = np.eye(axes), np.zeros(axes)
            for one in reversed(chain):
                turn, moved = own[one] @ turn, own[one] @ moved + shift[one]
            turns.append(turn)
            shifts.append(moved)
        return np.array(turns), np.array(shifts)

    def reflects(self, users: Float[np.ndarray, "users axes"]) -> Bool[np.ndarray, "users chains"]:
        """Tell which users are seen over which chains: each ray meets the mirrors' fronts.

        Of three mirrors, the first two and the last one are looked at.
        """
        chains = chains_of(len(self))
        front = users @ self.normal.T < self.offset
        able = np.ones((len(users), len(chains)), dtype=bool)
        if not len(self):
            return able
        turns, shifts = self.images
        able[:, 1 : 1 + len(self)] = front
        for number, chain in enumerate(chains[1 + len(self) :], start=1 + len(self)):
            first, second, last = chain[0], chain[1], chain[-1]
            image = users @ turns[number].T + shifts[number]
            beyond = image @ self.normal[first]
            meets = beyond > self.offset[first]
            share = self.offset[first] / np.where(meets, beyond, 1.0)
            place = share * (image @ self.normal[second])
            able[:, number] = meets & (place < self.offset[second]) & front[:, last]
        return able

    def without(self, index: int) -> "Mirrors":
        """Leave one out."""
        kept = np.arange(len(self)) != index
        return Mirrors(normal=self.normal[kept], offset=self.offset[kept])

    def and_one(self, normal: Float[np.ndarray, " axes"], offset: float) -> "Mirrors":
        """Add one."""
        return Mirrors(
            normal=np.concatenate([self.normal, normal[None]]),
            offset=np.append(self.offset, offset),
        )


def no_mirrors(axes: int) -> Mirrors:
    """Return none."""
    return Mirrors(normal=np.zeros((0, axes)), offset=np.zeros(0))


def chains_of(count: int) -> list[Chain]:
    """Return the straight way, and all chains that are followed over so many mirrors."""
    pairs = list(permutations(range(count), 2))
    three = [
        (first, second, third)
        for first, second in pairs
        for third in range(count)
        if third == first or (third != second and count <= MOST_TRIPLES)
    ]
    return [(), *((index,) for index in range(count)), *pairs, *three]
