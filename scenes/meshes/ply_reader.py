"""PLY files, in text and binary, as polygons; colours and normals in them are passed over."""

import re
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from scenes.meshes.polygons import Polygons

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_CORNERS = ("vertex_indices", "vertex_index")

_Lists = tuple[np.ndarray, np.ndarray]  # entries of all rows, and how many each row has
_Column = np.ndarray | _Lists


@dataclass(frozen=True)
class _Element:
    """A table of the file. Its columns are numbers, or lists (types of their count and entry)."""

    name: str
    count: int
    columns: dict[str, str | tuple[str, str]] = field(default_factory=dict)


def read_ply(content: bytes) -> Polygons:
    """Read the polygons of a PLY file.

    Raises
    ------
    ValueError
        If it is not a PLY file, or is truncated.
    """
    end = re.search(rb"\bend_header[ \t]*\r?\n", content)
    if not content.startswith(b"ply") or end is None:
        raise ValueError("no header from 'ply' to 'end_header'")
    order, elements = _header(content[: end.start()].decode("latin-1"))
    body = memoryview(content)[end.end() :]
    vertices: np.ndarray | None = None
    none = np.zeros(0, dtype=np.int64)
    faces: _Lists = none, none
    tokens = body.tobytes().split() if order is None else []
    at = 0  # a token of a text, a byte of a binary file
    for element in elements:
        if order is None:
            table, at = _text(tokens, at, element)
        else:
            table, at = _binary(body, at, element, order)
        if element.name == "vertex":
            vertices = np.stack([_coordinate(table, axis) for axis in "xyz"], axis=-1)
        for name in _CORNERS:
            column = table.get(name)
            if element.name == "face" and isinstance(column, tuple):
                faces = column
    if vertices is None:
        raise ValueError("no element 'vertex'")
    return Polygons(vertices=vertices, corners=faces[0].astype(np.int64), counts=faces[1])


def _header(text: str) -> tuple[str | None, list[_Element]]:
    """Return the byte order (None: text) and the tables."""
    orders = {"ascii": None, "binary_little_endian": "<", "binary_big_endian": ">"}
    formats: list[str] = []
    elements: list[_Element] = []
    for line in text.splitlines()[1:]:
        match line.split():
            case ["format", kind, _] if kind in orders:
                formats.append(kind)
            case ["element", name, count] if count.isdecimal():
                elements.append(_Element(name, int(count)))
            case ["property", "list", count, entry, name] if (
                elements and count in _TYPES and entry in _TYPES
            ):
                elements[-1].columns[name] = (_TYPES[count], _TYPES[entry])
            case ["property", kind, name] if elements and kind in _TYPES:
                elements[-1].columns[name] = _TYPES[kind]
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise ValueError(f"its header has a line {line[:60]!r}")
    if len(formats) != 1:
        raise ValueError("its header must have one line 'format'")
    return orders[formats[0]], elements


def _coordinate(table: dict[str, _Column], axis: str) -> Float[np.ndarray, " rows"]:
    column = table.get(axis)
    if not isinstance(column, np.ndarray):
        raise ValueError(f"its vertices lack a number {axis!r}")
    return column.astype(np.float64)


def _text(tokens: list[bytes], at: int, element: _Element) -> tuple[dict[str, _Column], int]:
    """Read a table of a text file from its tokens; return it, and where the next one begins."""
    columns = list(element.columns.items())
    if len(columns) == 1 and isinstance(columns[0][1], tuple):
        counts, entries = [], []
        for _ in range(element.count):
            length = int(tokens[at]) if at < len(tokens) else -1
            if not 0 <= length <= len(tokens) - at - 1:
                raise ValueError(f"its element {element.name!r} is truncated")
            counts.append(length)
            entries += tokens[at + 1 : at + 1 + length]
            at += 1 + length
        lists = np.array(entries, dtype=np.float64), np.array(counts, dtype=np.int64)
        return {columns[0][0]: lists}, at
    if any(isinstance(kind, tuple) for _, kind in columns):
        return _mixed_text(tokens, at, element)
    width = len(columns)
    if element.count * width > len(tokens) - at:
        raise ValueError(f"its element {element.name!r} is truncated")
    last = at + element.count * width
    rows = np.array(tokens[at:last], dtype=np.float64).reshape(element.count, width)
    return {name: rows[:, place] for place, (name, _) in enumerate(columns)}, last


