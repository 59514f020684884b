"""The variables of a dataset: dimensions, types, units and descriptions."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from estimator.measurement.store import PARAMETERS, TRUTH
from scenes.sampling.sample_space import SampleSpace
from scenes.scenario import Scenario
from simulator.dataset.config import DatasetConfig

MADE, FAILED = 0, 1
"""Status of a sample. [-]"""

TEXT = "text"
"""Data type of variables that hold strings of variable length."""


@dataclass(frozen=True, kw_only=True)
class Variable:
    """A variable with one value or array for each sample."""

    name: str
    group: str = ""  # "": the root
    dimensions: tuple[str, ...] = ()  # after `sample`
    shape: tuple[int, ...] = ()  # after `sample`
    type: str = "f8"  # NumPy's, or TEXT
    attributes: Mapping[str, Any] = field(default_factory=dict)
    large: bool = False  # chunked by sample, else many samples to a chunk

    @property
    def key(self) -> str:
        """Its path in the store."""
        return f"{self.group}/{self.name}" if self.group else self.name

    @property
    def missing(self) -> Any:
        """Fill value for absent entries."""
        kind = "U" if self.type == TEXT else np.dtype(self.type).kind
        return {"f": np.nan, "c": complex("nan+nanj"), "i": -1, "U": ""}[kind]

    def empty(self) -> np.ndarray:
        """Return an array of fill values for one sample."""
        if self.type == TEXT:
            return np.full(self.shape, "", dtype=np.dtypes.StringDType())
        return np.full(self.shape, self.missing, dtype=self.type)


@dataclass(frozen=True, kw_only=True)
class Constant:
    """A variable that is the same in all samples, and stored once."""

    name: str
    values: np.ndarray
    dimensions: tuple[str, ...]
    group: str = ""
    attributes: Mapping[str, Any] = field(default_factory=dict)


CLOCK = "the users' clock minus the base station's; NaN: not known to the estimator"


def signal_variables(
    config: DatasetConfig, users: int, elements: int, points: int
) -> list[Variable]:
    """Return echo and uplinks."""
    precise = "c8" if config.precision == "single" else "c16"
    sparameter = {"units": "1", "long_name": "S-parameter"}
    found = [
        Variable(
            name="echo",
            dimensions=("position", "frequency"),
            shape=(elements, points),
            type=precise,
            attributes=sparameter,
            large=True,
        )
    ]
    if users:
        found.append(
            Variable(
                name="uplink",
                dimensions=("user", "element", "frequency"),
                shape=(users, elements, points),
                type=precise,
                attributes=sparameter,
                large=True,
            )
        )
        found.append(
            Variable(
                name="uplink_present",
                dimensions=("user",),
                shape=(users,),
                type="i1",
                attributes={"flag_values": [0, 1], "flag_meanings": "absent present"},
            )
        )
        found.append(Variable(name="uplink_count", type="i4", attributes={"units": "1"}))
    found.append(
        Variable(
            name="echo_present",
            type="i1",
            attributes={"flag_values": [0, 1], "flag_meanings": "absent present"},
        )
    )
    return found


def status_variables() -> list[Variable]:
    """Return the variables on how a sample was made: status, draws, failure."""
    return [
        Variable(
            name="status",
            type="i1",
            attributes={
                "flag_values": [MADE, FAILED],
                "flag_meanings": "made failed",
                "long_name": "whether the sample could be made",
            },
        ),
        Variable(name="failure", type=TEXT, attributes={"long_name": "why it could not"}),
        Variable(
            name="redraws",
            type="i4",
            attributes={"units": "1", "long_name": "draws before that were impossible"},
        ),
        Variable(
            name="room",
            type="i8",
            attributes={"long_name": "equal where samples have the same walls"},
        ),
    ]


def geometry_variables(
    example: Scenario, elements: int, points: int, *, fixed_array: bool, fixed_band: bool
) -> list[Variable]:
    """Return elements' positions and frequencies, if they vary from sample to sample."""
    found = []
    if not fixed_array:
        names = [("aperture_position", "position"), ("element_position", "element")]
        if (
            example.base_station.transmit_positions(example.base_station.element_positions)
            is not None
        ):
            names.append(("transmit_position", "position"))
        found += [
            Variable(
                name=name,
                dimensions=(dimension, "axis"),
                shape=(elements, 3),
                attributes={"units": "m"},
            )
            for name, dimension in names
        ]
        found.append(Variable(name="position_count", type="i4", attributes={"units": "1"}))
        found.append(
            Variable(name="boresight", dimensions=("axis",), shape=(3,), attributes={"units": "1"})
        )
    if not fixed_band:
        found.append(
            Variable(
                name="frequency",
                dimensions=("frequency",),
                shape=(points,),
                attributes={"units": "Hz"},
            )
        )
        found.append(Variable(name="frequency_count", type="i4", attributes={"units": "1"}))
    return found


