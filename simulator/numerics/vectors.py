"""Vectors indexed by their axis first, of NumPy or Dr.Jit arrays alike."""

from typing import Any

import drjit as dr
import numpy as np

Vector = Any
"""Three components, by index: a tuple, an array [3, ...], or a vector of Dr.Jit."""


def dot(a: Vector, b: Vector) -> Any:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> tuple[Any, Any, Any]:
    """Vector product."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def added(a: Vector, b: Vector, factor: Any = 1.0) -> tuple[Any, Any, Any]:
    """First vector plus a multiple of the second."""
    return (a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2])


def scaled(a: Vector, factor: Any) -> tuple[Any, Any, Any]:
    """Multiple of a vector."""
    return (factor * a[0], factor * a[1], factor * a[2])


def square_root(value: Any) -> Any:
    """Principal square root, real or complex."""
    return np.sqrt(value) if _of_numpy(value) else dr.sqrt(value)


def at_least(value: Any, least: float) -> Any:
    """Maximum of a value and a limit."""
    return np.maximum(value, least) if _of_numpy(value) else dr.maximum(value, least)


def chosen(condition: Any, one: Any, other: Any) -> Any:
    """Choose element by element."""
    if _of_numpy(condition):
        return np.where(condition, one, other)
    return dr.select(condition, one, other)


def _of_numpy(value: Any) -> bool:
    return isinstance(value, np.ndarray | np.generic | bool | float | complex)
