"""Weights of facets per size: obliquity times reflection, and both ends' antenna patterns.

A :class:`Leg` holds distances and directions from one port to all facets, a
:class:`MaterialPart` the facets of one material with their weights: Fresnel's coefficients on
smooth facets, second-order small-slope weights on rough lines
(:mod:`simulator.scattering.small_slope_2d`), weighted curvature on rough triangles
(:mod:`simulator.scattering.weighted_curvature_3d`).
"""

import threading

import numpy as np
from jaxtyping import Complex, Float, Int

from simulator.antennas.ports import Ports
from simulator.geometry.facets import Facets, Group
from simulator.materials.facet_reflection import (
    Legs,
    angle_class,
    echo_coefficient,
    facet_coefficients,
    half_angle_cosine,
    reflection_nodes,
)
from simulator.materials.fresnel_slab import Conductor
from simulator.numerics.nufft_sum import FrequencySum, chebyshev_nodes
from simulator.scattering.rough_triangles import rough_weights
from simulator.scattering.small_slope_2d import (
    DirectionGrid,
    RoughLine,
    echo_weights,
    reflection_of_front,
)
from simulator.scattering.weighted_curvature_3d import half_space_mirror, middle_permittivity

ROUGH_NODES = 4
"""Fewest frequencies at which weights of rough lines are sampled: over a third of an octave, the
interpolation error is then 1e-3 of their difference from the tangent plane's. [-]"""


class MaterialPart:
    """The facets of one material, and the sampling of their sum over the band."""

    def __init__(
        self,
        facets: Facets,
        group: Group,
        count: int,
        frequencies: Float[np.ndarray, " freqs"],
        *,
        monostatic: bool,
    ) -> None:
        self.material, self.share, self.mask = group
        self.count = count
        self.frequencies, self.monostatic = frequencies, monostatic
        self.polarization = facets.polarization
        self.permittivity = middle_permittivity(
            self.material, float(frequencies[0]), float(frequencies[-1])
        )
        self.runs = [
            run
            for run in facets.runs
            if run.rough and (self.mask is None or self.mask[run.facets[0]])
        ]
        if self.runs:
            self.count = max(count, ROUGH_NODES)
        # Monostatic echoes have one coefficient for all facets: the sum is multiplied once.
        self.common: Complex[np.ndarray, " freqs"] | None = None
        if monostatic and not isinstance(self.material, Conductor):
            self.common = echo_coefficient(
                self.material, frequencies, polarization=self.polarization
            )
        self._totals: dict[float, FrequencySum] = {}
        self._lines: dict[tuple[int, float, int], tuple[RoughLine, DirectionGrid]] = {}
        self._lock = threading.Lock()

    def total(self, inward: "Leg", outward: "Leg", lit: np.ndarray) -> FrequencySum:
        """Return the sum whose sampling of the band suffices for these facets' angles."""
        same = self.monostatic or isinstance(self.material, Conductor)
        lowest = 1.0
        if not same:
            cosines = half_angle_cosine(inward.direction[lit], outward.direction[lit])
            if self.runs:
                ends = np.abs(inward.cosine[lit]), np.abs(outward.cosine[lit])
                cosines = np.concatenate([cosines, *ends])
            lowest = angle_class(cosines)
        with self._lock:
            if lowest not in self._totals:
                start, stop = float(self.frequencies[0]), float(self.frequencies[-1])
                count = self.count
                if not same:
                    count += reflection_nodes(self.material, start, stop, lowest=lowest) - 1
                nodes = chebyshev_nodes(start, stop, count)
                self._totals[lowest] = FrequencySum(self.frequencies, nodes)
            return self._totals[lowest]

    def weights(
        self,
        inward: "Leg",
        outward: "Leg",
        some: np.ndarray,
        nodes: Float[np.ndarray, " nodes"],
        facets: Facets,
    ) -> Float[np.ndarray, "#nodes facets"] | Complex[np.ndarray, "#nodes facets"]:
        """Obliquity times reflection of smooth facets; the small-slope weights of rough ones."""
        if self.share is not None:
            return self._rough_triangles(inward, outward, some, nodes, facets)
        smooth = np.flatnonzero(~facets.rough[some]) if self.runs else np.arange(some.size)
        if smooth.size == some.size:
            return self._smooth(inward, outward, some, nodes, facets)
        weights = np.empty((nodes.size, some.size), dtype=np.complex128)
        if smooth.size:
            weights[:, smooth] = self._smooth(inward, outward, some[smooth], nodes, facets)
        for number, run in enumerate(self.runs):
            chosen = np.flatnonzero(run.places[some] >= 0)
            for side in (1.0, -1.0):
                here = chosen[np.sign(inward.cosine[some[chosen]]) == side]
                if here.size == 0:
                    continue
                line, echoes = self._rough_line(number, side, nodes)
                which, places = some[here], run.places[some[here]]
                if self.monostatic:
                    found = echoes(inward.along(facets, which), places)
                else:
                    sent, heard = (
                        (leg.along(facets, which), np.abs(leg.cosine[which]))
                        for leg in (inward, outward)
                    )
                    found = line.weights(sent, heard, places, side=side, monostatic=False)
                if here.size == some.size:
                    weights = found.astype(np.complex128)
                else:
                    weights[:, here] = found
        if self.common is not None:
            half = reflection_of_front(self.material, nodes, polarization=self.polarization)
            weights[:, facets.rough[some]] /= half[:, None]
        return weights

    def _smooth(
        self,
        inward: "Leg",
        outward: "Leg",
        some: np.ndarray,
        nodes: Float[np.ndarray, " nodes"],
        facets: Facets,
    ) -> Float[np.ndarray, "#nodes facets"] | Complex[np.ndarray, "#nodes facets"]:
        obliquity = np.abs(inward.cosine[some] + outward.cosine[some])
        coefficients = self._coefficients(inward, outward, some, nodes, flat=facets.flat)
        return np.asarray(obliquity * coefficients)

    def _rough_triangles(
        self,
        inward: "Leg",
        outward: "Leg",
        some: np.ndarray,
        nodes: Float[np.ndarray, " nodes"],
        facets: Facets,
    ) -> Float[np.ndarray, "#nodes facets"] | Complex[np.ndarray, "#nodes facets"]:
        share, part, side = (
            float(self.share or 0.0),
            facets.part(some),
            np.sign(inward.facing[some]),
        )
        one = inward.direction[some].T, inward.fields(some).T
        other = one if outward is inward else (outward.direction[some].T, outward.fields(some).T)
        legs = Legs(transmit=one[0], receive=other[0], sent=one[1], received=other[1])
        added = rough_weights(part, side, legs, self.material, self.permittivity, share)
        if self.common is not None:
            added = added / half_space_mirror(self.permittivity)
        cosines = side * (inward.cosine[some] + outward.cosine[some])
        mirrored = self._coefficients(inward, outward, some, nodes, flat=False)
        return np.asarray(mirrored * cosines + added)

    def _rough_line(
        self, number: int, side: float, nodes: Float[np.ndarray, " nodes"]
    ) -> tuple[RoughLine, DirectionGrid]:
        """Return a run's rough line at these nodes, and its weights for monostatic echoes."""
        run, key = self.runs[number], (number, side, nodes.size)
        with self._lock:
            if key not in self._lines:
                line = RoughLine(
                    heights=run.heights,
                    step=run.step,
                    closed=run.closed,
                    material=self.material,
                    polarization=self.polarization,
                    nodes=nodes,
                )
                self._lines[key] = line, echo_weights(line, side=side)
            return self._lines[key]

    def _coefficients(
        self,
        inward: "Leg",
        outward: "Leg",
        some: np.ndarray,
        nodes: Float[np.ndarray, " nodes"],
        *,
        flat: bool,
    ) -> Float[np.ndarray, "#nodes facets"] | Complex[np.ndarray, "#nodes facets"]:
        """Return reflection coefficients at the nodes, without factors common to all facets."""
        if self.common is not None:
            return np.ones((1, len(some)))
        if self.monostatic and isinstance(self.material, Conductor):
            return np.full((1, len(some)), -1.0 if self.polarization == "vertical" else 1.0)
        legs = inward.direction[some], outward.direction[some]
        fields = None if flat else (inward.fields(some), outward.fields(some))
        return facet_coefficients(
            self.material, *legs, nodes, fields=fields, polarization=self.polarization
        )


