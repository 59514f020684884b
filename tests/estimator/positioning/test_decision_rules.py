"""From waves to an answer, on waves that are written down: each rule in the plane and in space."""

# Over 400 lines: each rule is tried in both dimensions on the same maps.

from dataclasses import dataclass, replace

import numpy as np
import pytest
from jaxtyping import Float
from scipy.constants import speed_of_light
from scipy.linalg import block_diag

from estimator.array.resolution_cell import Resolution
from estimator.channel.path import Path, PathSet, Shadow
from estimator.geometry.bearing import Bearing
from estimator.geometry.bearing_2d import LINEAR
from estimator.geometry.bearing_3d import PLANAR
from estimator.geometry.wall_2d import Wall
from estimator.geometry.wall_3d import PlaneWall
from estimator.positioning.decision_rules import decide
from estimator.positioning.map_context import MapContext, block_covariance, no_image
from estimator.results.estimate import UserEstimate
from estimator.walls.plane_fit import plane_axes
from estimator.wavefronts.wave_fit_2d import SphericalWave
from estimator.wavefronts.wave_fit_3d import Wavefront

Place = Float[np.ndarray, " 3"]

ANGLE, LENGTH = 1e-4, 5e-5  # deviations of a wave: 0.1 mrad, 0.05 mm
BENT = 1e-2  # deviation of a curvature, over the curvature
RESOLUTION = Resolution(along_ray=2e-3, across_ray=5e-3)
END = np.array([0.14, 0.94, 0.0])  # of the slanted wall y = x + 0.8
ALONG = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)


@dataclass(frozen=True)
class Dimension:
    """An array, and how its waves and walls are written down."""

    how: Bearing

    @property
    def height(self) -> float:
        """Height of the users: a planar array tells it. [m]."""
        return 0.0 if self.how is LINEAR else 0.07

    def user(self, x: float, y: float) -> Place:
        return np.array([x, y, self.height])

    def wall(self, start: Place, end: Place) -> Wall | PlaneWall:
        """An upright wall; in space it is 0.4 m high."""
        if self.how is LINEAR:
            return Wall(start=start, end=end, covariance=np.diag([1e-4**2, 2e-5**2]))
        along = end - start
        normal = np.array([along[1], -along[0], 0.0]) / np.linalg.norm(along)
        up = np.array([0.0, 0.0, 0.2])
        return PlaneWall(
            corners=np.stack([start - up, end - up, end + up, start + up]),
            centre=0.5 * (start + end),
            axes=plane_axes(normal),
            covariance=np.diag([1e-4**2, 1e-4**2, 2e-5**2]),
        )

    def path(
        self, place: Place, *, share: float, length: float | None, radius: float | None
    ) -> Path:
        """The wave of a source that is seen at a place, of another delay or curvature."""
        bearing = self.how.of(place)
        far = float(np.linalg.norm(place)) if length is None else length
        bend = 1 / (far if radius is None else radius)
        tied = np.array([*[ANGLE**2] * bearing.size, LENGTH**2])
        wave: SphericalWave | Wavefront
        if self.how is LINEAR:
            wave = SphericalWave(
                aoa=float(bearing[0]),
                path_length=far,
                radius=1 / bend,
                gain=1.0 + 0j,
                covariance=np.diag([*tied, (BENT / bend) ** 2]),
                explained=share,
            )
            bound: SphericalWave | Wavefront = replace(wave, radius=far, covariance=np.diag(tied))
        else:
            wave = Wavefront(
                cosines=(float(bearing[0]), float(bearing[1])),
                path_length=far,
                curvature=bend,
                gain=1.0 + 0j,
                covariance=np.diag([*tied, (BENT * bend) ** 2]),
                explained=share,
                passes=1,
            )
            bound = replace(wave, curvature=1 / far, covariance=np.diag(tied))
        return Path(wave=bound, free=wave, share=share, unambiguous=4.0)


