r"""Scattering by rough lines: Voronovich's small-slope approximation of second order.

Along the mean course of a line, with heights h and unit vectors :math:`\hat s_i, \hat s_s` from it
to both antennas, let t be their components along the line, q those along its normal, :math:`Q = q_i
+ q_s`; wavenumbers are over k. The line scatters as facets do,

.. math:: \frac{jk}{\lambda} \int N\, e^{jkQ h}\, h_i h_s\, dx, \qquad
          N = \frac{2 B}{Q} + jk\, (E * h)

in place of :math:`\Gamma (\cos\theta_i + \cos\theta_s)`. B is the kernel of perturbation theory
of first order (Bragg scattering); E corrects the second-order term of :math:`e^{jkQh}` to that of
second-order perturbation theory. It acts on the heights as a filter, and describes double
scattering by waves along the surface: the coherent loss of short-waved roughness with its phase,
and grazing incidence, where tangent planes would shadow each other. With p the intermediate
wavenumber of double scattering, :math:`q(p) = \sqrt{1 - p^2}`, evanescent waves included,

=========================  =======================================================================
conductor, vertical        :math:`B = -2 q_i q_s, \quad
                           \hat E(\xi) = \frac{B}{Q} [q(t_i+\xi) + q(t_s+\xi) - Q]`
conductor, horizontal      :math:`B = 2 (1 + t_i t_s), \quad \hat E(\xi) = \frac{2}{Q} \bigl[
                           \frac{(1 - t_i p)(1 + t_s p)}{q(p) + Z(p)}\Big|_{p = t_i + \xi} + (i
                           \leftrightarrow s) \bigr] - B`
dielectric, vertical       :math:`B = -\tfrac12 (\varepsilon-1)(1+R_i)(1+R_s), \quad \hat E(\xi) =
                           \frac{B}{Q} [\gamma(t_i+\xi) + \gamma(t_s+\xi) + q'(t_i) + q'(t_s) - Q]`
dielectric, horizontal     :math:`B = \tfrac12 [(\varepsilon-1) q_i q_s (1-R_i)(1-R_s) -
                           (\tfrac1\varepsilon - 1)\, t_i t_s (1+R_i)(1+R_s)], \quad E = 0`
=========================  =======================================================================

with :math:`q'(p) = \sqrt{\varepsilon - p^2}` and :math:`\gamma = q - q'`. "Vertical" is the
electric field along z (TM of the cross-section, TE of the plane of incidence). B of a conductor and
E of both verticals follow [1]_, [2]_; all were derived anew from the boundary conditions.
:math:`Z(p) = k^2 \langle (\xi h)^2 / q(p+\xi) \rangle`, over the line's own spectrum, is the loss
by roughness of a wave along a conductor in the horizontal polarization, which would otherwise
travel without loss (the smoothing method's mean wave [3]_).

A slab's back is flat behind its rough front. The slab's coefficients enter B, and flat walls are
unchanged: the difference of the slab's R from the half space's is added to N as
:math:`2 K R / Q` of the flat wall and, to first order of heights, :math:`2jk (B - KR) h`; here
:math:`K = \tfrac12 |\hat s_i + \hat s_s|^2` and R is that at half the angle between the antennas.

References
----------
.. [1] A. G. Voronovich, "Small-slope approximation for electromagnetic wave scattering at a rough
   interface of two dielectric half-spaces", Waves in Random Media 4, 1994,
   doi:10.1088/0959-7174/4/3/008.
.. [2] E. I. Thorsos, S. L. Broschat, "An investigation of the small slope approximation for
   scattering from rough surfaces. Part I. Theory", J. Acoust. Soc. Am. 97, 1995.
.. [3] J. G. Watson, J. B. Keller, "Rough surface scattering via the smoothing method", J. Acoust.
   Soc. Am. 75, 1984.
"""

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from jaxtyping import Complex, Complex64, Float, Int
from scipy.constants import speed_of_light

from scenes.schema.radio import Polarization
from simulator.materials.facet_reflection import over_angles
from simulator.materials.fresnel_slab import Dielectric, Material, reflection

STEP = 0.01
"""Step of the direction's component along the line (a cosine) between filtered heights, which are
interpolated: over it, waves from a distance x change phase by k x · 0.01, 0.3 rad at 5 λ. [-]"""

REACH = 0.01
"""Length beyond an open line's ends over which its heights are tapered to 0: 10 λ. [m]"""

LOSS = 1e-3
"""Imaginary part of 1 - p², which keeps 1/q finite for a wave along the line. [-]"""

SPECTRUM_BINS = 256
"""Bins of a line's spectrum for Z. [-]"""