def _mixed_text(tokens: list[bytes], at: int, element: _Element) -> tuple[dict[str, _Column], int]:
    """Read rows of numbers and lists, one after the other."""
    numbers: dict[str, list[bytes]] = {name: [] for name in element.columns}
    counts: dict[str, list[int]] = {name: [] for name in element.columns}
    for _ in range(element.count):
        for name, kind in element.columns.items():
            length = 1
            if isinstance(kind, tuple):
                length = int(tokens[at]) if at < len(tokens) else -1
                counts[name].append(length)
                at += 1
            if not 0 <= length <= len(tokens) - at:
                raise ValueError(f"its element {element.name!r} is truncated")
            numbers[name] += tokens[at : at + length]
            at += length
    return _table(element, numbers, counts), at


def _binary(
    body: memoryview, at: int, element: _Element, order: str
) -> tuple[dict[str, _Column], int]:
    """Read a table of a binary file; return it, and the byte at which the next one begins."""
    rows, end = _alike(body, at, element, order)
    if rows is None:
        return _mixed_binary(body, at, element, order)
    table: dict[str, _Column] = {}
    for name, kind in element.columns.items():
        if isinstance(kind, tuple):
            counts = rows[f"count of {name}"].astype(np.int64)
            table[name] = rows[name].reshape(-1), counts
        else:
            table[name] = rows[name]
    return table, end


def _alike(
    body: memoryview, at: int, element: _Element, order: str
) -> tuple[np.ndarray | None, int]:
    """Read all rows at once if every list is as long as that of the first row; else return None."""
    fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
    end = at
    for name, kind in element.columns.items():
        if isinstance(kind, str):
            fields.append((name, order + kind))
        else:
            length = 0
            if element.count:
                length = int(_values(body, end, order + kind[0], 1)[0])
                if not 0 <= length <= len(body):
                    raise ValueError(f"its element {element.name!r} is truncated")
            fields += [(f"count of {name}", order + kind[0]), (name, order + kind[1], (length,))]
        end = at + np.dtype(fields).itemsize
    layout = np.dtype(fields)
    if element.count * layout.itemsize > len(body) - at:
        return None, at
    rows = np.frombuffer(body, layout, count=element.count, offset=at)
    for name, kind in element.columns.items():
        if isinstance(kind, tuple) and np.any(rows[f"count of {name}"] != rows[name].shape[1]):
            return None, at
    return rows, at + element.count * layout.itemsize


def _mixed_binary(
    body: memoryview, at: int, element: _Element, order: str
) -> tuple[dict[str, _Column], int]:
    """Read rows of lists of several lengths, one after the other."""
    if not any(isinstance(kind, tuple) for kind in element.columns.values()):
        raise ValueError(f"its element {element.name!r} is truncated")
    numbers: dict[str, list[np.ndarray]] = {name: [] for name in element.columns}
    counts: dict[str, list[int]] = {name: [] for name in element.columns}
    for _ in range(element.count):
        for name, kind in element.columns.items():
            length = 1
            if isinstance(kind, tuple):
                length = int(_values(body, at, order + kind[0], 1)[0])
                at += np.dtype(kind[0]).itemsize
                counts[name].append(length)
            entry = order + (kind[1] if isinstance(kind, tuple) else kind)
            numbers[name].append(_values(body, at, entry, length))
            at += length * np.dtype(entry).itemsize
    joined = {name: np.concatenate(values) for name, values in numbers.items() if values}
    return _table(element, joined, counts), at


def _values(body: memoryview, at: int, kind: str, count: int) -> np.ndarray:
    if count < 0 or at + count * np.dtype(kind).itemsize > len(body):
        raise ValueError("it is truncated")
    return np.frombuffer(body, kind, count=count, offset=at)


def _table(
    element: _Element,
    numbers: dict[str, list[bytes]] | dict[str, np.ndarray],
    counts: dict[str, list[int]],
) -> dict[str, _Column]:
    table: dict[str, _Column] = {}
    for name, kind in element.columns.items():
        values = np.array(numbers.get(name, []), dtype=np.float64)
        if isinstance(kind, tuple):
            table[name] = values, np.array(counts[name], dtype=np.int64)
        else:
            table[name] = values
    return table
