"""Checks of positions: arrays inside walls, users inside boxes, solids that overlap.

Plates, cylinders and boxes stand upright and are convex, so the signed distance to each is
exact and convex, and so is its least value along a row of elements.
"""

import math
from collections.abc import Iterator, Mapping

import numpy as np
from jaxtyping import Float

from scenes.meshes.mesh_file import mesh_contains, mesh_distance, placed_mesh
from scenes.schema.objects import Box, Cylinder, MeshFile, Plate

TOUCHING = 1e-6
"""Depth to which solids may overlap and still count as touching [m]."""

_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0

Upright = Plate | Cylinder | Box


def inconsistencies(
    objects: Mapping[str, Upright | MeshFile],
    *,
    array: Float[np.ndarray, "along up 3"] | None,
    users: Mapping[str, Float[np.ndarray, " 3"]],
    clearance: float,
) -> list[str]:
    """Find overlapping solids, and antennas inside objects or too close to them.

    Parameters
    ----------
    objects
        The objects by name; a mesh is tested by its triangles and its vertices.
    array
        Elements of the base station, in rows along its axis and columns along z; None: it has
        no array. [m]
    users
        Positions by name. [m]
    clearance
        Distance that antennas keep from surfaces and from each other: closer, they are in the
        reactive near field. [m]

    Returns
    -------
    A line for each problem, with the keys, the values, the limit and the remedy.
    """
    needed = f"{clearance * 1e3:.3g} mm (the longest wavelength)"
    found = []
    for name, body in objects.items():
        distance, place = math.inf, np.zeros(3)
        if array is not None:
            distance, place = _nearest_of_array(body, array, clearance)
        if array is not None and distance < clearance:
            found.append(
                f"base_station.position_m = {_xyz(array.mean(axis=(0, 1)))}: the array is "
                f"{_closeness(body, distance)} objects.{name} at {_xyz(place)} m; it must keep "
                f"{needed} away; move the array or the object{_room(body, distance)}"
            )
        for user, position in users.items():
            distance = float(_distances(body, position[None, :], clearance)[0])
            if distance < clearance:
                found.append(
                    f"users.{user}.position_m = {_xyz(position)}: is "
                    f"{_closeness(body, distance)} objects.{name}; it must keep {needed} away; "
                    f"move the user or the object{_room(body, distance)}"
                )
    for user, position in users.items() if array is not None else ():
        distance = float(np.linalg.norm(array - position, axis=-1).min())
        if distance < clearance:
            found.append(
                f"users.{user}.position_m = {_xyz(position)}: is {distance * 1e3:.3g} mm from an "
                f"element of the base station; it must keep {needed} away; move the user"
            )
    for (first, one), (second, other) in _near_pairs(objects):
        if _overlap(one, other):
            found.append(
                f"objects.{second}.centre_m = {_xyz(np.array(other.centre_m))}: the solid "
                f"overlaps objects.{first}; solids may touch (to {TOUCHING * 1e6:g} µm), not "
                "overlap; move or shrink one of them"
            )
    return found


def crowded_antennas(
    objects: Mapping[str, Upright | MeshFile],
    *,
    key: str,
    positions: Float[np.ndarray, "positions 3"],
    clearance: float,
) -> list[str]:
    """Find antennas that stand too close to an object, each by itself.

    Parameters
    ----------
    objects
        The objects by name.
    key
        Where the scenario gives the positions.
    positions
        Of the antennas. [m]
    clearance
        Distance that antennas keep from surfaces. [m]

    Returns
    -------
    A line for each object, with the antenna that is nearest to it.
    """
    found = []
    for name, body in objects.items():
        distances = _distances(body, positions, clearance)
        nearest = int(np.argmin(distances))
        if distances[nearest] < clearance:
            found.append(
                f"{key}: the antenna at {_xyz(positions[nearest])} m is "
                f"{_closeness(body, float(distances[nearest]))} objects.{name}; it must keep "
                f"{clearance * 1e3:.3g} mm (the longest wavelength) away; move the antenna or "
                "the object"
            )
    return found


def signed_distance(
    body: Upright, points: Float[np.ndarray, "points 3"]
) -> Float[np.ndarray, " points"]:
    """Distance from points to the surface of an upright object, negative inside [m].

    Without a height the object is invariant along z.
    """
    offset = points - body.centre
    half_height = math.inf if body.height_m is None else body.height_m / 2
    if isinstance(body, Cylinder):
        radius = np.hypot(offset[..., 0], offset[..., 1])
        beyond = [radius - body.radius_m]
    else:
        depth = body.depth_m if isinstance(body, Box) else 0.0
        beyond = [
            np.abs(offset @ body.tangent) - body.length_m / 2,
            np.abs(offset @ body.across) - depth / 2,
        ]
    excess = np.stack([*beyond, np.abs(offset[..., 2]) - half_height], axis=-1)
    outside = np.linalg.norm(np.maximum(excess, 0.0), axis=-1)
    signed: np.ndarray = outside + np.minimum(excess.max(axis=-1), 0.0)
    return signed


def _nearest_of_array(
    body: Upright | MeshFile, array: Float[np.ndarray, "along up 3"], clearance: float
) -> tuple[float, Float[np.ndarray, " 3"]]:
    """Nearest point of the array's rows and columns to an object, and its distance."""
    if isinstance(body, MeshFile):
        points = array.reshape(-1, 3)
    else:
        # Along each row and each column the distance is convex: golden-section search. It
        # also finds a thin plate that stands between two elements.
        starts = np.concatenate([array[0], array[:, 0]])
        ends = np.concatenate([array[-1], array[:, -1]])
        points = _nearest_points(body, starts, ends)
    distances = _distances(body, points, clearance)
    nearest = int(np.argmin(distances))
    return float(distances[nearest]), points[nearest]


