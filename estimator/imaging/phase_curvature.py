r"""The phase curvature of an echo over the aperture: single scattering against double scattering.

A thing that is seen directly or over flat mirrors has a wavefront centred on one point: the round
trip is twice the distance of that point (its image) from each antenna. A wave that a rough wall
scatters on its way to a target, and that returns over the wall as a mirror, has the length

.. math:: \lVert q - f \rVert + \lVert f - t \rVert + \lVert t - q \rVert

over the antennas q, with the facet f and the target's image t. It appears half-way between their
directions, with the curvature :math:`\tfrac12(1/\lVert f \rVert + 1/\lVert t \rVert)`: more
than that of a point where it appears, as the facet is nearer. Scattered by the wall both ways, it
has :math:`1/\lVert f \rVert`; so has every echo whose last scatterer lies before the end of its
path. An excess curvature that the aperture resolves distinguishes the diffuse multipath around a
ghost from the ghost, for each peak of the speckle. Less curvature than a point's comes from a
smooth flat or convex surface, which is seen directly.
"""

import numpy as np
from jaxtyping import Complex, Complex64, Float
from scipy.constants import speed_of_light

from estimator.array.resolution_cell import Resolution
from estimator.imaging.range_compression import RangeProfiles

BENDS = np.linspace(0.0, 24.0, 13)
"""Excess phases at the ends of the aperture that are tried. Steps of 2 rad lose 9 % of a focus'
intensity at most; for 260 elements of 0.5 mm a ghost at 0.5 m and a facet at half of that differ by
23 rad. [rad]"""
SHIFTS = np.linspace(-0.75, 0.75, 7)
"""Directions that are tried, about the peak's, whose pixel is 0.75 cells wide. [cells λ/2D]"""
TILTS = np.linspace(-2.0, 2.0, 9)
"""Directions of a reflection without curvature that are tried, about the peak's: such a reflection
is as wide as the array, and its peaks lie beside its direction. [cells λ/2D]"""
OUTSHONE = 0.25
"""Coherence factor below which it is asked whether something brighter stands at the same range.
[-]"""
ABOUT = 8
"""Beams on either side of a peak that are counted as what stands about it. [cells λ/2D]"""
BRIGHTER = 4.0
"""Energy at a range over that from about a peak, from which something else outshines it: then the
coherence factor over all directions is 0.25 at most, as :data:`OUTSHONE` asks. [-]"""
RANGE_SHIFTS = np.linspace(-0.5, 0.5, 3)
"""Ranges that are tried, about the peak's, whose pixel is 0.75 cells wide. [cells c/2B]"""


def over_half_aperture(profiles: RangeProfiles) -> Float[np.ndarray, " channels"]:
    """Return where each channel is along the array: 0 in its middle, ±1 at the ends. [-]."""
    across = np.mean(profiles.legs, axis=0)[:, 0]
    return np.asarray((across - across.mean()) / (0.5 * np.ptp(across)))


def bent_intensities(
    profiles: RangeProfiles, points: Float[np.ndarray, "points 3"], resolution: Resolution
) -> Float[np.ndarray, "points bends"]:
    """Focus points with wavefronts of increasing curvature, each at its best place within a cell.

    Parameters
    ----------
    profiles
        Of an echo in the array's frame, not tapered.
    points
        Where the image has its peaks. [m]
    resolution
        Of the echo.

    Returns
    -------
    Largest intensity about each point for each of :data:`BENDS`. [-]
    """
    unit = over_half_aperture(profiles)
    # A direction λ/2D aside turns the round trip by half a turn at either end.
    phase = np.pi * SHIFTS[:, None] * unit + BENDS[:, None, None] * unit**2
    tried = np.exp(1j * phase).reshape(-1, unit.size)
    best = np.zeros((len(points), BENDS.size))
    for shift in RANGE_SHIFTS:
        aligned = aligned_profiles(profiles, points, shift * resolution.along_ray)
        # Not a matrix product: its bytes would depend on the number of threads.
        focused = np.einsum("pm,km->pk", aligned, tried).reshape(-1, BENDS.size, SHIFTS.size)
        best = np.maximum(best, (np.abs(focused) ** 2).max(axis=-1))
    intensities: np.ndarray = best / profiles.gain**2
    return intensities


