"""From waves to an answer, on waves that are written down."""

from dataclasses import replace

import numpy as np
import pytest
from jaxtyping import Float
from scipy.constants import speed_of_light
from scipy.linalg import block_diag

from estimator.array.resolution_cell import Resolution
from estimator.channel.path_extraction_2d import Path, PathSet
from estimator.geometry.wall_2d import Wall
from estimator.positioning.position_decision_2d import decide
from estimator.results.estimate import UserEstimate
from estimator.wavefronts.wave_fit_2d import SphericalWave

NOTHING_LOOSE = np.zeros((0, 3))
ANGLE, LENGTH = 1e-4, 5e-5  # deviations of a wave: 0.1 mrad, 0.05 mm
RESOLUTION = Resolution(along_ray=2e-3, across_ray=5e-3)


def wave(aoa_deg: float, length: float, radius: float) -> SphericalWave:
    return SphericalWave(
        aoa=float(np.radians(aoa_deg)),
        path_length=length,
        radius=radius,
        gain=1.0 + 0j,
        covariance=np.diag([ANGLE**2, LENGTH**2, (1e-2 * radius) ** 2]),
        explained=0.9,
    )


def path(aoa_deg: float, length: float, *, share: float = 0.9, radius: float | None = None) -> Path:
    free = wave(aoa_deg, length, radius or length)
    bound = SphericalWave(
        aoa=free.aoa,
        path_length=length,
        radius=length,
        gain=free.gain,
        covariance=free.covariance[:2, :2],
        explained=0.9,
    )
    return Path(wave=bound, free=free, share=share, unambiguous=4.0)


def reflected(user: Float[np.ndarray, " 3"], *, share: float = 0.9) -> Path:
    """The path over the slanted wall: that of the user's image in y = x + 0.8."""
    image = np.array([user[1] - 0.8, user[0] + 0.8])
    return path(
        float(np.degrees(np.arctan2(image[1], image[0]))),
        float(np.linalg.norm(image)),
        share=share,
    )


def direct(user: Float[np.ndarray, " 3"], *, share: float = 0.9) -> Path:
    return path(
        float(np.degrees(np.arctan2(user[1], user[0]))), float(np.linalg.norm(user)), share=share
    )


SLANTED = Wall(
    start=np.array([-0.14, 0.66, 0.0]),
    end=np.array([0.14, 0.94, 0.0]),
    covariance=np.diag([1e-4**2, 2e-5**2]),
)


def together(paths: list[Path]) -> PathSet:
    """Paths whose errors are independent."""
    zero = np.zeros((0, 0))
    return PathSet(
        paths=tuple(paths),
        covariance=block_diag(zero, *(one.wave.covariance for one in paths)),
        free_covariance=block_diag(zero, *(one.free.covariance for one in paths)),
    )


def decided(
    paths: list[Path],
    walls: list[Wall],
    *,
    imaged: bool = True,
    unassigned_peaks: Float[np.ndarray, "peaks 3"] = NOTHING_LOOSE,
) -> UserEstimate:
    return decide(
        "ann",
        together(paths),
        walls,
        resolution=RESOLUTION,
        imaged=imaged,
        unassigned_peaks=unassigned_peaks,
    )


def test_a_direct_path_is_the_user() -> None:
    user = np.array([0.2, 0.4, 0.0])
    found = decided([direct(user)], [SLANTED])
    assert (found.status, found.bounces, found.name, found.reason) == ("found", 0, "ann", None)
    assert found.position is not None
    np.testing.assert_allclose(found.position, user, atol=1e-12)
    assert found.covariance is not None
    # 0.1 mrad at 0.447 m across, 0.05 mm along.
    spread = np.sqrt(np.linalg.eigvalsh(found.covariance[:2, :2]))
    np.testing.assert_allclose(spread, [ANGLE * np.hypot(0.2, 0.4), LENGTH], rtol=1e-6)


def test_a_reflected_path_is_folded_to_the_user() -> None:
    user = np.array([1.0, 0.8, 0.0])
    found = decided([reflected(user)], [SLANTED])
    assert (found.status, found.bounces) == ("found", 1)
    assert found.position is not None
    assert found.path is not None
    np.testing.assert_allclose(found.position, user, atol=1e-9)
    expected = np.array([[0.0, 0.0, 0.0], [0.0, 0.8, 0.0], user])
    np.testing.assert_allclose(found.path, expected, atol=1e-9)
    assert found.aoa == pytest.approx(np.pi / 2)
    assert found.path_length == pytest.approx(1.8)


