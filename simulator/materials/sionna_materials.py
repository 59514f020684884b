r"""Sionna RT's radio materials, made of the same permittivities and roughness as ours.

Sionna describes a surface by a slab (permittivity, conductivity, thickness) and a scattering
coefficient S: the share S² of the reflected power is scattered, and the specular amplitude
falls to :math:`\sqrt{1 - S^2}`. Setting that equal to the coherent loss of a Gaussian rough
surface, :math:`e^{-2(k\sigma\cos\theta)^2}`, gives

.. math:: S^2 = 1 - e^{-(2 k \sigma \cos\theta)^2}

Sionna's S does not depend on the angle, so one angle of incidence stands for all: 45°, where
:math:`\cos^2\theta = 1/2` is the mean over the hemisphere of what a small area intercepts
(:math:`\int\cos^3\theta\sin\theta\,d\theta / \int\cos\theta\sin\theta\,d\theta`).
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import mitsuba as mi
import numpy as np
from scipy.constants import speed_of_light

from estimator.compute import engine
from simulator.materials.fresnel_slab import Absorber, Conductor, Dielectric, Material
from simulator.materials.permittivity import MaterialError, conductivity

mi.set_variant(engine.mitsuba_variant())

import sionna.rt as rt  # noqa: E402  the variant has to be chosen first

ANGLE_OF_INCIDENCE = math.pi / 4
"""Angle at which a roughness is turned into a scattering coefficient [rad]."""

CONDUCTIVITY = 1e7
"""Conductivity of a metal; Sionna's own 'metal' is known up to 100 GHz only [S/m]."""

ABSORBER_LOSS = 0.01
"""Loss ε'' of a layer of ε' = 1 that stands for a perfect absorber: it reflects -52 dB at
normal incidence and -46 dB at 45° [-]."""

ABSORBER_WAVELENGTHS = 500.0
"""Thickness of that layer in wavelengths: e^(-5π) is -136 dB of transmission [-]."""

OPAQUE_LOSS = math.log(1e3)
"""One-way loss of a layer that stands for a half space, 60 dB [neper]."""


class SionnaSlab(NamedTuple):
    """Parameters of a radio material of Sionna RT at one frequency."""

    relative_permittivity: float  # [-]
    conductivity: float  # [S/m]
    thickness: float  # [m]
    scattering_coefficient: float  # [-]


def scattering_coefficient(
    rms_height: float, frequency: float, *, angle: float = ANGLE_OF_INCIDENCE
) -> float:
    """Return Sionna's scattering coefficient of a rough surface.

    Parameters
    ----------
    rms_height
        Of a Gaussian rough surface. [m]
    frequency
        [Hz]
    angle
        Angle of incidence, from the normal. [rad]

    Returns
    -------
    S, from 0 (smooth) to 1 (nothing left of the specular wave). [-]
    """
    depth = 4 * math.pi * frequency / speed_of_light * rms_height * math.cos(angle)
    return math.sqrt(-math.expm1(-(depth**2)))


def sionna_slab(
    material: Material,
    frequency: float,
    *,
    rms_height: float = 0.0,
    angle: float = ANGLE_OF_INCIDENCE,
) -> SionnaSlab:
    """Describe a material at one frequency as Sionna RT does.

    Parameters
    ----------
    material
        What the surface is made of.
    frequency
        [Hz]
    rms_height
        Its roughness; 0 also if the geometry itself is rough. [m]
    angle
        Angle of incidence at which the scattering coefficient is computed. [rad]

    Raises
    ------
    MaterialError
        If the permittivity is not known at the frequency, or a half space is lossless, so that
        no absorbing layer is equivalent to it.
    """
    scattering = scattering_coefficient(rms_height, frequency, angle=angle)
    wavelength = speed_of_light / frequency
    match material:
        case Conductor():
            # Any thickness will do: the skin depth is below a micrometre.
            return SionnaSlab(1.0, CONDUCTIVITY, 1e-3, scattering)
        case Absorber():
            loss = np.array([1.0 - 1j * ABSORBER_LOSS])
            return SionnaSlab(
                1.0, _conductivity(loss, frequency), ABSORBER_WAVELENGTHS * wavelength, 0.0
            )
        case Dielectric():
            values = material.permittivity(np.array([frequency]))
            thickness = material.thickness
            if math.isinf(thickness):
                decay = -2 * math.pi / wavelength * float(np.sqrt(values[0]).imag)
                if decay <= 0:
                    raise MaterialError(
                        f"an opaque material without loss (permittivity {values[0].real:g}) is no "
                        "layer of Sionna RT; give it a loss or a thickness"
                    )
                thickness = OPAQUE_LOSS / decay
            return SionnaSlab(
                float(values[0].real), _conductivity(values, frequency), thickness, scattering
            )


def radio_material(
    name: str,
    material: Material,
    *,
    rms_height: float = 0.0,
    angle: float = ANGLE_OF_INCIDENCE,
    colour: tuple[float, float, float] | None = None,
) -> rt.RadioMaterial:
    """Make a radio material that follows the frequency of the scene it is put into.

    Setting ``scene.frequency`` updates permittivity, conductivity, thickness and scattering
    coefficient; outside of the band that the material is known for it raises
    :class:`~simulator.materials.permittivity.MaterialError`.

    Parameters
    ----------
    name
        Of the radio material in the scene.
    material, rms_height, angle
        As in :func:`sionna_slab`.
    colour
        Red, green, blue in renders, each 0…1; random by default.
    """
    made = _FollowingMaterial(name, color=colour)
    made.slab = lambda frequency: sionna_slab(
        material, frequency, rms_height=rms_height, angle=angle
    )
    return made


class _FollowingMaterial(rt.RadioMaterial):  # type: ignore[misc]  # Sionna RT is untyped
    """A radio material all of whose parameters are updated with the scene's frequency.

    Sionna's own callback sets permittivity and conductivity only; and a callback that refers to
    its material would be a reference cycle, never freed.
    """

    slab: Callable[[float], SionnaSlab] | None = None

    def frequency_update(self) -> None:
        """Update all parameters to the scene's frequency; called by Sionna when it is set."""
        scene: Any = self.scene
        if scene is None or self.slab is None:
            return
        # Sionna holds the frequency in single precision, 110 GHz as a little less than that.
        slab = self.slab(float(f"{scene.frequency[0]:.6g}"))
        self.relative_permittivity = slab.relative_permittivity
        self.conductivity = slab.conductivity
        self.thickness = slab.thickness
        self.scattering_coefficient = slab.scattering_coefficient


def _conductivity(permittivity: np.ndarray, frequency: float) -> float:
    return float(conductivity(permittivity, np.array([frequency]))[0])
