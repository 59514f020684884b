"""Grids that are graded towards corners."""

import numpy as np
import pytest

from validation.full_wave.graded_contour import box, cornered_contour


def test_a_box_has_its_perimeter_and_its_area() -> None:
    body = box(np.array([3.0, -1.0]), (2.0, 0.5), 0.7, spacing=0.02)
    # Where the rise meets the even spacing, the map has six derivatives: 1/40^6 and less.
    assert body.weights.sum() == pytest.approx(5.0, rel=1e-7)
    outward = np.einsum("ix,ix->i", body.points - [3.0, -1.0], body.normals)
    assert 0.5 * np.sum(outward * body.weights) == pytest.approx(1.0, rel=1e-7)
    assert body.spacing < 0.02 * (1 + 1e-9)
    assert body.weights.min() < 1e-6 * body.spacing
    np.testing.assert_allclose(body.curvatures, 0.0, atol=1e-9)


def test_a_curved_side_joins_straight_ones() -> None:
    turn = np.linspace(0, np.pi, 60)
    arc = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    body = cornered_contour([arc, np.stack([arc[-1], arc[0]])], [0.05, 0.03])
    assert body.weights.sum() == pytest.approx(2 + np.pi, rel=1e-6)
    outward = np.einsum("ix,ix->i", body.points, body.normals)
    assert 0.5 * np.sum(outward * body.weights) == pytest.approx(np.pi / 2, rel=1e-6)


def test_sharper_corners_have_more_points() -> None:
    counts = []
    for height in (1.0, 0.3):
        corners = np.array([[0, 0], [1, 0], [0.5, height]])
        sides = [np.stack([corners[one], corners[(one + 1) % 3]]) for one in range(3)]
        counts.append(cornered_contour(sides, [0.02] * 3).count)
    assert counts[1] > counts[0]


def test_contours_that_cannot_be_sampled_are_refused() -> None:
    corners = np.array([[0, 0], [1, 0], [0.5, 0.03]])
    sides = [np.stack([corners[one], corners[(one + 1) % 3]]) for one in range(3)]
    with pytest.raises(ValueError, match="blunt the corner"):
        cornered_contour(sides, [0.02] * 3)
    with pytest.raises(ValueError, match="clockwise"):
        cornered_contour([side[::-1] for side in sides[::-1]], [0.02] * 3)
    with pytest.raises(ValueError, match="must close"):
        cornered_contour([*sides[:2], sides[2] + [0.1, 0]], [0.02] * 3)
    with pytest.raises(ValueError, match="must be positive"):
        cornered_contour(sides, [0.02, 0.0, 0.02])
