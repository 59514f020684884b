"""Mirrors: the walls that an image shows, found without help."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Complex, Float
from scipy.constants import speed_of_light

from estimator.array.resolution import unaliased_sine
from estimator.array.windows import SURVEY_TAPER, frequency_taper, survey_weights
from estimator.geometry.path_tracing_2d import crossing
from estimator.imaging.backprojection import Focuser, backproject, focus, prepare
from estimator.imaging.phase_curvature import bent_intensities, coherence
from estimator.imaging.range_compression import range_profiles
from estimator.measurement.model import Echo, MeasurementError, frequency_step
from estimator.walls.face_ends import face_ends
from estimator.walls.line_detection import (
    LineCandidate,
    Resolution,
    coarse_resolution,
    find_lines,
    image_contrast,
    mean_background,
    significant_peaks,
)
from estimator.walls.line_fit_image import FittedLine, fit_between, fit_line
from estimator.walls.line_relations import (
    hides,
    is_edge_on,
    is_hidden,
    lies_on,
    overlap,
    seen_twice,
)
from estimator.walls.line_sampling import Focus

REFLECTED = 0.5
"""Coherence, as that of a mirror facing the array, of what does reflect it. [-]"""
FACE = 1e-2
"""Intensity of a facing surface's peaks over that of its reflection. [-]"""
MOST_GAIN = 1.2
"""Intensity that a bend of the wavefront may add to a peak; on full-wave data with two ghosts
and their clouds it adds less than 1 % to each of the wall's peaks, less than 5 % to the ghosts,
and more than 12 % to three quarters of the clouds', 60 % in the median. [-]"""
LEAST_COHERENCE = 0.02
"""Coherence of a peak that is one wave at all: sidelobes and the remains of what is nearer than
the array is long have 1/M of M channels, speckle in a cell with twenty more has 0.05. [-]"""
MOST_BENT = 0.4
"""Share of bent peaks on a wall's line. Of walls 0.3 to 1.7 m away at all angles, in simulated and
full-wave echoes, a quarter at most are: those that nearly face the array, where many facets share a
range. Of the lines that clouds and grating lobes feign, from half to all of them are. [-]"""
WALL_COHERENCE = 0.2
"""Median coherence of the peaks on a wall that does not reflect the array in itself. Of the same
walls it was 0.3 to 0.98; of what the ambiguities of range and angle feign, 0.04 and 0.1. [-]"""
MOST_CANDIDATES = 8
"""Lines sought among all peaks, bent ones included."""
MOST_UNCERTAIN = 0.5
"""Deviation of a wall's ends and of its offset: what is known no better than this is no line but
scattered peaks. [cells]"""
LEAST_CONTRAST = 10.0
"""Level of a wall over its surroundings: speckle in a cloud has some lines 5 dB above it. [-]"""
LEAST_CONFIDENCE = 0.999
LEAST_CELLS = 8.0
"""Shortest mirror; shorter ones have no angle to speak of. [cells]"""


@dataclass(frozen=True, kw_only=True)
class Survey:
    """A tapered image on a polar grid, uniform in range and in the sine of the azimuth."""

    values: Complex[np.ndarray, "ranges sines"]
    points: Float[np.ndarray, "ranges sines 3"]  # in the array's frame [m]
    peaks: Float[np.ndarray, "peaks 3"]  # that stand out of the background, strongest first [m]
    bent: Bool[np.ndarray, " peaks"]  # whether they were scattered twice: seen nowhere
    as_point: Float[np.ndarray, " peaks"]  # coherence over the aperture, as that of a point [-]
    as_mirror: Float[np.ndarray, " peaks"]  # the same as that of a mirror facing the array [-]
    background: float  # mean intensity of what is no echo [-]

    @property
    def contrast(self) -> float:
        """Intensity of the brightest over the background; 0 of no echo. [-]."""
        return image_contrast(float(np.max(np.abs(self.values) ** 2)), self.background)


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
    taper = survey_weights(echo)
    values = backproject(echo, points, weights=taper)
    peaks = significant_peaks(np.abs(values) ** 2, points)
    tried = bent_intensities(range_profiles(echo), peaks, resolution)
    # What the noise in the image is before the sum over the positions.
    background = mean_background(np.abs(values) ** 2)
    noise = background * taper.sum() ** 2 / (taper**2).sum()
    across = frequency_taper(echo.frequencies, SURVEY_TAPER)
    profiles = range_profiles(echo, weights=across[None, :])
    by_shape = [
        coherence(profiles, peaks, resolution, flat=flat, noise=noise * float((across**2).sum()))
        for flat in (False, True)
    ]
    return Survey(
        values=values,
        points=points,
        peaks=peaks,
        bent=(tried.max(axis=1) > MOST_GAIN * tried[:, 0])
        & ~_faces(peaks, tried[:, 0], by_shape[1], resolution),
        as_point=by_shape[0],
        as_mirror=by_shape[1],
        background=background,
    )


