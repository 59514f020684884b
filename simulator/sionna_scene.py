"""A scenario as a Sionna RT scene that Sionna's own solvers and renderer run on.

Its surfaces are the smooth mean shapes; their roughness is in the radio materials' scattering
coefficients. The frozen facets of our own simulation hold the roughness in their geometry, and
to put both into one scene would count it twice.
"""

import numpy as np
import sionna.rt as rt
from jaxtyping import Float

from scenes.scenario import Scenario
from scenes.shapes import Surface, object_surface
from simulator.materials import Material, named_material
from simulator.radio_materials import ANGLE_OF_INCIDENCE, radio_material
from simulator.ray_scene import HALF_HEIGHT, build_scene

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
    MaterialError
        If a material is not known at the frequency.
    """
    surfaces = mean_surfaces(scenario)
    materials = {}
    for surface in surfaces:
        rough = scenario.objects[surface.name].roughness
        materials[surface.name] = radio_material(
            f"/{surface.name}",
            object_material(scenario, surface.name),
            rms_height=rough.rms if rough is not None else 0.0,
            angle=angle,
            colour=COLOURS.get(surface.material, (0.6, 0.6, 0.6)),
        )
    scene = build_scene(surfaces, materials=materials, half_height=half_height)
    scene.frequency = scenario.radio.centre_frequency if frequency is None else frequency
    for name, user in scenario.users.items():
        place = user.position
        scene.add(
            rt.Transmitter(
                f"/user/{name}",
                position=place.tolist(),
                look_at=_ahead(place, scenario.aim(user.antenna, place)),
            )
        )
    centre = np.asarray(scenario.base_station.position_m, dtype=np.float64)
    scene.add(
        rt.Receiver(
            "/base_station",
            position=centre.tolist(),
            look_at=_ahead(centre, scenario.aim(scenario.base_station.antenna, centre)),
        )
    )
    return scene


def mean_surfaces(scenario: Scenario) -> list[Surface]:
    """Cut a scenario's objects into the fewest facets, without their roughness."""
    smooth = scenario.model_copy(
        update={
            "objects": {
                name: body.model_copy(update={"roughness": None})
                for name, body in scenario.objects.items()
            }
        }
    )
    return [object_surface(smooth, name, seed=0, spacing=np.inf) for name in smooth.objects]


def object_material(scenario: Scenario, name: str) -> Material:
    """Return what an object is made of, checked over the scenario's band."""
    return named_material(scenario.objects[name].material, scenario.radio.frequencies)


def _ahead(place: Float[np.ndarray, " 3"], aim: Float[np.ndarray, " 3"]) -> list[float]:
    ahead: list[float] = (place + aim).tolist()
    return ahead
