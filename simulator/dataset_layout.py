"""The layout of a dataset: which variables there are, with what dimensions, units and padding.

That of the measurement file with a leading dimension ``sample``. What differs in length from
sample to sample has room for the longest: rows that a sample lacks hold NaN (-1 among whole
numbers, "" among texts), and a count says how many there are. Users, walls and targets keep
their row, and so their name, in all samples.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from estimator.measurement import Measurement
from estimator.storage import CONVENTIONS, PARAMETERS, TRUTH
from estimator.storage import FORMAT as MEASUREMENT_FORMAT
from scenes.sample_space import SampleSpace
from scenes.scenario import Scenario
from scenes.scenario_error import ScenarioError
from simulator.dataset_config import FORMAT, DatasetConfig, identity

MADE, FAILED = 0, 1
"""Status of a sample."""

BLOCK_BYTES = 32 * 2**20
"""Most bytes of raw samples that lie in one file (a shard), unless a sample itself is larger."""

BLOCK_SAMPLES = 256
"""Most samples in one such file."""

LABEL_SAMPLES = 4096
"""Samples in one file of a label: a million samples are 245 files for each of some 30 labels."""

TEXT = "text"
"""Type of variables of variable-length strings."""


@dataclass(frozen=True, kw_only=True)
class Variable:
    """One variable that every sample has a value of."""

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
        """Value where a sample has none."""
        kind = "U" if self.type == TEXT else np.dtype(self.type).kind
        return {"f": np.nan, "c": complex("nan+nanj"), "i": -1, "U": ""}[kind]

    def empty(self) -> np.ndarray:
        """Return the values of a sample that has none."""
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


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Everything about a dataset but its samples."""

    samples: int
    variables: tuple[Variable, ...]
    constants: tuple[Constant, ...]
    attributes: Mapping[str, Any]
    users: tuple[str, ...]
    walls: tuple[str, ...]
    targets: tuple[str, ...]
    elements: int  # most of any sample
    frequencies: int  # likewise

    @property
    def sample_bytes(self) -> int:
        """Size of one sample's echo and uplinks, uncompressed [byte]."""
        return sum(
            int(np.prod(one.shape)) * np.dtype(one.type).itemsize
            for one in self.variables
            if one.large
        )

    @property
    def block(self) -> int:
        """Samples in one file of echo or uplink."""
        fitting = max(BLOCK_BYTES // max(self.sample_bytes, 1), 1)
        return min(1 << (fitting.bit_length() - 1), BLOCK_SAMPLES, LABEL_SAMPLES, self.samples)

    @property
    def blocks(self) -> int:
        """Number of such files."""
        return -(-self.samples // self.block)

    def block_samples(self, block: int) -> range:
        """Return the samples of a block."""
        return range(block * self.block, min((block + 1) * self.block, self.samples))


def dataset_layout(space: SampleSpace, config: DatasetConfig, example: Scenario) -> Layout:
    """Lay a dataset out.

    Parameters
    ----------
    space, config
        Its samples, and what was asked for.
    example
        Any sample's scenario; what does not vary is taken from it.

    Raises
    ------
    ScenarioError
        If samples would differ in what a dataset has once.
    """
    for key in ("waves", "dimensions", "format", "name"):
        if space.varies(key):
            raise ScenarioError(
                f"vary.{key}: must be the same in a whole dataset; make two datasets"
            )
    most_elements, most_points = space.most()
    elements = max(most_elements, example.base_station.element_count)
    points = max(most_points, example.radio.points)
    users = space.names("users")
    kinds = space.kinds()
    walls = tuple(name for name in kinds if "plate" in kinds[name])
    bodies = [name for name in kinds if kinds[name] - {"plate"}]
    points_too = [f"points.{n}" if n in bodies else n for n in space.names("points")]
    targets = (*bodies, *points_too)
    fixed_array = not space.varies("base_station")
    fixed_band = not space.varies("radio")
    variables = [
        *_signals(config, len(users), elements, points),
        *_status(),
        *_geometry(example, elements, points, fixed_array=fixed_array, fixed_band=fixed_band),
        *_labels(len(users), len(walls), len(targets), config.most_paths),
        *_parameters(space),
    ]
    clock_varies = space.varies("impairments")
    if clock_varies:
        variables.append(
            Variable(name="clock_offset", attributes={"units": "s", "long_name": _CLOCK})
        )
    return Layout(
        samples=config.samples,
        variables=tuple(variables),
        constants=(
            *_names(users, walls, targets),
            *_fixed(example, fixed_array=fixed_array, fixed_band=fixed_band),
        ),
        attributes=_attributes(space, config, example, clock_varies=clock_varies),
        users=users,
        walls=walls,
        targets=targets,
        elements=elements,
        frequencies=points,
    )


_CLOCK = "the users' clock minus the base station's; NaN: not known to the estimator"


def _signals(config: DatasetConfig, users: int, elements: int, points: int) -> list[Variable]:
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


def _status() -> list[Variable]:
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
    ]


def _geometry(
    example: Scenario, elements: int, points: int, *, fixed_array: bool, fixed_band: bool
) -> list[Variable]:
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


def _labels(users: int, walls: int, targets: int, paths: int) -> list[Variable]:
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


def _parameters(space: SampleSpace) -> list[Variable]:
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


def _names(
    users: tuple[str, ...], walls: tuple[str, ...], targets: tuple[str, ...]
) -> list[Constant]:
    def labels(name: str, values: tuple[str, ...], group: str = "") -> Constant:
        text = np.array(list(values), dtype=np.dtypes.StringDType())
        return Constant(name=name, values=text, dimensions=(name,), group=group)

    axes = ("x", "y", "z")
    found = [labels("axis", axes, group) for group in ("", TRUTH, PARAMETERS)]
    found += [labels("user", users, group) for group in ("", TRUTH) if users]
    found += [labels("wall", walls, TRUTH)] if walls else []
    return found + ([labels("target", targets, TRUTH)] if targets else [])


def _fixed(example: Scenario, *, fixed_array: bool, fixed_band: bool) -> list[Constant]:
    found = []
    station = example.base_station
    if fixed_array:
        places = station.element_positions
        named = {
            "aperture_position": ("position", places),
            "element_position": ("element", places),
        }
        apart = station.transmit_positions(places)
        if apart is not None:
            named["transmit_position"] = ("position", apart)
        found += [
            Constant(name=name, values=values, dimensions=(of, "axis"), attributes={"units": "m"})
            for name, (of, values) in named.items()
        ]
    if fixed_band:
        found.append(
            Constant(
                name="frequency",
                values=example.radio.frequencies,
                dimensions=("frequency",),
                attributes={"units": "Hz"},
            )
        )
    return found


def _attributes(
    space: SampleSpace, config: DatasetConfig, example: Scenario, *, clock_varies: bool
) -> dict[str, Any]:
    flaws = example.impairments
    attributes: dict[str, Any] = {
        "mmslam_format": MEASUREMENT_FORMAT,
        "dataset_format": FORMAT,
        "title": f"{config.samples} samples of variations of {example.name}",
        "conventions": CONVENTIONS,
        "waves": example.waves,
        "scenario": example.name,
        "dimensions": example.dimensions,
        "seed": config.seed,
        **identity(space),
    }
    if not space.varies("base_station"):
        attributes["boresight"] = example.base_station.boresight.tolist()
    if flaws.clock_known and not clock_varies:
        attributes["clock_offset_s"] = flaws.clock_offset
    return attributes


def fits(layout: Layout, measurement: Measurement) -> bool:
    """Tell whether a measurement has room in the layout."""
    shapes = [one.samples.shape for one in measurement.uplinks]
    shapes += [measurement.echo.samples.shape] if measurement.echo else []
    return all(shape[0] <= layout.elements and shape[1] <= layout.frequencies for shape in shapes)
