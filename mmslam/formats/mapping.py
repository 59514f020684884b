"""The mapping file: it describes the variables, axes, sign and units of measured data.

A TOML file beside the data. Paths in it are relative to it. Every table is checked before a
sample is read; see :class:`SweepMapping` for the keys.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, model_validator

from estimator.measurement.model import MeasurementError
from mmslam.formats.tables.air_table import AirTable
from mmslam.formats.tables.frequency_table import FrequencyTable
from mmslam.formats.tables.path_table import PathTable
from mmslam.formats.tables.position_table import PositionTable
from mmslam.formats.tables.signal_tables import EchoTable, SignalTable
from mmslam.formats.tables.sources import Name, Vector
from mmslam.formats.tables.time_tables import Band, ChirpTable, TimeTable
from scenes.files.toml_reader import read_toml
from scenes.schema.errors import ScenarioError, problems
from scenes.schema.quantities import Checked


class SweepMapping(Checked):
    """What in measured data is what. A delay t appears as exp(-j 2 pi f t) in exp(+jwt)."""

    time_convention: Literal["exp(+jwt)", "exp(-jwt)"] = Field(
        default="exp(+jwt)",
        description='"exp(+jwt)", as network analysers measure, or "exp(-jwt)" (conjugated)',
    )
    waves: Literal["spherical", "cylindrical"] = Field(
        default="spherical", description='"spherical", or "cylindrical" for two-dimensional fields'
    )
    boresight: Vector = Field(
        default=[0.0, 1.0, 0.0],
        description="the unit vector to which the array looks; left out, an area of positions in "
        "x and y looks along z, and any other array along y",
    )
    refractive_index: Annotated[float, Field(ge=1, le=20)] = Field(
        default=1.0,
        description="of the medium that all waves run in, if it is no air (dry sand 1.6, water 9): "
        "lengths are those in it",
    )
    air: AirTable | None = Field(
        default=None,
        description="the table of the air that was measured in; without it and refractive_index, "
        "lengths are those in vacuum",
    )
    clock_offset_ns: float | None = Field(
        default=None, description="the user's clock minus ours; leave it out if it is unknown"
    )
    scenario: Name | None = Field(default=None, description="a name for the measurement")
    frequency_rounded_to_hz: Annotated[float, Field(ge=0)] = Field(
        default=0.0,
        description="to how many hertz the frequencies in the files were rounded; "
        "an equal grid within that replaces them",
    )
    band_ghz: Band | None = Field(
        default=None, description="the lowest and highest frequency of the sweep that is kept [GHz]"
    )
    frequency: FrequencyTable | None = Field(
        default=None, description="the table of the frequencies"
    )
    time: TimeTable | None = Field(
        default=None, description="in its place, of traces over time: their times and band"
    )
    chirp: ChirpTable | None = Field(
        default=None, description="in its place, of a radar's beats: the chirp's slope and start"
    )
    positions: PositionTable | None = Field(default=None, description="the table of the positions")
    echo: EchoTable | None = Field(default=None, description="the table of the echo")
    uplinks: dict[Name, SignalTable] = Field(
        default={}, description="a table for each user's pilot, by name"
    )

    paths: PathTable | None = Field(
        default=None, description="the table of a sounder's path lists: no channel was kept"
    )

    @model_validator(mode="after")
    def _something(self) -> "SweepMapping":
        if self.echo is None and not self.uplinks and self.paths is None:
            raise ValueError("neither [echo] nor [uplinks.NAME] nor [paths] is there; give one")
        if sum(one is not None for one in (self.frequency, self.time, self.chirp)) > 1:
            raise ValueError("give one of [frequency], [time] and [chirp]")
        if self.band_ghz is not None and not 0 <= self.band_ghz[0] < self.band_ghz[1]:
            raise ValueError("band_ghz must rise: give the lowest and the highest frequency")
        if self.air is not None and self.refractive_index != 1.0:
            raise ValueError("[air] and refractive_index are both there; waves run in one medium")
        for name, signal in self.signals().items():
            if signal.positions is None and self.positions is None:
                raise ValueError(f"no [positions] for {name}; say where its antenna stood")
        return self

    def medium(self) -> dict[str, Any]:
        """Return the medium as a measurement's fields."""
        index = self.refractive_index
        return {
            "air": None if self.air is None else self.air.air(),
            "medium_index": None if index == 1.0 else index,
        }

    def sweep_axis(self) -> str:
        """Return the name of the axis along which each position was measured."""
        return "time" if self.time else "sample" if self.chirp else "frequency"

    def sweep_column(self) -> str | None:
        """Return the column that tells where in the sweep a row of a table stands."""
        table = self.frequency or self.time
        return table.variable if table is not None else None

    def signals(self) -> dict[str, SignalTable]:
        """Return the echo and the uplinks by the names of their tables."""
        signals: dict[str, SignalTable] = {} if self.echo is None else {"echo": self.echo}
        return signals | {f"uplinks.{name}": one for name, one in self.uplinks.items()}

    def positions_of(self, signal: SignalTable) -> PositionTable:
        """Return where a signal's antenna stood."""
        table = signal.positions or self.positions
        assert table is not None  # checked when the mapping was read
        return table


def load_mapping(path: Path) -> SweepMapping:
    """Read a mapping file.

    Raises
    ------
    MeasurementError
        If the file cannot be read, or a key is missing, unknown or impossible: a line for each.
    """
    try:
        data = read_toml(
            path,
            name=str(path),
            kind="mapping",
            remedy="give a mapping file by --mapping, its keys are listed by "
            "`mmslam import --schema`",
        )
    except ScenarioError as error:
        raise MeasurementError(str(error)) from None
    return checked_mapping(data, place=f"{path}: ")


def checked_mapping(tables: Mapping[str, Any], *, place: str = "mapping: ") -> SweepMapping:
    """Check a mapping's tables, as :func:`load_mapping` does those of a file.

    Parameters
    ----------
    tables
        As a TOML file would give them.
    place
        What messages begin with.

    Raises
    ------
    MeasurementError
        If a key is missing, unknown or impossible: a line for each.
    """
    try:
        return SweepMapping.model_validate(dict(tables))
    except ValidationError as error:
        found = problems(error, SweepMapping)
        raise MeasurementError("\n".join(f"{place}{_plain(line)}" for line in found)) from None


def mapping_schema() -> dict[str, Any]:
    """Return the JSON schema of a mapping file, for editors and other programs."""
    return SweepMapping.model_json_schema()


def _plain(line: str) -> str:
    """Drop pydantic's own preface, and name the file where no key can be named."""
    line = line.replace("Value error, ", "")
    return line.removeprefix(": ").replace("the scenario = ", "the mapping = ")
