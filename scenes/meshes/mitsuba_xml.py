"""Scenes of other programs: shapes, poses and materials from a Mitsuba or Sionna XML file.

The file is treated as untrusted. It is parsed here and never given to a renderer, so that it
cannot load plugins; it may name PLY and OBJ files in its own folder, and no others. Cameras,
lights and integrators are ignored.
"""

import hashlib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from jaxtyping import Float

from scenes.meshes.mitsuba_elements import (
    attribute,
    known_kind,
    numbers,
    parsed_scene,
    refusal,
)
from scenes.meshes.mitsuba_transforms import transform
from scenes.schema.errors import did_you_mean, shown_text
from scenes.schema.quantities import FORBIDDEN_IN_NAMES, LONGEST_NAME

MOST_SHAPES = 10_000
"""Most shapes of a foreign scene, each instance for itself: each becomes an object."""

FORMATS = ("ply", "obj")
"""Kinds of mesh file that a scene file may name."""

UNIT_SHAPES = {
    kind: Path(__file__).with_name("unit_shapes") / f"{kind}.ply" for kind in ("rectangle", "cube")
}
"""Meshes of Mitsuba's shapes without a file: both reach from -1 to 1, the rectangle faces +z."""

SHAPES = (*FORMATS, *UNIT_SHAPES, "shapegroup", "instance")
"""Kinds of shape that are read."""

BSDFS = (
    "itu-radio-material",
    "radio-material",
    "twosided",
    "diffuse",
    "principled",
    "conductor",
    "roughconductor",
    "dielectric",
    "roughdielectric",
    "thindielectric",
    "plastic",
    "roughplastic",
    "mask",
    "bumpmap",
    "normalmap",
    "null",
)
"""Kinds of material that are known. Of an ITU material its name and thickness count, of a radio
material its permittivity, conductivity and thickness, of all others the name alone."""

RADIO_DEFAULTS = {"relative_permittivity": 1.0, "conductivity": 0.0, "thickness": 0.1}
"""What Sionna RT takes for a radio material's parameters that a file leaves out [-, S/m, m]."""

_SNAKE_CASE = (2, 0, 0)  # version of a scene from which Mitsuba calls 'toWorld' to_world
_TOP = ("shape", "bsdf", "default", "sensor", "emitter", "integrator", "texture", "path")
_PARAMETERS = ("boolean", "integer", "float", "string", "rgb", "spectrum", "ref", "transform")
_LIT = ("emitter", "interior", "exterior", "texture")  # without effect on radio waves


@dataclass(frozen=True, kw_only=True)
class RadioSlab:
    """What a custom radio material of Sionna RT is made of."""

    permittivity: float  # real part, relative [-]
    conductivity: float  # [S/m]
    thickness: float  # [m]


@dataclass(frozen=True, kw_only=True)
class ForeignMaterial:
    """A material of a foreign scene, as far as the file specifies it."""

    name: str  # as in the file, without 'mat-' in front; dots and the like are underscores
    itu_type: str | None = None  # name of an ITU-R P.2040 material, if it is one
    thickness: float | None = None  # of an ITU material's slab [m]
    slab: RadioSlab | None = None


@dataclass(frozen=True, kw_only=True)
class ForeignShape:
    """A mesh of a foreign scene."""

    name: str  # as in the file, without 'mesh-' in front
    file: Path
    material: ForeignMaterial
    to_world: Float[np.ndarray, "3 4"]  # [m]


@dataclass(frozen=True, kw_only=True)
class _Names:
    """What elements refer to by their names."""

    materials: Mapping[str, ForeignMaterial]
    folders: tuple[Path, ...]  # that meshes are looked for in
    groups: dict[str, ElementTree.Element] = field(default_factory=dict)


