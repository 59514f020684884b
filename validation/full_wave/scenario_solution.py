r"""Full-wave solution of a whole two-dimensional scenario, in the simulator's output format.

Base station and users are line sources, as in the simulator's cylindrical waves: fields of unit
line sources, :math:`-\tfrac j4 H_0^{(2)}(kr)`. All bodies and all bounces between them are solved
together, at few frequencies of the band, and interpolated; the direct wave is added at every
frequency. Impairments of the radio (noise, clock) are drawn as in the simulator, from the same
random streams.
"""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import xarray as xr
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light
from threadpoolctl import threadpool_limits

from estimator.measurement.model import Echo, Measurement, Uplink
from scenes.scenario import Scenario, ScenarioError
from simulator.receiver.receiver import received
from simulator.scene.radio_scene import true_elements
from simulator.scene.truth import scenario_truth
from validation.full_wave.band_interpolation import COMPARED, interpolated_fields, nodes_needed
from validation.full_wave.boundary_equations import BoundaryProblem, Polarisation
from validation.full_wave.direct_solution import LEAF, array_fields
from validation.full_wave.line_source import LineSource
from validation.full_wave.scenario_bodies import ScenarioBodies, line_source, scenario_bodies

SECONDS_PER_UNKNOWN = 2.5e-3
"""Time on one core for each unknown and frequency: 2 to 4 ms were measured for 1 000 to 9 000
unknowns. [s]"""

RANK = 110
"""Rank of the links of a board of 13 mm, by which memory is estimated. [-]"""

MOST_UNKNOWNS = 40_000
"""Most unknowns at the highest frequency: 3 m of metal, or half a metre of drywall, at 300 GHz, and
some minutes for each frequency. [-]"""

MOST_BYTES = 8 * 2**30
"""Most memory of all frequencies that are solved for at once. [B]"""

MOST_ERROR = 1e-3
"""Largest error of interpolation over frequency, over the norm of a user's or the echo's field.
[-]"""

Progress = Callable[[str, int, int], None]
"""Called with the name of a stage, the steps done and the steps in all."""


@dataclass(frozen=True, kw_only=True)
class Effort:
    """Estimated time and memory of a scenario's solution."""

    unknowns: int  # at the highest frequency
    solutions: int  # frequencies to be solved for, if the smallest number suffices
    frequencies: int  # of the band
    workers: int  # frequencies at once

    @property
    def seconds(self) -> float:
        """Time of all solutions. [s]."""
        return SECONDS_PER_UNKNOWN * self.unknowns * self.solutions / self.workers

    @property
    def bytes(self) -> int:
        """Memory of the matrices: leaves, and four factors of a link at each level. [B]."""
        levels = max(1, round(np.log2(max(2.0, self.unknowns / LEAF))))
        return int(16 * self.unknowns * (LEAF + 5 * RANK * levels) * self.workers)

    def __str__(self) -> str:
        """Return the estimate as a line of text."""
        took = f"{self.seconds / 60:.0f} min" if self.seconds > 90 else f"{self.seconds:.0f} s"
        return (
            f"full wave: {self.unknowns} unknowns, {self.solutions} of {self.frequencies} "
            f"frequencies, {self.workers} at once; about {took} and "
            f"{self.bytes / 2**30:.1f} GiB"
        )


@dataclass(frozen=True, kw_only=True)
class FullWaveScenario:
    """A checked scenario, prepared for its solution."""

    scenario: Scenario
    bodies: ScenarioBodies
    elements: Float[np.ndarray, "elements 3"]  # true positions of the array's antennas [m]
    seed: int
    sample: int
    polarisation: Polarisation
    effort: Effort

    @property
    def users(self) -> list[LineSource]:
        """The users' antennas."""
        users = self.scenario.users.values()
        return [line_source(self.scenario, user.antenna, user.position) for user in users]


def full_wave_scenario(
    scenario: Scenario,
    *,
    seed: int,
    sample: int = 0,
    polarisation: Polarisation = "TM",
    workers: int | None = None,
) -> FullWaveScenario:
    """Prepare a scenario for its solution, and estimate time and memory.

    Parameters
    ----------
    scenario
        Two-dimensional, in cylindrical waves.
    seed, sample
        Which realisation of roughness and noise.
    polarisation
        TM: all antennas along z.
    workers
        Frequencies at once; by default, one on each core. The result is the same.

    Raises
    ------
    ScenarioError
        If it cannot be solved for, or exceeds the limits of unknowns or memory.
    """
    if scenario.air is not None:
        raise ScenarioError(
            f"scenario {scenario.name!r}: air: full wave is solved in vacuum; leave the table "
            "[air] out"
        )
    bodies = scenario_bodies(scenario, seed=seed, sample=sample)
    frequencies = scenario.radio.frequencies
    sampled = bodies.at(float(frequencies[-1]))
    unknowns = sum(body.contour.count * (1 if body.permittivity is None else 2) for body in sampled)
    if unknowns > MOST_UNKNOWNS:
        largest = max(zip(sampled, bodies.names, strict=True), key=lambda one: one[0].contour.count)
        raise ScenarioError(
            f"scenario {scenario.name!r}: full wave has {unknowns} unknowns at "
            f"{frequencies[-1] / 1e9:g} GHz, more than {MOST_UNKNOWNS}; make objects smaller, "
            f"objects.{largest[1]} first, or lower radio.stop_ghz"
        )
    elements = true_elements(scenario, seed=seed, sample=sample)
    ready = FullWaveScenario(
        scenario=scenario,
        bodies=bodies,
        elements=elements,
        seed=seed,
        sample=sample,
        polarisation=polarisation,
        effort=Effort(unknowns=unknowns, solutions=1, frequencies=frequencies.size, workers=1),
    )
    needed = nodes_needed(frequencies, _delays(ready)[1]) + len(COMPARED)
    solutions = min(needed, frequencies.size)
    workers = min(workers or os.cpu_count() or 1, solutions)
    while True:
        effort = Effort(
            unknowns=unknowns,
            solutions=solutions,
            frequencies=frequencies.size,
            workers=workers,
        )
        if effort.bytes <= MOST_BYTES or workers == 1:
            break
        workers -= 1
    return FullWaveScenario(**{**vars(ready), "effort": effort})