def _faces(
    peaks: Float[np.ndarray, "peaks 3"],
    intensity: Float[np.ndarray, " peaks"],
    as_mirror: Float[np.ndarray, " peaks"],
    resolution: Resolution,
) -> Bool[np.ndarray, " peaks"]:
    """Tell which peaks belong to a surface that faces the array and so reflects it.

    All of it has nearly one range: its peaks disturb each other, and their bends mean nothing.
    """
    belongs = np.zeros(len(peaks), dtype=bool)
    for flash in np.flatnonzero(as_mirror >= REFLECTED):
        ray = peaks[flash] / np.linalg.norm(peaks[flash])
        level = np.abs((peaks - peaks[flash]) @ ray) < 2 * resolution.along_ray
        belongs |= level & (intensity > FACE * intensity[flash])
    return belongs


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
    coarse = coarse_resolution(echo_resolution(echo))
    one_wave = np.maximum(looked.as_point, looked.as_mirror) >= LEAST_COHERENCE
    # Among many facets in one range some of a wall's peaks are bent as well; but around a wall
    # that is seen edge-on they are most of what is not on it.
    candidates = [
        *find_lines(looked.peaks[one_wave & ~looked.bent], coarse),
        *find_lines(looked.peaks[one_wave], coarse, most=MOST_CANDIDATES),
    ]
    farthest = echo_reach(echo)[1]
    plain, tapered = (
        focus_within(prepare(range_profiles(echo, weights=weights)), farthest)
        for weights in (None, survey_weights(echo))
    )
    half = 0.5 * float(np.ptp(echo.positions[:, 0]))
    certain, doubtful = _fitted(echo, looked, candidates, plain, tapered)
    lines = [line for line in _best_of(certain, coarse) if not is_edge_on(line, half)]
    lines = _cut_where_they_cross(lines, echo_resolution(echo), plain, tapered)
    in_sight = [line for line in lines if not is_hidden(line, lines)]
    # Behind a mirror are clouds as well: there only what is seen, not scattered twice, counts.
    behind = np.array(
        [
            any(hides(line, peak) for line in in_sight)
            and not any(lies_on(peak, line, coarse, margin=4.0) for line in in_sight)
            for peak in looked.peaks
        ],
        dtype=bool,
    )
    ghosts = find_lines(looked.peaks[one_wave & ~looked.bent & behind], coarse)
    certain, more = _fitted(echo, looked, ghosts, plain, tapered)
    # What the peaks leave in doubt, an image of it over a wall proves.
    proved = seen_twice(_best_of([*doubtful, *more], coarse), in_sight, echo_resolution(echo))
    in_sight += [
        line
        for line in proved
        if not is_hidden(line, in_sight)
        and not is_edge_on(line, half)
        and not any(overlap(line, known, coarse) for known in in_sight)
    ]
    for line in _best_of([*certain, *proved], coarse):
        if any(overlap(line, known, coarse) for known in in_sight):
            continue
        if is_hidden(line, in_sight) and not is_edge_on(line, half):
            in_sight.append(_to_its_ends(line, plain, tapered, echo_resolution(echo), half))
    return tuple(sorted(in_sight, key=lambda line: -line.level))


