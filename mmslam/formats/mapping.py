"""The mapping file: what in somebody's measured data is what, in which order, sign and unit.

A TOML file beside the data. Paths in it are relative to it. Every table is checked before a
sample is read; see :class:`SweepMapping` for the keys.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, model_validator

from estimator.measurement.model import MeasurementError
from mmslam.formats.file_pattern import fields_of_pattern
from scenes.files.toml_reader import read_toml
from scenes.schema.errors import ScenarioError, problems
from scenes.schema.quantities import Checked

POSITION, FREQUENCY, AXIS = "position", "frequency", "axis"
GRID_AXES = ("x", "y", "z")
"""Names of array axes: of a list of positions, of the sweep, and of a scan over a grid."""

FREQUENCY_UNITS = {"Hz": 1.0, "kHz": 1e3, "MHz": 1e6, "GHz": 1e9, "THz": 1e12}
LENGTH_UNITS = {"m": 1.0, "cm": 1e2, "mm": 1e3, "um": 1e6}
"""Factors to hertz, and divisors to metres (0.5/1000 is the double nearest to 0.0005)."""

Name = Annotated[str, Field(min_length=1)]
Vector = Annotated[list[float], Field(min_length=3, max_length=3)]
Coordinate = Annotated[
    Name | float, Field(description="the name of a variable or column, or one number for all")
]


class FrequencyTable(Checked):
    """The frequencies of array and CSV files (a Touchstone file says its own)."""

    unit: Literal["Hz", "kHz", "MHz", "GHz", "THz"] = Field(
        description='the unit of the numbers, as "GHz"'
    )
    variable: Name | None = Field(default=None, description="its variable or column")
    file: Name | None = Field(default=None, description="its file, if it is not SOURCE")
    start: float | None = Field(default=None, description="the first frequency, in `unit`")
    stop: float | None = Field(default=None, description="the last frequency, in `unit`")
    points: Annotated[int, Field(ge=2)] | None = Field(
        default=None, description="the number of frequencies, at least 2"
    )

    @model_validator(mode="after")
    def _one_source(self) -> "FrequencyTable":
        span = (self.start, self.stop, self.points)
        named = self.variable is not None or self.file is not None
        if named == any(one is not None for one in span):
            raise ValueError("give either variable (or a .npy file), or start, stop and points")
        if not named and None in span:
            raise ValueError("start, stop and points belong together; give all three")
        return self


class PositionTable(Checked):
    """Where the antenna stood: from file names, a list, variables, or a uniform line."""

    unit: Literal["m", "cm", "mm", "um"] = Field(description='the unit of the numbers, as "mm"')
    files: Name | None = Field(
        default=None,
        description='the pattern of the file names, as "x{x}_z{z}.s2p" or "scan{index}.s2p"',
    )
    csv: Name | None = Field(
        default=None, description="a CSV file with the columns file, x, y, z (y, z may be missing)"
    )
    variable: Name | None = Field(default=None, description="the variable of all coordinates")
    file: Name | None = Field(default=None, description="its file, if it is not SOURCE")
    axes: Annotated[list[Literal["position", "axis"]], Field(min_length=2, max_length=2)] = Field(
        default=["position", "axis"], description='["position", "axis"] or the other way round'
    )
    x: Coordinate | None = None
    y: Coordinate | None = None
    z: Coordinate | None = None
    first: Vector | None = Field(default=None, description="the first position [x, y, z]")
    step: Vector | None = Field(default=None, description="from each position to the next")
    origin: Vector = Field(
        default=[0.0, 0.0, 0.0], description="what is the base station's place; it is subtracted"
    )
    any_size: bool = Field(
        default=False, description="true: accept an array of implausible size or spacing"
    )

    @model_validator(mode="after")
    def _one_source(self) -> "PositionTable":
        if (self.first is None) != (self.step is None):
            raise ValueError("first and step belong together; give both")
        given = {
            "csv": self.csv is not None,
            "variable (or a .npy file)": self.variable is not None
            or (self.file is not None and not self.named_coordinates()),
            "x, y, z": any(one is not None for one in (self.x, self.y, self.z)),
            "first and step": self.first is not None,
        }
        ways = [way for way, there in given.items() if there]
        if len(ways) > 1 or (self.files is None and not ways):
            raise ValueError(
                f"give one of files, {', '.join(given)} (found: {' and '.join(ways) or 'none'})"
            )
        if self.files is not None:
            self._check_pattern(ways)
        return self

    def _check_pattern(self, ways: list[str]) -> None:
        fields = fields_of_pattern(str(self.files))
        if "index" in fields and (ways != ["first and step"] or len(fields) > 1):
            raise ValueError(
                "files with {index} needs first and step, and no {x}, {y} or {z} beside it"
            )
        if "index" not in fields and ways:
            raise ValueError(
                f"files = {self.files!r} gives the positions by {{x}}, {{y}}, {{z}}: "
                f"leave {ways[0]} out"
            )

    def named_coordinates(self) -> dict[str, str]:
        """Return the variables of the coordinates, by axis."""
        given = {"x": self.x, "y": self.y, "z": self.z}
        return {axis: name for axis, name in given.items() if isinstance(name, str)}


class SamplesTable(Checked):
    """Complex samples: a variable, or two real ones; or a parameter of Touchstone files."""

    parameter: Annotated[str, Field(pattern="^S[1-9][1-9]$")] | None = Field(
        default=None, description='the S-parameter of Touchstone files, as "S21"'
    )
    folder: Name | None = Field(
        default=None, description="the folder of its Touchstone files, if it is not SOURCE"
    )
    file: Name | None = Field(default=None, description="its file, if it is not SOURCE")
    variable: Name | None = Field(default=None, description="the variable of complex samples")
    real: Name | None = Field(default=None, description="the variable of the real part")
    imaginary: Name | None = Field(default=None, description="that of the imaginary part")
    magnitude: Name | None = Field(default=None, description="that of the linear magnitude")
    magnitude_db: Name | None = Field(default=None, description="that of 20 log10 |S|")
    phase_deg: Name | None = Field(default=None, description="that of the phase, in degrees")
    phase_rad: Name | None = Field(default=None, description="that of the phase, in radians")
    axes: list[Name] | None = Field(
        default=None,
        description='the order of the array\'s axes, as ["frequency", "position"]; '
        '"x", "y", "z" for a scan over a grid; any other name is taken by `take`',
    )
    take: dict[str, Annotated[int, Field(ge=0)]] = Field(
        default={}, description="which entry of each other axis is taken, as { run = 0 }"
    )

    @model_validator(mode="after")
    def _one_representation(self) -> "SamplesTable":
        pairs = [
            (self.real, self.imaginary),
            (self.magnitude or self.magnitude_db, self.phase_deg or self.phase_rad),
        ]
        if self.magnitude and self.magnitude_db:
            raise ValueError("give magnitude or magnitude_db, not both")
        if self.phase_deg and self.phase_rad:
            raise ValueError("give phase_deg or phase_rad, not both")
        if any((one is None) != (other is None) for one, other in pairs):
            raise ValueError("real needs imaginary, a magnitude needs a phase; give both")
        if (self.variable is not None) + sum(one is not None for one, _ in pairs) > 1:
            raise ValueError("give one of variable, real and imaginary, magnitude and phase")
        if self.folder is not None and self.file is not None:
            raise ValueError("give folder (a file for each position) or file (one for all)")
        return self

    def names_samples(self) -> bool:
        """Tell whether it says which variable holds the samples."""
        return bool(self.variable or self.real or self.magnitude or self.magnitude_db)


class ResponseTable(SamplesTable):
    """The radio's own response over frequency, measured by a through or a known target."""

    phase_only: bool = Field(default=False, description="true: leave the amplitudes as they are")


