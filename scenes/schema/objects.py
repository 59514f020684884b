"""Objects of a scenario: plates, cylinders, boxes and mesh files, with pose and roughness."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from jaxtyping import Float
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from scenes.schema.directions import left_of, right_of, unit_vector
from scenes.schema.materials import MATERIALS, Material, usual_texture
from scenes.schema.quantities import Angle, Checked, Position, Size
from scenes.schema.roughness import Roughness


class Body(Checked):
    """What all objects share."""

    material: Material = Field(
        description=f"one of {', '.join(MATERIALS)}, or a table [objects.NAME.material]"
    )
    centre_m: Position = Field(description="the centre of the object [m]")
    angle_deg: Angle = Field(0.0, description="the azimuth of its length from +x [degree]")
    roughness: Roughness | None = Field(
        None, description="the roughness of its surface; without, what its material has by itself"
    )
    realisation: str | None = Field(
        None,
        min_length=1,
        description="a mesh file of its surface with all heights, drawn or measured, in the "
        "scene's frame, relative to the scenario's file; without, heights are drawn",
    )

    @model_validator(mode="before")
    @classmethod
    def _as_rough_as_its_material(cls, data: Any) -> Any:
        if not isinstance(data, Mapping) or data.get("roughness") is not None:
            return data
        texture = usual_texture(data.get("material"))
        return data if texture is None else {**data, "roughness": texture}

    @model_validator(mode="after")
    def _an_absorber_has_no_facets(self) -> "Body":
        if self.material == "absorber" and self.roughness is not None:
            raise PydanticCustomError(
                "absorber", "an absorber scatters nothing, rough or smooth; remove 'roughness'"
            )
        return self

    @property
    def frozen(self) -> "MeshFile | None":
        """The mesh of its realisation, facets as they are; none if heights are to be drawn."""
        if self.realisation is None:
            return None
        smooth = Roughness(rms_mm=0.0, correlation_mm=1.0)
        return MeshFile(
            kind="mesh",
            material=self.material,
            file=self.realisation,
            facets="file",
            hollow=isinstance(self, MeshFile) and self.hollow,
            roughness=None if self.material == "absorber" else smooth,
        )

    @property
    def centre(self) -> Float[np.ndarray, " 3"]:
        """Centre of the object [m]."""
        return np.array(self.centre_m, dtype=np.float64)

    @property
    def tangent(self) -> Float[np.ndarray, " 3"]:
        """Unit vector along its length: (cos a, sin a, 0)."""
        return unit_vector(self.angle_deg)

    @property
    def across(self) -> Float[np.ndarray, " 3"]:
        """Unit vector along its depth: the tangent turned by +90° about z."""
        return left_of(self.tangent)

    @property
    def normal(self) -> Float[np.ndarray, " 3"]:
        """Unit vector (sin a, -cos a, 0), along which the heights of a plate count."""
        return right_of(self.tangent)


class Plate(Body):
    """A thin flat plate, seen from both sides, upright."""

    kind: Literal["plate"]
    length_m: Size = Field(description="the length of the plate along angle_deg [m]")
    height_m: Size | None = Field(None, description="the height along z, in 3-D only [m]")


class Cylinder(Body):
    """A circular cylinder, its axis along z."""

    kind: Literal["cylinder"]
    radius_m: Size = Field(description="the radius of the cylinder [m]")
    height_m: Size | None = Field(None, description="the height along z, in 3-D only [m]")


class Box(Body):
    """An upright box: its length along angle_deg, its depth across."""

    kind: Literal["box"]
    length_m: Size = Field(description="the length of the box along angle_deg [m]")
    depth_m: Size = Field(description="the depth of the box across its length [m]")
    height_m: Size | None = Field(None, description="the height along z, in 3-D only [m]")


Entry = Annotated[float, Field(ge=-1e6, le=1e6)]


class MeshFile(Body):
    """A triangle mesh from a file, turned about z and moved; in 2-D, where it meets z = 0."""

    kind: Literal["mesh"]
    file: str = Field(
        min_length=1, description="the PLY, STL, OBJ or OFF file, relative to the scenario's"
    )
    scale: float = Field(1.0, ge=1e-6, le=1e6, description="metres per unit of the file [m]")
    centre_m: Position = Field(
        (0.0, 0.0, 0.0), description="the point to which the file's origin is moved [m]"
    )
    matrix: (
        Annotated[
            tuple[
                Entry, Entry, Entry, Entry, Entry, Entry, Entry, Entry, Entry, Entry, Entry, Entry
            ],
            Field(strict=False),
        ]
        | None
    ) = Field(
        None,
        description="twelve numbers, row by row: the 3 x 4 matrix applied to the file's vertices "
        "before scale, angle_deg and centre_m",
    )
    facets: Literal["cut", "file"] = Field(
        "cut", description="'cut' the triangles until they are fine enough, or 'file': as they are"
    )
    flat_faces: bool = Field(
        False,
        description="whether its flat faces are walls however many they are, as a town's terrain "
        "and roofs; otherwise a mesh of more than 1000 stands for something round",
    )
    hollow: bool = Field(
        False,
        description="whether a closed mesh is a shell that can be seen from within, such as a "
        "room, and no solid",
    )
    solid: bool = Field(
        False,
        description="whether the mesh must be watertight: an open one is refused then, and else "
        "taken for a sheet that is seen from both sides",
    )

    @model_validator(mode="after")
    def _solid_or_hollow(self) -> "MeshFile":
        if self.solid and self.hollow:
            raise PydanticCustomError(
                "solid", "solid = true and hollow = true exclude each other; remove one"
            )
        return self

    @model_validator(mode="after")
    def _frozen_facets_are_rough_by_themselves(self) -> "MeshFile":
        if self.facets == "file" and self.roughness is not None and self.roughness.rms > 0:
            raise PydanticCustomError(
                "facets",
                "facets = 'file' takes the surface as it is, and roughness.rms_mm = {rms} would "
                "change it; set rms_mm = 0, or facets = 'cut'",
                {"rms": self.roughness.rms_mm},
            )
        return self


SceneObject = Annotated[Plate | Cylinder | Box | MeshFile, Field(discriminator="kind")]


def smallest_size(body: Plate | Cylinder | Box) -> float:
    """Return the smallest extent of an object, which limits its rms height [m]."""
    return min(_sizes(body))


def largest_size(body: Plate | Cylinder | Box) -> float:
    """Return the largest extent over which heights can be correlated [m].

    Around a cylinder that is its radius: heights on opposite sides must be uncorrelated.
    """
    return body.radius_m if isinstance(body, Cylinder) else max(_sizes(body))


def _sizes(body: Plate | Cylinder | Box) -> list[float]:
    sizes = (getattr(body, key, None) for key in ("length_m", "depth_m", "height_m", "radius_m"))
    return [size for size in sizes if size is not None]
