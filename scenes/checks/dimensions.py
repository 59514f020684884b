"""Checks for settings that are possible in 2-D scenes only, or in 3-D scenes only."""

from collections.abc import Mapping

from scenes.checks.multistatic import antenna_places
from scenes.schema.antenna import Directive
from scenes.schema.base_station import BaseStation
from scenes.schema.objects import MeshFile, SceneObject
from scenes.schema.point_target import PointTarget
from scenes.schema.radio import Radio
from scenes.schema.user import User


def dimension_problems(
    *,
    dimensions: int,
    waves: str,
    max_bounces: int,
    radio: Radio,
    station: BaseStation,
    users: Mapping[str, User],
    points: Mapping[str, PointTarget],
    objects: Mapping[str, SceneObject],
) -> list[str]:
    """Find settings that do not exist in a scene of this number of dimensions.

    Parameters
    ----------
    dimensions, waves, max_bounces
        Of the scenario.
    radio, station, users, points, objects
        Its parts, by name where there are several.

    Returns
    -------
    A line for each problem: the key, its value, why not, and the remedy.
    """
    found = []
    flat = dimensions == 2
    if waves == "cylindrical" and not flat:
        found.append(
            "waves = 'cylindrical': possible in two dimensions only, and dimensions = 3; "
            "set waves = 'spherical'"
        )
    if radio.polarization == "horizontal" and not flat:
        found.append(
            "radio.polarization = 'horizontal': possible in two dimensions only, and "
            "dimensions = 3; set it to 'vertical'"
        )
    places = {"base_station.position_m": station.position_m}
    if station.transmit_offset_m is not None:
        places["base_station.transmit_offset_m"] = station.transmit_offset_m
        if flat and max_bounces > 1:
            found.append(
                f"base_station.transmit_offset_m = "
                f"{list(station.transmit_offset_m[:2])}: with transmitter and "
                f"receiver apart, echoes of one bounce only are known, and max_bounces = "
                f"{max_bounces}; set max_bounces = 1, or leave transmit_offset_m out"
            )
    places |= antenna_places(station)
    if station.multistatic and max_bounces > 1:
        found.append(
            f"max_bounces = {max_bounces}: with transmitter and receiver apart, echoes of "
            "one bounce only are known; set max_bounces = 1, or give base_station.elements alone"
        )
    places |= {f"points.{name}.position_m": one.position_m for name, one in points.items()}
    for name, body in objects.items():
        places[f"objects.{name}.centre_m"] = body.centre_m
        if isinstance(body, MeshFile):
            if flat and body.roughness is not None and body.roughness.rms > 0:
                found.append(
                    f"objects.{name}.roughness.rms_mm = {body.roughness.rms_mm}: a mesh can be "
                    "rough in three dimensions only; set it to 0, set dimensions = 3, or use "
                    "plates, cylinders and boxes"
                )
        elif flat and body.height_m is not None:
            found.append(
                f"objects.{name}.height_m = {body.height_m}: a 2-D scene is invariant along z; "
                "remove it, or set dimensions = 3"
            )
        elif not flat and body.height_m is None:
            found.append(f"objects.{name}.height_m: missing; give the height along z [m]")
    if flat and isinstance(station.elements, tuple):
        found.append(
            f"base_station.elements = {list(station.elements)}: a planar array "
            "needs dimensions = 3; give one number of elements"
        )
    if flat:
        found += _polarization_problems(station, users)
    stations: dict[str, BaseStation | User] = {"base_station": station}
    stations |= {f"users.{name}": user for name, user in users.items()}
    for key, holder in stations.items():
        places[f"{key}.position_m"] = holder.position_m
        if isinstance(holder.antenna, Directive) and holder.antenna.aim_m is not None:
            places[f"{key}.antenna.aim_m"] = holder.antenna.aim_m
    if flat:
        found += [
            f"{key} = {list(point)}: z must be 0 in two dimensions; leave z out, "
            "or set dimensions = 3"
            for key, point in places.items()
            if point[2] != 0
        ]
    return found


def _polarization_problems(station: BaseStation, users: Mapping[str, User]) -> list[str]:
    """Find antennas with their own polarization in 2-D; radio.polarization holds for all."""
    found = []
    antennas = {"base_station.antenna": station.antenna}
    if station.transmitter is not None and station.transmitter.antenna is not None:
        antennas["base_station.transmitter.antenna"] = station.transmitter.antenna
    antennas |= {f"users.{name}.antenna": user.antenna for name, user in users.items()}
    for key, antenna in antennas.items():
        if antenna.polarization_deg != 0.0:
            found.append(
                f"{key}.polarization = {antenna.polarization!r}: in two dimensions all antennas "
                "have one; leave it out and set radio.polarization, or set dimensions = 3"
            )
        if antenna.cross_polar_db is not None:
            found.append(
                f"{key}.cross_polar_db = {antenna.cross_polar_db}: in two dimensions nothing is "
                "cross-polar; leave it out, or set dimensions = 3"
            )
    return found
