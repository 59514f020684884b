"""Numbers of the thesis' design equations, by theory and measured on ideal points.

Theory is that of :mod:`estimator.array.resolution` and :mod:`estimator.array.field_regions`.
Numbers are measured on the response of imaging and matched filter to one ideal point, in closed
form, or on the phases of that closed form.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.array.field_regions import far_field_distance, fresnel_distance
from estimator.array.resolution import (
    HALF_POWER,
    angular_resolution,
    cross_range_resolution,
    phase_per_frequency_step,
    range_resolution,
    unambiguous_range,
)
from estimator.channel.steering import angle_spectrum
from estimator.imaging.backprojection import backproject, focus_uplink
from validation.analytic.point_scatterer import point_echo, point_uplink
from validation.metrics.point_response import PeakCut, peak_cut

ELEMENTS, SPACING = 260, 0.5e-3
LENGTH = ELEMENTS * SPACING
"""Length of the array: each element represents one spacing. [m]"""
SIMULATION = np.linspace(220e9, 295e9, 1001)
LABORATORY = np.linspace(220e9, 329.98e9, 2750)
"""Every other point of the laboratory's 5500: unambiguous to 3.7 m, with lobes of equal width.
[Hz]"""
NEAR, FAR = 1.8, 2.8
WIDTHS_WITHIN = 0.05
"""Largest relative error of -3 dB widths: the formulas are for a narrow band and a small aperture.
Here the band is up to 40 % wide, which narrows the lobe by some per cent. [-]"""
PHASES_WITHIN = 0.02
"""Largest relative error of phases at the field regions' bounds: the next order, (D/2R)². [-]"""
EXACT = 1e-3
"""Largest relative error of quantities read from a grid of a thousandth of their value. [-]"""


@dataclass(frozen=True, kw_only=True)
class Number:
    """One number of the thesis."""

    name: str
    equation: str
    unit: str
    theory: float
    measured: float
    within: float  # largest relative difference of the two [-]
    origin: str  # of that
    thesis: float | None = None  # value in the thesis; None: not stated
    remark: str = ""


@dataclass(frozen=True, kw_only=True)
class Cut:
    """The response to one point, along a line across or along range, or over sin φ."""

    name: str
    coordinate: Float[np.ndarray, " samples"]  # [m] or [-]
    magnitude: Float[np.ndarray, " samples"]  # over the peak's [-]
    peak: PeakCut
    theory: float  # -3 dB width, in the coordinate's unit
    thesis: float | None = None  # width in the thesis


@dataclass(frozen=True, kw_only=True)
class DesignNumbers:
    """All numbers, and the cuts on which widths were measured."""

    numbers: tuple[Number, ...]
    across: tuple[Cut, ...]  # at 1.8 m and 2.8 m, echo and uplink
    along: tuple[Cut, ...]  # range cells
    lobes: Cut  # over sin φ, with its repetition


def measured_numbers() -> DesignNumbers:
    """Measure every number."""
    across = tuple(
        _across(distance, frequencies, passes, thesis)
        for distance, frequencies, thesis in (
            (NEAR, SIMULATION, 11e-3),
            (FAR, LABORATORY, 26e-3),
        )
        for passes in (1, 2)
    )
    along = (
        _along(NEAR, SIMULATION, passes=2),
        _along(NEAR, SIMULATION, passes=1),
        _along(FAR, LABORATORY, passes=2),
    )
    lobes = _lobes()
    numbers = (
        *(
            Number(
                name=f"-3 dB cross-range width, {cut.name}",
                equation="(2-15)-(2-28)",
                unit="mm",
                theory=1e3 * cut.theory,
                thesis=None if cut.thesis is None else 1e3 * cut.thesis,
                measured=1e3 * cut.peak.width,
                within=WIDTHS_WITHIN,
                origin="narrow-band formula on a wide band",
            )
            for cut in across
        ),
        *(
            Number(
                name=f"-3 dB range width, {cut.name}",
                equation="(2-15)-(2-28)",
                unit="mm",
                theory=1e3 * cut.theory,
                measured=1e3 * cut.peak.width,
                within=WIDTHS_WITHIN,
                origin="formula of a narrow aperture",
            )
            for cut in along
        ),
        Number(
            name="range, from peak to first zero, 220-329.98 GHz",
            equation="(2-15)-(2-28)",
            unit="mm",
            theory=1e3 * speed_of_light / (2 * float(np.ptp(LABORATORY))),
            thesis=1.5,
            measured=1e3 * _first_zero(along[2]),
            within=WIDTHS_WITHIN,
            origin="formula of a narrow aperture",
            remark="the thesis counts 100 GHz",
        ),
        _beam_width(),
        _grating_lobes(lobes),
        *_repetitions(),
        _phase_step(),
        *_field_regions(),
    )
    return DesignNumbers(numbers=numbers, across=across, along=along, lobes=lobes)


