from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.geometry.specular_chains_2d import possible_chains
from estimator.geometry.wall_2d import Wall, mirrored
from estimator.imaging.backprojection import focus, prepare
from estimator.imaging.range_compression import range_profiles
from estimator.mapping.ghost_correction import corrected_image
from estimator.measurement.model import Echo


def wall(start: tuple[float, float], end: tuple[float, float]) -> Wall:
    return Wall(
        start=np.array([*start, 0.0]), end=np.array([*end, 0.0]), covariance=np.zeros((2, 2))
    )


SLANTED = wall((-0.1, 0.2), (0.1, 0.4))  # 45° through (0, 0.3)


def spot(place: Float[np.ndarray, " 3"], width: float = 5e-3) -> Any:
    """A raw image that is bright around one place, in closed form."""

    def focuser(points: Float[np.ndarray, "*grid 3"]) -> Complex[np.ndarray, "*grid"]:
        away = np.linalg.norm(points - place, axis=-1)
        return np.asarray(np.exp(-((away / width) ** 2)) * np.exp(1j * points[..., 0]))

    return focuser


def one(points: Float[np.ndarray, "*grid 3"]) -> Complex[np.ndarray, "*grid"]:
    return np.ones(points.shape[:-1], dtype=np.complex128)


def test_a_ghost_maps_back_onto_its_target() -> None:
    target = np.array([0.2, 0.32, 0.0])
    ghost = mirrored(target, SLANTED.start, SLANTED.end)
    at_both = np.stack([target, ghost])
    unfolded = corrected_image(spot(ghost), at_both, [SLANTED], possible_chains([SLANTED]))
    image = unfolded.values
    assert abs(image[0]) == pytest.approx(1.0, abs=1e-12)
    assert image[1] == 0  # and nothing is left where it seemed to be
    # The value is the raw image's at the ghost, phase and all.
    assert image[0] == pytest.approx(np.exp(1j * ghost[0]), abs=1e-12)
    # What moved is recorded: over the mirror, and nothing is seen behind it.
    assert unfolded.chains[unfolded.chain[0]] == (0,)
    assert unfolded.chain[1] == -1


@settings(deadline=None, max_examples=50)
@given(st.floats(-0.3, 0.3), st.floats(0.05, 0.6))
def test_nothing_behind_a_wall_remains_and_what_is_seen_directly_is_untouched(
    x: float, y: float
) -> None:
    point = np.array([[x, y, 0.0]])
    # The ray to the point crosses the line y = x + 0.3 at (s·x, s·y), s = 0.3/(y - x).
    assume(abs(y - x) > 1e-6)
    share = 0.3 / (y - x)
    assume(abs(share - 1) > 1e-6)
    assume(abs(abs(share * x) - 0.1) > 1e-6)
    hidden = 0 < share < 1 and abs(share * x) < 0.1
    # Through the wall the array sees what lies at the point's image, if it is behind the wall.
    image = mirrored(point, SLANTED.start, SLANTED.end)[0]
    far = 0.3 / (image[1] - image[0]) if abs(image[1] - image[0]) > 1e-9 else -1.0
    assume(abs(far - 1) > 1e-6)
    assume(abs(abs(far * image[0]) - 0.1) > 1e-6)
    through = 0 < far < 1 and abs(far * image[0]) < 0.1
    unfolded = corrected_image(one, point, [SLANTED], possible_chains([SLANTED]))
    assert unfolded.values[0] == int(not hidden or through)
    assert (unfolded.chain[0] >= 0) == (not hidden or through)


def test_without_walls_the_image_stays_as_it_is() -> None:
    points = np.random.default_rng(1).uniform([-0.3, 0.1, 0], [0.3, 0.5, 0], (4, 5, 3))
    focuser = spot(np.array([0.0, 0.3, 0.0]), width=0.2)
    unfolded = corrected_image(focuser, points, [], possible_chains([]))
    np.testing.assert_array_equal(unfolded.values, focuser(points))
    assert unfolded.chains == ((),)
    assert not unfolded.chain.any()


def test_of_two_views_of_a_thing_the_brighter_is_kept() -> None:
    other = wall((0.15, 0.4), (0.35, 0.2))  # −45°
    target = np.array([0.1, 0.15, 0.0])
    ghosts = [mirrored(target, one.start, one.end) for one in (SLANTED, other)]
    both = [SLANTED, other]

    def focuser(points: Float[np.ndarray, "*grid 3"]) -> Complex[np.ndarray, "*grid"]:
        return np.asarray(sum(spot(ghost)(points) * (i + 1) for i, ghost in enumerate(ghosts)))

    unfolded = corrected_image(focuser, target[None], both, possible_chains(both))
    # The brighter one, as the raw image has it; the other is centimetres off: exp(-(40/5)²).
    assert unfolded.values[0] == pytest.approx(2 * np.exp(1j * ghosts[1][0]), abs=1e-12)
    assert unfolded.chains[unfolded.chain[0]] == (1,)


def test_the_focuser_is_asked_only_for_what_is_seen() -> None:
    asked: list[np.ndarray] = []

    def focuser(points: Float[np.ndarray, "*grid 3"]) -> Complex[np.ndarray, "*grid"]:
        asked.append(points)
        return one(points)

    behind = np.array([[-0.05, 0.5, 0.0]])
    assert corrected_image(focuser, behind, [SLANTED], possible_chains([SLANTED])).values[0] == 0
    assert sum(points.size for points in asked) == 0


def test_the_echo_over_a_mirror_focuses_on_the_target_itself(world: Any) -> None:
    # A point target that is seen over the mirror only: its echo is that of its image.
    target = np.array([0.1, 0.31, 0.0])
    ghost = mirrored(target, SLANTED.start, SLANTED.end)
    positions = world.array()
    ranges = np.linalg.norm(ghost - positions, axis=-1)[:, None]
    samples = np.exp(-4j * np.pi * world.band / speed_of_light * ranges)
    echo = Echo(samples=samples, positions=positions, frequencies=world.band)
    ready = prepare(range_profiles(echo))
    x, y = [-0.02, -4e-3, 0.0, 4e-3, 0.02], [-0.01, -2e-3, 0.0, 2e-3, 0.01]
    offsets = np.stack(np.meshgrid(x, y, [0.0], indexing="ij"), axis=-1)
    around = target + offsets[:, :, 0]
    unfolded = corrected_image(
        lambda points: focus(ready, points), around, [SLANTED], possible_chains([SLANTED])
    )
    image = np.abs(unfolded.values)
    assert int(np.argmax(image)) == 12  # the one in the middle
    assert image[2, 2] == pytest.approx(1.0, abs=1e-3)  # what back-projection promises
