"""Localization of a user over walls only (NLoS): realisations compared with the truth."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from scipy.constants import speed_of_light

from estimator.array.resolution import angular_resolution, range_resolution
from estimator.channel.angle_range_map_2d import angle_range_map
from estimator.geometry.wall_2d import mirrored
from estimator.localization.pipeline import locate
from estimator.measurement.model import Measurement, Uplink
from estimator.results.estimate import Estimate, Mirror, UserEstimate
from scenes.scenario import Scenario
from simulator.simulation import simulate
from validation.figures import figures_2d, views
from validation.harness.claim import Row
from validation.metrics.errors import WallError, error_summary, nearest_wall, wall_error
from validation.metrics.point_response import PeakCut, peak_cut
from validation.metrics.truth import Truth, truth_from_dataset

WIDTHS_WITHIN = 0.05
"""Largest relative error of -3 dB widths: theory is for a narrow band and an untapered aperture,
and a rough wall distorts the wavefront slightly. [-]"""


@dataclass(frozen=True, kw_only=True)
class MapCuts:
    """The matched filter along angle and along path length, through its peak."""

    angles: Float[np.ndarray, " samples"]  # [rad]
    over_angle: Float[np.ndarray, " samples"]  # magnitude over the peak's [-]
    lengths: Float[np.ndarray, " samples"]  # [m]
    over_length: Float[np.ndarray, " samples"]  # magnitude over the peak's [-]
    angle: PeakCut  # [rad]
    length: PeakCut  # [m]
    theory_angle: float  # -3 dB width 0.886 λ/(D sin θ) [rad]
    theory_length: float  # -3 dB width 0.886 c/B [m]


@dataclass(frozen=True, kw_only=True)
class Seen:
    """Data of a realisation for the figures."""

    measurement: Measurement
    estimate: Estimate
    truth: Truth


@dataclass(frozen=True, kw_only=True)
class UserTrial:
    """One realisation compared with the truth."""

    seed: int
    status: str
    error: float | None  # of the user's position [m]
    true_aoa: float  # of its image in the walls [rad]
    true_length: float  # [m]
    aoa_error: float  # signed; NaN without a position [rad]
    length_error: float  # signed [m]
    walls: tuple[WallError | None, ...]  # of each wall of the path, unfolded; None: not found
    ghosts: tuple[WallError | None, ...]  # the same at their places in the raw image
    cuts: MapCuts
    seen: Seen | None

    @property
    def width_across(self) -> float:
        """Width of the map's peak across range at the path's length. [m]."""
        return self.cuts.angle.width * self.true_length

    @property
    def theory_across(self) -> float:
        """Theoretical width across range. [m]."""
        return self.cuts.theory_angle * self.true_length


def hidden_user(scenario: Scenario, *, seed: int, walls: Sequence[str]) -> UserTrial:
    """Simulate a scenario with one user, locate it, and compare.

    Parameters
    ----------
    scenario
        With the array centred at the origin, along +x.
    seed
        Of roughness and noise.
    walls
        Names of those of the user's path, from the array outward.
    """
    simulation = simulate(scenario, seed=seed)
    truth = truth_from_dataset(simulation.truth)
    return compare_user(simulation.measurement, truth, seed=seed, walls=walls)


def compare_user(
    measurement: Measurement, truth: Truth, *, seed: int, walls: Sequence[str]
) -> UserTrial:
    """Locate the one user of a measurement, and compare with the truth."""
    estimate = locate(measurement)
    (uplink,), (user,) = measurement.uplinks, estimate.users
    image = true_position = truth.user_position[user.name]
    for name in reversed(walls):
        image = mirrored(image, truth.wall_start[name], truth.wall_end[name])
    aoa, length = float(np.arctan2(image[1], image[0])), float(np.linalg.norm(image))
    found = user.aoa is not None and user.path_length is not None
    error = None
    if user.status == "found" and user.position is not None:
        error = float(np.linalg.norm(user.position - true_position))
    return UserTrial(
        seed=seed,
        status=user.status,
        error=error,
        true_aoa=aoa,
        true_length=length,
        aoa_error=user.aoa - aoa if user.aoa is not None else np.nan,
        length_error=user.path_length - length if user.path_length is not None else np.nan,
        walls=tuple(_wall(name, estimate, truth) for name in walls),
        ghosts=tuple(_ghost(index, walls, estimate, truth) for index in range(len(walls))),
        cuts=map_cuts(
            uplink,
            aoa=user.aoa if found and user.aoa is not None else aoa,
            path_length=user.path_length if found and user.path_length is not None else length,
        ),
        seen=Seen(measurement=measurement, estimate=estimate, truth=truth),
    )


def _mirror_on(name: str, estimate: Estimate, truth: Truth) -> Mirror | None:
    """Return the most confident mirror whose nearest true wall is the given one."""
    on_it = [one for one in estimate.mirrors if nearest_wall(one, truth) == name]
    return max(on_it, key=lambda one: one.confidence, default=None)


def _wall(name: str, estimate: Estimate, truth: Truth) -> WallError | None:
    mirror = _mirror_on(name, estimate, truth)
    if mirror is None:
        return None
    return wall_error(mirror, name, truth.wall_start[name], truth.wall_end[name])


def _ghost(index: int, walls: Sequence[str], estimate: Estimate, truth: Truth) -> WallError | None:
    """Compare a wall at its place in the raw image: mirrored in the walls before it."""
    mirror = _mirror_on(walls[index], estimate, truth)
    if mirror is None:
        return None
    ends, normal = np.stack([mirror.start, mirror.end]), mirror.normal
    for about in (estimate.mirrors[i] for i in reversed(mirror.seen_through)):
        ends = mirrored(ends, about.start, about.end)
        normal = normal - 2 * float(normal @ about.normal) * about.normal
    true = np.stack([truth.wall_start[walls[index]], truth.wall_end[walls[index]]])
    for name in reversed(walls[:index]):
        true = mirrored(true, truth.wall_start[name], truth.wall_end[name])
    unfolded = replace(mirror, start=ends[0], end=ends[1], normal=normal)
    return wall_error(unfolded, walls[index], true[0], true[1])


def map_cuts(uplink: Uplink, *, aoa: float, path_length: float) -> MapCuts:
    """Cut the angle/range map through its peak at an angle and path length.

    Parameters
    ----------
    uplink
        Of an array centred at the origin, along +x.
    aoa, path_length
        Of the peak, approximately (to a part of its width). [rad], [m]
    """
    frequencies = uplink.frequencies
    elements = len(uplink.positions)
    # Each element represents one spacing.
    aperture = float(np.ptp(uplink.positions[:, 0])) * elements / (elements - 1)
    width = angular_resolution(
        wavelength=2 * speed_of_light / float(frequencies[0] + frequencies[-1]),
        aperture_length=aperture,
        angle=np.pi / 2 - aoa,
    )
    cell = range_resolution(float(np.ptp(frequencies)), passes=1)
    steps = np.linspace(-3, 3, 601)
    angles, lengths = aoa + steps * width, path_length + steps * cell
    looked = partial(angle_range_map, uplink, centre=np.zeros(3))
    over_angle = np.abs(looked(aoa=angles, path_length=np.array([path_length])).values[:, 0])
    angle = peak_cut(angles, over_angle)
    over_length = np.abs(looked(aoa=np.array([angle.place]), path_length=lengths).values[0])
    return MapCuts(
        angles=angles,
        over_angle=over_angle / over_angle.max(),
        lengths=lengths,
        over_length=over_length / over_length.max(),
        angle=angle,
        length=peak_cut(lengths, over_length),
        theory_angle=width,
        theory_length=cell,
    )


def user_rows(
    trials: Sequence[UserTrial], *, median: float, worst: float, thesis: str, across: str
) -> tuple[Row, ...]:
    """Return rows of the errors of several realisations, and of the widths of the map.

    Parameters
    ----------
    trials
        Of one scenario.
    median, worst
        Largest errors claimed. [m]
    thesis
        Error stated in the thesis.
    across
        Cross-range width stated in the thesis.
    """
    summary = error_summary([trial.error for trial in trials])
    count = f"{len(trials)} realisations" if len(trials) > 1 else "one realisation"
    theory_across, theory_along = trials[0].theory_across, trials[0].cuts.theory_length

    def farthest(values: list[float], theory: float) -> float:
        return max(values, key=lambda value: abs(value - theory))

    return (
        Row(
            name=f"median error of the user, {count}",
            stated=thesis,
            measured=1e3 * summary.median,
            unit="mm",
            high=1e3 * median,
            origin="the design's bound over seeds; roughness and the wall's angle set the floor",
        ),
        Row(
            name=f"worst error of the user, {count}",
            stated=thesis,
            measured=1e3 * summary.worst,
            unit="mm",
            high=1e3 * worst,
            origin="the design's bound over seeds",
        ),
        Row(
            name=f"-3 dB width of the map across range, at {trials[0].true_length:.2f} m",
            stated=f"theory 0.886 λR/D: {1e3 * theory_across:.1f} mm; {across}",
            measured=1e3 * farthest([trial.width_across for trial in trials], theory_across),
            unit="mm",
            low=1e3 * theory_across * (1 - WIDTHS_WITHIN),
            high=1e3 * theory_across * (1 + WIDTHS_WITHIN),
            origin="theory ± 5 %: narrow band, untapered, an unbent wave",
        ),
        Row(
            name="-3 dB width of the map along the path",
            stated=f"theory 0.886 c/B: {1e3 * theory_along:.2f} mm (null to peak: c/B)",
            measured=1e3 * farthest([trial.cuts.length.width for trial in trials], theory_along),
            unit="mm",
            low=1e3 * theory_along * (1 - WIDTHS_WITHIN),
            high=1e3 * theory_along * (1 + WIDTHS_WITHIN),
            origin="theory ± 5 %: a flat spectrum",
        ),
    )


def wall_rows(
    trials: Sequence[UserTrial],
    index: int,
    *,
    angle: float,
    offset: float,
    origin: str,
    as_seen: bool = False,
) -> tuple[Row, ...]:
    """Return rows of the largest errors of one wall of the path.

    Parameters
    ----------
    trials
        Of one scenario.
    index
        Of the wall, from the array outward.
    angle, offset
        Largest errors claimed. [rad], [m]
    origin
        Of these limits.
    as_seen
        Whether the wall's place in the raw image is compared, not the unfolded one.
    """
    found = [(trial.ghosts if as_seen else trial.walls)[index] for trial in trials]
    known = [one for one in found if one is not None]
    missed = len(known) < len(found)
    count = f"worst of {len(trials)}" if len(trials) > 1 else "one realisation"
    where = "as the raw image shows it" if as_seen else "unfolded" if index else "seen directly"
    name = f"wall {index + 1}, {where}, {count}"
    turned = np.nan if missed else max(one.angle for one in known)
    away = np.nan if missed else max((one.offset for one in known), key=abs)
    stated = "thesis: at its place, marked by hand"
    return (
        Row(
            name=f"angle of {name}",
            stated=stated,
            measured=float(np.degrees(turned)),
            unit="°",
            high=float(np.degrees(angle)),
            origin=origin,
        ),
        Row(
            name=f"offset of {name}",
            stated=stated,
            measured=1e3 * float(away),
            unit="mm",
            low=-1e3 * offset,
            high=1e3 * offset,
            origin=origin,
        ),
    )


def draw_map(ax: Axes, trial: UserTrial) -> None:
    """Draw the enlarged angle/range map with the measured -3 dB widths."""
    seen = _seen(trial)
    (heard,), (user,) = seen.estimate.close_ups, seen.estimate.users
    figures_2d.draw_angle_range_map(ax, heard, user, peak=float(np.abs(heard.values).max()))
    angle, length = trial.cuts.angle, trial.cuts.length
    half = 0.5 * np.degrees(angle.width)
    middle = np.degrees(angle.place)
    tall = 0.5 * length.width
    for x, y in (
        ([middle - half, middle + half], [length.place] * 2),
        ([middle] * 2, [length.place - tall, length.place + tall]),
    ):
        ax.plot(x, y, color=figures_2d.ON_DARK, lw=1.5)
    ax.set_title(
        f"-3 dB: {2 * half:.3f}° ({1e3 * trial.width_across:.1f} mm) × {1e3 * length.width:.2f} mm",
        fontsize=10,
    )


def draw_plan(ax: Axes, trial: UserTrial) -> None:
    """Draw the estimate in plan, over the true walls and user."""
    seen = _seen(trial)
    walls = [
        np.stack([start, seen.truth.wall_end[name]])
        for name, start in seen.truth.wall_start.items()
    ]
    places = list(seen.truth.user_position.values())
    positions = seen.measurement.uplinks[0].positions
    points = [views.estimate_points(seen.estimate, positions), np.stack(places), *walls]
    figures_2d.draw_localization(
        ax,
        seen.estimate,
        positions,
        view=views.view_around(np.concatenate(points)),
        true_positions=places,
        true_walls=walls,
    )


def draw_errors(ax: Axes, trials: Sequence[UserTrial], *, limit: float) -> None:
    """Draw the distribution of errors over realisations, with a claimed limit. [m]."""
    summary = error_summary([trial.error for trial in trials])
    errors = 1e3 * summary.errors
    shares = np.arange(1, len(errors) + 1) / summary.trials
    ax.step([0.0, *errors], [0.0, *shares], where="post", color=figures_2d.USER)
    ax.plot(errors, shares, "o", color=figures_2d.USER, ms=5)
    ax.axvline(1e3 * limit, color="0.4", ls="--", lw=1.0, label=f"claimed: {1e3 * limit:g} mm")
    ax.set(
        xlabel="position error [mm]",
        ylabel="share of the realisations [-]",
        xlim=(0, 1.1e3 * max(limit, float(summary.errors.max(initial=0.0)))),
        ylim=(0, 1.05),
    )
    ax.legend(fontsize=8, loc="lower right")


def first_user(trial: UserTrial) -> UserEstimate:
    """Return the first user of the estimate."""
    return _seen(trial).estimate.users[0]


def _seen(trial: UserTrial) -> Seen:
    if trial.seen is None:
        raise RuntimeError(f"seed {trial.seed}: only its numbers were kept; draw another one")
    return trial.seen
