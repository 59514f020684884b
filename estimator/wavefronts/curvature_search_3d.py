"""The start of a wavefront's fit: a grid search over direction, length and curvature.

The likelihood has many local maxima over the curvature (see
:mod:`estimator.wavefronts.curvature_search_2d`), and a wave whose curvature is not that of its
length peaks in the map beside its true direction. On a sparse array it also repeats at the grating
lobes; these are smeared over the band, so that the true direction has the highest matched-filter
output.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.measurement.model import Echo, Uplink

PHASE_STEP = 1.0
"""Difference of phase at the aperture's corners between neighbouring curvatures. [rad]"""
SAMPLES_PER_CELL = 6
"""Samples of a length for each range cell: between them a peak loses 0.1 dB at most. [-]"""
STRIDE = 2
"""Samples from one length looked at to the next: a third of a cell, 0.4 dB at most. [-]"""
HALF_BEAMS = 4
"""Directions looked at on either side and axis, in half beam widths. [-]"""
HALF_CELLS = 2
"""Lengths looked at on either side, in range cells. [-]"""
ROUNDEST = 0.5
"""Largest curvature tried, times half the aperture's diagonal: a source at its distance. [-]"""
MOST_ROUND = 4.0
"""The same over the curvature of a source at the peak: a patch that scatters a path stands between
the array and a quarter of the path's length. [-]"""
WIDEST = 0.98
"""Largest sum of squared cosines that is tried: within 8° of the array's plane its elements see no
wave. [-]"""
MOST_ELEMENTS = 400
"""Elements used; of more, evenly chosen ones: a start needs no full gain."""


@dataclass(frozen=True, kw_only=True)
class WavefrontStart:
    """A point on the grid."""

    cosines: tuple[float, float]
    path_length: float  # [m]
    curvature: float  # [1/m]
    strength: float  # of the matched filter there; compares starts of one measurement [-]


def search_wavefront(
    measured: Echo | Uplink,
    *,
    cosines: tuple[float, float],
    path_length: float,
    flattest: float = 0.0,
    roundest: float | None = None,
) -> WavefrontStart:
    """Search directions, lengths and curvatures around a peak of a map.

    Parameters
    ----------
    measured
        Samples at positions in the array's frame.
    cosines, path_length
        The peak. [-], [m]
    flattest, roundest
        Range of curvatures; by default from a plane wave to a source half an aperture away,
        but no more than four times as round as a source at the peak. [1/m]
    """
    passes = 2 if isinstance(measured, Echo) else 1
    chosen = _evenly_chosen(len(measured.positions))
    positions, samples = measured.positions[chosen], measured.samples[chosen]
    wavenumbers = 2 * np.pi * passes * measured.frequencies / speed_of_light
    centre = float(wavenumbers.mean())
    extent = np.ptp(measured.positions, axis=0)
    half = 0.5 * float(np.linalg.norm(extent))
    cell = 2 * np.pi / float(np.ptp(wavenumbers))
    most = min(ROUNDEST / half, MOST_ROUND / path_length) if roundest is None else roundest
    count = max(2, int(np.ceil((most - flattest) * 0.5 * centre * half**2 / PHASE_STEP)) + 1)
    bends = np.append(np.linspace(flattest, most, count), 1 / path_length)
    bends = bends[(bends >= flattest) & (bends <= most + 1e-12)]

    steps = 0.5 * np.arange(-HALF_BEAMS, HALF_BEAMS + 1)
    along = cosines[0] + 2 * np.pi / (centre * extent[0]) * steps
    up = cosines[1] + 2 * np.pi / (centre * extent[2]) * steps
    grid = np.stack(np.meshgrid(along, up, indexing="ij"), axis=-1).reshape(-1, 2)
    grid = grid[(grid**2).sum(axis=1) < WIDEST]

    step = cell / SAMPLES_PER_CELL
    reach = HALF_CELLS * cell
    profiles, first = _gated_profiles(samples, wavenumbers, path_length, half + reach + cell, step)
    shifts = np.arange(-HALF_CELLS * SAMPLES_PER_CELL, HALF_CELLS * SAMPLES_PER_CELL + 1, STRIDE)
    best = (-1.0, 0, 0, 0)
    for i, bend in enumerate(bends):
        excess = _excess(positions, grid, float(bend))
        cells = np.round((path_length + excess - first) / step).astype(int)
        turned = np.exp(1j * centre * (path_length + excess))
        gathered = profiles[
            np.arange(len(positions))[None, :, None],
            np.clip(cells[:, :, None] + shifts, 0, profiles.shape[1] - 1),
        ]
        sums = np.abs((turned[:, :, None] * gathered).sum(axis=1))
        top = int(np.argmax(sums))
        if sums.flat[top] > best[0]:
            best = float(sums.flat[top]), i, top // shifts.size, top % shifts.size
    strength, i, j, k = best
    return WavefrontStart(
        cosines=(float(grid[j, 0]), float(grid[j, 1])),
        path_length=path_length + float(shifts[k]) * step,
        curvature=float(bends[i]),
        strength=strength / (len(positions) * wavenumbers.size),
    )


def _evenly_chosen(count: int) -> np.ndarray:
    """Choose elements all over the array, without the regularity that makes grating lobes."""
    if count <= MOST_ELEMENTS:
        return np.arange(count)
    return np.sort(np.random.default_rng(0).choice(count, MOST_ELEMENTS, replace=False))


def _excess(
    positions: Float[np.ndarray, "elements 3"],
    cosines: Float[np.ndarray, "directions 2"],
    curvature: float,
) -> Float[np.ndarray, "directions elements"]:
    """Length to each element over that to the centre, without cancellation. [m]."""
    ahead = np.sqrt(1 - (cosines**2).sum(axis=1))
    across = (
        cosines[:, :1] * positions[:, 0]
        + ahead[:, None] * positions[:, 1]
        + cosines[:, 1:] * positions[:, 2]
    )
    bent = curvature * (positions**2).sum(axis=1) - 2 * across
    excess: np.ndarray = bent / (1 + np.sqrt(np.maximum(1 + curvature * bent, 1e-12)))
    return excess


def _gated_profiles(
    samples: Complex[np.ndarray, "elements freqs"],
    wavenumbers: Float[np.ndarray, " freqs"],
    centre: float,
    reach: float,
    step: float,
) -> tuple[Complex[np.ndarray, "elements lengths"], float]:
    """Compress each element's samples over a gate of lengths, the carrier taken out."""
    count = int(np.ceil(reach / step))
    lengths = centre + step * np.arange(-count, count + 1)
    matched = np.exp(1j * np.outer(wavenumbers - wavenumbers.mean(), lengths))
    # einsum, not a matrix product: its sums do not depend on the number of threads.
    return np.einsum("mf,fl->ml", samples, matched), float(lengths[0])