PLANE, SPACE = Dimension(LINEAR), Dimension(PLANAR)
pytestmark = pytest.mark.parametrize("dim", [PLANE, SPACE], ids=["plane", "space"])


def direct(
    dim: Dimension,
    place: Place,
    *,
    share: float = 0.9,
    length: float | None = None,
    radius: float | None = None,
) -> Path:
    return dim.path(place, share=share, length=length, radius=radius)


def image_of(place: Place) -> Place:
    """The image in the slanted wall's plane y = x + 0.8."""
    return np.array([place[1] - 0.8, place[0] + 0.8, place[2]])


def reflected(dim: Dimension, user: Place, *, share: float = 0.9) -> Path:
    return direct(dim, image_of(user), share=share)


def slanted(dim: Dimension) -> Wall | PlaneWall:
    return dim.wall(np.array([-0.14, 0.66, 0.0]), END)


def together(dim: Dimension, paths: list[Path]) -> PathSet:
    """Paths whose errors are independent."""
    nothing = np.zeros((0, 0))
    tied = len(dim.how.coordinates)
    free = [
        block_diag(
            path.free.covariance[:tied, :tied], np.array([[path.free.curvature_deviation**2]])
        )
        for path in paths
    ]
    return PathSet(
        paths=tuple(paths),
        covariance=block_diag(nothing, *(path.wave.covariance for path in paths)),
        free_covariance=block_diag(nothing, *free),
        how=dim.how,
    )


def room(*walls: Wall | PlaneWall, peaks: list[list[float]] | None = None) -> MapContext:
    return MapContext(
        walls=walls,  # type: ignore[arg-type]  # all of one kind
        wall_covariance=block_covariance(walls),
        resolution=RESOLUTION,
        imaged=True,
        unassigned_peaks=np.array(peaks or []).reshape(-1, 3),
        reach=np.inf,
        widest=1.0,
        contrast=np.inf,
    )


def decided(
    dim: Dimension, paths: list[Path], context: MapContext, *, clock_known: bool = True
) -> UserEstimate:
    return decide("ann", together(dim, paths), context, clock_known=clock_known)


def at(found: UserEstimate, place: Place, atol: float = 1e-8) -> None:
    assert found.position is not None
    np.testing.assert_allclose(found.position, place, atol=atol)


def test_a_direct_path_is_the_user(dim: Dimension) -> None:
    user = dim.user(0.2, 0.4)
    found = decided(dim, [direct(dim, user)], room(slanted(dim)))
    assert (found.status, found.bounces, found.name, found.reason) == ("found", 0, "ann", None)
    assert found.line_of_sight is True
    at(found, user, 1e-12)
    assert found.covariance is not None
    # 0.05 mm along; across 0.1 mrad of the angle, or of cosines that it turns by less.
    spread = np.sqrt(np.linalg.eigvalsh(found.covariance)[-len(dim.how.coordinates) :])
    far = float(np.linalg.norm(user))
    assert np.isclose(spread, LENGTH, rtol=0.15).any()
    assert np.all(spread < 2.5 * ANGLE * far + 1e-9)
    assert (found.elevation is None) == (dim is PLANE)


def test_a_path_over_a_known_wall_is_unfolded_to_the_user(dim: Dimension) -> None:
    user = dim.user(1.0, 0.8)
    found = decided(dim, [reflected(dim, user)], room(slanted(dim)))
    assert (found.status, found.bounces, found.line_of_sight) == ("found", 1, False)
    at(found, user)
    assert found.path is not None
    bounce = image_of(user) * 0.8 / 1.8  # the image lies straight ahead of the wall's middle
    np.testing.assert_allclose(found.path, np.stack([np.zeros(3), bounce, user]), atol=1e-9)
    assert found.aoa == pytest.approx(np.pi / 2)
    assert found.path_length == pytest.approx(np.linalg.norm(image_of(user)))


