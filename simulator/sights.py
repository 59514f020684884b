"""The antennas of a scenario in space, and where facets are needed because they look there."""

from collections.abc import Sequence
from functools import partial
from itertools import product

import numpy as np
from jaxtyping import Float

from scenes.antenna import Antenna
from scenes.scenario import Scenario
from scenes.tiled_faces import Reach
from simulator.antenna_pattern import AntennaPattern
from simulator.reach import Sight, in_reach
from simulator.specular_legs import DIRECT, Leg


def in_space(scenario: Scenario) -> bool:
    """Tell whether a scenario is three-dimensional and heard by an array of parallel antennas."""
    return scenario.dimensions == 3 and not scenario.base_station.multistatic


def array_sight(scenario: Scenario, elements: Float[np.ndarray, "elements 3"]) -> Sight:
    """Return the array's antennas, which look in parallel."""
    return _sight(scenario, scenario.base_station.antenna, elements)


def sending_sight(scenario: Scenario, elements: Float[np.ndarray, "elements 3"]) -> Sight | None:
    """Return the antennas that transmit the array's echo; None: the elements themselves."""
    offset = scenario.base_station.transmit_offset
    if offset is None:
        return None
    return _sight(scenario, scenario.base_station.antenna, elements + offset)


def user_sight(scenario: Scenario, name: str) -> Sight:
    """Return a user's antenna."""
    user = scenario.users[name]
    return _sight(scenario, user.antenna, user.position[None])


def needed_reach(
    scenario: Scenario, elements: Float[np.ndarray, "elements 3"], legs: Sequence[Leg]
) -> Reach:
    """Tell where facets of an object are needed.

    Parameters
    ----------
    scenario
        Its base station and its users.
    elements
        Where the array's antennas truly stand. [m]
    legs
        Ways over mirrors on which the object is seen, too.
    """
    array = array_sight(scenario, elements)
    send = sending_sight(scenario, elements) or array
    most = scenario.max_bounces - 1
    pairs = [
        (out.image(send), back.image(array))
        for out, back in product((DIRECT, *legs), repeat=2)
        if out.bounces + back.bounces <= most
    ]
    pairs += [(user_sight(scenario, name), array) for name in scenario.users]
    return partial(in_reach, pairs)


def _sight(scenario: Scenario, antenna: Antenna, positions: Float[np.ndarray, "n 3"]) -> Sight:
    aim = scenario.aim(antenna, positions.mean(axis=0))
    return Sight(positions=positions, pattern=AntennaPattern(antenna, aim))