MOST_ALONG = 0.9999
"""Largest component of a direction along a line, for evaluating weights: 0.8° over it. [-]"""

Ways = tuple[Float[np.ndarray, "#facets"], Float[np.ndarray, "#facets"]]
"""Components of the directions to an antenna: along the line, and along its normal (> 0)."""


@dataclass(frozen=True, kw_only=True)
class Kernels:
    """Scattering kernels of the slightly rough and of the flat surface, signs included."""

    bragg: Complex[np.ndarray, "_ _"]  # B
    mirror: Complex[np.ndarray, "_ _"]  # K R


def kernels(
    material: Material,
    transmit: Ways,
    receive: Ways,
    frequencies: Float[np.ndarray, " nodes"],
    *,
    polarization: Polarization,
    half_space: bool = False,
) -> Kernels:
    """Evaluate first-order perturbation theory and the tangent plane's kernel.

    Parameters
    ----------
    material
        A conductor or a dielectric.
    transmit, receive
        Directions to both antennas.
    frequencies
        [Hz].
    polarization
        Of the antennas.
    half_space
        Whether reflection by a slab's back is left out.
    """
    (t_i, q_i), (t_s, q_s) = transmit, receive
    mirror = 0.5 * ((t_i + t_s) ** 2 + (q_i + q_s) ** 2)
    vertical = polarization == "vertical"
    if not isinstance(material, Dielectric):
        bragg = -2 * q_i * q_s if vertical else 2 * (1 + t_i * t_s)
        sign = -1.0 if vertical else 1.0
        return Kernels(bragg=bragg[None] + 0j, mirror=sign * mirror[None] + 0j)
    half = np.sqrt(np.clip(mirror / 2, 0.0, 1.0))

    def coefficient(cosines: Float[np.ndarray, " facets"]) -> Complex[np.ndarray, "nodes facets"]:
        return _coefficient(material, cosines, frequencies, vertical, half_space)

    r_i, r_s = coefficient(q_i), coefficient(q_s)
    epsilon = material.permittivity(frequencies)[:, None]
    if vertical:
        bragg = -0.5 * (epsilon - 1) * (1 + r_i) * (1 + r_s)
    else:
        across = (epsilon - 1) * q_i * q_s * (1 - r_i) * (1 - r_s)
        bragg = 0.5 * (across - (1 / epsilon - 1) * t_i * t_s * (1 + r_i) * (1 + r_s))
    return Kernels(bragg=bragg, mirror=mirror * coefficient(half))


def _coefficient(
    material: Dielectric,
    cosines: Float[np.ndarray, " facets"],
    frequencies: Float[np.ndarray, " nodes"],
    vertical: bool,
    half_space: bool,
) -> Complex[np.ndarray, "nodes facets"]:
    """Return Fresnel's coefficients, interpolated over angle if there are many facets."""
    of = replace(material, thickness=np.inf) if half_space else material
    both = over_angles(partial(reflection, of), frequencies, cosines)
    return np.asarray(both.te if vertical else both.tm)


def reflection_of_front(
    material: Material,
    frequencies: Float[np.ndarray, " nodes"],
    *,
    polarization: Polarization,
) -> Complex[np.ndarray, " nodes"]:
    """Return a dielectric's coefficient at normal incidence, without reflection by its back."""
    assert isinstance(material, Dielectric)
    one = _coefficient(material, np.ones(1), frequencies, polarization == "vertical", True)
    return np.asarray(one[:, 0])


