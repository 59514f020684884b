"""How lines of an image lie to each other, seen from the array at the origin."""

import numpy as np
import pytest
from jaxtyping import Float

from estimator.array.resolution_cell import Resolution
from estimator.geometry.wall_2d import mirrored
from estimator.walls.fitted_line import FittedLine
from estimator.walls.line_relations import seen_twice

RESOLUTION = Resolution(along_ray=2e-3, across_ray=4e-3)
MIRROR = np.array([[-0.2, 0.6, 0.0], [0.2, 1.0, 0.0]])
ASIDE = np.array([[0.45, 0.5, 0.0], [0.45, 0.75, 0.0]])
OVER = mirrored(ASIDE, MIRROR[0], MIRROR[1])


def line(ends: Float[np.ndarray, "2 3"]) -> FittedLine:
    return FittedLine(
        start=ends[0],
        end=ends[1],
        covariance=np.diag([1e-8, 1e-10]),
        level=1.0,
        background=1e-3,
        confidence=1.0,
    )


def test_a_wall_and_its_image_over_another_prove_each_other() -> None:
    known, wall, image = line(MIRROR), line(ASIDE), line(OVER)
    assert seen_twice([image, wall], [known], RESOLUTION) == [image, wall]
    assert seen_twice([image], [known, wall], RESOLUTION) == [image]
    assert seen_twice([wall], [known, image], RESOLUTION) == [wall]


BESIDE = {
    "not behind the mirror": ASIDE + np.array([0.1, 0.0, 0.0]),
    "behind it, beside the image": OVER + np.array([0.0, 0.02, 0.0]),
}


@pytest.mark.parametrize("place", BESIDE)
def test_lines_that_are_no_images_of_each_other_prove_nothing(place: str) -> None:
    known, wall = line(MIRROR), line(ASIDE)
    assert seen_twice([line(BESIDE[place]), wall], [known], RESOLUTION) == []


def test_nothing_is_proved_where_no_mirror_is_known() -> None:
    assert seen_twice([line(ASIDE), line(OVER)], [], RESOLUTION) == []


def test_a_wall_at_right_angles_is_not_proved_by_its_own_image() -> None:
    # It goes on, mirrored, straight behind the mirror: one line is no two.
    across = line(np.array([[0.15, 0.65, 0.0], [-0.25, 1.05, 0.0]]))
    assert seen_twice([across], [line(MIRROR)], RESOLUTION) == []
