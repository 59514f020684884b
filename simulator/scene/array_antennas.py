"""The antennas of a 3-D scenario, and the regions in which their beams require facets."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from jaxtyping import Bool, Float

from scenes.scenario import Scenario
from scenes.schema.antenna import Antenna
from scenes.surfaces.tiled_faces import Reach
from simulator.antennas.antenna_pattern import ISOTROPIC, AntennaPattern
from simulator.antennas.beam_culling import AntennaGroup, in_reach
from simulator.antennas.polarization import antenna_polarization
from simulator.specular.diffuse_chains import DIFFUSE_LEVEL, DiffuseLeg
from simulator.specular.image_sources import DIRECT, Leg


def in_space(scenario: Scenario) -> bool:
    """Return whether a scenario is 3-D and received by an array of parallel antennas."""
    return scenario.dimensions == 3 and not scenario.base_station.multistatic


def array_group(scenario: Scenario, elements: Float[np.ndarray, "elements 3"]) -> AntennaGroup:
    """Return the array's antennas, which all have the same aim."""
    return _group(scenario, scenario.base_station.antenna, elements)


def sending_group(
    scenario: Scenario, elements: Float[np.ndarray, "elements 3"]
) -> AntennaGroup | None:
    """Return the antennas that transmit for the echo; None: the elements themselves."""
    offset = scenario.base_station.transmit_offset
    if offset is None:
        return None
    return _group(scenario, scenario.base_station.antenna, elements + offset)


def user_group(scenario: Scenario, name: str) -> AntennaGroup:
    """Return a user's antenna."""
    user = scenario.users[name]
    return _group(scenario, user.antenna, user.position[None])


def needed_reach(
    scenario: Scenario,
    elements: Float[np.ndarray, "elements 3"],
    legs: Sequence[Leg],
    rough: Sequence[DiffuseLeg] = (),
) -> Reach:
    """Return the region in which facets of an object are needed.

    Parameters
    ----------
    scenario
        Supplies the base station and the users.
    elements
        True positions of the array's antennas, jitter included. [m]
    legs
        Legs over mirrors that illuminate the object, too.
    rough
        Legs over several mirrors, of which the object is the one that scatters diffusely.
    """
    array = array_group(scenario, elements)
    send = sending_group(scenario, elements) or array
    most = scenario.max_bounces - 1
    ways = (DIRECT, *legs)
    outward, homeward = ([leg.image(group) for leg in ways] for group in (send, array))
    bounces = np.array([leg.bounces for leg in ways])
    chosen = np.argwhere(bounces[:, None] + bounces <= most).tolist()
    pairs = [(outward[out], homeward[back]) for out, back in chosen]
    users = [user_group(scenario, name) for name in scenario.users]
    pairs += [(ways[out].image(user), homeward[back]) for user in users for out, back in chosen]
    over_several = []
    for chain in rough:
        ends = {id(sight): chain.before.image(sight) for sight in (send, array)}
        if chain.bounces <= most and chain.before.bounces:  # to a target, in any direction
            over_several += [(end, _anywhere(end)) for end in ends.values()]
        if chain.bounces >= 2:
            over_several += [(chain.after.image(user), ends[id(array)]) for user in users]
    return partial(_either, pairs, over_several)


def _anywhere(sight: AntennaGroup) -> AntennaGroup:
    return AntennaGroup(positions=sight.positions[:1], pattern=ISOTROPIC)


def _either(
    pairs: Sequence[tuple[AntennaGroup, AntennaGroup]],
    diffuse: Sequence[tuple[AntennaGroup, AntennaGroup]],
    centres: Float[np.ndarray, "spheres 3"],
    radius: float,
) -> Bool[np.ndarray, " spheres"]:
    reached: np.ndarray = in_reach(pairs, centres, radius)
    left = np.flatnonzero(~reached)
    reached[left] = in_reach(diffuse, centres[left], radius, level=DIFFUSE_LEVEL)
    return reached


def _group(
    scenario: Scenario, antenna: Antenna, positions: Float[np.ndarray, "n 3"]
) -> AntennaGroup:
    aim = scenario.aim(antenna, positions.mean(axis=0))
    pattern = AntennaPattern(antenna, aim, antenna_polarization(antenna, aim))
    return AntennaGroup(positions=positions, pattern=pattern)
