"""A scenario prepared for simulation: frozen facets, the scene for ray tests, antenna ports."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Complex, Float
from scipy.constants import speed_of_light

from scenes.random_streams import random_stream
from scenes.realisations.object_surface import Surface, object_surface
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
from simulator.geometry.slabs import Slabs, no_slabs, sets_among
from simulator.materials.facet_reflection import reflection_nodes
from simulator.materials.fresnel_slab import Absorber, Dielectric, Material, named_material
from simulator.materials.permittivity import (
    ConstantPermittivity,
    MaterialError,
    Permittivity,
    PermittivityInMedium,
    PowerLawPermittivity,
    read_permittivity,
)
from simulator.materials.slab_insertion import (
    LEAST_LEVEL,
    Crossing,
    passage_level,
    passage_nodes,
    through_slabs,
)
from simulator.receiver.impairments import position_jitter
from simulator.scene.air import RadioInMedium
from simulator.scene.array_antennas import array_group, in_space, needed_reach, sending_group
from simulator.scene.level_of_detail import mirrored_bodies
from simulator.scene.scene_mirrors import SceneMirrors, scene_mirrors
from simulator.scene.scene_slabs import scene_slabs
from simulator.specular.diffuse_chains import diffuse_legs, may_reach
from simulator.visibility.mutual_visibility import MutualVisibility


@dataclass(frozen=True, kw_only=True)
class RadioScene:
    """One realisation of a scenario: the same facets for every antenna and frequency."""

    scenario: Scenario
    rays: RayScene  # of the opaque surfaces
    facets: Facets | None  # None: nothing scatters
    elements: Float[np.ndarray, "elements 3"]  # true positions of the array's antennas [m]
    scattering: tuple[str, ...] = ()  # objects to which the facets' material indices refer
    mirrors: SceneMirrors | None = None  # in 3-D
    slabs: Slabs = field(default_factory=no_slabs)  # surfaces that transmit waves
    surfaces: tuple[Surface, ...] = ()  # of all objects

    @cached_property
    def rays_to_all(self) -> RayScene:
        """The scene of all surfaces, transmitting ones included."""
        if not len(self.slabs):
            return self.rays
        return build_scene(self.surfaces, mean=True)

    def facets_of(self, name: str) -> Facets:
        """Return the facets of one object."""
        if self.facets is None or self.facets.material is None or name not in self.scattering:
            raise ValueError(f"{name!r} has no facets; known: {', '.join(self.scattering)}")
        return self.facets.part(np.flatnonzero(self.facets.material == self.scattering.index(name)))

    def facet_target(self, sequence: Sequence[int]) -> str | None:
        """Name the target that a chain of flat faces in space is cut into facets at.

        It is the last one in the scene of those of which the chain meets just one face; None:
        physical optics is left to a mean plane.
        """
        if self.mirrors is None:
            return None
        owners = [self.mirrors.owners[mirror] for mirror in sequence]
        once = [name for name in self.scattering if owners.count(name) == 1]
        return next((name for name in reversed(once) if name in self.mirrors.targets), None)

    @cached_property
    def mutual_visibility(self) -> MutualVisibility:
        """Mutual visibility of the facets: the same for all antennas, in echo and uplinks."""
        faces = () if self.facets is None else scattering_faces(self.facets)
        frequencies = self.scenario.radio.frequencies
        band = float(frequencies[0]), float(frequencies[-1])
        return MutualVisibility(self.rays, faces, slabs=self.slabs, band=band)


def radio_scene(
    scenario: Scenario, *, seed: int, sample: int, realisation: int | None = None
) -> RadioScene:
    """Draw the rough surfaces of a scenario and build its scene.

    Parameters
    ----------
    scenario
        The scenario.
    seed, sample
        Which realisation.
    realisation
        Sample whose roughness it has; None: its own.

    Raises
    ------
    ScenarioError
        If a material is not known over the band, or its table cannot be read.
    """
    frozen = sample if realisation is None else realisation
    materials = scenario_materials(scenario)  # first: errors show before long work
    elements = true_elements(scenario, seed=seed, sample=sample)
    slabs = scene_slabs(scenario, materials)
    if scenario.max_bounces == 0:  # surfaces only block rays
        plain = tuple(mean_surfaces(scenario))
        return RadioScene(
            scenario=scenario,
            rays=build_scene(opaque(plain, slabs)),
            facets=None,
            elements=elements,
            slabs=slabs,
            surfaces=plain,
        )
    mirrored = mirrored_bodies(scenario, materials, elements)
    mirrors = None
    if in_space(scenario):
        mirrors = _mirrors(scenario, materials, elements, mirrored=mirrored, slabs=slabs)
    coarse = {surface.name: surface for surface in mean_surfaces(scenario)} if mirrored else {}
    surfaces, scattering = [], {}
    for name, material in materials.items():
        if name in mirrored:
            surfaces.append(coarse[name])
            continue
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
        surface = object_surface(scenario, name, seed=seed, sample=frozen, reach=reach)
        surfaces.append(surface)
        if len(surface.cells) and not absorbs:
            scattering[name] = (surface, material)
    return RadioScene(
        scenario=scenario,
        # Rays meet the mean surface: roughness enters the facets' weights and casts no shadow.
        rays=build_scene(opaque(surfaces, slabs), mean=True),
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
        slabs=slabs,
        surfaces=tuple(surfaces),
    )


def opaque(surfaces: Sequence[Surface], slabs: Slabs) -> list[Surface]:
    """Return the opaque surfaces."""
    return [surface for surface in surfaces if surface.name not in slabs.owners]


def middle_wavelength(scenario: Scenario) -> float:
    """Wavelength in the middle of the band [m]."""
    frequencies = scenario.radio.frequencies
    return float(2.0 * speed_of_light / (frequencies[0] + frequencies[-1]))


def _mirrors(
    scenario: Scenario,
    materials: dict[str, Material],
    elements: Float[np.ndarray, "elements 3"],
    *,
    mirrored: frozenset[str],
    slabs: Slabs,
) -> SceneMirrors:
    array = array_group(scenario, elements)
    send = sending_group(scenario, elements)
    return scene_mirrors(
        scenario,
        materials,
        (array,) if send is None else (array, send),
        mirrored=mirrored,
        passing=frozenset(slabs.owners),
    )


def true_elements(scenario: Scenario, *, seed: int, sample: int) -> Float[np.ndarray, "elements 3"]:
    """Return the true positions of the base station's antennas, jitter included [m]."""
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
    """Return the material of each object.

    Raises
    ------
    ScenarioError
        If a material is not known over the band, its coefficients ripple too fast to be
        interpolated, or its table of permittivity cannot be read; the message names the key.
    """
    radio = scenario.radio
    frequencies = radio.frequencies
    known = np.array(radio.band) if isinstance(radio, RadioInMedium) else frequencies
    made: dict[str | Slab, Material] = {}
    for name, body in scenario.objects.items():
        if body.material in made:
            continue
        try:
            material = _material(body.material, known)
            if isinstance(radio, RadioInMedium):
                material = _in_medium(material, radio)
            reflection_nodes(material, float(frequencies[0]), float(frequencies[-1]))
        except MaterialError as error:
            raise ScenarioError(f"objects.{name}.material: {error}") from None
        made[body.material] = material
    return {name: made[body.material] for name, body in scenario.objects.items()}