def solve_scenario(
    ready: FullWaveScenario, *, progress: Progress | None = None
) -> tuple[Measurement, xr.Dataset]:
    """Solve a scenario, and add the impairments of its radio.

    Parameters
    ----------
    ready
        See :func:`full_wave_scenario`.
    progress
        Called after each frequency.

    Returns
    -------
    The measurement, and its ground truth.

    Raises
    ------
    FullWaveError
        If a solution does not satisfy its equation.
    ScenarioError
        If nothing is received.
    """
    scenario, station = ready.scenario, ready.scenario.base_station
    fields = noise_free_fields(ready, progress=progress)
    signals = {"echo": fields[0]}
    signals |= {
        f"uplink/{name}": pilot for name, pilot in zip(scenario.users, fields[1:], strict=True)
    }
    recorded = received(signals, scenario, seed=ready.seed, sample=ready.sample)
    elements, frequencies = station.element_positions, scenario.radio.frequencies
    measurement = Measurement(
        echo=Echo(samples=recorded["echo"], positions=elements, frequencies=frequencies)
        if "echo" in recorded
        else None,
        uplinks=tuple(
            Uplink(samples=pilot, positions=elements, frequencies=frequencies, user=name)
            for name in scenario.users
            if (pilot := recorded.get(f"uplink/{name}")) is not None
        ),
        waves=scenario.waves,
        boresight=station.boresight,
        clock_offset=scenario.impairments.clock_offset
        if scenario.impairments.clock_known
        else None,
        scenario=scenario.name,
        seed=ready.seed,
    )
    return measurement, scenario_truth(scenario)


def noise_free_fields(
    ready: FullWaveScenario, *, progress: Progress | None = None
) -> Complex[np.ndarray, "ways elements freqs"]:
    """Solve for the echo, and each user's pilot with its direct wave.

    Parameters
    ----------
    ready, progress
        See :func:`solve_scenario`.
    """
    frequencies = ready.scenario.radio.frequencies
    array = [LineSource(position=place[:2]) for place in ready.elements]

    def one(frequency: float) -> Complex[np.ndarray, "ways elements"]:
        problem = BoundaryProblem(
            ready.bodies.at(frequency), ready.polarisation, 2 * np.pi * frequency / speed_of_light
        )
        return array_fields(problem, array, ready.users)

    def solved(wanted: Float[np.ndarray, " wanted"]) -> Complex[np.ndarray, "ways elements wanted"]:
        columns = []
        # One BLAS thread in each worker: sums do not depend on the number of workers.
        with threadpool_limits(limits=1):
            for column in _in_turn(one, wanted.tolist(), ready.effort.workers):
                columns.append(column)
                if progress is not None:
                    progress("full wave", len(columns), wanted.size)
        return np.stack(columns, axis=-1)

    fields = interpolated_fields(solved, frequencies, *_delays(ready), most_error=MOST_ERROR)
    for index, user in enumerate(ready.users):
        direct = [
            user.field(ready.elements[:, :2], 2 * np.pi * float(one_) / speed_of_light)
            for one_ in frequencies
        ]
        fields[1 + index] += np.stack(direct, axis=-1)
    return fields


def _in_turn(
    one: Callable[[float], Complex[np.ndarray, "ways elements"]],
    wanted: list[float],
    workers: int,
) -> Iterator[Complex[np.ndarray, "ways elements"]]:
    pool = ThreadPoolExecutor(workers)
    try:
        yield from pool.map(one, wanted)
    finally:  # if interrupted, pending tasks are cancelled
        pool.shutdown(cancel_futures=True)


def _delays(ready: FullWaveScenario) -> tuple[Float[np.ndarray, "ways elements"], float]:
    """Return each link's delay over the bodies' middle, and the largest deviation from it [s].

    Waves over two bodies arrive later than over either, by less than twice the delay between them.
    """
    lowest = float(ready.scenario.radio.frequencies[0])
    contours = [body.contour.points for body in ready.bodies.at(lowest)]
    points = np.concatenate([contour[:: max(1, len(contour) // 200)] for contour in contours])
    to_array = np.linalg.norm(ready.elements[:, None, :2] - points, axis=-1)
    ways = [2 * to_array]
    ways += [to_array + np.linalg.norm(user.position - points, axis=-1) for user in ready.users]
    lengths = np.stack(ways)
    latest = lengths.max(axis=-1)
    if len(contours) > 1:
        span = np.ptp(points, axis=0)
        latest = latest + float(np.hypot(*span))
    middle = 0.5 * (latest + lengths.min(axis=-1))
    window = float(np.max(latest - middle))
    return np.asarray(middle / speed_of_light), window / speed_of_light
