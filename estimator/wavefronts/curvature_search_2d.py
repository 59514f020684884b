"""The start of a wave's fit with free curvature: a grid search over angle, length and curvature.

The likelihood has many local maxima over the radius of curvature: between two wavefronts whose
sagitta over the aperture differs by several wavelengths, it falls and rises again.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.measurement.model import Uplink

PHASE_STEP = 1.0
"""Difference of phase at the aperture's ends between neighbouring radii. [rad]"""
SAMPLES_PER_CELL = 8
"""Samples of a length for each range cell c/B: between them a peak loses 0.06 dB at most. [-]"""
HALF_BEAMS = 6
"""Angles looked at on either side, in half beam widths λ/D: an unmodelled curvature moves the
map's peak by a few beams. [-]"""
HALF_CELLS = 4
"""Lengths looked at on either side, in range cells c/B, for the same reason. [-]"""
GATE_CELLS = 2
"""Range cells of the profiles beyond all of these. [-]"""
ROUNDEST = 0.5
"""Largest curvature tried, times half the aperture: a source at the distance of the aperture. [-]
"""
FINEST = 0.01
"""Least step of the curvature, times half the aperture, for waves along the axis, whose curvature
hardly shows. [-]"""
LEAST_BEND = 1e-3
"""Curvature of a plane wave, as it is handed on: a radius of a kilometre is flat to 1e-3 of a
wavelength over half a metre at 300 GHz. [1/m]"""


@dataclass(frozen=True, kw_only=True)
class Start:
    """A point on the grid."""

    aoa: float  # [rad]
    path_length: float  # [m]
    radius: float  # [m]


def search_curvature(uplink: Uplink, *, aoa: float, path_length: float) -> Start:
    """Search radii from the aperture's size to infinity around a peak of the map.

    Parameters
    ----------
    uplink
        With positions in the array's frame.
    aoa, path_length
        The peak. [rad], [m]

    Returns
    -------
    The best point of the grid; its radius may be far from the path length.
    """
    across = uplink.positions[:, 0]
    half = 0.5 * float(np.ptp(across))
    wavenumbers = 2 * np.pi * uplink.frequencies / speed_of_light
    centre = float(wavenumbers.mean())
    cell = speed_of_light / float(np.ptp(uplink.frequencies))
    # Sagitta of the transverse half aperture: k h² sin²θ / 2R.
    sagitta = 0.5 * centre * (half * np.sin(aoa)) ** 2
    bends = np.arange(0.0, ROUNDEST / half, max(PHASE_STEP / max(sagitta, 1e-9), FINEST / half))
    bends = np.append(bends, 1 / path_length)
    beam = np.pi / (centre * half)
    cosines = np.cos(aoa) + 0.5 * beam * np.arange(-HALF_BEAMS, HALF_BEAMS + 1)
    cosines = cosines[np.abs(cosines) < 1]

    step = cell / SAMPLES_PER_CELL
    reach = HALF_CELLS * cell
    gate = float(np.linalg.norm(uplink.positions, axis=1).max()) + reach + GATE_CELLS * cell
    profiles, first = _gated_profiles(uplink, path_length, gate, step)
    shifts = np.arange(-HALF_CELLS * SAMPLES_PER_CELL, HALF_CELLS * SAMPLES_PER_CELL + 1)
    best = (-1.0, 0, 0, 0)
    for i, bend in enumerate(bends):
        # r_m − R_c for a source at radius 1/bend, exact and finite for a plane wave too.
        excess = _excess(uplink.positions, cosines, float(bend))
        places = (path_length + excess - first) / step
        cells = np.round(places).astype(int)
        # Within a sample only the carrier's phase turns.
        turned = np.exp(1j * centre * (path_length + excess))
        gathered = profiles[np.arange(len(across))[None, :, None], cells[:, :, None] + shifts]
        sums = np.abs(np.einsum("cm,cms->cs", turned, gathered))
        top = int(np.argmax(sums))
        if sums.flat[top] > best[0]:
            best = float(sums.flat[top]), i, top // shifts.size, top % shifts.size
    _, i, j, k = best
    return Start(
        aoa=float(np.arccos(cosines[j])),
        path_length=path_length + float(shifts[k]) * step,
        radius=float(1 / max(bends[i], LEAST_BEND)),
    )


def _excess(
    positions: Float[np.ndarray, "elements 3"], cosines: Float[np.ndarray, " angles"], bend: float
) -> Float[np.ndarray, "angles elements"]:
    r"""Return :math:`\lVert R \hat s - q \rVert - R` without cancellation. [m]."""
    towards = np.stack([cosines, np.sqrt(1 - cosines**2)], axis=-1)
    square = bend * (positions**2).sum(axis=1) - 2 * towards @ positions[:, :2].T
    excess: np.ndarray = square / (1 + np.sqrt(1 + bend * square))
    return excess


def _gated_profiles(
    uplink: Uplink, centre: float, reach: float, step: float
) -> tuple[Complex[np.ndarray, "elements lengths"], float]:
    """Compress each element's pilot over a gate of lengths, its carrier taken out."""
    wavenumbers = 2 * np.pi * uplink.frequencies / speed_of_light
    count = int(np.ceil(reach / step))
    lengths = centre + step * np.arange(-count, count + 1)
    matched = np.exp(1j * np.outer(wavenumbers - wavenumbers.mean(), lengths))
    return uplink.samples @ matched, float(lengths[0])
