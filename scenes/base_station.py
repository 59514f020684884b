"""The base station: its array, where it stands and where it looks."""

from typing import Annotated

import numpy as np
from jaxtyping import Float
from pydantic import Field, PlainValidator, model_validator
from pydantic_core import PydanticCustomError

from scenes.antenna import Antenna, Isotropic
from scenes.directions import left_of, unit_vector
from scenes.quantities import Angle, Checked, Position

MOST_ELEMENTS = 65_536
"""Most elements of the array: 256 by 256."""


LONGEST_SPACING = 1e4
"""Longest distance of neighbouring elements [mm]."""

_SHORTEST_SPACING = 1e-3


def _one_or_two(value: object, *, whole: bool, low: float, high: float) -> list[int | float]:
    """Check one number, or a pair [along the axis, along z]."""
    entries = value if isinstance(value, list | tuple) else [value]
    kinds: tuple[type[int] | type[float], ...] = (int,) if whole else (int, float)
    numbers = [e for e in entries if isinstance(e, kinds) and not isinstance(e, bool)]
    fitting = len(entries) == 2 if isinstance(value, list | tuple) else True
    if len(numbers) != len(entries) or not fitting:
        raise PydanticCustomError(
            "one_or_two",
            "must be {what}, or a pair [along the axis, along z]; give one of them",
            {"what": "an integer" if whole else "a number"},
        )
    if not all(low <= number <= high for number in numbers):
        raise PydanticCustomError(
            "one_or_two_range",
            "must be from {low} to {high}; change it",
            {"low": f"{low:g}", "high": f"{high:g}"},
        )
    return numbers


def _elements(value: object) -> int | tuple[int, int]:
    counts = [int(n) for n in _one_or_two(value, whole=True, low=1.0, high=float(MOST_ELEMENTS))]
    return (counts[0], counts[1]) if len(counts) == 2 else counts[0]


def _spacing(value: object) -> float | tuple[float, float]:
    spacings = _one_or_two(value, whole=False, low=_SHORTEST_SPACING, high=LONGEST_SPACING)
    pair = [float(spacing) for spacing in spacings]
    return (pair[0], pair[1]) if len(pair) == 2 else pair[0]


class BaseStation(Checked):
    """The base station's array: a line along its axis, or in 3-D a plane of axis and z."""

    elements: Annotated[
        int | tuple[int, int], PlainValidator(_elements, json_schema_input_type=int | list[int])
    ] = Field(description="the number of elements, or [along the axis, along z]")
    spacing_mm: Annotated[
        float | tuple[float, float],
        PlainValidator(_spacing, json_schema_input_type=float | list[float]),
    ] = Field(
        description="the distance of neighbouring elements, or [along the axis, along z] [mm]"
    )
    position_m: Position = Field((0.0, 0.0, 0.0), description="the centre of the array [m]")
    boresight_deg: Angle = Field(
        90.0, description="the azimuth of the boresight from +x; the axis is 90° less [degree]"
    )
    antenna: Antenna = Field(default_factory=Isotropic, description="the elements' antenna")
    transmit_offset_m: Position | None = Field(
        None,
        description="from each element to the antenna that transmits its echo; without, the "
        "element itself [m]",
    )

    @model_validator(mode="after")
    def _spacing_fits_elements(self) -> "BaseStation":
        if isinstance(self.spacing_mm, tuple) and not isinstance(self.elements, tuple):
            raise PydanticCustomError(
                "spacing",
                "spacing_mm = {spacing} is a pair, but elements = {elements} is not; give one "
                "spacing, or a pair of elements",
                {"spacing": str(list(self.spacing_mm)), "elements": self.elements},
            )
        if self.element_count > MOST_ELEMENTS:
            raise PydanticCustomError(
                "elements",
                "{count} elements in all must be at most {limit}; reduce elements",
                {"count": self.element_count, "limit": MOST_ELEMENTS},
            )
        return self

    @property
    def element_count(self) -> int:
        """Number of elements in all."""
        along, up = self.shape
        return along * up

    @property
    def axis(self) -> Float[np.ndarray, " 3"]:
        """Unit vector along the array, 90° clockwise of the boresight."""
        return unit_vector(self.boresight_deg - 90.0)

    @property
    def boresight(self) -> Float[np.ndarray, " 3"]:
        """Unit vector across the array."""
        return left_of(self.axis)

    @property
    def element_positions(self) -> Float[np.ndarray, "elements 3"]:
        """Elements, centred at the position; along z first, then along the axis [m]."""
        along, up = (
            spacing * 1e-3 * (np.arange(count) - (count - 1) / 2)
            for count, spacing in zip(self.shape, self._spacings, strict=True)
        )
        offsets = along[:, None, None] * self.axis + up[None, :, None] * np.array([0.0, 0.0, 1.0])
        positions: np.ndarray = np.asarray(self.position_m) + offsets.reshape(-1, 3)
        return positions

    @property
    def transmit_offset(self) -> Float[np.ndarray, " 3"] | None:
        """From each element to the antenna that transmits its echo; None: itself [m].

        What leaks from one to the other is not modelled: a measured sweep is calibrated for it.
        """
        offset = self.transmit_offset_m
        return None if offset is None else np.array(offset, dtype=np.float64)

    @property
    def shape(self) -> tuple[int, int]:
        """Number of elements along the axis and along z."""
        return self.elements if isinstance(self.elements, tuple) else (self.elements, 1)

    @property
    def _spacings(self) -> tuple[float, float]:
        spacing = self.spacing_mm
        return spacing if isinstance(spacing, tuple) else (spacing, spacing)
