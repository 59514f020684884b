"""A point before a leg of a path may be the near end of a mirror that the array sees edge-on."""

from dataclasses import replace

import numpy as np
import pytest
from jaxtyping import Float

from estimator.array.resolution_cell import Resolution
from estimator.geometry.bearing_2d import LINEAR
from estimator.geometry.wall_2d import Wall, mirrored
from estimator.positioning import diffuse_fallback
from estimator.positioning.los_check import look_along_legs
from estimator.positioning.map_context import MapContext, block_covariance
from estimator.results.estimate import UserEstimate
from estimator.wavefronts.wave_fit_2d import SphericalWave

# The ray along y meets the wall y = x + 0.8 at (0, 0.8), and goes on along x.
WALL = Wall(
    start=np.array([-0.14, 0.66, 0.0]),
    end=np.array([0.14, 0.94, 0.0]),
    covariance=np.diag([1e-4**2, 2e-5**2]),
)
USER = np.array([1.0, 0.8, 0.0])
WAVE = SphericalWave(
    aoa=np.pi / 2,
    path_length=1.8,
    radius=1.8,
    gain=1.0 + 0.0j,
    covariance=np.diag([1e-4**2, 5e-5**2]),
    explained=0.9,
)
ANSWER = UserEstimate(
    name="ann",
    status="found",
    position=USER,
    covariance=np.diag([1e-4, 1e-4, 0.0]) ** 2,
    bounces=1,
    path=np.array([[0.0, 0.0, 0.0], [0.0, 0.8, 0.0], USER]),
    line_of_sight=False,
    probability=0.9,
)


def room(*peaks: Float[np.ndarray, " 3"]) -> MapContext:
    return MapContext(
        walls=(WALL,),
        wall_covariance=block_covariance([WALL]),
        resolution=Resolution(along_ray=2e-3, across_ray=5e-3),
        imaged=True,
        unassigned_peaks=np.array(peaks).reshape(-1, 3),
        reach=np.inf,
        widest=1.0,
        contrast=np.inf,
    )


@pytest.mark.parametrize(
    ("x", "y", "sight"),
    [
        (0.40, 0.70, "behind a point"),  # the leg passes 0.11 m behind it
        (0.40, 0.90, "clear"),  # before it
        (0.30, 0.45, "clear"),  # farther behind it than such a wall is long
        (-0.30, 0.70, "clear"),  # on the other side of the wall
    ],
)
def test_the_leg_behind_a_point_may_meet_a_mirror_there(x: float, y: float, sight: str) -> None:
    way = look_along_legs(ANSWER, WAVE, (0,), room(np.array([x, y, 0.0])), LINEAR)
    assert way.sight == sight
    assert (way.doubt is None) == (way.otherwise is None) == (sight == "clear")


def test_over_that_mirror_the_user_is_its_image_with_the_error_of_a_slant_that_nobody_saw() -> None:
    peak = np.array([0.40, 0.70, 0.0])
    other = look_along_legs(ANSWER, WAVE, (0,), room(peak), LINEAR).otherwise
    assert other is not None
    assert other.position is not None
    assert other.covariance is not None
    assert other.bounces == 2
    image = mirrored(USER, np.zeros(3), peak)
    np.testing.assert_allclose(other.position, image, atol=1e-9)
    # Turned by 0.15 rad about the point, the mirror turns the image by 0.3 rad about it.
    turned = 0.3 * float(np.linalg.norm(USER - peak))
    assert np.sqrt(np.linalg.eigvalsh(other.covariance)[-1]) == pytest.approx(turned, rel=0.05)


def test_two_ends_say_more_than_one() -> None:
    ends = np.array([0.5, 0.75, 0.0]), np.array([0.5, 0.85, 0.0])
    way = look_along_legs(ANSWER, WAVE, (0,), room(*ends), LINEAR)
    assert way.sight == "between ends"
    assert way.otherwise is not None
    assert way.otherwise.position is not None
    np.testing.assert_allclose(way.otherwise.position, [0.0, 0.8, 0.0], atol=1e-9)


def test_what_a_wall_scatters_does_not_tell_one_more_mirror_from_none() -> None:

    over_two = look_along_legs(
        ANSWER, WAVE, (0,), room(np.array([0.40, 0.70, 0.0])), LINEAR
    ).otherwise
    assert over_two is not None
    doubted = replace(
        ANSWER, status="ambiguous", alternatives=(replace(over_two, probability=0.1),)
    )
    left = diffuse_fallback._among_alike(ANSWER, ANSWER, doubted)
    assert left.status == "ambiguous"
    assert [one.bounces for one in left.alternatives] == [2]
    assert left.probability == pytest.approx(0.9, rel=1e-2)
    path = over_two.path
    assert path is not None
    beside = (replace(over_two, path=path + 0.1, probability=0.1),)
    found = diffuse_fallback._among_alike(ANSWER, ANSWER, replace(doubted, alternatives=beside))
    assert (found.status, found.alternatives) == ("found", ())
