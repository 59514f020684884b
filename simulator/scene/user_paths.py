"""The specular paths between each user and the middle of the array, with complex gains."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Float

from scenes.scenario import Scenario
from simulator.geometry.mirrors import Mirrors
from simulator.geometry.ray_scene import blocked
from simulator.materials.gas_absorption import refractive_index
from simulator.scene.air import absorbed, wavelengths_of_air
from simulator.scene.array_antennas import array_group, user_group
from simulator.scene.radio_scene import RadioScene, radio_scene
from simulator.scene.scene_mirrors import SceneMirrors
from simulator.specular.image_method import Chain, find_chains
from simulator.specular.path_field import chain_response


@dataclass(frozen=True, kw_only=True)
class UserPath:
    """One specular path from a user to a place of the array."""

    vertices: Float[np.ndarray, "vertices 3"]  # user, reflections, array [m]
    length: float  # [m]
    gain: complex  # S-parameter, with the phase of its delay [-]
    slabs: tuple[int, ...]  # how many are crossed on each leg

    @property
    def bounces(self) -> int:
        """Number of reflections."""
        return len(self.vertices) - 2


def user_paths(
    scenario: Scenario,
    *,
    frequency: float | None = None,
    place: Float[np.ndarray, " 3"] | None = None,
) -> dict[str, tuple[UserPath, ...]]:
    """Find the paths of each user: direct, over up to ``max_bounces`` mirrors, through slabs.

    Parameters
    ----------
    scenario
        In space; its flat surfaces reflect as mirrors, with the coherent loss of their roughness.
        Facets, edges and the diffuse background have no paths.
    frequency
        At which gains are given; the middle of the band by default. [Hz]
    place
        Where the paths end, in the array; its middle by default. [m]

    Returns
    -------
    The strongest first, by the users' names.

    Raises
    ------
    ValueError
        If the scenario has two dimensions, or no bounce.
    """
    scene = radio_scene(wavelengths_of_air(scenario), seed=0, sample=0)
    if scene.mirrors is None:
        raise ValueError(
            f"scenario {scenario.name!r}: dimensions = {scenario.dimensions}, max_bounces = "
            f"{scenario.max_bounces}; paths are found in 3 dimensions, over at least 1 bounce"
        )
    end = scene.elements.mean(axis=0) if place is None else place
    at = np.array([scenario.radio.centre_frequency if frequency is None else frequency])
    at *= refractive_index(scenario.air)
    found = {}
    for name in scenario.users:
        chains = _chains(scene, scene.mirrors, name, end)
        mirrors = scene.mirrors.mirrors
        paths = [_path(scene, mirrors, name, end, chain, at) for chain in chains]
        paths = [_weakened(scenario, path, at) for path in paths]
        found[name] = tuple(sorted(paths, key=lambda one: -abs(one.gain)))
    return found


def _chains(
    scene: RadioScene, mirrors: SceneMirrors, name: str, end: Float[np.ndarray, " 3"]
) -> tuple[Chain, ...]:
    scenario = scene.scenario
    legs = [leg.sequence[::-1] for leg in mirrors.chains if leg.bounces > 0]
    if not legs:  # of one bounce, facets alone take care
        legs = [(mirror,) for mirror in range(len(mirrors.mirrors))]
    return find_chains(
        mirrors.mirrors,
        scenario.users[name].position[None],
        end[None],
        blocked=partial(blocked, scene.rays),
        clearance=scene.rays.clearance,
        max_bounces=scenario.max_bounces,
        min_bounces=0 if scenario.effects.line_of_sight else 1,
        slabs=scene.slabs,
        among=legs,
    )


def _path(
    scene: RadioScene,
    mirrors: Mirrors,
    name: str,
    end: Float[np.ndarray, " 3"],
    chain: Chain,
    at: Float[np.ndarray, " one"],
) -> UserPath:
    scenario = scene.scenario
    sender, array = user_group(scenario, name), array_group(scenario, end[None])
    response = chain_response(mirrors, chain, at, sender, array, scene.slabs)
    crossed = [0] * (len(chain.mirrors) + 1)
    if chain.crossed is not None:
        crossed = chain.crossed[0].tolist()
    return UserPath(
        vertices=np.array([scenario.users[name].position, *chain.vertices[0], end]),
        length=float(chain.lengths[0]),
        gain=complex(response[0]),
        slabs=tuple(len(scene.slabs.crossings(one)) if one else 0 for one in crossed),
    )


def _weakened(scenario: Scenario, path: UserPath, at: Float[np.ndarray, " one"]) -> UserPath:
    return replace(path, gain=path.gain * float(absorbed(scenario, at, path.length)[0]))
