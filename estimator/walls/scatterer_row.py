"""The echo of a row of scatterers as range profiles: what a straight wall is made of."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light
from scipy.linalg import cho_factor
from scipy.linalg.blas import zherk

from estimator.imaging.dirichlet_kernel import (
    Sweep,
    point_profiles,
    point_slopes,
    profiles_and_slopes,
)
from estimator.measurement.model import Echo, frequency_step

OVERSAMPLING = 1.2
"""Scatterers of the row, over the degrees of freedom of the speckle that the echo can show. Fewer
leave a part of it unexplained; more change nothing. [-]"""
RANGE_MARGIN = 10
"""Bins of the range profiles before the nearest scatterer and beyond the farthest: Dirichlet's
sidelobes fall below 1/10π of the peak there, −30 dB. [bins]"""
SAME_RANGE = 4.0
"""Parts of a wall whose ranges differ by less are resolved by their angle. [bins]"""
SECTOR_MARGIN = 1.25
"""Width of the sector in sine that the kept antenna positions sample without ambiguity, over that
of such parts. [-]"""
FEWEST_POSITIONS = 64
"""Antenna positions that are kept in any case: each adds its noise to the average. [-]"""
RIDGE = 1e-6
"""Added to the scatterers' Gram matrix, over its mean diagonal: scatterers finer than a cell are
not independent, and float64 still solves the sum to 1e-10. [-]"""
PLACES_OF_BAND, PLACES_OF_RANGE, PLACES_OF_SECTOR = 9, 33, 129
"""Places along a wall at which the bandwidth, the ranges and the sector of its echo are looked up;
all of them vary smoothly. [-]"""


@dataclass(frozen=True, kw_only=True)
class RowProfiles:
    """Range profiles of a part of the echo, each relative to the band's centre."""

    values: Complex[np.ndarray, "positions bins"]
    ranges: Float[np.ndarray, " bins"]  # [m]


def row_places(
    echo: Echo,
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
    beyond: tuple[float, float],
) -> Float[np.ndarray, " scatterers"]:
    """Space scatterers along a line so closely that they can represent any speckle.

    Parameters
    ----------
    echo
        In the array's frame.
    start, end
        The line. [m]
    beyond
        How far the row goes on before the start and beyond the end. [m]

    Returns
    -------
    Places from the line's middle. [m]
    """
    half = 0.5 * float(np.linalg.norm(end - start))
    low, high = -half - beyond[0], half + beyond[1]
    count = int(np.ceil(OVERSAMPLING * (high - low) * _bandwidth_along(echo, start, end)))
    places: np.ndarray = low + (np.arange(count) + 0.5) / count * (high - low)
    return places


def factorized(
    echoes: Complex[np.ndarray, "rows scatterers"],
) -> tuple[Complex[np.ndarray, "scatterers scatterers"], bool]:
    """Return the Cholesky factor of the scatterers' Gram matrix, for :func:`cho_solve`."""
    # Only the lower triangle, which is all that the factorization reads.
    gram = zherk(1.0, echoes.T, lower=1).conj()
    gram[np.diag_indices(len(gram))] += RIDGE * np.trace(gram).real / len(gram)
    factor, lower = cho_factor(gram, lower=True, overwrite_a=True)
    return factor, lower


def _bandwidth_along(
    echo: Echo, start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"]
) -> float:
    """Return the largest width of the spatial frequencies that the echo shows of the wall [1/m].

    A place's echo goes through 2f/c times the cosine between its ray and the wall.
    """
    along = (end - start) / np.linalg.norm(end - start)
    cosines = _range_slopes(echo, np.linspace(start, end, PLACES_OF_BAND), along)
    edges = 2 / speed_of_light * echo.frequencies[[0, -1], None, None] * cosines
    return float(np.max(edges.max(axis=(0, 1)) - edges.min(axis=(0, 1))))


