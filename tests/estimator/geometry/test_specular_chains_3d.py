"""What the array sees over several plane mirrors, against rays that are followed one by one."""

from typing import Any

import numpy as np
import pytest
from jaxtyping import Float

from estimator.array.resolution_cell import Resolution
from estimator.geometry.path_tracing_3d import folded_over, project_in_space
from estimator.geometry.specular_chains_3d import (
    chains_in_space,
    image_in_space,
    seen_over_in_space,
    unfolded_in_space,
)
from estimator.geometry.wall_3d import PlaneWall, mirrored_about
from estimator.mapping.map_3d import corrected_values, fold_planes
from estimator.walls.plane_fit import FittedPlane, plane_axes


def square(centre: list[float], normal: list[float], half: float = 0.5) -> PlaneWall:
    axes = plane_axes(np.array(normal) / np.linalg.norm(normal))
    place = np.array(centre)
    corners = place + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ axes
    return PlaneWall(corners=corners, centre=place, axes=axes, covariance=np.zeros((3, 3)))


# Over the first, 45° to the right of boresight, the array looks along +x onto the second, which
# turns the view back along -y.
FIRST = square([0.0, 1.5, 0.0], [1.0, -1.0, 0.0])
SECOND = square([1.5, 1.5, 0.0], [-1.0, -1.0, 0.0])
WALLS = (FIRST, SECOND)
THING = np.array([1.45, 0.6, 0.1])


def random_walls(rng: np.random.Generator) -> list[PlaneWall]:
    return [
        square(list(rng.uniform([-1.0, 0.8, -0.3], [1.0, 3.0, 0.3])), list(rng.standard_normal(3)))
        for _ in range(4)
    ]


@pytest.mark.parametrize("seed", range(3))
def test_lines_are_folded_as_rays_that_are_followed_one_by_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    walls = random_walls(rng)
    points = rng.uniform([-2.0, 0.3, -1.0], [2.0, 6.0, 1.0], (300, 3))
    places, chains = unfolded_in_space(points, walls, deepest=8)
    lengths = []
    for point, place, chain in zip(points, places, chains, strict=True):
        far = float(np.linalg.norm(point))
        cosines = float(point[0] / far), float(point[2] / far)
        ray = project_in_space(cosines, far, walls, covariance=np.zeros((3, 3)))
        assert tuple(chain[chain >= 0]) == ray.walls
        np.testing.assert_allclose(place, ray.position, atol=1e-9)
        np.testing.assert_allclose(folded_over(point, walls, ray.walls), ray.position, atol=1e-9)
        lengths.append(len(ray.walls))
    assert max(lengths) >= 2  # else this shows nothing


def test_without_walls_everything_is_where_it_shows() -> None:
    places, chains = unfolded_in_space(THING[None], [], deepest=2)
    np.testing.assert_allclose(places[0], THING)
    np.testing.assert_array_equal(chains, [[-1, -1]])


def test_an_image_is_seen_over_the_chain_whose_walls_its_line_meets() -> None:
    # The walls stand at right angles, so that both orders have one image: its line meets the
    # first wall first. Over each wall alone the thing is seen from the side.
    seen_over = {(0,), (1,), (0, 1)}
    for chain in chains_in_space(2, deepest=3):
        image = image_in_space(THING, WALLS, chain)
        np.testing.assert_allclose(folded_over(image, WALLS, chain), THING, atol=1e-12)
        seen = seen_over_in_space(image[None], WALLS, chain, skin=0.02)[0]
        assert seen == (chain in seen_over)
    assert len(list(chains_in_space(3, deepest=2))) == 3 + 6


def test_a_ghost_over_two_walls_comes_back_to_its_place_in_the_corrected_image(world: Any) -> None:
    image = image_in_space(THING, WALLS, (0, 1))
    survey = world.volume(image, 0.08, np.linspace(0.3, 5.0, 236))
    halfway = mirrored_about(image, FIRST)  # where folding once would leave it
    places = np.stack([THING, image, halfway])
    folded = np.abs(corrected_values(survey, places, WALLS, skin=0.02))
    assert folded[0] == pytest.approx(abs(survey.at(image[None])[0]), rel=1e-9)
    assert folded[0] > 0.8
    assert folded[1:].max() == 0.0


def test_a_wall_that_is_seen_over_two_others_is_folded_over_both() -> None:
    # A third wall closes the way that the second sends the view: the array sees it over both.
    third = square([1.5, 0.2, 0.0], [0.3, 1.0, 0.0], half=0.3)

    def shown(wall: PlaneWall, chain: tuple[int, ...]) -> FittedPlane:
        corners = image_in_space(wall.corners, WALLS, chain)
        centre = image_in_space(wall.centre, WALLS, chain)
        normal: Float[np.ndarray, " 3"] = np.cross(corners[1] - corners[0], corners[2] - corners[1])
        return FittedPlane(
            wall=PlaneWall(
                corners=corners,
                centre=centre,
                axes=plane_axes(normal / np.linalg.norm(normal)),
                covariance=np.zeros((3, 3)),
            ),
            level=1.0,
            background=1e-3,
            area=50.0,
            confidence=1.0,
        )

    planes = [shown(third, (0, 1)), shown(SECOND, (0,)), shown(FIRST, ())]
    ordered, walls, seen = fold_planes(planes, Resolution(along_ray=0.02, across_ray=0.02))
    assert seen == ((), (0,), (0, 1))
    assert ordered == (planes[2], planes[1], planes[0])
    for wall, true in zip(walls, (FIRST, SECOND, third), strict=True):
        np.testing.assert_allclose(wall.corners, true.corners, atol=1e-9)