def _aperture() -> Float[np.ndarray, "elements 3"]:
    positions = np.zeros((ELEMENTS, 3))
    positions[:, 0] = (np.arange(ELEMENTS) - (ELEMENTS - 1) / 2) * SPACING
    return positions


def _response(
    place: Float[np.ndarray, " 3"],
    points: Float[np.ndarray, "samples 3"],
    frequencies: Float[np.ndarray, " freqs"],
    passes: int,
) -> Float[np.ndarray, " samples"]:
    """Image one point (two passes), or match its pilot (one), at other points."""
    if passes == 2:
        echo = point_echo(
            place[None],
            positions=_aperture(),
            frequencies=frequencies,
            radar_cross_section=np.ones(1),
        )
        return np.asarray(np.abs(backproject(echo, points)))
    uplink = point_uplink(place[None], positions=_aperture(), frequencies=frequencies)
    return np.asarray(np.abs(focus_uplink(uplink, points)))


def _cut(
    name: str,
    direction: int,
    distance: float,
    frequencies: Float[np.ndarray, " freqs"],
    passes: int,
    theory: float,
    thesis: float | None = None,
) -> Cut:
    place = np.array([0.0, distance, 0.0])
    coordinate = np.linspace(-3, 3, 601) * theory
    points = np.tile(place, (coordinate.size, 1))
    points[:, direction] += coordinate
    magnitude = _response(place, points, frequencies, passes)
    return Cut(
        name=name,
        coordinate=coordinate,
        magnitude=magnitude / magnitude.max(),
        peak=peak_cut(coordinate, magnitude),
        theory=theory,
        thesis=thesis,
    )


def _across(
    distance: float, frequencies: Float[np.ndarray, " freqs"], passes: int, thesis: float
) -> Cut:
    theory = cross_range_resolution(
        wavelength=2 * speed_of_light / float(frequencies[0] + frequencies[-1]),
        distance=distance,
        aperture_length=LENGTH,
        passes=passes,
    )
    name = f"{'echo' if passes == 2 else 'uplink'} at {distance:g} m"
    return _cut(name, 0, distance, frequencies, passes, theory, thesis)


def _along(distance: float, frequencies: Float[np.ndarray, " freqs"], *, passes: int) -> Cut:
    band = f"{frequencies[0] / 1e9:g}-{frequencies[-1] / 1e9:g} GHz"
    name = f"{'echo' if passes == 2 else 'uplink path'}, {band}"
    theory = range_resolution(float(np.ptp(frequencies)), passes=passes)
    return _cut(name, 1, distance, frequencies, passes, theory)


def _first_zero(cut: Cut) -> float:
    """Return the distance of the first minimum beside the main lobe from its peak."""
    beyond = cut.coordinate > cut.peak.place + cut.peak.width / 2
    values, places = cut.magnitude[beyond], cut.coordinate[beyond]
    turn = int(np.flatnonzero(np.diff(values) > 0)[0])
    return float(places[turn] - cut.peak.place)


