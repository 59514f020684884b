"""The echo between separate transmitters and receivers (multistatic), in three dimensions.

Plates are divided into tiles, so that the facets of a rough one are never all in memory; tiles
outside the product of the antennas' patterns are left out. A plate does not hide itself by its own
roughness: rays are traced among the mean surfaces of all other objects.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Bool, Complex, Float
from scipy.constants import speed_of_light

from scenes.realisations.object_surface import Surface, object_surface
from scenes.realisations.plate_tiles import plate_sheet
from scenes.scenario import Scenario
from scenes.schema.antenna import Antenna
from scenes.schema.objects import Plate
from simulator.antennas.polarization import antenna_polarization
from simulator.antennas.ports import Ports
from simulator.geometry.facets import Facets, surface_facets
from simulator.geometry.mean_surfaces import mean_surfaces
from simulator.geometry.ray_scene import RayScene, build_scene, facets_visible
from simulator.materials.fresnel_slab import Absorber, Material
from simulator.scattering.bistatic_kernel import BistaticKernel, Port, pattern_table
from simulator.scattering.physical_optics import scattered
from simulator.scene.radio_scene import (
    RadioScene,
    antenna_pattern,
    scenario_materials,
    true_elements,
)

TILE_CELLS = 700
"""Cells along each side of a tile: a million triangles, 200 MB with derived arrays. [-]"""

FAINTEST = 1e-3
"""Product of both field patterns, relative to their peaks, below which a tile is left out: its
contribution is at -60 dB, and that of the edge so created another 60 dB lower. [-]"""

FEW_FREQUENCIES = 64
"""Frequencies up to which a sum at each one is faster than a non-uniform FFT over the band. [-]"""

MASKS_KEPT = 2
"""Antennas whose visibility masks are cached: the transmitter and the last receiver. [-]"""


@dataclass(frozen=True, kw_only=True)
class MultistaticScene:
    """One realisation of a scenario with separate transmitters and receivers."""

    radio: RadioScene  # its ray scene holds plates as mean planes; it has no facets
    materials: dict[str, Material]
    shaped: tuple[Surface, ...]  # all objects but plates, with their roughness
    seed: int
    sample: int  # of the roughness

    @property
    def scenario(self) -> Scenario:
        """The scenario."""
        return self.radio.scenario

    def around(self, name: str) -> list[Surface]:
        """All objects but one: plates as their mean planes, others with their roughness."""
        planes = [plane for plane in _mean_plates(self.scenario) if plane.name != name]
        return [*planes, *(surface for surface in self.shaped if surface.name != name)]


def multistatic_scene(
    scenario: Scenario, *, seed: int, sample: int, realisation: int | None = None
) -> MultistaticScene:
    """Prepare a scenario for simulation, except for the facets of its plates.

    Parameters are those of :func:`simulator.scene.radio_scene.radio_scene`.

    Raises
    ------
    ScenarioError
        If a material is not known over the band, or its table cannot be read.
    """
    frozen = sample if realisation is None else realisation
    materials = scenario_materials(scenario)
    shaped = tuple(
        object_surface(scenario, name, seed=seed, sample=frozen)
        for name, body in scenario.objects.items()
        if not isinstance(body, Plate)
    )
    radio = RadioScene(
        scenario=scenario,
        rays=build_scene([*_mean_plates(scenario), *shaped], mean=True),
        facets=None,
        elements=true_elements(scenario, seed=seed, sample=sample),
    )
    return MultistaticScene(
        radio=radio, materials=materials, shaped=shaped, seed=seed, sample=frozen
    )


def multistatic_echo(
    scene: MultistaticScene, *, advance: Callable[[], None]
) -> Complex[np.ndarray, "links freqs"]:
    """Simulate the noise-free echo of each pair of transmitter and receiver, over one bounce.

    Parameters
    ----------
    scene
        The frozen scene.
    advance
        Called once for each link, as the work goes on.

    Returns
    -------
    S-parameter of each link. [-]
    """
    links = _links(scene)
    echo = np.zeros((len(links), scene.scenario.radio.points), dtype=np.complex128)
    told = 0
    for part, share in _parts(scene):
        sums = _PartSums(part, scene.scenario.radio.frequencies)
        for index, link in enumerate(links):
            if link.bound(part) >= FAINTEST:
                echo[index] += sums(link)
            done = int((share[0] + (index + 1) / len(links)) / share[1] * len(links) + 1e-9)
            while told < done:
                told += 1
                advance()
    while told < len(links):
        told += 1
        advance()
    return echo


@dataclass(frozen=True, kw_only=True)
class _End:
    """An antenna, in the representations of the kernel and of the rest of the simulator."""

    port: Port
    antenna: Antenna


@dataclass(frozen=True, kw_only=True)
class _Link:
    transmit: _End
    receive: _End

    @property
    def ends(self) -> tuple[_End, _End]:
        return self.transmit, self.receive

    def bound(self, part: "_Part") -> float:
        """Upper bound of the patterns' product over a part, relative to their peaks. [-]."""
        if part.ball is None:
            return 1.0
        return math.prod(end.port.bound(*part.ball) for end in self.ends)


