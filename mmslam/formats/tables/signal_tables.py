"""The samples of a signal: which variables, in which order, and what is taken out of them."""

from math import isfinite
from typing import Annotated, Literal

from pydantic import Field, PlainValidator, model_validator
from pydantic_core import PydanticCustomError

from mmslam.formats.tables.position_table import PositionTable
from mmslam.formats.tables.sources import Entries, Name, Source, Vector
from scenes.schema.quantities import Checked

LARGEST_SHAPE = 2**28
"""Most numbers that a shape may promise; checked against the file's size as well."""


class RawTable(Checked):
    """Numbers without any header, as a recorder wrote them (the DCA1000 of TI radars, say)."""

    type: Literal["int16", "int32", "uint8", "uint16", "float32", "float64"] = Field(
        description='the kind of the numbers, as "int16"'
    )
    shape: Annotated[list[Annotated[int, Field(ge=1)]], Field(min_length=1)] = Field(
        description="the length of each axis, the slowest first; complex samples count once"
    )
    pairs: Literal["none", "IQ", "QI", "IIQQ", "QQII"] = Field(
        default="none",
        description='how I and Q of complex samples follow each other; "none": by an axis of '
        "their own, or real",
    )
    big_endian: bool = Field(default=False, description="true: the high byte comes first")
    header_bytes: Annotated[int, Field(ge=0)] = Field(
        default=0, description="how many bytes at the file's begin are left out"
    )


def _delay_or_focus(value: object) -> float | Literal["focus"]:
    if value == "focus":
        return "focus"
    refused = PydanticCustomError("delay", "must be a finite number, or 'focus'")
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise refused
    try:
        delay = float(value)
    except OverflowError:  # an integer of 309 digits and more
        raise refused from None
    if not isfinite(delay):
        raise refused
    return delay


DelayOrFocus = Annotated[
    float | Literal["focus"],
    PlainValidator(_delay_or_focus, json_schema_input_type=float | Literal["focus"]),
]
"""A delay [ns], or where to take it from; checked as one, so that messages name the key alone."""


class SamplesTable(Checked):
    """Complex samples: a variable, or two real ones; or a parameter of Touchstone files."""

    parameter: Annotated[str, Field(pattern="^S[1-9][1-9]$")] | None = Field(
        default=None, description='the S-parameter of Touchstone files, as "S21"'
    )
    folder: Name | None = Field(
        default=None, description="the folder of its Touchstone files, if it is not SOURCE"
    )
    file: Name | None = Field(default=None, description="its file, if it is not SOURCE")
    raw: RawTable | None = Field(default=None, description="how a file without header is laid out")
    variable: Name | None = Field(default=None, description="the variable of complex samples")
    real: Source | None = Field(
        default=None,
        description='the variable of the real part (I), or { take = { iq = 0 } } of "iq" in axes',
    )
    imaginary: Source | None = Field(default=None, description="that of the imaginary part (Q)")
    magnitude: Source | None = Field(default=None, description="that of the linear magnitude")
    magnitude_db: Source | None = Field(default=None, description="that of 20 log10 |S|")
    phase_deg: Source | None = Field(default=None, description="that of the phase, in degrees")
    phase_rad: Source | None = Field(default=None, description="that of the phase, in radians")
    analytic: bool = Field(
        default=False,
        description="true: real samples of one mixer over frequency; their analytic signal is "
        "formed, of delays up to half of the unambiguous one",
    )
    offset: float | Annotated[list[float], Field(min_length=2, max_length=2)] = Field(
        default=0.0,
        description="the converter's zero, subtracted from real and imaginary part; two numbers: "
        "from each its own",
    )
    scale: float = Field(
        default=1.0, description="the factor from the file's numbers to S-parameters"
    )
    axes: list[Name] | None = Field(
        default=None,
        description='the order of the array\'s axes, as ["frequency", "position"]; '
        '"x", "y", "z" for a scan over a grid; any other name is taken by `take`',
    )
    take: Entries = Field(
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
        whole = self.variable is not None or self.analytic
        if whole + sum(one is not None for one, _ in pairs) > 1:
            raise ValueError("give one of variable, real and imaginary, magnitude and phase")
        if self.folder is not None and self.file is not None:
            raise ValueError("give folder (a file for each position) or file (one for all)")
        if self.scale == 0:
            raise ValueError("scale is 0; give the factor to S-parameters")
        if self.offset != 0.0 and pairs[1][0] is not None:
            raise ValueError("offset is of real and imaginary parts; a magnitude has none")
        return self

    def names_samples(self) -> bool:
        """Tell whether it says which variable holds the samples."""
        return bool(self.variable or self.real or self.magnitude or self.magnitude_db)


REPRESENTATION = (
    "variable", "real", "imaginary", "magnitude", "magnitude_db", "phase_deg", "phase_rad",
)  # fmt: skip
"""Keys of samples that say together which variables hold them."""


class ResponseTable(SamplesTable):
    """The radio's own response over frequency, measured by a through or a known target."""

    phase_only: bool = Field(default=False, description="true: leave the amplitudes as they are")


class SignalTable(SamplesTable):
    """One measured signal, and what is to be taken out of it."""

    positions: PositionTable | None = Field(
        default=None, description="its own positions, if they are not those of [positions]"
    )
    leave_out: list[Annotated[int, Field(ge=0)]] = Field(
        default=[],
        description="positions that are left out, counted from 0 in the order of the samples",
    )
    background: SamplesTable | None = Field(
        default=None, description="the same measurement without the scene; it is subtracted"
    )
    response: ResponseTable | None = Field(
        default=None, description="the radio's response; it is divided out"
    )
    subtract_shared: Literal["mean"] | Annotated[int, Field(ge=1)] | None = Field(
        default=None,
        description='what all positions share is subtracted: "mean", or a number of the strongest '
        "principal components",
    )
    gate_out_ns: Annotated[list[float], Field(min_length=2, max_length=2)] | None = Field(
        default=None,
        description="delays, there and back, that are taken out (an antenna's own mismatch), "
        "counted after cable_delay_ns",
    )
    cable_delay_ns: DelayOrFocus = Field(
        default=0.0,
        description='the delay of all cables in the signal\'s way, there and back; "focus": as '
        "the curvature of the strongest point's wave tells it",
    )


class EchoTable(SignalTable):
    """The echo; its transmitter may stand apart."""

    autofocus: Literal["range"] | None = Field(
        default=None,
        description='"range": how far each position is towards the scene is corrected by the '
        "sharpest image",
    )
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
