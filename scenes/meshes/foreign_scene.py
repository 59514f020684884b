"""The table [geometry]: a foreign scene's meshes as objects, their materials given by name."""

import functools
import importlib.util
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Float
from pydantic import Field, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from scenes.meshes.mesh_file import mesh_contains
from scenes.meshes.mitsuba_xml import (
    RADIO_DEFAULTS,
    ForeignMaterial,
    ForeignShape,
    read_mitsuba_xml,
)
from scenes.schema.errors import ScenarioError, did_you_mean, problems
from scenes.schema.materials import MATERIALS, SLABS, usual_texture
from scenes.schema.objects import MeshFile
from scenes.schema.quantities import Checked

DEEP = 1e-6
"""Depth in a closed shape from which an antenna counts as within it [m]."""

_THE_FILES = ("kind", "file", "matrix", "facets")  # keys of an object that the file decides


class Geometry(Checked):
    """The table [geometry]: a scene file of another program, and the materials of its shapes."""

    file: str | None = Field(
        None,
        min_length=1,
        description="the Mitsuba or Sionna XML file, relative to the scenario's",
    )
    sionna: str | None = Field(
        None, min_length=1, description="instead of file: the name of a scene of Sionna RT's own"
    )
    facets: Literal["cut", "file"] = Field(
        "cut", description="'cut' its triangles until they are fine enough, or 'file': as they are"
    )
    beyond_itu: bool = Field(
        False,
        description="whether bands that ITU-R P.2040-4 does not cover for one of the file's "
        "materials are taken from its nearest rows",
    )
    materials: dict[str, dict[str, Any]] = Field(
        default_factory=dict,
        description="by the name of a material of the file: keys of an object, such as material "
        "and roughness",
    )
    objects: dict[str, dict[str, Any]] = Field(
        default_factory=dict,
        description="by the name of a shape of the file: the same, for this shape alone",
    )

    @model_validator(mode="after")
    def _one_source(self) -> "Geometry":
        if (self.file is None) == (self.sionna is None):
            raise PydanticCustomError(
                "geometry",
                "has {given} file and sionna; give exactly one",
                {"given": "neither" if self.file is None else "both"},
            )
        if self.sionna is not None and self.sionna not in sionna_scenes():
            raise PydanticCustomError(
                "geometry",
                "sionna = {name}: no scene of Sionna RT{hint}; known: {known}",
                {
                    "name": repr(self.sionna),
                    "hint": did_you_mean(self.sionna, sionna_scenes()),
                    "known": ", ".join(sionna_scenes()),
                },
            )
        return self

    @property
    def path(self) -> Path:
        """The scene's XML file."""
        return Path(self.file) if self.file is not None else sionna_scenes()[str(self.sionna)]


@functools.cache
def sionna_scenes() -> Mapping[str, Path]:
    """Return the XML files of the scenes that Sionna RT ships, by name, without loading it."""
    found = importlib.util.find_spec("sionna")
    folders = () if found is None else found.submodule_search_locations or ()
    return {
        file.stem: file
        for folder in folders
        for file in sorted(Path(folder).glob("rt/scenes/*/*.xml"))
        if file.stem == file.parent.name
    }


def with_geometry(data: Mapping[str, object]) -> dict[str, object]:
    """Replace a scenario's table [geometry] by an object of kind 'mesh' for each of its shapes.

    A material of the ITU-R P.2040 keeps its name and thickness unless told otherwise, a radio
    material its permittivity, conductivity and thickness; for all others the table says what they
    are. A scattering coefficient is not taken over: an object's ``roughness`` says what scatters.
    What was told about a shape goes before what was told about its material. A closed shape in
    which the base station or a user stands is a room: hollow, unless the table says otherwise.

    Parameters
    ----------
    data
        Nested tables, as a TOML file holds them; without [geometry] they stay as they are.

    Raises
    ------
    ScenarioError
        If the table or its file cannot be read, a name in the table is not one of the file, a
        material is not given, or a shape has the name of another object.
    """
    plain = dict(data)
    table = plain.pop("geometry", None)
    if table is None:
        return plain
    try:
        geometry = Geometry.model_validate(table)
    except ValidationError as error:
        lines = (
            f"geometry.{line}" if not line.startswith(":") else f"geometry{line}"
            for line in problems(error, Geometry)
        )
        raise ScenarioError("\n".join(lines)) from None
    try:
        shapes = read_mitsuba_xml(geometry.path)
    except ScenarioError as error:
        key = "file" if geometry.file is not None else "sionna"
        raise ScenarioError(f"geometry.{key}: {error}") from None
    own = plain.get("objects", {})
    if not isinstance(own, Mapping):  # the scenario's own check says so
        return plain
    found = [*_unknown(geometry, shapes), *_clashes(shapes, own)]
    objects: dict[str, object] = {}
    for shape in shapes:
        body = _body(geometry, shape)
        if "material" not in body:
            name = shape.material.name
            found.append(
                f"geometry.materials.{name}.material: missing (for shape {shape.name!r}); give one "
                f"of {', '.join(MATERIALS)}, or a table"
                if name
                else f"geometry.objects.{shape.name}.material: missing, and the file gives the "
                f"shape none; give one of {', '.join(MATERIALS)}, or a table"
            )
        objects[shape.name] = body
    if found:
        raise ScenarioError("\n".join(dict.fromkeys(found)))
    _open_rooms(objects, _antennas(plain))
    return {**plain, "objects": {**objects, **own}}


