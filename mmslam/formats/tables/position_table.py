"""Where the antenna stood."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from mmslam.formats.file_pattern import fields_of_pattern
from mmslam.formats.tables.sources import Coordinate, CoordinateTable, Name, Vector
from scenes.schema.quantities import Checked


class PositionTable(Checked):
    """Where the antenna stood: from file names, a list, variables, or a uniform line or grid."""

    unit: Literal["m", "cm", "mm", "um", "in", "mil", "ft"] = Field(
        description='the unit of the numbers, as "mm"'
    )
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
    x: Coordinate | None = Field(
        default=None, description="the name of a variable or column, one number for all, or a file"
    )
    y: Coordinate | None = None
    z: Coordinate | None = None
    azimuth_deg: Coordinate | None = Field(
        default=None,
        description="in place of x and y: the angle from +x towards +y, around their origin",
    )
    radius: Coordinate | None = Field(
        default=None, description="the distance from that axis, with azimuth_deg"
    )
    turntable: bool = Field(
        default=False,
        description="true: azimuth_deg tells how far the scene was turned before an antenna at "
        "rest, which seen from the scene turns the other way",
    )
    first: Vector | None = Field(default=None, description="the first position [x, y, z]")
    step: Vector | None = Field(
        default=None,
        description="from each position to the next, along each axis of a grid; with {x}, {y}, "
        "{z} in file names: from each number to the next",
    )
    snake: bool = Field(
        default=False,
        description="true: of a grid, every second row was measured backwards",
    )
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
        if (self.azimuth_deg is None) != (self.radius is None):
            raise ValueError("azimuth_deg and radius belong together; give both")
        if self.azimuth_deg is not None and (self.x is not None or self.y is not None):
            raise ValueError("azimuth_deg and radius stand in place of x and y; leave these out")
        if self.turntable and self.azimuth_deg is None:
            raise ValueError("turntable = true needs azimuth_deg and radius; give both")
        given = {
            "csv": self.csv is not None,
            "variable (or a .npy file)": self.variable is not None
            or (self.file is not None and not self.named_coordinates()),
            "x, y, z": bool(self.coordinates()),
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
        if "index" not in fields and ways not in ([], ["first and step"]):
            raise ValueError(
                f"files = {self.files!r} gives the positions by {{x}}, {{y}}, {{z}}: "
                f"leave {ways[0]} out"
            )

    def coordinates(self) -> dict[str, CoordinateTable]:
        """Return what is said of each coordinate, by axis; those that are left out are 0."""
        given = {
            "x": self.x,
            "y": self.y,
            "z": self.z,
            "azimuth": self.azimuth_deg,
            "radius": self.radius,
        }
        return {axis: one for axis, one in given.items() if one is not None}

    def named_coordinates(self) -> dict[str, str]:
        """Return the variables of the coordinates, by axis."""
        given = self.coordinates().items()
        return {axis: one.variable for axis, one in given if one.variable is not None}