def _fitted(
    echo: Echo,
    looked: Survey,
    candidates: Sequence[LineCandidate],
    plain: Focus,
    tapered: Focus,
) -> tuple[list[FittedLine], list[FittedLine]]:
    """Fit candidates that are no part of a line that was fitted.

    Returns
    -------
    Walls that are certain, and lines whose peaks leave it in doubt whether they are walls.
    """
    resolution = echo_resolution(echo)
    coarse = coarse_resolution(resolution)
    reach = echo_reach(echo)
    trials = looked.values.shape[0] * looked.values.shape[1]
    lines: list[FittedLine] = []
    doubtful: list[FittedLine] = []
    for candidate in candidates:
        ends = candidate.start, candidate.end
        if any(all(lies_on(end, line, coarse, margin=4.0) for end in ends) for line in lines):
            continue  # a part of a wall that was followed to its ends already
        line = fit_line(
            plain,
            tapered,
            candidate.start,
            candidate.end,
            resolution,
            reach=(0.5 * reach[0], reach[1]),
            trials=trials,
        )
        if line is None or line.confidence < LEAST_CONFIDENCE:
            continue
        if line.level < LEAST_CONTRAST * line.background:
            continue
        if line.length < LEAST_CELLS * float(resolution.cell(line.middle, line.direction)):
            continue
        if _is_uncertain(line, resolution):
            continue
        (lines if _is_of_waves(line, looked, coarse) else doubtful).append(line)
    return lines, doubtful


def _is_of_waves(line: FittedLine, looked: Survey, coarse: Resolution) -> bool:
    """Tell whether the peaks on a line are waves that come from there, as a wall's are."""
    on = np.array([lies_on(peak, line, coarse) for peak in looked.peaks], dtype=bool)
    if not on.any():
        return True
    if np.mean(looked.bent[on]) > MOST_BENT:
        return False
    reflects = bool(np.any(looked.as_mirror[on] >= REFLECTED))
    coherent = np.maximum(looked.as_point, looked.as_mirror)[on]
    return reflects or float(np.median(coherent)) >= WALL_COHERENCE


def _best_of(lines: Sequence[FittedLine], coarse: Resolution) -> list[FittedLine]:
    """Of lines that lie on each other keep the one with the most energy along it."""
    kept: list[FittedLine] = []
    for line in sorted(lines, key=lambda one: -one.level * one.length):
        if not any(overlap(line, one, coarse) for one in kept):
            kept.append(line)
    return kept


def _is_uncertain(line: FittedLine, resolution: Resolution) -> bool:
    deviations = np.sqrt(np.diag(line.covariance)) * [0.5 * line.length, 1.0]
    cell = float(resolution.cell(line.middle, line.normal))
    return bool(np.any(deviations > MOST_UNCERTAIN * cell))


def _cut_where_they_cross(
    lines: Sequence[FittedLine], resolution: Resolution, plain: Focus, tapered: Focus
) -> list[FittedLine]:
    """Cut what lies behind another line off a line that crosses it.

    Walls that meet at a right angle each continue in the other's mirror image, straight: the
    image shows a cross, of which the halves behind the other wall are ghosts.
    """
    cut: list[FittedLine] = []
    for line in lines:
        start, end = line.start, line.end
        for other in lines:
            hit = None if other is line else crossing(start, line.direction, other.start, other.end)
            if hit is None or hit[0] >= float(np.linalg.norm(end - start)):
                continue
            meeting = start + hit[0] * line.direction
            halves = [hides(other, 0.5 * (meeting + tip)) for tip in (start, end)]
            if halves == [True, False]:
                start = meeting
            elif halves == [False, True]:
                end = meeting
        if start is line.start and end is line.end:
            cut.append(line)
            continue
        shorter = fit_between(plain, tapered, start, end, resolution, trials=1)
        # What is left may be too little for a line: speckle then fits at any angle.
        if shorter is not None and not _is_uncertain(shorter, resolution):
            cut.append(replace(shorter, confidence=line.confidence))
    return cut


def _to_its_ends(
    line: FittedLine, plain: Focus, tapered: Focus, resolution: Resolution, half: float
) -> FittedLine:
    """Cut a hidden line where its face ends."""
    ends = face_ends(line, plain, resolution, half)
    if ends[0] is line.start and ends[1] is line.end:
        return line
    shorter = fit_between(plain, tapered, *ends, resolution, trials=1)
    return line if shorter is None else replace(shorter, confidence=line.confidence)


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
    resolution = coarse_resolution(echo_resolution(echo))
    return np.array(
        [
            peak
            for peak in looked.peaks[~looked.bent]
            if not any(lies_on(peak, line, resolution, margin=4.0) for line in lines)
            and not any(hides(line, peak) for line in lines)
        ]
    ).reshape(-1, 3)
