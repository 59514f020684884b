r"""A rough plate in three dimensions against small perturbations, reciprocity and energy.

Small perturbations (S. O. Rice, "Reflection of electromagnetic waves from slightly rough
surfaces", Commun. Pure Appl. Math. 4 (1951) 351) give the backscatter of a slightly rough plane

.. math:: \sigma^\circ = 16 \pi k^4 \cos^4\theta\, |\alpha|^2\, W(2 k \sin\theta)

with the spectrum :math:`W` of the heights (its integral over the plane of wavenumbers is the mean
square height), :math:`\alpha_h = R_{TE}`, :math:`\alpha_v = (\varepsilon - 1)(\sin^2\theta -
\varepsilon (1 + \sin^2\theta)) / (\varepsilon \cos\theta + \sqrt{\varepsilon - \sin^2\theta})^2`;
for a conductor -1 and :math:`-(1 + \sin^2\theta) / \cos^2\theta`. Here it is measured as in an
anechoic chamber: echoes from azimuths around plates of a few square centimetres, less their mean
over plates (which removes the edges).

Energy: for a lossless plate, the diffusely scattered power in all directions and both
polarizations, and the specular power after the loss by roughness, add up to the incident power.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Complex, Float, Int
from scipy.constants import speed_of_light

from scenes.realisations.object_surface import Surface
from scenes.schema.roughness import Roughness
from scenes.surfaces.height_synthesis import rough_sheet
from scenes.surfaces.shape import grid_triangles
from simulator.antennas.antenna_pattern import ISOTROPIC
from simulator.antennas.links import Links
from simulator.antennas.polarization import Polarization
from simulator.geometry.facets import Facets, surface_facets
from simulator.materials.fresnel_slab import Conductor, Dielectric, Material
from simulator.materials.permittivity import ConstantPermittivity
from simulator.scattering.patch_sum import scattered_by_patches
from simulator.visibility.seen import Seen

FREQUENCY = 250e9  # [Hz]
SIDE = 12e-3  # of the plate: ten wavelengths [m]
DISTANCE = 1.0  # of the antennas: the plate subtends 0.7° [m]
STEPS_PER_LENGTH = 6  # facets per correlation length: the loss by flat facets is 0.15 dB at 60° [-]
DRYWALL = 2.56 - 0.13j
"""Relative permittivity of plasterboard at 250 GHz, ITU-R P.2040-4. [-]"""

UPRIGHT = Polarization()
ACROSS = Polarization(cross_polar=1e9)
"""Field perpendicular to that of a vertical antenna in any direction: horizontal."""

MATERIALS: dict[str, Material] = {
    "conductor": Conductor(),
    "drywall": Dielectric(permittivity=ConstantPermittivity(value=DRYWALL), thickness=math.inf),
}


def plate(roughness: Roughness, seed: int) -> Surface:
    """Return a rough plate that faces +z."""
    count = 1 + math.ceil(SIDE * STEPS_PER_LENGTH / roughness.correlation_length)
    heights = rough_sheet(
        lengths=(SIDE, SIDE),
        counts=(count, count),
        rms=roughness.rms,
        correlation_length=roughness.correlation_length,
        spectrum=roughness.spectrum,
        inner_cutoff=roughness.inner_cutoff,
        rng=np.random.default_rng(seed),
    )
    along = SIDE * np.linspace(-0.5, 0.5, count)
    x, y = np.meshgrid(along, along, indexing="ij")
    mean = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=-1)
    return Surface(
        name="plate",
        material="metal",
        vertices=mean + heights.reshape(-1, 1) * np.array([0.0, 0.0, 1.0]),
        mean_vertices=mean,
        cells=grid_triangles(np.arange(x.size).reshape(x.shape)),
        closed=False,
        roughness=roughness,
    )


def links(
    facets: Facets,
    senders: Float[np.ndarray, "links 3"],
    receivers: Float[np.ndarray, "links 3"],
    polarizations: tuple[Polarization, Polarization],
) -> Complex[np.ndarray, " links"]:
    """Sum a plate's facets between isotropic antennas."""
    sent, received = (replace(ISOTROPIC, polarization=one) for one in polarizations)
    if senders is receivers:
        received = sent

    def everything(some: Int[np.ndarray, " some"]) -> Seen:
        return Seen(
            always=np.ones(len(some), dtype=bool),
            sometimes=np.empty(0, dtype=np.int64),
            table=np.empty((0, len(receivers)), dtype=bool),
        )

    ends = Links(senders=senders, receivers=receivers, sent=sent, received=received)
    band = FREQUENCY + np.array([0.0, 1e8])
    sums: np.ndarray = scattered_by_patches(facets, ends, everything, band)[:, 0]
    return sums


def around(degrees: float, count: int) -> Float[np.ndarray, "azimuths 3"]:
    """Return antenna positions at one angle off the plate's normal, at all azimuths."""
    turns = 2 * np.pi * (np.arange(count) + 0.3) / count
    angle = math.radians(degrees)
    flat = math.sin(angle) * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    return DISTANCE * np.concatenate([flat, np.full((count, 1), math.cos(angle))], axis=-1)


