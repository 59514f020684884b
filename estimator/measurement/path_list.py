"""Paths that a channel sounder lists: directions at the base station, delays and levels."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.measurement.errors import MeasurementError

MOST_PATHS = 1000
"""Paths of one place of the user; more are no list of waves but samples of a channel. [-]"""


@dataclass(frozen=True, kw_only=True)
class PathList:
    """The paths of a user at one place, as the base station at the origin receives them.

    Examples
    --------
    >>> paths = PathList(
    ...     user="place 1", azimuth=np.array([1.2, 0.4]), delay=np.array([10e-9, 14e-9]),
    ...     angle_deviation=0.03, delay_deviation=0.2e-9,
    ... )
    >>> paths.directions.shape
    (2, 3)
    """

    user: str
    azimuth: Float[np.ndarray, " paths"]  # in the plane z = 0, from +x towards +y [rad]
    delay: Float[np.ndarray, " _"]  # on the base station's clock [s]
    angle_deviation: float  # standard deviation of azimuth and elevation [rad]
    delay_deviation: float  # standard deviation of the delays [s]
    elevation: Float[np.ndarray, " _"] | None = None
    """Above the plane z = 0; None: not measured, all is taken to lie in that plane. [rad]"""
    gain_db: Float[np.ndarray, " _"] | None = None
    """Received over transmitted power, of isotropic antennas where ``frequency`` is given. [dB]"""
    frequency: float | None = None  # centre of the band, if gains are calibrated [Hz]
    gain_deviation_db: float = 1.0  # standard deviation of the gains [dB]

    def __post_init__(self) -> None:
        """Refuse paths that no method could use."""
        count = self.azimuth.size
        for name, values in self._columns().items():
            if values.shape != (count,):
                raise MeasurementError(
                    f"paths of {self.user!r}: {values.size} values of {name} for {count} of "
                    "azimuth; give one for each path"
                )
            if not np.all(np.isfinite(values)):
                raise MeasurementError(
                    f"paths of {self.user!r}: {np.count_nonzero(~np.isfinite(values))} of {count} "
                    f"values of {name} are NaN or infinite; leave those paths out"
                )
        if not 1 <= count <= MOST_PATHS:
            raise MeasurementError(
                f"paths of {self.user!r}: {count} paths; a list has 1 to {MOST_PATHS}"
            )
        if self.elevation is not None and np.abs(self.elevation).max() > np.pi / 2:
            raise MeasurementError(
                f"paths of {self.user!r}: an elevation of "
                f"{np.degrees(np.abs(self.elevation).max()):.4g}° is beyond 90°; is it counted "
                "from the zenith?"
            )
        for name, value in (
            ("angle_deviation", self.angle_deviation),
            ("delay_deviation", self.delay_deviation),
            ("gain_deviation_db", self.gain_deviation_db),
        ):
            if not (np.isfinite(value) and value > 0):
                raise MeasurementError(
                    f"paths of {self.user!r}: {name} = {value:g}; it must be positive: "
                    "nothing is measured exactly"
                )

    @property
    def length(self) -> Float[np.ndarray, " paths"]:
        """Delays as lengths, on the base station's clock. [m]."""
        return np.asarray(self.delay * speed_of_light)

    @property
    def directions(self) -> Float[np.ndarray, "paths 3"]:
        """Unit vectors from the base station towards where the waves come from."""
        up = np.zeros(self.azimuth.size) if self.elevation is None else self.elevation
        flat = np.cos(up)
        return np.stack(
            [flat * np.cos(self.azimuth), flat * np.sin(self.azimuth), np.sin(up)], axis=-1
        )

    def _columns(self) -> dict[str, np.ndarray]:
        columns = {"azimuth": self.azimuth, "delay": self.delay}
        if self.elevation is not None:
            columns["elevation"] = self.elevation
        if self.gain_db is not None:
            columns["gain_db"] = self.gain_db
        return columns
