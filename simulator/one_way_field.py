r"""The field that antennas send to the facets of one surface over the facets of another.

Line facets (2-D). With the free-space link of a line source, :math:`G = g_0 e^{-jkr}/\sqrt r`,
:math:`g_0 = e^{-j\pi/4}/\sqrt{8\pi k}`, a field is written :math:`h = g_0 \eta`. A wall's facets
w take a wave onward to the facets q of a target by physical optics, in the reciprocal form,

.. math:: \eta_q = \sqrt{\tfrac{k}{8\pi}}\, e^{j\pi/4} \sum_w \Gamma_w
          (\cos\theta_{in} + \cos\theta_{out})\, \eta_w \frac{e^{-jk r_{wq}}}{\sqrt{r_{wq}}}\, ds_w

so that a long flat mirror returns :math:`\Gamma/\sqrt L` over a path of total length L. Since
each contribution arrives from its own direction, its derivative along the normal, over jk, is
the contribution times the cosine of its angle of incidence: the *slope* of the wave. Both are
what the next surface needs, so that chains of surfaces are made by repetition.

The sum over wall facets is a product of matrices at each frequency. Once the delay of a path
in the middle of the contributions' is taken out, the field varies slowly with frequency.
"""

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Complex, Complex64, Float, Float32, Int
from scipy.constants import speed_of_light
from threadpoolctl import threadpool_limits

from estimator.engine import thread_count
from simulator.facets import Facets
from simulator.materials import Conductor, Material, reflection
from simulator.physical_optics import Ports

FACETS_AT_ONCE = 64
"""Wall facets in one matrix product. Two terms of the obliquity, cosine and sine make 256
columns of it: up to there BLAS adds them up in one order, whatever its number of threads."""

NODES_AT_ONCE = 4
"""Frequencies that share the geometry of a block of facets."""

FACTOR_BYTES = 2**30
"""What the left factors of the matrix products may take in all threads. [byte]"""

GROUP_WIDTH = 1e-3
"""Wall facets are taken together over this length to bound the lengths of paths. [m]"""


@dataclass(frozen=True, kw_only=True)
class Face:
    """One side of a surface of line facets."""

    centres: Float[np.ndarray, "facets 2"]  # [m]
    normals: Float[np.ndarray, "facets 2"]  # unit vectors, to the side that scatters
    sizes: Float[np.ndarray, " facets"]  # what each stands for in a sum over the surface [m]
    edges: Float[np.ndarray, "facets 2"]  # [m]
    source: Int[np.ndarray, " facets"]  # index of each facet in the whole set
    surface: int  # which object the face belongs to
    material: Material

    @property
    def count(self) -> int:
        """Number of facets."""
        return len(self.sizes)

    def part(self, chosen: slice | Int[np.ndarray, " chosen"]) -> "Face":
        """Choose some of the facets."""
        return Face(
            **{
                name: getattr(self, name)[chosen]
                for name in ("centres", "normals", "sizes", "edges", "source")
            },
            surface=self.surface,
            material=self.material,
        )


@dataclass(frozen=True, kw_only=True)
class Wave:
    """Field of ports at the facets of a face; zero where nothing arrives.

    The delay of :attr:`middle` is taken out of it.
    """

    strength: Complex64[np.ndarray, "#nodes ports facets"]  # [m^-1/2]
    slope: Complex64[np.ndarray, "#nodes ports facets"]  # derivative along the normal, over jk
    bounds: "Bounds"

    @property
    def middle(self) -> Float[np.ndarray, "ports facets"]:
        """Length whose delay is taken out. [m]."""
        return self.bounds.middle

    def part(self, facets: slice | Int[np.ndarray, " chosen"], port: int) -> "Wave":
        """Choose one port and some facets; a single port's wave serves all ports."""
        row = slice(port, port + 1) if self.strength.shape[1] > 1 else slice(None)
        return Wave(
            strength=self.strength[:, row, facets],
            slope=self.slope[:, row, facets],
            bounds=self.bounds.part(facets, row),
        )


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """Between which lengths lie the paths from ports to the facets of a face."""

    shortest: Float[np.ndarray, "ports facets"]  # 0 where nothing arrives [m]
    longest: Float[np.ndarray, "ports facets"]  # [m]
    origins: Float[np.ndarray, "ports facets 2"]  # where the shortest path comes from [m]

    @property
    def middle(self) -> Float[np.ndarray, "ports facets"]:
        """Length half way between the shortest and the longest. [m]."""
        middle: np.ndarray = (self.shortest + self.longest) / 2
        return middle

    @property
    def spread(self) -> float:
        """Largest difference of lengths at one facet. [m]."""
        return float((self.longest - self.shortest).max(initial=0.0))

    def part(
        self, facets: slice | Int[np.ndarray, " chosen"], ports: slice = slice(None)
    ) -> "Bounds":
        """Choose some of the facets, and of the ports."""
        return Bounds(
            shortest=self.shortest[ports, facets],
            longest=self.longest[ports, facets],
            origins=self.origins[ports, facets],
        )


