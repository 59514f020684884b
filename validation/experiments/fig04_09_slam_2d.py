"""Thesis figures 4.9 to 4.12: locating a user over one wall, in two dimensions.

Run as ``python -m validation.experiments.fig04_09_slam_2d [FILE.png [SEEDS]]``; ten seconds of one
core for each of ten seeds.

4.9 is the angle of arrival at one frequency, 4.10 the image, 4.11 the angle/range map, 4.12 the
localization. The scenario is ``slam_2d``. What the thesis leaves open, and what was chosen (more of
it in the scenario's header): the wall's length (0.40 m) and roughness (0.05 mm rms, correlation
length 0.3 mm: bright in the image, and it hardly bends the reflected wave); the width of the user's
beam (0.1 rad); noise (20 dB per channel sample; the thesis' solver has none); the frequency of 4.9
(220 GHz, the band's first, as in its figures 4.3 to 4.7); which width a resolution is (-3 dB). The
thesis marks the mirror by hand and shows one case; here the mirror is found, over ten realisations.

Corrections: the cross-range of 11 mm at 1.8 m should be 0.886 λR/D = 14.3 mm; (3-8) needs a minus
before 2dR cos θ, and (3-4) to (3-10) the other sign of the phase.

Claims that are asserted: the angle at one frequency; the map's -3 dB widths are theory's; the
mirror; the user is found in every realisation, with a median error below 0.4 mm, the worst below 1
mm.
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure
from scipy.constants import speed_of_light

from estimator.array.resolution import angular_resolution
from estimator.channel.steering import angle_spectrum
from estimator.measurement.model import Uplink
from scenes.files.loading import load_scenario
from validation.figures import figures_2d, views
from validation.figures.resolution_bars import draw_resolution_bars
from validation.harness.claim import Row, Tell
from validation.harness.row_table import conclude_with_figure
from validation.metrics.point_response import PeakCut, peak_cut
from validation.trials.hidden_user import (
    WIDTHS_WITHIN,
    UserTrial,
    draw_errors,
    draw_map,
    draw_plan,
    hidden_user,
    user_rows,
    wall_rows,
)

SEEDS, QUICK_SEEDS = 10, 3
MEDIAN, WORST = 0.4e-3, 1.0e-3
HALF_SIZE = (
    "base_station.elements=130",
    "radio.points=501",
    "objects.wall.centre_m=[0.0, 0.4]",
    "objects.wall.length_m=0.2",
    "users.user.position_m=[0.5, 0.4]",
)
"""Overrides that halve all lengths, also the array's: the same resolution cells at a quarter of the
work."""
ANGLE_LIMIT = np.radians(0.03)
"""Largest error of the angle at one frequency: the error by roughness of 0.44 mm (the worst of 40
realisations over the whole band) is 0.014° at 1.8 m, and at one frequency it is not averaged over
the band. [rad]"""
WALL_ANGLE, WALL_OFFSET = WORST / 2 / 1.0, WORST / 2
"""Largest errors of the wall: that of the angle alone would cause the worst position error, twice
the angle times 1 m behind it; that of the offset half of it, as it moves the user by √2 as much.
[rad], [m]"""


@dataclass(frozen=True, kw_only=True)
class OneFrequency:
    """The spectrum of angles at one frequency, with the spherical and the plane model."""

    frequency: float  # [Hz]
    angles: Float[np.ndarray, " angles"]  # [rad]
    spherical: Float[np.ndarray, " angles"]  # over its peak [-]
    plane: Float[np.ndarray, " angles"]  # over the spherical model's peak [-]
    peak: PeakCut  # [rad]
    theory: float  # -3 dB width [rad]


@dataclass(frozen=True, kw_only=True)
class Slam2d:
    """All realisations; the first with what its figures show."""

    trials: tuple[UserTrial, ...]
    spectra: tuple[OneFrequency, ...]  # one for each realisation

    @property
    def angle_error(self) -> float:
        """Worst error of the angle at one frequency. [rad]."""
        pairs = zip(self.spectra, self.trials, strict=True)
        return max(abs(one.peak.place - trial.true_aoa) for one, trial in pairs)


def measure(
    *, seed: int = 0, seeds: int | None = None, quick: bool = False, tell: Tell | None = None
) -> Slam2d:
    """Simulate and locate several realisations; the quick form is of half the size.

    Parameters
    ----------
    seed
        First seed.
    seeds
        Number of seeds; ``None``: ten, or three in the quick form.
    quick
        Whether all lengths are halved.
    tell
        Called after each realisation.
    """
    count = seeds if seeds is not None else QUICK_SEEDS if quick else SEEDS
    scenario = load_scenario("slam_2d", HALF_SIZE if quick else ())
    trials: list[UserTrial] = []
    spectra: list[OneFrequency] = []
    for index in range(count):
        trial = hidden_user(scenario, seed=seed + index, walls=("wall",))
        if trial.seen is not None:
            (uplink,) = trial.seen.measurement.uplinks
            spectra.append(spectrum_at_one_frequency(uplink, trial))
        trials.append(replace(trial, seen=trial.seen if index == 0 else None))
        if tell is not None:
            tell(index + 1, count)
    return Slam2d(trials=tuple(trials), spectra=tuple(spectra))


def spectrum_at_one_frequency(uplink: Uplink, trial: UserTrial) -> OneFrequency:
    """Match the pilot at the band's first frequency, at the path length of the map's peak."""
    frequency = float(uplink.frequencies[0])
    elements = len(uplink.positions)
    theory = angular_resolution(
        wavelength=speed_of_light / frequency,
        aperture_length=float(np.ptp(uplink.positions[:, 0])) * elements / (elements - 1),
        angle=np.pi / 2 - trial.cuts.angle.place,
    )
    angles = trial.cuts.angle.place + np.linspace(-8, 8, 3201) * theory
    spherical, plane = (
        np.abs(angle_spectrum(uplink, angles, frequency=frequency, distance=distance))
        for distance in (trial.cuts.length.place, None)
    )
    top = float(spherical.max())
    return OneFrequency(
        frequency=frequency,
        angles=angles,
        spherical=spherical / top,
        plane=plane / top,
        peak=peak_cut(angles, spherical),
        theory=theory,
    )


def rows(result: Slam2d) -> tuple[Row, ...]:
    """Return the figures with their limits."""
    first = result.spectra[0]
    width = float(np.degrees(first.theory))
    widths = [float(np.degrees(one.peak.width)) for one in result.spectra]
    count = f"worst of {len(result.trials)}"
    return (
        Row(
            name=f"angle of arrival at {first.frequency / 1e9:g} GHz alone, off the truth, {count}",
            stated="thesis: 90° on a grid of 0.18°",
            measured=float(np.degrees(result.angle_error)),
            unit="°",
            high=float(np.degrees(ANGLE_LIMIT)),
            origin="twice the roughness' floor, 0.44 mm at 1.8 m",
        ),
        Row(
            name=f"-3 dB width of the angle's peak at {first.frequency / 1e9:g} GHz",
            stated=f"theory 0.886 λ/D: {width:.3f}°",
            measured=max(widths, key=lambda value: abs(value - width)),
            unit="°",
            low=width * (1 - WIDTHS_WITHIN),
            high=width * (1 + WIDTHS_WITHIN),
            origin="theory ± 5 %: an unbent wave",
        ),
        *wall_rows(
            result.trials,
            0,
            angle=WALL_ANGLE,
            offset=WALL_OFFSET,
            origin="what alone would use up the worst error of the user, 1 m behind it",
        ),
        *user_rows(
            result.trials,
            median=MEDIAN,
            worst=WORST,
            thesis="thesis: < 1 mm, one case",
            across="thesis: 11 mm",
        ),
    )


def draw(figure: Figure, result: Slam2d) -> None:
    """Draw 4.9 to 4.12 of the first realisation, and the errors of all."""
    trial, spectrum = result.trials[0], result.spectra[0]
    image = trial.seen.estimate.raw_image if trial.seen is not None else None
    if trial.seen is None or image is None:
        raise RuntimeError("the first realisation's images were not kept; nothing can be drawn")
    estimate, positions = trial.seen.estimate, trial.seen.measurement.uplinks[0].positions
    axes = figure.subplots(2, 3)
    ax = axes[0, 0]
    degrees = np.degrees(spectrum.angles)
    for values, line, label in (
        (spectrum.spherical, "-", "spherical (3-10), at the path's length"),
        (spectrum.plane, "--", "plane (3-19)"),
    ):
        ax.plot(degrees, 20 * np.log10(np.maximum(values, 1e-4)), line, label=label)
    ax.axvline(np.degrees(trial.true_aoa), color="0.6", lw=0.8, zorder=0)
    ax.set(
        title=f"4.9: at {spectrum.frequency / 1e9:g} GHz alone",
        xlabel="angle of arrival [°]",
        ylabel="level over the peak [dB]",
        xlim=(degrees[0], degrees[-1]),
        ylim=(-40, 8),
    )
    ax.legend(fontsize=8)
    bright = views.bright_points(image)
    # As wide as the plan below it, for comparison.
    shown = [views.estimate_points(estimate, positions), bright]
    view = views.view_around(np.concatenate(shown))
    figures_2d.draw_image(axes[0, 1], image, view=view)
    figures_2d.overlay_mirrors(axes[0, 1], estimate.mirrors, line=False)
    figures_2d.overlay_array(axes[0, 1], positions, colour=figures_2d.ON_DARK)
    echo = trial.seen.measurement.echo
    if echo is not None:
        wall = 0.5 * (estimate.mirrors[0].start + estimate.mirrors[0].end)
        draw_resolution_bars(axes[0, 1], view, wall, positions, echo.frequencies)
    axes[0, 1].set_title("4.10: image, and the mirror found")
    draw_map(axes[0, 2], trial)
    axes[0, 2].set_title(f"4.11: {axes[0, 2].get_title()}", fontsize=10)
    draw_plan(axes[1, 0], trial)
    error = "not found" if trial.error is None else f"{1e3 * trial.error:.3f} mm off"
    axes[1, 0].set_title(f"4.12: user {error}")
    ax = axes[1, 1]
    cuts = trial.cuts
    for offsets, values, width, label in (
        (cuts.angles - cuts.angle.place, cuts.over_angle, cuts.theory_angle, "over angle"),
        (cuts.lengths - cuts.length.place, cuts.over_length, cuts.theory_length, "over length"),
    ):
        ax.plot(offsets / width, 20 * np.log10(np.maximum(values, 1e-4)), label=label)
    shares = np.linspace(-3, 3, 601)
    ideal = np.maximum(np.abs(np.sinc(0.8859 * shares)), 1e-4)
    ax.plot(shares, 20 * np.log10(ideal), ":", color="black", label="sin(πx)/(πx)")
    ax.axhline(-3, color="0.7", lw=0.7, zorder=0)
    ax.set(
        title="cuts through the map's peak",
        xlabel="from the peak, over theory's -3 dB width [-]",
        ylabel="level over the peak [dB]",
        xlim=(-3, 3),
        ylim=(-40, 2),
    )
    ax.legend(fontsize=8)
    draw_errors(axes[1, 2], result.trials, limit=WORST)
    axes[1, 2].set_title(f"{len(result.trials)} realisations")


def main(arguments: list[str]) -> None:
    """Simulate, draw, print the figures and check them."""
    path = Path(arguments[0] if arguments else "fig04_09_slam_2d.png")
    seeds = int(arguments[1]) if len(arguments) > 1 else SEEDS
    result = measure(seeds=seeds, tell=lambda done, count: print(f"{done} of {count}", flush=True))
    conclude_with_figure(path, (16, 9.5), lambda figure: draw(figure, result), rows(result))


if __name__ == "__main__":
    main(sys.argv[1:])