@dataclass(frozen=True, kw_only=True)
class _Part:
    """A whole object, or a tile of a plate."""

    surface: Callable[[], Surface]
    material: Material
    rays: RayScene  # surfaces that may hide it, without a plate's own facets
    ball: tuple[Float[np.ndarray, " 3"], float] | None  # bounding sphere [m]; None: unknown


class _PartSums:
    """The facets of a part, made for the first link that needs them."""

    def __init__(self, part: _Part, frequencies: Float[np.ndarray, " freqs"]) -> None:
        self.part, self.frequencies = part, frequencies
        self._surface: Surface | None = None
        self._kernel: BistaticKernel | None = None
        self._facets: Facets | None = None
        self._seen: dict[bytes, Bool[np.ndarray, " facets"] | None] = {}

    def __call__(self, link: _Link) -> Complex[np.ndarray, " freqs"]:
        seen = [self._seen_from(end) for end in link.ends]
        if self.frequencies.size > FEW_FREQUENCIES:
            return self._over_the_band(link, seen)
        lit = [mask for mask in seen if mask is not None]
        if self._kernel is None:
            self._kernel = BistaticKernel(self.surface, self.part.material, self.frequencies)
        return self._kernel.link(
            link.transmit.port,
            link.receive.port,
            np.logical_and.reduce(lit) if lit else None,
        )

    @property
    def surface(self) -> Surface:
        if self._surface is None:
            self._surface = self.part.surface()
        return self._surface

    @property
    def facets(self) -> Facets:
        if self._facets is None:
            middle = 2 * speed_of_light / float(self.frequencies[0] + self.frequencies[-1])
            self._facets = surface_facets(self.surface, self.part.material, wavelength=middle)
        return self._facets

    def _seen_from(self, end: _End) -> Bool[np.ndarray, " facets"] | None:
        place = end.port.position
        key = place.tobytes()
        if key in self._seen:
            self._seen[key] = self._seen.pop(key)  # the transmitter's is dropped last
            return self._seen[key]
        mask: Bool[np.ndarray, " facets"] | None = None
        if self.part.rays.objects:
            mask = facets_visible(self.part.rays, self.facets, place[None])[0]
        if len(self._seen) >= MASKS_KEPT:
            del self._seen[next(iter(self._seen))]
        self._seen[key] = mask
        return mask

    def _over_the_band(
        self, link: _Link, seen: list[Bool[np.ndarray, " facets"] | None]
    ) -> Complex[np.ndarray, " freqs"]:
        everything = np.ones(self.facets.count, dtype=bool)
        transmit, receive = (
            Ports(
                positions=end.port.position[None],
                pattern=antenna_pattern(end.antenna, end.port.aim),
                visible=(everything if mask is None else mask)[None],
                polarization=end.port.polarization,
            )
            for end, mask in zip(link.ends, seen, strict=True)
        )
        return np.asarray(
            scattered(self.facets, transmit, receive, self.frequencies, waves="spherical")[0]
        )


def _links(scene: MultistaticScene) -> list[_Link]:
    scenario, station = scene.scenario, scene.scenario.base_station
    elements = scene.radio.elements
    senders = station.transmit_positions(elements)
    senders = elements if senders is None else senders
    ends = []
    for antenna, places, aims in (
        (station.transmit_antenna, senders, scenario.transmit_aims(senders)),
        (station.antenna, elements, scenario.element_aims(elements)),
    ):
        pattern = pattern_table(antenna)
        ends.append(
            [
                _End(
                    port=Port(
                        position=place,
                        aim=aim,
                        pattern=pattern,
                        polarization=antenna_polarization(antenna, aim),
                    ),
                    antenna=antenna,
                )
                for place, aim in zip(places, aims, strict=True)
            ]
        )
    return [
        _Link(transmit=transmit, receive=receive) for transmit, receive in zip(*ends, strict=True)
    ]


def _parts(scene: MultistaticScene) -> Iterator[tuple[_Part, tuple[float, float]]]:
    """Yield each scattering part, with the amount of work before it and in all."""
    scenario = scene.scenario
    names = [
        name
        for name in scenario.objects
        if scenario.max_bounces > 0 and not isinstance(scene.materials[name], Absorber)
    ]
    for place, name in enumerate(names):
        body, material = scenario.objects[name], scene.materials[name]
        if not isinstance(body, Plate):
            part = _Part(
                surface=partial(_named, scene.shaped, name),
                material=material,
                rays=scene.radio.rays,
                ball=None,
            )
            yield part, (place, len(names))
            continue
        rays = build_scene(scene.around(name), mean=True)
        sheet = plate_sheet(scenario, name, seed=scene.seed, sample=scene.sample)
        tiles = list(sheet.tiles(TILE_CELLS))
        for number, tile in enumerate(tiles):
            part = _Part(
                surface=partial(sheet.surface, tile),
                material=material,
                rays=rays,
                ball=(tile.centre, tile.radius + sheet.highest),
            )
            yield part, (place * len(tiles) + number, len(names) * len(tiles))


def _named(surfaces: tuple[Surface, ...], name: str) -> Surface:
    return next(surface for surface in surfaces if surface.name == name)


def _mean_plates(scenario: Scenario) -> list[Surface]:
    return [
        surface
        for surface in mean_surfaces(scenario)
        if isinstance(scenario.objects[surface.name], Plate)
    ]
