"""Ideal points in free space: estimator and simulator against closed form, in 2-D and 3-D.

Run as ``python -m validation.experiments.simulator_on_points [FILE.png]``; some seconds.

Not a figure of the thesis, but the basis of all of its equations. The closed form
(:mod:`validation.analytic.point_scatterer`) shares no code with either: the radar equation for the
echo, Friis' equation for the uplink, and a Hankel function for that of a line source.

Chosen: the points of ``point_scatterers`` (0.5 to 0.9 m away, up to 13° off broadside), a line of
260 positions, cylindrical and spherical waves; and in space a plane of 32 × 32 positions 1 mm
apart, 220-295 GHz in 201 points, with points 0.3 to 0.36 m away. Each point alone, with a phase of
its own: side lobes of one would move the others' peaks.

Claims that are asserted: an image peaks within 0.05 of a resolution cell of each point; its -3 dB
widths are theory's within 5 %; its phase there is the point's within 5°, and its level within 0.2
dB; the simulated echoes and uplinks of all points together are the closed form's up to double
precision.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Complex, Float
from matplotlib.figure import Figure
from scipy.constants import speed_of_light
from scipy.special import hankel2

from estimator.array.resolution import HALF_POWER, cell_at, range_resolution
from estimator.imaging.backprojection import backproject
from estimator.measurement.model import Waves
from scenes.files.loading import load_scenario
from simulator.simulation import simulate
from validation.analytic.point_scatterer import point_echo, point_uplink
from validation.harness.claim import Row
from validation.harness.row_table import conclude_with_figure
from validation.metrics.point_response import peak_cut

CELLS_OFF = 0.05
"""Largest distance of a peak from its point, over the range cell: at 20 dB SNR of the focused
point, the Cramér-Rao bound √12/(2π√(2·SNR)) is 0.04 of a cell. [-]"""
WIDTHS_WITHIN = 0.05
"""Largest relative error of -3 dB widths: the formulas are for a narrow band, this one is 29 %.
[-]"""
PHASE_DEG = 5.0
"""Largest error of phase: that of one sample at 20 dB is 1/√(2·SNR), 4°. [°]"""
LEVEL_DB = 0.2
"""Largest error of level: a third of that of one sample at 20 dB SNR. [dB]"""
SIMULATOR_WITHIN = 1e-9
"""Largest error of a simulated channel over the largest sample: double precision (1e-16) of phases
of 2e3 cycles, with a margin for their summation. [-]"""
LINE = (
    np.array([0.0, 0.5, 0.0]),
    np.array([0.15, 0.7, 0.0]),
    np.array([-0.2, 0.9, 0.0]),
)
"""The points of point_scatterers. [m]"""
SPACE = (
    np.array([0.0, 0.3, 0.0]),
    np.array([0.04, 0.33, -0.03]),
    np.array([-0.05, 0.36, 0.02]),
)
USER = np.array([0.25, 0.4, 0.0])
FREQUENCIES = np.linspace(220e9, 295e9, 1001)
FEW_FREQUENCIES = np.linspace(220e9, 295e9, 201)
_SAMPLES = np.linspace(-2.5, 2.5, 501)  # of a cut, over the width


@dataclass(frozen=True, kw_only=True)
class PointImage:
    """The image of one ideal point."""

    case: str
    place: Float[np.ndarray, " 3"]  # [m]
    cells_off: float  # largest over the axes, relative to the -3 dB cell [-]
    width_errors: tuple[float, ...]  # relative to theory, range first [-]
    phase_error: float  # at the point [rad]
    level_error_db: float  # at the point, over the amplitude there [dB]
    cuts: Float[np.ndarray, "axes samples"]  # magnitude over the peak's, along range first [-]


@dataclass(frozen=True, kw_only=True)
class ChannelError:
    """Error of a simulated channel against its closed form."""

    case: str
    error: float  # largest, over the largest sample [-]
    within: float = SIMULATOR_WITHIN  # limit [-]
    origin: str = "double precision of 2e3 turns"  # of the limit


@dataclass(frozen=True, kw_only=True)
class PointResults:
    """All points and channels."""

    images: tuple[PointImage, ...]
    channels: tuple[ChannelError, ...]


def measure() -> PointResults:
    """Image points in closed form, and simulate them."""
    waves: tuple[Waves, ...] = ("cylindrical", "spherical")
    line, plane = _line(), _plane()
    images = [
        _image(f"line, {wave}", point, line, FREQUENCIES, wave, phase)
        for wave in waves
        for point, phase in zip(LINE, (0.3, -1.9, 2.6), strict=True)
    ]
    images += [
        _image("plane, spherical", point, plane, FEW_FREQUENCIES, "spherical", phase)
        for point, phase in zip(SPACE, (0.3, -1.9, 2.6), strict=True)
    ]
    channels = [*_simulated_line(), _cylindrical_uplink(), *_simulated_space()]
    return PointResults(images=tuple(images), channels=tuple(channels))


def _line(elements: int = 260) -> Float[np.ndarray, "elements 3"]:
    positions = np.zeros((elements, 3))
    positions[:, 0] = (np.arange(elements) - (elements - 1) / 2) * 0.5e-3
    return positions


def _plane(side: int = 32) -> Float[np.ndarray, "elements 3"]:
    places = (np.arange(side) - (side - 1) / 2) * 1e-3
    x, z = np.meshgrid(places, places, indexing="ij")
    return np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=-1)


def _image(
    case: str,
    point: Float[np.ndarray, " 3"],
    positions: Float[np.ndarray, "positions 3"],
    frequencies: Float[np.ndarray, " freqs"],
    waves: Waves,
    phase: float,
) -> PointImage:
    """Image a point along its range and across that, and compare."""
    echo = point_echo(
        point[None],
        positions=positions,
        frequencies=frequencies,
        radar_cross_section=np.array([1e-4]),
        phase=np.array([phase]),
        waves=waves,
    )
    distance = float(np.linalg.norm(point))
    along = point / distance
    directions = [along]
    widths = [range_resolution(float(np.ptp(frequencies)))]
    if np.ptp(positions[:, 2]) > 0:
        for axis in (0, 2):  # the aperture's own axes, less their part along the range
            across = np.eye(3)[axis] - along[axis] * along
            directions.append(across / np.linalg.norm(across))
            # The range of the aperture's directions along that axis.
            ends = np.unique(positions[:, axis])
            rays = point - np.outer(ends, np.eye(3)[axis])
            rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
            spread = float(np.ptp(rays @ directions[-1])) * ends.size / (ends.size - 1)
            wavelength = 2 * speed_of_light / float(frequencies[0] + frequencies[-1])
            widths.append(HALF_POWER * wavelength / (2 * spread))
    else:
        directions.append(np.array([along[1], -along[0], 0.0]))
        cell = cell_at(point, positions=positions, frequencies=frequencies)
        widths.append(cell.across)
    points = np.stack(
        [
            point + np.outer(_SAMPLES * width, direction)
            for direction, width in zip(directions, widths, strict=True)
        ]
    )
    cuts = np.abs(backproject(echo, points))
    peaks = [peak_cut(_SAMPLES * width, cut) for cut, width in zip(cuts, widths, strict=True)]
    value = complex(backproject(echo, point[None])[0])
    # The mean over aperture and band of the closed form's amplitude, which varies over both.
    amplitude = float(np.mean(np.abs(echo.samples)))
    return PointImage(
        case=case,
        place=point,
        cells_off=max(abs(peak.place) / width for peak, width in zip(peaks, widths, strict=True)),
        width_errors=tuple(
            peak.width / width - 1 for peak, width in zip(peaks, widths, strict=True)
        ),
        phase_error=float(np.angle(value * np.exp(-1j * phase))),
        level_error_db=float(20 * np.log10(abs(value) / amplitude)),
        cuts=cuts / cuts.max(axis=1, keepdims=True),
    )


def _simulated_line() -> list[ChannelError]:
    """Simulate echo and uplink of a line of positions."""
    overrides = ("radio.points=101", f"users.user.position_m={USER[:2].tolist()}")
    return _simulated("line, spherical", overrides, LINE)


def _cylindrical_uplink() -> ChannelError:
    """Simulate the uplink of a line source, whose exact field is a Hankel function.

    For cylindrical waves a point has no radar cross-section, so there is no echo to compare.
    """
    overrides = ("waves=cylindrical", "radio.points=21", "noise.snr_db=inf")
    scenario = load_scenario("near_field_user", overrides)
    place = scenario.users["isotropic_70"].position
    away = np.linalg.norm(scenario.base_station.element_positions - place, axis=1)
    wavenumber = 2 * np.pi * scenario.radio.frequencies / speed_of_light
    exact = -0.25j * hankel2(0, np.outer(away, wavenumber))
    uplinks = simulate(scenario, seed=0).measurement.uplinks
    (ours,) = (uplink.samples for uplink in uplinks if uplink.user == "isotropic_70")
    return ChannelError(
        case="uplink, line, cylindrical",
        error=_error(ours, exact),
        within=1.1 / (8 * float(wavenumber[0] * away.min())),
        origin="1/(8kR), the next term of the far form that is simulated",
    )


def _simulated_space() -> list[ChannelError]:
    """Simulate echo and uplink of a plane of positions."""
    overrides = [
        "dimensions=3",
        "radio.points=21",
        "base_station.elements=[16, 16]",
        "base_station.spacing_mm=1.0",
        f"users.user.position_m={USER.tolist()}",
    ]
    names = ("near", "right", "left")
    overrides += [
        f"points.{name}.position_m={place.tolist()}"
        for name, place in zip(names, SPACE, strict=True)
    ]
    return _simulated("plane, spherical", overrides, SPACE)


def _simulated(
    case: str,
    overrides: Sequence[str],
    points: Sequence[Float[np.ndarray, " 3"]],
) -> list[ChannelError]:
    scenario = load_scenario("point_scatterers", overrides)
    measurement = simulate(scenario, seed=0).measurement
    positions, frequencies = scenario.base_station.element_positions, scenario.radio.frequencies
    targets, sections = np.stack(points), np.full(len(points), 1e-4)
    echo = point_echo(
        targets,
        positions=positions,
        frequencies=frequencies,
        radar_cross_section=sections,
    )
    # A pilot arrives directly, and over each point as a bistatic echo of the user.
    over_points = point_echo(
        targets,
        positions=positions,
        frequencies=frequencies,
        radar_cross_section=sections,
        transmit_positions=np.tile(USER, (len(positions), 1)),
    )
    direct = point_uplink(USER[None], positions=positions, frequencies=frequencies)
    if measurement.echo is None:
        raise RuntimeError("point_scatterers has no echo")
    pairs = (
        ("echo", measurement.echo.samples, echo.samples),
        ("uplink", measurement.uplinks[0].samples, direct.samples + over_points.samples),
    )
    return [
        ChannelError(case=f"{name}, {case}", error=_error(ours, theirs))
        for name, ours, theirs in pairs
    ]


def _error(ours: Complex[np.ndarray, "*n"], theirs: Complex[np.ndarray, "*n"]) -> float:
    return float(np.max(np.abs(ours - theirs)) / np.max(np.abs(theirs)))


def rows(results: PointResults) -> tuple[Row, ...]:
    """Return the largest errors of all points, with their limits."""
    table: list[Row] = []
    for case in dict.fromkeys(image.case for image in results.images):
        images = [image for image in results.images if image.case == case]
        points = f"worst of {len(images)} points, {case} waves"
        table += [
            Row(
                name=f"peak off the point, over the cell, {points}",
                stated="closed form: at the point",
                measured=max(image.cells_off for image in images),
                high=CELLS_OFF,
                origin="noise at 20 dB after focusing moves a peak by 0.04 cells (Cramér-Rao)",
            ),
            Row(
                name=f"-3 dB widths, {points}",
                stated="theory: 0.886 c/2B and 0.886 λ/2|Δu|",
                measured=100
                * max((error for image in images for error in image.width_errors), key=abs),
                unit="%",
                low=-100 * WIDTHS_WITHIN,
                high=100 * WIDTHS_WITHIN,
                origin="narrow-band formulas on a band of 29 %",
            ),
            Row(
                name=f"phase at the point, {points}",
                stated="closed form: the point's",
                measured=float(np.degrees(max(abs(image.phase_error) for image in images))),
                unit="°",
                high=PHASE_DEG,
                origin="noise turns one sample at 20 dB by 4°",
            ),
            Row(
                name=f"level at the point, {points}",
                stated="closed form: the mean amplitude of its echo",
                measured=max((image.level_error_db for image in images), key=abs),
                unit="dB",
                low=-LEVEL_DB,
                high=LEVEL_DB,
                origin="noise changes one sample at 20 dB by 0.6 dB, three times as much",
            ),
        ]
    table += [
        Row(
            name=f"simulated {channel.case} waves",
            stated="closed form: radar equation, Friis, line source",
            measured=channel.error,
            high=channel.within,
            origin=channel.origin,
        )
        for channel in results.channels
    ]
    return tuple(table)


def draw(figure: Figure, results: PointResults) -> None:
    """Draw the cuts of all points over their cells, with the theoretical ones."""
    axes = figure.subplots(1, 2, sharey=True)
    theory = np.abs(np.sinc(HALF_POWER * _SAMPLES))
    for ax, chosen, title in (
        (axes[0], slice(0, 1), "along range"),
        (axes[1], slice(1, None), "across range"),
    ):
        for image in results.images:
            colour = {"l": "#30638e", "p": "#e09f1f"}[image.case[0]]
            for cut in image.cuts[chosen]:
                ax.plot(_SAMPLES, _decibels(cut), color=colour, lw=0.8, alpha=0.6)
        ax.plot(_SAMPLES, _decibels(theory), ":", color="black", lw=1.2)
        ax.axhline(-3, color="0.7", lw=0.7, zorder=0)
        ax.set(xlabel="from the point, over the -3 dB cell [-]", ylim=(-40, 2), title=title)
    axes[0].set_ylabel("magnitude relative to the peak [dB]")
    axes[1].plot([], [], color="#30638e", label="line of 260 positions")
    axes[1].plot([], [], color="#e09f1f", label="plane of 32 × 32 positions")
    axes[1].plot([], [], ":", color="black", label="theory: sin(πx)/(πx)")
    axes[1].legend(fontsize=8, loc="upper right")


def _decibels(magnitude: Float[np.ndarray, " samples"]) -> Float[np.ndarray, " samples"]:
    return np.asarray(20 * np.log10(np.maximum(magnitude, 1e-6)))


def main(arguments: list[str]) -> None:
    """Measure, draw, print the figures and check them."""
    path = Path(arguments[0] if arguments else "simulator_on_points.png")
    results = measure()
    conclude_with_figure(path, (10, 4.4), lambda figure: draw(figure, results), rows(results))


if __name__ == "__main__":
    main(sys.argv[1:])
