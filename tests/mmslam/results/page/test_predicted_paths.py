"""The page's JavaScript against the estimator's Python, on the same rooms."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.array.array_frame import ArrayFrame
from estimator.geometry.path_tracing import trace
from estimator.geometry.wall_2d import Wall
from estimator.geometry.wall_3d import PlaneWall
from estimator.measurement.model import Measurement
from estimator.measurement.path_list import PathList
from estimator.prediction.channel_2d import predict_channel, predict_user_channel
from estimator.results.estimate import Estimate, Mirror, Target, UserEstimate
from mmslam.results.page.plan import prediction_document

ROUNDING = 1e-9
"""Both work in double precision; a chain of three mirrors loses some digits of 16. [m], [rad]"""

FREQUENCY = 257.5e9

Predicted = Callable[[list[Any]], list[Any]]


def turned_frame(rng: np.random.Generator) -> ArrayFrame:
    """Return an array somewhere in the world, looking anywhere along its floor."""
    turn = rng.uniform(-np.pi, np.pi)
    ahead = np.array([np.cos(turn), np.sin(turn), 0.0])
    axis = np.array([np.sin(turn), -np.cos(turn), 0.0])
    origin = np.array([*rng.uniform(-3, 3, 2), 0.0])
    return ArrayFrame(origin=origin, axes=np.stack([axis, ahead, np.cross(axis, ahead)]))


def random_walls(rng: np.random.Generator, count: int) -> list[Wall]:
    walls = []
    for _ in range(count):
        middle = np.array([rng.uniform(-2, 2), rng.uniform(0.3, 3), 0.0])
        turn, half = rng.uniform(0, np.pi), rng.uniform(0.2, 1.5)
        way = half * np.array([np.cos(turn), np.sin(turn), 0.0])
        walls.append(Wall(start=middle - way, end=middle + way, covariance=np.zeros((2, 2))))
    return walls


def map_of(
    frame: ArrayFrame, outlines: list[np.ndarray], dimensions: int, most: int
) -> dict[str, Any]:
    return {
        "dimensions": dimensions,
        "frame": {"origin": frame.origin.tolist(), "axes": frame.axes.tolist()},
        "frequency_hz": FREQUENCY,
        "mirrors": [frame.to_world(outline).tolist() for outline in outlines],
        "screens": [],
        "level_db": [-6.0] * len(outlines),
        "deviation_db": [3.5] * len(outlines),
        "max_bounces": most,
    }


def test_the_browser_predicts_the_paths_of_random_plane_rooms_as_the_estimator_does(
    predicted: Predicted,
) -> None:
    rng = np.random.default_rng(5)
    rooms = [random_walls(rng, int(rng.integers(0, 6))) for _ in range(200)]
    frames = [turned_frame(rng) for _ in rooms]
    users = [np.array([rng.uniform(-2, 2), rng.uniform(-0.5, 3), 0.0]) for _ in rooms]
    cases = []
    for walls, frame, user in zip(rooms, frames, users, strict=True):
        outlines = [np.stack([wall.start, wall.end]) for wall in walls]
        cases.append([frame.to_world(user).tolist(), map_of(frame, outlines, 2, 3)])
    told = predicted(cases)
    count = 0
    for walls, frame, user, answer in zip(rooms, frames, users, told, strict=True):
        known = predict_channel(user, np.zeros((3, 3)), walls, frequency=FREQUENCY)
        by_chain = {path.walls: path for path in known}
        chains = {tuple(path["mirrors"]) for path in answer}
        assert chains == set(by_chain)
        for path in answer:
            heading = np.array([np.cos(path["aoa"]), np.sin(path["aoa"]), 0.0])
            launched, met, _ = trace(heading, path["path_length"], walls, max_bounces=8)
            assert list(met) == path["mirrors"]
            np.testing.assert_allclose(launched[-1], user, atol=10 * ROUNDING)
            other = by_chain[tuple(path["mirrors"])]
            assert path["aoa"] == pytest.approx(other.aoa, abs=ROUNDING)
            assert path["delay"] == pytest.approx(other.delay, abs=ROUNDING / speed_of_light)
            assert path["level_db"] == pytest.approx(other.level_db, abs=1e-7)
            assert path["deviation_db"] == pytest.approx(other.gain_deviation_db, abs=1e-7)
            vertices = frame.to_local(np.array(path["vertices"]))
            np.testing.assert_allclose(vertices, other.vertices, atol=10 * ROUNDING)
            if path["mirrors"]:
                assert path["margin"] == pytest.approx(other.margin, abs=10 * ROUNDING)
        levels = [path["level_db"] for path in answer]
        assert levels == sorted(levels, reverse=True)
        count += len(known)
    assert count > 150  # rooms in which nothing is seen would prove nothing


def test_the_map_of_a_result_is_predicted_as_its_own_users_channel(
    predicted: Predicted, measurement: Measurement, estimate: Estimate
) -> None:
    (user,) = estimate.users
    wide = Target(
        position=np.array([0.75, 0.55, 0.0]),
        ghost=np.array([0.75, 0.55, 0.0]),
        ends=np.array([[0.6, 0.6, 0.0], [0.9, 0.5, 0.0]]),  # in the direct way
    )
    screened = replace(estimate, targets=(wide,))
    frame = ArrayFrame(origin=np.zeros(3), axes=np.eye(3))
    for one in (estimate, screened):
        known = predict_user_channel(one, user, frame, frequency=FREQUENCY)
        document = prediction_document(measurement, one, dimensions=2)
        assert document is not None
        assert user.position is not None
        (answer,) = predicted([[user.position.tolist(), document]])
        assert {tuple(path["mirrors"]) for path in answer} == {
            path.walls for path in known if path.target is None
        }
    assert [path["mirrors"] for path in answer] == [[0]]


def test_the_direct_path_is_left_when_no_mirror_was_found(
    predicted: Predicted, measurement: Measurement, nothing_found: Estimate
) -> None:
    document = prediction_document(measurement, nothing_found, dimensions=2)
    (answer,) = predicted([[[3.0, 4.0, 0.0], document]])
    (path,) = answer
    assert path["path_length"] == pytest.approx(5.0, abs=ROUNDING)
    assert np.tan(path["aoa"]) == pytest.approx(4 / 3)


def shoebox(size: np.ndarray, low: np.ndarray) -> list[np.ndarray]:
    """Return the outlines of the six walls of a room."""
    outlines = []
    for axis, end in product(range(3), (0, 1)):
        first, second = (other for other in range(3) if other != axis)
        corners = np.zeros((4, 3))
        corners[:, axis] = low[axis] + end * size[axis]
        corners[:, first] = low[first] + size[first] * np.array([0, 1, 1, 0])
        corners[:, second] = low[second] + size[second] * np.array([0, 0, 1, 1])
        outlines.append(corners)
    return outlines


def test_a_room_of_six_walls_has_the_images_of_its_lattice(predicted: Predicted) -> None:
    size, low = np.array([4.0, 3.0, 2.5]), np.array([-1.7, -0.4, -1.1])
    user = np.array([1.31, 1.87, 0.43])
    frame = ArrayFrame(origin=np.array([0.3, -2.0, 1.0]), axes=np.eye(3))
    (answer,) = predicted(
        [[frame.to_world(user).tolist(), map_of(frame, shoebox(size, low), 3, 2)]]
    )
    # Images of order n along an axis: the user moved by two rooms, or mirrored once.
    lengths = []
    for orders in product(range(-2, 3), repeat=3):
        if sum(map(abs, orders)) > 2:
            continue
        image = np.array(
            [
                low[axis]
                + n * size[axis]
                + (user[axis] - low[axis]) * (1 if n % 2 == 0 else -1)
                + (size[axis] if n % 2 else 0.0)
                for axis, n in enumerate(orders)
            ]
        )
        if image[1] > 0:  # before the array
            lengths.append(float(np.linalg.norm(image)))
    found = [path["path_length"] for path in answer]
    np.testing.assert_allclose(sorted(found), sorted(lengths), atol=ROUNDING)


def test_in_space_each_path_is_the_ray_that_is_launched_along_it(predicted: Predicted) -> None:
    rng = np.random.default_rng(8)
    frame = ArrayFrame(origin=np.zeros(3), axes=np.eye(3))
    count = 0
    for _ in range(30):
        walls = []
        for _ in range(3):
            normal = rng.normal(size=3)
            normal /= np.linalg.norm(normal)
            first = np.cross(normal, [0.3, 0.5, 0.81])
            first /= np.linalg.norm(first)
            second = np.cross(normal, first)
            centre = np.array([*rng.uniform(-1, 1, 1), rng.uniform(0.5, 3), rng.uniform(-1, 1)])
            half = rng.uniform(0.5, 2, 2)
            signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
            walls.append(
                PlaneWall(
                    corners=centre + signs @ np.stack([first, second]),
                    centre=centre,
                    axes=np.stack([first, second]),
                    covariance=np.zeros((3, 3)),
                )
            )
        user = np.array([rng.uniform(-1, 1), rng.uniform(0.5, 3), rng.uniform(-1, 1)])
        document = map_of(frame, [wall.corners for wall in walls], 3, 3)
        (answer,) = predicted([[user.tolist(), document]])
        for path in answer:
            up, along = np.sin(path["elevation"]), np.cos(path["aoa"])
            heading = np.array([along, np.sqrt(1 - along**2 - up**2), up])
            vertices, met, _ = trace(heading, path["path_length"], walls, max_bounces=8)
            assert list(met) == path["mirrors"]
            # The square root above loses half the digits near the array's plane.
            np.testing.assert_allclose(vertices[-1], user, atol=1e-5)
            count += 1
    assert count > 30


def test_a_result_without_a_frame_offers_no_prediction(
    measurement: Measurement, estimate: Estimate
) -> None:
    circle = np.linspace(0, 2 * np.pi, 13)
    places = np.stack([np.cos(circle), np.sin(circle), np.zeros(13)], axis=-1)
    assert measurement.echo is not None
    around = replace(measurement, echo=replace(measurement.echo, positions=places), uplinks=())
    assert prediction_document(around, estimate, dimensions=2) is None


@pytest.mark.parametrize("dimensions", [2, 3])
def test_lists_of_paths_have_no_frequency_to_predict_at(
    measurement: Measurement, estimate: Estimate, dimensions: int
) -> None:
    heard = PathList(
        user="ann",
        azimuth=np.array([1.2]),
        delay=np.array([5e-9]),
        angle_deviation=0.01,
        delay_deviation=1e-11,
    )
    lists = replace(measurement, echo=None, uplinks=(), path_lists=(heard,))
    assert prediction_document(lists, estimate, dimensions=dimensions) is None


def test_as_many_bounces_are_followed_as_the_answer_has(
    measurement: Measurement, estimate: Estimate
) -> None:
    (user,) = estimate.users
    for bounces, followed in ((1, 1), (2, 2), (7, 3)):
        one = replace(estimate, users=(replace(user, bounces=bounces),))
        document = prediction_document(measurement, one, dimensions=2)
        assert document is not None
        assert document["max_bounces"] == followed


def test_hundreds_of_mirrors_are_followed_over_fewer_bounces(
    measurement: Measurement, estimate: Estimate
) -> None:
    (user,) = estimate.users
    (mirror,) = estimate.mirrors
    many: tuple[Mirror, ...] = (mirror,) * 200
    far: UserEstimate = replace(user, bounces=3)
    document = prediction_document(
        measurement, replace(estimate, mirrors=many, users=(far,)), dimensions=2
    )
    assert document is not None
    assert document["max_bounces"] == 1
