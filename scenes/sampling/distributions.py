"""Distributions of a scenario's keys: what a dataset or a sweep draws, and from what range.

Each draws one value from a generator. ``grid`` and ``list`` draw nothing: their values are gone
through in turn, by the sample's number.
"""

from typing import Annotated, Any, Literal

import numpy as np
from jaxtyping import Float
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from scenes.schema.errors import ScenarioError
from scenes.schema.quantities import Checked, Position

Number = Annotated[float, Field(ge=-1e12, le=1e12)]

MOST_VALUES = 100_000
"""Most values that a choice, a grid or a list may have."""

Values = Annotated[tuple[Any, ...], Field(strict=False, min_length=1, max_length=MOST_VALUES)]

_PROBES = 4000  # of a polygon's box: none inside, though 1 in 1000 is, has a chance of 0.02
_MOST_TRIES_INSIDE = 300_000  # seconds; at one in 10 000 inside, they fail once in e^30
_MOST_TRIES = 10_000  # of a truncated normal distribution; it keeps at least 1 % (see below)

LEAST_KEPT = 0.01
"""Share of a truncated distribution that its limits must keep: draws are repeated until one is
within them, a hundred times on average at most. [-]"""

LEAST_FILLED = 1e-3
"""Share of the box around a polygon that must be inside: points are drawn in the box until one is,
a thousand times on average at most. [-]"""


class Uniform(Checked):
    """Uniform distribution of real numbers over a range."""

    kind: Literal["uniform"]
    low: Number = Field(description="the smallest value")
    high: Number = Field(description="the largest value")

    @model_validator(mode="after")
    def _a_range(self) -> "Uniform":
        _check_range(self.low, self.high)
        return self

    def draw(self, rng: np.random.Generator) -> float:
        """Draw a value."""
        return float(rng.uniform(self.low, self.high))

    def extremes(self) -> tuple[object, ...]:
        """Return values that any draw lies between."""
        return self.low, self.high


class UniformInteger(Checked):
    """Uniform distribution of integers over a range, its ends included."""

    kind: Literal["uniform_integer"]
    low: int = Field(ge=-(2**53), le=2**53, description="the smallest value")
    high: int = Field(ge=-(2**53), le=2**53, description="the largest value")

    @model_validator(mode="after")
    def _a_range(self) -> "UniformInteger":
        _check_range(self.low, self.high)
        return self

    def draw(self, rng: np.random.Generator) -> int:
        """Draw a value."""
        return int(rng.integers(self.low, self.high, endpoint=True))

    def extremes(self) -> tuple[object, ...]:
        """Return values that any draw lies between."""
        return self.low, self.high


class LogUniform(Checked):
    """Log-uniform distribution over a range: each octave is equally likely."""

    kind: Literal["log_uniform"]
    low: Annotated[float, Field(gt=0, le=1e12)] = Field(description="the smallest value, above 0")
    high: Annotated[float, Field(gt=0, le=1e12)] = Field(description="the largest value")

    @model_validator(mode="after")
    def _a_range(self) -> "LogUniform":
        _check_range(self.low, self.high)
        return self

    def draw(self, rng: np.random.Generator) -> float:
        """Draw a value."""
        value = float(np.exp(rng.uniform(np.log(self.low), np.log(self.high))))
        return min(max(value, self.low), self.high)  # the exponential may round beyond an end

    def extremes(self) -> tuple[object, ...]:
        """Return values that any draw lies between."""
        return self.low, self.high


class Normal(Checked):
    """Normal distribution, truncated at ``low`` and ``high`` where they are given."""

    kind: Literal["normal"]
    mean: Number = Field(description="the mean before it is cut off")
    deviation: Annotated[float, Field(gt=0, le=1e12)] = Field(
        description="the standard deviation before it is cut off"
    )
    low: Number | None = Field(None, description="the smallest value [none]")
    high: Number | None = Field(None, description="the largest value [none]")

    @model_validator(mode="after")
    def _keeps_enough(self) -> "Normal":
        low = -np.inf if self.low is None else self.low
        high = np.inf if self.high is None else self.high
        if low >= high:
            raise PydanticCustomError(
                "range", "low = {low} must be below high = {high}", {"low": low, "high": high}
            )
        # Probability within the limits, on a fine grid of ±8 deviations: rejection must end soon.
        steps = np.linspace(-8.0, 8.0, 16_001)
        density = np.exp(-0.5 * steps**2)
        kept = (self.mean + self.deviation * steps >= low) & (
            self.mean + self.deviation * steps <= high
        )
        if density[kept].sum() < LEAST_KEPT * density.sum():
            raise PydanticCustomError(
                "range",
                "low and high keep less than 1 % of the distribution; widen them, or use a "
                "uniform one",
            )
        return self

    def draw(self, rng: np.random.Generator) -> float:
        """Draw a value; what is cut off is drawn again."""
        low = -np.inf if self.low is None else self.low
        high = np.inf if self.high is None else self.high
        for _ in range(_MOST_TRIES):
            value = float(rng.normal(self.mean, self.deviation))
            if low <= value <= high:
                return value
        raise AssertionError("unreachable: at least 1 % is kept")  # 0.99^10000 = 2e-44

    def extremes(self) -> tuple[object, ...]:
        """Return values that any draw lies between, or three deviations where it is open."""
        low = self.mean - 3 * self.deviation if self.low is None else self.low
        high = self.mean + 3 * self.deviation if self.high is None else self.high
        return low, high


