"""Foreign scenes: which meshes and materials a Mitsuba or Sionna XML file puts where.

The file is taken for untrusted. It is parsed here and never handed to a renderer, so that no
plugin of it runs; it may name PLY and OBJ files in its own folder, and no others. Cameras,
lights and integrators are left alone.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np
from jaxtyping import Float

from scenes.schema.errors import ScenarioError, did_you_mean, shown_text
from scenes.schema.quantities import FORBIDDEN_IN_NAMES

LARGEST_FILE = 10 * 2**20
"""Largest XML file that is read [byte]."""

MOST_SHAPES = 2000
"""Most shapes of a foreign scene: each becomes an object."""

DEEPEST = 32
"""Deepest nesting of elements; a Mitsuba scene needs five."""

SHAPES = ("ply", "obj")
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
"""Kinds of material that are known; of their parameters only an ITU material's name counts."""

_TOP = ("shape", "bsdf", "default", "sensor", "emitter", "integrator", "texture")
_PARAMETERS = ("boolean", "integer", "float", "string", "rgb", "spectrum", "ref", "transform")


@dataclass(frozen=True, kw_only=True)
class ForeignMaterial:
    """A material of a foreign scene, as far as it can be told."""

    name: str  # as in the file, without 'mat-' in front; dots and the like are underscores
    itu_type: str | None  # name of an ITU-R P.2040 material, if it is one
    thickness: float | None  # of an ITU material's slab [m]


@dataclass(frozen=True, kw_only=True)
class ForeignShape:
    """A mesh of a foreign scene."""

    name: str  # as in the file, without 'mesh-' in front
    file: Path
    material: ForeignMaterial
    to_world: Float[np.ndarray, "3 4"]  # [m]


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
    root = _parsed(path)
    if root.tag != "scene":
        raise _refusal(path, f"its root is <{root.tag}>; a Mitsuba scene begins with <scene>")
    for element in root:
        if element.tag not in _TOP:
            raise _refusal(
                path,
                f"<{element.tag}> is not allowed{did_you_mean(element.tag, _TOP)}; put everything "
                f"into one file of {', '.join(f'<{tag}>' for tag in _TOP)}",
            )
    materials = {
        _attribute(path, element, "id"): _material(path, element)
        for element in root.iter("bsdf")
        if "id" in element.attrib
    }
    shapes = root.findall("shape")
    if len(shapes) > MOST_SHAPES:
        raise _refusal(path, f"{len(shapes)} shapes are more than {MOST_SHAPES}; join some")
    found = tuple(_shape(path, shape, materials) for shape in shapes)
    if not found:
        raise _refusal(path, "it holds no shape; export the scene's meshes with it")
    names = [shape.name for shape in found]
    for name in names:
        if names.count(name) > 1:
            raise _refusal(path, f"two shapes are called {name!r}; rename one of them")
    return found


def _refusal(path: Path, reason: str) -> ScenarioError:
    return ScenarioError(f"scene file {shown_text(str(path))!r}: {reason}")


def _parsed(path: Path) -> ElementTree.Element:
    try:
        size = path.stat().st_size
        if not path.is_file() or not 0 < size <= LARGEST_FILE:
            raise _refusal(
                path, f"a file of 1 to {LARGEST_FILE} bytes is needed, this has {size}; is it XML?"
            )
        text = path.read_bytes()
    except (OSError, ValueError) as error:
        if isinstance(error, ScenarioError):
            raise
        told = error.strerror if isinstance(error, OSError) else error
        raise _refusal(path, f"{told}; give the path of a Mitsuba XML file") from None
    builder = ElementTree.TreeBuilder()
    parser = expat.ParserCreate()
    depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > DEEPEST:
            raise _refusal(path, f"elements are nested deeper than {DEEPEST}; is it a scene?")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def document_type(name: str, *_: object) -> None:
        raise _refusal(
            path,
            f"it declares a document type ({name!r}), and with it perhaps entities that read "
            "other files or grow without end; remove <!DOCTYPE …>",
        )

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler = document_type
    try:
        parser.Parse(text, True)
    # Of an encoding that it does not know, expat says so by other exceptions.
    except (expat.ExpatError, ValueError, LookupError) as error:
        if isinstance(error, ScenarioError):
            raise
        raise _refusal(path, f"not valid XML: {shown_text(str(error))}; export it again") from None
    root: ElementTree.Element = builder.close()
    return root


def _attribute(path: Path, element: ElementTree.Element, name: str) -> str:
    value = element.get(name)
    if value is None:
        raise _refusal(path, f"<{element.tag}> lacks the attribute {name!r}; export it again")
    if "$" in value:
        raise _refusal(
            path,
            f"<{element.tag} {name}={value!r}>: parameters ($) are not filled in; write it out",
        )
    return value


def _kind(path: Path, element: ElementTree.Element, known: tuple[str, ...]) -> str:
    kind = _attribute(path, element, "type")
    if kind not in known:
        remedy = (
            "export it as a mesh" if element.tag == "shape" else "use a diffuse or radio material"
        )
        raise _refusal(
            path,
            f"<{element.tag} type={kind!r}> is not known{did_you_mean(kind, known)}; known: "
            f"{', '.join(known)}; {remedy}",
        )
    return kind