@dataclass(frozen=True, kw_only=True)
class RoughLine:
    """One run of facets of one material, at the frequencies at which its weights are sampled.

    Filtered heights are computed once for each direction of a grid, at all facets, and cached.
    """

    heights: Float[np.ndarray, " facets"]  # [m]
    step: float  # [m]
    closed: bool
    material: Material
    polarization: Polarization
    nodes: Float[np.ndarray, " nodes"]  # [Hz]

    def weights(
        self,
        transmit: Ways,
        receive: Ways,
        some: Int[np.ndarray, " facets"] | None = None,
        *,
        side: float,
        monostatic: bool,
    ) -> Complex[np.ndarray, "nodes facets"]:
        r"""Evaluate N of some or all facets.

        Parameters
        ----------
        transmit, receive
            Directions to both antennas: at these facets, or one for all of them.
        some
            Which facets; None: all.
        side
            1 if the antennas are on the side of positive heights, -1 on the other. [-]
        monostatic
            Whether both are the same. A slab's back is then left out: except for the dependence
            on angle, it changes the echo of all facets by one factor.
        """
        heights = self.heights if some is None else self.heights[some]
        height = side * heights
        total = transmit[1] + receive[1]
        pair = self.material, transmit, receive, self.nodes
        first = kernels(*pair, polarization=self.polarization, half_space=True)
        weight = 2 * first.bragg / total
        wavenumber = 2 * np.pi * self.nodes[:, None] / speed_of_light
        if isinstance(self.material, Dielectric) and not monostatic:
            if np.isfinite(self.material.thickness):
                whole = kernels(*pair, polarization=self.polarization)
                rest = whole.bragg - first.bragg - whole.mirror + first.mirror
                weight = weight + 2 * (whole.mirror - first.mirror) / total
                weight = weight + 2j * wavenumber * rest * height
        again = self.second_order(transmit, receive, some, side=side, monostatic=monostatic)
        return np.asarray(weight + 2 * first.bragg / total * again)

    def second_order(
        self,
        transmit: Ways,
        receive: Ways,
        some: Int[np.ndarray, " facets"] | None = None,
        *,
        side: float,
        monostatic: bool = False,
    ) -> Complex[np.ndarray, "nodes facets"]:
        """Evaluate the term of E over 2B/Q. Parameters are those of :meth:`weights`. [-]."""
        heights = self.heights if some is None else self.heights[some]
        height = side * heights
        (t_i, q_i), (t_s, q_s) = transmit, receive
        total = q_i + q_s
        wavenumber = 2 * np.pi * self.nodes[:, None] / speed_of_light
        dielectric = isinstance(self.material, Dielectric)
        if dielectric and self.polarization == "horizontal":
            return np.zeros((self.nodes.size, heights.size), dtype=np.complex128)
        sent = side * self._filtered(t_i, some)
        heard = sent if monostatic else side * self._filtered(t_s, some)
        if self.polarization == "horizontal":
            again = _twice_scattered(sent, t_i, t_s) + _twice_scattered(heard, t_s, t_i)
            filtered = again / (2 * (1 + t_i * t_s)) - 0.5 * total * height
        else:
            local = self._inner(t_i) + self._inner(t_s) - total if dielectric else -total
            filtered = 0.5 * (sent[0] + heard[0] + local * height)
        return np.asarray(1j * wavenumber * filtered)

    def _inner(self, along: Float[np.ndarray, " chosen"]) -> Complex[np.ndarray, "nodes chosen"]:
        """Return the normal component within the dielectric. [-]."""
        assert isinstance(self.material, Dielectric)
        epsilon = self.material.permittivity(self.nodes)[:, None]
        return np.asarray(np.sqrt(epsilon - along**2))

    def _filtered(
        self, along: Float[np.ndarray, "#facets"], some: Int[np.ndarray, " facets"] | None
    ) -> Complex[np.ndarray, "parts nodes facets"]:
        """Filter the heights, for one direction or for that at each facet. [m]."""
        if along.size == 1:
            field = self._field(float(along[0]))
            return field if some is None else field[..., some]
        return self._bank(along, np.arange(self.heights.size) if some is None else some)

    @cached_property
    def _bank(self) -> "DirectionGrid":
        return DirectionGrid(self._field, self.heights.size)

    def _field(self, along: float) -> Complex[np.ndarray, "parts nodes facets"]:
        """Filter the heights, for one direction."""
        heights = self.heights if self.closed else extended(self.heights, self.step)
        spectrum = np.fft.fft(heights)
        waves = np.fft.fftfreq(heights.size, self.step) * speed_of_light
        between = along + waves / self.nodes[:, None]  # p [nodes, waves]
        if self.polarization == "horizontal":
            normal = normal_component(between, LOSS)
            lossy = normal + self._loss(between)
            filters = np.stack([1 / lossy, between / lossy, between**2 / lossy])
        else:
            normal = normal_component(between)
            if isinstance(self.material, Dielectric):
                epsilon = self.material.permittivity(self.nodes)[:, None]
                normal = normal - np.sqrt(epsilon - between**2)
            filters = normal[None]
        return np.asarray(np.fft.ifft(filters * spectrum)[..., : self.heights.size])

    def _loss(
        self, between: Float[np.ndarray, "nodes waves"]
    ) -> Complex[np.ndarray, "nodes waves"]:
        """Return Z, the loss of waves along the line by roughness. [-]."""
        window = np.hanning(self.heights.size) if not self.closed else 1.0
        power = np.abs(np.fft.fft(self.heights * window)) ** 2
        power *= np.mean(self.heights**2) / max(float(power.sum()), np.finfo(float).tiny)
        waves = np.fft.fftfreq(self.heights.size, self.step) * speed_of_light  # [Hz]
        edges = np.linspace(waves.min(), waves.max(), SPECTRUM_BINS + 1)
        binned, _ = np.histogram(waves, edges, weights=power)
        middle = (edges[1:] + edges[:-1]) / 2
        found = []
        for row, frequency in zip(between, self.nodes, strict=True):
            grid = np.linspace(row.min(), row.max(), 2 * SPECTRUM_BINS)
            again = normal_component(grid[:, None] + middle / frequency, LOSS**0.5)
            loss = np.sum(binned * (2 * np.pi * middle / speed_of_light) ** 2 / again, axis=-1)
            found.append(np.interp(row, grid, loss.real) + 1j * np.interp(row, grid, loss.imag))
        return np.array(found)


