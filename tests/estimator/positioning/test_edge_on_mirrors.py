"""A point before a leg of a path may be the near end of a mirror that the array sees edge-on."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from jaxtyping import Float

from estimator.array.resolution_cell import Resolution
from estimator.geometry.bearing import Bearing
from estimator.geometry.bearing_2d import LINEAR
from estimator.geometry.bearing_3d import PLANAR
from estimator.geometry.wall_2d import Wall, mirrored
from estimator.geometry.wall_3d import PlaneWall
from estimator.positioning import diffuse_fallback
from estimator.positioning.los_check import StraightWay, look_along_legs
from estimator.positioning.map_context import MapContext, block_covariance
from estimator.results.estimate import UserEstimate
from estimator.walls.plane_fit import plane_axes
from estimator.wavefronts.wave_fit_2d import SphericalWave
from estimator.wavefronts.wave_fit_3d import Wavefront

# The ray along y meets the wall y = x + 0.8 at (0, 0.8), and goes on along x.
START, END = np.array([-0.14, 0.66, 0.0]), np.array([0.14, 0.94, 0.0])
USER = np.array([1.0, 0.8, 0.0])
UP = np.array([0.0, 0.0, 0.2])
COVARIANCE = np.diag([1e-4**2, 5e-5**2])


@dataclass(frozen=True)
class Dimension:
    """An array, a wave to it over a wall, and what it makes of them."""

    how: Bearing
    wave: SphericalWave | Wavefront
    wall: Wall | PlaneWall

    def room(self, *peaks: Float[np.ndarray, " 3"]) -> MapContext:
        return MapContext(
            walls=(self.wall,),  # type: ignore[arg-type]  # all of one kind
            wall_covariance=block_covariance([self.wall]),
            resolution=Resolution(along_ray=2e-3, across_ray=5e-3),
            imaged=True,
            unassigned_peaks=np.array(peaks).reshape(-1, 3),
            reach=np.inf,
            widest=1.0,
            contrast=np.inf,
        )

    def look(self, *peaks: Float[np.ndarray, " 3"]) -> StraightWay:
        return look_along_legs(ANSWER, self.wave, (0,), self.room(*peaks), self.how)


PLANE = Dimension(
    how=LINEAR,
    wave=SphericalWave(
        aoa=np.pi / 2,
        path_length=1.8,
        radius=1.8,
        gain=1.0 + 0.0j,
        covariance=COVARIANCE,
        explained=0.9,
    ),
    wall=Wall(start=START, end=END, covariance=np.diag([1e-4**2, 2e-5**2])),
)
SPACE = Dimension(
    how=PLANAR,
    wave=Wavefront(
        cosines=(0.0, 0.0),
        path_length=1.8,
        curvature=1 / 1.8,
        gain=1.0 + 0.0j,
        covariance=np.diag([1e-4**2, 1e-4**2, 5e-5**2]),
        explained=0.9,
        passes=1,
    ),
    wall=PlaneWall(
        corners=np.stack([START - UP, END - UP, END + UP, START + UP]),
        centre=0.5 * (START + END),
        axes=plane_axes(np.array([1.0, -1.0, 0.0]) / np.sqrt(2)),
        covariance=np.diag([1e-4**2, 1e-4**2, 2e-5**2]),
    ),
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
in_both = pytest.mark.parametrize("dim", [PLANE, SPACE], ids=["plane", "space"])


@in_both
@pytest.mark.parametrize(
    ("x", "y", "sight"),
    [
        (0.40, 0.70, "behind a point"),  # the leg passes 0.11 m behind it
        (0.40, 0.90, "clear"),  # before it
        (0.30, 0.45, "clear"),  # farther behind it than such a wall is long
        (-0.30, 0.70, "clear"),  # on the other side of the wall
    ],
)
def test_the_leg_behind_a_point_may_meet_a_mirror_there(
    dim: Dimension, x: float, y: float, sight: str
) -> None:
    way = dim.look(np.array([x, y, 0.0]))
    # In space one point does not tell how an edge runs, nor the wall behind it.
    assert way.sight == (sight if dim is PLANE else "clear")
    assert (way.doubt is None) == (way.otherwise is None) == (way.sight == "clear")


def test_over_that_mirror_the_user_is_its_image_with_the_error_of_a_slant_that_nobody_saw() -> None:
    peak = np.array([0.40, 0.70, 0.0])
    other = PLANE.look(peak).otherwise
    assert other is not None
    assert other.position is not None
    assert other.covariance is not None
    assert other.bounces == 2
    image = mirrored(USER, np.zeros(3), peak)
    np.testing.assert_allclose(other.position, image, atol=1e-9)
    # Turned by 0.15 rad about the point, the mirror turns the image by 0.3 rad about it.
    turned = 0.3 * float(np.linalg.norm(USER - peak))
    assert np.sqrt(np.linalg.eigvalsh(other.covariance)[-1]) == pytest.approx(turned, rel=0.05)


def test_a_point_that_may_be_a_sidelobe_of_the_wall_is_no_end() -> None:
    beside = START + 0.9 * (END - START) + np.array([6e-3, -6e-3, 0.0])
    assert PLANE.look(beside).sight == "clear"


@in_both
def test_two_ends_say_more_than_one(dim: Dimension) -> None:
    way = dim.look(np.array([0.5, 0.75, 0.0]), np.array([0.5, 0.85, 0.0]))
    assert way.sight == "between ends"
    assert way.otherwise is not None
    assert way.otherwise.position is not None
    np.testing.assert_allclose(way.otherwise.position, [0.0, 0.8, 0.0], atol=1e-9)


@in_both
def test_in_space_two_points_that_no_straight_edges_have_are_no_ends(dim: Dimension) -> None:
    # One of them 0.1 m higher: edges at right angles to both rays would lean by 30°.
    ends = np.array([0.5, 0.75, 0.0]), np.array([0.5, 0.85, 0.1])
    way = dim.look(*ends)
    assert (way.sight == "between ends") == (dim is PLANE)


def test_what_a_wall_scatters_does_not_tell_one_more_mirror_from_none() -> None:
    over_two = PLANE.look(np.array([0.40, 0.70, 0.0])).otherwise
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