def thinned(echo: Echo, start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"]) -> Echo:
    """Keep every n-th antenna position, as many as resolve the wall's parts.

    Only parts at about the same range have to be resolved by their angle: few on an inclined wall,
    all of one that faces the array.
    """
    x = echo.positions[:, 0]
    points = np.linspace(start, end, PLACES_OF_SECTOR) - echo.positions.mean(axis=0)
    ranges = np.linalg.norm(points, axis=-1)
    sines = points[:, 0] / ranges
    near = SAME_RANGE * sweep_of(echo).bin_width
    together = np.abs(ranges[:, None] - ranges) < near
    span = float(np.max(np.abs(sines[:, None] - sines) * together))
    wavelength = speed_of_light / float(echo.frequencies[-1])
    spacing = float(np.ptp(x)) / max(1, len(x) - 1)
    every = int(wavelength / (2 * SECTOR_MARGIN * max(span, 1e-6) * max(spacing, 1e-9)))
    every = max(1, min(every, len(x) // FEWEST_POSITIONS))
    return every_nth(echo, every)


def every_nth(echo: Echo, every: int) -> Echo:
    """Keep one of so many antenna positions."""
    return Echo(
        samples=echo.samples[::every],
        positions=echo.positions[::every],
        frequencies=echo.frequencies,
        transmit_positions=None
        if echo.transmit_positions is None
        else echo.transmit_positions[::every],
    )


def _ways(
    echo: Echo, points: Float[np.ndarray, "points 3"]
) -> list[Float[np.ndarray, "positions points 3"]]:
    """Return the ways from receivers and from transmitters to points. [m]."""
    ends = [echo.positions]
    ends.append(ends[0] if echo.transmit_positions is None else echo.transmit_positions)
    return [points[None] - end[:, None] for end in ends]


def ranges_to(
    echo: Echo, points: Float[np.ndarray, "points 3"]
) -> Float[np.ndarray, "positions points"]:
    """Return half the way out and back. [m]."""
    back, out = (np.linalg.norm(way, axis=-1) for way in _ways(echo, points))
    return np.asarray(0.5 * (back + out))


def _range_slopes(
    echo: Echo, points: Float[np.ndarray, "points 3"], direction: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "positions points"]:
    """Return by how much these ranges grow as points move in a direction. [-]."""
    back, out = (way @ direction / np.linalg.norm(way, axis=-1) for way in _ways(echo, points))
    return np.asarray(0.5 * (back + out))


def sweep_of(echo: Echo) -> Sweep:
    """Return an echo's uniform frequencies."""
    step, count = frequency_step(echo.frequencies), len(echo.frequencies)
    centre = float(echo.frequencies[0]) + 0.5 * (count - 1) * step
    return Sweep(centre=centre, step=step, count=count)


def row_profiles(
    echo: Echo, start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"]
) -> RowProfiles:
    """Range profiles around the wall, at the sweep's own independent ranges."""
    sweep = sweep_of(echo)
    ranges = ranges_to(echo, np.linspace(start, end, PLACES_OF_RANGE))
    low = int(np.floor(ranges.min() / sweep.bin_width)) - RANGE_MARGIN
    high = int(np.ceil(ranges.max() / sweep.bin_width)) + RANGE_MARGIN
    bins = np.arange(low, min(high, low + sweep.count - 1) + 1) * sweep.bin_width
    offsets = echo.frequencies - sweep.centre
    turns = np.exp(4j * np.pi / speed_of_light * np.outer(offsets, bins)) / np.sqrt(sweep.count)
    return RowProfiles(values=echo.samples @ turns, ranges=bins)


def row_echoes(
    echo: Echo, profiles: RowProfiles, points: Float[np.ndarray, "points 3"]
) -> Complex[np.ndarray, "rows points"]:
    """Return each scatterer's range profiles."""
    return point_profiles(sweep_of(echo), profiles.ranges, ranges_to(echo, points))


def row_echoes_and_slopes(
    echo: Echo,
    profiles: RowProfiles,
    points: Float[np.ndarray, "points 3"],
    normal: Float[np.ndarray, " 3"],
) -> tuple[Complex[np.ndarray, "rows points"], Complex[np.ndarray, "rows points"]]:
    """Return each scatterer's range profiles, and how they change along a normal [1/m]."""
    rates = _range_slopes(echo, points, normal)
    return profiles_and_slopes(sweep_of(echo), profiles.ranges, ranges_to(echo, points), rates)


def row_slopes(
    echo: Echo,
    profiles: RowProfiles,
    points: Float[np.ndarray, "points 3"],
    rates: Float[np.ndarray, "positions points"],
) -> Complex[np.ndarray, "rows points"]:
    """Return how each scatterer's range profiles change at rates of its ranges. [1/m]."""
    return point_slopes(sweep_of(echo), profiles.ranges, ranges_to(echo, points), rates)


def adjoint(
    matrix: Complex[np.ndarray, "rows columns"], values: Complex[np.ndarray, "rows *some"]
) -> Complex[np.ndarray, "columns *some"]:
    """Multiply the conjugate transpose of a large matrix, without a copy of it."""
    return np.asarray((matrix.T @ values.conj()).conj())
