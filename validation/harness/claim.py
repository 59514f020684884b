"""A claim: the value by the thesis or theory, our measured figure, and its limits."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import Literal

from matplotlib.figure import Figure

Effort = Literal["quick", "full"]


@dataclass(frozen=True, kw_only=True)
class Row:
    """One figure of a claim."""

    name: str  # short description of the figure
    stated: str  # value by the thesis or theory
    measured: float
    unit: str = ""  # as it is printed: mm, °, dB; "" for a bare number
    low: float | None = None  # limits in that unit, both inclusive
    high: float | None = None
    origin: str  # origin of the limits

    def __post_init__(self) -> None:
        """Convert NumPy's numbers; refuse a row without limits, which cannot fail."""
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
        """The figure as text."""
        return f"{self.measured:.4g} {self.unit}".strip()

    @property
    def limits(self) -> str:
        """The limits as text."""
        unit = f" {self.unit}" if self.unit else ""
        if self.low is None:
            return f"≤ {self.high:.4g}{unit}"
        if self.high is None:
            return f"≥ {self.low:.4g}{unit}"
        return f"{self.low:.4g} … {self.high:.4g}{unit}"


@dataclass(frozen=True, kw_only=True)
class Finding:
    """Rows measured for a claim, and the function that draws them."""

    rows: Sequence[Row]
    draw: Callable[[Figure], None] | None = None
    remarks: Sequence[str] = field(default_factory=tuple)  # explanations that belong to the rows


Tell = Callable[[int, int], None]
"""Called with the number of steps done and in all."""


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A statement about the software that anyone can measure again."""

    key: str  # also the name of its files
    title: str
    source: str  # thesis' figure or equation, paper, or law of physics
    measure: Callable[[Effort, Tell], Finding]
    quick: bool = True  # whether it has a quick form; otherwise it runs in the full suite only
    minutes: float = 0.1  # approximate time of the full form on two cores
