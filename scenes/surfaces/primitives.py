"""Plates, cylinders and boxes as grids of facets: lines in 2-D, triangles in 3-D."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from scenes.schema.objects import Body, Box, Cylinder, Plate
from scenes.surfaces.facet_spacing import steps, steps_round
from scenes.surfaces.heights import Heights
from scenes.surfaces.shape import Shape, grid_triangles
from scenes.surfaces.tiled_faces import Face, Reach, TiledFace, tiled_face

_UP = np.array([0.0, 0.0, 1.0])


def upright_shape(body: Plate | Cylinder | Box, spacing: float, heights: Heights) -> Shape:
    """Cut an upright object into facets.

    Parameters
    ----------
    body
        The object; one without a height is two-dimensional.
    spacing
        Largest distance of neighbouring vertices along the grid's two directions. [m]
    heights
        Where the heights over the mean shape come from.
    """
    match body:
        case Plate():
            return _plate(body, spacing, heights)
        case Cylinder(height_m=None):
            return _circle(body, spacing, heights)
        case Cylinder():
            return _cylinder(body, spacing, heights)
        case Box(height_m=None):
            return _rectangle(body, spacing, heights)
        case Box():
            return _box(body, spacing, heights)


def shape_in_reach(
    body: Plate | Cylinder | Box, spacing: float, heights: Heights, reach: Reach
) -> Shape:
    """Cut an upright object of a 3-D scene into facets where they are needed.

    The heights are those of the whole object. Plates and smooth boxes are made in reach only;
    others are made as a whole first.

    Parameters
    ----------
    body, spacing, heights
        See :func:`upright_shape`.
    reach
        Where facets are needed; elsewhere triangles only block rays.
    """
    match body:
        case Plate(height_m=float() as height):
            # Its normal, tangent x up, is that of a face with these sides.
            along, rise = body.length_m * body.tangent, height * _UP
            face = Face(corner=body.centre - (along + rise) / 2, first=along, second=rise)
            return _joined([tiled_face(face, spacing, reach, heights.sheet)])
        case Box(height_m=float() as height) if heights.smooth:
            return _joined(
                [tiled_face(face, spacing, reach, heights.sheet) for face in _faces(body, height)]
            )
        case _:
            return in_reach(upright_shape(body, spacing, heights), reach)


def in_reach(shape: Shape, reach: Reach) -> Shape:
    """Keep as scattering facets only those in reach; the others only block rays."""
    corners = shape.mean_vertices[shape.cells]
    centres = corners.mean(axis=1)
    radius = float(np.linalg.norm(corners - centres[:, None], axis=-1).max(initial=0.0))
    wanted = reach(centres, radius)
    return Shape(
        vertices=shape.vertices,
        mean_vertices=shape.mean_vertices,
        cells=shape.cells[wanted],
        screens=shape.cells[~wanted],
    )


def _faces(box: Box, height: float) -> list[Face]:
    sides = [box.length_m * box.tangent, box.depth_m * box.across, height * _UP]
    corner = box.centre - (sides[0] + sides[1] + sides[2]) / 2
    faces = []
    for axis in range(3):
        first, second = sides[(axis + 1) % 3], sides[(axis + 2) % 3]
        faces.append(Face(corner=corner, first=second, second=first))
        faces.append(Face(corner=corner + sides[axis], first=first, second=second))
    return faces


def _joined(faces: Sequence[TiledFace]) -> Shape:
    starts = np.cumsum([0, *(len(face.vertices) for face in faces)])[:-1]
    return Shape(
        vertices=np.concatenate([face.vertices for face in faces]),
        mean_vertices=np.concatenate([face.mean_vertices for face in faces]),
        cells=np.concatenate([face.cells + s for face, s in zip(faces, starts, strict=True)]),
        screens=np.concatenate([face.screens + s for face, s in zip(faces, starts, strict=True)]),
    )


def _chain(count: int, *, closed: bool) -> Int[np.ndarray, "cells 2"]:
    first = np.arange(count if closed else count - 1)
    return np.stack([first, (first + 1) % count], axis=-1)


def _plate(plate: Plate, spacing: float, heights: Heights) -> Shape:
    along = steps(plate.length_m, spacing) + 1
    offsets = plate.length_m * np.linspace(-0.5, 0.5, along)[:, None] * plate.tangent
    if plate.height_m is None:
        mean = plate.centre + offsets
        height, cells = heights.line(plate.length_m, along), _chain(along, closed=False)
    else:
        up = steps(plate.height_m, spacing) + 1
        rise = plate.height_m * np.linspace(-0.5, 0.5, up)[:, None] * _UP
        mean = (plate.centre + offsets[:, None] + rise).reshape(-1, 3)
        height = heights.sheet((plate.length_m, plate.height_m), (along, up)).ravel()
        cells = grid_triangles(np.arange(along * up).reshape(along, up))
    vertices = mean + height[:, None] * plate.normal
    return Shape(vertices=vertices, mean_vertices=mean, cells=cells)


def _radial(body: Body, around: int) -> Float[np.ndarray, "around 3"]:
    turn = 2 * np.pi * np.arange(around)[:, None] / around
    outward: np.ndarray = np.cos(turn) * body.tangent + np.sin(turn) * body.across
    return outward


def _circle(cylinder: Cylinder, spacing: float, heights: Heights) -> Shape:
    around = steps_round(cylinder.radius_m, spacing)
    outward = _radial(cylinder, around)
    height = heights.line(2 * np.pi * cylinder.radius_m, around, periodic=True)
    return Shape(
        vertices=cylinder.centre + (cylinder.radius_m + height)[:, None] * outward,
        mean_vertices=cylinder.centre + cylinder.radius_m * outward,
        cells=_chain(around, closed=True),
    )


def _cylinder(cylinder: Cylinder, spacing: float, heights: Heights) -> Shape:
    """Side and two caps; a cap's rim moves with the side, the side's ends with the caps."""
    radius, tall = cylinder.radius_m, float(cylinder.height_m or 0.0)
    around, up = steps_round(radius, spacing), steps(tall, spacing)
    rings = steps(radius, spacing)
    outward = _radial(cylinder, around)
    side = heights.sheet((2 * np.pi * radius, tall), (around, up + 1), periodic=(True, False))
    bottom, top = (_cap_heights(radius, rings, around, heights) for _ in range(2))

    # (radius, rise) and their displacements, over (around, up) and per cap over (around, rings)
    level = np.linspace(0.0, 1.0, up + 1)
    inner = np.arange(1, rings) / rings
    fading = _fading(radius * (1 - inner), radius, heights)
    pulled = _between(tall * level, tall, bottom[:, -1:], top[:, -1:], heights)
    parts = [
        (np.ones(up + 1), level, side, pulled),
        (inner, np.zeros(rings - 1), fading * side[:, :1], -bottom[:, 1:-1]),
        (inner, np.ones(rings - 1), fading * side[:, -1:], top[:, 1:-1]),
    ]
    mean, moved = [], []
    for share, rise, radial, axial in parts:
        place = radius * share[:, None] * outward[:, None] + tall * (rise - 0.5)[:, None] * _UP
        mean.append(place.reshape(-1, 3))
        shift = radial[..., None] * outward[:, None] + axial[..., None] * _UP
        moved.append((place + shift).reshape(-1, 3))
    middles = np.stack([-tall / 2 * _UP, tall / 2 * _UP])
    mean.append(middles)
    moved.append(middles + np.stack([-bottom[0, 0] * _UP, top[0, 0] * _UP]))

    side_ids = np.arange(around * (up + 1)).reshape(around, up + 1)
    cap_ids = side_ids.size + np.arange(2 * around * (rings - 1)).reshape(2, around, rings - 1)
    below = np.concatenate([cap_ids[0], side_ids[:, :1]], axis=1)
    above = np.concatenate([cap_ids[1], side_ids[:, -1:]], axis=1)
    low, high = side_ids.size + cap_ids.size + np.arange(2)
    here, after = np.arange(around), np.roll(np.arange(around), -1)
    cells = [
        grid_triangles(_wrapped(side_ids)),
        grid_triangles(_wrapped(below)),  # around x outward points down
        grid_triangles(_wrapped(above).T),
        np.stack([np.full(around, low), below[after, 0], below[here, 0]], axis=-1),
        np.stack([np.full(around, high), above[here, 0], above[after, 0]], axis=-1),
    ]
    return Shape(
        vertices=cylinder.centre + np.concatenate(moved),
        mean_vertices=cylinder.centre + np.concatenate(mean),
        cells=np.concatenate(cells),
    )


def _wrapped(ids: Int[np.ndarray, "around n"]) -> Int[np.ndarray, "around_and_one n"]:
    return np.concatenate([ids, ids[:1]])


def _cap_heights(
    radius: float, rings: int, around: int, heights: Heights
) -> Float[np.ndarray, "around rings_and_middle"]:
    share = np.linspace(0.0, 1.0, rings + 1)
    turn = 2 * np.pi * np.arange(around)[:, None] / around
    places = radius * np.stack([share * np.cos(turn), share * np.sin(turn)], axis=-1)
    return heights.at(places.reshape(-1, 2)).reshape(around, rings + 1)


def _rectangle(box: Box, spacing: float, heights: Heights) -> Shape:
    sides = np.array([box.length_m, box.depth_m])
    nx, ny = (steps(float(side), spacing) for side in sides)
    i = np.concatenate([np.arange(nx), np.full(ny, nx), np.arange(nx, 0, -1), np.zeros(ny, int)])
    j = np.concatenate([np.zeros(nx, int), np.arange(ny), np.full(nx, ny), np.arange(ny, 0, -1)])
    index = np.stack([i, j], axis=-1)
    counts = np.array([nx, ny])
    shift = np.zeros((len(index), 2))
    for axis in (0, 1):
        other = 1 - axis
        low, high = (heights.line(float(sides[other]), int(counts[other]) + 1) for _ in range(2))
        across = index[:, other]
        side, place = float(sides[axis]), index[:, axis] * (sides[axis] / counts[axis])
        shift[:, axis] = _between(place, side, low[across], high[across], heights)
    return _placed(box, sides * (index / counts - 0.5), shift, _chain(len(index), closed=True))


def _box(box: Box, spacing: float, heights: Heights) -> Shape:
    sides = np.array([box.length_m, box.depth_m, float(box.height_m or 0.0)])
    counts = np.array([steps(float(side), spacing) for side in sides])
    weights = np.array([(counts[1] + 1) * (counts[2] + 1), counts[2] + 1, 1])
    keys = []
    for axis in range(3):
        first, second = (axis + 1) % 3, (axis + 2) % 3  # first x second points along the axis
        grid = (
            np.arange(counts[first] + 1)[:, None] * weights[first]
            + np.arange(counts[second] + 1) * weights[second]
        )
        keys.append(grid_triangles(grid.T))
        keys.append(grid_triangles(grid + counts[axis] * weights[axis]))
    nodes, ids = np.unique(np.concatenate(keys), return_inverse=True)
    index = np.stack(
        [nodes // weights[0], nodes % weights[0] // weights[1], nodes % weights[1]], axis=-1
    )
    shift = np.zeros((len(index), 3))
    for axis in range(3):
        a, b = (other for other in range(3) if other != axis)
        size, count = (float(sides[a]), float(sides[b])), (int(counts[a]) + 1, int(counts[b]) + 1)
        low, high = (heights.sheet(size, count) for _ in range(2))
        at = index[:, a], index[:, b]
        side, place = float(sides[axis]), index[:, axis] * (sides[axis] / counts[axis])
        shift[:, axis] = _between(place, side, low[at], high[at], heights)
    return _placed(box, sides * (index / counts - 0.5), shift, ids.reshape(-1, 3))


def _between(
    place: Float[np.ndarray, "*#n"],
    side: float,
    low: Float[np.ndarray, "*#n"],
    high: Float[np.ndarray, "*#n"],
    heights: Heights,
) -> Float[np.ndarray, "*n"]:
    """Displacement along an axis from the outward heights of the faces at its two ends.

    On those faces it is their height; between them it fades, so that the faces in between
    reach the displaced edges and are otherwise left alone.
    """
    near_low, near_high = (_fading(way, side / 2, heights) for way in (place, side - place))
    shift: np.ndarray = near_high * high - near_low * low
    return shift


def _fading(
    way: Float[np.ndarray, "*n"], longest: float, heights: Heights
) -> Float[np.ndarray, "*n"]:
    """Share of an edge's displacement that is left at a distance from the edge."""
    return np.maximum(0.0, 1.0 - way / min(longest, heights.edge_zone))


def _placed(
    box: Box,
    local: Float[np.ndarray, "vertices axes"],
    shift: Float[np.ndarray, "vertices axes"],
    cells: Int[np.ndarray, "cells corners"],
) -> Shape:
    axes = np.stack([box.tangent, box.across, _UP])[: local.shape[1]]
    mean = box.centre + local @ axes
    return Shape(vertices=mean + shift @ axes, mean_vertices=mean, cells=cells)
