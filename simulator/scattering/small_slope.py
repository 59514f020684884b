r"""Rough lines beyond the tangent plane: the small-slope approximation of second order (Voronovich).

Along the mean course of a line, with heights h and unit vectors :math:`\hat s_i, \hat s_s` from it
to both antennas, let t be their components along the line, q those along its normal, :math:`Q = q_i
+ q_s`; wavenumbers are over k. The line scatters as facets do,

.. math:: \frac{jk}{\lambda} \int N\, e^{jkQ h}\, h_i h_s\, dx, \qquad
          N = \frac{2 B}{Q} + jk\, (E * h)

in place of :math:`\Gamma (\cos\theta_i + \cos\theta_s)`. B is the kernel of perturbation theory
of first order (Bragg scattering); E completes what :math:`e^{jkQh}` gives in the second order to
what perturbation theory of second order gives. It works on the heights as a filter, and holds how
waves along the surface scatter again: the coherent loss of short waves with its phase, and grazing
incidence, where tangent planes would hide each other. With p the wavenumber between both orders,
:math:`q(p) = \sqrt{1 - p^2}`, evanescent waves included,

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

with :math:`q'(p) = \sqrt{\varepsilon - p^2}` and :math:`\gamma = q - q'`. "Vertical" is the electric
field along z (TM of the cross-section, TE of the plane of incidence). B of a conductor and E of
both verticals follow [1]_, [2]_; all were derived anew from the boundary conditions, for this form.
:math:`Z(p) = k^2 \langle (\xi h)^2 / q(p+\xi) \rangle`, over the line's own spectrum, is what
roughness takes from a wave along a conductor in the horizontal polarization, which would otherwise
run without loss (the smoothing method's mean wave [3]_).

A slab's back lies flat behind its rough front. Its coefficients enter B as a whole, and flat walls
stay as they are: what the slab's R has beyond the half space's is added to N as
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

import threading
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from scenes.schema.radio import Polarization
from simulator.materials.layered_media import Conductor, Dielectric, Material, reflection, slab
from simulator.numerics.nufft_sum import barycentric_basis, chebyshev_nodes

STEP = 0.01
"""Step of the direction's component along the line, over 1, between which fields of the filter are
interpolated: waves that come from x away turn by k x · 0.01 over it, 0.3 rad at 5 λ. [-]"""

REACH = 0.01
"""Length beyond an open line's ends over which its heights fade: 10 λ. [m]"""

LOSS = 1e-3
"""Imaginary part of 1 - p² that keeps a wave along the line finite on its grid. [-]"""

SPECTRUM_BINS = 256
"""Bins of a line's spectrum for Z. [-]"""

ANGLES = 12
"""Chebyshev points over the cosines of a link, for coefficients of a dielectric. [-]"""

Ways = tuple[Float[np.ndarray, " facets"], Float[np.ndarray, " facets"]]
"""Components of the directions to an antenna: along the line, and along its normal (> 0)."""


@dataclass(frozen=True, kw_only=True)
class Kernels:
    """Of the flat and the slightly rough surface, signs included."""

    bragg: Complex[np.ndarray, "#nodes facets"]  # B
    mirror: Complex[np.ndarray, "#nodes facets"]  # K R


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
        Leave out what a slab's back reflects.
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
    """Fresnel's coefficients of facets; a half space's are interpolated over the angle."""

    def exact(angles: Float[np.ndarray, " n"]) -> Complex[np.ndarray, "n nodes"]:
        if half_space:
            both = slab(material.permittivity(frequencies), np.inf, frequencies, angles)[0]
        else:
            both = reflection(material, frequencies, angles)
        return both.te if vertical else both.tm

    low, high = float(cosines.min()), float(cosines.max())
    if half_space and len(cosines) > 4 * ANGLES:
        angles = chebyshev_nodes(low, high, ANGLES)
        basis = barycentric_basis(angles, cosines)
        return np.asarray(np.einsum("af,an->nf", basis, exact(angles)))
    return exact(cosines).T


