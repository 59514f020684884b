"""Attributes of a measurement file, checked: they may come from anybody."""

from dataclasses import asdict
from pathlib import Path

import numpy as np

from estimator.measurement.air import Air
from estimator.measurement.errors import MeasurementError
from estimator.measurement.guarded_store import shortened

AIR_KEYS = {f"air_{name}": name for name in Air.__dataclass_fields__}
"""Attributes that tell the air, and the quantities that they hold."""

AIR_VARIABLES = tuple((key, key) for key in AIR_KEYS)
"""Variables of a dataset whose samples differ in it, and the attributes that they stand for."""

_MOST_DIGITS = 30  # of a number that a message shows


def unit_boresight(path: Path, value: object) -> np.ndarray:
    """Read the direction in which the array looks: a unit vector.

    Raises
    ------
    MeasurementError
        If it is something else.
    """
    try:
        boresight = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        boresight = np.zeros(0)
    if boresight.shape != (3,) or not abs(np.linalg.norm(boresight) - 1) < 1e-6:
        raise MeasurementError(
            f"{path}: boresight = {shortened(repr(value))}; it must be a unit vector [x, y, z]"
        )
    return boresight


def finite_number(path: Path, attributes: dict[str, object], key: str) -> float | None:
    """Read a number, or None where the attribute is missing.

    Raises
    ------
    MeasurementError
        If it is something else.
    """
    value = attributes.get(key)
    if value is None:
        return None
    try:
        number = float(value) if isinstance(value, int | float) else np.nan
    except OverflowError:  # a whole number of some hundred digits
        number = np.inf
    if isinstance(value, bool) or not np.isfinite(number):
        raise MeasurementError(f"{path}: {key} = {_shown(value)}; it must be a finite number")
    return number


def air_attributes(air: Air | None) -> dict[str, float]:
    """Return the attributes that tell the air; none of vacuum."""
    values = {} if air is None else asdict(air)
    return {key: values[name] for key, name in AIR_KEYS.items() if name in values}


def read_air(path: Path, attributes: dict[str, object]) -> Air | None:
    """Read the air, or None where nothing tells it; what is left out of it is a room's.

    Raises
    ------
    MeasurementError
        If a value is no number, or none that air can have.
    """
    told = {name: finite_number(path, attributes, key) for key, name in AIR_KEYS.items()}
    given = {name: value for name, value in told.items() if value is not None}
    if not given:
        return None
    try:
        return Air(**given)
    except MeasurementError as error:
        raise MeasurementError(f"{path}: {error}") from None


def whole_seed(path: Path, attributes: dict[str, object]) -> int | None:
    """Read the seed, or None where there is none: a whole number of at most 63 bits.

    Raises
    ------
    MeasurementError
        If it is something else.
    """
    value = attributes.get("seed")
    if value is None:
        return None
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if isinstance(value, bool) or not isinstance(value, int) or abs(value) >= 2**63:
        raise MeasurementError(
            f"{path}: seed = {_shown(value)}; it must be a whole number of at most 63 bits"
        )
    return value


def _shown(value: object) -> str:
    if isinstance(value, int) and abs(value) >= 10**_MOST_DIGITS:
        return f"a whole number of more than {_MOST_DIGITS} digits"  # Python writes no huge ones
    return shortened(repr(value))
