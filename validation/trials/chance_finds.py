"""False alarms by noise, speckle and random peaks, compared with the estimator's thresholds.

Each function draws data that a threshold should reject, or accept, and returns rows with the limits
stated in the threshold's docstring.
"""

import numpy as np
from jaxtyping import Float
from scipy.ndimage import maximum_filter1d, uniform_filter
from scipy.signal import firwin
from scipy.stats import binom

from estimator import false_alarm
from estimator.array.linear_array import echo_resolution
from estimator.array.resolution_cell import Resolution, coarse_resolution
from estimator.imaging.survey_2d import survey
from estimator.walls import line_detection, line_extent, plane_detection, plane_fit
from validation.harness.claim import Row
from validation.trials.drawn_echoes import draw_echo

SURE = 1e-3
"""Probability that a measured share is outside of correct limits. [-]"""


def share_limits(probability: float, trials: int) -> tuple[float, float]:
    """Return limits of the share of events of a probability in a number of trials. [-]."""
    low = binom.ppf(SURE / 2, trials, probability) / trials
    return float(low), float(binom.ppf(1 - SURE / 2, trials, probability) / trials)


def highest_of_cells(rng: np.random.Generator, *, trials: int = 4000, cells: int = 2000) -> Row:
    """Measure how often the brightest of many cells of noise passes the threshold of a rate.

    It is checked at a rate of 0.05; the estimator's own rates are too small to be measured.
    """
    rate = 0.05
    highest = rng.exponential(size=(trials, cells)).max(axis=1)
    low, high = share_limits(rate, trials)
    return Row(
        name=f"false_alarm.threshold: highest of {cells} cells above it at a rate of {rate:g}",
        stated=f"{rate:g}",
        measured=float(np.mean(highest > false_alarm.threshold(rate, cells=float(cells)))),
        low=low,
        high=high,
        origin=f"binomial scatter of {trials} trials",
    )


def peaks_of_noise(rng: np.random.Generator, *, images: int = 20) -> Row:
    """Count the peaks of images of noise alone."""
    surveys = [survey(draw_echo("noise", rng).echo) for _ in range(images)]
    pixels = surveys[0].values.size
    return Row(
        name=f"false_alarm.PIXEL: peaks in an image of noise, {pixels} pixels",
        stated=f"at most {pixels * false_alarm.PIXEL:.2g} an image",
        measured=float(np.mean([len(one.peaks) for one in surveys])),
        high=pixels * false_alarm.PIXEL + 3 * np.sqrt(pixels * false_alarm.PIXEL / images),
        origin="pixels times the rate, and three deviations",
    )


def strewn_lines(rng: np.random.Generator, *, peaks: int, images: int = 10) -> Row:
    """Count the line candidates among peaks uniformly random in an image."""
    looked = survey(draw_echo("noise", rng).echo)
    coarse = coarse_resolution(echo_resolution(draw_echo("noise", rng).echo))
    places = looked.points.reshape(-1, 3)
    counts = [
        len(line_detection.find_lines(rng.choice(places, peaks, replace=False), coarse))
        for _ in range(images)
    ]
    return Row(
        name=f"line_detection.FEWEST_INLIERS: candidates among {peaks} strewn peaks",
        stated="hardly one in an image",
        measured=float(np.mean(counts)),
        unit="an image",
        high=0.1 + 3 * np.sqrt(0.1 / images),
        origin="one image in ten and three deviations: each costs a fit, which tests its contrast",
    )


def strewn_planes(rng: np.random.Generator, *, peaks: int = 300, volumes: int = 100) -> Row:
    """Count how often peaks uniformly random in a volume make a plane."""
    resolution = coarse_resolution(PLANAR_RESOLUTION)
    depth, width = 3.0, 1.2
    found = 0
    for _ in range(volumes):
        cosines = rng.uniform(-width / 2, width / 2, (peaks, 2))
        rays = np.column_stack([cosines[:, 0], np.sqrt(1 - (cosines**2).sum(1)), cosines[:, 1]])
        places = rng.uniform(0.3, 0.3 + depth, peaks)[:, None] * rays
        found += bool(plane_detection.find_planes(places, resolution, depth=depth, width=width))
    return Row(
        name=f"false_alarm.PLANE: volumes of {peaks} strewn peaks in which a plane is found",
        stated=f"at most {false_alarm.PLANE:g}",
        measured=found / volumes,
        high=share_limits(false_alarm.PLANE, volumes)[1],
        origin=f"the rate, and the binomial scatter of {volumes} volumes",
    )


