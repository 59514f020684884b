"""Users behind a wall: a wave that seems to be reflected may have come through the wall.

Boards, panes and thin partitions let a part of the wave through, a conductor nothing; the echo does
not tell which a wall is. A reflected wave is about as strong as free space less the reflection
loss; a wave through a wall has lost what the wall absorbs, more at higher frequencies. Within the
wall it is slower than in air, so that the user is nearer than the delay says. And what absorbs
takes more from the band's upper end than from its lower one, which a reflection does not.
"""

from dataclasses import replace

import numpy as np

from estimator.channel.path import PathSet
from estimator.geometry.path_tracing import project
from estimator.positioning.blockage import WITH_A_MIRROR, Sight
from estimator.positioning.level_likelihood import (
    level_density,
    through_density,
)
from estimator.positioning.map_context import MapContext
from estimator.positioning.posterior import arrives_first, level_of, tilt_ratio
from estimator.positioning.weighted_least_squares import Consensus
from estimator.results.estimate import UserEstimate

THROUGH = 0.1
"""Prior probability that a lone path which seems to be reflected came through the wall. Of 4 such
paths in 41 tuning rooms, of which two thirds of the walls are dielectrics, one had. [-]"""
UNSEEN_PANE = 0.02
"""Prior probability that a lone path which seems direct came through a wall that the map does not
show. Of 39 such paths in random rooms one had. [-]"""
LEVEL_UNKNOWN = 1e-4
"""The same where the level tells nothing: antennas with a gain are aimed at what they see. With
half and twice of it the answers in ten rooms are the same (``python -m
validation.experiments.thresholds decisions``). [-]"""
EXTRA_LENGTH, EXTRA_DEVIATION = 8e-3, 8e-3
"""Path length that a wall adds, d (n - 1): 6 mm for 4 mm of glass, 8 mm for half an inch of
plasterboard and for 20 mm of wood. [m]"""


SHIFT_DEVIATION = 2e-3
"""Shift to the side of a wave that leaves a wall: 1 mm at 45° behind 4 mm of glass, 4 mm behind
half an inch of plasterboard. [m]"""


def through_odds(explanation: Consensus, found: PathSet, room: MapContext, sight: Sight) -> float:
    """Return the odds that a lone path came straight through a wall. [-].

    Parameters
    ----------
    explanation
        Of the path: reflected by a wall, which it may have come through; or direct, through one
        that the map does not show.
    found, room
        The paths and the map.
    sight
        What the image shows on the straight way of a direct path.
    """
    (only,) = explanation.sightings
    path, bounces = found.paths[only.path], len(only.chain)
    excess = level_of(path, found, room)
    tilted = tilt_ratio(path, found, room, way="through", over="reflected" if bounces else "direct")
    prior = 1.0 if bounces else WITH_A_MIRROR[sight]
    if excess is None or found.frequency is None:
        return prior * LEVEL_UNKNOWN * tilted
    # Tilts are compared above.
    level = level_density(excess, bounces, first=arrives_first(path, found, room))
    prior *= THROUGH if bounces else UNSEEN_PANE
    return prior * through_density(excess, found.frequency) / level * tilted


def behind_the_wall(alone: UserEstimate, explanation: Consensus, found: PathSet) -> UserEstimate:
    """Return where the user is if the path came straight through the wall."""
    (only,) = explanation.sightings
    wave = found.paths[only.path].wave
    nearer = wave.path_length - EXTRA_LENGTH
    covariance = wave.covariance[: wave.bearing.size + 1, : wave.bearing.size + 1].copy()
    covariance[-1, -1] += EXTRA_DEVIATION**2
    place = project(found.how, wave.bearing, nearer, [], covariance=covariance)
    axes = found.how.coordinates
    shift = np.zeros((3, 3))
    shift[axes, axes] = SHIFT_DEVIATION**2
    return replace(
        alone,
        status="ambiguous",
        position=place.position,
        covariance=place.covariance + shift,
        bounces=0,
        path=place.path,
        line_of_sight=False,
    )
