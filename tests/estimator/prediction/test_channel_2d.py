"""The predicted channel against closed forms, the simulator's chains and Monte Carlo."""

# Over 400 lines: one map serves all cases.

from collections.abc import Sequence

import numpy as np
import pytest
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.array.array_frame import array_frame
from estimator.geometry.bearing_2d import LINEAR
from estimator.geometry.path_tracing import project
from estimator.geometry.wall_2d import Wall
from estimator.prediction.channel_2d import PredictedPath, predict_channel, predict_user_channel
from estimator.prediction.wall_reflection import (
    ASSUMED_DB,
    ASSUMED_DEVIATION_DB,
    MeasuredGain,
    excess_db,
    wall_reflections,
)
from estimator.results.estimate import Estimate, Mirror, Target, UserEstimate
from simulator.geometry.mirrors import Mirrors, line_mirrors
from simulator.materials.fresnel_slab import Conductor
from simulator.specular.image_method import find_chains
from validation.analytic.point_scatterer import point_echo, point_uplink

FREQUENCY = 257.5e9
WAVELENGTH = speed_of_light / FREQUENCY
EXACT = np.zeros((3, 3))
ROUNDING = 1e-12  # some hundred roundings of double precision at a few metres


def wall(
    x: float,
    y: float,
    angle_deg: float,
    length: float,
    *,
    tilt: float = 0.0,
    offset: float = 0.0,
) -> Wall:
    angle = np.radians(angle_deg)
    half = 0.5 * length * np.array([np.cos(angle), np.sin(angle), 0.0])
    middle = np.array([x, y, 0.0])
    covariance = np.diag([tilt**2, offset**2])
    return Wall(start=middle - half, end=middle + half, covariance=covariance)


def at(x: float, y: float) -> Float[np.ndarray, " 3"]:
    return np.array([x, y, 0.0])


DIAGONAL = wall(0.0, 0.8, 45.0, 0.4)


def over(paths: Sequence[PredictedPath], *walls: int) -> PredictedPath:
    (path,) = [path for path in paths if path.walls == walls and path.target is None]
    return path


# Closed forms


def test_the_image_of_the_user_tells_angle_and_delay() -> None:
    paths = predict_channel(at(1.0, 0.8), EXACT, [DIAGONAL], frequency=FREQUENCY)
    assert [path.walls for path in paths] == [(), (0,)]  # strongest first
    direct, reflected = paths
    assert direct.path_length == pytest.approx(np.hypot(1.0, 0.8), rel=ROUNDING)
    assert direct.aoa == pytest.approx(np.arctan2(0.8, 1.0), rel=ROUNDING)
    assert direct.gain == pytest.approx(WAVELENGTH / (4 * np.pi * direct.path_length))
    assert direct.level_db == pytest.approx(20 * np.log10(direct.gain))
    assert np.isinf(direct.margin)
    # Up to the wall and off to the right: 0.8 m and 1.0 m.
    assert reflected.path_length == pytest.approx(1.8, rel=ROUNDING)
    assert reflected.delay == pytest.approx(1.8 / speed_of_light, rel=ROUNDING)
    assert np.degrees(reflected.aoa) == pytest.approx(90.0, rel=ROUNDING)
    np.testing.assert_allclose(
        reflected.vertices, [at(0, 0), at(0, 0.8), at(1.0, 0.8)], atol=ROUNDING
    )
    assert reflected.margin == pytest.approx(0.2, rel=ROUNDING)
    free = WAVELENGTH / (4 * np.pi * 1.8)
    assert 20 * np.log10(reflected.gain / free) == pytest.approx(ASSUMED_DB)
    assert reflected.gain_deviation_db == pytest.approx(ASSUMED_DEVIATION_DB)


