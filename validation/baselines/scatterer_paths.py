r"""Angles at both ends and the length of single-bounce paths of one transmitter.

Represents positioning by non-line-of-sight paths without a map (Miao, Yu, Juang, IEEE Trans. Veh.
Technol. 2007; Shahmansoori et al., IEEE Trans. Wireless Commun. 2018). Infrastructure: one base
station, ours, but an array at the user too (two rows of 8 antennas across each other, 0.5 mm
apart), whose orientation is known.

A path of length L that departs from the user towards :math:`\hat s_u` and arrives from
:math:`\hat s_a` restricts the user to the line :math:`q + r \hat s_a - (L - r) \hat s_u`, with the
unknown distance r of the bounce. The lines of two such paths intersect; a direct one
(:math:`\hat s_u = -\hat s_a`) gives a point. A single path over a mirror gives only a line, and so
no position.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.channel.relax import extract_paths
from estimator.measurement.model import Uplink
from validation.baselines.room import Fix, Room

USER_ELEMENTS = 8
"""Antennas in each of the user's two rows. [-]"""
USER_SPACING = 0.5e-3
"""Spacing of these antennas: half a wavelength at 300 GHz. [m]"""
LISTENING = 16
"""Elements of our array that receive each of the user's antennas; all receive the first one. [-]"""
POINTS = 501
"""Frequencies of the path search: unambiguous to 2 m over 75 GHz. [-]"""
LISTENING_POINTS = 161
"""Frequencies at which these elements receive: enough to separate paths already found. [-]"""
MOST_PATHS = 4
"""Most paths of the search: as many as in our own estimator. [-]"""
WEAKEST_DB = -15.0
"""Least level of a path relative to the strongest one: below, a rough wall's speckle would be taken
for paths. [dB]"""
DIRECT = np.radians(3.0)
"""Largest angle between departure and reversed arrival of a direct path: the beam of one of the
user's rows is 19°, and the error of a strong path's direction is a fraction of that. [rad]"""
DIRECTION_STEP_DEG = 0.05
"""Step of the searched directions: far below a row's beam of 19°. [°]"""
PARALLEL = 1e-4
"""Least eigenvalue of the lines' normal matrix for an intersection: for two lines it is twice the
squared sine of half the angle between them, here 0.8°. [-]"""


@dataclass(frozen=True, kw_only=True)
class BouncePath:
    """Directions of one path at both ends, and its length."""

    arrives_from: Float[np.ndarray, " 2"]  # unit vector at the base station
    leaves_to: Float[np.ndarray, " 2"]  # unit vector at the user
    length: float  # [m]


def scatterer_paths(room: Room) -> Fix:
    """Find all paths' lengths and angles at both ends, and intersect their lines."""
    station = room.scenario.base_station
    x, y, _ = station.centre
    array = room.own_array
    offsets = user_array()
    few = replace(array, elements=min(LISTENING, array.elements))
    long = room.radio.model_copy(update={"points": min(POINTS, room.radio.points)})
    radio = room.radio.model_copy(update={"points": min(LISTENING_POINTS, room.radio.points)})
    pilots = [room.pilot(few, radio=radio, offset=offset) for offset in offsets]
    boresight = np.array([*station.boresight[:2], 0.0])
    axis = np.array([boresight[1], -boresight[0], 0.0])
    paths = extract_paths(
        room.pilot(array, radio=long), most=MOST_PATHS, axis=axis, boresight=boresight
    )
    if not paths:
        return Fix(position=None, reason="no path stands out of the noise")
    strongest = max(abs(path.gain) for path in paths)
    kept = [p for p in paths if abs(p.gain) >= 10 ** (WEAKEST_DB / 20) * strongest]
    found = []
    for path in kept:
        arrives = np.cos(path.aoa) * axis[:2] + np.sin(path.aoa) * boresight[:2]
        source = np.array([x, y]) + path.path_length * arrives
        gains = np.array([_gain(pilot, source) for pilot in pilots])
        found.append(
            BouncePath(
                arrives_from=arrives,
                leaves_to=departure(gains, offsets, float(pilots[0].frequencies.mean())),
                length=path.path_length,
            )
        )
    return intersect(np.array([x, y]), found)


def user_array() -> Float[np.ndarray, "antennas 2"]:
    """Return the antennas' offsets from the user's centre: a row along x, and one along y [m]."""
    row = np.arange(USER_ELEMENTS) * USER_SPACING
    along = np.stack([row, np.zeros(USER_ELEMENTS)], axis=-1)
    return np.concatenate([along, along[1:, ::-1]])


def _gain(pilot: Uplink, source: Float[np.ndarray, " 2"]) -> complex:
    """Project a pilot onto the spherical wave of a source, at the carrier of the band's middle."""
    distance = np.linalg.norm(pilot.positions[:, :2] - source, axis=-1)
    wave = np.exp(-2j * np.pi * np.outer(distance, pilot.frequencies / speed_of_light))
    return complex((wave.conj() * pilot.samples).sum() / wave.size)


def departure(
    gains: Complex[np.ndarray, " antennas"],
    offsets: Float[np.ndarray, "antennas 2"],
    frequency: float,
) -> Float[np.ndarray, " 2"]:
    """Return the direction in which a path leaves the user, from its phase at each antenna.

    The signal of an antenna nearer to the point of reflection arrives earlier: the phase rises with
    the offset along the direction. All directions are tried in steps of 0.05°.
    """
    angles = np.radians(np.arange(0.0, 360.0, DIRECTION_STEP_DEG))
    towards = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    turns = np.einsum("ax,ox->ao", towards, offsets) * frequency / speed_of_light
    match = np.abs((np.exp(-2j * np.pi * turns) * gains).sum(axis=-1))
    return np.asarray(towards[int(np.argmax(match))])


def intersect(station: Float[np.ndarray, " 2"], paths: list[BouncePath]) -> Fix:
    """Find the user by the first direct path, or where the lines of bounced ones intersect.

    Parameters
    ----------
    station
        Position of the base station. [m]
    paths
        The strongest first.
    """
    direct = [path for path in paths if path.arrives_from @ path.leaves_to < -np.cos(DIRECT)]
    if direct:
        return Fix(position=station + direct[0].length * direct[0].arrives_from)
    if len(paths) < 2:
        return Fix(position=None, reason="one bounced path leaves a line of places")
    normal, right = np.zeros((2, 2)), np.zeros(2)
    for path in paths:
        along = path.arrives_from + path.leaves_to
        along = along / np.linalg.norm(along)
        across = np.eye(2) - np.outer(along, along)
        normal += across
        right += across @ (station - path.length * path.leaves_to)
    if np.linalg.eigvalsh(normal)[0] < PARALLEL:
        return Fix(position=None, reason="the lines of the bounced paths are parallel")
    return Fix(position=np.linalg.solve(normal, right))
