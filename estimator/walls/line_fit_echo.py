r"""A wall's line from its whole echo: least squares over a row of unknown scatterers.

A straight rough wall is a row of scatterers of unknown strengths :math:`\gamma_i`, so its echo,
as range profiles of each antenna position, is

.. math:: d = A(\alpha, \rho)\, \gamma + \text{rest}, \qquad
          A_{(m,b),i} = D(r_b - r_{mi})\, e^{-j 4 \pi f_c r_{mi} / c}

with Dirichlet's kernel D of the sweep. Scatterers spaced more closely than a resolution cell can
represent any speckle, and yet span only a small part of the data space: a row that is turned or
moved by a fraction of a cell does not explain the echo. Least squares over strengths, angle and
offset together (variable projection, in Kaufman's approximation [1]_) have none of the errors of an
image's brightest line: each cell's speckle in its neighbours' sidelobes, levels that change along
the wall, and its ends.

The residual is noise, and the effect of the wall's own heights beyond first order; both are
independent from part to part of the wall, so that the covariance follows from the parts' scores
(:mod:`estimator.walls.cluster_robust_covariance`).

References
----------
.. [1] L. Kaufman, "A variable projection method for solving separable nonlinear least squares
       problems", BIT 15, 49-57 (1975), doi:10.1007/BF01932995
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light
from scipy.linalg import cho_factor, cho_solve
from scipy.linalg.blas import zherk

from estimator.geometry.wall_2d import unit_normal
from estimator.measurement.model import Echo, frequency_step
from estimator.walls.cluster_robust_covariance import cluster_robust_covariance
from estimator.walls.dirichlet_kernel import Sweep, point_profiles

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
STEPS = 2
"""Gauss-Newton steps: from an error of a hundredth of a cell the first leaves less than a
thousandth. [-]"""
FARTHEST_STEP = 0.5
"""Largest displacement of an end from where the image has it: beyond, the row explains some other
echo. [cells]"""
FEWEST_CELLS = 7
"""Shortest line; a shorter one is the neighbourhood of a point. [cells]"""
PART = 3.0
"""Length of the parts of a wall whose scores are taken to be independent. Within a part they are
not: what the model leaves out (for instance, an antenna's pattern that weighs places differently at
each position) gives neighbouring places opposite scores. [cells]"""
DEPTH = 4e-6
"""Of a wall's surface, against where it reflects: the phase of a lossy material's reflection
changes with frequency as if it lay deeper. On drywall at 220 to 330 GHz 3 to 6 µm were measured;
metal has none. [m]"""


@dataclass(frozen=True, kw_only=True)
class CoherentLine:
    """A segment in the array's frame, with the statistics of its angle and offset."""

    start: Float[np.ndarray, " 3"]  # [m]
    end: Float[np.ndarray, " 3"]  # [m]
    covariance: Float[np.ndarray, "2 2"]  # of (angle [rad], offset [m]) at the midpoint
    explained: float  # share of the echo from its ranges that it and the others explain [-]


def fit_coherently(
    echo: Echo,
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
    *,
    cell_along: float,
    cell_across: float,
    beyond: tuple[float, float] = (0.0, 0.0),
    others: Float[np.ndarray, "others 3"] | None = None,
) -> CoherentLine | None:
    """Refine a wall's line that is known to a small part of a cell.

    Parameters
    ----------
    echo
        In the array's frame, of uniform frequencies; transmitters may stand apart.
    start, end
        The line. [m]
    cell_along, cell_across
        Resolution along the wall and across it, at half power. [m]
    beyond
        How much longer the wall may be than what is found of it, before its start and beyond
        its end: echo of a part that the row does not reach would turn the line. [m]
    others
        Scatterers at known places that send echoes from the same ranges, with unknown strengths
        of their own. [m]

    Returns
    -------
    The line, with the same length; ``None`` where it is too short, or where the echo is not that
    of a row of scatterers nearby.
    """
    length = float(np.linalg.norm(end - start))
    if length < FEWEST_CELLS * cell_along:
        return None
    low, high = (-0.5 * length - beyond[0], 0.5 * length + beyond[1])
    count = int(np.ceil(OVERSAMPLING * (high - low) * _bandwidth_along(echo, start, end)))
    places = low + (np.arange(count) + 0.5) / count * (high - low)
    levers = 2 * places / length
    thinned = _thinned(echo, start, end)
    profiles = _profiles(thinned, start, end)
    beside = None
    if others is not None and len(others):
        beside = _echoes(thinned, profiles, others, unit_normal(start, end))[0]
    data = profiles.values.ravel()
    first = (start, end)
    for _ in range(STEPS):
        along = (end - start) / length
        row = 0.5 * (start + end) + places[:, None] * along
        echoes, slopes = _echoes(thinned, profiles, row, unit_normal(start, end))
        if beside is not None:
            echoes = np.concatenate([echoes, beside], axis=1)
        # Only the lower triangle, which is all that the factorization reads.
        gram = zherk(1.0, echoes.T, lower=1).conj()
        gram[np.diag_indices(len(gram))] += RIDGE * np.trace(gram).real / len(gram)
        solved = cho_factor(gram, lower=True, overwrite_a=True)
        all_strengths = cho_solve(solved, _adjoint(echoes, data))
        residual = data - echoes @ all_strengths
        strengths = all_strengths[:count]
        moved = slopes @ np.stack([strengths, strengths * levers], axis=-1)
        moved -= echoes @ cho_solve(solved, _adjoint(echoes, moved))
        stiffness = (moved.conj().T @ moved).real
        step = np.linalg.solve(stiffness, (moved.conj().T @ residual).real)
        start, end = _moved(start, end, step)
        if max(np.linalg.norm(start - first[0]), np.linalg.norm(end - first[1])) > (
            FARTHEST_STEP * cell_across
        ):
            return None
    scores = (strengths.conj() * _adjoint(slopes, residual)).real
    gains = (strengths.conj()[:, None] * _adjoint(slopes, moved)).real
    designs = np.stack([np.ones_like(levers), levers], axis=-1)
    # Of (offset, displacement of the ends).
    by_step = cluster_robust_covariance(places, designs, scores, gains, part=PART * cell_along)
    # An end that moves along the normal by δ turns the line by −2δ over its length.
    to_angle = np.array([[0.0, -2.0 / length], [1.0, 0.0]])
    covariance = to_angle @ by_step @ to_angle.T
    covariance[1, 1] += DEPTH**2
    explained = 1 - float(np.vdot(residual, residual).real / np.vdot(data, data).real)
    return CoherentLine(start=start, end=end, covariance=covariance, explained=explained)