def test_a_wall_hides_what_is_behind_it() -> None:
    screen = wall(0.5, 0.4, 130.0, 0.3)  # across the line of sight
    paths = predict_channel(at(1.0, 0.8), EXACT, [DIAGONAL, screen], frequency=FREQUENCY)
    assert [path.walls for path in paths] == [(0,)]
    curtain = wall(0.4, 0.8, 90.0, 0.2)  # across the second leg
    paths = predict_channel(at(1.0, 0.8), EXACT, [DIAGONAL, curtain], frequency=FREQUENCY)
    assert () in [path.walls for path in paths]
    assert (0,) not in [path.walls for path in paths]


def test_a_wall_reflects_within_its_ends_only() -> None:
    user = at(1.0, 0.8 + 0.15)
    inside = over(predict_channel(user, EXACT, [DIAGONAL], frequency=FREQUENCY), 0)
    bounce = inside.vertices[1] - at(0.0, 0.8)
    assert inside.margin == pytest.approx(0.2 - np.linalg.norm(bounce), rel=1e-9)
    beyond = at(0.8, 1.05)  # its ray would meet the line 0.21 m from the wall's middle
    short = predict_channel(beyond, EXACT, [DIAGONAL], frequency=FREQUENCY)
    assert [path.walls for path in short] == [()]
    slack = predict_channel(beyond, EXACT, [DIAGONAL], frequency=FREQUENCY, end_slack=0.02)
    # The image (0.25, 1.6) and the line y = x + 0.8 meet at x = 0.8/5.4.
    assert over(slack, 0).margin == pytest.approx(0.2 - np.sqrt(2) * 0.8 / 5.4, rel=1e-9)


def test_nothing_arrives_from_behind_the_array() -> None:
    behind = wall(0.0, -0.5, 0.0, 4.0)
    paths = predict_channel(at(0.3, 1.0), EXACT, [behind], frequency=FREQUENCY)
    assert [path.walls for path in paths] == [()]
    assert predict_channel(at(0.3, -1.0), EXACT, [], frequency=FREQUENCY) == ()


# A second method


