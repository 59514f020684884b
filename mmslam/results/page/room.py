"""What the page of a scenario draws: its surfaces, antennas, users and specular paths, in space."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from scenes.realisations.object_surface import Surface
from scenes.scenario import Scenario
from simulator.geometry.mean_surfaces import mean_surfaces
from simulator.scene.scenario_paths import ScenarioPath
from validation.figures import figures_2d
from validation.figures.scenario_plan import DIELECTRIC, FAINT_DB, MATERIAL_COLOURS, TARGET_PATH
from validation.figures.scenario_view import SHELL, STRIP_HEIGHT

SCRIPTS_ROOM = ("plan.js", "space.js", "start_room.js")
"""Of ``room.html.j2``."""

MOST_FACES = 60_000
"""Triangles that the page draws, of all objects; of more, evenly chosen ones. [-]"""

MOST_EDGED = 200
"""Faces of an object up to which their edges are drawn. [-]"""

DIGITS = 5
"""Of a coordinate in metres: 10 µm, less than a pixel of any screen."""

_FLAT = 1 - 1e-6  # cosine between the normals of two triangles of one face: 1.4 mrad
_GAP = [None, None, None]  # between two lines
_METAL_ON_BOTH = "#3c9a90"  # figures_2d.MIRROR and INK are too dark on a dark page
_LIGHT = {figures_2d.MIRROR: _METAL_ON_BOTH, "#3d3d3d": "#77808a", DIELECTRIC: "#b08a66"}


def room_document(scenario: Scenario, paths: Sequence[ScenarioPath]) -> dict[str, Any]:
    """Lay out what the page draws, in the world's frame and metres.

    Parameters
    ----------
    scenario
        Drawn with smooth surfaces; the lines of a 2-D scene become low upright strips.
    paths
        Its specular paths, from the array.
    """
    station = scenario.base_station
    surfaces = mean_surfaces(scenario)
    size = _size(scenario, surfaces)
    things = _joined(
        [thing for surface in surfaces for thing in _body(scenario, surface, size, len(surfaces))]
    )
    things += [_path(path) for path in paths]
    things.append(_points("array", "array", station.element_positions, "element of the array", 2))
    if station.transmitter is not None:
        things.append(
            _points("array", "array", station.transmitter.positions, "transmitter", 5, "diamond")
        )
    for name, target in scenario.points.items():
        things.append(_points("targets", "target", target.position[None], name, 5, "cross"))
    for name, user in scenario.users.items():
        things.append(_points("users", "user", user.position[None], name, 6))
    return {
        "title": scenario.title or scenario.name,
        "name": scenario.name,
        "dimensions": scenario.dimensions,
        "things": things,
        "counts": {
            "object": len(scenario.objects),
            "user": len(scenario.users),
            "specular path": len(paths),
        },
    }


def _size(scenario: Scenario, surfaces: Sequence[Surface]) -> float:
    points = [scenario.base_station.element_positions, *(one.vertices for one in surfaces)]
    points += [user.position[None] for user in scenario.users.values()]
    points += [target.position[None] for target in scenario.points.values()]
    return float(np.linalg.norm(np.ptp(np.concatenate(points), axis=0)))


def _body(scenario: Scenario, surface: Surface, size: float, bodies: int) -> list[dict[str, Any]]:
    """Lay out an object: its faces, and their edges if they are few."""
    body = scenario.objects[surface.name]
    material = str(body.material) if isinstance(body.material, str) else "slab of its own"
    colour = MATERIAL_COLOURS.get(str(body.material), DIELECTRIC)
    colour = _LIGHT.get(colour, colour)
    text = f"{surface.name}: {material}"
    if body.roughness is not None:
        text += f", rms height {1e3 * body.roughness.rms:.3g} mm"
    if surface.cells.shape[1] == 2:
        corners = _strips(surface.vertices[surface.cells], STRIP_HEIGHT * size)
        points, cells = corners.reshape(-1, 3), np.arange(4 * len(corners)).reshape(-1, 4)
        triangles = np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
    else:
        points, triangles = surface.vertices, surface.cells
        cells = triangles
    step = -(-len(triangles) * bodies // MOST_FACES)
    points, triangles = _used(points, triangles[::step])
    wide = float(np.ptp(surface.vertices, axis=0).max()) > SHELL * size
    faces = {
        "layer": "objects",
        "kind": "mesh",
        "points": _rounded(points),
        "triangles": triangles.tolist(),
        "colour": colour,
        # What may enclose others is almost transparent.
        "opacity": 0.15 if wide and scenario.dimensions == 3 else 0.55,
        "text": text,
    }
    if len(cells) > MOST_EDGED:
        return [faces]
    if surface.cells.shape[1] == 2:
        rims = [[*_rounded(strip[[0, 1, 2, 3, 0]]), _GAP] for strip in corners]
    else:
        rims = [[*_rounded(edge), _GAP] for edge in _edges(surface.vertices, surface.cells)]
    edges = {
        "layer": "edges",
        "kind": "line",
        "points": [point for rim in rims for point in rim],
        "colour": colour,
        "width": 2,
        "text": text,
    }
    return [faces, edges]


def _edges(
    points: Float[np.ndarray, "points 3"], triangles: Int[np.ndarray, "triangles 3"]
) -> Float[np.ndarray, "edges 2 3"]:
    """Return the edges of a mesh, but for those within a flat face."""
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    beside: dict[tuple[bytes, ...], list[int]] = {}
    ends: dict[tuple[bytes, ...], np.ndarray] = {}
    for number, triangle in enumerate(np.round(corners, DIGITS)):
        for first in range(3):
            pair = triangle[[first, (first + 1) % 3]]
            key = tuple(sorted(end.tobytes() for end in pair + 0.0))  # no -0
            beside.setdefault(key, []).append(number)
            ends[key] = pair
    kept = [
        ends[key]
        for key, faces in beside.items()
        if len(faces) != 2 or abs(normals[faces[0]] @ normals[faces[1]]) < _FLAT
    ]
    return np.array(kept).reshape(-1, 2, 3)


def _joined(things: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Join what looks alike: a browser draws ten things of a town, not thousands."""
    alike: dict[tuple[Any, ...], dict[str, Any]] = {}
    for thing in things:
        key = (thing["layer"], thing["kind"], thing["colour"], thing.get("opacity"))
        if key not in alike:
            more: dict[str, Any] = {"triangles": []} if thing["kind"] == "mesh" else {}
            alike[key] = {**thing, **more, "points": [], "labels": [], "label_of": []}
        one = alike[key]
        before = len(one["points"])
        one["points"] += thing["points"]
        one["label_of"] += [len(one["labels"])] * len(thing["points"])
        one["labels"].append(thing["text"])
        if thing["kind"] == "mesh":
            one["triangles"] += [[before + point for point in cell] for cell in thing["triangles"]]
    return list(alike.values())