def label_variables(users: int, walls: int, targets: int, paths: int) -> list[Variable]:
    """Return the truth of users, walls, targets and paths, sized for the largest sample."""
    metres, radians = {"units": "m"}, {"units": "rad"}

    def points(name: str, of: str, count: int, told: str) -> Variable:
        attributes = {**metres, "long_name": told}
        return Variable(
            name=name,
            group=TRUTH,
            dimensions=(of, "axis"),
            shape=(count, 3),
            attributes=attributes,
        )

    def of_paths(name: str, kind: str, attributes: dict[str, Any]) -> Variable:
        return Variable(
            name=name,
            group=TRUTH,
            dimensions=("user", "path"),
            shape=(users, paths),
            type=kind,
            attributes=attributes,
        )

    def count(of: str) -> Variable:
        return Variable(name=f"{of}_count", group=TRUTH, type="i4", attributes={"units": "1"})

    found = [count("user"), count("wall"), count("target")]
    if users:
        found += [
            points("user_position", "user", users, "where each user is"),
            Variable(
                name="line_of_sight",
                group=TRUTH,
                dimensions=("user",),
                shape=(users,),
                type="i1",
                attributes={
                    "flag_values": [0, 1],
                    "flag_meanings": "no_line_of_sight line_of_sight",
                    "long_name": "whether the centre of the array sees the user",
                },
            ),
            Variable(
                name="path_count",
                group=TRUTH,
                dimensions=("user",),
                shape=(users,),
                type="i4",
                attributes={
                    "units": "1",
                    "long_name": "specular paths, those included for which there was no room",
                },
            ),
            of_paths(
                "path_angle",
                "f8",
                {**radians, "long_name": "angle of arrival, from the array's axis"},
            ),
            of_paths(
                "path_elevation", "f8", {**radians, "long_name": "angle of arrival, above z = 0"}
            ),
            of_paths("path_delay", "f8", {"units": "s", "long_name": "length over light's speed"}),
            of_paths("path_bounces", "i2", {"units": "1", "long_name": "mirrors on the way"}),
            of_paths(
                "path_antenna_gain",
                "f8",
                {"units": "dB", "long_name": "of both antennas, relative to their peaks"},
            ),
            of_paths(
                "path_slabs", "i2", {"units": "1", "long_name": "slabs that it leads through"}
            ),
            of_paths(
                "path_transmission",
                "f8",
                {"units": "dB", "long_name": "field behind these slabs over that before"},
            ),
        ]
    if walls:
        found += [
            points("wall_start", "wall", walls, "one end of each plate, seen from above"),
            points("wall_end", "wall", walls, "the other end"),
            Variable(
                name="wall_height",
                group=TRUTH,
                dimensions=("wall",),
                shape=(walls,),
                attributes={**metres, "long_name": "along z; NaN in two dimensions"},
            ),
        ]
    if targets:
        found += [
            points("target_position", "target", targets, "centre of each body that is no plate"),
            points("target_size", "target", targets, "along its length, depth and height"),
            Variable(
                name="target_angle",
                group=TRUTH,
                dimensions=("target",),
                shape=(targets,),
                attributes={**radians, "long_name": "of its length, from +x"},
            ),
            Variable(
                name="target_kind",
                group=TRUTH,
                dimensions=("target",),
                shape=(targets,),
                type=TEXT,
                attributes={"long_name": "point, cylinder, box or mesh"},
            ),
        ]
    return found


def parameter_variables(space: SampleSpace) -> list[Variable]:
    """Return the drawn parameters."""
    found = []
    for one in space.parameters:
        attributes = {"long_name": one.key} | ({} if one.unit is None else {"units": one.unit})
        found.append(
            Variable(
                name=one.key,
                group=PARAMETERS,
                dimensions=("axis",) if one.kind == "position" else (),
                shape=(3,) if one.kind == "position" else (),
                type=TEXT if one.kind == "text" else "f8",
                attributes=attributes,
            )
        )
    return found
