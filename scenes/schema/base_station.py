"""The base station: its array, where it stands and where it looks."""

from typing import Annotated

import numpy as np
from jaxtyping import Float
from pydantic import ConfigDict, Field, PlainValidator, model_validator
from pydantic.config import JsonDict
from pydantic_core import PydanticCustomError

from scenes.schema.antenna import Antenna, Isotropic
from scenes.schema.directions import left_of, unit_vector
from scenes.schema.multistatic import Receivers, Transmitter
from scenes.schema.quantities import Angle, Checked, Position

MOST_ELEMENTS = 65_536
"""Most elements of the array: 256 by 256."""


LONGEST_SPACING = 1e4
"""Longest distance of neighbouring elements [mm]."""

_SHORTEST_SPACING = 1e-3
"""Shortest distance of neighbouring elements, a thousandth of λ at 300 GHz [mm]."""


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


_ARRAY_OR_RECEIVERS: JsonDict = {
    "anyOf": [{"required": ["elements", "spacing_mm"]}, {"required": ["receivers"]}]
}


class BaseStation(Checked):
    """The base station's array: a line along its axis, or in 3-D a plane of axis and z.

    In place of an array, receivers may stand by themselves; then each looks at the antenna's
    aim for itself, whereas the elements of an array look in parallel.
    """

    model_config = ConfigDict(json_schema_extra=_ARRAY_OR_RECEIVERS)

    elements: (
        Annotated[
            int | tuple[int, int], PlainValidator(_elements, json_schema_input_type=int | list[int])
        ]
        | None
    ) = Field(None, description="the number of elements, or [along the axis, along z]")
    spacing_mm: (
        Annotated[
            float | tuple[float, float],
            PlainValidator(_spacing, json_schema_input_type=float | list[float]),
        ]
        | None
    ) = Field(
        None, description="the distance of neighbouring elements, or [along the axis, along z] [mm]"
    )
    receivers: Receivers | None = Field(
        None, description="in place of elements: where receivers stand, on an arc or a list"
    )
    transmitter: Transmitter | None = Field(
        None, description="what transmits the echo, where that is not the element itself"
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
    def _an_array_or_receivers(self) -> "BaseStation":
        if self.receivers is None:
            found = [
                f"base_station.{key}: missing; give {field.description}"
                for key, field in type(self).model_fields.items()
                if key in ("elements", "spacing_mm") and getattr(self, key) is None
            ]
        else:
            found = [
                f"base_station.{key} = {value}: base_station.receivers say where they stand; "
                f"remove {key}, or the receivers"
                for key in ("elements", "spacing_mm")
                if (value := getattr(self, key)) is not None
            ]
            if any(self.position_m):
                found.append(
                    f"base_station.position_m = {list(self.position_m)}: base_station.receivers "
                    "say where they stand; remove position_m"
                )
        if found:
            raise PydanticCustomError("array", "array", {"problems": found})
        return self

    @model_validator(mode="after")
    def _one_kind_of_transmitter(self) -> "BaseStation":
        if self.transmitter is None:
            return self
        if self.transmit_offset_m is not None:
            raise PydanticCustomError(
                "transmitter",
                "has both transmitter and transmit_offset_m; keep one of them",
            )
        places = len(self.transmitter.positions)
        if places not in (1, self.element_count):
            raise PydanticCustomError(
                "transmitter",
                "transmitter.positions_m has {places} places for {count} receivers; give one "
                "for each, or a single position_m",
                {"places": places, "count": self.element_count},
            )
        return self

    @model_validator(mode="after")
    def _channels_differ(self) -> "BaseStation":
        if self.receivers is None:
            return self
        places = self.element_positions
        senders = self.transmit_positions(places)
        channels = places if senders is None else np.concatenate([places, senders], axis=1)
        known, first = np.unique(channels, axis=0, return_index=True)
        if len(known) < len(channels):
            twice = np.setdiff1d(np.arange(len(channels)), first)[0]
            raise PydanticCustomError(
                "channels",
                "receivers[{index}] stands where another does, with the same transmitter; move "
                "or remove it",
                {"index": int(twice)},
            )
        return self

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
        """Number of elements (or receivers) in all."""
        along, up = self.shape
        return along * up

    @property
    def multistatic(self) -> bool:
        """Whether antennas stand by themselves, not as an array that hears its own echo."""
        return self.receivers is not None or self.transmitter is not None

    @property
    def centre(self) -> Float[np.ndarray, " 3"]:
        """Centre of the array, or the mean of the receivers [m]."""
        if self.receivers is None:
            return np.array(self.position_m, dtype=np.float64)
        return np.array(self.element_positions.mean(axis=0))

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
        """Receivers, or elements about the position, along z first, then along the axis [m]."""
        if self.receivers is not None:
            return self.receivers.positions
        along, up = (
            spacing * 1e-3 * (np.arange(count) - (count - 1) / 2)
            for count, spacing in zip(self.shape, self._spacings, strict=True)
        )
        offsets = along[:, None, None] * self.axis + up[None, :, None] * np.array([0.0, 0.0, 1.0])
        positions: np.ndarray = np.asarray(self.position_m) + offsets.reshape(-1, 3)
        return positions

    def transmit_positions(
        self, elements: Float[np.ndarray, "elements 3"]
    ) -> Float[np.ndarray, "elements 3"] | None:
        """Place the antenna that transmits the echo of each element; None: itself [m].

        Parameters
        ----------
        elements
            Where the elements stand. A transmitter beside them moves with them. [m]
        """
        if self.transmitter is not None:
            return np.array(np.broadcast_to(self.transmitter.positions, elements.shape))
        offset = self.transmit_offset
        return None if offset is None else elements + offset

    @property
    def transmit_antenna(self) -> Antenna:
        """The transmitter's antenna."""
        own = None if self.transmitter is None else self.transmitter.antenna
        return self.antenna if own is None else own

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
        if self.receivers is not None:
            return len(self.receivers.positions), 1
        elements = self.elements or 1
        return elements if isinstance(elements, tuple) else (elements, 1)

    @property
    def _spacings(self) -> tuple[float, float]:
        spacing = self.spacing_mm or 0.0
        return spacing if isinstance(spacing, tuple) else (spacing, spacing)
