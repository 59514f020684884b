"""Links over millions of triangles: geometry in a Dr.Jit kernel, sums over the band on CPU cores.

The same physical optics as in NumPy in :mod:`simulator.scattering.physical_optics`, in the same
order: distances and phases in double precision, amplitudes in single. Facets' reflection must not
vary over the band (conductors; monostatic echoes, which share one coefficient).
"""

import math
import os
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from jaxtyping import Bool, Complex, Float
from scipy.constants import speed_of_light

from estimator.compute import engine
from simulator.antennas.polarization import VERTICAL, Polarization, field_vector
from simulator.geometry.facets import Facets
from simulator.materials.facet_reflection import Legs, conductor_mirror
from simulator.materials.fresnel_slab import Conductor, Material
from simulator.numerics.nufft_sum import FrequencySum
from simulator.scattering.triangle_transform import triangle_transform
from simulator.scattering.weighted_curvature_3d import (
    curvature_weight,
    half_space_mirror,
    scattering_kernel,
)

mi.set_variant(engine.mitsuba_variant())

Complex2f: Any = mi.Complex2f
Complex2d: Any = mi.Complex2d


WAITING = 2
"""Links whose evaluated facets may wait for a free core: each takes 40 byte a facet. [-]"""

CONDUCTOR = Conductor()

Pair = tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]
"""Positions of a link's transmitter and receiver. [m]"""


@dataclass(frozen=True, kw_only=True)
class Weights:
    """Factors of the facets' scattering in one link."""

    lit: Bool[np.ndarray, " facets"]  # seen from both ends
    gain: Float[np.ndarray, " facets"] | None = None  # product of both patterns; None: 1
    material: Material = CONDUCTOR
    permittivity: complex = 1.0 + 0j  # of the material
    share: float | None = None  # see simulator.geometry.facets.Relief; None: smooth


class FacetKernel:
    """Facets in the kernel's arrays, for antennas of two polarizations."""

    def __init__(
        self, facets: Facets, sent: Polarization = VERTICAL, received: Polarization = VERTICAL
    ) -> None:
        self.count = facets.count
        self.polarizations = sent, received
        self.mean = self.normals_of(facets)
        self.centres = [mi.Float64(np.ascontiguousarray(axis)) for axis in facets.centres.T]
        self.normals = _single(facets.normals)
        self.sizes = mi.Float(facets.sizes.astype(np.float32))
        self.edges = [_single(facets.edges[:, side]) for side in range(2)]
        self.two_sided = mi.Bool(facets.two_sided)

    def typical_advance(self, pairs: list[Pair]) -> float:
        """Typical difference of delay over one facet, the largest of these links. [s].

        Over a link's facets it is the sixth root of the mean sixth power: the error of three
        nodes grows with the third power, and errors of facets add in power.
        """
        largest = 0.0
        for transmit, receive in pairs:
            legs = [self._leg(end) for end in (transmit, receive)]
            both = legs[0].direction + legs[1].direction
            first, second = (dr.dot(both, edge) for edge in self.edges)
            slope = dr.maximum(dr.maximum(abs(first), abs(second)), abs(first - second))
            slope *= 1.0 / speed_of_light
            scale = float(dr.max(slope)[0])
            if scale > 0.0:  # in single precision the sixth power would underflow
                share = float(dr.mean((slope * (1.0 / scale)) ** 6)[0])
                largest = max(largest, scale * share ** (1 / 6))
        return largest

    def link(
        self, pair: Pair, weights: Weights, total: FrequencySum, *, monostatic: bool
    ) -> tuple[Float[np.ndarray, " facets"], list[Float[np.ndarray, " facets"]]]:
        """Evaluate one link's facets: phases per frequency step, and terms at the nodes.

        Of each term the real part, then the imaginary part.

        For a conductor, or, for a monostatic echo, a surface of coefficient -1.
        """
        inward = self._leg(pair[0])
        outward = inward if monostatic else self._leg(pair[1])
        length = inward.distance + outward.distance
        turns = length * dr.opaque(mi.Float64, total.centre / speed_of_light)
        steps = length * dr.opaque(mi.Float64, total.step / speed_of_light)
        sine, cosine = dr.sincos(mi.Float(turns - dr.round(turns)) * (-2 * math.pi))
        # In double: it is multiplied by hundreds of steps.
        phases = (steps - dr.round(steps)) * (2 * math.pi)
        facing = inward.cosine, outward.cosine
        if self.mean is not None:
            facing = tuple(dr.dot(leg.direction, self.mean) for leg in (inward, outward))
        lit = mi.Bool(weights.lit) & (facing[0] * facing[1] > 0)
        lit &= self.two_sided | (facing[0] > 0)
        product = mi.Float(inward.distance) * mi.Float(outward.distance)
        amplitude = self.sizes / (8 * math.pi * product)
        if weights.gain is not None:
            amplitude *= mi.Float(weights.gain.astype(np.float32))
        amplitude = dr.select(lit, amplitude, 0.0)
        legs = self._legs(inward, outward, monostatic=monostatic)
        mirror = mi.Float(-1.0) if monostatic else mi.Float(conductor_mirror(legs))
        weight: Any = abs(inward.cosine + outward.cosine) * mirror
        if weights.share is not None and self.mean is not None:
            side = dr.select(facing[0] > 0, mi.Float(1.0), mi.Float(-1.0))
            weight = side * (inward.cosine + outward.cosine) * mirror
            weight = weight + self._curvature(legs, side, weights, monostatic=monostatic)
        both = inward.direction + outward.direction
        first, second = (dr.dot(both, edge) / speed_of_light for edge in self.edges)
        terms = []
        for node in total.nodes:
            wave = dr.opaque(mi.Float, 2 * math.pi * float(node))
            re, im = triangle_transform(wave * first, wave * second)
            re, im = amplitude * (re * cosine - im * sine), amplitude * (re * sine + im * cosine)
            if isinstance(weight, Complex2f):
                real, imaginary = weight.real, weight.imag
                re, im = re * real - im * imaginary, re * imaginary + im * real
            else:
                re, im = re * weight, im * weight
            terms += [re, im]
        dr.eval(phases, *terms)  # together: one kernel
        return phases.numpy(), [term.numpy() for term in terms]

    @staticmethod
    def normals_of(facets: Facets) -> Any:
        """Return normals of the mean surface; None if all facets are smooth."""
        return None if facets.relief is None else _single(facets.relief.normals)

    def _legs(self, inward: "_Leg", outward: "_Leg", *, monostatic: bool) -> Legs:
        axes = [
            (mi.Vector3d(*(dr.opaque(mi.Float64, float(a)) for a in one.axis)), one.cross_polar)
            for one in self.polarizations
        ]
        sent = field_vector(inward.exact, *axes[0])
        received = sent if monostatic else field_vector(outward.exact, *axes[1])
        return Legs(inward.exact, outward.exact, sent, received)

    def _curvature(self, legs: Legs, side: Any, weights: Weights, *, monostatic: bool) -> Any:
        """Return the curvature term of the weights, over the coefficient common to all. [-]."""
        mean, normals = side * mi.Vector3d(self.mean), side * mi.Vector3d(self.normals)
        upright = dr.dot(mean, normals)
        slope = mean - normals / dr.maximum(upright, 1e-6)
        permittivity = Complex2d(weights.permittivity.real, weights.permittivity.imag)
        kernel = scattering_kernel(weights.material, legs, permittivity)
        share = 0.0 if weights.share is None else weights.share
        added = upright * curvature_weight(kernel, legs, mean, slope, share)
        if isinstance(weights.material, Conductor):
            return mi.Float(added)
        mirror = 1.0 / half_space_mirror(weights.permittivity) if monostatic else 1.0 + 0j
        # The kernel's sign is that of a coefficient of -1.
        added = added * Complex2d(-mirror.real, -mirror.imag)
        return Complex2f(mi.Float(added.real), mi.Float(added.imag))

    def _leg(self, end: Float[np.ndarray, " 3"]) -> "_Leg":
        # An opaque value, not a literal: one compiled kernel serves all links.
        towards = [
            dr.opaque(mi.Float64, float(place)) - axis
            for place, axis in zip(end, self.centres, strict=True)
        ]
        distance = dr.sqrt(towards[0] ** 2 + towards[1] ** 2 + towards[2] ** 2)
        exact = mi.Vector3d(*(axis / distance for axis in towards))
        direction = mi.Vector3f(exact)
        return _Leg(distance, exact, direction, dr.dot(direction, self.normals))