def _unknown(geometry: Geometry, shapes: tuple[ForeignShape, ...]) -> list[str]:
    tables = {
        "materials": (geometry.materials, [shape.material.name for shape in shapes]),
        "objects": (geometry.objects, [shape.name for shape in shapes]),
    }
    found = []
    for table, (given, known) in tables.items():
        for name, keys in given.items():
            place = f"geometry.{table}.{name}"
            if name not in known:
                listed = ", ".join(dict.fromkeys(word for word in known if word)) or "none"
                found.append(
                    f"{place}: no such name in {str(geometry.path)!r}{did_you_mean(name, known)}; "
                    f"known: {listed}"
                )
            found += [
                f"{place}.{key}: is decided by the file; remove it"
                for key in _THE_FILES
                if key in keys
            ]
    return found


def _clashes(shapes: tuple[ForeignShape, ...], own: Mapping[str, object]) -> list[str]:
    return [
        f"objects.{shape.name}: a shape of geometry.file has this name, too; rename the object"
        for shape in shapes
        if shape.name in own
    ]


def _body(geometry: Geometry, shape: ForeignShape) -> dict[str, object]:
    body: dict[str, object] = {
        "flat_faces": geometry.facets == "cut",  # as other path solvers take them
        **_made_of(shape.material, beyond=geometry.beyond_itu),
        **geometry.materials.get(shape.material.name, {}),
        **geometry.objects.get(shape.name, {}),
        "kind": "mesh",
        "file": str(shape.file),
        "facets": geometry.facets,
    }
    if not (shape.to_world == [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]).all():
        body["matrix"] = [float(entry) for entry in shape.to_world.ravel()]
    frozen = geometry.facets == "file" and "roughness" not in body
    if frozen and usual_texture(body.get("material")) is not None:
        # Its roughness is in its facets; without this it would get its material's usual one.
        body["roughness"] = {"rms_mm": 0.0, "correlation_mm": 1.0}
    return body


def _antennas(plain: Mapping[str, object]) -> Float[np.ndarray, "antennas 3"]:
    """Return where the base station and the users stand, as far as that can be read [m]."""
    station, users = plain.get("base_station"), plain.get("users")
    tables = [station if isinstance(station, Mapping) else {}]
    tables += list(users.values()) if isinstance(users, Mapping) else []
    places = [np.zeros((0, 3))]
    for table in tables:
        given = table.get("position_m", [0.0, 0.0]) if isinstance(table, Mapping) else None
        if isinstance(given, Sequence) and all(isinstance(one, float | int) for one in given):
            at = [float(one) for one in given][:3]
            places.append(np.array([at + [0.0] * (3 - len(at))]))
    return np.concatenate(places)


def _open_rooms(objects: dict[str, object], places: Float[np.ndarray, "antennas 3"]) -> None:
    """Make closed meshes with antennas in them shells that are seen from within: rooms."""
    for body in objects.values():
        if not isinstance(body, dict) or "hollow" in body or "solid" in body:
            continue
        try:
            mesh = MeshFile.model_validate(body)
        except ValidationError:  # the scenario's own check says so
            continue
        if mesh_contains(mesh, places, deeper_than=DEEP).any():
            body["hollow"] = True


def _made_of(material: ForeignMaterial, *, beyond: bool) -> dict[str, object]:
    """Return what the file says of a material, as keys of an object."""
    if material.slab is not None:
        return {
            "material": {
                "permittivity": [material.slab.permittivity, 0.0],
                "conductivity_s_m": material.slab.conductivity,
                "thickness_mm": material.slab.thickness * 1e3,
            }
        }
    name = material.itu_type
    if name == "metal":
        return {"material": "metal"}
    if name not in SLABS:
        return {}
    if material.thickness is None and not beyond:
        return {"material": name}
    thickness = material.thickness
    if thickness is None:
        thickness = RADIO_DEFAULTS["thickness"]
    told = {"beyond_itu": True} if beyond else {}
    return {"material": {"name": name, "thickness_mm": thickness * 1e3, **told}}