@dataclass(frozen=True, kw_only=True)
class RoughLine:
    """One run of facets, of one material, at the frequencies that its weights are sampled at.

    Fields of the filter are worked out once for each direction of a grid, at all facets.
    """

    heights: Float[np.ndarray, " facets"]  # [m]
    step: float  # [m]
    closed: bool
    material: Material
    polarization: Polarization
    nodes: Float[np.ndarray, " nodes"]  # [Hz]
    _fields: dict[int, Complex[np.ndarray, "parts nodes facets"]] = field(
        default_factory=dict, repr=False
    )
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    def weights(
        self,
        transmit: Ways,
        receive: Ways,
        some: np.ndarray,
        *,
        side: Float[np.ndarray, " chosen"] | float = 1.0,
        monostatic: bool,
    ) -> Complex[np.ndarray, "#nodes chosen"]:
        r"""Evaluate N of some of the line's facets.

        Parameters
        ----------
        transmit, receive
            Directions to both antennas, at these facets, on the side of the mean normal.
        some
            Indices of the facets on the line.
        side
            1 where the antennas are on the side that heights rise to, -1 on the other. [-]
        monostatic
            Whether both are the same.
        """
        height = side * self.heights[some]
        (t_i, q_i), (t_s, q_s) = transmit, receive
        total = q_i + q_s
        how = {"polarization": self.polarization}
        whole = kernels(self.material, transmit, receive, self.nodes, **how)
        wavenumber = 2 * np.pi * self.nodes[:, None] / speed_of_light
        thin = isinstance(self.material, Dielectric) and np.isfinite(self.material.thickness)
        first = whole
        if thin:
            first = kernels(
                self.material, transmit, receive, self.nodes, **how, half_space=True
            )
        weight = 2 * first.bragg / total
        if thin:
            weight = weight + 2 * (whole.mirror - first.mirror) / total
            rest = whole.bragg - first.bragg - whole.mirror + first.mirror
            weight = weight + 2j * wavenumber * rest * height
        if isinstance(self.material, Dielectric) and self.polarization == "horizontal":
            return np.asarray(weight)
        sent = side * self._at(t_i, some)
        heard = sent if monostatic else side * self._at(t_s, some)
        if isinstance(self.material, Dielectric):
            inner = self._inner(t_i) + self._inner(t_s)
            local = inner - total
        else:
            local = -total
        if self.polarization == "vertical":
            filtered = first.bragg / total * (sent[0] + heard[0] + local * height)
        else:
            filtered = -first.bragg * height + (2 / total) * (
                _twice_scattered(sent, t_i, t_s) + _twice_scattered(heard, t_s, t_i)
            )
        return np.asarray(weight + 1j * wavenumber * filtered)

    def _inner(self, along: Float[np.ndarray, " chosen"]) -> Complex[np.ndarray, "nodes chosen"]:
        """Normal component within the dielectric. [-]."""
        assert isinstance(self.material, Dielectric)
        epsilon = self.material.permittivity(self.nodes)[:, None]
        return np.asarray(np.sqrt(epsilon - along**2))

    def _at(
        self, along: Float[np.ndarray, " chosen"], some: np.ndarray
    ) -> Complex[np.ndarray, "parts nodes chosen"]:
        """Interpolate the filter's fields for the directions of the facets. [m]."""
        places = along / STEP
        low, high = int(np.floor(places.min())), int(np.floor(places.max())) + 1
        with self._lock:
            for index in range(low, high + 1):
                if index not in self._fields:
                    self._fields[index] = self._field(index * STEP)
        below = np.floor(places).astype(np.int64)
        share = places - below
        found = np.empty((*self._fields[low].shape[:2], some.size), dtype=np.complex128)
        for index in range(low, high):
            here = np.flatnonzero(below == index)
            if here.size:
                one, other = (self._fields[index + k][..., some[here]] for k in (0, 1))
                found[..., here] = one + (other - one) * share[here]
        return found

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
        """What roughness takes from waves along the line, Z. [-]."""
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


def _twice_scattered(
    fields: Complex[np.ndarray, "parts nodes facets"],
    near: Float[np.ndarray, " facets"],
    far: Float[np.ndarray, " facets"],
) -> Complex[np.ndarray, "nodes facets"]:
    """Combine the fields of 1, p and p² to those of (1 - near p)(1 + far p)."""
    return np.asarray(fields[0] + (far - near) * fields[1] - near * far * fields[2])


def normal_component(
    between: Float[np.ndarray, "*n"], loss: float = 0.0
) -> Complex[np.ndarray, "*n"]:
    """Return q(p); evanescent waves decay. [-]."""
    # The branch with a negative imaginary part: exp(-jkqz) falls with z.
    root = np.sqrt(1.0 - between**2 - 1j * loss)
    return np.asarray(np.where(root.imag > 0, -root, root))


def extended(heights: Float[np.ndarray, " n"], step: float) -> Float[np.ndarray, " more"]:
    """Let an open line's heights go on, turned about its ends, and fade; periodic then. [m]."""
    count = min(int(REACH / step), heights.size - 1)
    fade = 0.5 * (1 + np.cos(np.pi * (np.arange(count) + 0.5) / count))
    after = (2 * heights[-1] - heights[-1 : -count - 1 : -1]) * fade
    before = (2 * heights[0] - heights[:count]) * fade
    return np.concatenate([heights, after, before[::-1]])
