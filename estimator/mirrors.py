"""Mirrors: the walls that an image shows, found without help."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.backprojection import Focuser, backproject, focus, prepare
from estimator.line_search import Resolution, find_lines, significant_peaks
from estimator.measurement import Echo, MeasurementError, frequency_step
from estimator.mirror_fit import FittedLine, Focus, fit_line
from estimator.projection import crossing
from estimator.range_profiles import range_profiles
from estimator.resolution import HALF_POWER, unaliased_sine
from estimator.windows import Window, aperture_taper, frequency_taper

TAPER = Window(name="taylor", sidelobe_db=-50.0, nearly_equal=9)
"""The survey's; its sidelobes are below :data:`estimator.line_search.DYNAMIC_RANGE`."""

LEAST_CONFIDENCE = 0.999
LEAST_CELLS = 8.0
"""Shortest mirror; shorter ones have no angle to speak of. [cells]"""


@dataclass(frozen=True, kw_only=True)
class Survey:
    """A tapered image on a polar grid, uniform in range and in the sine of the azimuth."""

    values: Complex[np.ndarray, "ranges sines"]
    points: Float[np.ndarray, "ranges sines 3"]  # in the array's frame [m]
    peaks: Float[np.ndarray, "peaks 3"]  # that stand out of the background, strongest first [m]


def echo_resolution(echo: Echo) -> Resolution:
    """Return c/2B along the ray and λ/2D across it, of an echo in the array's frame."""
    band = float(echo.frequencies[-1] - echo.frequencies[0])
    wavelength = speed_of_light / float(echo.frequencies.mean())
    aperture = float(np.ptp(echo.positions[:, 0]))
    return Resolution(along_ray=speed_of_light / (2 * band), across_ray=wavelength / (2 * aperture))


def echo_reach(echo: Echo) -> tuple[float, float]:
    """Return the distances between which an echo can be imaged. [m].

    From half the aperture to the unambiguous range c/2Δf, less the aperture.

    Raises
    ------
    MeasurementError
        If nothing is left between.
    """
    aperture = float(np.ptp(echo.positions[:, 0]))
    step = frequency_step(echo.frequencies)
    nearest, farthest = 0.5 * aperture, speed_of_light / (2 * step) - 1.1 * aperture
    if farthest < 2 * nearest:
        raise MeasurementError(
            f"frequency step {step / 1e6:.4g} MHz: the echo is unambiguous to "
            f"{speed_of_light / (2 * step):.3g} m only, less than twice the aperture of "
            f"{aperture:.3g} m; take smaller frequency steps"
        )
    return nearest, farthest


def imaged_sine(echo: Echo) -> float:
    """Return the largest |sin φ| that is imaged: without grating lobes, and short of endfire."""
    spacing = float(np.ptp(echo.positions[:, 0])) / (len(echo.positions) - 1)
    return min(0.95, unaliased_sine(spacing, speed_of_light / float(echo.frequencies[-1])))


def survey(echo: Echo) -> Survey:
    """Image everything within reach, at half the resolution of a low-sidelobe taper.

    Parameters
    ----------
    echo
        In the array's frame.
    """
    resolution = echo_resolution(echo)
    nearest, farthest = echo_reach(echo)
    ranges = np.arange(nearest, farthest, 0.75 * resolution.along_ray)
    limit = imaged_sine(echo)
    count = 2 * int(np.ceil(limit / (0.75 * resolution.across_ray))) + 1
    sines = np.linspace(-limit, limit, count)
    points = np.zeros((ranges.size, count, 3))
    points[..., 0] = ranges[:, None] * sines
    points[..., 1] = ranges[:, None] * np.sqrt(1 - sines**2)
    values = backproject(echo, points, weights=_taper_weights(echo))
    peaks = significant_peaks(np.abs(values) ** 2, points)
    return Survey(values=values, points=points, peaks=peaks)


