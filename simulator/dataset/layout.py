"""The layout of a dataset: its variables, their dimensions, units and padding.

It is that of the measurement file with a leading dimension ``sample``. Variables whose length
differs among samples are padded to the longest with NaN (-1 among integers, "" among texts), and a
count gives the number of valid rows. Users, walls and targets keep their row, and so their name, in
all samples.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from estimator.measurement.model import Measurement
from estimator.measurement.store import CONVENTIONS, PARAMETERS, TRUTH
from estimator.measurement.store import FORMAT as MEASUREMENT_FORMAT
from estimator.measurement.store_attributes import AIR_KEYS, air_attributes
from scenes.sampling.sample_space import SampleSpace
from scenes.scenario import Scenario
from scenes.schema.errors import ScenarioError
from simulator.dataset.config import FORMAT, DatasetConfig, identity
from simulator.dataset.variables import (
    CLOCK,
    Constant,
    Variable,
    geometry_variables,
    label_variables,
    parameter_variables,
    signal_variables,
    status_variables,
)
from simulator.scene.air import measured_air

AIR_TOLD = {
    "air_temperature_c": {"units": "degC"},
    "air_pressure_hpa": {"units": "hPa"},
    "air_humidity_percent": {"units": "%"},
}
"""Attributes of the variables that tell the air where it differs among samples."""

BLOCK_BYTES = 32 * 2**20
"""Most bytes of raw samples in one file (a shard), unless one sample is larger. [byte]"""

BLOCK_SAMPLES = 256
"""Most samples in one such file. [-]"""

LABEL_SAMPLES = 4096
"""Samples in one file of a label: a million samples are 245 files for each of 30 labels. [-]"""


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Structure of a dataset: everything but its samples."""

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
    """Return the layout of a dataset.

    Parameters
    ----------
    space, config
        Its samples, and its configuration.
    example
        Scenario of any sample; supplies what does not vary.

    Raises
    ------
    ScenarioError
        If a quantity would vary that a dataset stores once for all samples.
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
        *signal_variables(config, len(users), elements, points),
        *status_variables(),
        *geometry_variables(
            example, elements, points, fixed_array=fixed_array, fixed_band=fixed_band
        ),
        *label_variables(len(users), len(walls), len(targets), config.most_paths),
        *parameter_variables(space),
    ]
    clock_varies = space.varies("impairments")
    if clock_varies:
        variables.append(
            Variable(name="clock_offset", attributes={"units": "s", "long_name": CLOCK})
        )
    air_varies = space.varies("air")
    if air_varies:
        variables += [Variable(name=key, attributes=AIR_TOLD[key]) for key in AIR_KEYS]
    return Layout(
        samples=config.samples,
        variables=tuple(variables),
        constants=(
            *_names(users, walls, targets),
            *_fixed(example, fixed_array=fixed_array, fixed_band=fixed_band),
        ),
        attributes=_attributes(
            space, config, example, clock_varies=clock_varies, air_varies=air_varies
        ),
        users=users,
        walls=walls,
        targets=targets,
        elements=elements,
        frequencies=points,
    )


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
    space: SampleSpace,
    config: DatasetConfig,
    example: Scenario,
    *,
    clock_varies: bool,
    air_varies: bool,
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
    if not air_varies:
        attributes |= air_attributes(measured_air(example.air))
    return attributes


def fits(layout: Layout, measurement: Measurement) -> bool:
    """Return whether a measurement fits into the layout."""
    shapes = [one.samples.shape for one in measurement.uplinks]
    shapes += [measurement.echo.samples.shape] if measurement.echo else []
    return all(shape[0] <= layout.elements and shape[1] <= layout.frequencies for shape in shapes)