class DirectionGrid:
    """A function of the facet and of one direction, tabulated on a grid of directions.

    Interpolation is linear and symmetric in both antennas' directions, so links stay reciprocal.
    """

    def __init__(
        self, at: Callable[[float], Complex[np.ndarray, "*parts facets"]], facets: int
    ) -> None:
        """Take a function of the direction's component along the line."""
        self._evaluate, self._facets = at, facets
        self._half = math.ceil(1 / STEP)
        self._known = np.zeros(2 * self._half + 1, dtype=bool)
        self._values: Complex64[np.ndarray, "grid facets parts"] | None = None
        self._parts: tuple[int, ...] = ()
        self._lock = threading.Lock()

    def __call__(
        self, along: Float[np.ndarray, " chosen"], some: Int[np.ndarray, " chosen"]
    ) -> Complex64[np.ndarray, "*parts chosen"]:
        """Interpolate at some facets, by the component along the line at each of them."""
        places = along / STEP + self._half
        below = np.clip(places.astype(np.int64), 0, 2 * self._half - 1)
        with self._lock:
            values = self._known_from(int(below.min()), int(below.max()) + 1)
        share = (places - below).astype(np.float32)[:, None]
        one, other = values[below, some], values[below + 1, some]
        other -= one
        other *= share
        other += one
        return np.ascontiguousarray(other.T).reshape(*self._parts, some.size)

    def _known_from(self, low: int, high: int) -> Complex64[np.ndarray, "grid facets parts"]:
        for index in range(low, high + 1):
            if self._known[index]:
                continue
            # At grazing, the normal component of the grid's last direction would be 0.
            found = self._evaluate(
                float(np.clip((index - self._half) * STEP, -MOST_ALONG, MOST_ALONG))
            )
            if self._values is None:
                self._parts = found.shape[:-1]
                shape = (self._known.size, self._facets, math.prod(self._parts))
                self._values = np.zeros(shape, dtype=np.complex64)  # allocated when written
            self._values[index] = found.reshape(-1, self._facets).T
            self._known[index] = True
        assert self._values is not None
        return self._values


def echo_weights(line: RoughLine, *, side: float) -> DirectionGrid:
    """Return the weights of a line for monostatic echoes."""

    def at(along: float) -> Complex[np.ndarray, "nodes facets"]:
        way = np.array([along]), np.array([np.sqrt(1 - along**2)])
        return line.weights(way, way, side=side, monostatic=True)

    return DirectionGrid(at, line.heights.size)


def _twice_scattered(
    fields: Complex[np.ndarray, "parts nodes facets"],
    near: Float[np.ndarray, "#facets"],
    far: Float[np.ndarray, "#facets"],
) -> Complex[np.ndarray, "nodes facets"]:
    """Combine the filtered heights of 1, p and p² to that of (1 - near p)(1 + far p)."""
    return np.asarray(fields[0] + (far - near) * fields[1] - near * far * fields[2])


def normal_component(
    between: Float[np.ndarray, "*n"], loss: float = 0.0
) -> Complex[np.ndarray, "*n"]:
    """Return q(p); evanescent waves decay. [-]."""
    # The branch with a negative imaginary part: exp(-jkqz) falls with z.
    root = np.sqrt(1.0 - between**2 - 1j * loss)
    return np.asarray(np.where(root.imag > 0, -root, root))


def extended(heights: Float[np.ndarray, " n"], step: float) -> Float[np.ndarray, " more"]:
    """Extend an open line's heights point-symmetrically about its ends, tapered; periodic. [m].

    Heights are those of facets' centres, so the line ends half a step beyond the last one.
    Symmetry about that end has no kink. Symmetry about the last centre would repeat its height, and
    the echo's error would fall with the spacing, not with its square.
    """
    count = min(round(REACH / step), heights.size - 1)
    fade = 0.5 * (1 + np.cos(np.pi * (np.arange(count) + 0.5) / count))
    last = 1.5 * heights[-1] - 0.5 * heights[-2]
    first = 1.5 * heights[0] - 0.5 * heights[1]
    after = (2 * last - heights[-1 : -count - 1 : -1]) * fade
    before = (2 * first - heights[:count]) * fade
    return np.concatenate([heights, after, before[::-1]])
