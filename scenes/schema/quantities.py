"""Checked quantities of a scenario file: positions, sizes and names, with their limits."""

from collections.abc import Sequence
from typing import Annotated

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

FARTHEST = 1000.0
"""Largest coordinate and size; beyond, double precision phases at 1 THz lose 1e-6 rad [m]."""

THINNEST = 1e-5
"""Smallest size of an object: a tenth of the wavelength at 3 THz [m]."""

FORBIDDEN_IN_NAMES = "./\\=\"'[]"

LONGEST_NAME = 64
"""Most characters of a name. [-]"""
"""Signs that a name must not hold: it is part of dotted keys and of file names."""


class Checked(BaseModel):
    """Base of all scenario tables: strict, frozen, and without unknown keys."""

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid", allow_inf_nan=False)


def _three_coordinates(value: object) -> tuple[object, ...]:
    if (
        not isinstance(value, Sequence)
        or isinstance(value, str | bytes)
        or len(value) not in (2, 3)
    ):
        raise PydanticCustomError(
            "position", "must be a position in metres; give it as [x, y] or [x, y, z]"
        )
    return (*value, 0.0) if len(value) == 2 else tuple(value)


def _name(value: str) -> str:
    if not value:
        raise PydanticCustomError("name", "must not be empty; give it a name, such as 'wall'")
    bad = [sign for sign in value if sign in FORBIDDEN_IN_NAMES or not sign.isprintable()]
    if bad or value != value.strip() or len(value) > LONGEST_NAME:
        raise PydanticCustomError(
            "name",
            "must have at most {longest} printable characters, none of {signs} and no space at its "
            "ends (it is part of keys and file names); rename it",
            {"signs": " ".join(FORBIDDEN_IN_NAMES), "longest": LONGEST_NAME},
        )
    return value


Coordinate = Annotated[float, Field(ge=-FARTHEST, le=FARTHEST)]

Position = Annotated[
    tuple[Coordinate, Coordinate, Coordinate],
    BeforeValidator(
        _three_coordinates,
        json_schema_input_type=Annotated[list[Coordinate], Field(min_length=2, max_length=3)],
    ),
]
"""[x, y] or [x, y, z]; always three coordinates inside [m]."""

Angle = Annotated[float, Field(ge=-360.0, le=360.0)]
"""[degree]"""

Size = Annotated[float, Field(ge=THINNEST, le=FARTHEST)]
"""Length, height, depth or radius of an object [m]."""

Name = Annotated[str, AfterValidator(_name)]
"""Name of a scenario, an object or a user: part of keys, streams and file names."""
