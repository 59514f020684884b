r"""The estimator on full-wave data, end to end: position errors of the user of ``slam_2d``.

Run as ``python -m validation.experiments.full_wave.localization [FOLDER [TRIALS [CASE …]]]``. It
takes about two minutes a trial on two idle cores, stores solutions in FOLDER (by default
``full_wave_localization``) and reuses them when started again.

The scene is the thesis' figures 4.9 to 4.12 at full size: 260 positions 0.5 mm apart, 220 to
295 GHz in 1001 points, a conducting wall 0.40 m long, 0.8 m away and turned by 45°, the user
1 m behind it. Echo and uplink are solutions of Maxwell's equations in two dimensions
(:mod:`validation.full_wave.method_of_moments`), with cylindrical waves; noise of 20 dB SNR is added
as in the simulator. Each trial is compared with the simulator's result for the *same* frozen wall
and the same noise, which differs by physical optics alone.

Chosen: the beam is that of a line source at a complex position, an exact solution, with the
thesis' width of 0.1 rad on its axis; the direct path from user to array is left out, as the
beam is 50 dB down there (at 0.48 rad). Roughness: that of ``slam_2d`` (0.05 mm rms,
0.3 mm long, Gaussian) and a rougher one (0.15 mm, 1 mm). Fields are solved for at some 300
Chebyshev frequencies and interpolated (:mod:`validation.full_wave.band_interpolation`).

Claims that are asserted, for full-wave data: with the roughness of ``slam_2d`` the median error
of the user is below 0.4 mm and every one below 1.0 mm, the limits set for the simulated scene;
with any roughness, every user is found, within the 99.9 % region of its stated covariance.
"""

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Complex
from matplotlib.axes import Axes
from scipy.stats import chi2

from estimator.localization.pipeline import locate
from estimator.measurement.model import Echo, Measurement, Uplink
from scenes.files.loading import load_scenario, override_scenario
from scenes.realisations.object_surface import object_surface
from scenes.scenario import Scenario
from scenes.schema.antenna import GaussianBeam
from scenes.schema.objects import Plate
from simulator.receiver.receiver import received
from simulator.scene.truth import scenario_truth
from simulator.simulation import simulate
from validation.full_wave.band_interpolation import band_fields
from validation.full_wave.line_source import LineSource
from validation.full_wave.strip_scattering import StripFields, StripScene
from validation.metrics.coverage import position_errors
from validation.metrics.errors import wall_error
from validation.metrics.truth import Truth, truth_from_dataset

TRIALS = 10
WALL, USER = "wall", "user"

CYLINDRICAL = ("waves=cylindrical",)
CASES: dict[str, tuple[str, ...]] = {
    "0.05 mm, 0.3 mm": CYLINDRICAL,
    "0.15 mm, 1.0 mm": (
        *CYLINDRICAL,
        f"objects.{WALL}.roughness.rms_mm=0.15",
        f"objects.{WALL}.roughness.correlation_mm=1.0",
    ),
}
"""Overrides of ``slam_2d`` for each roughness: rms height, correlation length."""

HALF_SIZE = (
    "base_station.elements=128",
    "radio.points=251",
    f"objects.{WALL}.centre_m=[0.0, 0.4]",
    f"objects.{WALL}.length_m=0.2",
    f"users.{USER}.position_m=[0.45, 0.4]",
)
"""Overrides of a quick variant with half of all lengths: some 15 s a trial."""

PER_CORRELATION_LENGTH = 3.0
"""Grid points for each correlation length: an error of 1e-3 of the echo, 40 dB below the noise,
up to slopes of 0.3 rms; 1e-2 at 0.2 mm rms, l = 0.3 mm. [-]"""

PROFILE_POINTS = 10.0
"""Points of the profile for each correlation length: jumps in the third derivative of a spline
through fewer have an effect, 5e-4 of the echo at 4. [-]"""

REGION = float(chi2.ppf(0.999, 2))
MOST_MEDIAN, MOST_WORST = 0.4e-3, 1.0e-3
"""Limits on the user's error in ``slam_2d``. [m]"""

Advance = Callable[[int, int], None]


@dataclass(frozen=True, kw_only=True)
class Located:
    """Errors of the estimate of one measurement."""

    status: str
    error: float  # of the user, NaN without a position [m]
    square: float  # normalised square of that error; NaN without a position [-]
    wall_angle: float  # of the mirror nearest to the wall, NaN without one [rad]
    wall_offset: float  # of the wall's centre from it [m]


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One realisation of roughness and noise."""

    seed: int
    full_wave: Located
    simulated: Located
    echo_correlation: float  # of the simulator's noise-free echo with the full-wave one [-]
    uplink_correlation: float  # the same of the uplinks [-]


@dataclass(frozen=True, kw_only=True)
class Case:
    """All realisations of one roughness."""

    name: str
    trials: tuple[Trial, ...]

    @property
    def errors(self) -> tuple[float, ...]:
        """The user's errors in full-wave data. [m]."""
        return tuple(trial.full_wave.error for trial in self.trials)


