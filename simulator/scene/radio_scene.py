"""A scenario made ready to be simulated: frozen facets, the scene for rays, antenna ports."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from scenes.random_streams import random_stream
from scenes.realisations.object_surface import object_surface
from scenes.scenario import Scenario, ScenarioError
from scenes.schema.antenna import Antenna, Isotropic
from scenes.schema.materials import Slab
from scenes.surfaces.tiled_faces import Reach
from simulator.antennas.field_pattern import field_gain
from simulator.antennas.ports import Pattern, Ports, isotropic
from simulator.geometry.faces import scattering_faces
from simulator.geometry.facets import Facets, scene_facets
from simulator.geometry.mean_surfaces import mean_surfaces
from simulator.geometry.ray_scene import RayScene, build_scene, facets_visible
from simulator.materials.facet_reflection import reflection_nodes
from simulator.materials.fresnel_slab import Absorber, Dielectric, Material, named_material
from simulator.materials.permittivity import (
    ConstantPermittivity,
    MaterialError,
    Permittivity,
    read_permittivity,
)
from simulator.receiver.impairments import position_jitter
from simulator.scene.array_antennas import array_group, in_space, needed_reach, sending_group
from simulator.scene.scene_mirrors import SceneMirrors, scene_mirrors
from simulator.specular.diffuse_chains import diffuse_legs, may_reach
from simulator.visibility.mutual_visibility import MutualVisibility


@dataclass(frozen=True, kw_only=True)
class RadioScene:
    """One realisation of a scenario: the same facets for every antenna and frequency."""

    scenario: Scenario
    rays: RayScene
    facets: Facets | None  # None: nothing scatters
    elements: Float[np.ndarray, "elements 3"]  # where the array's antennas truly stand [m]
    scattering: tuple[str, ...] = ()  # names of the objects that the facets' materials belong to
    mirrors: SceneMirrors | None = None  # in space

    def facets_of(self, name: str) -> Facets:
        """Return the facets of one object."""
        if self.facets is None or self.facets.material is None or name not in self.scattering:
            raise ValueError(f"{name!r} has no facets; known: {', '.join(self.scattering)}")
        return self.facets.part(np.flatnonzero(self.facets.material == self.scattering.index(name)))

    @cached_property
    def mutual_visibility(self) -> MutualVisibility:
        """Which facets see each other: the same for all antennas, in echo and uplinks."""
        faces = () if self.facets is None else scattering_faces(self.facets)
        return MutualVisibility(self.rays, faces)


def radio_scene(scenario: Scenario, *, seed: int, sample: int) -> RadioScene:
    """Draw the rough surfaces of a scenario and build its scene.

    Raises
    ------
    ScenarioError
        If a material is not known over the band, or its table cannot be read.
    """
    materials = scenario_materials(scenario)  # first: it is quick, and may fail
    elements = true_elements(scenario, seed=seed, sample=sample)
    if scenario.max_bounces == 0:  # surfaces only block rays
        rays = build_scene(mean_surfaces(scenario))
        return RadioScene(scenario=scenario, rays=rays, facets=None, elements=elements)
    mirrors = _mirrors(scenario, materials, elements) if in_space(scenario) else None
    surfaces, scattering = [], {}
    for name, material in materials.items():
        absorbs = isinstance(material, Absorber)  # only blocks rays
        reach: Reach | None = None
        if mirrors is not None and not absorbs:
            legs = mirrors.legs if name in mirrors.targets else ()
            rough = [
                one
                for one in diffuse_legs(mirrors.mirrors, mirrors.chains)
                if mirrors.owners[one.rough] == name
                and may_reach(mirrors.mirrors, one, array_group(scenario, elements))
            ]
            reach = needed_reach(scenario, elements, legs, rough)
        surface = object_surface(scenario, name, seed=seed, sample=sample, reach=reach)
        surfaces.append(surface)
        if len(surface.cells) and not absorbs:
            scattering[name] = (surface, material)
    return RadioScene(
        scenario=scenario,
        # Roughness is the weights' business, and hides nothing.
        rays=build_scene(surfaces, mean=True),
        facets=(
            scene_facets(
                list(scattering.values()),
                polarization=scenario.radio.polarization,
                wavelength=middle_wavelength(scenario),
            )
            if scattering
            else None
        ),
        elements=elements,
        scattering=tuple(scattering),
        mirrors=mirrors,
    )


def middle_wavelength(scenario: Scenario) -> float:
    """Wavelength in the middle of the band [m]."""
    frequencies = scenario.radio.frequencies
    return float(2.0 * speed_of_light / (frequencies[0] + frequencies[-1]))


def _mirrors(
    scenario: Scenario,
    materials: dict[str, Material],
    elements: Float[np.ndarray, "elements 3"],
) -> SceneMirrors:
    array = array_group(scenario, elements)
    send = sending_group(scenario, elements)
    return scene_mirrors(scenario, materials, (array,) if send is None else (array, send))


def true_elements(scenario: Scenario, *, seed: int, sample: int) -> Float[np.ndarray, "elements 3"]:
    """Return where the base station's antennas stand, jitter included [m]."""
    nominal = scenario.base_station.element_positions
    jitter = scenario.impairments.position_jitter
    if jitter == 0:
        return nominal
    return position_jitter(
        nominal,
        rms=jitter,
        dimensions=scenario.dimensions,
        rng=random_stream(seed, sample, "position_jitter"),
    )


def scenario_materials(scenario: Scenario) -> dict[str, Material]:
    """Return what each object is made of.

    Raises
    ------
    ScenarioError
        If a material is not known over the band, ripples too fast over it, or its table of
        permittivity cannot be read; the message names the object's key.
    """
    frequencies = scenario.radio.frequencies
    made: dict[str | Slab, Material] = {}
    for name, body in scenario.objects.items():
        if body.material in made:
            continue
        try:
            material = _material(body.material, frequencies)
            reflection_nodes(material, float(frequencies[0]), float(frequencies[-1]))
        except MaterialError as error:
            raise ScenarioError(f"objects.{name}.material: {error}") from None
        made[body.material] = material
    return {name: made[body.material] for name, body in scenario.objects.items()}


def _material(material: str | Slab, frequencies: Float[np.ndarray, " freqs"]) -> Material:
    if isinstance(material, str):
        return named_material(material, frequencies)
    if material.name is not None:
        return named_material(material.name, frequencies, thickness=material.thickness)
    permittivity: Permittivity
    if material.permittivity is not None:
        real, loss = material.permittivity
        permittivity = ConstantPermittivity(value=complex(real, -loss))
    else:
        permittivity = read_permittivity(Path(str(material.file)))
        permittivity(frequencies)  # refuses a band that it does not cover
    return Dielectric(permittivity=permittivity, thickness=material.thickness)


def antenna_pattern(antenna: Antenna, aim: Float[np.ndarray, " 3"]) -> Pattern:
    """Return an antenna's field pattern as the facets use it; it does not vary with frequency."""
    if isinstance(antenna, Isotropic):
        return isotropic

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
