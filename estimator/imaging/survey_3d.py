"""The volume in front of a planar array: one tapered image on a polar grid, read anywhere.

Uniform in range and in the two direction cosines, the grid has as many points in each
resolution cell near the array as far from it; a Cartesian grid of the finest cell would have
hundreds of times as many. Between its points the image, less the carrier's phase to the
array's centre, is smooth, and is interpolated.
"""

from dataclasses import dataclass

import numpy as np
import scipy.ndimage
from jaxtyping import Bool, Complex, Float
from scipy.constants import speed_of_light

from estimator.array.planar_array import PlanarArray, planar_reach, planar_resolution
from estimator.array.windows import survey_weights
from estimator.imaging.backprojection import backproject
from estimator.imaging.peak_detection import (
    image_contrast,
    mean_background,
    peak_threshold,
    peaks_above,
)
from estimator.imaging.range_compression import unambiguous_path
from estimator.measurement.model import Echo

STEP = 0.75
"""Spacing of the grid, over the untapered cell: 0.49 of the tapered one. [-]"""

MOST_PEAKS = 500
"""Strongest peaks that are searched for planes. In a room each wall shows a few dozen; the search
tests its draws on all of them. [-]"""

LEAST_AHEAD = 0.05
"""Square of the direction cosine along boresight, from which a direction is imaged: within 13° of
the array's plane a step of the grid is several cells long. [-]"""

BAND = 9
"""Frequencies over the band at which a grating lobe's origin is looked for: the origin moves by the
relative bandwidth times λ/2d over the band, about eight beams for a tenth of bandwidth and 32
elements at λ/2 to λ. [-]"""

LOBE = 4.0
"""Intensity at the origin of a grating lobe over that of the lobe, at least. It is the square of
the lobe's smear in beams: 13 for a tenth of relative bandwidth and 32 elements. [-]"""

MOST_WORK = 2.5e9
"""Points times positions from which the grid grows coarser, up to :data:`WIDEST_STEP`: a matter of
time, some seconds on two cores. [-]"""

WIDEST_STEP = 1.0
"""Widest spacing of the grid, over the untapered cell: 0.65 of the tapered one; a peak between its
points loses 1.6 dB at most along each axis. [-]"""


@dataclass(frozen=True, kw_only=True)
class VolumeSurvey:
    """A tapered image of everything within reach, in the array's frame."""

    values: Complex[np.ndarray, "ranges along up"]  # less the carrier's phase [-]
    ranges: Float[np.ndarray, " ranges"]  # [m]
    along: Float[np.ndarray, " along"]  # direction cosines along x [-]
    up: Float[np.ndarray, " up"]  # direction cosines along z [-]
    carrier: float  # two-way wavenumber of the phase taken out [rad/m]
    background: float  # mean intensity of what is no echo [-]
    peaks: Float[np.ndarray, "peaks 3"]  # that stand out of it, strongest first [m]
    lobes: Float[np.ndarray, "lobes 3"]  # peaks that are grating lobes of what is outside [m]

    @property
    def contrast(self) -> float:
        """Intensity of the brightest over the background; 0 of no echo. [-]."""
        return image_contrast(float(np.max(np.abs(self.values) ** 2)), self.background)

    def at(self, points: Float[np.ndarray, "*n 3"]) -> Complex[np.ndarray, "*n"]:
        """Read the image at points; outside the surveyed volume there is none: 0."""
        shape = points.shape[:-1]
        flat = points.reshape(-1, 3)
        distance = np.linalg.norm(flat, axis=1)
        safe = np.maximum(distance, 1e-9)
        places = np.stack(
            [
                (distance - self.ranges[0]) / (self.ranges[1] - self.ranges[0]),
                (flat[:, 0] / safe - self.along[0]) / (self.along[1] - self.along[0]),
                (flat[:, 2] / safe - self.up[0]) / (self.up[1] - self.up[0]),
            ]
        )
        sizes = np.array(self.values.shape)[:, None]
        inside = np.all((places > -1e-6) & (places < sizes - 1 + 1e-6), axis=0)
        inside &= flat[:, 1] > 0
        values = np.zeros(len(flat), dtype=np.complex128)
        read = scipy.ndimage.map_coordinates(
            self.values, places[:, inside], order=1, mode="nearest"
        )
        values[inside] = read * np.exp(1j * self.carrier * distance[inside])
        return values.reshape(shape)


def survey_volume(echo: Echo, array: PlanarArray) -> VolumeSurvey:
    """Image everything within reach and within the angles without grating lobes.

    Parameters
    ----------
    echo
        In the array's frame.
    array
        Its extents.
    """
    resolution = planar_resolution(array, echo)
    nearest, farthest = planar_reach(array, echo, passes=2)
    sine = array.unaliased(echo.frequencies, passes=2)
    beams = array.beam(echo.frequencies, passes=2)
    work = (farthest - nearest) / resolution.along_ray * (2 * sine) ** 2 / np.prod(beams)
    work *= len(echo.positions)
    step = float(np.clip((work / MOST_WORK) ** (1 / 3), STEP, WIDEST_STEP))
    ranges = np.arange(nearest, farthest, step * resolution.along_ray)
    along, up = (
        np.linspace(-sine, sine, 2 * max(1, int(np.ceil(sine / (step * beam)))) + 1)
        for beam in beams
    )
    points, values, seen = _imaged(echo, ranges, along, up)
    carrier = 4 * np.pi * float(echo.frequencies.mean()) / speed_of_light
    values *= np.exp(-1j * carrier * ranges)[:, None, None]
    intensity = np.abs(values) ** 2
    background = mean_background(intensity[seen])
    threshold = peak_threshold(background, float(intensity.max()))
    peaks, levels = peaks_above(intensity, points, threshold, most=MOST_PEAKS)
    lobe = brighter_elsewhere(echo, array, peaks, levels)
    return VolumeSurvey(
        values=values,
        ranges=ranges,
        along=along,
        up=up,
        carrier=carrier,
        background=background,
        peaks=peaks[~lobe],
        lobes=peaks[lobe],
    )


