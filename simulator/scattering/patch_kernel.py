r"""Kernel that sums each patch of triangles at a few frequencies, between given positions.

The same physical optics as :mod:`simulator.scattering.physical_optics`, relative to the patch's
centre: with the vectors :math:`\mathbf a` from the centre to an antenna, and
:math:`\boldsymbol\rho` from the centre to a triangle,

.. math:: |\mathbf a - \boldsymbol\rho| - |\mathbf a| =
          \frac{\rho^2 - 2\,\mathbf a \cdot \boldsymbol\rho}
          {|\mathbf a - \boldsymbol\rho| + |\mathbf a|}

which has an error of some nanometres in single precision. One lane sums one patch for one link,
triangle by triangle: the result does not depend on the number of threads.
"""

import math
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from jaxtyping import Bool, Complex64, Float
from scipy.constants import speed_of_light

from estimator.compute import engine
from simulator.antennas.antenna_pattern import AntennaPattern
from simulator.antennas.links import Links
from simulator.antennas.polarization import field_vector
from simulator.geometry.patches import Patches
from simulator.materials.facet_reflection import Legs, conductor_mirror, mirror_shares
from simulator.materials.fresnel_slab import Conductor, Material, reflection
from simulator.numerics.nufft_sum import chebyshev_nodes, lagrange_basis
from simulator.scattering.triangle_transform import triangle_transform
from simulator.scattering.weighted_curvature_3d import (
    curvature_weight,
    half_space_mirror,
    middle_permittivity,
    scattering_kernel,
)

mi.set_variant(engine.mitsuba_variant())

Complex2f: Any = mi.Complex2f


SHAPE_NODES = 3
"""Frequencies at which a triangle's transform is evaluated; between, it is a parabola. [-]"""

ANGLES = 2048
"""Cosines of incidence at which a dielectric's coefficients are tabulated. [-]"""


