"""What the array sees over several plane mirrors, against rays that are followed one by one."""

from typing import Any

import numpy as np
import pytest
from jaxtyping import Float

from estimator.array.resolution_cell import Resolution
from estimator.geometry.bearing_3d import PLANAR
from estimator.geometry.path_tracing import project
from estimator.geometry.specular_chains import (
    Chain,
    image_over,
    seen_over,
    unfolded,
    unfolded_over,
)
from estimator.geometry.specular_chains_3d import possible_chains
from estimator.geometry.wall_3d import PlaneWall, mirrored_about
from estimator.mapping.ghost_correction import corrected_image
from estimator.mapping.map_3d import unfold_planes
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
def test_lines_are_unfolded_as_rays_that_are_followed_one_by_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    walls = random_walls(rng)
    points = rng.uniform([-2.0, 0.3, -1.0], [2.0, 6.0, 1.0], (150, 3))
    places, chains = unfolded(points, walls, deepest=8)
    lengths = []
    for point, place, chain in zip(points, places, chains, strict=True):
        far = float(np.linalg.norm(point))
        ray = project(PLANAR, PLANAR.of(point), far, walls, covariance=np.zeros((3, 3)))
        assert tuple(chain[chain >= 0]) == ray.walls
        np.testing.assert_allclose(place, ray.position, atol=1e-9)
        np.testing.assert_allclose(unfolded_over(point, walls, ray.walls), ray.position, atol=1e-9)
        lengths.append(len(ray.walls))
    assert max(lengths) >= 2  # else this shows nothing


def test_without_walls_everything_is_where_it_shows() -> None:
    places, chains = unfolded(THING[None], [], deepest=2)
    np.testing.assert_allclose(places[0], THING)
    np.testing.assert_array_equal(chains, [[-1, -1]])


def test_an_image_is_seen_over_the_chain_whose_walls_its_line_meets() -> None:
    # The walls stand at right angles, so that both orders have one image: its line meets the
    # first wall first. Over each wall alone the thing is seen from the side.
    over = {(0,), (1,), (0, 1)}
    for chain in [(0,), (1,), (0, 1), (1, 0), (0, 1, 0), (1, 0, 1)]:
        image = image_over(THING, WALLS, chain)
        np.testing.assert_allclose(unfolded_over(image, WALLS, chain), THING, atol=1e-12)
        assert seen_over(image[None], WALLS, chain, skin=0.02)[0] == (chain in over)


@pytest.mark.parametrize("seed", range(3))
def test_every_chain_that_a_ray_follows_is_among_the_possible_ones(seed: int) -> None:
    rng = np.random.default_rng(seed)
    walls = random_walls(rng)
    points = rng.uniform([-2.0, 0.3, -1.0], [2.0, 6.0, 1.0], (3000, 3))
    met = {tuple(int(i) for i in row if i >= 0) for row in unfolded(points, walls)[1]}
    possible = set(possible_chains(walls))
    assert met <= possible
    assert max(len(chain) for chain in met) >= 2  # else this shows nothing
    # Of all chains that repeat no wall at once, 4 · 3⁷ of eight alone, few are left.
    assert len(possible) < 200


@pytest.mark.parametrize("deepest", [0, 1, 2, 3, 8])
def test_between_two_parallel_walls_there_are_chains_of_every_length_asked_for(
    deepest: int,
) -> None:
    # The array stands between them and looks along both: to and fro, as often as one likes.
    walls = [square([-0.5, 4.0, 0.0], [1.0, 0.0, 0.0], 6.0),
             square([0.5, 4.0, 0.0], [-1.0, 0.0, 0.0], 6.0)]  # fmt: skip
    lengths = [len(chain) for chain in possible_chains(walls, deepest=deepest)]
    # From either wall first: one chain of each length and side.
    assert sorted(lengths) == [0] + [n for n in range(1, deepest + 1) for _ in range(2)]
    # The n-th image of the last wall stands n - 1/2 metres aside.
    near = [len(chain) for chain in possible_chains(walls, deepest=deepest, reach=2.6)]
    assert max(near) == min(deepest, 3)


def test_a_ghost_over_two_walls_comes_back_to_its_place_in_the_corrected_image(world: Any) -> None:
    image = image_over(THING, WALLS, (0, 1))
    survey = world.volume(image, 0.08, np.linspace(0.3, 5.0, 236))
    halfway = mirrored_about(image, FIRST)  # where unfolding once would leave it
    places = np.stack([THING, image, halfway])
    chains = possible_chains(WALLS)
    unfolding = np.abs(corrected_image(survey.at, places, WALLS, chains, skin=0.02).values)
    assert unfolding[0] == pytest.approx(abs(survey.at(image[None])[0]), rel=1e-9)
    assert unfolding[0] > 0.8
    assert unfolding[1:].max() == 0.0


def test_a_wall_that_is_seen_over_two_others_is_unfolded_over_both() -> None:
    # A third wall closes the way that the second sends the view: the array sees it over both.
    third = square([1.5, 0.2, 0.0], [0.3, 1.0, 0.0], half=0.3)

    def shown(wall: PlaneWall, chain: Chain) -> FittedPlane:
        corners = image_over(wall.corners, WALLS, chain)
        centre = image_over(wall.centre, WALLS, chain)
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
    ordered, walls, seen = unfold_planes(planes, Resolution(along_ray=0.02, across_ray=0.02))
    assert seen == ((), (0,), (0, 1))
    assert ordered == (planes[2], planes[1], planes[0])
    for wall, true in zip(walls, (FIRST, SECOND, third), strict=True):
        np.testing.assert_allclose(wall.corners, true.corners, atol=1e-9)