def small_perturbations(
    material: str, polarization: str, degrees: float, roughness: Roughness
) -> float:
    """Evaluate Rice's backscatter, of a Gaussian spectrum. [-]."""
    cosine, sine2 = math.cos(math.radians(degrees)), math.sin(math.radians(degrees)) ** 2
    wavenumber = 2 * math.pi * FREQUENCY / speed_of_light
    if material == "conductor":
        amplitude: complex = -1.0 if polarization == "h" else -(1 + sine2) / cosine**2
    else:
        inner = np.sqrt(DRYWALL - sine2)
        if polarization == "h":
            amplitude = (cosine - inner) / (cosine + inner)
        else:
            amplitude = (DRYWALL - 1) * (sine2 - DRYWALL * (1 + sine2))
            amplitude /= (DRYWALL * cosine + inner) ** 2
    length = roughness.correlation_length
    bragg = 2 * wavenumber * math.sqrt(sine2)
    spectrum = (
        (roughness.rms * length) ** 2 / (4 * math.pi) * math.exp(-((bragg * length) ** 2) / 4)
    )
    return 16 * math.pi * wavenumber**4 * cosine**4 * abs(amplitude) ** 2 * spectrum


@dataclass(frozen=True, kw_only=True)
class Backscatter:
    """One measured value of the backscatter per area."""

    material: str
    polarization: str
    degrees: float
    over_theory: float  # [dB]
    error: float  # statistical error, one standard deviation [dB]


def backscatter(plates: int, azimuths: int) -> list[Backscatter]:
    """Measure the backscatter of slightly rough plates against small perturbations."""
    roughness = Roughness(rms_mm=0.01, correlation_mm=0.3)
    wavelength = speed_of_light / FREQUENCY
    found = []
    for name, material in MATERIALS.items():
        made = [
            surface_facets(plate(roughness, seed), material, wavelength=wavelength)
            for seed in range(plates)
        ]
        for degrees in (30.0, 45.0, 60.0):
            places = around(degrees, azimuths)
            for polarization, field in (("h", ACROSS), ("v", UPRIGHT)):
                echoes = np.stack([links(one, places, places, (field, field)) for one in made])
                power = float(np.var(echoes, axis=0, ddof=1).mean())
                level = power * (4 * math.pi) ** 3 * DISTANCE**4 / (wavelength * SIDE) ** 2
                theory = small_perturbations(name, polarization, degrees, roughness)
                # The width of speckle along the azimuth is λ / 2D sinθ.
                apart = wavelength / (2 * SIDE * math.sin(math.radians(degrees)))
                independent = min(azimuths, 2 * math.pi / apart) * (plates - 1)
                found.append(
                    Backscatter(
                        material=name,
                        polarization=polarization,
                        degrees=degrees,
                        over_theory=10 * math.log10(level / theory),
                        error=10 / math.log(10) / math.sqrt(independent),
                    )
                )
    return found


@dataclass(frozen=True, kw_only=True)
class Energy:
    """Specular and diffuse power of a rough conducting plate, over the incident power."""

    polarization: str
    mirrored: float  # [-]
    diffuse: float  # [-]

    @property
    def whole(self) -> float:
        """Sum of both. [-]."""
        return self.mirrored + self.diffuse


def energy(plates: int, directions: int, roughness: Roughness, degrees: float) -> list[Energy]:
    """Sum the power scattered by a rough conducting plate.

    Parameters
    ----------
    plates, directions
        Numbers of realisations, and of receivers over the half space.
    roughness, degrees
        Of the plate; incidence off its normal.
    """
    wavelength = speed_of_light / FREQUENCY
    sender = DISTANCE * np.array([math.sin(math.radians(degrees)), 0.0, 0.0])
    sender[2] = math.sqrt(DISTANCE**2 - sender[0] ** 2)
    # Equal solid angles: a Fibonacci spiral over the half space; the specular direction first.
    order = np.arange(directions) + 0.5
    up, turn = order / directions, np.pi * (1 + 5**0.5) * order
    flat = np.sqrt(1 - up**2)
    places = DISTANCE * np.stack([flat * np.cos(turn), flat * np.sin(turn), up], axis=-1)
    receivers = np.concatenate([sender[None] * [-1.0, 1.0, 1.0], places])
    senders = np.broadcast_to(sender, receivers.shape)
    made = [surface_facets(plate(roughness, seed), wavelength=wavelength) for seed in range(plates)]
    smooth = plate(roughness, 0)
    mirror = surface_facets(replace(smooth, vertices=smooth.mean_vertices))
    found = []
    for name, sent in (("h", ACROSS), ("v", UPRIGHT)):
        diffuse, ratio = 0.0, 0j
        for received in (ACROSS, UPRIGHT):
            sums = np.stack([links(one, senders, receivers, (sent, received)) for one in made])
            power = np.var(sums, axis=0, ddof=1)[1:].mean()
            # Scattering coefficient over 4 pi cos(incidence), over the half space.
            level = power * (4 * math.pi) ** 3 * DISTANCE**4 / (wavelength * SIDE) ** 2
            diffuse += level / (4 * math.pi * math.cos(math.radians(degrees))) * 2 * math.pi
            if received is sent:
                flat_link = links(mirror, senders[:1], receivers[:1].copy(), (sent, received))[0]
                ratio = complex(sums[:, 0].mean() / flat_link)
        found.append(Energy(polarization=name, mirrored=abs(ratio) ** 2, diffuse=float(diffuse)))
    return found
