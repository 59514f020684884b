"""How the keys that vary from sample to sample are stored: their data type and unit."""

from dataclasses import dataclass
from typing import Literal

from scenes.sampling.distributions import Drawn, Stepped


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A key that varies, as it is stored."""

    key: str
    kind: Literal["number", "position", "text"]
    unit: str | None  # None: it has none, or is no number


_UNITS = {
    "m": "m",
    "mm": "mm",
    "m2": "m2",
    "deg": "degree",
    "rad": "rad",
    "db": "dB",
    "dbi": "dBi",
    "dbsm": "dBsm",
    "ghz": "GHz",
    "ns": "ns",
}


def parameter_of(key: str, drawn: Drawn | Stepped) -> Parameter:
    """Tell how the values of a key are stored, by what they may be and by its name's unit."""
    values = drawn.extremes()
    unit = _UNITS.get(key.rpartition("_")[2], "1")
    if all(_is_number(value) for value in values):
        return Parameter(key=key, kind="number", unit=unit)
    if all(_is_position(value) for value in values):
        return Parameter(key=key, kind="position", unit=unit)
    return Parameter(key=key, kind="text", unit=None)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_position(value: object) -> bool:
    return (
        isinstance(value, list | tuple)
        and len(value) in (2, 3)
        and all(_is_number(entry) for entry in value)
    )
