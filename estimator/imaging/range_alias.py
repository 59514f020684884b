r"""Detection of range ambiguities: echoes from beyond c/2Δf by their wavefront's curvature.

At range r the image shows, too, what stands at r + n c/2Δf, with the same profile at every
antenna. But a wavefront from there is flatter: over the aperture its round trip differs from that
of a point at r by

.. math:: 2 \left( \lVert q - p_n \rVert - \lVert p_n \rVert \right)
          - 2 \left( \lVert q - p \rVert - \lVert p \rVert \right) ,
          \qquad p_n = p \, \frac{\lVert p \rVert + n c / 2 \Delta f}{\lVert p \rVert} ,

so that echoes are focused best at their true range. A mirror that faces the array returns a plane
wave, which distinguishes it from both.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Complex, Float
from scipy.constants import speed_of_light

from estimator.array.planar_array import spans_a_plane
from estimator.array.resolution_cell import Resolution
from estimator.imaging.phase_curvature import (
    RANGE_SHIFTS,
    SHIFTS,
    TILTS,
    aligned_profiles,
    over_half_aperture,
)
from estimator.imaging.range_compression import RangeProfiles

ORDERS = 3
"""Unambiguous ranges beyond which nothing is looked for: the wavefront's curvature then falls by a
tenth only from one to the next, and the echo of a post by 24 dB over that of the first. [-]"""

BEYOND_HERE = 1.3
"""Intensity as from beyond, over that as from where a thing is imaged. Of walls of three
realisations imaged 0.4 m too near by an array of 32 mm it was 1.6 to 1.7, of true walls 1.1 at
most. [-]"""
BEYOND_FLAT = 1.1
"""The same over that of a wave without curvature: 1.35 to 1.4 there, and less than 1 on the
reflection of the array in walls that face it. [-]"""

ARC = 2.0
"""Intensity of the brightest as from beyond, over the brightest as from where it is imaged, from
which an arc is one wave's from beyond: such a wave loses its number of cells across, tens. [-]"""

MOST = 3.0
"""Most that one peak counts in a mean of such ratios. [-]"""
CLEARLY_HERE = 0.5
"""Intensity as from beyond, over that as from here, of a peak that is here whatever its neighbours
are: a ghost in its cloud has less than 0.1. [-]"""
NEIGHBOURHOOD = 6.0
"""Distance of peaks that are taken to be of one thing: some ten peaks of a wall. [cells]"""


@dataclass(frozen=True, kw_only=True)
class FocusByRange:
    """Intensities of peaks of an image, focused at several true ranges."""

    here: Float[np.ndarray, " points"]  # as where they are imaged [-]
    beyond: Float[np.ndarray, " points"]  # largest, as one or more unambiguous ranges farther [-]
    flat: Float[np.ndarray, " points"]  # as from infinity, or a mirror that faces the array [-]

    def is_beyond(self, which: Bool[np.ndarray, " points"]) -> bool:
        """Tell whether some of the points, taken together, are beyond the unambiguous range."""
        if not which.any():
            return False
        # The reflection of a part of the array, bright and nearly flat, would outweigh its wall.
        over_here, over_flat = (
            float(np.minimum(self.beyond[which] / other[which], MOST).mean())
            for other in (self.here, self.flat)
        )
        return over_here > BEYOND_HERE and over_flat > BEYOND_FLAT

    def points_beyond(
        self, points: Float[np.ndarray, "points 3"], resolution: Resolution
    ) -> Bool[np.ndarray, " points"]:
        """Tell which points are beyond the unambiguous range, each with its neighbours.

        A single speckle peak is not conclusive: scatterers in the same cell interfere, which may
        increase or decrease the curvature of its wavefront.

        Parameters
        ----------
        points
            The same points. [m]
        resolution
            Of the image that they are peaks of.
        """
        reach = np.linalg.norm(points, axis=-1)
        sines = points[:, 0] / reach
        apart = np.hypot(
            (reach[:, None] - reach) / resolution.along_ray,
            (sines[:, None] - sines) / resolution.across_ray,
        )
        near = (apart < NEIGHBOURHOOD).astype(float)
        near /= near.sum(axis=1, keepdims=True)
        # Of speckle that by chance is focused badly otherwise, a ratio may be huge.
        over_here, over_flat = (
            np.minimum(self.beyond / other, MOST) for other in (self.here, self.flat)
        )
        told: np.ndarray = (
            (near @ over_here > BEYOND_HERE)
            & (near @ over_flat > BEYOND_FLAT)
            & (over_here > CLEARLY_HERE)
        )
        return told


