"""The survey of a linear array: a coarse image of all that it reaches, and its peaks."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Complex, Float

from estimator.array.linear_array import echo_reach, echo_resolution, imaged_sine
from estimator.array.resolution_cell import Resolution, coarse_resolution
from estimator.array.windows import SURVEY_TAPER, frequency_taper, survey_weights
from estimator.imaging.aperture_parts import PolarGrid
from estimator.imaging.focusing import PreparedEcho
from estimator.imaging.peak_detection import image_contrast, mean_background, significant_peaks
from estimator.imaging.phase_curvature import bent_intensities, coherence_factor
from estimator.imaging.polar_image import focus_polar
from estimator.imaging.range_alias import FocusByRange, focus_by_range
from estimator.measurement.model import Echo

STEP = 0.75
"""Spacing of the image's grid in range and sine, over the untapered cell: 0.49 of the cell of the
survey's taper, so that a peak between pixels loses 0.9 dB at most along each axis. [-]"""

WHOLE = 1e-6
"""Part of a step by which a sector may miss its last pixel, by rounding. [-]"""

REFLECTED = 0.35
"""Least coherence, with the wavefront of a mirror that faces the array, of the array's reflection
in it: an ideal mirror has 1, and a third of the array in it a third. [-]"""
FLATTER = 2.0
"""Least coherence of such a reflection over that with a point's wavefront. In 101 random rooms 34
peaks where a wall faces the array have both, and one of 1139 elsewhere on walls; of 0.5 alone, as
a mirror, it is 28 and 23: far away the two wavefronts are alike. [-]"""

FACE = 1e-2
"""Intensity of a facing surface's own peaks, over that of its reflection: the sidelobes of the
reflection in its range are weaker, as the taper's are −50 dB. [-]"""

FACE_DEPTH = 2.0
"""Distance in range within which peaks belong to one facing surface: the half width of the survey's
range lobe down to its first null. [cells c/2B]"""

MOST_GAIN = 1.2
"""Intensity that a bend of the wavefront may add to a peak; on full-wave data with two ghosts
and their clouds it adds less than 1 % to each of the wall's peaks, less than 5 % to the ghosts,
and more than 12 % to three quarters of the clouds', 60 % in the median. [-]"""


@dataclass(frozen=True, kw_only=True)
class Survey:
    """A tapered image on a polar grid, uniform in range and in the sine of the azimuth."""

    values: Complex[np.ndarray, "ranges sines"]
    points: Float[np.ndarray, "ranges sines 3"]  # in the array's frame [m]
    peaks: Float[np.ndarray, "peaks 3"]  # that stand out of the background, strongest first [m]
    bent: Bool[np.ndarray, " peaks"]
    """Whether nothing is where they appear: they were scattered twice, or are beyond the
    unambiguous range."""
    beyond: Bool[np.ndarray, " peaks"]  # whether they are beyond the unambiguous range
    as_point: Float[np.ndarray, " peaks"]  # coherence over the aperture, as that of a point [-]
    as_mirror: Float[np.ndarray, " peaks"]  # the same as that of a mirror facing the array [-]
    by_range: FocusByRange  # the peaks as from where they are imaged, and as from farther away
    background: float  # mean intensity of what is no echo [-]

    @property
    def reflected(self) -> Bool[np.ndarray, " peaks"]:
        """Whether the peaks are the array's reflection in a surface that faces it."""
        return is_reflection(self.as_point, self.as_mirror)

    @property
    def contrast(self) -> float:
        """Intensity of the brightest over the background; 0 of no echo. [-]."""
        return image_contrast(float(np.max(np.abs(self.values) ** 2)), self.background)


