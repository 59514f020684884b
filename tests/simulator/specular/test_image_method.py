from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from simulator.geometry.mirrors import Mirrors, line_mirrors
from simulator.materials.fresnel_slab import Conductor
from simulator.specular import image_method
from simulator.specular.image_method import Chain, find_chains

LENGTH_ROUNDING = 1e-14
"""A few roundings of double precision at lengths of some metres."""


def clear_air(starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    return np.zeros(len(starts), dtype=bool)


def solid(mirrors: Mirrors) -> image_method.Blocked:
    """Occlusion by the mirrors themselves: does a segment cross a plane inside the edges?"""

    def blocked(starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
        hit = np.zeros(len(starts), dtype=bool)
        for index, (origin, normal) in enumerate(
            zip(mirrors.corners[:, 0], mirrors.normals, strict=True)
        ):
            before, after = (starts - origin) @ normal, (ends - origin) @ normal
            crosses = before * after < 0
            share = np.divide(before, before - after, out=np.zeros_like(before), where=crosses)
            points = starts + share[:, None] * (ends - starts)
            hit |= crosses & (mirrors.margins(points, index) >= 0)
        return hit

    return blocked


def make(corners: np.ndarray, *, two_sided: bool = True, rms: float = 0.0) -> Mirrors:
    return Mirrors(
        corners=corners,
        materials=(Conductor(),) * len(corners),
        rms_heights=np.full(len(corners), rms),
        two_sided=np.full(len(corners), two_sided),
    )


def floor(size: float = 4.0, *, two_sided: bool = True, rms: float = 0.0) -> Mirrors:
    square = size / 2 * np.array([[[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]], dtype=float)
    return make(square, two_sided=two_sided, rms=rms)


def box_corners(size: np.ndarray) -> np.ndarray:
    """Six faces of a box with a corner at the origin, normals outward."""
    faces = []
    for axis in range(3):
        for side in (0.0, 1.0):
            face = np.zeros((4, 3))
            face[:, axis] = side
            face[:, (axis + 1) % 3] = [0, 1, 1, 0] if side else [1, 0, 0, 1]
            face[:, (axis + 2) % 3] = [0, 0, 1, 1]
            faces.append(face * size)
    return np.array(faces)


def random_plates(rng: np.random.Generator, count: int) -> Mirrors:
    squares = []
    for _ in range(count):
        width, height = rng.uniform(0.3, 1.0, 2)
        plate = np.array([[-width, -height, 0], [width, -height, 0], [width, height, 0]])
        plate = np.vstack([plate, [[-width, height, 0]]])
        squares.append(plate @ Rotation.random(rng=rng).as_matrix().T + rng.uniform(-1, 1, 3))
    return make(np.array(squares))


def as_links(chains: Sequence[Chain]) -> dict[tuple[int, int, tuple[int, ...]], float]:
    return {
        (int(source), int(receiver), chain.mirrors): float(length)
        for chain in chains
        for source, receiver, length in zip(*np.nonzero(chain.valid), chain.lengths, strict=True)
    }


def test_the_line_of_sight_is_straight() -> None:
    ends = np.array([[3.0, 4.0, 12.0]])
    (chain,) = find_chains(floor(), np.zeros((1, 3)), ends, blocked=clear_air, max_bounces=0)
    assert chain.mirrors == ()
    assert chain.lengths[0] == 13
    np.testing.assert_allclose(chain.departures, ends / 13, rtol=1e-15)
    np.testing.assert_allclose(chain.arrivals, -ends / 13, rtol=1e-15)
    assert chain.vertices.shape == (1, 0, 3)


def test_a_floor_reflects_at_equal_angles_as_if_from_the_image() -> None:
    source, receiver = np.array([[-1.0, 0.0, 1.0]]), np.array([[1.0, 0.0, 3.0]])
    _, chain = find_chains(floor(), source, receiver, blocked=clear_air)
    assert chain.mirrors == (0,)
    np.testing.assert_allclose(chain.lengths, np.sqrt(20), rtol=1e-15)
    np.testing.assert_allclose(chain.vertices, [[[-0.5, 0, 0]]], atol=1e-15)
    np.testing.assert_allclose(chain.cosines, 4 / np.sqrt(20), rtol=1e-15)
    np.testing.assert_allclose(chain.departures, [[1, 0, -2] / np.sqrt(5)], atol=1e-15)
    np.testing.assert_allclose(chain.arrivals, [[-1, 0, -2] / np.sqrt(5)], atol=1e-15)


def test_a_closed_room_shows_all_images_of_the_source_lattice() -> None:
    size = np.array([1.3, 0.9, 0.7])
    walls = make(box_corners(size))
    source, receiver = np.array([[0.31, 0.42, 0.13]]), np.array([[0.97, 0.11, 0.53]])
    chains = find_chains(walls, source, receiver, blocked=solid(walls), max_bounces=3)
    lattice = []
    for shift in np.ndindex(7, 7, 7):
        cell = np.array(shift) - 3
        if np.abs(cell).sum() <= 3:
            image = np.where(cell % 2, cell * size + size - source[0], cell * size + source[0])
            lattice.append(np.linalg.norm(receiver[0] - image))
    assert len(lattice) == 1 + 6 + 18 + 38
    lengths = [length for chain in chains for length in chain.lengths]
    np.testing.assert_allclose(np.sort(lengths), np.sort(lattice), rtol=LENGTH_ROUNDING)


def test_a_rough_room_is_no_darker_than_a_smooth_one() -> None:
    # The crests of real walls stand before the mean planes on which the vertices lie.
    size = np.array([1.3, 0.9, 0.7])
    crests = solid(make(box_corners(size - 8e-4) + 4e-4))
    walls = make(box_corners(size), rms=1e-4)
    source, receiver = np.array([[0.31, 0.42, 0.13]]), np.array([[0.97, 0.11, 0.53]])
    assert len(find_chains(walls, source, receiver, blocked=crests)) == 63
    smooth = make(box_corners(size))
    assert len(find_chains(smooth, source, receiver, blocked=crests)) == 1


def test_a_right_angled_corner_returns_every_ray_antiparallel() -> None:
    corner = make(box_corners(np.ones(3))[[0, 2]])  # the planes x = 0 and y = 0
    sources = np.array([[0.4, 0.3, 0.2], [0.3, 0.4, 0.2], [0.5, 0.1, 0.8]])
    receivers = sources + np.array([0.001, 0.002, 0.0])
    chains = find_chains(corner, sources, receivers, blocked=solid(corner), min_bounces=2)
    assert {chain.mirrors for chain in chains} == {(0, 1), (1, 0)}
    # Each link has one path: in one order or the other, never in both.
    np.testing.assert_array_equal(sum(chain.valid.astype(int) for chain in chains), 1)
    turned = np.array([-1.0, -1.0, 1.0])
    for chain in chains:
        source, receiver = np.nonzero(chain.valid)
        unfolded = np.linalg.norm(sources[source] * turned - receivers[receiver], axis=1)
        np.testing.assert_allclose(chain.lengths, unfolded, rtol=LENGTH_ROUNDING)
        np.testing.assert_allclose(
            chain.directions[:, -1], turned * chain.directions[:, 0], atol=1e-15
        )


@pytest.mark.parametrize(("side", "paths"), [(1.0, 1), (-1.0, 0)])
def test_the_inside_of_a_body_does_not_reflect(side: float, paths: int) -> None:
    ends = np.array([[0.5, 0.0, side]])
    chains = find_chains(
        floor(two_sided=False), -ends * [1, 1, -1], ends, blocked=clear_air, min_bounces=1
    )
    assert len(chains) == paths


def test_a_plate_reflects_on_both_sides_but_only_on_the_side_of_both_ends() -> None:
    ends = np.array([[0.5, 0.0, 1.0], [0.5, 0.0, -1.0]])
    (chain,) = find_chains(floor(), ends * [-1, 1, 1], ends, blocked=clear_air, min_bounces=1)
    np.testing.assert_array_equal(chain.valid, np.eye(2, dtype=bool))


@pytest.mark.parametrize(("offset", "paths"), [(-1e-6, 1), (1e-6, 0)])
def test_a_mirror_ends_at_its_edge(offset: float, paths: int) -> None:
    edge, beside = np.array([[[2.0 + offset, 0.0, 1.0]], [[2.0 + offset, 0.5, 1.0]]])
    chains = find_chains(floor(4.0), edge, beside, blocked=clear_air, min_bounces=1)
    assert len(chains) == paths


def test_what_stands_in_any_leg_takes_the_path_away() -> None:
    mirrors = floor()
    source, receiver = np.array([[-1.0, 0.0, 1.0]]), np.array([[1.0, 0.0, 1.0]])
    for x, left in [(-0.5, [()]), (0.5, [()]), (2.0, [(), (0,)])]:
        screen = np.array([[[x, -1, 0.1], [x, 1, 0.1], [x, 1, 0.8], [x, -1, 0.8]]])
        chains = find_chains(mirrors, source, receiver, blocked=solid(make(screen)))
        assert [chain.mirrors for chain in chains] == left


def test_a_mirror_does_not_shadow_its_own_reflection_even_at_grazing_angles() -> None:
    mirrors = floor(20.0)
    height = 1e-4  # 10 m apart: 0.001 degrees
    source, receiver = np.array([[-5.0, 0.0, height]]), np.array([[5.0, 0.0, height]])
    chains = find_chains(mirrors, source, receiver, blocked=solid(mirrors))
    assert [chain.mirrors for chain in chains] == [(), (0,)]
    assert chains[1].cosines[0, 0] == pytest.approx(2e-5, rel=1e-9)


def test_a_point_in_the_plane_of_a_mirror_has_no_image() -> None:
    points = np.array([[0.5, 0.0, 0.0]])
    above = np.array([[0.0, 0.0, 1.0]])
    assert not find_chains(floor(), points, above, blocked=clear_air, min_bounces=1)
    assert not find_chains(floor(), above, points, blocked=clear_air, min_bounces=1)


def test_a_point_does_not_see_itself_directly() -> None:
    point = np.array([[0.0, 0.0, 1.0]])
    (chain,) = find_chains(floor(), point, point, blocked=clear_air)
    assert chain.mirrors == (0,)
    assert chain.lengths[0] == 2


def test_receivers_on_a_rough_surface_are_not_lit_by_that_surface() -> None:
    mirrors = make(box_corners(np.ones(3))[[0, 2]])
    source = np.array([[0.4, 0.3, 0.2]])
    crest = np.array([[0.001, 0.5, 0.5]])  # of the roughness of mirror 0, the plane x = 0
    chains = find_chains(mirrors, source, crest, blocked=clear_air, receivers_on=0)
    assert all(chain.mirrors[-1:] != (0,) for chain in chains)
    assert (1,) in [chain.mirrors for chain in chains]
    freely = find_chains(mirrors, source, crest, blocked=clear_air)
    assert (0,) in [chain.mirrors for chain in freely]


def test_a_receiver_on_a_surface_is_seen_from_just_off_it() -> None:
    body = floor()
    source, receiver = np.array([[0.0, 0.0, 1.0]]), np.array([[0.5, 0.0, -1e-9]])
    assert not find_chains(body, source, receiver, blocked=solid(body), max_bounces=0)
    (chain,) = find_chains(
        body,
        source,
        receiver,
        blocked=solid(body),
        max_bounces=0,
        receiver_offsets=np.array([[0.0, 0.0, 1e-6]]),
    )
    assert chain.lengths[0] == pytest.approx(np.hypot(1.0, 0.5), abs=2e-9)


@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_exchanging_both_ends_reverses_every_path(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mirrors = random_plates(rng, 5)
    sources, receivers = rng.uniform(-1, 1, (2, 3)), rng.uniform(-1, 1, (3, 3))
    there = as_links(find_chains(mirrors, sources, receivers, blocked=solid(mirrors)))
    back = as_links(find_chains(mirrors, receivers, sources, blocked=solid(mirrors)))
    reversed_back = {(r, s, sequence[::-1]): length for (s, r, sequence), length in back.items()}
    assert there.keys() == reversed_back.keys()
    for link, length in there.items():
        assert length == pytest.approx(reversed_back[link], rel=LENGTH_ROUNDING)


@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_moving_the_whole_scene_changes_no_path(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mirrors = random_plates(rng, 5)
    points = rng.uniform(-1, 1, (4, 3))
    turn, shift = Rotation.random(rng=rng).as_matrix(), rng.uniform(-3, 3, 3)
    moved = make(mirrors.corners @ turn.T + shift)
    here = as_links(find_chains(mirrors, points[:1], points[1:], blocked=solid(mirrors)))
    there = points @ turn.T + shift
    away = as_links(find_chains(moved, there[:1], there[1:], blocked=solid(moved)))
    assert here.keys() == away.keys()
    for link, length in here.items():
        assert length == pytest.approx(away[link], rel=3 * LENGTH_ROUNDING)


def test_leaving_out_mirrors_beyond_the_beams_loses_no_path(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def everything(mirrors: Mirrors, sequence: tuple[int, ...], latest: np.ndarray) -> np.ndarray:
        return np.array([mirror != (*sequence, None)[-2:][0] for mirror in range(len(mirrors))])

    rng = np.random.default_rng(0)
    scenes = [(random_plates(rng, 5), rng.uniform(-1, 1, (40, 3))) for _ in range(2)]

    def all_links() -> list[dict[tuple[int, int, tuple[int, ...]], float]]:
        return [
            as_links(find_chains(mirrors, points[:20], points[20:], blocked=solid(mirrors)))
            for mirrors, points in scenes
        ]

    pruned = all_links()
    monkeypatch.setattr(image_method, "within_reach", everything)
    assert all_links() == pruned
    assert sum(len(sequence) > 1 for links in pruned for _, _, sequence in links) > 10


def test_tracing_in_pieces_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(1)
    mirrors, points = random_plates(rng, 6), rng.uniform(-1, 1, (20, 3))
    whole = find_chains(mirrors, points[:9], points[9:], blocked=solid(mirrors))
    monkeypatch.setattr(image_method, "PAIRS_AT_ONCE", 40)
    pieces = find_chains(mirrors, points[:9], points[9:], blocked=solid(mirrors))
    assert [chain.mirrors for chain in whole] == [chain.mirrors for chain in pieces]
    for one, other in zip(whole, pieces, strict=True):
        for name in ("valid", "lengths", "vertices", "cosines", "directions"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_lengths_directions_and_vertices_of_a_path_agree() -> None:
    rng = np.random.default_rng(2)
    mirrors, points = random_plates(rng, 6), rng.uniform(-1, 1, (60, 3))
    for chain in find_chains(mirrors, points[:30], points[30:], blocked=solid(mirrors)):
        source, receiver = np.nonzero(chain.valid)
        corners = np.concatenate(
            [points[source][:, None], chain.vertices, points[30 + receiver][:, None]], axis=1
        )
        legs = np.diff(corners, axis=1)
        lengths = np.linalg.norm(legs, axis=-1)
        np.testing.assert_allclose(lengths.sum(axis=1), chain.lengths, rtol=LENGTH_ROUNDING)
        np.testing.assert_allclose(
            legs, lengths[..., None] * chain.directions, atol=LENGTH_ROUNDING
        )


def test_a_scene_without_mirrors_has_the_line_of_sight_only() -> None:
    empty = make(np.empty((0, 4, 3)))
    (chain,) = find_chains(empty, np.zeros((1, 3)), np.ones((2, 3)), blocked=clear_air)
    assert chain.mirrors == ()
    assert chain.valid.all()
    assert not find_chains(empty, np.zeros((1, 3)), np.empty((0, 3)), blocked=clear_air)


def test_the_thesis_wall_turns_a_user_into_its_ghost() -> None:
    half = 0.2 * np.array([np.cos(np.pi / 4), np.sin(np.pi / 4), 0.0])
    centre = np.array([0.0, 0.8, 0.0])
    wall = line_mirrors(
        (centre - half)[None],
        (centre + half)[None],
        materials=[Conductor()],
        rms_heights=np.zeros(1),
        two_sided=np.ones(1, dtype=bool),
    )
    array = np.zeros((260, 3))
    array[:, 0] = 0.5e-3 * (np.arange(260) - 129.5)
    user = np.array([[1.0, 0.8, 0.0]])
    (chain,) = find_chains(wall, user, array, blocked=solid(wall), min_bounces=1)
    ghost = np.array([0.0, 1.8, 0.0])
    np.testing.assert_allclose(
        chain.lengths, np.linalg.norm(array - ghost, axis=1), rtol=LENGTH_ROUNDING
    )
    np.testing.assert_array_equal(chain.vertices[..., 2], 0)