class Choice(Checked):
    """Discrete distribution: one of a few values, equally likely or weighted."""

    kind: Literal["choice"]
    values: Values = Field(description="the values to choose from")
    weights: Annotated[tuple[Annotated[float, Field(ge=0)], ...], Field(strict=False)] | None = (
        Field(None, description="how often each is chosen, in proportion [alike]")
    )

    @model_validator(mode="after")
    def _a_weight_for_each(self) -> "Choice":
        if self.weights is None:
            return self
        if len(self.weights) != len(self.values) or sum(self.weights) <= 0:
            raise PydanticCustomError(
                "weights",
                "{weights} weights for {values} values; give one for each, and not all 0",
                {"weights": len(self.weights), "values": len(self.values)},
            )
        return self

    def draw(self, rng: np.random.Generator) -> object:
        """Draw a value."""
        weights = np.ones(len(self.values)) if self.weights is None else np.array(self.weights)
        # Not by Generator.choice: NumPy may change how it uses the random stream.
        place = np.searchsorted(np.cumsum(weights) / weights.sum(), rng.random(), side="right")
        return self.values[min(int(place), len(self.values) - 1)]

    def extremes(self) -> tuple[object, ...]:
        """Return all values."""
        return self.values


class Grid(Checked):
    """Values of one axis of a full grid: every combination with the other grids is used."""

    kind: Literal["grid"]
    values: Values = Field(description="the values to go through")

    def extremes(self) -> tuple[object, ...]:
        """Return all values."""
        return self.values


class Listed(Checked):
    """Values used in step with those of the other lists: the first with the first, and so on."""

    kind: Literal["list"]
    values: Values = Field(description="the values to go through, beside the other lists'")

    def extremes(self) -> tuple[object, ...]:
        """Return all values."""
        return self.values


class InBox(Checked):
    """A position, uniformly distributed in an axis-aligned box."""

    kind: Literal["in_box"]
    low_m: Position = Field(description="the corner of the smallest coordinates [m]")
    high_m: Position = Field(description="the corner of the largest coordinates [m]")

    @model_validator(mode="after")
    def _a_box(self) -> "InBox":
        if any(high < low for low, high in zip(self.low_m, self.high_m, strict=True)):
            raise PydanticCustomError(
                "box",
                "a coordinate of low_m = {low} exceeds that of high_m = {high}; swap them",
                {"low": str(list(self.low_m)), "high": str(list(self.high_m))},
            )
        return self

    def draw(self, rng: np.random.Generator) -> list[float]:
        """Draw a position. [m]."""
        return [float(v) for v in rng.uniform(self.low_m, self.high_m)]

    def extremes(self) -> tuple[object, ...]:
        """Return two corners. [m]."""
        return list(self.low_m), list(self.high_m)


class InPolygon(Checked):
    """A position, uniformly distributed over a polygon in the xy plane and between two heights."""

    kind: Literal["in_polygon"]
    corners_m: Annotated[
        tuple[Position, ...], Field(strict=False, min_length=3, max_length=1000)
    ] = Field(description="the corners [x, y] in order [m]")
    low_z_m: float = Field(0.0, ge=-1000, le=1000, description="the lowest height [m]")
    high_z_m: float = Field(0.0, ge=-1000, le=1000, description="the largest height [m]")

    @model_validator(mode="after")
    def _has_an_inside(self) -> "InPolygon":
        if self.low_z_m > self.high_z_m:
            _check_range(self.low_z_m, self.high_z_m)
        corners = self._plan
        size = np.ptp(corners, axis=0).prod()
        # Of a random point of the box around it, at least one in a thousand must be inside.
        # The area alone does not tell: a self-crossing outline, run twice, has no interior.
        few = np.random.default_rng(0).uniform(
            corners.min(axis=0), corners.max(axis=0), size=(_PROBES, 2)
        )
        if (
            abs(_signed_area(corners)) < LEAST_FILLED * size
            or size == 0
            or not any(_inside(float(x), float(y), corners) for x, y in few)
        ):
            raise PydanticCustomError(
                "polygon", "the corners enclose (almost) nothing; give them in order around it"
            )
        return self

    @property
    def _plan(self) -> Float[np.ndarray, "corners 2"]:
        return np.array(self.corners_m, dtype=np.float64)[:, :2]

    def draw(self, rng: np.random.Generator) -> list[float]:
        """Draw a position. [m]."""
        corners = self._plan
        low, high = corners.min(axis=0), corners.max(axis=0)
        for _ in range(_MOST_TRIES_INSIDE):
            x, y = (float(v) for v in rng.uniform(low, high))
            if _inside(x, y, corners):
                return [x, y, float(rng.uniform(self.low_z_m, self.high_z_m))]
        raise ScenarioError("corners_m enclose (almost) nothing; give them in order around it")

    def extremes(self) -> tuple[object, ...]:
        """Return the corners. [m]."""
        heights = {self.low_z_m, self.high_z_m}
        return tuple([x, y, z] for x, y in self._plan.tolist() for z in sorted(heights))


Drawn = Uniform | UniformInteger | LogUniform | Normal | Choice | InBox | InPolygon
Stepped = Grid | Listed
Distribution = Annotated[Drawn | Stepped, Field(discriminator="kind")]


def _check_range(low: float, high: float) -> None:
    if low > high:
        raise PydanticCustomError(
            "range",
            "low = {low} must not exceed high = {high}; swap them",
            {"low": low, "high": high},
        )


def _signed_area(corners: Float[np.ndarray, "corners 2"]) -> float:
    x, y = corners.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def _inside(x: float, y: float, corners: Float[np.ndarray, "corners 2"]) -> bool:
    """Tell whether a ray from the point along +x crosses the outline an odd number of times."""
    (x0, y0), (x1, y1) = corners.T, np.roll(corners, -1, axis=0).T
    crosses = (y0 > y) != (y1 > y)
    rise = np.where(crosses, y1 - y0, 1.0)
    where = x0 + (y - y0) / rise * (x1 - x0)
    return bool(np.count_nonzero(crosses & (x < where)) % 2)
