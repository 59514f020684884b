"""Fingerprints of signal strength and angle of arrival: a surveyed grid and nearest neighbours.

Stands for RADAR (Bahl and Padmanabhan, INFOCOM 2000) and its successors with angles. Beyond ours
it needs three more anchors (of 16 elements each, at :data:`validation.baselines.room.ANCHORS`) and
a survey of the whole room with the same transmitter, here 0.15 m apart, that holds only as long
as nothing is moved. It assumes that nearby places sound alike, and answers between its grid
points at best: its error is a fraction of their distance.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from scenes.schema.radio import Radio
from validation.baselines.arrivals import plane_wave_angle, strength_db
from validation.baselines.room import ANCHORS, Fix, Room

ELEMENTS = 16
"""Antennas of each anchor, by which it tells an angle; chosen, not measured. [-]"""
POINTS = 16
"""Frequencies of the fingerprint, over our band. [-]"""
PITCH = 0.15
"""Distance of surveyed places. [m]"""
EAST = (0.1, 1.2)
"""The part of the room that is surveyed, from west to east. [m]"""
NORTH = (0.25, 0.95)
"""The same from south to north. [m]"""
OFF_ROUND = (0.03, 0.02)
"""By which the survey begins east and north of that: users stand at round numbers, and a place that
was surveyed itself would flatter the method. [m]"""
NEIGHBOURS = 4
"""Places that are averaged: those around a place on a grid. [-]"""
ANGLE_SCALE = np.radians(2.0)
"""Difference of angles that counts as much as one of :data:`LEVEL_SCALE_DB`: what fading moves it
by from place to place. Chosen, not measured. [rad]"""
LEVEL_SCALE_DB = 2.0
"""Difference of levels, as above. Chosen, not measured. [dB]"""
LEAST_APART = 1e-9
"""Added to a distance of fingerprints that is divided by: one may be met exactly. [-]"""


def fingerprinting(room: Room) -> Fix:
    """Survey a grid, and average the places that sound most like the user."""
    grid = survey_grid()
    prints = np.stack([fingerprint(room, place) for place in grid])
    return Fix(position=nearest(grid, prints, fingerprint(room, None)))


def survey_grid() -> Float[np.ndarray, "places 2"]:
    """Return the surveyed places, off the round numbers that users stand at [m]."""
    x = np.arange(EAST[0] + OFF_ROUND[0], EAST[1], PITCH)
    y = np.arange(NORTH[0] + OFF_ROUND[1], NORTH[1], PITCH)
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)


def fingerprint(room: Room, place: Float[np.ndarray, " 2"] | None) -> Float[np.ndarray, " n"]:
    """Measure strength and angle at each anchor, over what counts alike."""
    radio = Radio(start_ghz=room.radio.start_ghz, stop_ghz=room.radio.stop_ghz, points=POINTS)
    values = []
    for anchor in ANCHORS:
        pilot = room.pilot(replace(anchor, elements=ELEMENTS), radio=radio, survey=place)
        values += [strength_db(pilot) / LEVEL_SCALE_DB, plane_wave_angle(pilot) / ANGLE_SCALE]
    return np.array(values)


def nearest(
    places: Float[np.ndarray, "places 2"],
    prints: Float[np.ndarray, "places n"],
    heard: Float[np.ndarray, " n"],
) -> Float[np.ndarray, " 2"]:
    """Average the places of the nearest fingerprints, weighted by the inverse of their distance."""
    apart = np.linalg.norm(prints - heard, axis=-1)
    best = np.argsort(apart, kind="stable")[:NEIGHBOURS]
    weights = 1 / (apart[best] + LEAST_APART)
    return np.asarray((weights[:, None] * places[best]).sum(axis=0) / weights.sum())