PLANAR_RESOLUTION = Resolution(along_ray=0.0214, across_ray=0.016)
"""Resolution of 32 × 32 elements of 5 mm at 57 to 64 GHz, as in ``room_3d``."""


def speckle_gap(rng: np.random.Generator, *, cells: int = 100_000) -> tuple[Row, Row]:
    """Measure the distances between peaks of speckle along a wall.

    Speckle is Gaussian noise with a bandwidth of one cycle per cell, sampled eight times per cell;
    peaks are maxima within half a cell to either side, above a tenth of the mean.
    """
    per_cell = 8
    kernel = firwin(16 * per_cell + 1, 1.0 / per_cell)
    field = rng.standard_normal((2, cells * per_cell))
    parts = [np.convolve(part, kernel, mode="valid") for part in field]
    speckle = parts[0] ** 2 + parts[1] ** 2
    speckle = speckle / speckle.mean()
    tops = np.flatnonzero(speckle == maximum_filter1d(speckle, per_cell + 1))
    places = tops[speckle[tops] > line_extent.END_LEVEL] / per_cell
    gaps = np.diff(places)
    wide = float(np.sum(gaps > line_detection.GAP)) / float(places[-1] - places[0])
    return (
        Row(
            name="line_detection.GAP: gaps as wide in speckle",
            stated="below 1e-3 a cell",
            measured=wide,
            unit="a cell",
            high=1e-3,
            origin="the constant's docstring",
        ),
        Row(
            name="peak_detection.MOST_PEAKS: distance of neighbouring peaks of speckle",
            stated="one or two cells",
            measured=float(gaps.mean()),
            unit="cells",
            low=1.0,
            high=2.0,
            origin="the constant's docstring",
        ),
    )


def speckle_levels(rng: np.random.Generator, *, cells: int = 200_000) -> tuple[Row, Row]:
    """Measure how often speckle is dark, and the deviation of its mean over some cells in dB."""
    intensity = rng.exponential(size=cells)
    count = int(line_extent.CELLS_OF_STEP)
    means = (10 * np.log10(intensity[: cells // count * count])).reshape(-1, count).mean(axis=1)
    return (
        Row(
            name="line_extent.END_LEVEL: share of speckle below it",
            stated="one cell in ten",
            measured=float(np.mean(intensity < line_extent.END_LEVEL)),
            low=0.09,
            high=0.10,
            origin="1 − exp(−0.1) = 0.095, and the scatter of the draws",
        ),
        Row(
            name=f"line_extent.CELLS_OF_STEP: deviation of the mean level of {count} cells",
            stated="3 dB",
            measured=float(means.std()),
            unit="dB",
            low=3.0,
            high=3.4,
            origin="5.57 dB of one cell over √3 = 3.2 dB",
        ),
    )


def smoothed_background(rng: np.random.Generator, *, pixels: int = 1000) -> Row:
    """Measure how often background, averaged over nine half-cell pixels, exceeds the contrast."""
    fine: Float[np.ndarray, "2 rows columns"] = rng.standard_normal((2, pixels, pixels))
    # Pixels of half a cell: the band is half of the sampling rate along each axis.
    spectrum = np.fft.fft2(fine[0] + 1j * fine[1])
    inside = np.abs(np.fft.fftfreq(pixels)) < 0.25
    intensity = np.abs(np.fft.ifft2(spectrum * np.outer(inside, inside))) ** 2
    smooth = uniform_filter(intensity / intensity.mean(), plane_fit.SMOOTHED, mode="wrap")
    return Row(
        name="plane_fit.CONTRAST: smoothed pixels of background above it",
        stated="below one in a thousand",
        measured=float(np.mean(smooth > plane_fit.CONTRAST)),
        high=1e-3,
        origin="the constant's docstring",
    )


def chance_rows(rng: np.random.Generator, *, share: float = 1.0) -> list[Row]:
    """Return the rows of all functions, with a share of their usual numbers of draws."""
    return [
        highest_of_cells(rng, trials=max(400, round(4000 * share))),
        peaks_of_noise(rng, images=max(2, round(20 * share))),
        *(strewn_lines(rng, peaks=count, images=max(2, round(10 * share))) for count in (100, 400)),
        strewn_planes(rng, volumes=max(5, round(100 * share))),
        *speckle_gap(rng, cells=max(20_000, round(100_000 * share))),
        *speckle_levels(rng),
        smoothed_background(rng),
    ]