def _material(path: Path, element: ElementTree.Element) -> ForeignMaterial:
    kind = _kind(path, element, BSDFS)
    name = _key(element.get("id", "").removeprefix("mat-"))
    itu_type, thickness = None, None
    if name.startswith(("itu_", "itu-")):  # as older Sionna and Blender write them
        itu_type = name[4:]
    if kind == "itu-radio-material" or itu_type is not None:
        for parameter in element:
            if parameter.tag == "string" and parameter.get("name") == "type":
                itu_type = _attribute(path, parameter, "value")
            if parameter.tag == "float" and parameter.get("name") == "thickness":
                thickness = _numbers(path, parameter, "value", 1)[0]
    return ForeignMaterial(name=name, itu_type=itu_type, thickness=thickness)


def _shape(
    path: Path, element: ElementTree.Element, materials: Mapping[str, ForeignMaterial]
) -> ForeignShape:
    _kind(path, element, SHAPES)
    file, to_world, material = None, np.eye(4), None
    for part in element:
        role = part.get("name")
        if part.tag == "bsdf":
            material = _material(path, part)
        elif part.tag == "ref":
            target = _attribute(path, part, "id")
            material = materials.get(target, material)
            if material is None:
                raise _refusal(
                    path,
                    f"<ref id={target!r}> refers to no material"
                    f"{did_you_mean(target, materials)}; known: {', '.join(materials) or 'none'}",
                )
        elif part.tag == "transform" and role == "to_world":
            to_world = _transform(path, part)
        elif part.tag == "string" and role == "filename":
            file = _mesh_file(path, _attribute(path, part, "value"))
        elif part.tag not in _PARAMETERS:
            raise _refusal(path, f"<{part.tag}> is not allowed in <shape>; remove it")
    if file is None:
        raise _refusal(path, "a <shape> lacks its 'filename'; export it again")
    name = _key(element.get("id", file.stem).removeprefix("mesh-"))
    if material is None:
        material = ForeignMaterial(name="", itu_type=None, thickness=None)
    return ForeignShape(name=name, file=file, material=material, to_world=to_world[:3])


def _key(name: str) -> str:
    """Replace what a name in a scenario must not hold: Blender's 'Cube.001' is Cube_001."""
    return "".join("_" if sign in FORBIDDEN_IN_NAMES else sign for sign in name)


def _mesh_file(path: Path, name: str) -> Path:
    folder = path.resolve().parent
    if Path(name).suffix.lower().removeprefix(".") not in SHAPES:
        raise _refusal(path, f"mesh {name!r}: only PLY and OBJ files are read; export it as PLY")
    try:
        file = (folder / name).resolve()  # links followed, so that none leads out
    except (OSError, RuntimeError, ValueError) as error:
        raise _refusal(path, f"mesh {shown_text(name)!r}: {error}; rename it") from None
    if not file.is_relative_to(folder):
        raise _refusal(path, f"mesh {name!r} lies outside of the file's own folder; copy it there")
    return file


def _transform(path: Path, element: ElementTree.Element) -> Float[np.ndarray, "4 4"]:
    """Multiply the steps of a transform; each acts after those above it."""
    whole = np.eye(4)
    for step in element:
        match step.tag:
            case "matrix":
                matrix = _matrix(path, step)
            case "translate":
                matrix = _moved(_triple(path, step, 0.0))
            case "scale":
                matrix = np.diag([*_triple(path, step, 1.0), 1.0])
            case "rotate":
                matrix = _rotation(path, step)
            case _:
                raise _refusal(
                    path,
                    f"<{step.tag}> in a transform is not known; use matrix, translate, scale or "
                    "rotate",
                )
        whole = matrix @ whole
    return whole


def _matrix(path: Path, step: ElementTree.Element) -> Float[np.ndarray, "4 4"]:
    matrix = np.array(_numbers(path, step, "value", 16)).reshape(4, 4)
    if not np.array_equal(matrix[3], [0.0, 0.0, 0.0, 1.0]):
        raise _refusal(
            path, f"the last row of a matrix is {matrix[3].tolist()}; it must be 0 0 0 1"
        )
    return matrix


def _moved(offset: list[float]) -> Float[np.ndarray, "4 4"]:
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    return matrix


def _rotation(path: Path, step: ElementTree.Element) -> Float[np.ndarray, "4 4"]:
    axis = np.array(_triple(path, step, 0.0))
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        raise _refusal(path, "a <rotate> has no axis; give x, y or z")
    turn = math.radians(_numbers(path, step, "angle", 1)[0])
    x, y, z = axis / length
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix = np.eye(4)  # Rodrigues
    matrix[:3, :3] += math.sin(turn) * cross + (1.0 - math.cos(turn)) * cross @ cross
    return matrix


def _triple(path: Path, step: ElementTree.Element, missing: float) -> list[float]:
    if "value" in step.attrib:
        numbers = list(_split(step.attrib["value"]))
        count = 1 if len(numbers) == 1 and step.tag == "scale" else 3
        values = _numbers(path, step, "value", count)
        return values * 3 if count == 1 else values
    return [_numbers(path, step, axis, 1)[0] if axis in step.attrib else missing for axis in "xyz"]


def _numbers(path: Path, element: ElementTree.Element, name: str, count: int) -> list[float]:
    text = _attribute(path, element, name)
    try:
        values = [float(part) for part in _split(text)]
        if len(values) != count or not all(map(math.isfinite, values)):
            raise ValueError
    except ValueError:
        raise _refusal(
            path, f"<{element.tag} {name}={text[:60]!r}>: {count} finite numbers are needed"
        ) from None
    return values


def _split(text: str) -> Iterator[str]:
    yield from text.replace(",", " ").split()
