"""Whether the frequencies lie close enough for the scene's own extent: noted, not refused."""

import math

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from scenes.meshes.mesh_file import placed_mesh
from scenes.scenario import Scenario
from scenes.schema.objects import Box, Cylinder, MeshFile, Plate


def range_notes(scenario: Scenario) -> tuple[str, ...]:
    """Return notes on objects and users beyond the unambiguous range of the frequency grid.

    Samples at a spacing Δf tell one-way paths apart up to c/Δf, and echoes up to c/2Δf. What lies
    beyond appears at a range too short by multiples of that, where it is taken for a mirror or a
    user.

    Parameters
    ----------
    scenario
        Its objects by their farthest point from the array, seen or not, and its users by their
        distance. None is told of antennas that stand by themselves: no range is imaged by them.
    """
    grid = scenario.radio.frequencies
    if grid.size < 2 or scenario.base_station.multistatic:
        return ()
    span = float(grid[-1] - grid[0])
    limit = speed_of_light * (grid.size - 1) / span  # of one-way paths
    centre = scenario.base_station.element_positions.mean(axis=0)
    reach = {
        f"objects.{name}": farthest_point(body, centre)
        for name, body in scenario.objects.items()
        if body.material != "absorber"
    }
    notes = []
    if reach and max(reach.values()) > limit / 2:
        name = max(reach, key=lambda key: reach[key])
        beyond = sum(one > limit / 2 for one in reach.values())
        notes.append(
            f"radio.points = {grid.size}: echoes are unambiguous up to c/2Δf = {limit / 2:.3g} m, "
            f"and {name} reaches to {reach[name]:.3g} m from the array"
            f"{f' ({beyond - 1} more beyond)' if beyond > 1 else ''}; what is beyond appears "
            f"nearer than it is, maybe as a false mirror (set radio.points to "
            f"{points_needed(2 * reach[name], span)} or more, or cut the scene)"
        )
    for name, user in scenario.users.items():
        distance = float(np.linalg.norm(user.position - centre))
        if distance > limit:
            notes.append(
                f"radio.points = {grid.size}: pilots are unambiguous up to c/Δf = {limit:.3g} m, "
                f"and users.{name} is {distance:.3g} m from the array (set radio.points to "
                f"{points_needed(distance, span)} or more)"
            )
    return tuple(notes)


def points_needed(length: float, span: float) -> int:
    """Count the frequencies over a band by which paths up to a length are told apart.

    Parameters
    ----------
    length
        Of the whole path. [m]
    span
        From the first frequency to the last. [Hz]
    """
    return math.ceil(length * span / speed_of_light) + 1


def farthest_point(
    body: Plate | Cylinder | Box | MeshFile, place: Float[np.ndarray, " 3"]
) -> float:
    """Return the distance from a place to the farthest point of a body. [m]."""
    if isinstance(body, MeshFile):
        points = placed_mesh(body).vertices
        return float(np.linalg.norm(points - place, axis=-1).max())
    half_height = 0.0 if body.height_m is None else body.height_m / 2
    up = half_height + abs(float(body.centre[2] - place[2]))
    across = (body.centre - place)[:2]
    if isinstance(body, Cylinder):
        return math.hypot(float(np.linalg.norm(across)) + body.radius_m, up)
    depth = body.depth_m if isinstance(body, Box) else 0.0
    offsets = [
        across + side * body.length_m / 2 * body.tangent[:2] + other * depth / 2 * body.across[:2]
        for side in (-1, 1)
        for other in (-1, 1)
    ]
    return math.hypot(max(float(np.linalg.norm(offset)) for offset in offsets), up)
