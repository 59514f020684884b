"""Convex polygons cut by planes and seen through windows."""

import numpy as np
import pytest
from jaxtyping import Float

from simulator.geometry.polygon_clipping import clipped, empty, within_view

UP = np.array([0.0, 0.0, 1.0])


def square(side: float, height: float = 0.0) -> Float[np.ndarray, "1 4 3"]:
    x = side / 2 * np.array([-1.0, 1.0, 1.0, -1.0])
    y = side / 2 * np.array([-1.0, -1.0, 1.0, 1.0])
    return np.stack([x, y, np.full(4, height)], axis=-1)[None]


def area(polygons: Float[np.ndarray, "n corners 3"]) -> Float[np.ndarray, " n"]:
    spokes = polygons - polygons[:, :1]
    doubled = np.cross(spokes, np.roll(spokes, -1, axis=1)).sum(axis=1)
    return np.asarray(np.linalg.norm(doubled, axis=-1) / 2)


def test_a_plane_through_the_middle_leaves_half() -> None:
    rng = np.random.default_rng(0)
    angles = rng.uniform(0, 2 * np.pi, 50)
    many = np.repeat(square(2.0), 50, axis=0)
    heights = many[..., 0] * np.cos(angles)[:, None] + many[..., 1] * np.sin(angles)[:, None]
    assert area(clipped(many, heights)) == pytest.approx(2.0, abs=1e-12)


def test_cuts_by_all_sides_leave_what_is_common() -> None:
    left = square(2.0)
    for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1)):
        left = clipped(left, 0.3 + sign * left[..., axis])
    assert area(left) == pytest.approx(0.36, abs=1e-12)


def test_beyond_a_plane_nothing_is_left() -> None:
    left = clipped(square(2.0), square(2.0)[..., 0] - 1.5)
    assert empty(left).all()
    assert not empty(square(1e-4)).any()


def test_a_window_halfway_shows_twice_its_width() -> None:
    eye = np.array([[0.0, 0.0, 2.0]])
    found = within_view(square(9.0), eye, square(1.0, height=1.0), UP)
    assert area(found) == pytest.approx(4.0, rel=1e-9)
    assert area(within_view(square(1.0), eye, square(1.0, height=1.0), UP)) == pytest.approx(1.0)


def test_what_of_a_window_is_behind_the_plane_shows_nothing() -> None:
    """A wall that stands in the plane: only its upper half is between the eye and the plane."""
    eye = np.array([[-1.0, 0.0, 1.0]])
    y, z = 0.5 * np.array([-1.0, 1.0, 1.0, -1.0]), 0.5 * np.array([-1.0, -1.0, 1.0, 1.0])
    window = np.stack([np.zeros(4), y, z], axis=-1)[None]
    found = within_view(square(9.0), eye, window, UP)
    # From the foot of the window at x = 0 to where the ray over its top meets the plane, x = 1.
    assert found[..., 0].min() == pytest.approx(0.0, abs=1e-9)
    assert found[..., 0].max() == pytest.approx(1.0, abs=1e-9)
    assert area(found) == pytest.approx((1.0 + 2.0) / 2, rel=1e-9)


def test_a_window_beside_the_view_shows_nothing() -> None:
    eye = np.array([[0.0, 0.0, 2.0]])
    aside = square(1.0, height=1.0) + np.array([9.0, 0.0, 0.0])
    assert empty(within_view(square(2.0), eye, aside, UP)).all()