def read_mitsuba_xml(path: Path) -> tuple[ForeignShape, ...]:
    """Read which meshes a Mitsuba or Sionna scene consists of.

    Parameters
    ----------
    path
        The XML file; its meshes must lie in its folder, or in folders within.

    Raises
    ------
    ScenarioError
        If the file cannot be read, holds a document type (and so entities), includes or
        aliases other files, has a shape or material of an unknown kind, or names a mesh that
        is no PLY or OBJ file, or lies outside of its folder.
    """
    root = parsed_scene(path)
    if root.tag != "scene":
        raise refusal(path, f"its root is <{root.tag}>; a Mitsuba scene begins with <scene>")
    for element in root:
        if element.tag not in _TOP:
            raise refusal(
                path,
                f"<{element.tag}> is not allowed{did_you_mean(element.tag, _TOP)}; put everything "
                f"into one file of {', '.join(f'<{tag}>' for tag in _TOP)}",
            )
    _fill_in_defaults(root)
    _rename_old_parameters(path, root)
    materials = {
        attribute(path, element, "id"): _material(path, element)
        for element in root.iter("bsdf")
        if "id" in element.attrib
    }
    names = _Names(materials=materials, folders=_folders(path, root))
    found: list[ForeignShape] = []
    for element in root.findall("shape"):
        if known_kind(path, element, SHAPES) == "shapegroup":
            names.groups[attribute(path, element, "id")] = element
            continue
        found += _shapes(path, element, names)
        if len(found) > MOST_SHAPES:
            raise refusal(path, f"it has more than {MOST_SHAPES} shapes; join some")
    if not found:
        raise refusal(path, "it holds no shape; export the scene's meshes with it")
    taken: set[str] = set()
    for shape in found:
        if shape.name in taken:
            raise refusal(path, f"two shapes are called {shape.name!r}; rename one of them")
        taken.add(shape.name)
    return tuple(found)


def _fill_in_defaults(root: ElementTree.Element) -> None:
    """Replace parameters ($name) by what the file's <default> elements say."""
    defaults = {one.get("name"): one.get("value", "") for one in root.findall("default")}
    for element in root.iter():
        for key, value in element.attrib.items():
            if value.startswith("$") and "$" not in defaults.get(value[1:], "$"):
                element.set(key, defaults[value[1:]])


def _rename_old_parameters(path: Path, root: ElementTree.Element) -> None:
    """Call parameters as Mitsuba 3 does; files older than version 2 write toWorld."""
    text = attribute(path, root, "version") if "version" in root.attrib else "3.0.0"
    if not re.fullmatch(r"\d{1,4}(\.\d{1,4}){0,3}", text):
        raise refusal(path, f"version = {shown_text(text)!r}; a number such as 3.0.0 is needed")
    if tuple(int(part) for part in text.split(".")) >= _SNAKE_CASE:
        return
    for element in root.iter():
        if "name" in element.attrib and element.tag in _PARAMETERS:
            old = element.attrib["name"]
            element.set("name", re.sub(r"(?<=[a-z0-9])([A-Z])", r"_\1", old).lower())


def _folders(path: Path, root: ElementTree.Element) -> tuple[Path, ...]:
    """Return the folders that meshes are looked for in: the file's own, and those of <path>."""
    home = path.resolve().parent
    inside = [_within(path, home, attribute(path, one, "value")) for one in root.findall("path")]
    return home, *inside


def _material(path: Path, element: ElementTree.Element) -> ForeignMaterial:
    kind = known_kind(path, element, BSDFS)
    name = _key(element.get("id", "").removeprefix("mat-"))
    itu_type = name[4:] if name.startswith(("itu_", "itu-")) else None  # older Sionna, Blender
    if kind == "radio-material":
        given = dict(RADIO_DEFAULTS)
        for parameter in element.findall("float"):
            if (key := parameter.get("name", "")) in given:
                given[key] = numbers(path, parameter, "value", 1)[0]
        slab = RadioSlab(
            permittivity=given["relative_permittivity"],
            conductivity=given["conductivity"],
            thickness=given["thickness"],
        )
        return ForeignMaterial(name=name, slab=slab)
    if kind == "twosided" and itu_type is None:
        for inner in element.findall("bsdf"):
            inside = _material(path, inner)
            if inside.slab is not None or inside.itu_type is not None:
                return ForeignMaterial(
                    name=name or inside.name,
                    itu_type=inside.itu_type,
                    thickness=inside.thickness,
                    slab=inside.slab,
                )
    thickness = None
    if kind == "itu-radio-material" or itu_type is not None:
        for parameter in element:
            if parameter.tag == "string" and parameter.get("name") == "type":
                itu_type = attribute(path, parameter, "value")
            if parameter.tag == "float" and parameter.get("name") == "thickness":
                thickness = numbers(path, parameter, "value", 1)[0]
        if kind == "itu-radio-material" and thickness is None:
            thickness = RADIO_DEFAULTS["thickness"]
    return ForeignMaterial(name=name, itu_type=itu_type, thickness=thickness)


