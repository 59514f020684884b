"""The data model: what a radio measures, and the conventions that every module relies on.

Time convention exp(+jωt): a delay τ appears as exp(−j2πfτ). World frame, right-handed,
metres: x cross-range (along a linear array), y range (boresight), z up. Samples are
S-parameters between antenna ports: a free-space link has |S21| = λ/(4πR). Angles of
arrival are measured from the array's axis (+x), broadside is 90°.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Complex, Float

from estimator.measurement.air import Air
from estimator.measurement.errors import MeasurementError
from estimator.measurement.path_list import PathList

__all__ = [
    "Air",
    "Echo",
    "Measurement",
    "MeasurementError",
    "PathList",
    "Uplink",
    "Waves",
    "frequency_step",
]

Waves = Literal["spherical", "cylindrical"]

LARGEST_INDEX = 20.0
"""Largest refractive index of a medium that is no mistake: water has 9. [-]"""

UNIFORM_STEP = 1e-6
"""Largest departure from a uniform frequency grid, over the step: 1e-6 of 75 MHz at 2 m of
range is 1e-6 rad, far below any noise. [-]"""


@dataclass(frozen=True, kw_only=True)
class Echo:
    """Stepped-frequency echo of the scene: monostatic, or from transmitters that stand apart.

    Examples
    --------
    >>> positions = np.array([[0.0, 0.0, 0.0], [5e-4, 0.0, 0.0]])  # [m]
    >>> frequencies = np.array([220e9, 221e9, 222e9])  # [Hz]
    >>> echo = Echo(
    ...     samples=np.full((2, 3), 1e-3 + 0j), positions=positions, frequencies=frequencies
    ... )
    >>> echo.samples.shape
    (2, 3)
    """

    samples: Complex[np.ndarray, "positions freqs"]  # S-parameter [-]
    positions: Float[np.ndarray, "positions 3"]  # phase centres, of the receiver [m]
    frequencies: Float[np.ndarray, " freqs"]  # [Hz]
    transmit_positions: Float[np.ndarray, "positions 3"] | None = None  # None: monostatic [m]

    def __post_init__(self) -> None:
        """Refuse samples, positions or frequencies that no method could use."""
        _check("echo", self.samples, self.positions, self.frequencies, self.transmit_positions)


@dataclass(frozen=True, kw_only=True)
class Uplink:
    """One user's pilot, as each element of the array receives it.

    Examples
    --------
    >>> positions = np.array([[0.0, 0.0, 0.0], [5e-4, 0.0, 0.0]])  # [m]
    >>> frequencies = np.array([220e9, 221e9, 222e9])  # [Hz]
    >>> samples = np.full((2, 3), 1e-3 + 0j)
    >>> Uplink(samples=samples, positions=positions, frequencies=frequencies, user="ann").user
    'ann'
    """

    samples: Complex[np.ndarray, "elements freqs"]  # S-parameter [-]
    positions: Float[np.ndarray, "elements 3"]  # phase centres [m]
    frequencies: Float[np.ndarray, " freqs"]  # [Hz]
    user: str

    def __post_init__(self) -> None:
        """Refuse samples, positions or frequencies that no method could use."""
        _check(f"uplink of {self.user!r}", self.samples, self.positions, self.frequencies)


@dataclass(frozen=True, kw_only=True)
class Measurement:
    """Everything that the estimator may know: no scene, no truth."""

    echo: Echo | None
    uplinks: tuple[Uplink, ...]
    waves: Waves = "spherical"
    boresight: Float[np.ndarray, " 3"] = field(default_factory=lambda: np.array([0.0, 1.0, 0.0]))
    clock_offset: float | None = None  # user's clock minus ours; None: unknown [s]
    scenario: str | None = None
    seed: int | None = None
    path_lists: tuple[PathList, ...] = ()  # of users whose channels were not kept
    air: Air | None = None  # that the waves run in; None: vacuum, or another medium
    medium_index: float | None = None  # refractive index of another medium [-]

    def __post_init__(self) -> None:
        """Refuse a measurement without data."""
        if self.air is not None and self.medium_index is not None:
            raise MeasurementError(
                f"air and medium_index = {self.medium_index:g} are both given; waves run in one "
                "medium: leave one of them out"
            )
        if self.medium_index is not None and not 1 <= self.medium_index <= LARGEST_INDEX:
            raise MeasurementError(
                f"medium_index = {self.medium_index:g}; a refractive index lies between 1 and "
                f"{LARGEST_INDEX:g} (water 9)"
            )
        length = float(np.linalg.norm(self.boresight))
        if not abs(length - 1) < 1e-6:
            raise MeasurementError(
                f"boresight = {self.boresight.tolist()} has length {length:g}; give a unit vector"
            )
        if self.echo is None and not self.uplinks and not self.path_lists:
            raise MeasurementError(
                "the measurement has neither 'echo' nor 'uplink' nor lists of paths: give one"
            )
        grids = [uplink.frequencies for uplink in self.uplinks]
        grids += [self.echo.frequencies] if self.echo else []
        if any(not np.array_equal(grid, grids[0]) for grid in grids):
            raise MeasurementError(
                "echo and uplinks have different frequencies; measure all on one grid"
            )
        first = self.uplinks[:1]
        if any(not np.array_equal(one.positions, first[0].positions) for one in self.uplinks):
            raise MeasurementError(
                "the uplinks have different element positions; one array receives all users"
            )
        users = [uplink.user for uplink in self.uplinks]
        users += [listed.user for listed in self.path_lists]
        if self.path_lists and len(set(users)) < len(users):
            twice = next(user for user in users if users.count(user) > 1)
            raise MeasurementError(f"two users are called {twice!r}; name them differently")

    @property
    def refractive_index(self) -> float:
        """Of the medium that the waves run in; 1 of vacuum. [-]."""
        if self.air is not None:
            return self.air.refractive_index
        return 1.0 if self.medium_index is None else self.medium_index

    @property
    def places(self) -> Float[np.ndarray, "positions 3"]:
        """Phase centres of the echo, else of the uplinks, else the base station's place. [m]."""
        measured = self.echo or next(iter(self.uplinks), None)
        return np.zeros((1, 3)) if measured is None else measured.positions