class Seen:
    """Whether a segment crosses a mirror inside its edges."""

    def __init__(self, mirrors: Mirrors) -> None:
        self.mirrors = mirrors

    def __call__(self, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
        hit = np.zeros(len(starts), dtype=bool)
        for index in range(len(self.mirrors)):
            before, after = (self.mirrors.heights(points, index) for points in (starts, ends))
            crosses = before * after < 0
            share = np.divide(before, before - after, out=np.zeros_like(before), where=crosses)
            points = starts + share[:, None] * (ends - starts)
            hit |= crosses & (self.mirrors.margins(points, index) >= 0)
        return hit


@pytest.mark.parametrize("seed", range(12))
def test_the_paths_are_those_of_the_simulator(seed: int) -> None:
    rng = np.random.default_rng(seed)
    walls = [
        wall(x, y, angle_deg, length)
        for x, y, angle_deg, length in rng.uniform([-1.5, 0.3, 0, 0.5], [1.5, 2, 180, 1.5], (5, 4))
    ]
    user = at(*rng.uniform([-1.5, 0.2], [1.5, 2.0]))
    mirrors = line_mirrors(
        np.stack([one.start for one in walls]),
        np.stack([one.end for one in walls]),
        materials=(Conductor(),) * 5,
        rms_heights=np.zeros(5),
        two_sided=np.ones(5, dtype=bool),
    )
    chains = find_chains(mirrors, np.zeros((1, 3)), user[None], blocked=Seen(mirrors))
    expected = {chain.mirrors: chain for chain in chains if chain.departures[0, 1] > 0}
    paths = predict_channel(user, EXACT, walls, frequency=FREQUENCY)
    assert {path.walls for path in paths} == set(expected)
    for path in paths:
        chain = expected[path.walls]
        assert path.path_length == pytest.approx(chain.lengths[0], rel=ROUNDING)
        direction = chain.departures[0]
        assert path.aoa == pytest.approx(np.arctan2(direction[1], direction[0]), abs=ROUNDING)
        # A grazing bounce moves along its wall by the rounding over the sine of incidence.
        np.testing.assert_allclose(path.vertices[1:-1], chain.vertices[0], atol=1e-9)


def test_the_seeds_hold_chains_of_three_mirrors() -> None:
    """What the comparison above rests on: a closed room has paths of every order."""
    room = [wall(0, 2.0, 3.0, 4.0), wall(-1.5, 1.0, 88.0, 3.0), wall(1.5, 1.0, 93.0, 3.0)]
    paths = predict_channel(at(0.4, 1.1), EXACT, room, frequency=FREQUENCY)
    assert {len(path.walls) for path in paths} == {0, 1, 2, 3}
    assert {len(path.walls) for path in paths if len(path.walls) <= 1} == {
        len(path.walls)
        for path in predict_channel(at(0.4, 1.1), EXACT, room, frequency=FREQUENCY, max_bounces=1)
    }


# Uncertainty


def test_the_path_that_gave_the_position_is_as_certain_as_it_was_measured() -> None:
    walls = [wall(0.0, 0.8, 45.0, 0.6, tilt=5e-4, offset=2e-4), wall(0.9, 0.8, -45.0, 0.6)]
    walls[1] = Wall(start=walls[1].start, end=walls[1].end, covariance=np.diag([1e-6, 1e-7]))
    measured = np.array([[1e-10, 2e-10], [2e-10, 1e-9]])
    found = project(LINEAR, np.radians([89.0]), 2.5, walls, covariance=measured)
    assert found.walls == (0, 1)
    paths = predict_channel(
        found.position, found.covariance, walls, frequency=FREQUENCY, over=(0, 1)
    )
    path = over(paths, 0, 1)
    # Central differences of step 1e-6: what they lose to rounding, over walls 1e4 as uncertain.
    np.testing.assert_allclose(path.covariance, measured, rtol=1e-3, atol=1e-13)
    careless = over(
        predict_channel(found.position, found.covariance, walls, frequency=FREQUENCY), 0, 1
    )
    assert np.all(np.diag(careless.covariance) > 10 * np.diag(measured))


@pytest.mark.parametrize("rests", [False, True])
def test_the_covariance_is_that_of_drawn_positions_and_walls(rests: bool) -> None:
    trials = 20_000
    rng = np.random.default_rng(1)
    middles, angles = np.array([0.8j, 0.9 + 0.8j]), np.radians([45.0, -50.0])
    tilts, offsets = np.array([1e-3, 2e-3]), np.array([5e-4, 3e-4])
    walls = [
        wall(
            middle.real, middle.imag, np.degrees(angle), 0.8, tilt=float(tilt), offset=float(offset)
        )
        for middle, angle, tilt, offset in zip(middles, angles, tilts, offsets, strict=True)
    ]
    # In the complex plane a mirror is z → a + exp(2jφ)·conj(z − a): no code is shared.
    drawn_angles = angles[:, None] + tilts[:, None] * rng.standard_normal((2, trials))
    feet = middles[:, None] - 1j * np.exp(1j * drawn_angles) * (
        offsets[:, None] * rng.standard_normal((2, trials))
    )

    def reflected(points: np.ndarray, index: int) -> np.ndarray:
        turned = np.exp(2j * drawn_angles[index]) * np.conj(points - feet[index])
        return np.asarray(feet[index] + turned)

    measured = np.diag([1e-4, 3e-4]) ** 2
    found = project(LINEAR, np.radians([100.0]), 1.73, walls[:1], covariance=measured)
    if rests:
        seen = rng.multivariate_normal([np.radians(100.0), 1.73], measured, size=trials)
        users = reflected(seen[:, 1] * np.exp(1j * seen[:, 0]), 0)
    else:
        users = rng.multivariate_normal(found.position[:2], found.covariance[:2, :2], size=trials)
        users = users @ [1, 1j]
    paths = predict_channel(
        found.position, found.covariance, walls, frequency=FREQUENCY, over=(0,) if rests else ()
    )
    assert {path.walls for path in paths} >= {(), (0,), (0, 1)}
    for path in paths:
        images = users
        for index in reversed(path.walls):
            images = reflected(images, index)
        values = np.cov(np.angle(images), np.abs(images))
        assert path.path_length == pytest.approx(np.abs(images).mean(), abs=1e-4)
        # Variances of N normal draws scatter by √(2/N): four deviations; what is beyond first
        # order is 1e-3 of it.
        tolerance = 4 * np.sqrt(2 / trials) + 1e-3
        np.testing.assert_allclose(np.diag(path.covariance), np.diag(values), rtol=tolerance)
        size = np.sqrt(values[0, 0] * values[1, 1])
        assert path.covariance[0, 1] == pytest.approx(values[0, 1], abs=tolerance * size)
        assert path.delay_deviation == pytest.approx(
            np.sqrt(path.covariance[1, 1]) / speed_of_light
        )


def test_a_position_cannot_be_better_than_the_walls_it_was_found_over() -> None:
    walls = [wall(0.0, 0.8, 45.0, 0.4, tilt=1e-3, offset=1e-3)]
    with pytest.raises(ValueError, match="leave `over` out"):
        predict_channel(at(1.0, 0.8), 1e-12 * np.eye(3), walls, frequency=FREQUENCY, over=(0,))


def test_walls_that_err_together_say_so() -> None:
    walls = [wall(0.0, 0.8, 45.0, 0.8), wall(0.9, 0.8, -45.0, 0.8)]
    user = at(0.9, -0.3)
    ones = np.zeros((4, 4))
    ones[np.ix_([1, 3], [1, 3])] = 1e-6  # both offsets err by the same 1 mm
    alike = over(
        predict_channel(user, EXACT, walls, frequency=FREQUENCY, wall_covariance=ones), 0, 1
    )
    apart = over(
        predict_channel(
            user, EXACT, walls, frequency=FREQUENCY, wall_covariance=np.diag(np.diag(ones))
        ),
        0,
        1,
    )
    # At 45° each offset d moves the path's length by √2 d or -√2 d: they add, or cancel.
    assert apart.covariance[1, 1] == pytest.approx(2 * 2 * 1e-6, rel=1e-2)
    together = alike.covariance[1, 1] / apart.covariance[1, 1]
    assert together == pytest.approx(0.0, abs=1e-3) or together == pytest.approx(2.0, rel=1e-3)


# Targets


def test_a_target_scatters_as_the_bistatic_radar_equation_says() -> None:
    section, place, user = 1e-3, at(0.2, 0.5), at(-0.6, 0.9)
    positions = np.zeros((2, 3))
    positions[:, 0] = [-1e-5, 1e-5]
    echo = point_echo(
        place[None],
        positions=positions,
        frequencies=np.array([FREQUENCY, FREQUENCY + 1.0]),
        radar_cross_section=np.array([section]),
    )
    target = Target(
        position=place,
        ghost=place,
        covariance=1e-6 * np.eye(3),
        level_db=float(20 * np.log10(np.abs(echo.samples).mean())),
    )
    paths = predict_channel(user, 1e-6 * np.eye(3), [], frequency=FREQUENCY, targets=[target])
    (path,) = [path for path in paths if path.target == 0]
    legs = np.linalg.norm(place), np.linalg.norm(user - place)
    expected = WAVELENGTH * np.sqrt(section) / ((4 * np.pi) ** 1.5 * legs[0] * legs[1])
    assert path.gain == pytest.approx(expected, rel=1e-6)
    assert path.path_length == pytest.approx(sum(legs), rel=ROUNDING)
    assert path.aoa == pytest.approx(np.arctan2(0.5, 0.2), rel=ROUNDING)
    assert path.radius == pytest.approx(legs[0])  # the wave comes from the target
    # Angle: 1 mm over the first leg. Length: 1 mm of the user's, and the target's along the
    # bisector of both legs.
    turn = place / legs[0] - (user - place) / legs[1]
    assert path.covariance[0, 0] == pytest.approx(1e-6 / legs[0] ** 2)
    assert path.covariance[1, 1] == pytest.approx(1e-6 * (1 + turn @ turn))


def test_a_wide_target_hides_but_not_itself() -> None:
    target = Target(
        position=at(0.5, 0.4),
        ghost=at(0.5, 0.4),
        level_db=-50.0,
        ends=np.stack([at(0.4, 0.5), at(0.6, 0.3)]),
    )
    paths = predict_channel(at(1.0, 0.8), EXACT, [DIAGONAL], frequency=FREQUENCY, targets=[target])
    assert sorted((path.walls, path.target) for path in paths if path.target is None) == [
        ((0,), None)
    ]
    assert [path.target for path in paths if path.target is not None] == [0]


# Levels


def test_free_space_has_no_excess() -> None:
    source = at(0.4, 1.5)
    pilot = point_uplink(
        source[None], positions=at(0.0, 0.0)[None], frequencies=np.array([FREQUENCY])
    )
    length = float(np.linalg.norm(source))
    assert excess_db(complex(pilot.samples[0, 0]), length, FREQUENCY) == pytest.approx(0, abs=1e-9)
    with pytest.raises(ValueError, match="above 0"):
        excess_db(0j, length, FREQUENCY)


def test_a_located_user_tells_how_its_wall_reflects() -> None:
    measured = MeasuredGain(walls=(0,), excess_db=-9.4, deviation_db=0.01)
    known = wall_reflections(2, [measured])
    # The assumption pulls by (0.01/3.5)² of 3.4 dB.
    assert known.level_db[0] == pytest.approx(-9.4, abs=1e-4)
    assert known.over([0])[1] == pytest.approx(0.01, rel=1e-4)
    assert known.over([1]) == pytest.approx((ASSUMED_DB, ASSUMED_DEVIATION_DB))
    assert known.over([]) == (0.0, 0.0)
    path = over(
        predict_channel(
            at(1.0, 0.8),
            EXACT,
            [DIAGONAL],
            frequency=FREQUENCY,
            reflections=wall_reflections(1, [measured]),
        ),
        0,
    )
    assert 20 * np.log10(path.gain * 4 * np.pi * 1.8 / WAVELENGTH) == pytest.approx(-9.4, abs=1e-3)


def test_a_path_over_two_walls_tells_their_sum_only() -> None:
    known = wall_reflections(2, [MeasuredGain(walls=(0, 1), excess_db=-20.0, deviation_db=0.01)])
    total, deviation = known.over([0, 1])
    assert total == pytest.approx(-20.0, abs=1e-3)
    assert deviation == pytest.approx(0.01, rel=1e-3)
    # Each is half of it, and the difference is as unknown as before.
    np.testing.assert_allclose(known.level_db, -10.0, atol=1e-3)
    difference = np.array([1.0, -1.0])
    assert difference @ known.covariance @ difference == pytest.approx(2 * ASSUMED_DEVIATION_DB**2)


def test_no_wall_gives_more_than_it_gets() -> None:
    loud = MeasuredGain(walls=(0,), excess_db=23.0, deviation_db=0.1)  # a horn
    assert wall_reflections(1, [loud]).level_db[0] == 0.0


def test_a_gain_over_a_wall_that_there_is_not_is_refused() -> None:
    with pytest.raises(ValueError, match="there are 1 walls"):
        wall_reflections(1, [MeasuredGain(walls=(1,), excess_db=-3.0)])


# A whole answer


def test_a_located_user_has_its_channel_in_any_frame() -> None:
    uncertain = wall(0.0, 0.8, 45.0, 0.4, tilt=3e-4, offset=1e-4)
    measured = np.diag([1e-5, 2e-5]) ** 2
    found = project(LINEAR, np.radians([90.0]), 1.8, [uncertain], covariance=measured)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    positions = np.zeros((5, 3))
    positions[:, 0] = np.linspace(-0.06, 0.06, 5)
    shift = np.array([2.0, -1.0, 1.5])
    frame = array_frame(positions @ turn.T + shift, turn @ [0.0, 1.0, 0.0])
    user = UserEstimate(
        name="ann",
        status="found",
        position=frame.to_world(found.position),
        covariance=frame.axes.T @ found.covariance @ frame.axes,
        bounces=1,
        path=frame.to_world(found.path),
    )
    mirror = Mirror(
        start=frame.to_world(uncertain.start),
        end=frame.to_world(uncertain.end),
        normal=frame.turned_to_world(np.array([1.0, -1.0, 0.0]) / np.sqrt(2)),
        covariance=uncertain.covariance,
        confidence=1.0,
        level_db=30.0,
    )
    post = at(0.5, 0.3)
    target = Target(position=frame.to_world(post), ghost=frame.to_world(post), level_db=-60.0)
    estimate = Estimate(users=(user,), mirrors=(mirror,), targets=(target,))
    paths = predict_user_channel(estimate, user, frame, frequency=FREQUENCY)
    reflected = over(paths, 0)
    assert reflected.path_length == pytest.approx(1.8, abs=1e-9)
    assert reflected.aoa == pytest.approx(np.pi / 2, abs=1e-9)
    np.testing.assert_allclose(reflected.covariance, measured, rtol=1e-3, atol=1e-15)
    assert [path.target for path in paths if path.target is not None] == [0]
    # The same place, surer than the wall: joined with a path that does not rest on it.
    surer = UserEstimate(
        name="ann",
        status="found",
        position=user.position,
        covariance=1e-12 * np.eye(3),
        path=user.path,
    )
    independent = over(predict_user_channel(estimate, surer, frame, frequency=FREQUENCY), 0)
    assert independent.covariance[1, 1] > reflected.covariance[1, 1]


def test_a_user_without_a_position_has_no_predicted_channel() -> None:
    nobody = UserEstimate(name="bob", status="not_found", reason="no wave")
    frame = array_frame(np.array([[0.0, 0, 0], [1.0, 0, 0]]), np.array([0.0, 1.0, 0.0]))
    with pytest.raises(ValueError, match="'bob' is not_found"):
        predict_user_channel(Estimate(users=(nobody,), mirrors=()), nobody, frame, frequency=1e9)


@pytest.mark.parametrize("max_bounces", [0, 1, 2, 3, 8])
def test_between_parallel_walls_paths_have_as_many_bounces_as_asked_for(max_bounces: int) -> None:
    # Array and user stand between two long walls: a path of each length over either wall first.
    walls = [wall(-0.5, 20.01, 90.0, 40.0), wall(0.5, 20.01, 90.0, 40.0)]  # before the array
    paths = predict_channel(
        at(0.1, 1.5), EXACT, walls, frequency=FREQUENCY, max_bounces=max_bounces
    )
    counts = sorted(len(path.walls) for path in paths)
    assert counts == [0] + [n for n in range(1, max_bounces + 1) for _ in range(2)]
    for path in paths:
        # The n-th image stands n metres farther aside, in the closed form of two parallel mirrors.
        turns = len(path.walls)
        first = -1 if turns and path.walls[0] == 0 else 1
        aside = first * turns + 0.1 * (-1) ** turns
        assert path.path_length == pytest.approx(np.hypot(aside, 1.5), rel=1e-12)


@pytest.mark.parametrize("max_bounces", [-1, 9])
def test_bounces_that_are_not_followed_are_refused(max_bounces: int) -> None:
    with pytest.raises(ValueError, match=f"max_bounces = {max_bounces}: chains of 0 to 8 mirrors"):
        predict_channel(at(0.1, 1.5), EXACT, [], frequency=FREQUENCY, max_bounces=max_bounces)