def _strips(lines: Float[np.ndarray, "lines 2 3"], height: float) -> Float[np.ndarray, "lines 4 3"]:
    up = np.array([0.0, 0.0, height / 2])
    first, second = lines[:, 0], lines[:, 1]
    return np.stack([first - up, second - up, second + up, first + up], axis=1)


def _used(
    points: Float[np.ndarray, "points 3"], triangles: Int[np.ndarray, "triangles 3"]
) -> tuple[Float[np.ndarray, "used 3"], Int[np.ndarray, "triangles 3"]]:
    """Leave out the points that no triangle has."""
    used, numbers = np.unique(triangles, return_inverse=True)
    return points[used], numbers.reshape(triangles.shape)


def _path(path: ScenarioPath) -> dict[str, Any]:
    faint = path.gain_db < FAINT_DB
    bounces = f"{path.bounces} reflection{'' if path.bounces == 1 else 's'}"
    text = f"to {path.end}: {path.length:.4f} m, {bounces}, antennas {path.gain_db:.1f} dB"
    if path.through:
        text += f", through {', '.join(path.through)} {path.transmission_db:.1f} dB"
    style = (
        {"role": "path"}
        if path.kind == "user"
        else {"role": "target", "colour": _LIGHT.get(TARGET_PATH, "#4da778")}
    )
    return {
        "layer": "faint paths" if faint else f"paths to {path.kind}s",
        "kind": "line",
        "points": _rounded(path.vertices),
        "width": 2 if faint else 4,
        "dash": "dot" if faint else "solid",
        "text": text,
        **style,
    }


def _points(
    layer: str,
    role: str,
    places: Float[np.ndarray, "places 3"],
    text: str,
    size: int,
    symbol: str = "circle",
) -> dict[str, Any]:
    return {
        "layer": layer,
        "role": role,
        "kind": "points",
        "points": _rounded(places),
        "text": text,
        "size": size,
        "symbol": symbol,
    }


def _rounded(points: Float[np.ndarray, "points 3"]) -> list[Any]:
    listed: list[Any] = np.round(points, DIGITS).tolist()
    return listed