def test_paths_that_agree_are_fused(dim: Dimension) -> None:
    user = dim.user(0.5, 0.75)
    both = [direct(dim, user, share=0.5), reflected(dim, user, share=0.4)]
    found = decided(dim, both, room(slanted(dim)))
    alone = decided(dim, both[:1], room(slanted(dim)))
    assert (found.status, found.bounces, found.line_of_sight) == ("found", 0, True)
    at(found, user)
    assert found.covariance is not None
    assert alone.covariance is not None
    # Two measurements know more than one, in every direction.
    gain = np.linalg.eigvalsh(alone.covariance - found.covariance)
    assert np.all(gain > -1e-18)
    assert gain[-1] > 0


def test_a_path_that_contradicts_the_others_is_dropped_and_the_reason_says_so(
    dim: Dimension,
) -> None:
    user, elsewhere = dim.user(0.5, 0.75), dim.user(-0.3, 0.4)
    three = [
        direct(dim, user, share=0.4),
        reflected(dim, user, share=0.4),
        direct(dim, elsewhere, share=0.15),
    ]
    found = decided(dim, three, room(slanted(dim)))
    assert (found.status, found.line_of_sight) == ("found", True)
    assert [one.used for one in found.paths] == [True, True, False]
    assert [one.mirrors for one in found.paths] == [(), (0,), ()]
    assert found.paths[2].reason == (
        "a stronger path comes over the same mirrors: scattered beside it"
    )
    at(found, user)


def test_two_paths_that_agree_outweigh_a_stronger_one_that_does_not(dim: Dimension) -> None:
    user, elsewhere = dim.user(0.5, 0.75), dim.user(-0.3, 0.4)
    three = [
        direct(dim, elsewhere, share=0.4),
        direct(dim, user, share=0.3),
        reflected(dim, user, share=0.28),
    ]
    found = decided(dim, three, room(slanted(dim)))
    # Two paths agree to 0.1 mrad and 0.05 mm by chance once in a million.
    assert found.status == "found"
    assert found.probability is not None
    assert found.probability > 0.999
    at(found, user)
    assert [path.used for path in found.paths] == [False, True, True]


def test_rivals_of_like_strength_are_ambiguous_and_both_places_are_given(dim: Dimension) -> None:
    one, other = dim.user(0.3, 0.4), dim.user(-0.2, 0.5)
    two = [direct(dim, one, share=0.5), direct(dim, other, share=0.45)]
    found = decided(dim, two, room(slanted(dim)))
    assert found.status == "ambiguous"
    assert found.reason == "paths of like strength end at different places"
    at(found, one)
    (alternative,) = found.alternatives
    at(alternative, other)


def test_a_longer_path_from_where_the_image_shows_nothing_contradicts_nothing(
    dim: Dimension,
) -> None:
    # Off a wall far aside, as of a floor; the answer stands straight ahead, in what is imaged.
    user, image = dim.user(0.05, 0.6), dim.user(0.9, 0.5)
    two = [direct(dim, user, share=0.5), direct(dim, image, share=0.45)]
    assert decided(dim, two, replace(room(), widest=0.3)).status == "found"
    assert decided(dim, two, room()).status == "ambiguous"
    # A nearer place is the user's as well as not, wherever it is seen.
    nearer = [direct(dim, user, share=0.5), direct(dim, 0.4 * image, share=0.45)]
    assert decided(dim, nearer, replace(room(), widest=0.3)).status == "ambiguous"


