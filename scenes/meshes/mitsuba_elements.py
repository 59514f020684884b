"""Elements of an untrusted Mitsuba XML file: parsed within limits, read one attribute at a time."""

import math
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

from scenes.schema.errors import ScenarioError, did_you_mean, shown_text

LARGEST_FILE = 10 * 2**20
"""Largest XML file that is read [byte]."""

DEEPEST = 32
"""Deepest nesting of elements; a Mitsuba scene needs five."""


def refusal(path: Path, reason: str) -> ScenarioError:
    """Say why a scene file is refused, and what to do."""
    return ScenarioError(f"scene file {shown_text(str(path))!r}: {reason}")


def parsed_scene(path: Path) -> ElementTree.Element:
    """Parse the file: no document type, no entities, no deep nesting.

    Raises
    ------
    ScenarioError
        If the file is too large, cannot be read, or is not such XML.
    """
    try:
        size = path.stat().st_size
        if not path.is_file() or not 0 < size <= LARGEST_FILE:
            raise refusal(
                path, f"a file of 1 to {LARGEST_FILE} bytes is needed, this has {size}; is it XML?"
            )
        text = path.read_bytes()
    except (OSError, ValueError) as error:
        if isinstance(error, ScenarioError):
            raise
        told = error.strerror if isinstance(error, OSError) else error
        raise refusal(path, f"{told}; give the path of a Mitsuba XML file") from None
    builder = ElementTree.TreeBuilder()
    parser = expat.ParserCreate()
    depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > DEEPEST:
            raise refusal(path, f"elements are nested deeper than {DEEPEST}; is it a scene?")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def document_type(name: str, *_: object) -> None:
        raise refusal(
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
        raise refusal(path, f"not valid XML: {shown_text(str(error))}; export it again") from None
    root: ElementTree.Element = builder.close()
    return root


def attribute(path: Path, element: ElementTree.Element, name: str) -> str:
    """Return an attribute, or refuse the file that lacks it."""
    value = element.get(name)
    if value is None:
        raise refusal(path, f"<{element.tag}> lacks the attribute {name!r}; export it again")
    if "$" in value:
        raise refusal(
            path,
            f"<{element.tag} {name}={value!r}>: parameters ($) are not filled in; write it out",
        )
    return value


def known_kind(path: Path, element: ElementTree.Element, known: tuple[str, ...]) -> str:
    """Return the element's type, or refuse one that is not known."""
    kind = attribute(path, element, "type")
    if kind not in known:
        remedy = (
            "export it as a mesh" if element.tag == "shape" else "use a diffuse or radio material"
        )
        raise refusal(
            path,
            f"<{element.tag} type={kind!r}> is not known{did_you_mean(kind, known)}; known: "
            f"{', '.join(known)}; {remedy}",
        )
    return kind


def numbers(path: Path, element: ElementTree.Element, name: str, count: int) -> list[float]:
    """Return the finite numbers of an attribute, or refuse another count of them."""
    text = attribute(path, element, name)
    try:
        values = [float(part) for part in split_numbers(text)]
        if len(values) != count or not all(map(math.isfinite, values)):
            raise ValueError
    except ValueError:
        raise refusal(
            path, f"<{element.tag} {name}={text[:60]!r}>: {count} finite numbers are needed"
        ) from None
    return values


def split_numbers(text: str) -> Iterator[str]:
    """Split a list of numbers at commas and spaces."""
    yield from text.replace(",", " ").split()