def _nearest_points(
    body: Upright, starts: Float[np.ndarray, "lines 3"], ends: Float[np.ndarray, "lines 3"]
) -> Float[np.ndarray, "lines 3"]:
    low, high = np.zeros((len(starts), 1)), np.ones((len(starts), 1))

    def at(fraction: Float[np.ndarray, "lines 1"]) -> Float[np.ndarray, "lines 1"]:
        return signed_distance(body, starts + fraction * (ends - starts))[:, None]

    for _ in range(60):  # 0.618^60 = 3e-13 of a row's length
        left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
        lower_half = at(left) <= at(right)
        low, high = np.where(lower_half, low, left), np.where(lower_half, right, high)
    middle = (low + high) / 2
    nearest: np.ndarray = starts + middle * (ends - starts)
    return nearest


def _distances(
    body: Upright | MeshFile, points: Float[np.ndarray, "points 3"], clearance: float
) -> Float[np.ndarray, " points"]:
    if isinstance(body, MeshFile):
        return mesh_distance(body, points, farthest=clearance)
    return signed_distance(body, points)


def _near_pairs(
    objects: Mapping[str, Upright | MeshFile],
) -> Iterator[tuple[tuple[str, Upright | MeshFile], tuple[str, Upright | MeshFile]]]:
    """List the pairs of solids whose bounding boxes meet."""
    solids = [(name, body) for name, body in objects.items() if not isinstance(body, Plate)]
    boxes = [_bounds(body) for _, body in solids]
    if len(boxes) < 2:
        return
    low, high = np.stack([one[0] for one in boxes]), np.stack([one[1] for one in boxes])
    for first, pair in enumerate(solids):
        meet = (low[first + 1 :] <= high[first]) & (high[first + 1 :] >= low[first])
        for second in np.flatnonzero(meet.all(axis=-1)).tolist():
            yield pair, solids[first + 1 + second]


def _bounds(body: Upright | MeshFile) -> Float[np.ndarray, "2 3"]:
    """Return the lowest and highest corner of a box around a body; endless without a height [m]."""
    if isinstance(body, MeshFile):
        return placed_mesh(body).bounds
    half_height = math.inf if body.height_m is None else body.height_m / 2
    if isinstance(body, Cylinder):
        across = np.array([body.radius_m, body.radius_m])
    else:
        depth = body.depth_m if isinstance(body, Box) else 0.0
        sides = np.abs(np.stack([body.tangent, body.across]))[:, :2]
        across = np.array([body.length_m, depth]) / 2 @ sides
    reach = np.array([*across, half_height])
    return np.stack([body.centre - reach, body.centre + reach])


def _overlap(one: Upright | MeshFile, other: Upright | MeshFile) -> bool:
    if isinstance(one, Plate) or isinstance(other, Plate):
        return False
    if isinstance(one, MeshFile) or isinstance(other, MeshFile):
        return _mesh_overlap(one, other)
    return min(_depth_along_z(one, other), _depth_in_plan(one, other)) > TOUCHING


def _depth_along_z(one: Cylinder | Box, other: Cylinder | Box) -> float:
    if one.height_m is None or other.height_m is None:
        return math.inf
    return (one.height_m + other.height_m) / 2 - abs(one.centre_m[2] - other.centre_m[2])


def _depth_in_plan(one: Cylinder | Box, other: Cylinder | Box) -> float:
    if isinstance(one, Cylinder):
        if isinstance(other, Box):
            one, other = other, one
        else:
            apart = math.dist(one.centre_m[:2], other.centre_m[:2])
            return one.radius_m + other.radius_m - apart
    offset = other.centre - one.centre
    if isinstance(other, Cylinder):
        flat = one.model_copy(update={"height_m": None})
        return other.radius_m - float(signed_distance(flat, other.centre[None])[0])
    axes = [one.tangent, one.across, other.tangent, other.across]  # separating axes
    return min(_reach(one, a) + _reach(other, a) - abs(float(offset @ a)) for a in axes)


def _reach(box: Box, axis: Float[np.ndarray, " 3"]) -> float:
    along, across = abs(float(box.tangent @ axis)), abs(float(box.across @ axis))
    return (box.length_m * along + box.depth_m * across) / 2


def _mesh_overlap(one: Cylinder | Box | MeshFile, other: Cylinder | Box | MeshFile) -> bool:
    for inner, outer in ((one, other), (other, one)):
        if isinstance(inner, MeshFile):
            points = placed_mesh(inner).vertices
        else:
            points = inner.centre[None, :]
        if isinstance(outer, MeshFile):
            if mesh_contains(outer, points, deeper_than=TOUCHING).any():
                return True
        elif (signed_distance(outer, points) < -TOUCHING).any():
            return True
    return False


def _room(body: Upright | MeshFile, distance: float) -> str:
    """Say what makes a body a room, if an antenna stands in it."""
    if distance < 0 and isinstance(body, MeshFile):
        return ", or set hollow = true if it is a room that is seen from within"
    return ""


def _closeness(body: Upright | MeshFile, distance: float) -> str:
    if distance < 0:
        return "inside"
    if distance < TOUCHING:
        return "on" if not isinstance(body, Plate) else "on or across"
    return f"{distance * 1e3:.3g} mm from"


def _xyz(point: Float[np.ndarray, " 3"]) -> str:
    shown = [round(float(value), 7) + 0.0 for value in point]  # 0.1 µm; no -0.0
    return str(shown[:2] if shown[2] == 0 else shown)
