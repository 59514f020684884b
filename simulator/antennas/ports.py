"""Antenna ports: where they stand and how their fields depend on direction."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Complex, Float

from simulator.antennas.polarization import VERTICAL, Polarization

Pattern = Callable[
    [Float[np.ndarray, "facets 3"], Float[np.ndarray, " facets"], Float[np.ndarray, " nodes"]],
    Float[np.ndarray, "#nodes facets"] | Complex[np.ndarray, "#nodes facets"],
]
"""Field over that of an isotropic port, from the unit directions that leave the port, the
distances [m] and the frequencies [Hz]; a single row if it does not vary with frequency."""


@dataclass(frozen=True, kw_only=True)
class Ports:
    """Antenna ports at points of space, as the facets see them."""

    positions: Float[np.ndarray, "ports 3"]  # [m]
    pattern: Pattern
    visible: Bool[np.ndarray, "ports facets"]
    nodes: int = 1  # frequencies that the pattern has to be sampled at
    slabs: tuple[Any, ...] = ()  # crossings whose insertion the pattern holds
    slab_nodes: int = 0  # how many of the nodes are these slabs'
    polarization: Polarization = VERTICAL  # in two dimensions the field is along z
    behind_slabs: "tuple[Ports, ...]" = ()
    """The same ports as the facets see them that waves only reach through slabs: for each set of
    slabs, with what they insert in the pattern."""

    @property
    def ways(self) -> "tuple[Ports, ...]":
        """The ports as all facets see them: past everything, then through slabs."""
        return replace(self, behind_slabs=()), *self.behind_slabs

    def part(self, some: slice) -> "Ports":
        """Choose some of the ports."""
        return replace(
            self,
            positions=self.positions[some],
            visible=self.visible[some],
            behind_slabs=tuple(one.part(some) for one in self.behind_slabs),
        )


def isotropic(
    directions: Float[np.ndarray, "facets 3"],
    distances: Float[np.ndarray, " facets"],
    frequencies: Float[np.ndarray, " nodes"],
) -> Float[np.ndarray, "1 facets"]:
    """Pattern of an isotropic port."""
    return np.ones((1, len(distances)))