def _in_medium(material: Material, radio: RadioInMedium) -> Material:
    if not isinstance(material, Dielectric):
        return material
    relative = PermittivityInMedium(
        permittivity=material.permittivity, refractive_index=radio.refractive_index, band=radio.band
    )
    return replace(material, permittivity=relative)


def _material(material: str | Slab, frequencies: Float[np.ndarray, " freqs"]) -> Material:
    if isinstance(material, str):
        return named_material(material, frequencies)
    if material.name is not None:
        return named_material(
            material.name, frequencies, thickness=material.thickness, beyond=material.beyond_itu
        )
    permittivity: Permittivity
    if material.permittivity is not None:
        real, loss = material.permittivity
        permittivity = ConstantPermittivity(value=complex(real, -loss))
        if material.conductivity_s_m is not None:
            permittivity = PowerLawPermittivity.of_conductivity(real, material.conductivity_s_m)
    else:
        permittivity = read_permittivity(Path(str(material.file)))
        permittivity(frequencies)  # refuses a band that it does not cover
    return Dielectric(permittivity=permittivity, thickness=material.thickness)


def antenna_pattern(antenna: Antenna, aim: Float[np.ndarray, " 3"]) -> Pattern:
    """Return an antenna's field pattern for the sum over facets, the same at all frequencies."""
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
    """Return ports of equal antennas, with the facets visible to each and the slabs between."""
    ports = Ports(
        positions=positions,
        pattern=antenna_pattern(antenna, scene.scenario.aim(antenna, positions.mean(axis=0))),
        visible=facets_visible(scene.rays, facets, positions),
    )
    if not len(scene.slabs):
        return ports
    off = scene.rays.clearance
    crossed = scene.slabs.crossed_between(positions, facets.places, off=off)
    behind = [
        _through(scene, ports, scene.slabs.crossings(one), crossed == one)
        for one in sets_among(crossed, ports.visible)
    ]
    return replace(
        ports,
        visible=ports.visible & (crossed == 0),
        behind_slabs=tuple(one for one in behind if one is not None),
    )


def _through(
    scene: RadioScene,
    ports: Ports,
    crossings: tuple[Crossing, ...],
    behind: Bool[np.ndarray, "ports facets"],
) -> Ports | None:
    """Return the ports for facets behind a set of slabs; None if these transmit too little."""
    scenario = scene.scenario
    frequencies = scenario.radio.frequencies
    if passage_level(crossings, frequencies) < LEAST_LEVEL:
        return None
    added = passage_nodes(crossings, float(frequencies[0]), float(frequencies[-1])) - 1
    return replace(
        ports,
        visible=ports.visible & behind,
        pattern=partial(_inserted, ports.pattern, crossings, scenario),
        nodes=ports.nodes + added,
        slabs=(*ports.slabs, *crossings),
        slab_nodes=ports.slab_nodes + added,
    )


def _inserted(
    pattern: Pattern,
    crossings: tuple[Crossing, ...],
    scenario: Scenario,
    directions: Float[np.ndarray, "facets 3"],
    distances: Float[np.ndarray, " facets"],
    frequencies: Float[np.ndarray, " nodes"],
) -> Complex[np.ndarray, "nodes facets"]:
    inserted = through_slabs(
        crossings,
        directions,
        distances,
        frequencies,
        vertical=scenario.radio.polarization == "vertical",
        cylindrical=scenario.waves == "cylindrical",
    )
    return np.asarray(pattern(directions, distances, frequencies) * inserted.T)