def frequency_step(frequencies: Float[np.ndarray, " freqs"]) -> float:
    """Return the step of a uniform frequency grid. [Hz].

    Raises
    ------
    MeasurementError
        If there is one frequency only, or the steps differ by more than
        :data:`UNIFORM_STEP`.
    """
    if frequencies.size < 2:
        raise MeasurementError(
            "frequency: one point has no bandwidth; range needs at least two frequencies"
        )
    step = float(frequencies[-1] - frequencies[0]) / (frequencies.size - 1)
    grid = frequencies[0] + step * np.arange(frequencies.size)
    worst = int(np.argmax(np.abs(frequencies - grid)))
    if abs(frequencies[worst] - grid[worst]) > UNIFORM_STEP * abs(step):
        raise MeasurementError(
            f"frequency: the grid is not uniform (point {worst} is {frequencies[worst]:.6g} Hz, "
            f"a uniform one has {grid[worst]:.6g} Hz); resample the sweep to equal steps"
        )
    return step


def _check(
    name: str,
    samples: Complex[np.ndarray, "positions freqs"],
    positions: Float[np.ndarray, "positions 3"],
    frequencies: Float[np.ndarray, " freqs"],
    transmit_positions: Float[np.ndarray, "positions 3"] | None = None,
) -> None:
    expected = (len(positions), len(frequencies))
    if samples.shape != expected:
        raise MeasurementError(
            f"{name}: samples have shape {samples.shape}, but there are {expected[0]} positions "
            f"and {expected[1]} frequencies; the shape must be {expected}"
        )
    if 0 in expected:
        raise MeasurementError(f"{name}: empty (shape {expected}); measure at least one sample")
    channels = positions
    if transmit_positions is not None:
        if transmit_positions.shape != positions.shape:
            raise MeasurementError(
                f"{name}: {len(transmit_positions)} transmit positions for {expected[0]} receive "
                "positions; give one pair for each row of samples"
            )
        channels = np.concatenate([positions, transmit_positions], axis=1)
    arrays = {"samples": samples, "positions": channels, "frequencies": frequencies}
    for what, values in arrays.items():
        bad = np.count_nonzero(~np.isfinite(values))
        if bad:
            raise MeasurementError(
                f"{name}: {bad} of {values.size} {what} are NaN or infinite; "
                "a chunk may be missing: measure again or remove those rows"
            )
    if frequencies[0] <= 0 or np.any(np.diff(frequencies) <= 0):
        raise MeasurementError(f"{name}: frequencies must be positive and increasing; sort them")
    if len(np.unique(channels, axis=0)) < len(channels):
        raise MeasurementError(f"{name}: two positions coincide; keep one of each")
    if not np.any(samples):
        raise MeasurementError(f"{name}: all samples are zero; nothing was received")
