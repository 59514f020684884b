"""Tabulated transmission of a slab over angle and frequency, for links to many facets."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from scenes.schema.radio import Polarization
from simulator.materials.reflection_table import Angles, ReflectionTable, tabulated
from simulator.materials.slab_insertion import Crossing, bent_rays, inserted


@dataclass(frozen=True, kw_only=True)
class InsertionTable:
    """A slab crossed by a link, and its coefficients over frequency and angle."""

    crossing: Crossing
    frequency: float  # at which the refractive index that bends rays is taken [Hz]
    table: ReflectionTable

    @classmethod
    def of(
        cls, crossing: Crossing, nodes: Float[np.ndarray, " nodes"], polarization: Polarization
    ) -> "InsertionTable":
        """Tabulate a slab's coefficient, for waves polarized along z or across it."""

        def exact_at(some: Float[np.ndarray, " n"], cosines: Float[np.ndarray, " m"]) -> np.ndarray:
            both = inserted(crossing.material, some, cosines)
            return both.te if polarization == "vertical" else both.tm

        middle = float(nodes[nodes.size // 2])
        return cls(crossing=crossing, frequency=middle, table=tabulated(exact_at, nodes))

    def places(self, directions: Float[np.ndarray, "*n 2"]) -> Angles:
        """Look up where directions lie in the table."""
        cosines = np.abs(np.einsum("...x,x->...", directions, self.crossing.normal[:2]))
        return self.table.places(np.minimum(cosines, 1.0))

    def bending(
        self, directions: Float[np.ndarray, "*n 2"], lengths: Float[np.ndarray, "*n"]
    ) -> Float[np.ndarray, "*n"]:
        r"""Return the optical path of bent rays beyond that of straight ones, :math:`s^2/2L`. [m].

        The table holds coefficients at the straight ray's angle; this is the phase it leaves out.
        """
        rays = np.concatenate([directions, np.zeros((*directions.shape[:-1], 1))], axis=-1)
        bent = bent_rays((self.crossing,), rays.reshape(-1, 3), lengths.ravel(), self.frequency)
        return np.asarray(bent.saved.reshape(lengths.shape))