def strip_scene(scenario: Scenario, *, seed: int) -> StripScene:
    """Convert the scenario's frozen wall and its user for the full-wave solver.

    Raises
    ------
    ValueError
        If the user's antenna is neither isotropic nor a Gaussian beam.
    """
    plate, user = scenario.objects[WALL], scenario.users[USER]
    assert isinstance(plate, Plate)
    spacing, detail = scenario.facet_spacing(WALL), np.inf
    if plate.roughness is not None and plate.roughness.rms > 0:
        detail = plate.roughness.correlation_length / PER_CORRELATION_LENGTH
        spacing = min(spacing, plate.roughness.correlation_length / PROFILE_POINTS)
    # The same surface as the simulator's, sampled more finely.
    profile = object_surface(scenario, WALL, seed=seed, spacing=spacing).vertices
    source = LineSource(position=user.position[:2])
    if isinstance(user.antenna, GaussianBeam):
        aim = scenario.aim(user.antenna, user.position)[:2]
        source = LineSource(position=user.position[:2], aim=aim, width=user.antenna.sigma_rad)
    return StripScene(
        profile=profile,
        positions=scenario.base_station.element_positions,
        users=(source,),
        detail=detail,
    )


def noisy_measurement(scenario: Scenario, fields: StripFields, *, seed: int) -> Measurement:
    """Add the scenario's noise to noise-free fields; its stream does not depend on the fields."""
    signals = {"echo": fields.echo, f"uplink/{USER}": fields.uplinks[0]}
    recorded = received(signals, scenario, seed=seed, sample=0)
    station, frequencies = scenario.base_station, scenario.radio.frequencies
    positions = station.element_positions
    pilot = recorded[f"uplink/{USER}"]
    return Measurement(
        echo=Echo(samples=recorded["echo"], positions=positions, frequencies=frequencies),
        uplinks=(Uplink(samples=pilot, positions=positions, frequencies=frequencies, user=USER),),
        waves="cylindrical",
        boresight=station.boresight,
        clock_offset=0.0,
    )


def located(measurement: Measurement, truth: Truth) -> Located:
    """Locate the user and compare user and wall with the truth."""
    estimate = locate(measurement)
    (user,) = estimate.users
    angle = offset = np.nan
    error, square = position_errors(user, truth.user_position[USER])
    if estimate.mirrors:
        ends = truth.wall_start[WALL], truth.wall_end[WALL]
        walls = [wall_error(mirror, WALL, *ends) for mirror in estimate.mirrors]
        nearest = min(walls, key=lambda wall: abs(wall.offset) + wall.angle)
        angle, offset = nearest.angle, nearest.offset
    return Located(
        status=user.status,
        error=np.nan if error is None else error,
        square=np.nan if square is None else square,
        wall_angle=angle,
        wall_offset=offset,
    )


def trial(
    scenario: Scenario,
    *,
    seed: int,
    folder: Path | None = None,
    workers: int | None = None,
    advance: Advance = lambda done, steps: None,
) -> Trial:
    """Solve and simulate one realisation, and locate its user in both."""
    truth = truth_from_dataset(scenario_truth(scenario))
    solved = band_fields(
        strip_scene(scenario, seed=seed),
        scenario.radio.frequencies,
        folder=folder,
        workers=workers,
        advance=advance,
    )
    quiet = simulate(override_scenario(scenario, ["noise.snr_db=inf"]), seed=seed).measurement
    assert quiet.echo is not None
    simulated = StripFields(echo=quiet.echo.samples, uplinks=quiet.uplinks[0].samples[None])
    return Trial(
        seed=seed,
        full_wave=located(noisy_measurement(scenario, solved, seed=seed), truth),
        simulated=located(noisy_measurement(scenario, simulated, seed=seed), truth),
        echo_correlation=correlation(simulated.echo, solved.echo),
        uplink_correlation=correlation(simulated.uplinks, solved.uplinks),
    )


def correlation(one: Complex[np.ndarray, "*n"], other: Complex[np.ndarray, "*n"]) -> float:
    """Return the magnitude of the complex correlation of two fields. [-]."""
    norms = np.linalg.norm(one) * np.linalg.norm(other)
    return float(abs(np.vdot(one, other)) / norms)


