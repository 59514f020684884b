"""Checks of multistatic base stations: separate receivers and transmitters, not an array."""

from collections.abc import Mapping, Sequence

from scenes.checks.placement import crowded_antennas
from scenes.schema.antenna import Directive
from scenes.schema.base_station import BaseStation
from scenes.schema.multistatic import Arc
from scenes.schema.objects import Box, Cylinder, MeshFile, Plate


def antenna_places(station: BaseStation) -> dict[str, tuple[float, float, float]]:
    """Return all points by which separate antennas are placed, by the key that gives each [m]."""
    receivers, transmitter = station.receivers, station.transmitter
    points: dict[str, tuple[float, float, float]] = {}
    if isinstance(receivers, Arc):
        points["base_station.receivers.centre_m"] = receivers.centre_m
    elif receivers is not None:
        places = enumerate(receivers.positions_m)
        points |= {f"base_station.receivers.positions_m[{n}]": place for n, place in places}
    if transmitter is None:
        return points
    if transmitter.position_m is not None:
        points["base_station.transmitter.position_m"] = transmitter.position_m
    places = enumerate(transmitter.positions_m or ())
    points |= {f"base_station.transmitter.positions_m[{n}]": place for n, place in places}
    antenna = transmitter.antenna
    if isinstance(antenna, Directive) and antenna.aim_m is not None:
        points["base_station.transmitter.antenna.aim_m"] = antenna.aim_m
    return points


def multistatic_problems(
    station: BaseStation,
    objects: Mapping[str, Plate | Cylinder | Box | MeshFile],
    *,
    users: Sequence[str],
    clearance: float,
) -> list[str]:
    """Find separate antennas on or in objects, and users, whose pilots are not received.

    Parameters
    ----------
    station
        The base station; for a monostatic array nothing is checked.
    objects
        By name.
    users
        Their names.
    clearance
        Distance that antennas keep from surfaces. [m]

    Returns
    -------
    A line for each problem, with the key, the value, the limit and the remedy.
    """
    if not station.multistatic:
        return []
    found = [
        f"users.{name}: a base station whose antennas stand apart measures its echo only; remove "
        "the user, or give base_station.elements without receivers and transmitter"
        for name in users
    ]
    found += [
        f"objects.{name}.realisation: the heights of plates are drawn tile by tile where antennas "
        "stand apart, and not read; remove it, or give the surface as an object of kind = 'mesh' "
        "with facets = 'file'"
        for name, body in objects.items()
        if isinstance(body, Plate) and body.realisation is not None
    ]
    antennas = {}
    if station.receivers is not None:
        antennas["base_station.receivers"] = station.element_positions
        if station.transmit_offset is not None:
            places = station.element_positions + station.transmit_offset
            antennas["base_station.transmit_offset_m"] = places
    if station.transmitter is not None:
        antennas["base_station.transmitter"] = station.transmitter.positions
    for key, places in antennas.items():
        found += crowded_antennas(objects, key=key, positions=places, clearance=clearance)
    return found