def survey(
    echo: Echo,
    *,
    prepared: PreparedEcho | None = None,
    values: Complex[np.ndarray, "ranges sines"] | None = None,
) -> Survey:
    """Image everything within reach, at half the resolution of a low-sidelobe taper.

    Parameters
    ----------
    echo
        In the array's frame.
    prepared
        The same, if it was looked at before.
    values
        Its tapered image on :func:`survey_grid`, if that is known already. [-]
    """
    resolution = echo_resolution(echo)
    ready = PreparedEcho(echo) if prepared is None else prepared
    ranges, sines = survey_grid(echo, imaged_sine(echo))
    points = sector_points(ranges[:, None], sines)
    taper = survey_weights(echo)
    if values is None:
        values = focus_sector(ready, ranges, sines)
    peaks = significant_peaks(np.abs(values) ** 2, points)
    untapered = ready.plain.profiles
    tried = bent_intensities(untapered, peaks, resolution)
    by_range = focus_by_range(untapered, peaks, resolution)
    beyond = by_range.points_beyond(peaks, coarse_resolution(resolution))
    # What the noise in the image is before the sum over the positions.
    background = mean_background(np.abs(values) ** 2)
    noise = background * taper.sum() ** 2 / (taper**2).sum()
    across = frequency_taper(echo.frequencies, SURVEY_TAPER)
    by_shape = [
        coherence_factor(
            ready.over_band, peaks, resolution, flat=flat, noise=noise * float((across**2).sum())
        )
        for flat in (False, True)
    ]
    return Survey(
        values=values,
        points=points,
        peaks=peaks,
        beyond=beyond,
        bent=beyond
        | (tried.max(axis=1) > MOST_GAIN * tried[:, 0])
        & ~_faces(peaks, tried[:, 0], is_reflection(by_shape[0], by_shape[1]), resolution),
        by_range=by_range,
        as_point=by_shape[0],
        as_mirror=by_shape[1],
        background=background,
    )


def survey_grid(
    echo: Echo, widest: float
) -> tuple[Float[np.ndarray, " ranges"], Float[np.ndarray, " sines"]]:
    """Return the ranges [m] and the sines [-] at which an echo is surveyed, up to a largest sine.

    Sectors of any width share their pixels: the steps are such that the sector without grating
    lobes ends with one.
    """
    resolution = echo_resolution(echo)
    nearest, farthest = echo_reach(echo)
    ranges = np.arange(nearest, farthest, STEP * resolution.along_ray)
    limit = imaged_sine(echo)
    step = limit / int(np.ceil(limit / (STEP * resolution.across_ray)))
    half = int(np.floor(widest / step + WHOLE))
    return ranges, step * np.arange(-half, half + 1)


def focus_sector(
    prepared: PreparedEcho, ranges: Float[np.ndarray, " ranges"], sines: Float[np.ndarray, " sines"]
) -> Complex[np.ndarray, "ranges sines"]:
    """Focus the tapered echo on ranges [m] and sines before a linear array. [-]."""
    grid = PolarGrid(ranges, sines)
    return focus_polar(prepared.tapered, grid, centre=np.zeros(3), axis=np.array([1.0, 0.0, 0.0]))


def sector_points(
    ranges: Float[np.ndarray, "*#grid"], sines: Float[np.ndarray, "*#grid"]
) -> Float[np.ndarray, "*grid 3"]:
    """Return places in the plane before a linear array, from ranges [m] and azimuths' sines."""
    x = ranges * sines
    return np.stack([x, ranges * np.sqrt(1 - sines**2), np.zeros_like(x)], axis=-1)


def is_reflection(
    as_point: Float[np.ndarray, " peaks"], as_mirror: Float[np.ndarray, " peaks"]
) -> Bool[np.ndarray, " peaks"]:
    """Tell by the coherence with two wavefronts [-] which peaks reflect the array in itself."""
    return np.asarray((as_mirror >= REFLECTED) & (as_mirror >= FLATTER * as_point))


def _faces(
    peaks: Float[np.ndarray, "peaks 3"],
    intensity: Float[np.ndarray, " peaks"],
    reflected: Bool[np.ndarray, " peaks"],
    resolution: Resolution,
) -> Bool[np.ndarray, " peaks"]:
    """Tell which peaks belong to a surface that faces the array and so reflects it.

    All its points have nearly the same range: their peaks interfere, so that the curvature of a
    single peak's wavefront is not meaningful.
    """
    belongs = np.zeros(len(peaks), dtype=bool)
    for flash in np.flatnonzero(reflected):
        ray = peaks[flash] / np.linalg.norm(peaks[flash])
        level = np.abs((peaks - peaks[flash]) @ ray) < FACE_DEPTH * resolution.along_ray
        belongs |= level & (intensity > FACE * intensity[flash])
    return belongs