def localization(
    name: str,
    *,
    trials: int = TRIALS,
    overrides: tuple[str, ...] = (),
    folder: Path | None = None,
    advance: Callable[[Trial], None] = lambda trial: None,
) -> Case:
    """Locate the user in several realisations of one roughness.

    Parameters
    ----------
    name
        One of :data:`CASES`.
    trials
        Realisations; seed 0 is the first.
    overrides
        Further overrides, such as :data:`HALF_SIZE`.
    folder
        Cache of solutions.
    advance
        Called after each trial.
    """
    scenario = load_scenario("slam_2d", (*CASES[name], *overrides))
    done = []
    for seed in range(trials):
        done.append(trial(scenario, seed=seed, folder=folder))
        advance(done[-1])
    return Case(name=name, trials=tuple(done))


def table_row(name: str, trial: Trial) -> str:
    """Return the line of one trial."""
    cells = [
        f"{what} {one.status:9s} {1e3 * one.error:6.3f} mm (χ² {one.square:5.2f}), wall "
        f"{np.degrees(one.wall_angle):.4f}° {1e3 * one.wall_offset:+.4f} mm"
        for what, one in (("full wave", trial.full_wave), ("simulated", trial.simulated))
    ]
    return (
        f"{name}, seed {trial.seed}: {'; '.join(cells)}; correlation of echoes "
        f"{trial.echo_correlation:.4f}, uplinks {trial.uplink_correlation:.4f}"
    )


def summary(case: Case) -> str:
    """Return the line of one roughness."""
    cells = []
    for what in ("full_wave", "simulated"):
        results = [getattr(trial, what) for trial in case.trials]
        errors = 1e3 * np.array([one.error for one in results])
        angles = np.degrees([one.wall_angle for one in results])
        offsets = 1e3 * np.abs([one.wall_offset for one in results])
        cells.append(
            f"{what.replace('_', ' ')}: user median {np.median(errors):.3f}, worst "
            f"{errors.max():.3f} mm; wall median {np.median(angles):.4f}°, worst "
            f"{angles.max():.4f}°, {np.median(offsets):.4f} and {offsets.max():.4f} mm"
        )
    return f"{case.name}, {len(case.trials)} realisations: {'; '.join(cells)}"


def draw(ax: Axes, case: Case) -> None:
    """Draw the user's error in each realisation, on full-wave and on simulated data."""
    seeds = [trial.seed for trial in case.trials]
    for what, marker, label in (
        ("full_wave", "o", "full wave"),
        ("simulated", "x", "simulated, the same wall and noise"),
    ):
        errors = [1e3 * getattr(trial, what).error for trial in case.trials]
        ax.semilogy(seeds, errors, marker, label=label)
    ax.axhline(1e3 * MOST_MEDIAN, color="0.5", ls="--", label="limit of the median")
    ax.axhline(1e3 * MOST_WORST, color="0.5", label="limit of each")
    ax.set(
        xlabel="realisation of roughness and noise",
        ylabel="error of the user [mm]",
        title=f"slam_2d, wall of {case.name} rms and correlation",
    )
    ax.grid(alpha=0.3, which="both")
    ax.legend()


def fails(case: Case) -> list[str]:
    """Return the claims for full-wave data that do not hold."""
    said = [
        f"{case.name}, seed {trial.seed}: {trial.full_wave.status}, error "
        f"{1e3 * trial.full_wave.error:.3f} mm, χ² {trial.full_wave.square:.1f} of {REGION:.1f}"
        for trial in case.trials
        if trial.full_wave.status != "found" or not trial.full_wave.square < REGION
    ]
    errors = np.array(case.errors)
    held = np.median(errors) < MOST_MEDIAN and errors.max() < MOST_WORST
    if case.name == next(iter(CASES)) and not held:
        said.append(
            f"{case.name}: median {1e3 * np.median(errors):.3f} and worst "
            f"{1e3 * errors.max():.3f} mm; {1e3 * MOST_MEDIAN:g} and {1e3 * MOST_WORST:g} mm "
            "are the limits"
        )
    return said


def main(arguments: list[str]) -> int:
    """Print a table; return 1 if a claim does not hold."""
    folder = Path(arguments[0] if arguments else "full_wave_localization")
    trials = int(arguments[1]) if len(arguments) > 1 else TRIALS
    wrong = []
    for name in arguments[2:] or CASES:
        started = time.perf_counter()

        def tell(trial: Trial, name: str = name, started: float = started) -> None:
            minutes = (time.perf_counter() - started) / 60
            print(f"{table_row(name, trial)} [{minutes:.1f} min]", flush=True)

        case = localization(name, trials=trials, folder=folder, advance=tell)
        print(summary(case), flush=True)
        wrong += fails(case)
    for line in wrong:
        print(f"FAIL {line}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
