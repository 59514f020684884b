"""Switches for the propagation effects that are simulated."""

from pydantic import Field

from scenes.schema.quantities import Checked


class Effects(Checked):
    """The table [effects]."""

    line_of_sight: bool = Field(
        True, description="whether users' pilots come straight, or through what lets them through"
    )
    transmission: bool = Field(
        True,
        description="whether slabs of a dielectric let waves through; else every surface blocks",
    )
    diffraction: bool = Field(
        False,
        description="whether pilots bend round edges of opaque plates and boxes",
    )
