r"""Materials over frequency, and reflection and transmission coefficients of flat layers of them.

A surface is a perfect conductor, a perfect absorber, or a slab of a dielectric with complex
relative permittivity :math:`\varepsilon = \varepsilon' - j \varepsilon''` (time convention
exp(+jωt)) between air on both sides. TE is the electric field across the plane of incidence
(vertical antennas and a vertical wall), TM the field within it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from simulator.materials.permittivity import (
    ConstantPermittivity,
    MaterialError,
    Permittivity,
    itu_permittivity,
)


@dataclass(frozen=True)
class Conductor:
    """A perfect electric conductor; the reflection loss of copper at 300 GHz would be 0.01 dB."""


@dataclass(frozen=True)
class Absorber:
    """A surface that neither reflects nor transmits anything."""


@dataclass(frozen=True, kw_only=True)
class Dielectric:
    """A slab in air."""

    permittivity: Permittivity
    thickness: float  # infinite: opaque, a half space [m]

    def __post_init__(self) -> None:
        """Refuse a slab without thickness."""
        if not self.thickness > 0:
            raise MaterialError(
                f"the slab's thickness is {self.thickness} m; it must be positive "
                "(infinite for an opaque body)"
            )


Material = Conductor | Absorber | Dielectric


class Coefficients(NamedTuple):
    """Field coefficients of both polarizations, over angles and frequencies."""

    te: Complex[np.ndarray, "*n freqs"]
    tm: Complex[np.ndarray, "*n freqs"]


def reflection(
    material: Material,
    frequencies: Float[np.ndarray, " freqs"],
    cosines: Float[np.ndarray, "*n"],
) -> Coefficients:
    """Reflection coefficients of a flat surface for each angle and frequency.

    The signs are those of ITU-R P.2040-4: a conductor has -1 (TE) and +1 (TM), the two
    directions of the TM field being across the same vector, before and after.

    Parameters
    ----------
    material
        What the surface is made of.
    frequencies
        Any grid. [Hz]
    cosines
        Cosines of the angles of incidence, from 0 (grazing) to 1. [-]
    """
    shape = (*cosines.shape, frequencies.size)
    match material:
        case Conductor():
            one = np.ones(shape, dtype=np.complex128)
            return Coefficients(-one, one)
        case Absorber():
            nothing = np.zeros(shape, dtype=np.complex128)
            return Coefficients(nothing, nothing.copy())
        case Dielectric():
            permittivity = material.permittivity(frequencies)
            return slab(permittivity, material.thickness, frequencies, cosines)[0]


def transmission(
    material: Material,
    frequencies: Float[np.ndarray, " freqs"],
    cosines: Float[np.ndarray, "*n"],
) -> Coefficients:
    """Transmission coefficients of a flat surface for each angle and frequency.

    The phase is from the point where the wave enters to the opposite point of the far face,
    along the normal. Parameters are those of :func:`reflection`.
    """
    if isinstance(material, Dielectric):
        permittivity = material.permittivity(frequencies)
        return slab(permittivity, material.thickness, frequencies, cosines)[1]
    nothing = np.zeros((*cosines.shape, frequencies.size), dtype=np.complex128)
    return Coefficients(nothing, nothing.copy())


def slab(
    permittivity: Complex[np.ndarray, " freqs"],
    thickness: float,
    frequencies: Float[np.ndarray, " freqs"],
    cosines: Float[np.ndarray, "*n"],
) -> tuple[Coefficients, Coefficients]:
    r"""Fresnel coefficients of a slab, all internal reflections summed.

    Eqs. (37), (43), (44) of ITU-R P.2040-4: with
    :math:`a = \sqrt{\varepsilon - \sin^2\theta}` and :math:`q = 2 \pi d a / \lambda`,

    .. math:: r_{TE} = \frac{\cos\theta - a}{\cos\theta + a}, \quad
              r_{TM} = \frac{\varepsilon\cos\theta - a}{\varepsilon\cos\theta + a}, \quad
              R = \frac{r (1 - e^{-2jq})}{1 - r^2 e^{-2jq}}, \quad
              T = \frac{(1 - r^2) e^{-jq}}{1 - r^2 e^{-2jq}}

    Parameters
    ----------
    permittivity
        Complex relative permittivity at each frequency. [-]
    thickness
        Thickness of the slab; infinite for a half space, which transmits nothing. [m]
    frequencies
        Any grid. [Hz]
    cosines
        Cosines of the angles of incidence. [-]

    Returns
    -------
    The reflection and the transmission coefficients. [-]
    """
    cosine = cosines[..., None]
    inner = np.sqrt(permittivity - (1.0 - cosine**2))
    if np.isinf(thickness):
        once = np.zeros_like(inner)
    else:
        once = np.exp(-2j * np.pi * thickness * frequencies / speed_of_light * inner)
    reflected, transmitted = [], []
    for outer in (cosine, permittivity * cosine):
        face = (outer - inner) / (outer + inner)
        resonance = 1.0 - (face * once) ** 2
        reflected.append(face * (1.0 - once**2) / resonance)
        transmitted.append((1.0 - face**2) * once / resonance)
    return Coefficients(*reflected), Coefficients(*transmitted)


THICKNESS: Mapping[str, float] = {
    "drywall": 12.7e-3,
    "plasterboard": 12.7e-3,
    "glass": 4e-3,
    "ceiling_board": 15e-3,
    "chipboard": 18e-3,
    "plywood": 12e-3,
    "floorboard": 15e-3,
    "wood": 20e-3,
    "concrete": np.inf,
    "brick": np.inf,
    "marble": np.inf,
    "cardboard": np.inf,
}
"""Default thickness: boards and panes as commonly sold (drywall: half an inch); masonry is so thick
that no reflection returns from its far side. [m]"""

CARDBOARD = 2.0 - 0.1j
"""Relative permittivity of cardboard. A carton is opaque: its content is not modelled. [-]"""


def named_material(
    name: str,
    frequencies: Float[np.ndarray, " freqs"],
    *,
    thickness: float | None = None,
    beyond: bool = False,
) -> Material:
    """Return a material by its name.

    ``metal`` and ``absorber`` are perfect. ``drywall`` is 12.7 mm of gypsum board after the
    plasterboard row of ITU-R P.2040-4; the names of :data:`ITU_ROWS` are slabs of that
    material; ``cardboard`` is an opaque carton.

    Parameters
    ----------
    name
        One of the above.
    frequencies
        The band that the material has to be known for. [Hz]
    thickness
        Thickness of a slab, if not that of :data:`THICKNESS`. [m]
    beyond
        Whether bands that no row of ITU-R P.2040-4 covers are taken from the nearest rows.

    Raises
    ------
    MaterialError
        If there is no such material, or its permittivity is not known over the band.
    """
    if name == "metal":
        return Conductor()
    if name == "absorber":
        return Absorber()
    if name not in THICKNESS:
        known = ", ".join(["metal", "absorber", *THICKNESS])
        raise MaterialError(
            f"unknown material {name!r}; known: {known}; or give a permittivity and a thickness"
        )
    permittivity: Permittivity
    if name == "cardboard":
        permittivity = ConstantPermittivity(value=CARDBOARD)
    else:
        row = "plasterboard" if name == "drywall" else name
        permittivity = itu_permittivity(row, frequencies, beyond=beyond)
    return Dielectric(
        permittivity=permittivity, thickness=THICKNESS[name] if thickness is None else thickness
    )