def test_of_two_waves_that_describe_one_bent_front_the_stronger_is_the_user(
    dim: Dimension,
) -> None:
    user = dim.user(1.0, 0.8)
    image = image_of(user)
    # A deviation beside it: parts of one front err by as much as they are apart.
    beside = image + np.array([4e-3, 0.0, 0.0])
    size = len(dim.how.coordinates) - 1

    def bent(place: Place, share: float) -> Path:
        one = direct(dim, place, share=share)
        loose = np.diag([(4e-3) ** 2] * size + [LENGTH**2])
        changed = replace(one.wave, covariance=loose)  # type: ignore[type-var]
        return replace(one, wave=changed, tilt_db=-1.2 if share < 0.5 else 0.1)

    for shares, place in (((0.55, 0.41), image), ((0.41, 0.55), beside)):
        both = [bent(image, shares[0]), bent(beside, shares[1])]
        paths = replace(together(dim, both), bandwidth=7e9, frequency=60e9)
        found = decide("ann", paths, room(slanted(dim)))
        at(found, image_of(place), 1e-6)
        alone = decide("ann", together(dim, [bent(place, 0.9)]), room(slanted(dim)))
        assert found.covariance is not None
        assert alone.covariance is not None
        away = image_of(beside) - user
        # The other part has 0.41/0.96 of the probability.
        more = away @ (found.covariance - alone.covariance) @ away / (away @ away)
        assert more == pytest.approx(0.43 * away @ away, rel=0.05)


def test_a_much_weaker_path_elsewhere_does_not_make_it_ambiguous(dim: Dimension) -> None:
    one, other = dim.user(0.3, 0.4), dim.user(-0.2, 0.5)
    two = [direct(dim, one, share=0.8), direct(dim, other, share=0.1)]
    found = decided(dim, two, room(slanted(dim)))
    assert (found.status, found.alternatives) == ("found", ())


@pytest.mark.parametrize(("inside", "bounces"), [(True, 1), (False, 0)])
def test_at_a_walls_very_end_the_ray_may_pass_beside_it(
    dim: Dimension, inside: bool, bounces: int
) -> None:
    # A point of the wall's plane 2 mm before or behind its end, at 0.95 m: 1.5 mrad, less than
    # the 5 mrad of the image's cell.
    near = END + (-2e-3 if inside else 2e-3) * ALONG
    near[2] = dim.height
    place = 1.8 * near / np.linalg.norm(near)
    found = decided(dim, [direct(dim, place)], room(slanted(dim)))
    assert found.status == "ambiguous"
    assert found.bounces == bounces
    assert found.reason == "the path meets a wall at its very end: it may pass beside it"
    other, *behind = found.alternatives
    # Whatever seems reflected may have come through the wall; without levels that is improbable.
    assert all(one.probability is not None and one.probability < 1e-3 for one in behind)
    assert other.bounces == 1 - bounces
    assert found.position is not None
    at(other, image_of(found.position), 1e-6)


@pytest.mark.parametrize(("side", "bounces"), [(-1.0, 1), (1.0, 0)])
def test_the_elements_that_a_wave_reaches_tell_whether_it_came_over_a_walls_end(
    dim: Dimension, side: float, bounces: int
) -> None:
    # As above at the very end; elements 3 cm aside see it 14 mm farther in on the wall, or beyond.
    near = END - 2e-3 * ALONG
    wave = direct(dim, 1.8 * near / np.linalg.norm(near))
    shadow = Shadow(
        lit=np.arange(128) < 64,
        reached=np.array([0.03 * side, 0.0, 0.0]),
        dark=np.array([-0.03 * side, 0.0, 0.0]),
    )
    assert decided(dim, [wave], room(slanted(dim))).status == "ambiguous"
    found = decided(dim, [replace(wave, shadow=shadow)], room(slanted(dim)))
    assert (found.status, found.bounces) == ("found", bounces)


@pytest.mark.parametrize(("chance", "status"), [(0.3, "ambiguous"), (1e-4, "found")])
def test_a_wall_that_may_stand_farther_leaves_a_user_over_it_open_and_none_beside_it(
    dim: Dimension, chance: float, status: str
) -> None:
    here = slanted(dim)
    farther = dim.wall(np.array([-0.14, 0.66, 0.0]) * 1.5, END * 1.5)
    context = replace(
        room(here),
        rooms=((1 - chance, (here,)), (chance, (farther,))),  # type: ignore[arg-type]  # of one kind
    )
    over = decided(dim, [reflected(dim, dim.user(1.0, 0.8))], context)
    assert over.status == status
    at(over, dim.user(1.0, 0.8))
    assert len(over.alternatives) == (status == "ambiguous")
    beside = decided(dim, [direct(dim, dim.user(0.5, 0.3))], context)
    assert beside.status == "found"