def _beam_width() -> Number:
    """Width of the spectrum of angles at one frequency."""
    frequency = float(SIMULATION[0])
    uplink = point_uplink(
        np.array([[0.0, NEAR, 0.0]]), positions=_aperture(), frequencies=np.array([frequency])
    )
    theory = angular_resolution(wavelength=speed_of_light / frequency, aperture_length=LENGTH)
    angles = np.pi / 2 + np.linspace(-2, 2, 801) * theory
    spectrum = np.abs(angle_spectrum(uplink, angles, frequency=frequency, distance=NEAR))
    return Number(
        name="-3 dB beam width at 220 GHz, uplink",
        equation="(2-15)-(2-28)",
        unit="°",
        theory=float(np.degrees(theory)),
        measured=float(np.degrees(peak_cut(angles, spectrum).width)),
        within=PHASES_WITHIN,
        origin="small-angle formula",
    )


def _lobes() -> Cut:
    """Correlate the echo of a distant point, at one frequency, with plane waves over sin φ."""
    frequency, distance = float(SIMULATION[-1]), 1e3
    sine = np.linspace(-1, 1, 5001)[1:-1]
    place = np.array([0.3, np.sqrt(1 - 0.3**2), 0.0]) * distance
    echo = point_echo(
        place[None],
        positions=_aperture(),
        frequencies=np.array([frequency]),
        radar_cross_section=np.ones(1),
    )
    turns = -2 * np.outer(sine, echo.positions[:, 0]) * frequency / speed_of_light
    magnitude = np.abs(np.exp(2j * np.pi * turns) @ echo.samples[:, 0])
    near = np.abs(sine - 0.3) < 0.05
    theory = HALF_POWER * speed_of_light / frequency / (2 * LENGTH)
    return Cut(
        name="echo of a point at sin φ = 0.3, 295 GHz",
        coordinate=sine,
        magnitude=magnitude / magnitude.max(),
        peak=peak_cut(sine[near], magnitude[near]),
        theory=theory,
    )


def _grating_lobes(lobes: Cut) -> Number:
    """Distance in sin φ from a point to its repetition."""
    other = lobes.coordinate < lobes.peak.place - 0.5
    repeated = peak_cut(lobes.coordinate[other], lobes.magnitude[other]).place
    wavelength = speed_of_light / float(SIMULATION[-1])
    return Number(
        name="sin φ up to which 0.5 mm are unambiguous at 295 GHz, echo",
        equation="(2-22)",
        unit="",
        theory=wavelength / (4 * SPACING),
        measured=float(lobes.peak.place - repeated) / 2,
        within=EXACT,
        origin="grid of the spectrum",
        remark="the thesis asks λ/4, 0.25 mm, always",
    )


def _repetitions() -> tuple[Number, ...]:
    """Distance in range from a point to its repetition in a stepped-frequency profile."""
    numbers = []
    for step, thesis, equation in (
        (75e6, 1.0, "(2-15)-(2-28)"),
        (20e6, 3.75, "(2-15)-(2-28)"),
        (100e6, 1.5, "section 2.4.3"),
    ):
        frequencies = 220e9 + step * np.arange(201)
        theory = unambiguous_range(step)
        echo = point_echo(
            np.array([[0.0, 0.3 * theory, 0.0]]),
            positions=np.zeros((1, 3)),
            frequencies=frequencies,
            radar_cross_section=np.ones(1),
        )
        ranges = np.linspace(0.1, 1.5, 1401) * theory
        turns = 2 * np.outer(ranges, frequencies) / speed_of_light
        profile = np.abs(np.exp(2j * np.pi * turns) @ echo.samples[0])
        first = ranges < 0.8 * theory
        places = [peak_cut(ranges[part], profile[part]).place for part in (first, ~first)]
        numbers.append(
            Number(
                name=f"range after which an echo repeats, steps of {step / 1e6:g} MHz",
                equation=equation,
                unit="m",
                theory=theory,
                thesis=thesis,
                measured=places[1] - places[0],
                within=EXACT,
                origin="grid of the profile",
                remark=""
                if abs(thesis / theory - 1) < 0.01
                else "c/(4Δf) is the rule for real samples",
            )
        )
    return tuple(numbers)