def focus_by_range(
    profiles: RangeProfiles, points: Float[np.ndarray, "points 3"], resolution: Resolution
) -> FocusByRange:
    """Focus points as if they were where they are imaged, and as if they were farther.

    Parameters
    ----------
    profiles
        Of an echo in the array's frame, not tapered.
    points
        Where the image has its peaks. [m]
    resolution
        Of the echo.
    """
    middles = np.mean(profiles.legs, axis=0)
    about, aside = (_tilts(profiles, middles, cells) for cells in (SHIFTS, TILTS))
    wavenumber = 2 * np.pi * profiles.carrier / speed_of_light
    reach = np.linalg.norm(points, axis=-1, keepdims=True)
    # Of a path of `passes` legs each way; a monostatic echo's profiles end at twice c/2Δf.
    longer = profiles.unambiguous / (profiles.passes * len(profiles.legs))
    places = [points * (reach + order * longer) / reach for order in range(ORDERS + 1)]
    lengths = [_lengths(profiles, place) for place in places]
    ways = profiles.passes * len(profiles.legs)
    lengths.append(-ways * (points / reach) @ (middles - middles.mean(axis=0)).T)
    best = np.zeros((len(lengths), len(points)))
    for shift in RANGE_SHIFTS:
        aligned = aligned_profiles(profiles, points, shift * resolution.along_ray)
        for order, (trial, length) in enumerate(zip(best, lengths, strict=True)):
            # A reflection is as wide as the array, and has its peaks beside its direction.
            tilts = aside if order > ORDERS else about
            turned = aligned * np.exp(1j * wavenumber * (length - lengths[0]))
            focused = np.abs(np.einsum("pm,tm->pt", turned, tilts)) ** 2
            np.maximum(trial, focused.max(axis=1), out=trial)
    best /= profiles.gain**2
    return FocusByRange(here=best[0], beyond=best[1:-1].max(axis=0), flat=best[-1])


def brightest_from_beyond(
    profiles: RangeProfiles,
    ranges: Float[np.ndarray, " ranges"],
    sines: Float[np.ndarray, " sines"],
) -> float:
    """Return how much brighter some ranges are focused from beyond the unambiguous range. [-].

    Near the array, the echo of one post from beyond is imaged as an arc over many directions, of
    which peak by peak none is focused there: only its own direction is, and that decides here.

    Parameters
    ----------
    profiles
        Of an echo in the array's frame, not tapered.
    ranges
        Where things are imaged, less than a cell apart. [m]
    sines
        Directions in which things may be, less than a cell apart. [-]

    Returns
    -------
    Largest intensity as from beyond, over the largest as from here.
    """
    longer = profiles.unambiguous / (profiles.passes * len(profiles.legs))
    brightest = np.zeros(ORDERS + 1)
    for reach in ranges:
        for order in range(ORDERS + 1):
            x = (reach + order * longer) * sines
            y = (reach + order * longer) * np.sqrt(1 - sines**2)
            points = np.stack([x, y, np.zeros_like(x)], axis=-1)
            focused = np.abs(aligned_profiles(profiles, points, 0.0).sum(axis=-1)) ** 2
            brightest[order] = max(brightest[order], float(focused.max()))
    return float(brightest[1:].max() / brightest[0]) if brightest[0] > 0 else 0.0


def _tilts(
    profiles: RangeProfiles,
    middles: Float[np.ndarray, "channels 3"],
    cells: Float[np.ndarray, " beside"],
) -> Complex[np.ndarray, "tilts channels"]:
    """Return the phases over an array of waves from some cells beside a peak."""
    along: np.ndarray = np.exp(1j * np.pi * cells[:, None] * over_half_aperture(profiles))
    if not spans_a_plane(middles):
        return along
    height = middles[:, 2] - middles[:, 2].mean()
    up = np.exp(1j * np.pi * cells[:, None] * height / (0.5 * np.ptp(height)))
    return np.asarray((along[:, None] * up).reshape(-1, len(middles)))


def _lengths(
    profiles: RangeProfiles, points: Float[np.ndarray, "points 3"]
) -> Float[np.ndarray, "points channels"]:
    """Return the path to each point from each position, less that from the centre. [m]."""
    total = 0.0
    for leg in profiles.legs:
        total = total + (
            np.linalg.norm(points[:, None] - leg, axis=-1)
            - np.linalg.norm(points - leg.mean(axis=0), axis=-1)[:, None]
        )
    return np.asarray(profiles.passes * total)