def _shapes(path: Path, element: ElementTree.Element, names: _Names) -> Iterator[ForeignShape]:
    """Yield a shape, or all those of the group that an instance puts somewhere."""
    if known_kind(path, element, SHAPES) != "instance":
        yield _shape(path, element, names)
        return
    placed, group = np.eye(4), None
    for part in element:
        if part.tag == "ref":
            group = attribute(path, part, "id")
        elif part.tag == "transform":
            placed = _to_world(path, part)
    if group is None or group not in names.groups:
        raise refusal(
            path,
            f"an <instance> refers to the group {shown_text(str(group))!r}, which no <shapegroup> "
            f"before it is called{did_you_mean(str(group), names.groups)}",
        )
    children = names.groups[group].findall("shape")
    name = _key(element.get("id", group).removeprefix("mesh-"))
    for number, child in enumerate(children):
        known_kind(path, child, (*FORMATS, *UNIT_SHAPES))  # no groups within groups
        shape = _shape(path, child, names)
        whole = placed @ np.vstack([shape.to_world, [0.0, 0.0, 0.0, 1.0]])
        yield ForeignShape(
            name=name if len(children) == 1 else f"{name}_{number + 1}",
            file=shape.file,
            material=shape.material,
            to_world=whole[:3],
        )


def _shape(path: Path, element: ElementTree.Element, names: _Names) -> ForeignShape:
    kind = known_kind(path, element, SHAPES)
    file, to_world, material = UNIT_SHAPES.get(kind), np.eye(4), None
    for part in element:
        role = part.get("name")
        if part.tag == "bsdf":
            material = _material(path, part)
        elif part.tag == "ref":
            target = attribute(path, part, "id")
            material = names.materials.get(target, material)
            if material is None:
                raise refusal(
                    path,
                    f"<ref id={target!r}> refers to no material"
                    f"{did_you_mean(target, names.materials)}; known: "
                    f"{', '.join(names.materials) or 'none'}",
                )
        elif part.tag == "transform":
            to_world = _to_world(path, part)
        elif part.tag == "string" and role == "filename" and kind in FORMATS:
            file = _mesh_file(path, attribute(path, part, "value"), names.folders)
        elif part.tag not in (*_PARAMETERS, *_LIT):
            raise refusal(path, f"<{part.tag}> is not allowed in <shape>; remove it")
    if file is None:
        raise refusal(path, "a <shape> lacks its 'filename'; export it again")
    name = _key(element.get("id", file.stem).removeprefix("mesh-"))
    return ForeignShape(
        name=name,
        file=file,
        material=material or ForeignMaterial(name=""),
        to_world=to_world[:3],
    )


def _to_world(path: Path, element: ElementTree.Element) -> Float[np.ndarray, "4 4"]:
    role = element.get("name")
    if role != "to_world":
        raise refusal(
            path,
            f"<transform name={shown_text(str(role))!r}> of a shape is not known; since version "
            "2.0.0 it is called 'to_world': rename it, or write the version that the file has",
        )
    return transform(path, element)


def _key(name: str) -> str:
    """Replace what a name in a scenario must not hold: Blender's 'Cube.001' is Cube_001.

    The end of one that is too long gives way to eight hexadecimal digits of the whole, so that
    names that differ at their ends stay apart.
    """
    plain = "".join(
        "_" if sign in FORBIDDEN_IN_NAMES or not sign.isprintable() else sign for sign in name
    ).strip()
    if len(plain) <= LONGEST_NAME:
        return plain
    digest = hashlib.sha256(name.encode()).hexdigest()[:8]
    return f"{plain[: LONGEST_NAME - 9]}_{digest}"


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that no file system takes
        return False


def _mesh_file(path: Path, name: str, folders: tuple[Path, ...]) -> Path:
    if Path(name).suffix.lower().removeprefix(".") not in FORMATS:
        raise refusal(
            path, f"mesh {shown_text(name)!r}: only PLY and OBJ files are read; export it as PLY"
        )
    places = [_within(path, folder, name, home=folders[0]) for folder in folders]
    return next((place for place in places if _is_file(place)), places[0])


def _within(path: Path, folder: Path, name: str, *, home: Path | None = None) -> Path:
    """Return a place in a folder, or refuse one outside of the scene's own folder."""
    try:
        place = (folder / name).resolve()  # links followed, so that none leads out
    except (OSError, RuntimeError, ValueError) as error:
        raise refusal(path, f"{shown_text(name)!r}: {error}; rename it") from None
    if not place.is_relative_to(home or folder):
        raise refusal(path, f"mesh {name!r} lies outside of the file's own folder; copy it there")
    return place