def test_direct_and_reflected_path_that_agree_are_weighed_together() -> None:
    user = np.array([0.5, 0.75, 0.0])
    both = [direct(user, share=0.5), reflected(user, share=0.4)]
    found = decided(both, [SLANTED])
    alone = decided(both[:1], [SLANTED])
    assert (found.status, found.bounces) == ("found", 0)  # that of the strongest
    assert found.position is not None
    assert found.covariance is not None
    assert alone.covariance is not None
    np.testing.assert_allclose(found.position, user, atol=1e-9)
    # Two measurements know more than one, in every direction.
    gain = np.linalg.eigvalsh(alone.covariance[:2, :2] - found.covariance[:2, :2])
    assert np.all(gain > -1e-18)
    assert gain[-1] > 0


def test_a_path_that_contradicts_the_others_is_dropped_and_the_reason_says_so() -> None:
    user, elsewhere = np.array([0.5, 0.75, 0.0]), np.array([-0.3, 0.4, 0.0])
    three = [direct(user, share=0.4), reflected(user, share=0.4), direct(elsewhere, share=0.15)]
    found = decided(three, [SLANTED])
    assert (found.status, found.line_of_sight) == ("found", True)
    assert [one.used for one in found.paths] == [True, True, False]
    assert [one.mirrors for one in found.paths] == [(), (0,), ()]
    assert found.paths[2].reason == (
        "a stronger path comes over the same mirrors: scattered beside it"
    )
    assert found.position is not None
    np.testing.assert_allclose(found.position, user, atol=1e-9)


def test_two_paths_that_agree_outweigh_a_stronger_one_that_does_not() -> None:
    user, elsewhere = np.array([0.5, 0.75, 0.0]), np.array([-0.3, 0.4, 0.0])
    three = [direct(elsewhere, share=0.4), direct(user, share=0.3), reflected(user, share=0.28)]
    found = decided(three, [SLANTED])
    # The other one is strong all the same: that is said, and its place is given.
    assert found.status == "ambiguous"
    assert found.position is not None
    np.testing.assert_allclose(found.position, user, atol=1e-9)
    (other,) = found.alternatives
    assert other.position is not None
    np.testing.assert_allclose(other.position, elsewhere, atol=1e-9)


def test_line_of_sight_is_stated() -> None:
    user = np.array([0.5, 0.75, 0.0])
    assert decided([direct(user)], [SLANTED]).line_of_sight is True
    assert decided([reflected(user)], [SLANTED]).line_of_sight is False
    assert decided([], [SLANTED]).line_of_sight is None


def test_a_second_path_tells_whether_the_first_meets_a_walls_very_end() -> None:
    # 2 mm before the wall's end: alone it could pass beside it.
    along = np.array([1.0, 1.0]) / np.sqrt(2)
    near = SLANTED.end[:2] - 2e-3 * along
    ray = 1.5 * near / np.linalg.norm(near)
    user = np.array([ray[1] - 0.8, ray[0] + 0.8, 0.0])
    assert decided([reflected(user)], [SLANTED]).status == "ambiguous"
    both = decided([reflected(user, share=0.5), direct(user, share=0.4)], [SLANTED])
    assert (both.status, both.bounces, both.line_of_sight) == ("found", 1, True)
    assert both.position is not None
    np.testing.assert_allclose(both.position, user, atol=1e-9)


def test_a_place_over_a_wall_between_two_peaks_is_known_as_well_as_they_are() -> None:
    image = np.array([0.0, 1.5, 0.0])
    ends = np.array([[-0.1, 0.7, 0.0], [0.1, 0.9, 0.0]])
    found = decided([direct(image)], [], unassigned_peaks=ends)
    (other,) = found.alternatives
    assert other.position is not None
    assert other.covariance is not None
    np.testing.assert_allclose(other.position, [0.7, 0.8, 0.0], atol=1e-9)
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


def test_something_on_the_straight_way_may_be_a_short_mirror() -> None:
    user = np.array([0.0, 0.9, 0.0])
    post = np.array([[0.001, 0.5, 0.0]])
    found = decided([direct(user)], [], unassigned_peaks=post)
    assert (found.status, found.line_of_sight) == ("ambiguous", None)
    assert found.reason is not None
    assert "something stands on the straight way at (0.001, 0.500) m" in found.reason
    # Beside the ray by more than two cells, or where the user itself is, it is nothing.
    for place in ([0.03, 0.5, 0.0], [0.0, 0.89, 0.0]):
        assert decided([direct(user)], [], unassigned_peaks=np.array([place])).status == "found"


