"""An array and a user in each scene that Sionna RT ships."""

from scenes.scenario import Scenario, parse_scenario

PLACES = {
    "box": ([0.5, -2.0, 1.5], [1.3, 2.1, 1.2]),
    "box_knife": ([0.5, -2.0, 1.5], [1.3, 2.1, 1.2]),
    "box_one_screen": ([0.5, -2.0, 1.5], [1.3, 2.1, 1.2]),
    "box_two_screens": ([0.5, -3.7, 1.5], [1.3, 3.1, 1.2]),
    "double_reflector": ([-6.0, -3.0, 3.0], [-4.0, 3.0, 2.0]),
    "etoile": ([0.0, 0.0, 60.0], [30.0, -12.0, 1.6]),
    "floor_wall": ([-1.0, -1.2, 1.5], [1.2, 0.4, 1.1]),
    "florence": ([0.0, 0.0, 130.0], [20.0, 0.0, 1.6]),
    "munich": ([8.5, 21.0, 27.0], [44.0, 94.0, 1.6]),
    "san_francisco": ([0.0, 0.0, 180.0], [20.0, 0.0, 1.6]),
    "simple_reflector": ([-0.3, -0.5, 2.0], [0.4, 0.4, 1.5]),
    "simple_street_canyon": ([-30.0, 0.5, 12.0], [24.0, 2.0, 1.6]),
    "simple_street_canyon_with_cars": ([-30.0, 0.5, 12.0], [24.0, 2.0, 1.6]),
    "simple_wedge": ([20.0, 8.0, 1.0], [5.0, 6.0, -1.0]),
    "triple_reflector": ([-6.0, -3.0, 3.0], [-4.0, 3.0, 2.0]),
}
"""Of the base station and of the user. [m]"""


def shipped_scenario(name: str, ghz: float, bounces: int) -> Scenario:
    """Put eight elements, half a wavelength apart, and a user into a scene of Sionna RT.

    The band is the 0.4 GHz below the given frequency (marble is known up to 60 GHz), in 41 points.
    Waves do not pass through slabs.
    """
    station, user = PLACES[name]
    return parse_scenario(
        {
            "name": name,
            "dimensions": 3,
            "max_bounces": bounces,
            "radio": {"start_ghz": ghz - 0.4, "stop_ghz": ghz, "points": 41},
            "base_station": {
                "elements": [8, 1],
                "spacing_mm": 150.0 / ghz,
                "position_m": station,
            },
            "geometry": {"sionna": name, "beyond_itu": True},
            "users": {"user": {"position_m": user}},
            "effects": {"transmission": False},
        }
    )
