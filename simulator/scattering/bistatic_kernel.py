"""Bistatic links over millions of triangles, at few frequencies.

The same physical optics as :mod:`simulator.scattering.physical_optics`, of conductors and
dielectrics: one kernel computes facets' contributions, at each frequency separately, and sums them
in blocks of a fixed size, so that the result does not depend on the number of threads. Antenna
patterns and reflection coefficients are read from tables. Lengths and phases are in double
precision, amplitudes in single.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from jaxtyping import Bool, Complex, Float, Float32
from scipy.constants import speed_of_light

from estimator.compute import engine
from scenes.realisations.object_surface import Surface
from scenes.schema.antenna import Antenna, Isotropic
from scenes.surfaces.height_synthesis import slope_share
from simulator.antennas.field_pattern import field_gain
from simulator.antennas.polarization import VERTICAL, Polarization, field_vector
from simulator.geometry.facets import SMOOTHED, is_rough
from simulator.materials.facet_reflection import Legs, mirror_shares
from simulator.materials.fresnel_slab import Conductor, Material, reflection
from simulator.scattering.triangle_transform import triangle_transform
from simulator.scattering.weighted_curvature_3d import (
    curvature_weight,
    middle_permittivity,
    scattering_kernel,
)

mi.set_variant(engine.mitsuba_variant())

Complex2f: Any = mi.Complex2f
Complex2d: Any = mi.Complex2d

FREQUENCIES_AT_ONCE = 8
"""Frequencies in one kernel: it compiles in a second, and reads the facets once for all. [-]"""

BLOCK = 1024
"""Facets summed in single precision; the sums of such blocks are added in double. [-]"""

PATTERN_STEPS = 2**16
"""Steps of a pattern's table: the error for a beam of a degree is 1e-5 of its peak. [-]"""

TABLE_ACCURACY = 1e-5
"""Largest error of a coefficient half way between two angles of its table. [-]"""

MOST_ANGLES = 2**15
"""Most angles of a table. Within a degree of grazing, the fastest ripples of a slab of low loss
are then not resolved. [-]"""


@dataclass(frozen=True, kw_only=True)
class Port:
    """One antenna at one end of a link."""

    position: Float[np.ndarray, " 3"]  # [m]
    aim: Float[np.ndarray, " 3"]  # unit vector
    pattern: Float32[np.ndarray, " steps"] | None  # over sin(ψ/2), ψ off the aim; None: 1
    polarization: Polarization = VERTICAL

    @cached_property
    def at_most(self) -> Float32[np.ndarray, " steps"]:
        """Largest field gain at that angle off the aim or farther, over the peak. [-]."""
        if self.pattern is None:
            return np.ones(1, dtype=np.float32)
        falling = np.maximum.accumulate(self.pattern[::-1])[::-1]
        return np.asarray(falling / falling[0], dtype=np.float32)

    def bound(self, centre: Float[np.ndarray, " 3"], radius: float) -> float:
        """Upper bound of the field gain over a sphere, relative to the peak. [-]."""
        towards = centre - self.position
        distance = float(np.linalg.norm(towards))
        if radius >= distance:
            return 1.0
        off = 2.0 * math.asin(min(1.0, float(np.linalg.norm(towards / distance - self.aim)) / 2))
        nearest = max(0.0, off - math.asin(radius / distance))
        step = int(math.sin(nearest / 2) * (len(self.at_most) - 1))
        return float(self.at_most[step])


def pattern_table(antenna: Antenna) -> Float32[np.ndarray, " steps"] | None:
    """Tabulate an antenna's field gain over sin(ψ/2), ψ the angle off its aim; None: 1."""
    if isinstance(antenna, Isotropic):
        return None
    angles = 2.0 * np.arcsin(np.linspace(0.0, 1.0, PATTERN_STEPS))
    directions = np.stack([np.sin(angles), 0 * angles, np.cos(angles)], axis=-1)
    gains = field_gain(antenna, np.array([0.0, 0.0, 1.0]), directions)
    return np.asarray(gains, dtype=np.float32)


