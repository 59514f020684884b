"""Where a table's numbers come from: a variable, a file, one entry of an axis, or one number."""

from typing import Annotated, Any

from pydantic import BeforeValidator, Field, model_validator

from scenes.schema.quantities import Checked

FREQUENCY_UNITS = {"Hz": 1.0, "kHz": 1e3, "MHz": 1e6, "GHz": 1e9, "THz": 1e12}
LENGTH_UNITS = {
    "m": 1.0,
    "cm": 1e2,
    "mm": 1e3,
    "um": 1e6,
    "in": 1 / 0.0254,
    "mil": 1 / 0.0254e-3,
    "ft": 1 / 0.3048,
}
TIME_UNITS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9, "ps": 1e12, "fs": 1e15}
"""Factors to hertz; divisors to metres and seconds (0.5/1000 is the double nearest to 0.0005)."""

Name = Annotated[str, Field(min_length=1)]
Vector = Annotated[list[float], Field(min_length=3, max_length=3)]
Entries = dict[str, Annotated[int, Field(ge=0)]]


class SourceTable(Checked):
    """A variable (or column), its file if it is not the table's, and what is taken of its axes."""

    variable: Name | None = Field(default=None, description="its variable or column")
    file: Name | None = Field(default=None, description="its file, if it is not SOURCE")
    take: Entries = Field(
        default={}, description="which entry of each other axis is taken, as { run = 0 }"
    )


class CoordinateTable(Checked):
    """A coordinate of positions: a variable (perhaps of another file), or one number for all."""

    variable: Name | None = Field(default=None, description="its variable or column")
    file: Name | None = Field(default=None, description="its file, if it is not SOURCE")
    value: float | None = Field(default=None, description="one number for all positions")

    @model_validator(mode="after")
    def _one(self) -> "CoordinateTable":
        if (self.value is None) == (self.variable is None and self.file is None):
            raise ValueError("give a variable, a file or both, or one number for all positions")
        return self


def _source(value: Any) -> Any:
    return {"variable": value} if isinstance(value, str) else value


def _coordinate(value: Any) -> Any:
    if isinstance(value, str):  # these files have no names: "x.npy" can only be the file
        alone = value.lower().endswith((".npy", ".txt", ".dat", ".asc"))
        return {"file" if alone else "variable": value}
    if isinstance(value, int | float) and not isinstance(value, bool):
        return {"value": float(value)}
    return value


Source = Annotated[SourceTable, BeforeValidator(_source, json_schema_input_type=Name | SourceTable)]
"""``"name"``, or ``{ variable = "name", file = "other.npz", take = { iq = 1 } }``."""

Coordinate = Annotated[
    CoordinateTable,
    BeforeValidator(_coordinate, json_schema_input_type=Name | float | CoordinateTable),
]
"""``"name"``, ``12.5``, ``"x.npy"``, or ``{ file = "grid.npz", variable = "x" }``."""