def _phase_step() -> Number:
    echo = point_echo(
        np.array([[0.0, NEAR, 0.0]]),
        positions=np.zeros((1, 3)),
        frequencies=SIMULATION[:2],
        radar_cross_section=np.ones(1),
    )
    turned = np.angle(echo.samples[0, 0] * echo.samples[0, 1].conj()) % (2 * np.pi)
    return Number(
        name="phase of an echo from 1.8 m for each step of 75 MHz",
        equation="(2-24)",
        unit="rad",
        theory=phase_per_frequency_step(NEAR, float(SIMULATION[1] - SIMULATION[0])),
        measured=float(turned),
        within=1e-9,
        origin="double precision",
        remark="4πRΔf/c; printed as 4πR/Δλ",
    )


def _field_regions() -> tuple[Number, ...]:
    """Measure the wavefront's phase at the aperture's ends, at the bounds (3-1) and (3-3)."""
    frequency = float(SIMULATION[0])
    wavelength = speed_of_light / frequency
    far, fresnel = far_field_distance(LENGTH, wavelength), fresnel_distance(LENGTH, wavelength)
    steepest = np.arctan(np.sqrt(2))  # angle of the largest cubic term: 54.7° off broadside
    bends = {
        distance: _end_phases(np.array([0.0, distance, 0.0]), frequency) for distance in (far, 20.0)
    }
    place = fresnel * np.array([np.cos(steepest), np.sin(steepest), 0.0])
    left, right = _end_phases(place, frequency)
    linear = 2 * np.pi * LENGTH / 2 * np.cos(steepest) / wavelength
    cubic = abs((left - right) / 2) - linear
    return (
        Number(
            name="wavefront's bend at the ends of 13 cm at 2D²/λ = 24.8 m, 220 GHz",
            equation="(3-3)",
            unit="°",
            theory=22.5,
            measured=float(np.degrees(np.mean(bends[far]))),
            within=PHASES_WITHIN,
            origin="next order of the wavefront",
            remark="far field beyond it; printed as R < 2D²/λ",
        ),
        Number(
            name="wavefront's bend at 20 m, the thesis' far field",
            equation="(3-3)",
            unit="°",
            theory=22.5 * far / 20.0,
            measured=float(np.degrees(np.mean(bends[20.0]))),
            within=PHASES_WITHIN,
            origin="next order of the wavefront",
            remark="more than 22.5°: still radiating near field",
        ),
        Number(
            name=f"wavefront's cubic part at 0.62 √(D³/λ) = {fresnel:.3f} m, where it is largest",
            equation="(3-1)",
            unit="°",
            theory=22.5,
            measured=float(np.degrees(abs(cubic))),
            within=PHASES_WITHIN,
            origin="next odd order of the wavefront, (D/2R)², and 0.62 for 0.6204",
            remark="a bound on the phase; nothing is reactive there",
        ),
    )


def _end_phases(place: Float[np.ndarray, " 3"], frequency: float) -> tuple[float, float]:
    """Return the phase lags of the aperture's two ends behind its middle. [rad]."""
    positions = np.zeros((3, 3))
    positions[:, 0] = np.array([-0.5, 0.0, 0.5]) * LENGTH
    lags = []
    for share in (0, 2):
        # From element to element the phase changes by less than half a cycle: it can be unwrapped.
        steps = np.linspace(positions[1], positions[share], 1001)
        samples = point_uplink(place[None], positions=steps, frequencies=np.array([frequency]))
        lags.append(-float(np.unwrap(np.angle(samples.samples[:, 0]))[[0, -1]] @ [-1, 1]))
    return lags[0], lags[1]
