"""Which mirrors each path may have come over, and which choices agree on one place.

Every path may come over the mirrors that its ray meets, or over others that it only just misses.
Each choice of paths and chains of mirrors is one hypothesis; those whose joint least squares
leave no more over than their covariances allow are consistent.
"""

from itertools import product

import numpy as np

from estimator import false_alarm
from estimator.channel.path import Path, PathSet
from estimator.compute.distributions import chi_square_quantile
from estimator.geometry.bearing import Bearing
from estimator.geometry.specular_chains import Chain
from estimator.positioning.map_context import MapContext
from estimator.positioning.weighted_least_squares import (
    Consensus,
    Sighting,
    UndeterminedPlaceError,
    solve_position,
)

Chains = dict[int, tuple[Chain, ...]]
"""For each path the chains of mirrors it may come over, the one that its ray meets first."""
END_DEVIATIONS = 3.0
"""Deviations of the angle, beside the image's cell, by which a ray may meet another wall: of
Gaussian errors one in 370 is larger. [-]"""
SAME = 1 - false_alarm.DISAGREEMENT
"""Probability with which two estimates of one position pass for the same. [-]"""


def end_reach(path: Path, room: MapContext) -> float:
    """Angle by which a path's ray may be off a wall's end. [rad]."""
    size = path.wave.bearing.size
    variance = float(path.wave.covariance[:size, :size].trace())
    return room.resolution.across_ray + END_DEVIATIONS * float(np.sqrt(variance))


def consistent_ones(
    chains: Chains, found: PathSet, room: MapContext, *, clock_known: bool = True
) -> list[Consensus]:
    """Solve all choices of paths and chains; two paths never come over the same mirrors."""
    choices = [
        [None, *(Sighting(path=index, chain=chain) for chain in options)]
        for index, options in chains.items()
    ]
    consistent = []
    for choice in product(*choices):
        sightings = [one for one in choice if one is not None]
        if sightings and len({one.chain for one in sightings}) == len(sightings):
            try:
                solved = solve_position(
                    sightings,
                    found.observed if clock_known else found.free_observed,
                    found.covariance if clock_known else found.free_covariance,
                    room.walls,
                    room.wall_covariance,
                    how=found.how,
                    clock_known=clock_known,
                )
            except UndeterminedPlaceError:
                continue
            if solved.agrees:
                consistent.append(solved)
    return consistent


def same_place(one: Consensus, other: Consensus, how: Bearing) -> bool:
    """Tell whether two positions are the same within their covariances."""
    axes = how.coordinates
    between = (one.position - other.position)[axes]
    spread = (one.covariance + other.covariance)[np.ix_(axes, axes)]
    return bool(between @ np.linalg.solve(spread, between) < same_square(how))


def same_square(how: Bearing) -> float:
    """Squared distance, over its covariance, within which two positions are the same. [-]."""
    return chi_square_quantile(SAME, len(how.coordinates))