@pytest.mark.parametrize(
    ("contrast", "walls", "status"),
    [(50.0, [], "ambiguous"), (1e4, [], "found"), (50.0, [SLANTED], "found")],
)
def test_an_echo_too_noisy_to_show_walls_leaves_the_straight_way_open(
    contrast: float, walls: list[Wall], status: str
) -> None:
    user = np.array([0.5, 0.3, 0.0])  # not over the wall that is known in the last case
    answer = decide(
        "ann",
        together([direct(user)]),
        walls,
        resolution=RESOLUTION,
        imaged=True,
        unassigned_peaks=NOTHING_LOOSE,
        contrast=contrast,
    )
    assert answer.status == status
    assert answer.position == pytest.approx(user, abs=1e-9)
    if status == "ambiguous":
        assert answer.line_of_sight is None
        assert answer.reason is not None
        assert "is 17 dB above its noise, and below 25 dB walls may not show" in answer.reason


def late(paths: list[Path], walls: list[Wall]) -> UserEstimate:
    return decide(
        "ann",
        together(paths),
        walls,
        resolution=RESOLUTION,
        imaged=True,
        unassigned_peaks=NOTHING_LOOSE,
        clock_known=False,
    )


def shifted(one: Path, length: float) -> Path:
    """The path as a clock sees it that is ahead by so many metres."""
    free = replace(one.free, path_length=one.free.path_length - length)
    return replace(one, wave=replace(one.wave, path_length=free.path_length), free=free)


@pytest.mark.parametrize("length", [0.0, 0.2, -0.35])
def test_two_paths_tell_the_offset_of_the_clock(length: float) -> None:
    user = np.array([0.5, 0.75, 0.0])
    both = [direct(user, share=0.5), reflected(user, share=0.4)]
    found = late([shifted(one, length) for one in both], [SLANTED])
    assert (found.status, found.line_of_sight) == ("found", True)
    assert found.position is not None
    np.testing.assert_allclose(found.position, user, atol=1e-8)
    assert found.clock_offset == pytest.approx(length / speed_of_light, abs=1e-16)
    assert found.clock_deviation is not None
    # Not better than one length itself, far better than the curvature (9 mm of 0.9 m).
    assert LENGTH < found.clock_deviation * speed_of_light < 5e-3


def test_one_path_whose_curvature_refutes_a_true_clock_is_placed_by_its_curvature() -> None:
    user = np.array([0.5, 0.75, 0.0])
    found = late([shifted(direct(user), 0.4)], [SLANTED])
    assert found.status == "ambiguous"
    assert found.position is not None
    np.testing.assert_allclose(found.position, user, atol=1e-9)
    assert found.reason is not None
    assert "curvature only (1.334 ± 0.030 ns)" in found.reason


def test_without_waves_there_is_no_user() -> None:
    found = decided([], [SLANTED])
    assert (found.status, found.position) == ("not_found", None)
    assert found.reason == "no wave stands out of the pilot"


def test_a_wave_that_an_edge_scatters_is_no_user_and_the_reason_says_so() -> None:
    # Delay 1.8 m, but round as from the wall's end, 0.67 m away.
    found = decided([path(78.0, 1.8, radius=0.67)], [SLANTED])
    assert (found.status, found.position, found.alternatives) == ("not_found", None, ())
    assert found.reason is not None
    assert "78.00°, 1.800 m" in found.reason
    assert "comes from a point about 0.67 m away" in found.reason
    assert "edge" in found.reason


def test_a_path_beyond_the_unambiguous_length_is_no_user_and_the_reason_says_so() -> None:
    found = decided([path(85.0, 1.3, radius=5.3)], [SLANTED])
    assert found.status == "not_found"
    assert found.reason is not None
    assert "85.00°, 1.300 m has the curvature of one 5.30 m long" in found.reason
    assert "beyond the unambiguous 4.00 m; take smaller frequency steps" in found.reason


def test_scattered_energy_beside_a_stronger_specular_wave_does_not_matter() -> None:
    user = np.array([1.0, 0.8, 0.0])
    edge = path(80.0, 1.8, radius=0.7, share=0.2)
    found = decided([reflected(user, share=0.6), edge], [SLANTED])
    assert found.status == "found"
    assert found.position is not None
    np.testing.assert_allclose(found.position, user, atol=1e-9)