def test_well_inside_or_well_beside_a_wall_nothing_is_ambiguous(dim: Dimension) -> None:
    for beyond in (-2e-2, 2e-2):
        near = END + beyond * ALONG
        place = 1.8 * near / np.linalg.norm(near)
        assert decided(dim, [direct(dim, place)], room(slanted(dim))).status == "found"


def test_a_second_path_tells_whether_the_first_meets_a_walls_very_end(dim: Dimension) -> None:
    near = END - 2e-3 * ALONG
    user = image_of(1.5 * near / np.linalg.norm(near))
    assert decided(dim, [reflected(dim, user)], room(slanted(dim))).status == "ambiguous"
    both = [reflected(dim, user, share=0.5), direct(dim, user, share=0.4)]
    found = decided(dim, both, room(slanted(dim)))
    assert (found.status, found.bounces, found.line_of_sight) == ("found", 1, True)
    at(found, user)


def test_at_the_level_of_free_space_a_wall_that_seems_too_long_leaves_the_answer_open(
    dim: Dimension,
) -> None:
    # The ray meets the wall 1.4 reaches before its end, which the image shows to a cell.
    turn = 1.4 * (RESOLUTION.across_ray + 3 * ANGLE)
    place = 1.3 * np.array(
        [END[0] * np.cos(turn) - END[1] * np.sin(turn), END[0] * np.sin(turn) + END[1], 0.0]
    )
    wave = direct(dim, place)
    assert isinstance(wave.wave, SphericalWave | Wavefront)
    gain = speed_of_light / 60e9 / (4 * np.pi * float(np.linalg.norm(place)))
    strong = replace(wave, wave=replace(wave.wave, gain=complex(gain)))
    room_shown = room(slanted(dim))
    found = decide("user", replace(together(dim, [strong]), frequency=60e9), room_shown)
    assert found.status == "ambiguous"
    places = [one.position for one in (found, *found.alternatives) if one.position is not None]
    assert min(float(np.linalg.norm(one - place)) for one in places) < 5e-3
    # 10 dB below, it is a reflected wave for sure.
    weak = replace(wave, wave=replace(wave.wave, gain=complex(gain / 10**0.5)))
    found = decide("user", replace(together(dim, [weak]), frequency=60e9), room_shown)
    assert found.bounces == 1


def test_a_ray_between_two_loose_points_may_pass_over_a_wall_too_smooth_to_be_seen(
    dim: Dimension,
) -> None:
    ends = [[-0.1, 0.5, 0.0], [0.1, 0.5, 0.0]]
    ahead = dim.user(0.0, 0.9)
    found = decided(dim, [direct(dim, ahead)], room(peaks=ends))
    assert (found.status, found.line_of_sight) == ("ambiguous", None)
    assert found.reason is not None
    assert "too smooth to be seen" in found.reason
    (other,) = found.alternatives
    at(other, dim.user(0.0, 0.1), 1e-9)  # unfolded at y = 0.5
    # A user before them, or beside, is not in doubt; nor is one over a wall that is seen.
    for place in (dim.user(0.0, 0.45), 0.9 * dim.user(0.5, 0.866)):
        assert decided(dim, [direct(dim, place)], room(peaks=ends)).status == "found"
    user = dim.user(1.0, 0.8)
    seen = decided(dim, [reflected(dim, user)], room(slanted(dim), peaks=ends))
    assert seen.status == "found"