def two_faces(
    facets: Facets, chosen: Int[np.ndarray, " chosen"], *, surface: int, material: Material
) -> tuple[Face, ...]:
    """Return the sides of a surface that scatter: the outer one, or both of an open surface."""
    sides = (1.0, -1.0) if bool(facets.two_sided[chosen].any()) else (1.0,)
    return tuple(
        Face(
            centres=facets.centres[chosen, :2],
            normals=side * facets.normals[chosen, :2],
            sizes=facets.sizes[chosen],
            edges=facets.edges[chosen, 0, :2],
            source=chosen,
            surface=surface,
            material=material,
        )
        for side in sides
    )


def quadrature(face: Face, count: int) -> Face:
    """Replace each facet by the points of its Gauss rule: the phase over it is not constant."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    points = face.centres[:, None] + nodes[:, None] / 2 * face.edges[:, None]
    repeated = face.part(np.repeat(np.arange(face.count), count))
    return Face(
        centres=points.reshape(-1, 2),
        normals=repeated.normals,
        sizes=(face.sizes[:, None] * weights / 2).ravel(),
        edges=repeated.edges,
        source=repeated.source,
        surface=face.surface,
        material=face.material,
    )


def direct(face: Face, ports: Ports, nodes: Float[np.ndarray, " nodes"]) -> Wave:
    """Return the free-space wave of ports at the facets that they see from the front.

    Parameters
    ----------
    face
        Where the wave arrives.
    ports
        Antennas, with the visibility of the whole set of facets.
    nodes
        Frequencies that a pattern which varies over the band is sampled at. [Hz]
    """
    towards = ports.positions[:, None, :2] - face.centres
    distance = np.sqrt(np.einsum("pfx,pfx->pf", towards, towards))
    cosine = np.einsum("pfx,fx->pf", towards, face.normals) / distance
    lit = ports.visible[:, face.source] & (cosine > 0)
    outward = np.zeros((face.count, 3))
    gains = []
    for index in range(len(ports.positions)):
        outward[:, :2] = -towards[index] / distance[index, :, None]
        gains.append(ports.pattern(outward, distance[index], nodes))
    gain = np.stack(gains, axis=1)
    strength = (gain * np.where(lit, 1 / np.sqrt(distance), 0.0)).astype(np.complex64)
    length = np.where(lit, distance, 0.0)
    origins = np.broadcast_to(ports.positions[:, None, :2], towards.shape)
    return Wave(
        strength=strength,
        slope=strength * cosine.astype(np.float32),
        bounds=Bounds(shortest=length, longest=length, origins=origins),
    )


def onward_bounds(
    arriving: Bounds, wall: Face, target: Face, seen: Bool[np.ndarray, "wall target"]
) -> Bounds:
    """Bound the lengths of the paths from the ports over a wall to a target's facets.

    Parameters
    ----------
    arriving
        Lengths of the paths to the wall.
    wall, target
        The two faces.
    seen
        Which facets of the wall and of the target see each other.
    """
    firsts = _groups(wall)
    members = np.diff(np.append(firsts, wall.count))
    middles = wall.centres[firsts + members // 2]
    group = np.repeat(np.arange(len(firsts)), members)
    radius = np.zeros(len(firsts))
    np.maximum.at(radius, group, np.linalg.norm(wall.centres - middles[group], axis=-1))
    hidden = ~np.logical_or.reduceat(seen, firsts, axis=0)
    apart = np.linalg.norm(middles[:, None] - target.centres, axis=-1)
    nearest, farthest = apart - radius[:, None], apart + radius[:, None]
    nearest[hidden], farthest[hidden] = np.inf, -np.inf
    lit = arriving.longest > 0
    low = np.minimum.reduceat(np.where(lit, arriving.shortest, np.inf), firsts, axis=1)
    high = np.maximum.reduceat(np.where(lit, arriving.longest, -np.inf), firsts, axis=1)

    def of_port(port: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        lengths = low[port, :, None] + nearest
        first = np.argmin(lengths, axis=0)
        shortest = np.take_along_axis(lengths, first[None], axis=0)[0]
        longest = (high[port, :, None] + farthest).max(axis=0)
        return shortest, longest, middles[first]

    with ThreadPoolExecutor(thread_count()) as pool:
        found = list(pool.map(of_port, range(len(low))))
    shortest, longest, origins = (np.stack(parts) for parts in zip(*found, strict=True))
    arrives = np.isfinite(shortest)
    return Bounds(
        shortest=np.where(arrives, np.maximum(shortest, 0.0), 0.0),
        longest=np.where(arrives, longest, 0.0),
        origins=origins,
    )


def onward(
    wave: Wave,
    wall: Face,
    target: Face,
    seen: Bool[np.ndarray, "wall target"],
    bounds: Bounds,
    nodes: Float[np.ndarray, " nodes"],
) -> Wave:
    """Take a wave from a wall to a target by physical optics on the wall's facets.

    Parameters
    ----------
    wave
        What arrives at the wall: at these nodes, or the same at all frequencies.
    wall, target, seen
        The two faces, and which of their facets see each other.
    bounds
        Lengths of the paths, after :func:`onward_bounds`.
    nodes
        Frequencies. [Hz]
    """
    ports, columns = len(bounds.shortest), target.count
    shape = (nodes.size, ports, columns)
    strength, slope = np.empty(shape, np.complex64), np.empty(shape, np.complex64)
    # The mirror that would lead from the ports to the middle of what is seen of the target.
    towards = target.centres[seen.any(axis=0)].mean(axis=0) if seen.any() else wall.centres[0]
    incidence = half_angle_cosines(wall, wave.bounds.origins, towards)
    blocks = [slice(at, at + FACETS_AT_ONCE) for at in range(0, wall.count, FACETS_AT_ONCE)]

    def some_nodes(first: int) -> None:
        frequencies = nodes[first : first + NODES_AT_ONCE]
        here = slice(first, first + frequencies.size) if len(wave.strength) > 1 else slice(None)
        coefficients = face_coefficients(wall, incidence, frequencies)
        turns = wave.middle * (-frequencies[:, None, None] / speed_of_light)
        reflected = coefficients.astype(np.complex64) * _phasor(turns)
        left = _real_factors(reflected * wave.slope[here], reflected * wave.strength[here])
        total = np.zeros((frequencies.size, 2 * ports, 2 * columns), np.float32)
        for block in blocks:
            distance, weights = _links(wall.part(block), target, seen[block])
            right = np.empty((2, *weights.shape), np.float32)
            for node, frequency in enumerate(frequencies):
                angle = _angle(distance * (frequency / speed_of_light))
                np.multiply(weights, np.cos(angle)[:, None], out=right[0])
                np.multiply(weights, np.sin(angle)[:, None], out=right[1])
                factors = left[node, :, :, :, block].reshape(2 * ports, -1)
                total[node] += factors @ right.reshape(-1, 2 * columns)
        parts = total.reshape(-1, 2, ports, 2, columns)
        for node, frequency in enumerate(frequencies):
            scale = math.sqrt(frequency / (4 * speed_of_light)) * np.exp(0.25j * np.pi)
            turned = _phasor(bounds.middle * (frequency / speed_of_light)) * np.complex64(scale)
            real, imaginary = parts[node]
            strength[first + node] = turned * (real[:, 0] + 1j * imaginary[:, 0])
            slope[first + node] = turned * (real[:, 1] + 1j * imaginary[:, 1])

    needed = 32 * NODES_AT_ONCE * ports * wall.count
    workers = max(1, min(thread_count(), FACTOR_BYTES // needed))
    # BLAS threads of their own would spin against these: up to 20 times slower.
    with threadpool_limits(limits=1, user_api="blas"), ThreadPoolExecutor(workers) as pool:
        list(pool.map(some_nodes, range(0, nodes.size, NODES_AT_ONCE)))
    return Wave(strength=strength, slope=slope, bounds=bounds)


def _real_factors(
    slope: Complex64[np.ndarray, "nodes ports wall"],
    strength: Complex64[np.ndarray, "nodes ports wall"],
) -> Float32[np.ndarray, "nodes rows 2 2 wall"]:
    """Arrange what multiplies the cosines and the sines of the links' phases.

    Rows: the real parts of all ports, then the imaginary parts. A real product of matrices
    spares the links, which are many, from being made complex.
    """
    both = np.stack([slope, strength], axis=2)
    real = np.stack([both.real, both.imag], axis=2)
    imaginary = np.stack([both.imag, -both.real], axis=2)
    return np.concatenate([real, imaginary], axis=1)


def half_angle_cosines(
    face: Face,
    one: Float[np.ndarray, "#ports #facets 2"] | Float[np.ndarray, " 2"],
    other: Float[np.ndarray, "#ports #facets 2"] | Float[np.ndarray, " 2"],
) -> Float[np.ndarray, "ports facets"]:
    """Cosines of half the angle at each facet between the ways to two points. [-]."""
    both = unit(one - face.centres) + unit(other - face.centres)
    return np.asarray(np.minimum(np.hypot(both[..., 0], both[..., 1]) / 2, 1.0))


def face_coefficients(
    face: Face, cosines: Float[np.ndarray, "ports facets"], frequencies: Float[np.ndarray, " nodes"]
) -> Float[np.ndarray, "1 1 1"] | Complex[np.ndarray, "nodes ports facets"]:
    """Reflection coefficients of the field along z at some angles of incidence. [-]."""
    if isinstance(face.material, Conductor):
        return np.full((1, 1, 1), -1.0)
    return np.moveaxis(reflection(face.material, frequencies, cosines).te, -1, 0)


def unit(vectors: Float[np.ndarray, "*n 2"]) -> Float[np.ndarray, "*n 2"]:
    """Return vectors of length 1 in the same directions."""
    unit: np.ndarray = vectors / np.hypot(vectors[..., :1], vectors[..., 1:])
    return unit


def _links(
    wall: Face, target: Face, seen: Bool[np.ndarray, "wall target"]
) -> tuple[Float[np.ndarray, "wall target"], Float32[np.ndarray, "2 wall 2 target"]]:
    """Distances, and weights of each pair: (1, cosine at wall), wall, (1, at target), target."""
    x, y = (target.centres[:, axis] - wall.centres[:, None, axis] for axis in (0, 1))
    # Facets that touch have no distance, and no far field either.
    distance = np.maximum(np.sqrt(x * x + y * y), wall.sizes[:, None] / 2)
    # Amplitudes do in single precision; the phase is another matter.
    x, y, near = (values.astype(np.float32) for values in (x, y, 1 / distance))
    sizes, out, into = (
        values.astype(np.float32) for values in (wall.sizes, wall.normals, target.normals)
    )
    weights = np.empty((2, wall.count, 2, target.count), np.float32)
    weights[0, :, 0] = seen * sizes[:, None] * np.sqrt(near)
    weights[0, :, 1] = weights[0, :, 0] * near * -(x * into[:, 0] + y * into[:, 1])
    leaves = near * (x * out[:, :1] + y * out[:, 1:])
    np.multiply(weights[0], leaves[:, None], out=weights[1])
    return distance, weights


def _angle(turns: Float[np.ndarray, "*n"]) -> Float32[np.ndarray, "*n"]:
    """Return an angle in radians; whole turns, of which there are thousands, go first."""
    return np.asarray((turns - np.rint(turns)) * (2 * np.pi), dtype=np.float32)


def _phasor(turns: Float[np.ndarray, "*n"]) -> Complex64[np.ndarray, "*n"]:
    """Return exp(j2π·turns)."""
    angle = _angle(turns)
    phasor = np.empty(angle.shape, np.complex64)
    np.cos(angle, out=phasor.real)
    np.sin(angle, out=phasor.imag)
    return phasor


def _groups(wall: Face) -> np.ndarray:
    """First facets of runs of neighbours that are about :data:`GROUP_WIDTH` long."""
    steps = np.linalg.norm(np.diff(wall.centres, axis=0), axis=-1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    return np.unique(along // GROUP_WIDTH, return_index=True)[1]
