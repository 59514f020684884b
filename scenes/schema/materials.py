"""Materials of objects: named materials, and slabs of a permittivity that a scenario gives.

Only names and numbers: the simulator computes the reflection coefficients
(``simulator.materials.fresnel_slab``), and a test checks that both know the same names.
"""

import math
from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator
from pydantic_core import PydanticCustomError

from scenes.schema.errors import NAME_TAG, TABLE_TAG, did_you_mean
from scenes.schema.quantities import Checked

SLABS = (
    "drywall",
    "plasterboard",
    "glass",
    "ceiling_board",
    "chipboard",
    "plywood",
    "floorboard",
    "wood",
    "concrete",
    "brick",
    "marble",
    "cardboard",
)
"""Named dielectrics: plasterboard (as drywall, too) to marble after ITU-R P.2040-4."""

MATERIALS = ("metal", "absorber", *SLABS)
"""Materials that a scenario may name."""


class Texture(NamedTuple):
    """How rough a material is unless told otherwise: Gaussian heights."""

    rms_mm: float
    correlation_mm: float


TEXTURES: Mapping[str, Texture] = {
    "drywall": Texture(rms_mm=0.02, correlation_mm=0.3),
    "cardboard": Texture(rms_mm=0.05, correlation_mm=0.3),
}
"""Roughness of named materials where an object gives none; all others are smooth. No settled
values are published at these frequencies: these are parameters to be swept, and
``roughness.rms_mm = 0`` makes a smooth one."""


def _name(value: str) -> str:
    if value not in MATERIALS:
        raise PydanticCustomError(
            "material",
            "unknown material{hint}; use one of {known}, or a table with 'permittivity' or "
            "'file', and 'thickness_mm'",
            {"hint": did_you_mean(value, MATERIALS), "known": ", ".join(MATERIALS)},
        )
    return value


def _slab_name(value: str) -> str:
    if value not in SLABS:
        raise PydanticCustomError(
            "material",
            "not a slab{hint}; use one of {known}",
            {"hint": did_you_mean(value, SLABS), "known": ", ".join(SLABS)},
        )
    return value


Loss = Annotated[float, Field(ge=0, le=1e6)]
Real = Annotated[float, Field(ge=1, le=1e6)]


class Slab(Checked):
    """A dielectric slab: a named one of another thickness, or one of a given permittivity."""

    name: Annotated[str, AfterValidator(_slab_name)] | None = Field(
        None, description=f"one of {', '.join(SLABS)}, to change its thickness"
    )
    permittivity: (
        Annotated[tuple[Real, Loss], Field(strict=False, json_schema_extra={"type": "array"})]
        | None
    ) = Field(None, description="[e', e''] of e' - j e'', constant over frequency")
    conductivity_s_m: float | None = Field(
        None,
        ge=0,
        le=1e9,
        description="with a permittivity [e', 0]: the conductivity, whose loss falls with "
        "frequency [S/m]",
    )
    file: str | None = Field(
        None,
        min_length=1,
        description="a CSV table frequency_ghz,eps_real,eps_imag, relative to the scenario's file",
    )
    beyond_itu: bool = Field(
        False,
        description="with a name: whether bands between and beyond the rows of ITU-R P.2040-4 are "
        "taken from the nearest rows",
    )
    thickness_mm: float = Field(
        gt=0, allow_inf_nan=True, description="the thickness, inf for an opaque body [mm]"
    )

    @model_validator(mode="after")
    def _one_source(self) -> "Slab":
        given = [key for key in ("name", "permittivity", "file") if getattr(self, key) is not None]
        if len(given) != 1:
            raise PydanticCustomError(
                "slab",
                "has {given}; give exactly one of name, permittivity and file",
                {"given": " and ".join(given) or "neither name nor permittivity nor file"},
            )
        if self.conductivity_s_m is not None and (
            self.permittivity is None or self.permittivity[1] != 0
        ):
            raise PydanticCustomError(
                "slab",
                "conductivity_s_m = {conductivity} stands for the loss of a permittivity; give "
                "permittivity = [e', 0] with it, or leave it out",
                {"conductivity": self.conductivity_s_m},
            )
        if self.beyond_itu and self.name is None:
            raise PydanticCustomError(
                "slab", "beyond_itu = true is about named materials; give a name, or leave it out"
            )
        if math.isnan(self.thickness_mm):
            raise PydanticCustomError("slab", "thickness_mm = nan; give a number, or inf")
        return self

    @property
    def thickness(self) -> float:
        """Thickness, infinite for an opaque body [m]."""
        return self.thickness_mm * 1e-3

    def __str__(self) -> str:
        """Name it as a legend would."""
        if self.permittivity is not None:
            what = f"ε {self.permittivity[0]:g} − {self.permittivity[1]:g}j"
            if self.conductivity_s_m is not None:
                what = f"ε {self.permittivity[0]:g}, {self.conductivity_s_m:g} S/m"
        else:
            what = str(self.name or self.file)
        return f"{what}, {'opaque' if math.isinf(self.thickness) else f'{self.thickness_mm:g} mm'}"


def _form(value: object) -> str:
    return TABLE_TAG if isinstance(value, Mapping | Slab) else NAME_TAG


Material = Annotated[
    Annotated[str, AfterValidator(_name), Tag(NAME_TAG)] | Annotated[Slab, Tag(TABLE_TAG)],
    Discriminator(_form),
]
"""A name of :data:`MATERIALS`, or a slab."""


def usual_texture(material: object) -> dict[str, Any] | None:
    """Return the table ``roughness`` that a material has by itself, if any."""
    name = material.get("name") if isinstance(material, Mapping) else material
    if isinstance(material, Slab):
        name = material.name
    texture = TEXTURES.get(name) if isinstance(name, str) else None
    return None if texture is None else {**texture._asdict(), "spectrum": "gaussian"}