def _taper_weights(echo: Echo) -> Float[np.ndarray, "positions freqs"]:
    return np.outer(aperture_taper(echo.positions, TAPER), frequency_taper(echo.frequencies, TAPER))


def detect_mirrors(echo: Echo, looked: Survey) -> tuple[FittedLine, ...]:
    """Find the walls that the image shows; the strongest first.

    Parameters
    ----------
    echo
        In the array's frame.
    looked
        Its survey.

    Returns
    -------
    Lines whose confidence is at least :data:`LEAST_CONFIDENCE`. Nothing tells here whether
    one is seen directly or through another.
    """
    resolution = echo_resolution(echo)
    coarse = _coarse_resolution(echo)
    candidates = find_lines(looked.peaks, coarse)
    plain = prepare(range_profiles(echo))
    tapered = prepare(range_profiles(echo, weights=_taper_weights(echo)))
    reach = echo_reach(echo)
    trials = looked.values.shape[0] * looked.values.shape[1]
    lines: list[FittedLine] = []
    for candidate in candidates:
        middle = 0.5 * (candidate.start + candidate.end)
        if any(_lies_on(middle, line, coarse) for line in lines):
            continue  # a part of a wall that was followed to its ends already
        line = fit_line(
            focus_within(plain, reach[1]),
            focus_within(tapered, reach[1]),
            candidate.start,
            candidate.end,
            resolution,
            reach=(0.5 * reach[0], reach[1]),
            trials=trials,
        )
        if line is None or line.confidence < LEAST_CONFIDENCE:
            continue
        if line.length < LEAST_CELLS * float(resolution.cell(line.middle, line.direction)):
            continue
        lines.append(line)
    return tuple(sorted(lines, key=lambda line: -line.level))


def focus_within(focuser: Focuser, farthest: float) -> Focus:
    """Return a function that focuses on points; beyond what is unambiguous there is 0."""

    def focused(points: Float[np.ndarray, "*grid 3"]) -> Complex[np.ndarray, "*grid"]:
        inside = np.einsum("...x,...x->...", points, points) < farthest**2
        if np.all(inside):
            return focus(focuser, points)
        values = np.zeros(points.shape[:-1], dtype=np.complex128)
        values[inside] = focus(focuser, points[inside])
        return values

    return focused


def loose_peaks(
    echo: Echo, looked: Survey, lines: Sequence[FittedLine]
) -> Float[np.ndarray, "peaks 3"]:
    """Return the survey's peaks that lie neither on a wall nor behind one, strongest first."""
    resolution = _coarse_resolution(echo)
    return np.array(
        [
            peak
            for peak in looked.peaks
            if not any(_lies_on(peak, line, resolution, margin=4.0) for line in lines)
            and not any(hides(line, peak) for line in lines)
        ]
    ).reshape(-1, 3)


def _coarse_resolution(echo: Echo) -> Resolution:
    """Return the resolution of the survey, which its taper widens."""
    fine, wider = echo_resolution(echo), TAPER.half_power_width / HALF_POWER
    return Resolution(along_ray=wider * fine.along_ray, across_ray=wider * fine.across_ray)


def hides(line: FittedLine, point: Float[np.ndarray, " 3"]) -> bool:
    """Tell whether a line stands between the array and a point."""
    far = float(np.linalg.norm(point))
    hit = crossing(np.zeros(3), point / far, line.start, line.end)
    return hit is not None and hit[0] < far


def _lies_on(
    point: Float[np.ndarray, " 3"],
    line: FittedLine,
    resolution: Resolution,
    *,
    margin: float = 0.0,
) -> bool:
    """Tell whether a point is on a segment, within two cells across and a margin along it."""
    normal = np.array([line.direction[1], -line.direction[0], 0.0])
    beside = abs(float((point - line.middle) @ normal))
    along = abs(float((point - line.middle) @ line.direction))
    reach = 0.5 * line.length + margin * float(resolution.cell(point, line.direction))
    return beside < 2 * float(resolution.cell(point, normal)) and along < reach
