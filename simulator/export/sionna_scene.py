"""A scenario as a Sionna RT scene that Sionna's own solvers and renderer run on.

Its surfaces are the smooth mean shapes; their roughness is in the radio materials' scattering
coefficients. The frozen facets of our own simulation hold the roughness in their geometry, and
to put both into one scene would count it twice.
"""

import numpy as np
import sionna.rt as rt
from jaxtyping import Float

from scenes.scenario import Scenario
from scenes.schema.materials import Slab
from simulator.geometry.mean_surfaces import mean_surfaces, rms_height
from simulator.geometry.ray_scene import HALF_HEIGHT, sionna_rt_scene
from simulator.materials.sionna_materials import ANGLE_OF_INCIDENCE, radio_material
from simulator.scene.radio_scene import scenario_materials

COLOURS = {
    "metal": (0.45, 0.47, 0.52),
    "absorber": (0.09, 0.09, 0.10),
    "drywall": (0.86, 0.82, 0.72),
    "plasterboard": (0.86, 0.82, 0.72),
    "cardboard": (0.66, 0.49, 0.31),
    "wood": (0.55, 0.37, 0.22),
    "glass": (0.55, 0.70, 0.78),
    "concrete": (0.60, 0.60, 0.58),
    "brick": (0.62, 0.32, 0.25),
}
"""Red, green, blue of materials in renders, 0…1; grey for all others."""

MARKER = 0.015
"""Radius of the balls that show antennas in renders [m]."""


def sionna_scene(
    scenario: Scenario,
    *,
    frequency: float | None = None,
    angle: float = ANGLE_OF_INCIDENCE,
    half_height: float = HALF_HEIGHT,
) -> rt.Scene:
    """Build the Sionna RT scene of a scenario, with its users and its base station.

    Each object has the scenario's name, and a radio material called ``/NAME`` that follows
    ``scene.frequency``. The users are transmitters ``/user/NAME``, the base station's centre is
    the receiver ``/base_station``; their arrays (pattern, polarization) are Sionna's to choose.

    Parameters
    ----------
    scenario
        Of two or three dimensions.
    frequency
        At first; the middle of the band by default. [Hz]
    angle
        Angle of incidence at which a roughness becomes a scattering coefficient. [rad]
    half_height
        Half the height of the strips that a 2-D scenario's lines become. [m]

    Raises
    ------
    ScenarioError
        If a material is not known over the scenario's band.
    MaterialError
        If it is not known at the frequency.
    """
    surfaces = mean_surfaces(scenario)
    materials = {
        name: radio_material(
            f"/{name}",
            material,
            rms_height=rms_height(scenario, name),
            angle=angle,
            colour=material_colour(scenario.objects[name].material),
        )
        for name, material in scenario_materials(scenario).items()
    }
    scene = sionna_rt_scene(
        surfaces,
        materials=materials,
        frequency=scenario.radio.centre_frequency if frequency is None else frequency,
        half_height=half_height,
    )
    for name, user in scenario.users.items():
        place = user.position
        scene.add(
            rt.Transmitter(
                f"/user/{name}",
                position=place.tolist(),
                look_at=_ahead(place, scenario.aim(user.antenna, place)),
                display_radius=MARKER,
            )
        )
    centre = scenario.base_station.centre
    scene.add(
        rt.Receiver(
            "/base_station",
            position=centre.tolist(),
            look_at=_ahead(centre, scenario.aim(scenario.base_station.antenna, centre)),
            display_radius=MARKER,
        )
    )
    return scene


def material_colour(material: str | Slab) -> tuple[float, float, float]:
    """Return the colour of a material in renders."""
    name = material if isinstance(material, str) else str(material.name)
    return COLOURS.get(name, (0.6, 0.6, 0.6))


def _ahead(place: Float[np.ndarray, " 3"], aim: Float[np.ndarray, " 3"]) -> list[float]:
    ahead: list[float] = (place + aim).tolist()
    return ahead


def stand_back(scenario: Scenario) -> tuple[list[float], list[float]]:
    """Choose where a camera sees the whole scenario from: behind and above the base station.

    Returns
    -------
    Position of the camera, and the point that it looks at. [m]
    """
    station = scenario.base_station
    points = [station.element_positions, *(s.vertices for s in mean_surfaces(scenario))]
    points += [user.position[None] for user in scenario.users.values()]
    low, high = (bound(np.concatenate(points), axis=0) for bound in (np.min, np.max))
    centre, size = (low + high) / 2, float(np.linalg.norm(high - low))
    side = np.cross(station.boresight, [0.0, 0.0, 1.0])
    eye = centre + size * (-1.0 * station.boresight - 0.4 * side + np.array([0.0, 0.0, 0.9]))
    return eye.tolist(), centre.tolist()
