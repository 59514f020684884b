r"""A scene in air, simulated as one in vacuum: one door for the medium, in place of every kernel.

Waves of frequency f in a medium of index n that does not disperse run as waves of :math:`n f` in
vacuum: every length, angle, wavelength and Fresnel zone is the same. A wall of permittivity ε acts
by its permittivity relative to the medium, :math:`\varepsilon(f) / n^2`, and by its own wavelength,
which that keeps as it is. So the radio is given the frequencies n f, the walls' permittivities are
divided by n², and nothing else changes. Absorption multiplies each path by what its length says,
after all paths are summed (:mod:`simulator.numerics.delay_weighting`).
"""

import math
from collections.abc import Callable

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.measurement.air import Air
from scenes.scenario import Scenario, ScenarioError
from scenes.schema import air as scene_air
from scenes.schema.radio import Radio
from simulator.materials.gas_absorption import HIGHEST, LOWEST, decay_rate, refractive_index
from simulator.numerics.delay_weighting import NeighbourGrid, decayed, neighbour_grid
from simulator.scene.unambiguous_range import farthest_point

MOST_SAMPLES = 2**27
"""Most samples of one array on the refined grid: 2 GiB of complex doubles."""

Signal = Complex[np.ndarray, "channels freqs"]


class RadioInMedium(Radio):
    """A radio whose frequencies are those of vacuum that have its wavelengths."""

    refractive_index: float
    band: tuple[float, float]  # where materials are looked up: the radio's own [Hz]
    wavelengths: tuple[float, float]  # shortest and longest, for what only has to be fine enough

    @property
    def shortest_wavelength(self) -> float:
        """As the radio has it in vacuum, so that walls are the same in air. [m]."""
        return self.wavelengths[0]

    @property
    def longest_wavelength(self) -> float:
        """As the radio has it in vacuum. [m]."""
        return self.wavelengths[1]


def in_air(scenario: Scenario) -> tuple[Scenario, Callable[[Signal], Signal]]:
    """Return the scenario that is simulated in vacuum, and what completes its signals.

    Parameters
    ----------
    scenario
        One without air is returned as it is, with what changes nothing.

    Raises
    ------
    ScenarioError
        If absorption is asked for beyond 1 to 1000 GHz, or the delays of a large scene would need
        too many frequencies.
    """
    air = scenario.air
    if air is None:
        return scenario, lambda signal: signal
    index, radio = refractive_index(air), scenario.radio
    frequencies = radio.frequencies
    grid: NeighbourGrid | None = None
    start, stop, points = float(frequencies[0]), float(frequencies[-1]), radio.points
    if air.absorption:
        _check_band(frequencies)
        longest = index * longest_path(scenario) / speed_of_light
        grid = neighbour_grid(frequencies, longest)
        _check_size(scenario, grid)
        start, stop, points = grid.start, grid.stop, grid.points
    made = RadioInMedium.model_construct(
        start_ghz=start * index / 1e9,
        stop_ghz=stop * index / 1e9,
        points=points,
        polarization=radio.polarization,
        refractive_index=index,
        band=(float(frequencies[0]), float(frequencies[-1])),
        wavelengths=(radio.shortest_wavelength, radio.longest_wavelength),
    )
    simulated = scenario.model_copy(update={"radio": made})
    if grid is None:
        return simulated, lambda signal: signal
    rates = decay_rate(air, frequencies) * speed_of_light / index  # per second of delay
    return simulated, lambda signal: decayed(signal, grid, rates)


def wavelengths_of_air(scenario: Scenario) -> Scenario:
    """Return the scenario in vacuum that has the wavelengths of its air, without absorption."""
    if scenario.air is None:
        return scenario
    clear = scenario.air.model_copy(update={"absorption": False})
    return in_air(scenario.model_copy(update={"air": clear}))[0]


def absorbed(
    scenario: Scenario, frequencies: Float[np.ndarray, " freqs"], length: float
) -> Float[np.ndarray, " freqs"]:
    """Return what the scenario's air leaves of a field over a length. [-].

    Parameters
    ----------
    scenario
        In air or in vacuum.
    frequencies
        Those of :func:`wavelengths_of_air`. [Hz]
    length
        Of the path. [m]
    """
    air = scenario.air
    if air is None or not air.absorption:
        return np.ones_like(frequencies)
    left: np.ndarray = np.exp(-decay_rate(air, frequencies / refractive_index(air)) * length)
    return left


def measured_air(air: scene_air.Air | None) -> Air | None:
    """Return the air as a measurement tells it: read off a thermometer, not of the truth."""
    if air is None:
        return None
    return Air(
        temperature_c=air.temperature_c,
        pressure_hpa=air.pressure_hpa,
        humidity_percent=air.humidity_percent,
    )


def longest_path(scenario: Scenario) -> float:
    """Return a length that no path of the scene exceeds. [m].

    All of it lies within the distance R of its farthest point from the array's centre, and a leg
    within that ball is at most 2 R long.
    """
    places = scenario.base_station.element_positions
    senders = scenario.base_station.transmit_positions(places)
    centre = places.mean(axis=0)
    ends = [places, *(user.position[None] for user in scenario.users.values())]
    ends += [point.position[None] for point in scenario.points.values()]
    ends += [] if senders is None else [senders]
    reach = max(float(np.linalg.norm(one - centre, axis=-1).max()) for one in ends)
    reach = max([reach, *(farthest_point(one, centre) for one in scenario.objects.values())])
    return 2.0 * reach * (scenario.max_bounces + 1)


def _check_band(frequencies: Float[np.ndarray, " freqs"]) -> None:
    if frequencies[0] < LOWEST or frequencies[-1] > HIGHEST:
        raise ScenarioError(
            f"air.absorption = true: ITU-R P.676 knows it from {LOWEST / 1e9:g} to "
            f"{HIGHEST / 1e9:g} GHz, but the radio uses {frequencies[0] / 1e9:g}-"
            f"{frequencies[-1] / 1e9:g} GHz; set it to false"
        )


def _check_size(scenario: Scenario, grid: NeighbourGrid) -> None:
    samples = scenario.base_station.element_count * grid.points
    if samples > MOST_SAMPLES or grid.start <= 0 or not math.isfinite(grid.stop):
        raise ScenarioError(
            f"air.absorption = true: paths of up to {grid.longest * speed_of_light:.3g} m need "
            f"{grid.points} frequencies from {grid.start / 1e9:.3g} GHz on at each of "
            f"{scenario.base_station.element_count} elements, and at most {MOST_SAMPLES} samples "
            "above 0 GHz are computed; lower max_bounces, raise radio.points, or set it to false"
        )
