"""The ground truth of a scenario, stored with its measurement and never given to the estimator."""

from typing import NamedTuple

import numpy as np
import xarray as xr

from scenes.meshes.mesh_file import placed_mesh
from scenes.realisations.object_surface import plate_segment
from scenes.scenario import Scenario
from scenes.schema.objects import Cylinder, MeshFile, Plate, SceneObject


class _Target(NamedTuple):
    """A body other than a plate."""

    kind: str  # point, cylinder, box or mesh
    position: np.ndarray  # centre [m]
    size: np.ndarray  # along the body's own axes; zero of a point, and along z in 2-D [m]
    angle: float  # of the first of these axes from +x [rad]


def scenario_truth(scenario: Scenario) -> xr.Dataset:
    """Return where users, walls (plates) and targets (other bodies) are, without absorbers.

    Returns
    -------
    In metres ``user_position [user, axis]``, ``wall_start`` and ``wall_end [wall, axis]``,
    ``target_position [target, axis]`` (centres; of a mesh, that of its bounding box) and
    ``target_size [target, axis]`` (extents along the body's length, depth and height; 0 for a
    point, and along z in 2-D); in radians ``target_angle [target]``, of a body's length from
    +x; and ``target_kind [target]``: point, cylinder, box or mesh.
    """
    walls = {
        name: plate_segment(body)
        for name, body in scenario.objects.items()
        if isinstance(body, Plate) and body.material != "absorber"
    }
    targets = _targets(scenario)
    found = list(targets.values())
    positions = [user.position for user in scenario.users.values()]
    labels = np.dtypes.StringDType()
    metres, radians = {"units": "m"}, {"units": "rad"}
    kinds = np.array([target.kind for target in found], dtype=labels)
    angles = np.array([target.angle for target in found], dtype=np.float64)
    return xr.Dataset(
        {
            "user_position": (("user", "axis"), _rows(positions), metres),
            "wall_start": (("wall", "axis"), _rows([ends[0] for ends in walls.values()]), metres),
            "wall_end": (("wall", "axis"), _rows([ends[1] for ends in walls.values()]), metres),
            "target_position": (
                ("target", "axis"),
                _rows([target.position for target in found]),
                metres,
            ),
            "target_size": (("target", "axis"), _rows([target.size for target in found]), metres),
            "target_angle": ("target", angles, radians),
            "target_kind": ("target", kinds),
        },
        {
            "user": ("user", np.array(list(scenario.users), dtype=labels)),
            "wall": ("wall", np.array(list(walls), dtype=labels)),
            "target": ("target", np.array(list(targets), dtype=labels)),
        },
    )


def _targets(scenario: Scenario) -> dict[str, _Target]:
    flat = scenario.dimensions == 2
    found = {
        name: _target(body, flat=flat)
        for name, body in scenario.objects.items()
        if not isinstance(body, Plate) and body.material != "absorber"
    }
    for name, point in scenario.points.items():
        # An object's name holds no dot, so this one cannot collide.
        label = f"points.{name}" if name in found else name
        found[label] = _Target("point", point.position, np.zeros(3), 0.0)
    return found


def _target(body: SceneObject, *, flat: bool) -> _Target:
    if isinstance(body, MeshFile):
        low, high = placed_mesh(body).bounds
        position, size, angle = (low + high) / 2, high - low, 0.0
    else:
        position, angle = body.centre, float(np.radians(body.angle_deg))
        plan = (
            (2 * body.radius_m, 2 * body.radius_m)
            if isinstance(body, Cylinder)
            else (body.length_m, getattr(body, "depth_m", 0.0))
        )
        size = np.array([*plan, body.height_m or 0.0])
    in_space = np.array([1.0, 1.0, 0.0 if flat else 1.0])
    return _Target(body.kind, position * in_space, size * in_space, angle)


def _rows(points: list[np.ndarray]) -> np.ndarray:
    return np.array(points, dtype=np.float64).reshape(-1, 3)