class PatchKernel:
    """Patches in the kernel's arrays, and the sums over them."""

    def __init__(
        self,
        patches: Patches,
        material: Material,
        nodes: Float[np.ndarray, " nodes"],
        *,
        share: float | None = None,
    ) -> None:
        self.patches, self.material, self.nodes = patches, material, nodes
        self.share = share if patches.mean is not None else None  # None: they are smooth
        self.first = mi.UInt32(patches.first.astype(np.uint32))
        values = [patches.offsets, patches.edges.reshape(-1, 6)]
        if self.share is not None and patches.mean is not None:
            values.append(patches.mean)
        self.values = mi.Float(np.concatenate(values, axis=-1).ravel())
        self.stride = 3 * (1 + len(values))
        self.permittivity = middle_permittivity(material, float(nodes.min()), float(nodes.max()))
        self.one_sided = mi.Bool(patches.one_sided)
        self.all_two_sided = not patches.one_sided.any()
        self.centres = [mi.Float64(np.ascontiguousarray(axis)) for axis in patches.centres.T]
        few = chebyshev_nodes(float(nodes.min()), float(nodes.max()), SHAPE_NODES)
        if nodes.size < SHAPE_NODES or nodes.max() == nodes.min():
            few = nodes[:1] if nodes.max() == nodes.min() else nodes
        self.few, self.basis = few, lagrange_basis(few, nodes)
        self.table: Any = None

    def __call__(
        self, links: Links, mask: Bool[np.ndarray, "facets links"] | None = None
    ) -> Complex64[np.ndarray, "patches links nodes"]:
        """Sum each patch for each link, relative to the delay of its centre.

        Multiplied by :math:`j` it is the S-parameter; monostatic echoes of a dielectric are without
        its reflection coefficient at normal incidence, those of a conductor with it.

        Parameters
        ----------
        links
            The links.
        mask
            Which triangles each link sees, in the patches' order; None: all.
        """
        count, patches = len(links.receivers), self.patches.count
        lane = dr.arange(mi.UInt32, count * patches)
        patch = lane // count
        link = lane - patch * count
        centre = [dr.gather(mi.Float64, axis, patch) for axis in self.centres]
        inward = _End(links.senders, links.sent, link, centre)
        outward = inward if links.echo else _End(links.receivers, links.received, link, centre)
        reflector = self._reflector(inward, outward, echo=links.echo)
        seen = None if mask is None else mi.Bool(np.ascontiguousarray(mask).ravel())
        start = dr.gather(mi.UInt32, self.first, patch)
        stop = dr.gather(mi.UInt32, self.first, patch + 1)
        size = self.nodes.size

        def body(index: Any, *sums: Any) -> tuple[Any, ...]:
            at = index * self.stride
            offset, one, other = (
                mi.Vector3f(*(dr.gather(mi.Float, self.values, at + k + axis) for axis in range(3)))
                for k in (0, 3, 6)
            )
            across = 0.5 * dr.cross(one, other)
            first = inward.leg(offset)
            second = first if links.echo else outward.leg(offset)
            mean: Any = across  # its side that faces both ends is illuminated
            if self.share is not None:
                mean = mi.Vector3f(
                    *(dr.gather(mi.Float, self.values, at + 9 + axis) for axis in range(3))
                )
            here, there = dr.dot(first.direction, mean), dr.dot(second.direction, mean)
            lit = here * there > 0
            if not self.all_two_sided:
                lit &= (here > 0) | ~dr.gather(mi.Bool, self.one_sided, index)
            if seen is not None:
                lit &= dr.gather(mi.Bool, seen, index * count + link)
            amplitude = 1.0 / (8 * math.pi * first.distance * second.distance)
            amplitude *= inward.gain(first.direction)
            amplitude *= outward.gain(second.direction)
            both = first.direction + second.direction
            amplitude = dr.select(lit, amplitude, 0.0)
            shapes = self._shapes(dr.dot(both, one), dr.dot(both, other))
            phasors = self._phasors(first.longer + second.longer)
            legs = self._legs(inward, outward, first.direction, second.direction)
            coefficients = reflector(legs)
            oblique, extra = dr.abs(here + there), None
            if self.share is not None:
                side = dr.select(here > 0, mi.Float(1.0), mi.Float(-1.0))
                oblique = side * dr.dot(both, across)
                extra = self._curvature(legs, side, (mean, across), echo=links.echo)
            new = []
            for node in range(size):
                re, im = _product(shapes[node], phasors[node])
                gamma = coefficients if isinstance(coefficients, _Real) else coefficients[node]
                weight = _weighed(gamma, oblique, extra)
                if isinstance(weight, _Real):
                    re, im = re * weight.value, im * weight.value
                else:
                    re, im = _product((re, im), weight)
                new += [sums[2 * node] + amplitude * re, sums[2 * node + 1] + amplitude * im]
            return index + 1, *new

        zeros = [dr.zeros(mi.Float, count * patches) for _ in range(2 * size)]
        loop: Any = dr.while_loop
        state = loop(
            state=(start, *zeros),
            cond=lambda index, *sums: index < stop,
            body=body,
            compress=False,
        )
        dr.eval(*state[1:])
        result = np.empty((patches, count, size), dtype=np.complex64)
        for node in range(size):
            re, im = state[1 + 2 * node].numpy(), state[2 + 2 * node].numpy()
            result[..., node].real = re.reshape(patches, count)
            result[..., node].imag = im.reshape(patches, count)
        return result

    def _shapes(self, first: Any, second: Any) -> list[Any]:
        """Transform of a triangle at all nodes, interpolated from :data:`SHAPE_NODES`."""
        exact = []
        for node in self.few:
            wave = dr.opaque(mi.Float, 2 * math.pi * float(node) / speed_of_light)
            exact.append(triangle_transform(wave * first, wave * second))
        if self.few is self.nodes:
            return exact
        shapes = []
        for node in range(self.nodes.size):
            weights = [dr.opaque(mi.Float, float(w)) for w in self.basis[:, node]]
            shapes.append(
                tuple(
                    sum(w * part[k] for w, part in zip(weights, exact, strict=True)) for k in (0, 1)
                )
            )
        return shapes

    def _phasors(self, longer: Any) -> list[Any]:
        """Phase factors of the difference of length to the patch's centre, at all nodes.

        Chebyshev nodes are in pairs, symmetric about their middle.
        """
        middle = 0.5 * (self.nodes[0] + self.nodes[-1])
        scale = 2 * math.pi / speed_of_light
        carrier = _turned(longer * dr.opaque(mi.Float, scale * float(middle)))
        size = self.nodes.size
        phasors: list[Any] = [carrier] * size
        for node in range(size // 2):
            apart = 0.5 * float(self.nodes[size - 1 - node] - self.nodes[node])
            re, im = _turned(longer * dr.opaque(mi.Float, scale * apart))
            phasors[size - 1 - node] = _product(carrier, (re, im))
            phasors[node] = _product(carrier, (re, -im))
        return phasors

    def _reflector(self, inward: "_End", outward: "_End", *, echo: bool) -> Any:
        """Return the function of both directions that gives a triangle's coefficients."""
        if echo:
            constant = _Real(mi.Float(-1.0 if isinstance(self.material, Conductor) else 1.0))
            return lambda legs: constant
        if isinstance(self.material, Conductor):
            return lambda legs: _Real(conductor_mirror(legs))
        middle = mi.Float(_half_angle_cosine(inward.towards_centre(), outward.towards_centre()))
        te_and_tm = self._tabulated(middle)

        def dielectric(legs: Legs) -> list[Any]:
            shares = mirror_shares(legs)
            apart = _half_angle_cosine(legs.transmit, legs.receive) - middle
            gammas = []
            for node in range(self.nodes.size):
                parts = [0.0, 0.0]
                for share, table in zip(shares, te_and_tm, strict=True):
                    for k in (0, 1):
                        value, slope = table[node][k]
                        parts[k] += share * (value + slope * apart)
                gammas.append(tuple(parts))
            return gammas

        return dielectric

    def _legs(self, inward: "_End", outward: "_End", first: Any, second: Any) -> Legs:
        """Both directions with the antennas' fields, which are evaluated only if needed."""
        mirrored = outward is inward
        if mirrored and self.share is None:
            return Legs(first, second, first, second)
        sent = inward.field(first)
        received = sent if mirrored else outward.field(second)
        return Legs(first, second, sent, received)

    def _curvature(self, legs: Legs, side: Any, normals: tuple[Any, Any], *, echo: bool) -> Any:
        """Return the curvature term of a triangle's weight; complex for a dielectric. [m²]."""
        mean, across = (side * normal for normal in normals)
        area = dr.dot(mean, across)
        slope = mean - across / dr.maximum(area, 1e-30)
        permittivity = Complex2f(
            dr.opaque(mi.Float, self.permittivity.real), dr.opaque(mi.Float, self.permittivity.imag)
        )
        kernel = scattering_kernel(self.material, legs, permittivity)
        assert self.share is not None
        weight = area * curvature_weight(kernel, legs, mean, slope, self.share)
        if isinstance(self.material, Conductor):
            return weight
        if echo:  # its coefficient at normal incidence is left out
            mirror = 1.0 / half_space_mirror(self.permittivity)
            weight = weight * Complex2f(
                dr.opaque(mi.Float, mirror.real), dr.opaque(mi.Float, mirror.imag)
            )
        return weight

    def _tabulated(self, cosine: Any) -> list[list[tuple[Any, Any]]]:
        """Return the coefficients at a cosine, and their derivatives, by cubic interpolation."""
        if self.table is None:
            cosines = np.linspace(0.0, 1.0, ANGLES + 1)
            values = reflection(self.material, self.nodes, cosines)
            self.table = [
                [
                    [mi.Float(np.ascontiguousarray(part).astype(np.float32)) for part in pair]
                    for pair in ((v.real, v.imag) for v in np.ascontiguousarray(kind.T))
                ]
                for kind in values
            ]
        place = cosine * ANGLES
        below = dr.clip(mi.UInt32(place), 1, ANGLES - 2)
        share = place - mi.Float(below)
        found = []
        for kind in self.table:
            rows = []
            for pair in kind:
                row = []
                for part in pair:
                    a, b, c, d = (dr.gather(mi.Float, part, below - 1 + k) for k in range(4))
                    m0, m1 = 0.5 * (c - a), 0.5 * (d - b)
                    p2, p3 = 3 * (c - b) - 2 * m0 - m1, 2 * (b - c) + m0 + m1
                    value = b + share * (m0 + share * (p2 + share * p3))
                    slope = (m0 + share * (2 * p2 + 3 * share * p3)) * ANGLES
                    row.append((value, slope))
                rows.append((row[0], row[1]))
            found.append(rows)
        return found


@dataclass(frozen=True)
class _Real:
    value: Any


@dataclass(frozen=True)
class _Leg:
    direction: Any  # from the triangle to the antenna
    distance: Any
    longer: Any  # distance less that from the patch's centre [m]


class _End:
    """One end of the links, relative to the patches' centres."""

    def __init__(
        self, places: Float[np.ndarray, "links 3"], pattern: AntennaPattern, link: Any, centre: Any
    ) -> None:
        axes = [mi.Float64(np.ascontiguousarray(axis)) for axis in places.T]
        apart = [
            dr.gather(mi.Float64, axis, link) - c for axis, c in zip(axes, centre, strict=True)
        ]
        distance = dr.sqrt(apart[0] ** 2 + apart[1] ** 2 + apart[2] ** 2)
        self.apart: Any
        self.distance: Any
        self.apart, self.distance = mi.Vector3f(*(mi.Float(a) for a in apart)), mi.Float(distance)
        self.pattern = pattern
        self.axis = mi.Vector3f(*(dr.opaque(mi.Float, float(a)) for a in pattern.polarization.axis))
        self.aim = mi.Vector3f(*(dr.opaque(mi.Float, float(a)) for a in pattern.aim))
        self.peak = dr.opaque(mi.Float, pattern.peak)

    def towards_centre(self) -> Any:
        return self.apart / self.distance

    def leg(self, offset: Any) -> _Leg:
        towards = self.apart - offset
        distance = dr.norm(towards)
        longer = (dr.dot(offset, offset) - 2 * dr.dot(self.apart, offset)) / (
            distance + self.distance
        )
        return _Leg(towards / distance, distance, longer)

    def field(self, direction: Any) -> Any:
        """Vector of the antenna's field at a triangle that sees it in that direction."""
        return field_vector(direction, self.axis, self.pattern.polarization.cross_polar)

    def gain(self, direction: Any) -> Any:
        """Field pattern towards a triangle that sees the antenna in that direction."""
        pattern = self.pattern
        if math.isfinite(pattern.width):
            apart = direction + self.aim
            half = dr.minimum(0.5 * dr.norm(apart), 1.0)
            angle = 2 * dr.asin(half)
            return self.peak * dr.exp(angle * angle * dr.opaque(mi.Float, -0.5 / pattern.width**2))
        if pattern.forward_only:
            cosine = -dr.dot(direction, self.aim)
            power = dr.opaque(mi.Float, pattern.power)
            front = dr.exp(power * dr.log(dr.maximum(cosine, 1e-30)))
            return dr.select(cosine > 0, self.peak * front, 0.0)
        return mi.Float(1.0)


def _turned(phase: Any) -> tuple[Any, Any]:
    sine, cosine = dr.sincos(phase)
    return cosine, -sine


def _product(one: Any, other: Any) -> tuple[Any, Any]:
    return one[0] * other[0] - one[1] * other[1], one[0] * other[1] + one[1] * other[0]


def _weighed(gamma: Any, oblique: Any, extra: Any) -> Any:
    """Weight of a triangle: the tangent plane's and the curvature term."""
    if isinstance(gamma, _Real):
        if extra is None:
            return _Real(gamma.value * oblique)
        if isinstance(extra, Complex2f):
            return (gamma.value * oblique + extra.real, extra.imag)
        return _Real(gamma.value * oblique + extra)
    re, im = gamma[0] * oblique, gamma[1] * oblique
    return (re, im) if extra is None else (re + extra.real, im + extra.imag)


def _half_angle_cosine(first: Any, second: Any) -> Any:
    return dr.minimum(0.5 * dr.norm(first + second), 1.0)
