"""Checks of point targets: spherical waves, and a minimum distance from antennas."""

from collections.abc import Mapping

import numpy as np

from scenes.schema.base_station import BaseStation
from scenes.schema.point_target import PointTarget
from scenes.schema.user import User


def point_problems(
    points: Mapping[str, PointTarget],
    *,
    waves: str,
    station: BaseStation,
    users: Mapping[str, User],
    clearance: float,
) -> list[str]:
    """Find point targets that have no cross-section, or are nearer than ``clearance`` [m]."""
    if points and waves == "cylindrical":
        return [
            "waves = 'cylindrical': a point has no radar cross-section in them; set "
            "waves = 'spherical', or remove the points"
        ]
    found = []
    stations = {"the array": station.element_positions}
    if station.transmitter is not None:
        stations["base_station.transmitter"] = station.transmitter.positions
    stations |= {f"users.{name}": user.position[None] for name, user in users.items()}
    for name, point in points.items():
        for holder, places in stations.items():
            distance = float(np.linalg.norm(places - point.position, axis=-1).min())
            if distance < clearance:
                found.append(
                    f"points.{name}.position_m = {list(point.position_m)}: is "
                    f"{distance * 1e3:.3g} mm from {holder}; it must keep "
                    f"{clearance * 1e3:.3g} mm (the longest wavelength) away; move it"
                )
    return found