def _imaged(
    echo: Echo,
    ranges: Float[np.ndarray, " ranges"],
    along: Float[np.ndarray, " along"],
    up: Float[np.ndarray, " up"],
) -> tuple[
    Float[np.ndarray, "ranges along up 3"],
    Complex[np.ndarray, "ranges along up"],
    Bool[np.ndarray, "ranges along up"],
]:
    """Image a polar grid; return its points [m], the values, and where there is an image."""
    points = np.zeros((ranges.size, along.size, up.size, 3))
    points[..., 0] = ranges[:, None, None] * along[:, None]
    points[..., 2] = ranges[:, None, None] * up
    ahead = np.maximum(1 - along[:, None] ** 2 - up**2, 0.0)
    points[..., 1] = ranges[:, None, None] * np.sqrt(ahead)
    values = np.zeros(points.shape[:-1], dtype=np.complex128)
    seen = np.broadcast_to(ahead > LEAST_AHEAD, values.shape)
    values[seen] = backproject(echo, points[seen], weights=survey_weights(echo))
    return points, values, seen


def peaks_around(
    echo: Echo,
    array: PlanarArray,
    looked: VolumeSurvey,
    heading: Float[np.ndarray, " 3"],
    farthest: float,
) -> Float[np.ndarray, "peaks 3"]:
    """Find the peaks of the image around a direction beyond the angles without grating lobes.

    There the image shows real scatterers and also grating lobes of scatterers elsewhere. A peak
    is therefore no proof of a scatterer, but the absence of peaks shows that nothing is there.

    Parameters
    ----------
    echo
        In the array's frame.
    array
        Its extents.
    looked
        The survey: as wide a piece as that is imaged around the direction.
    heading
        Unit vector.
    farthest
        To which distance. [m]

    Returns
    -------
    Peaks that no grating lobe explains, strongest first. [m]
    """
    ranges = looked.ranges[looked.ranges <= farthest]
    if ranges.size < 2:
        return np.zeros((0, 3))
    along, up = heading[0] + looked.along, heading[2] + looked.up
    points, values, _ = _imaged(echo, ranges, along, up)
    intensity = np.abs(values) ** 2
    strongest = float(np.max(np.abs(looked.values) ** 2))
    threshold = peak_threshold(looked.background, strongest)
    peaks, levels = peaks_above(intensity, points, threshold, most=MOST_PEAKS)
    real: np.ndarray = peaks[~brighter_elsewhere(echo, array, peaks, levels)]
    return real


def brighter_elsewhere(
    echo: Echo,
    array: PlanarArray,
    peaks: Float[np.ndarray, "peaks 3"],
    levels: Float[np.ndarray, " peaks"],
) -> Bool[np.ndarray, " peaks"]:
    """Tell which peaks are grating lobes of something outside of the imaged angles.

    A source at direction cosine u repeats at u ± λ/2d, which moves with the frequency: over the
    band the repetition is smeared, and weaker than what is seen where the source really is.

    Parameters
    ----------
    echo
        In the array's frame.
    array
        Its extents.
    peaks
        Of the tapered image. [m]
    levels
        Their intensities. [-]
    """
    points, real = lobe_origins(echo, array, peaks)
    # Where the farthest element's path is ambiguous there is no image to look at.
    reach = np.linalg.norm(points, axis=-1) + array.half
    real &= reach < unambiguous_path(echo.frequencies) / 2
    if not real.any():
        return np.zeros(len(peaks), dtype=bool)
    there = np.zeros(real.shape)
    there[real] = np.abs(backproject(echo, points[real], weights=survey_weights(echo))) ** 2
    lobes: np.ndarray = there.max(axis=1) > LOBE * levels
    return lobes


def lobe_origins(
    echo: Echo, array: PlanarArray, points: Float[np.ndarray, "points 3"]
) -> tuple[Float[np.ndarray, "points origins 3"], Bool[np.ndarray, "points origins"]]:
    """Return where sources would be whose grating lobes the points are, and whether they can be.

    Parameters
    ----------
    echo
        In the array's frame.
    array
        Its extents.
    points
        That the image shows. [m]

    Returns
    -------
    Origins for eight orders and some frequencies of the band [m], and which lie in front.
    """
    distance = np.linalg.norm(points, axis=1)
    wavelengths = speed_of_light / np.linspace(echo.frequencies[0], echo.frequencies[-1], BAND)
    places = []
    for along, up in [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]:
        shift = 0.5 * wavelengths[:, None] * np.array([along, up]) / np.array(array.spacing)
        places.append(points[:, None, ::2] / distance[:, None, None] + shift)
    cosines = np.concatenate(places, axis=1)
    ahead = 1 - (cosines**2).sum(axis=-1)
    rays = np.stack([cosines[..., 0], np.sqrt(np.maximum(ahead, 0)), cosines[..., 1]], axis=-1)
    return distance[:, None, None] * rays, ahead > LEAST_AHEAD