class BistaticKernel:
    """Triangles of one surface in the kernel's arrays, and the sum over them."""

    def __init__(
        self, surface: Surface, material: Material, frequencies: Float[np.ndarray, " freqs"]
    ) -> None:
        if surface.cells.shape[1] != 3:
            raise ValueError(
                f"surface {surface.name!r} is made of lines; the kernel sums triangles"
            )
        self.count = len(surface.cells)
        self._short = -self.count % BLOCK  # the last block is padded with facets of size 0
        corners = [
            mi.Vector3d(*(dr.gather(mi.Float64, axis, index) for axis in _axes(surface.vertices)))
            for index in (mi.UInt32(_padded(c, self._short)) for c in surface.cells.T)
        ]
        edges = [corner - corners[0] for corner in corners[1:]]
        across = dr.cross(*edges)
        doubled = dr.norm(across)
        self._centres = (corners[0] + corners[1] + corners[2]) / 3.0
        self._normals = mi.Vector3f(across / doubled)
        self._edges = [mi.Vector3f(edge) for edge in edges]
        self._sizes = mi.Float(doubled * 0.5)
        filled = dr.arange(mi.UInt32, self.count + self._short) < self.count
        self._sizes = dr.select(filled, self._sizes, 0.0)
        self._two_sided = mi.Bool(not surface.closed)
        dr.eval(self._centres, self._normals, self._edges, self._sizes)
        self._frequencies, self._material = frequencies, material
        start, stop = float(frequencies.min()), float(frequencies.max())
        self._permittivity = middle_permittivity(material, start, stop)
        self._share: float | None = None
        self._mean: Any = None
        if is_rough(surface):
            wavelength = 2 * speed_of_light / (start + stop)
            self._share = slope_share(surface.roughness, SMOOTHED * wavelength)
            self._mean = self._mean_normals(surface)
        self._tables = (
            None
            if isinstance(material, Conductor)
            else [mi.Float(row.ravel()) for row in reflection_rows(material, frequencies)]
        )

    def link(
        self,
        transmit: Port,
        receive: Port,
        lit: Bool[np.ndarray, " facets"] | None = None,
    ) -> Complex[np.ndarray, " freqs"]:
        """Sum one link's facets.

        Parameters
        ----------
        transmit, receive
            Both ends.
        lit
            Which facets both ends see; None: all.

        Returns
        -------
        S-parameter at each frequency. [-]
        """
        seen = None if lit is None else mi.Bool(_padded(lit, self._short))
        sums = [
            self._some(transmit, receive, seen, range(first, min(first + step, count)))
            for count, step in [(len(self._frequencies), FREQUENCIES_AT_ONCE)]
            for first in range(0, count, step)
        ]
        return np.asarray(1j * np.concatenate(sums))

    def _some(
        self, transmit: Port, receive: Port, seen: Any, rows: range
    ) -> Complex[np.ndarray, " some"]:
        one, other = self._leg(transmit), self._leg(receive)
        length = one.distance + other.distance
        facing = one.cosine, other.cosine
        if self._mean is not None:
            facing = dr.dot(one.direction, self._mean), dr.dot(other.direction, self._mean)
        lit = (facing[0] * facing[1] > 0) & (self._two_sided | (facing[0] > 0))
        if seen is not None:
            lit &= seen
        product = mi.Float(one.distance) * mi.Float(other.distance)
        amplitude = self._sizes / (8 * math.pi * product)
        for end in (one, other):
            if end.gain is not None:
                amplitude *= end.gain
        amplitude = dr.select(lit, amplitude, 0.0)
        both = one.direction + other.direction
        first, second = (dr.dot(both, edge) for edge in self._edges)
        legs = Legs(one.exact, other.exact, one.field, other.field)
        shares = mirror_shares(legs)
        te, tm = mi.Float(shares.te), mi.Float(shares.tm)
        side = dr.select(facing[0] > 0, mi.Float(1.0), mi.Float(-1.0))
        oblique = side * (one.cosine + other.cosine)
        extra = None if self._mean is None else self._curvature(legs, side)
        half_angle = dr.minimum(mi.Float(0.5 * dr.norm(mi.Vector3d(both))), 1.0)
        terms = []
        for row in rows:
            per_metre = float(self._frequencies[row]) / speed_of_light
            turns = length * dr.opaque(mi.Float64, per_metre)
            sine, cosine = dr.sincos(mi.Float(turns - dr.round(turns)) * (-2 * math.pi))
            wave = dr.opaque(mi.Float, 2 * math.pi * per_metre)
            re, im = triangle_transform(wave * first, wave * second)
            re, im = re * cosine - im * sine, re * sine + im * cosine
            if self._tables is None:
                turned = oblique * (tm - te) if extra is None else oblique * (tm - te) + extra
                terms += [amplitude * turned * re, amplitude * turned * im]
            else:
                mirror = _interpolated(self._tables[row], half_angle)
                g_re = oblique * (te * mirror[0] + tm * mirror[2])
                g_im = oblique * (te * mirror[1] + tm * mirror[3])
                if extra is not None:
                    g_re, g_im = g_re + extra.real, g_im + extra.imag
                g_re, g_im = amplitude * g_re, amplitude * g_im
                terms += [g_re * re - g_im * im, g_re * im + g_im * re]
        dr.eval(*terms)  # together: one kernel
        parts = [
            float(np.sum(dr.block_sum(term, BLOCK).numpy(), dtype=np.float64)) for term in terms
        ]
        return np.array(parts[::2]) + 1j * np.array(parts[1::2])

    def _leg(self, port: Port) -> "_Leg":
        # An opaque value, not a literal: one compiled kernel serves all links.
        towards = [
            dr.opaque(mi.Float64, float(place)) - axis
            for place, axis in zip(port.position, self._centres, strict=True)
        ]
        distance = dr.sqrt(towards[0] ** 2 + towards[1] ** 2 + towards[2] ** 2)
        exact = mi.Vector3d(*(axis / distance for axis in towards))
        direction = mi.Vector3f(exact)
        gain = None
        if port.pattern is not None:
            aim = mi.Vector3d(*(dr.opaque(mi.Float64, float(value)) for value in port.aim))
            place = mi.Float(dr.norm(-exact - aim)) * (0.5 * (len(port.pattern) - 1))
            gain = _lookup(mi.Float(port.pattern), place, len(port.pattern))
        axis = mi.Vector3d(*(dr.opaque(mi.Float64, float(a)) for a in port.polarization.axis))
        vector = field_vector(exact, axis, port.polarization.cross_polar)
        return _Leg(distance, exact, direction, dr.dot(direction, self._normals), gain, vector)

    def _mean_normals(self, surface: Surface) -> Any:
        corners = [
            mi.Vector3d(
                *(dr.gather(mi.Float64, axis, index) for axis in _axes(surface.mean_vertices))
            )
            for index in (mi.UInt32(_padded(c, self._short)) for c in surface.cells.T)
        ]
        across = dr.cross(corners[1] - corners[0], corners[2] - corners[0])
        normals = mi.Vector3f(across / dr.norm(across))
        dr.eval(normals)
        return normals

    def _curvature(self, legs: Legs, side: Any) -> Any:
        """Return the curvature term of the facets' weights; complex for a dielectric. [-]."""
        mean, normals = side * mi.Vector3d(self._mean), side * mi.Vector3d(self._normals)
        upright = dr.dot(mean, normals)
        slope = mean - normals / dr.maximum(upright, 1e-6)
        permittivity = Complex2d(self._permittivity.real, self._permittivity.imag)
        kernel = scattering_kernel(self._material, legs, permittivity)
        share = 0.0 if self._share is None else self._share
        added = upright * curvature_weight(kernel, legs, mean, slope, share)
        if isinstance(self._material, Conductor):
            return mi.Float(added)
        return Complex2f(mi.Float(added.real), mi.Float(added.imag))