def _adjoint(
    matrix: Complex[np.ndarray, "rows columns"], values: Complex[np.ndarray, "rows *some"]
) -> Complex[np.ndarray, "columns *some"]:
    """Multiply the conjugate transpose of a large matrix, without a copy of it."""
    return np.asarray((matrix.T @ values.conj()).conj())


@dataclass(frozen=True, kw_only=True)
class _Profiles:
    """Range profiles of a part of the echo, each relative to the band's centre."""

    values: Complex[np.ndarray, "positions bins"]
    ranges: Float[np.ndarray, " bins"]  # [m]


def _moved(
    start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"], step: Float[np.ndarray, " 2"]
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Displace a line along its normal, and its ends by so much more and less."""
    normal = unit_normal(start, end)
    return start + (step[0] - step[1]) * normal, end + (step[0] + step[1]) * normal


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


def _thinned(echo: Echo, start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"]) -> Echo:
    """Keep every n-th antenna position, as many as resolve the wall's parts.

    Only parts at about the same range have to be resolved by their angle: few on an inclined wall,
    all of one that faces the array.
    """
    x = echo.positions[:, 0]
    points = np.linspace(start, end, PLACES_OF_SECTOR) - echo.positions.mean(axis=0)
    ranges = np.linalg.norm(points, axis=-1)
    sines = points[:, 0] / ranges
    near = SAME_RANGE * _sweep(echo).bin_width
    together = np.abs(ranges[:, None] - ranges) < near
    span = float(np.max(np.abs(sines[:, None] - sines) * together))
    wavelength = speed_of_light / float(echo.frequencies[-1])
    spacing = float(np.ptp(x)) / max(1, len(x) - 1)
    every = int(wavelength / (2 * SECTOR_MARGIN * max(span, 1e-6) * max(spacing, 1e-9)))
    every = max(1, min(every, len(x) // FEWEST_POSITIONS))
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


def _ranges(
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


def _sweep(echo: Echo) -> Sweep:
    step, count = frequency_step(echo.frequencies), len(echo.frequencies)
    centre = float(echo.frequencies[0]) + 0.5 * (count - 1) * step
    return Sweep(centre=centre, step=step, count=count)


def _profiles(
    echo: Echo, start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"]
) -> _Profiles:
    """Range profiles around the wall, at the sweep's own independent ranges."""
    sweep = _sweep(echo)
    ranges = _ranges(echo, np.linspace(start, end, PLACES_OF_RANGE))
    low = int(np.floor(ranges.min() / sweep.bin_width)) - RANGE_MARGIN
    high = int(np.ceil(ranges.max() / sweep.bin_width)) + RANGE_MARGIN
    bins = np.arange(low, min(high, low + sweep.count - 1) + 1) * sweep.bin_width
    offsets = echo.frequencies - sweep.centre
    turns = np.exp(4j * np.pi / speed_of_light * np.outer(offsets, bins)) / np.sqrt(sweep.count)
    return _Profiles(values=echo.samples @ turns, ranges=bins)


def _echoes(
    echo: Echo,
    profiles: _Profiles,
    points: Float[np.ndarray, "points 3"],
    normal: Float[np.ndarray, " 3"],
) -> tuple[Complex[np.ndarray, "rows points"], Complex[np.ndarray, "rows points"]]:
    """Return each scatterer's range profiles, and how they change along a normal [1/m]."""
    return point_profiles(
        _sweep(echo), profiles.ranges, _ranges(echo, points), _range_slopes(echo, points, normal)
    )
