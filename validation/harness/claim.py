"""A claim: what the thesis or theory says, what we measure, and how far apart they may be."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import Literal

from matplotlib.figure import Figure

Effort = Literal["quick", "full"]


@dataclass(frozen=True, kw_only=True)
class Row:
    """One figure of a claim."""

    name: str  # what was measured, in a few words
    stated: str  # what the thesis or theory says of it
    measured: float
    unit: str = ""  # as it is printed: mm, °, dB; "" for a bare number
    low: float | None = None  # limits in that unit, both inclusive
    high: float | None = None
    origin: str  # where the limits come from

    def __post_init__(self) -> None:
        """Take NumPy's numbers too; refuse a row that cannot fail."""
        for key in ("measured", "low", "high"):
            if getattr(self, key) is not None:
                object.__setattr__(self, key, float(getattr(self, key)))
        if self.low is None and self.high is None:
            raise ValueError(f"{self.name!r} has no limit; give low or high")

    @property
    def passed(self) -> bool:
        """Whether the figure is within its limits; NaN is not."""
        if not isfinite(self.measured):
            return False
        above = self.low is None or self.measured >= self.low
        return above and (self.high is None or self.measured <= self.high)

    @property
    def value(self) -> str:
        """The figure in words."""
        return f"{self.measured:.4g} {self.unit}".strip()

    @property
    def limits(self) -> str:
        """The limits in words."""
        unit = f" {self.unit}" if self.unit else ""
        if self.low is None:
            return f"≤ {self.high:.4g}{unit}"
        if self.high is None:
            return f"≥ {self.low:.4g}{unit}"
        return f"{self.low:.4g} … {self.high:.4g}{unit}"


@dataclass(frozen=True, kw_only=True)
class Finding:
    """What was measured for a claim, and how it is drawn."""

    rows: Sequence[Row]
    draw: Callable[[Figure], None] | None = None
    remarks: Sequence[str] = field(default_factory=tuple)  # explanations that belong to the rows


Tell = Callable[[int, int], None]
"""Told how many steps of how many are done."""


@dataclass(frozen=True, kw_only=True)
class Claim:
    """Something that a stranger should not have to believe."""

    key: str  # also its file's name
    title: str
    source: str  # the thesis' figure or equation, a paper, a law of physics
    measure: Callable[[Effort, Tell], Finding]
    quick: bool = True  # whether it has a quick form; others run in the full suite only
    minutes: float = 0.1  # of the full form, about, on two cores