def coherence_factor(
    profiles: RangeProfiles,
    points: Float[np.ndarray, "points 3"],
    resolution: Resolution,
    *,
    flat: bool,
    noise: float,
) -> Float[np.ndarray, " points"]:
    r"""Return the coherence factor of an echo at some places.

    .. math:: \frac{|\sum_m z_m|^2}{M \sum_m |z_m|^2}

    of the M channels' profiles :math:`z_m` at the range to a place: the share of the energy that is
    one wave over the whole aperture. It is 1 for a single point, the share of the aperture for
    what only a part of it sees, 1/M for speckle and sidelobes from elsewhere at the same range.

    Parameters
    ----------
    profiles
        Tapered over frequency, not over the positions.
    points
        Where the image has its peaks. [m]
    resolution
        Of the echo.
    flat
        Whether the wave is taken to come from a mirror that faces the array there, which
        returns it without curvature.
    noise
        Variance that thermal noise adds to each :math:`z_m`, which is no wave.
    """
    across = np.mean(profiles.legs, axis=0)[:, 0]
    offset = across - across.mean()
    squared = np.einsum("px,px->p", points, points)
    cosine2 = 1 - points[:, 0] ** 2 / squared
    bend = -2 * np.pi * profiles.carrier / speed_of_light * cosine2 / np.sqrt(squared)
    turn = np.exp(1j * bend[:, None] * offset**2) if flat else 1.0
    # A reflection is as wide as the array, and has its peaks beside where it is perpendicular.
    unit = offset / (0.5 * np.ptp(across))
    tilts = np.exp(1j * np.pi * (TILTS if flat else np.zeros(1))[:, None] * unit)
    best = np.zeros(len(points))
    for shift in RANGE_SHIFTS:
        aligned = aligned_profiles(profiles, points, shift * resolution.along_ray)
        energy = np.einsum("pm,pm->p", aligned, aligned.conj()).real
        tilted = np.einsum("pm,tm->pt", aligned * turn, tilts)
        wave = (np.abs(tilted) ** 2).max(axis=1) / offset.size
        # Noise is taken out of the energy, but never more than all that is not the wave.
        best = np.maximum(best, wave / np.maximum(energy - offset.size * noise, wave + 1e-300))
        outshone = np.flatnonzero(best < OUTSHONE)
        if outshone.size:
            bent = (aligned * turn)[outshone]
            best[outshone] = np.maximum(best[outshone], _local_coherence(bent, tilts, unit))
    return best


def _local_coherence(
    aligned: Complex[np.ndarray, "points channels"],
    tilts: Complex[np.ndarray, "tilts channels"],
    unit: Float[np.ndarray, " channels"],
) -> Float[np.ndarray, " points"]:
    """Return the share of the energy from about a direction that is one wave; 0 if most is. [-].

    Something brighter at the same range, in another direction, is no part of what stands in this
    one: through a window over the aperture, which keeps its sidelobes out, only beams within
    :data:`ABOUT` count. Where these hold most of the range's energy nothing outshines it.
    """
    window = 1 + np.cos(np.pi * unit)
    shares = np.zeros(len(aligned))
    within = np.exp(1j * np.pi * np.arange(-ABOUT, ABOUT + 1)[:, None] * unit)
    windowed = aligned * window
    every = np.einsum("pm,pm->p", windowed, windowed.conj()).real * unit.size
    for tilt in tilts:
        beams = np.abs(np.einsum("pm,bm->pb", windowed * tilt, within)) ** 2
        about = beams.sum(axis=1)
        # Of one wave the window puts a quarter of the power into each of the two beams beside.
        share = 1.5 * beams[:, ABOUT] / np.maximum(about, np.finfo(float).tiny)
        share[every < BRIGHTER * about] = 0.0
        shares = np.maximum(shares, np.minimum(share, 1.0))
    return shares


def aligned_profiles(
    profiles: RangeProfiles, points: Float[np.ndarray, "points 3"], farther: float
) -> Complex64[np.ndarray, "points channels"]:
    """Read each channel's profile at each point, the path's phase taken out."""
    path = np.sum([_distances(points, leg) for leg in profiles.legs], axis=0)
    return profiles_at(profiles, profiles.passes * path + 2 * farther)


def profiles_at(
    profiles: RangeProfiles, length: Float[np.ndarray, "points channels"]
) -> Complex64[np.ndarray, "points channels"]:
    """Read each channel's profile at path lengths of its own, their phase taken out.

    Places and phases are reduced in float64, what is left of them is as exact as the profiles.

    Parameters
    ----------
    profiles
        Of uniform frequencies, if lengths are beyond the unambiguous one, or negative.
    length
        Of the paths. [m]
    """
    place = length / profiles.cell
    whole = np.rint(place)
    part = (place - whole).astype(np.float32)
    channels, cells, _ = profiles.coefficients.shape
    cubic = profiles.coefficients[np.arange(channels), whole.astype(np.int64) % cells]
    value = cubic[..., 3]
    for order in (2, 1, 0):
        value = value * part + cubic[..., order]
    turns = profiles.carrier / speed_of_light * length
    angle = (2 * np.pi * (turns - np.rint(turns))).astype(np.float32)
    turn = np.empty(angle.shape, dtype=np.complex64)
    turn.real, turn.imag = np.cos(angle), np.sin(angle)
    return np.asarray(value * turn)


def _distances(
    points: Float[np.ndarray, "points 3"], ends: Float[np.ndarray, "channels 3"]
) -> Float[np.ndarray, "points channels"]:
    x, y, z = (points[:, None, axis] - ends[:, axis] for axis in range(3))
    return np.asarray(np.sqrt(x * x + y * y + z * z))
