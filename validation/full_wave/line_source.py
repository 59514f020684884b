r"""Fields of line sources in two dimensions, at real and at complex positions.

Time convention :math:`e^{+j\omega t}`; a unit line source has the field of the free-space
Green's function

.. math:: G(R) = -\tfrac{j}{4} H_0^{(2)}(kR)

A line source displaced by the imaginary distance :math:`b` against its aim is an exact solution of
the wave equation outside a short branch cut at its position, and near the aim a Gaussian beam,

.. math:: g(\psi) \approx e^{-kb(1 - \cos\psi)} \approx e^{-\psi^2/2\sigma^2}, \qquad
          \sigma = 1/\sqrt{kb}

here normalised to the level of the real source along the aim, in the far field [1]_.

References
----------
.. [1] L. B. Felsen, "Complex-source-point solutions of the field equations and their relation
   to the propagation and scattering of Gaussian beams", Symp. Math. 18, 1976.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float
from scipy.special import hankel2, hankel2e, j0, y0

FAR = 25.0
"""Argument above which the asymptotic series is used: its relative error is below 2e-10, and it
takes half the time of the Bessel functions. [-]"""


def greens_function(phase: Float[np.ndarray, "*n"]) -> Complex[np.ndarray, "*n"]:
    r"""Evaluate :math:`G = -\tfrac{j}{4} H_0^{(2)}(kR)`.

    Parameters
    ----------
    phase
        :math:`kR`, positive. [rad]
    """
    # P and Q of Hankel's expansion, DLMF 10.17.5, times 1/4; Q is negative.
    clipped = np.maximum(phase, FAR)
    inverse = 1.0 / (8.0 * clipped)
    square = inverse * inverse
    even = 1 - square * (4.5 - square * (11025 / 24 - square * (108056025 / 720)))
    odd = inverse * (1 - square * (37.5 - square * (893025 / 120)))
    size = 0.25 * np.sqrt(2 / np.pi / clipped)
    turn = clipped - 0.25 * np.pi
    cosine, sine = np.cos(turn), np.sin(turn)
    field = np.empty(phase.shape, dtype=np.complex128)
    # −j (P + jQ)(cos − j sin), with Q = −odd in H⁽¹⁾ and hence +odd here.
    field.real = size * (odd * cosine - even * sine)
    field.imag = -size * (even * cosine + odd * sine)
    near = phase < FAR
    if near.any():
        close = phase[near]
        field[near] = -0.25 * (y0(close) + 1j * j0(close))
    return field


def radial_derivative(phase: Float[np.ndarray, "*n"]) -> Complex[np.ndarray, "*n"]:
    r"""Evaluate :math:`dG/d(kR) = \tfrac{j}{4} H_1^{(2)}(kR)`.

    Parameters
    ----------
    phase
        :math:`kR`, positive. [rad]
    """
    return np.asarray(0.25j * hankel2(1, phase))


@dataclass(frozen=True, kw_only=True)
class LineSource:
    """A unit line source, isotropic or a beam.

    A beam has either the same angular width, or the same imaginary displacement, at all
    frequencies.
    """

    position: Float[np.ndarray, " 2"]  # [m]
    aim: Float[np.ndarray, " 2"] | None = None  # direction of the beam, of any length
    width: float | None = None  # standard deviation of the field [rad]
    displacement: float | None = None  # b [m]

    def __post_init__(self) -> None:
        """Refuse a beam with both width and displacement, or with neither."""
        told = [one for one in (self.width, self.displacement) if one is not None]
        if len(told) != (self.aim is not None) or not all(one > 0 for one in told):
            raise ValueError(
                f"a beam needs an aim and either a width or a displacement above 0, but aim = "
                f"{self.aim}, width = {self.width}, displacement = {self.displacement}; give "
                "two of them, or none for an isotropic source"
            )

    def field(
        self, points: Float[np.ndarray, "points 2"], wavenumber: float
    ) -> Complex[np.ndarray, " points"]:
        """Return the field at some points; the wavenumber is in rad/m."""
        if self.aim is None:
            return greens_function(wavenumber * np.hypot(*(points - self.position).T))
        _, phase, decay = self._complex_way(points, wavenumber)
        return np.asarray(-0.25j * hankel2e(0, phase) * np.exp(-1j * phase - decay))

    def gradient(
        self, points: Float[np.ndarray, "points 2"], wavenumber: float
    ) -> Complex[np.ndarray, "points 2"]:
        """Return the gradient of the field at some points. [1/m]."""
        way, phase, decay = self._complex_way(points, wavenumber)
        slope = 0.25j * hankel2e(1, phase) * np.exp(-1j * phase - decay)
        return np.asarray((wavenumber**2 * slope / phase)[:, None] * way)

    def _complex_way(
        self, points: Float[np.ndarray, "points 2"], wavenumber: float
    ) -> tuple[Complex[np.ndarray, "points 2"], Complex[np.ndarray, " points"], float]:
        """Return the vectors from the source's complex position, their lengths times k, and kb."""
        way = (points - self.position).astype(np.complex128)
        decay = 0.0
        if self.aim is not None:
            decay = (
                wavenumber * self.displacement
                if self.displacement is not None
                else 1 / float(self.width or 1.0) ** 2
            )
            way += 1j * decay / wavenumber * self.aim / np.hypot(*self.aim)
        distance = np.sqrt(way[:, 0] ** 2 + way[:, 1] ** 2)
        # This root gives an outgoing wave, strongest along the aim.
        distance = np.where(distance.real < 0, -distance, distance)
        return way, wavenumber * distance, decay