class SignalTable(SamplesTable):
    """One measured signal, and what is to be taken out of it."""

    positions: PositionTable | None = Field(
        default=None, description="its own positions, if they are not those of [positions]"
    )
    background: SamplesTable | None = Field(
        default=None, description="the same measurement without the scene; it is subtracted"
    )
    response: ResponseTable | None = Field(
        default=None, description="the radio's response; it is divided out"
    )
    cable_delay_ns: float = Field(
        default=0.0, description="the delay of all cables in the signal's way, there and back"
    )


class EchoTable(SignalTable):
    """The echo; its transmitter may stand apart."""

    transmit_offset_m: Vector | None = Field(
        default=None, description="from each receive position to its transmitter [m]"
    )
    transmit_positions: PositionTable | None = Field(
        default=None, description="where the transmitter stood, one for each receive position"
    )

    @model_validator(mode="after")
    def _one_transmitter(self) -> "EchoTable":
        if self.transmit_offset_m is not None and self.transmit_positions is not None:
            raise ValueError("give transmit_offset_m or transmit_positions, not both")
        return self


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
        default=[0.0, 1.0, 0.0], description="the unit vector to which the array looks"
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
    frequency: FrequencyTable | None = Field(
        default=None, description="the table of the frequencies"
    )
    positions: PositionTable | None = Field(default=None, description="the table of the positions")
    echo: EchoTable | None = Field(default=None, description="the table of the echo")
    uplinks: dict[Name, SignalTable] = Field(
        default={}, description="a table for each user's pilot, by name"
    )

    @model_validator(mode="after")
    def _something(self) -> "SweepMapping":
        if self.echo is None and not self.uplinks:
            raise ValueError("neither [echo] nor [uplinks.NAME] is there; give one")
        for name, signal in self.signals().items():
            if signal.positions is None and self.positions is None:
                raise ValueError(f"no [positions] for {name}; say where its antenna stood")
        return self

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
