"""A scenario's measurement by full wave in place of rays: small two-dimensional scenes."""

from collections.abc import Callable
from pathlib import Path

from estimator.results.estimate import Progress
from mmslam import output, own_results
from mmslam.measurement import Measurement
from mmslam.measurement_files import write
from mmslam.terminal.interruption import interruptions_held
from scenes.scenario import Scenario, ScenarioError


def simulate_full_wave(
    scenario: Scenario,
    *,
    seed: int = 0,
    tell: Callable[[str], None] = lambda told: None,
    progress: Progress | None = None,
) -> Measurement:
    """Solve the wave equation in a scenario: its measurement, with the truth beside it.

    Ctrl-C takes effect between two frequencies.

    Parameters
    ----------
    scenario
        Two-dimensional, in cylindrical waves; plates, cylinders and boxes.
    seed
        Of roughness and noise: the realisation is that of :func:`mmslam.simulate`.
    tell
        Told in a line, beforehand, how many unknowns there are and about how long they take.
    progress
        Told each frequency.

    Raises
    ------
    ScenarioError
        If full wave cannot solve it, said before anything is solved; or if nothing is received.

    Examples
    --------
    >>> import mmslam
    >>> small = {
    ...     "waves": "cylindrical", "objects.wall.length_m": 0.01,
    ...     "base_station.elements": 4, "radio.points": 3,
    ... }
    >>> room = mmslam.load_scenario("slam_2d", small)
    >>> mmslam.simulate_full_wave(room, seed=1).echo.samples.shape
    (4, 3)
    """
    with interruptions_held() as let_through:
        # The ray tracer's import takes seconds, and the materials stand beside it.
        from validation.full_wave.direct_solution import FullWaveError
        from validation.full_wave.scenario_solution import full_wave_scenario, solve_scenario

        def step(stage: str, done: int, total: int) -> None:
            let_through()
            if progress is not None:
                progress(stage, done, total)

        ready = full_wave_scenario(scenario, seed=seed)
        tell(str(ready.effort))
        try:
            found, truth = solve_scenario(ready, progress=step)
        except FullWaveError as error:
            raise ScenarioError(f"scenario {scenario.name!r}: {error}") from error
    return Measurement.of(found, beside=truth)


def solve_to_file(
    scenario: Scenario,
    *,
    seed: int,
    path: Path,
    tell: Callable[[str], None],
    progress: Progress | None = None,
) -> Measurement:
    """Solve a scenario to a measurement file; ``path`` is refused before any work."""
    with output.replacing(path, own_results.refuse_foreign_store) as new:
        measurement = simulate_full_wave(scenario, seed=seed, tell=tell, progress=progress)
        write(new, measurement)
    return measurement
