"""Transforms of a Mitsuba XML file: a sequence of steps, applied from top to bottom."""

import math
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from jaxtyping import Float

from scenes.meshes.mitsuba_elements import attribute, numbers, refusal, split_numbers

STEPS = ("matrix", "translate", "scale", "rotate", "lookat")
"""Steps of a transform that are known."""


def transform(path: Path, element: ElementTree.Element) -> Float[np.ndarray, "4 4"]:
    """Return the 4 x 4 matrix of a transform, its steps applied from top to bottom."""
    whole = np.eye(4)
    for step in element:
        match step.tag:
            case "matrix":
                matrix = _matrix(path, step)
            case "translate":
                matrix = _moved(np.array(_triple(path, step, 0.0)))
            case "scale":
                matrix = np.diag([*_triple(path, step, 1.0), 1.0])
            case "rotate":
                matrix = _rotation(path, step)
            case "lookat" | "lookAt":
                matrix = _look_at(path, step)
            case _:
                raise refusal(
                    path,
                    f"<{step.tag}> in a transform is not known; use {', '.join(STEPS[:-1])} or "
                    f"{STEPS[-1]}",
                )
        whole = matrix @ whole
    return whole


def _matrix(path: Path, step: ElementTree.Element) -> Float[np.ndarray, "4 4"]:
    matrix = np.eye(4)
    if sum(1 for _ in split_numbers(step.get("value", ""))) == 9:  # 3 x 3: no translation
        matrix[:3, :3] = np.array(numbers(path, step, "value", 9)).reshape(3, 3)
        return matrix
    matrix[:] = np.array(numbers(path, step, "value", 16)).reshape(4, 4)
    if not np.array_equal(matrix[3], [0.0, 0.0, 0.0, 1.0]):
        raise refusal(path, f"the last row of a matrix is {matrix[3].tolist()}; it must be 0 0 0 1")
    return matrix


def _moved(offset: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "4 4"]:
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    return matrix


def _rotation(path: Path, step: ElementTree.Element) -> Float[np.ndarray, "4 4"]:
    axis = np.array(_triple(path, step, 0.0))
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        raise refusal(path, "a <rotate> has no axis; give x, y or z")
    turn = math.radians(numbers(path, step, "angle", 1)[0])
    x, y, z = axis / length
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix = np.eye(4)  # Rodrigues
    matrix[:3, :3] += math.sin(turn) * cross + (1.0 - math.cos(turn)) * cross @ cross
    return matrix


def _look_at(path: Path, step: ElementTree.Element) -> Float[np.ndarray, "4 4"]:
    """Turn +z towards a target and +y up, then move the origin, as Mitsuba does."""
    origin, target = (np.array(numbers(path, step, name, 3)) for name in ("origin", "target"))
    up = np.array(numbers(path, step, "up", 3)) if "up" in step.attrib else np.array([0.0, 0, 1.0])
    forward = target - origin
    left = np.cross(up, forward)
    if not np.linalg.norm(left) > 1e-12 * np.linalg.norm(up) * np.linalg.norm(forward):
        raise refusal(
            path, "a <lookat> looks along its 'up', or at its own origin; give another 'up'"
        )
    forward, left = forward / np.linalg.norm(forward), left / np.linalg.norm(left)
    matrix = _moved(origin)
    matrix[:3, :3] = np.stack([left, np.cross(forward, left), forward], axis=-1)
    return matrix


def _triple(path: Path, step: ElementTree.Element, missing: float) -> list[float]:
    if "value" not in step.attrib:
        return [
            numbers(path, step, axis, 1)[0] if axis in step.attrib else missing for axis in "xyz"
        ]
    given = sum(1 for _ in split_numbers(attribute(path, step, "value")))
    count = 1 if given == 1 and step.tag == "scale" else 3
    values = numbers(path, step, "value", count)
    return values * 3 if count == 1 else values