@dataclass(frozen=True)
class _Leg:
    distance: Any
    exact: Any
    direction: Any
    cosine: Any
    gain: Any
    field: Any


def reflection_rows(
    material: Material, frequencies: Float[np.ndarray, " freqs"]
) -> Float32[np.ndarray, "freqs angles 4"]:
    """Tabulate a material's coefficients over the cosine of incidence, evenly from 0 to 1.

    Parameters
    ----------
    material
        Of the surface.
    frequencies
        Any grid. [Hz]

    Returns
    -------
    Real and imaginary part of TE, then of TM, at the fewest angles for which the error is below
    :data:`TABLE_ACCURACY`. [-]
    """
    angles = 64
    while angles < MOST_ANGLES:
        exact = np.stack(reflection(material, frequencies, np.linspace(0.0, 1.0, 2 * angles + 1)))
        between = (exact[:, :-1:2] + exact[:, 2::2]) / 2
        if float(np.abs(between - exact[:, 1::2]).max()) <= TABLE_ACCURACY:
            break
        angles *= 2
    both = reflection(material, frequencies, np.linspace(0.0, 1.0, angles + 1))
    parts = [both.te.real, both.te.imag, both.tm.real, both.tm.imag]
    return np.ascontiguousarray(np.stack(parts, axis=-1).swapaxes(0, 1), dtype=np.float32)


def _interpolated(table: Any, cosine: Any) -> Any:
    last = dr.width(table) // 4 - 1
    place = cosine * last
    below = dr.minimum(mi.UInt32(place), last - 1)
    low, high = (dr.gather(mi.Vector4f, table, below + step) for step in (0, 1))
    return low + (high - low) * (place - mi.Float(below))


def _lookup(table: Any, place: Any, count: int) -> Any:
    below = dr.minimum(mi.UInt32(place), count - 2)
    low, high = (dr.gather(mi.Float, table, below + step) for step in (0, 1))
    return low + (high - low) * (place - mi.Float(below))


def _padded(values: np.ndarray, short: int) -> np.ndarray:
    return np.ascontiguousarray(np.pad(values, (0, short), mode="edge"))


def _axes(points: Float[np.ndarray, "n 3"]) -> list[Any]:
    return [mi.Float64(np.ascontiguousarray(axis)) for axis in points.T]