@pytest.mark.parametrize("order", [1, -1])
def test_the_strongest_wave_decides_in_whatever_order_they_were_found(order: int) -> None:
    # What a wave from beyond the unambiguous length leaves of a map: a weak ridge that looks
    # specular, found first, and then the wave itself.
    paths = [path(90.0, 0.15, share=0.11), path(90.9, 0.08, share=0.77, radius=4.08)]
    found = decided(paths[::order], [])
    assert found.status == "not_found"
    assert found.reason is not None
    assert "4.08 m long" in found.reason


def test_two_equal_paths_that_end_at_different_places_are_ambiguous() -> None:
    one, other = np.array([0.3, 0.4, 0.0]), np.array([-0.2, 0.5, 0.0])
    found = decided([direct(one, share=0.5), direct(other, share=0.45)], [SLANTED])
    assert found.status == "ambiguous"
    assert found.reason == "paths of like strength end at different places"
    assert found.position is not None
    np.testing.assert_allclose(found.position, one, atol=1e-9)
    assert len(found.alternatives) == 1
    alternative = found.alternatives[0]
    assert alternative.position is not None
    np.testing.assert_allclose(alternative.position, other, atol=1e-9)


def test_a_much_weaker_path_elsewhere_does_not_make_it_ambiguous() -> None:
    one, other = np.array([0.3, 0.4, 0.0]), np.array([-0.2, 0.5, 0.0])
    found = decided([direct(one, share=0.8), direct(other, share=0.1)], [SLANTED])
    assert (found.status, found.alternatives) == ("found", ())


def test_without_an_echo_a_position_is_only_a_guess() -> None:
    user = np.array([0.2, 0.4, 0.0])
    found = decided([direct(user)], [], imaged=False)
    assert found.status == "ambiguous"
    assert found.position is not None
    np.testing.assert_allclose(found.position, user, atol=1e-12)
    assert found.reason is not None
    assert "no echo was measured, so mirrors are unknown" in found.reason


@pytest.mark.parametrize(("inside", "bounces"), [(True, 1), (False, 0)])
def test_at_a_walls_very_end_the_ray_may_pass_beside_it(inside: bool, bounces: int) -> None:
    # The ray to a point of the wall's line 2 mm before or behind its end, at 0.95 m: 1.5 mrad,
    # less than the 5 mrad of the image's cell.
    along = np.array([1.0, 1.0]) / np.sqrt(2)
    near = SLANTED.end[:2] + (-2e-3 if inside else 2e-3) * along
    ray = near / np.linalg.norm(near)
    found = decided([path(float(np.degrees(np.arctan2(ray[1], ray[0]))), 1.8)], [SLANTED])
    assert found.status == "ambiguous"
    assert found.bounces == bounces
    assert found.reason == "the path meets a wall at its very end: it may pass beside it"
    (other,) = found.alternatives
    assert other.bounces == 1 - bounces
    assert found.position is not None
    assert other.position is not None
    # One is the other's image in the wall's line y = x + 0.8.
    np.testing.assert_allclose(
        other.position[:2], [found.position[1] - 0.8, found.position[0] + 0.8], atol=1e-6
    )


def test_well_inside_or_well_beside_a_wall_nothing_is_ambiguous() -> None:
    along = np.array([1.0, 1.0]) / np.sqrt(2)
    for beyond in (-2e-2, 2e-2):
        near = SLANTED.end[:2] + beyond * along
        found = decided([path(float(np.degrees(np.arctan2(near[1], near[0]))), 1.8)], [SLANTED])
        assert found.status == "found"


def test_a_ray_between_two_loose_points_may_pass_over_a_wall_too_smooth_to_be_seen() -> None:
    ends = np.array([[-0.1, 0.5, 0.0], [0.1, 0.5, 0.0]])
    ahead = path(90.0, 0.9)
    found = decided([ahead], [], unassigned_peaks=ends)
    assert found.status == "ambiguous"
    assert found.reason is not None
    assert "too smooth to be seen" in found.reason
    (other,) = found.alternatives
    assert other.position is not None
    np.testing.assert_allclose(other.position, [0.0, 0.1, 0.0], atol=1e-9)  # folded at y = 0.5
    # A user before them, or beside, is not in doubt; nor is one over a wall that is seen.
    assert decided([path(90.0, 0.45)], [], unassigned_peaks=ends).status == "found"
    assert decided([path(60.0, 0.9)], [], unassigned_peaks=ends).status == "found"
    assert (
        decided([reflected(np.array([1.0, 0.8, 0.0]))], [SLANTED], unassigned_peaks=ends).status
        == "found"
    )