def test_a_place_over_a_wall_between_two_peaks_is_known_as_well_as_they_are(
    dim: Dimension,
) -> None:
    image = np.array([0.0, 1.5, 0.0])
    ends = np.array([[-0.1, 0.7, 0.0], [0.1, 0.9, 0.0]])
    found = decided(dim, [direct(dim, image)], room(peaks=ends.tolist()))
    (other,) = found.alternatives
    at(other, np.array([0.7, 0.8, 0.0]), 1e-9)
    assert other.covariance is not None
    # Half a cell along the normal at either end, at random; what the wave itself is known to is
    # far less.
    rng = np.random.default_rng(4)
    normal = np.array([1.0, -1.0, 0.0]) / np.sqrt(2)
    cells = RESOLUTION.cell(ends, normal)
    moved = ends + 0.5 * (cells * rng.standard_normal((2000, 2)))[..., None] * normal
    along = moved[:, 1] - moved[:, 0]
    normals = np.stack([along[:, 1], -along[:, 0], 0 * along[:, 0]], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    height = np.einsum("nx,nx->n", image - moved[:, 0], normals)
    drawn = np.cov((image - 2 * height[:, None] * normals)[:, :2].T)
    # A covariance of 2000 draws is known to 1/√2000 of the deviations' product, or √2 of it.
    scale = np.sqrt(np.outer(np.diag(drawn), np.diag(drawn)))
    np.testing.assert_allclose(other.covariance[:2, :2] / scale, drawn / scale, atol=0.13)


def test_something_on_the_straight_way_may_be_a_short_mirror(dim: Dimension) -> None:
    user = np.array([0.0, 0.9, 0.0])
    found = decided(dim, [direct(dim, user)], room(peaks=[[0.001, 0.5, 0.0]]))
    assert (found.status, found.line_of_sight) == ("ambiguous", None)
    assert found.reason is not None
    where = "0.001, 0.500" if dim is PLANE else "0.001, 0.500, 0.000"
    assert f"something stands on the straight way at ({where}) m" in found.reason
    # Beside the ray by more than two cells, or where the user itself is, it is nothing.
    for place in ([0.03, 0.5, 0.0], [0.0, 0.89, 0.0]):
        assert decided(dim, [direct(dim, user)], room(peaks=[place])).status == "found"


def test_beyond_the_images_reach_the_straight_way_is_open(dim: Dimension) -> None:
    user = dim.user(0.1, 0.9)
    found = decided(dim, [direct(dim, user)], replace(room(), reach=0.8))
    assert (found.status, found.line_of_sight) == ("ambiguous", None)
    assert found.reason is not None
    assert "stands on it to 0.80 m only; take smaller frequency steps" in found.reason
    assert decided(dim, [direct(dim, user)], replace(room(), reach=1.0)).status == "found"


def test_outside_of_the_imaged_sector_the_straight_way_is_open(dim: Dimension) -> None:
    user = dim.user(0.5, 0.5)
    found = decided(dim, [direct(dim, user)], replace(room(), widest=0.5))
    assert (found.status, found.line_of_sight) == ("ambiguous", None)
    assert found.reason is not None
    assert "but only what is within 30.0° of boresight" in found.reason
    assert ("at 45.00°" if dim is PLANE else "aside") in found.reason
    at(found, user)
    assert decided(dim, [direct(dim, user)], replace(room(), widest=0.8)).status == "found"


def test_outside_of_the_sector_a_look_by_itself_clears_the_straight_way(dim: Dimension) -> None:
    user = np.array([0.5, 0.5, 0.0])

    def answer(*peaks: list[float]) -> UserEstimate:
        found = np.array(peaks).reshape(-1, 3)
        context = replace(room(), widest=0.5, aside=lambda heading, farthest: found)
        return decided(dim, [direct(dim, user)], context)

    assert answer().status == "found"
    blocked = answer([0.25, 0.25, 0.0])
    assert blocked.reason is not None
    assert "something stands on the straight way" in blocked.reason
    mirror = answer([0.2, 0.4, 0.0], [0.4, 0.2, 0.0])
    assert mirror.reason is not None
    assert "too smooth to be seen" in mirror.reason
    blind = replace(room(), widest=0.5, aside=lambda heading, farthest: None)
    assert decided(dim, [direct(dim, user)], blind).status == "ambiguous"


@pytest.mark.parametrize(
    ("contrast", "known", "status"),
    [(50.0, False, "ambiguous"), (1e4, False, "found"), (50.0, True, "found")],
)
def test_an_echo_too_noisy_to_show_walls_leaves_the_straight_way_open(
    dim: Dimension, contrast: float, known: bool, status: str
) -> None:
    user = dim.user(0.5, 0.3)  # not over the wall that is known in the last case
    context = replace(room(slanted(dim)) if known else room(), contrast=contrast)
    answer = decided(dim, [direct(dim, user)], context)
    assert answer.status == status
    at(answer, user, 1e-9)
    if status == "ambiguous":
        assert answer.line_of_sight is None
        assert answer.reason is not None
        assert "is 17 dB above its noise, and below 25 dB walls may not show" in answer.reason


def shifted(one: Path, length: float) -> Path:
    """The path as a clock sees it that is ahead by so many metres."""
    late = one.free.path_length - length
    changes = {"path_length": late}
    return replace(one, wave=replace(one.wave, **changes), free=replace(one.free, **changes))  # type: ignore[type-var]


@pytest.mark.parametrize("length", [0.0, 0.009, 0.2, -0.35])
def test_two_paths_tell_the_offset_of_an_unknown_clock(dim: Dimension, length: float) -> None:
    user = dim.user(0.5, 0.75)
    both = [direct(dim, user, share=0.5), reflected(dim, user, share=0.4)]
    late = [shifted(one, length) for one in both]
    found = decided(dim, late, room(slanted(dim)), clock_known=False)
    assert (found.status, found.line_of_sight) == ("found", True)
    at(found, user)
    assert found.clock_offset == pytest.approx(length / speed_of_light, abs=1e-16)
    assert found.clock_deviation is not None
    # Not better than one length itself, far better than the curvature (9 mm of 0.9 m).
    assert LENGTH < found.clock_deviation * speed_of_light < 5e-3


def test_two_parts_of_one_bent_front_tell_no_offset(dim: Dimension) -> None:
    # At a wall's end, one part over it and one beside it: they agree at some offset.
    near = END - 2e-3 * ALONG
    place = 1.8 * near / np.linalg.norm(near)
    turned = place + np.array([0.009, 0.0, 0.0])
    parts = [direct(dim, place, share=0.55), direct(dim, turned, share=0.4)]
    found = decided(dim, parts, room(slanted(dim)), clock_known=False)
    assert found.status == "ambiguous"
    assert sum(one.used for one in found.paths) == 1


@pytest.mark.parametrize("offset_ps", [0.0, 30.0])
def test_one_path_with_an_unknown_clock_is_ambiguous(dim: Dimension, offset_ps: float) -> None:
    user = dim.user(0.2, 0.6)
    late = shifted(direct(dim, user), offset_ps * 1e-12 * speed_of_light)
    found = decided(dim, [late], room(), clock_known=False)
    assert found.status == "ambiguous"
    assert found.reason is not None
    assert "the user's clock offset is unknown, and one path alone cannot tell it" in found.reason
    # Its curvature does, and that place is given: 6 mm of 0.6 m, more than 30 ps are.
    at(found.alternatives[-1], user)
    assert found.alternatives[-1].clock_offset == pytest.approx(1e-12 * offset_ps, abs=1e-16)


def test_one_path_whose_curvature_refutes_a_true_clock_is_placed_by_its_curvature(
    dim: Dimension,
) -> None:
    user = dim.user(0.5, 0.75)
    late = shifted(direct(dim, user), 0.4)
    found = decided(dim, [late], room(slanted(dim)), clock_known=False)
    assert found.status == "ambiguous"
    at(found, user)
    assert found.reason is not None
    assert "curvature only (1.334 ± 0.030 ns)" in found.reason


def test_a_hollow_wave_of_an_unknown_clock_is_put_no_farther_than_a_plane_one(
    dim: Dimension,
) -> None:
    hollow = direct(dim, dim.user(0.5, 0.75), radius=1e4)
    found = decided(dim, [hollow], room(), clock_known=False)
    assert found.status == "ambiguous"
    assert found.position is not None
    assert np.linalg.norm(found.position) == pytest.approx(1e3, rel=1e-6)


def test_without_waves_there_is_no_user(dim: Dimension) -> None:
    found = decided(dim, [], room(slanted(dim)))
    assert (found.status, found.position, found.line_of_sight) == ("not_found", None, None)
    assert found.reason == "no wave stands out of the pilot"


def test_a_wave_that_an_edge_scatters_is_no_user_and_the_reason_says_so(dim: Dimension) -> None:
    # Delay 1.8 m, but round as from the wall's end, 0.67 m away.
    aside = np.radians(78.0)
    found = decided(
        dim,
        [direct(dim, np.array([np.cos(aside), np.sin(aside), 0.0]), length=1.8, radius=0.67)],
        room(slanted(dim)),
    )
    assert (found.status, found.position, found.alternatives) == ("not_found", None, ())
    assert found.reason is not None
    assert ("78.00°" if dim is PLANE else "12.00° aside, 0.00° up") + ", 1.800 m" in found.reason
    assert "comes from a point about 0.67 m away" in found.reason
    assert "edge" in found.reason


def test_a_path_beyond_the_unambiguous_length_is_no_user_and_the_reason_says_so(
    dim: Dimension,
) -> None:
    far = direct(dim, dim.user(0.1, 1.3), length=1.3, radius=5.3)
    found = decided(dim, [far], room(slanted(dim)))
    assert found.status == "not_found"
    assert found.reason is not None
    assert "1.300 m has the curvature of one 5.30 m long" in found.reason
    assert "beyond the unambiguous 4.00 m; take smaller frequency steps" in found.reason


def test_scattered_energy_beside_a_stronger_specular_wave_does_not_matter(dim: Dimension) -> None:
    user = dim.user(1.0, 0.8)
    edge = direct(dim, dim.user(0.3, 1.77), length=1.8, radius=0.7, share=0.2)
    found = decided(dim, [reflected(dim, user, share=0.6), edge], room(slanted(dim)))
    assert found.status == "found"
    at(found, user)


@pytest.mark.parametrize(("aside", "status"), [(0.004, "found"), (0.04, "not_found")])
def test_stronger_scattered_energy_is_explained_by_a_post_on_its_way(
    dim: Dimension, aside: float, status: str
) -> None:
    # A beam that looks at the post: its wave is as long as the way from the user over it.
    user, post = dim.user(0.3, 0.9), dim.user(-0.1, 0.6)
    far = float(np.linalg.norm(post))
    over = direct(
        dim, post, length=far + float(np.linalg.norm(user - post)) + aside, radius=far, share=0.7
    )
    found = decided(dim, [over, direct(dim, user, share=0.3)], room())
    assert found.status == status
    if status == "found":
        at(found, user)


@pytest.mark.parametrize("order", [1, -1])
def test_the_strongest_wave_decides_in_whatever_order_they_were_found(
    dim: Dimension, order: int
) -> None:
    # What a wave from beyond the unambiguous length leaves of a map: a weak ridge that looks
    # specular, found first, and then the wave itself.
    paths = [
        direct(dim, np.array([0.0, 0.15, 0.0]), share=0.11),
        direct(dim, np.array([-1e-3, 0.08, 0.0]), length=0.08, share=0.77, radius=4.08),
    ]
    found = decided(dim, paths[::order], room())
    assert found.status == "not_found"
    assert found.reason is not None
    assert "4.08 m long" in found.reason


def test_without_an_echo_a_position_is_only_a_guess(dim: Dimension) -> None:
    user = dim.user(0.2, 0.4)
    found = decided(dim, [direct(dim, user)], no_image())
    assert found.status == "ambiguous"
    at(found, user, 1e-12)
    assert found.reason is not None
    assert "no echo was measured, so mirrors are unknown" in found.reason
