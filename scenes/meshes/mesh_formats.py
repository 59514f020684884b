"""Mesh files as triangles: PLY, STL, OBJ and OFF, parsed from memory; no other file is opened.

The readers are our own: a library for all formats takes a second to import, which would delay
every error message about a scenario.
"""

import re
from collections.abc import Callable, Mapping

import numpy as np
from jaxtyping import Float, Int

from scenes.meshes.ply_reader import read_ply
from scenes.meshes.polygons import Polygons, triangles_of

_NUMBER = rb"\s+([^\s]+)"


def read_mesh(
    content: bytes, kind: str
) -> tuple[Float[np.ndarray, "vertices 3"], Int[np.ndarray, "faces 3"]]:
    """Read the vertices and the triangles of a mesh file.

    Colours, texture coordinates, normals and materials are passed over.

    Parameters
    ----------
    content
        The whole file.
    kind
        Key of :data:`READERS`.

    Returns
    -------
    Vertices as the file has them, in its unit, and the three corners of each triangle.

    Raises
    ------
    ValueError
        If the content is damaged or not of this format.
    """
    polygons = READERS[kind](content)
    return polygons.vertices, triangles_of(polygons)


def _stl(content: bytes) -> Polygons:
    facets = int.from_bytes(content[80:84], "little")
    # A binary file may begin with 'solid', too; its length tells.
    is_text = content.lstrip().startswith(b"solid") and len(content) != 84 + 50 * facets
    if is_text:
        found = re.findall(rb"\bvertex" + 3 * _NUMBER, content)
        vertices = np.array(found, dtype=np.float64).reshape(-1, 3)
        if len(vertices) % 3:
            raise ValueError(f"{len(vertices)} vertices make no triangles; is it truncated?")
    else:
        if len(content) < 84 or len(content) < 84 + 50 * facets:
            raise ValueError(f"{len(content)} bytes are too few for its {facets} triangles")
        row = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        rows = np.frombuffer(content, row, count=facets, offset=84)
        vertices = rows["corners"].reshape(-1, 3).astype(np.float64)
    return Polygons(
        vertices=vertices,
        corners=np.arange(len(vertices)),
        counts=np.full(len(vertices) // 3, 3),
    )


def _obj(content: bytes) -> Polygons:
    vertices: list[list[bytes]] = []
    corners: list[int] = []
    counts: list[int] = []
    for line in content.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines():
        match line.split():
            case [b"v", x, y, z, *_]:
                vertices.append([x, y, z])
            case [b"f", *places]:
                # Counted from 1; negative ones back from the vertex that was read last.
                numbers = [int(place.partition(b"/")[0]) for place in places]
                if 0 in numbers:
                    raise ValueError("a face has vertex 0, and the first is 1")
                corners += [n - 1 if n > 0 else len(vertices) + n for n in numbers]
                counts.append(len(numbers))
    return _polygons(vertices, corners, counts)


def _off(content: bytes) -> Polygons:
    lines = [words for line in content.splitlines() if (words := line.partition(b"#")[0].split())]
    if not lines or lines[0][0] not in (b"OFF", b"COFF", b"NOFF", b"CNOFF"):
        raise ValueError("it does not begin with 'OFF'")
    lines[0] = lines[0][1:]
    rows = iter(lines if lines[0] else lines[1:])
    try:
        size = [int(word) for word in next(rows)[:2]]
        vertices = [next(rows)[:3] for _ in range(size[0])]
        corners: list[int] = []
        counts: list[int] = []
        for _ in range(size[1]):
            count, *places = next(rows)
            counts.append(int(count))
            corners += [int(place) for place in places[: int(count)]]
    except (StopIteration, IndexError):
        raise ValueError("it is truncated") from None
    return _polygons(vertices, corners, counts)


def _polygons(vertices: list[list[bytes]], corners: list[int], counts: list[int]) -> Polygons:
    if sum(counts) != len(corners) or min(counts, default=0) < 0:
        raise ValueError("a face has fewer corners than it says")
    return Polygons(
        vertices=np.array(vertices, dtype=np.float64).reshape(-1, 3),
        corners=np.array(corners, dtype=np.int64),
        counts=np.array(counts, dtype=np.int64),
    )


READERS: Mapping[str, Callable[[bytes], Polygons]] = {
    "ply": read_ply,
    "stl": _stl,
    "obj": _obj,
    "off": _off,
}
"""By the end of the file's name."""