@dataclass(frozen=True)
class _Leg:
    distance: Any
    exact: Any
    direction: Any
    cosine: Any


def sum_links(
    kernel: FacetKernel,
    pairs: list[Pair],
    weights: Callable[[int], Weights],
    total: FrequencySum,
    *,
    monostatic: bool,
    advance: Callable[[], None] = lambda: None,
) -> Complex[np.ndarray, "links freqs"]:
    """Sum the facets of each link; kernels run one after the other, beside sums on other cores.

    Parameters
    ----------
    kernel
        The facets.
    pairs
        Transmitter and receiver of each link.
    weights
        Of each link's facets.
    total
        The sum over the band.
    monostatic
        Whether both ends of each pair are the same position.
    advance
        Called after each link.

    Returns
    -------
    The sums, of a conductor's facets; :math:`j` times them is the S-parameter. [-]
    """
    workers = max(1, min(engine.thread_count(), os.cpu_count() or 1))
    rows: list[Complex[np.ndarray, " freqs"]] = []
    waiting: list[Future[Complex[np.ndarray, " freqs"]]] = []

    def finished(most: int) -> Iterator[Complex[np.ndarray, " freqs"]]:
        while len(waiting) > most:
            yield waiting.pop(0).result()
            advance()

    with ThreadPoolExecutor(workers) as pool:
        for index, pair in enumerate(pairs):
            phases, terms = kernel.link(pair, weights(index), total, monostatic=monostatic)
            waiting.append(pool.submit(_sum, total, phases, terms))
            rows += finished(workers + WAITING)
        rows += finished(0)
    return np.stack(rows)


def _sum(
    total: FrequencySum,
    phases: Float[np.ndarray, " facets"],
    parts: list[Float[np.ndarray, " facets"]],
) -> Complex[np.ndarray, " freqs"]:
    terms = np.empty((total.nodes.size, phases.size), dtype=np.complex128)
    for row in range(total.nodes.size):
        terms[row].real, terms[row].imag = parts[2 * row], parts[2 * row + 1]
    return total.transform(phases, terms)


def _single(vectors: Float[np.ndarray, "facets 3"]) -> Any:
    return mi.Vector3f(*(mi.Float(axis.astype(np.float32)) for axis in vectors.T))
