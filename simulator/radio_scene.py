"""A scenario made ready to be simulated: frozen facets, the scene for rays, antenna ports."""

from dataclasses import dataclass

import numpy as np
import sionna.rt as rt
from jaxtyping import Float

from scenes.antenna import Antenna
from scenes.scenario import Scenario
from scenes.shapes import object_surface
from simulator.antennas import field_gain
from simulator.facets import Facets, joined, surface_facets
from simulator.physical_optics import Pattern, Ports
from simulator.ray_scene import build_scene, facets_visible

CONDUCTOR = "metal"
"""The material whose facets scatter; an absorber only blocks rays."""


@dataclass(frozen=True, kw_only=True)
class RadioScene:
    """One realisation of a scenario: the same facets for every antenna and frequency."""

    scenario: Scenario
    rays: rt.Scene
    facets: Facets | None  # None: nothing scatters


def radio_scene(scenario: Scenario, *, seed: int, sample: int) -> RadioScene:
    """Draw the rough surfaces of a scenario and build its scene."""
    surfaces = [
        object_surface(scenario, name, seed=seed, sample=sample) for name in scenario.objects
    ]
    scattering = [surface_facets(surface) for surface in surfaces if surface.material == CONDUCTOR]
    return RadioScene(
        scenario=scenario,
        rays=build_scene(surfaces),
        facets=joined(scattering) if scattering else None,
    )


def antenna_pattern(antenna: Antenna, aim: Float[np.ndarray, " 3"]) -> Pattern:
    """Return an antenna's field pattern as the facets use it; it does not vary with frequency."""

    def pattern(
        directions: Float[np.ndarray, "facets 3"],
        distances: Float[np.ndarray, " facets"],
        frequencies: Float[np.ndarray, " nodes"],
    ) -> Float[np.ndarray, "1 facets"]:
        return field_gain(antenna, aim, directions)[None, :]

    return pattern


def facet_ports(
    scene: RadioScene, facets: Facets, antenna: Antenna, positions: Float[np.ndarray, "ports 3"]
) -> Ports:
    """Place equal antennas at positions and trace which facets each sees."""
    return Ports(
        positions=positions,
        pattern=antenna_pattern(antenna, scene.scenario.aim(antenna, positions.mean(axis=0))),
        visible=facets_visible(scene.rays, facets, positions),
    )