class Leg:
    """Distances and directions from one port to all facets."""

    def __init__(self, facets: Facets, ports: Ports, index: int) -> None:
        towards = ports.positions[index] - facets.centres
        self.distance = np.sqrt(np.einsum("fx,fx->f", towards, towards))
        self.direction = towards / self.distance[:, None]
        self.cosine = np.einsum("fx,fx->f", self.direction, facets.normals)
        # Roughness does not hide its own surface: the mean surface has to face the antenna.
        self.facing = self.cosine
        if facets.relief is not None:
            self.facing = np.einsum("fx,fx->f", self.direction, facets.relief.normals)
        self.lit = ports.visible[index] & (facets.two_sided | (self.facing > 0))
        self.pattern, self.polarization = ports.pattern, ports.polarization
        self._places = np.cumsum(self.lit) - 1  # of lit facets among those
        self._gains: dict[int, np.ndarray] = {}
        self._along: np.ndarray | None = None

    def along(
        self, facets: Facets, some: Int[np.ndarray, " chosen"]
    ) -> Float[np.ndarray, " chosen"]:
        """Component of the direction along a line's mean course. [-]."""
        if self._along is None:
            direction, normal = self.direction, facets.normals
            self._along = np.asarray(
                direction[:, 1] * normal[:, 0] - direction[:, 0] * normal[:, 1]
            )
        return np.asarray(self._along[some])

    def fields(self, some: np.ndarray) -> Float[np.ndarray, "some 3"]:
        """Vectors of the antenna's field at some of the facets."""
        return self.polarization.field(-self.direction[some])

    def gain(
        self, some: np.ndarray, nodes: Float[np.ndarray, " nodes"]
    ) -> Float[np.ndarray, "#nodes facets"] | Complex[np.ndarray, "#nodes facets"]:
        """Field pattern of the port towards some of the facets that are lit."""
        if nodes.size not in self._gains:  # all parts' nodes span the same band
            lit = self.lit
            self._gains[nodes.size] = self.pattern(-self.direction[lit], self.distance[lit], nodes)
        return self._gains[nodes.size][:, self._places[some]]
