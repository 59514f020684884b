"""The measurement of the Python interface: data, and beside them the ground truth if known.

The estimator's own data model has no field for the truth: :func:`mmslam.locate` passes on only
the data, by :meth:`Measurement.without_truth`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Complex, Float
from numpy.typing import ArrayLike

from estimator.measurement import model
from estimator.measurement.air import Air
from estimator.measurement.model import Echo, MeasurementError, PathList, Uplink, Waves
from estimator.measurement.store import measurement_to_dataset
from mmslam.table import Table, html, text
from validation.metrics.truth import Truth, read_truth_dataset, truth_from_dataset

__all__ = ["Air", "Echo", "Measurement", "PathList", "TruthFile", "Uplink"]

USER = "user"
"""Default name of the user of a single pilot."""


@dataclass(frozen=True, kw_only=True)
class TruthFile:
    """Reference to the truth in a measurement file; read on first access."""

    store: Path
    sample: int | None = None

    def read(self) -> xr.Dataset | None:
        """Read it; None if the store holds none."""
        return read_truth_dataset(self.store, sample=self.sample)


@dataclass(frozen=True, kw_only=True, repr=False)
class Measurement(model.Measurement):
    """Echo and uplinks of one array, and beside them, where it is known, the truth.

    Conventions: SI; exp(+jωt), so that a delay τ appears as exp(−j2πfτ); x along the array, y its
    boresight, z up.

    Examples
    --------
    >>> import numpy as np
    >>> positions = 0.5e-3 * np.arange(-20, 20)  # [m], along the array
    >>> frequencies = np.linspace(220e9, 240e9, 41)  # [Hz]
    >>> delay = 2 * np.hypot(positions - 0.03, 0.4) / 299792458  # of one point, there and back [s]
    >>> measurement = Measurement.from_arrays(
    ...     frequencies=frequencies,
    ...     positions=positions,
    ...     echo=np.exp(-2j * np.pi * delay[:, None] * frequencies),
    ... )
    >>> measurement
    measurement: echo
    positions    40 over 19.5 mm
    frequencies  41 from 220 to 240 GHz
    clock        unknown
    truth        unknown
    """

    beside: xr.Dataset | TruthFile | None = None  # the truth; the estimator is never given it
    notes: tuple[str, ...] = ()  # remarks on implausible data at import

    @classmethod
    def of(
        cls,
        measurement: model.Measurement,
        *,
        beside: xr.Dataset | TruthFile | None = None,
        notes: Sequence[str] = (),
    ) -> "Measurement":
        """Put the truth beside a measurement."""
        return cls(**_parts(measurement), beside=beside, notes=tuple(notes))

    @classmethod
    def from_arrays(
        cls,
        *,
        frequencies: ArrayLike,
        positions: ArrayLike,
        echo: ArrayLike | None = None,
        uplink: ArrayLike | Mapping[str, ArrayLike] | None = None,
        element_positions: ArrayLike | None = None,
        transmit_positions: ArrayLike | None = None,
        waves: Waves = "spherical",
        boresight: Sequence[float] = (0.0, 1.0, 0.0),
        clock_offset: float | None = None,
        scenario: str | None = None,
        air: Air | None = None,
        medium_index: float | None = None,
    ) -> "Measurement":
        """Make a measurement of plain arrays: your own sweep.

        Parameters
        ----------
        frequencies
            In equal steps, shape (freqs,). [Hz]
        positions
            Phase centres of the receiver, shape (positions, 3), or (positions,) along x. [m]
        echo
            Complex S-parameters, shape (positions, freqs).
        uplink
            The pilot of one user, shape (elements, freqs), or of several by name.
        element_positions
            Where the uplinks were received, if not at ``positions``; likewise. [m]
        transmit_positions
            Where the echo's transmitter stood, if apart; likewise. [m]
        waves, boresight, clock_offset, scenario
            As in the measurement file: ``clock_offset`` [s] is the user's clock minus ours, None
            where it is unknown.
        air
            That the waves ran in; None: vacuum, or another medium.
        medium_index
            Refractive index of that medium. [-]

        Raises
        ------
        MeasurementError
            If shapes do not match, or values are not finite; the message says what to change.
        """
        where = _places(positions, "positions")
        heard = where
        if element_positions is not None:
            heard = _places(element_positions, "element_positions")
        apart = None
        if transmit_positions is not None:
            apart = _places(transmit_positions, "transmit_positions")
        grid = np.asarray(frequencies, dtype=np.float64)
        pilots = uplink if isinstance(uplink, Mapping) else {USER: uplink}
        return cls(
            echo=None
            if echo is None
            else Echo(
                samples=_samples(echo),
                positions=where,
                frequencies=grid,
                transmit_positions=apart,
            ),
            uplinks=tuple(
                Uplink(samples=_samples(pilot), positions=heard, frequencies=grid, user=name)
                for name, pilot in pilots.items()
                if pilot is not None
            ),
            waves=waves,
            boresight=np.asarray(boresight, dtype=np.float64),
            clock_offset=clock_offset,
            scenario=scenario,
            air=air,
            medium_index=medium_index,
        )

    def without_truth(self) -> model.Measurement:
        """Return the data without the truth, as the estimator gets them."""
        return model.Measurement(**_parts(self))

    def to_xarray(self) -> xr.Dataset:
        """Return the measurement as the measurement file holds it, without the truth."""
        return measurement_to_dataset(self.without_truth())

    @cached_property
    def truth_dataset(self) -> xr.Dataset | None:
        """The ground truth as a dataset, with the true paths; None if it is unknown."""
        return self.beside.read() if isinstance(self.beside, TruthFile) else self.beside

    @cached_property
    def truth(self) -> Truth:
        """Where users, walls and targets really are, by name; empty where it is not known."""
        return truth_from_dataset(self.truth_dataset)

    def table(self) -> Table:
        """Return what it holds, in a few rows."""
        measured = self.echo or next(iter(self.uplinks), None)
        users = [uplink.user for uplink in self.uplinks]
        held = ["echo"] if self.echo else []
        held += [f"uplink{'s' if len(users) > 1 else ''} of {', '.join(users)}"] if users else []
        listed = sum(one.azimuth.size for one in self.path_lists)
        held += [f"{listed} paths of {len(self.path_lists)} places"] if listed else []
        sweep = []
        if measured is not None:
            size = 1e3 * float(np.linalg.norm(np.ptp(measured.positions, axis=0)))
            low, high = 1e-9 * measured.frequencies[[0, -1]]
            sweep = [
                ("positions", f"{len(measured.positions)} over {size:.4g} mm"),
                ("frequencies", f"{measured.frequencies.size} from {low:.5g} to {high:.5g} GHz"),
            ]
        clock = "unknown" if self.clock_offset is None else f"{1e9 * self.clock_offset:g} ns off"
        medium = [] if self.air is None else [("air", str(self.air))]
        if self.medium_index is not None:
            medium = [("medium", f"of index {self.medium_index:g}")]
        rows = [
            *sweep,
            *medium,
            ("clock", clock if self.clock_offset else clock.replace("0 ns off", "shared")),
            ("truth", "unknown" if self.beside is None else "beside it"),
            *(("note", note) for note in self.notes),
        ]
        name = self.scenario or "measurement"
        seed = "" if self.seed is None else f", seed {self.seed}"
        return Table(title=f"{name}{seed}: {', '.join(held)}", rows=tuple(rows))

    def __repr__(self) -> str:
        """Show what it holds, not its samples."""
        return text([self.table()])

    def _repr_html_(self) -> str:
        return html([self.table()])


def _parts(measurement: model.Measurement) -> dict[str, Any]:
    return {one.name: getattr(measurement, one.name) for one in fields(model.Measurement)}


def _samples(given: ArrayLike) -> Complex[np.ndarray, "..."]:
    return np.asarray(given, dtype=np.complex128)


def _places(given: ArrayLike, name: str) -> Float[np.ndarray, "positions 3"]:
    places = np.asarray(given, dtype=np.float64)
    if places.ndim == 1:
        return np.stack([places, np.zeros_like(places), np.zeros_like(places)], axis=1)
    if places.ndim != 2 or places.shape[1] != 3:
        raise MeasurementError(
            f"{name} have shape {places.shape}; give (positions, 3) coordinates in metres, or one "
            "number for each position along x"
        )
    return places
