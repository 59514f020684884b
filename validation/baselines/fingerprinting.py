"""Fingerprints of signal strength and angle of arrival: a surveyed grid and nearest neighbours.

Represents RADAR (Bahl and Padmanabhan, INFOCOM 2000) and its successors with angles. Beyond ours
it needs three more anchors (of 16 elements each, at :data:`validation.baselines.room.ANCHORS`) and
a survey of the whole room with the same transmitter, here 0.15 m apart, which is valid only while
nothing is moved. It assumes that nearby positions have similar fingerprints, and interpolates
between its grid points at best: its error is a fraction of their spacing.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from scenes.schema.radio import Radio
from validation.baselines.arrivals import plane_wave_angle, strength_db
from validation.baselines.room import ANCHORS, Fix, Room

ELEMENTS = 16
"""Antennas of each anchor, for the angle: at half a wavelength a beam of 6°, the median change of
the angle from one surveyed position to the next. [-]"""
POINTS = 16
"""Frequencies of the fingerprint, over our band. [-]"""
PITCH = 0.15
"""Spacing of surveyed positions. [m]"""
EAST = (0.1, 1.2)
"""Surveyed region from west to east. [m]"""
NORTH = (0.25, 0.95)
"""The same from south to north. [m]"""
OFF_ROUND = (0.03, 0.02)
"""Offset of the grid to the east and north: users are at round coordinates, and a user at a
surveyed position would favour the method. [m]"""
NEIGHBOURS = 4
"""Neighbours that are averaged: those around a point of a grid. [-]"""
ANGLE_SCALE = np.radians(2.0)
"""Difference of angles with the same weight as a difference of :data:`LEVEL_SCALE_DB`. With half
and twice of it the method errs by 144 and 133 in place of 141 mm in sight, and by 17 and 12 in
place of 15 mm in sight and over the wall (``python -m validation.experiments.baselines --scales``).
[rad]"""
LEVEL_SCALE_DB = 2.0
"""Difference of levels of the same weight; only the ratio to :data:`ANGLE_SCALE` counts. [dB]"""
LEAST_APART = 1e-9
"""Added to the distance of fingerprints in the divisor: it may be 0. [-]"""


def fingerprinting(room: Room) -> Fix:
    """Survey a grid, and average the positions of the most similar fingerprints."""
    grid = survey_grid()
    prints = np.stack([fingerprint(room, place) for place in grid])
    return Fix(position=nearest(grid, prints, fingerprint(room, None)))


def fixes_by_weight(room: Room) -> list[Float[np.ndarray, " 2"]]:
    """Return the positions for half, once and twice :data:`ANGLE_SCALE`, by one survey. [m]."""
    grid = survey_grid()
    prints = np.stack([fingerprint(room, place) for place in grid])
    heard = fingerprint(room, None)
    weights = [np.tile([1.0, 1 / scale], len(ANCHORS)) for scale in (0.5, 1.0, 2.0)]
    return [nearest(grid, prints * weight, heard * weight) for weight in weights]


def survey_grid() -> Float[np.ndarray, "places 2"]:
    """Return the surveyed positions [m]."""
    x = np.arange(EAST[0] + OFF_ROUND[0], EAST[1], PITCH)
    y = np.arange(NORTH[0] + OFF_ROUND[1], NORTH[1], PITCH)
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)


def fingerprint(room: Room, place: Float[np.ndarray, " 2"] | None) -> Float[np.ndarray, " n"]:
    """Measure strength and angle at each anchor, normalised to equal weights."""
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
    """Average the positions of the nearest fingerprints, weighted by inverse distance."""
    apart = np.linalg.norm(prints - heard, axis=-1)
    best = np.argsort(apart, kind="stable")[:NEIGHBOURS]
    weights = 1 / (apart[best] + LEAST_APART)
    return np.asarray((weights[:, None] * places[best]).sum(axis=0) / weights.sum())
