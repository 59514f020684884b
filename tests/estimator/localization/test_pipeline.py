"""The whole estimator, on echoes and pilots in closed form, and once on the simulator's."""

# Over 400 lines: its rooms, in closed form, serve all cases.

from dataclasses import dataclass, replace
from hashlib import sha256
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jaxtyping import Float
from scipy.constants import speed_of_light
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from estimator.geometry.wall_2d import mirrored
from estimator.localization import pipeline
from estimator.localization.pipeline import locate
from estimator.localization.stages import MappedRoom
from estimator.localization.stages_2d import LinearStages
from estimator.mapping import map_images_2d
from estimator.measurement.model import Echo, Measurement, MeasurementError, Uplink
from estimator.results.estimate import Estimate, UserEstimate
from scenes.scenario import parse_scenario
from simulator.simulation import simulate

WALL = np.array([[-0.0707, 0.2293, 0.0], [0.0707, 0.3707, 0.0]])  # 45° through (0, 0.3), 20 cm
USER = np.array([0.3, 0.32, 0.0])
IMAGE = np.array([0.02, 0.6, 0.0])  # of the user in the line y = x + 0.3


@dataclass(frozen=True)
class Room:
    """One wall's echo, and the means to add pilots."""

    world: Any
    echo: Echo

    def pilot(
        self, *sources: Float[np.ndarray, " 3"], extra: float = 0.0, snr: float = 20.0
    ) -> Uplink:
        """A pilot that comes from some places at once, each 0.8 as strong as the one before."""
        samples = sum(
            0.8**index * self.world.pilot(source, extra=extra)
            for index, source in enumerate(sources)
        )
        return Uplink(
            samples=self.world.noisy(samples, snr, np.random.default_rng(5)),
            positions=self.echo.positions,
            frequencies=self.echo.frequencies,
            user="ann",
        )

    def measured(self, *pilots: Uplink, **changes: Any) -> Measurement:
        return Measurement(**{"echo": self.echo, "uplinks": pilots, "clock_offset": 0.0, **changes})


@pytest.fixture(scope="module")
def room(world: Any) -> Room:
    rng = np.random.default_rng(0)
    return Room(world, world.echo(world.rough_line((0.0, 0.3), 45.0, 0.2, rng), rng))


@pytest.fixture(scope="module")
def hidden(room: Room) -> tuple[Measurement, Estimate]:
    """The user over the wall, located once for several tests."""
    measurement = room.measured(room.pilot(IMAGE))
    return measurement, locate(measurement)


MAPS: dict[bytes, MappedRoom] = {}


@pytest.fixture(autouse=True)
def _each_echo_is_mapped_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Most tests differ by the pilot alone: the map of one and the same echo serves them all."""
    mapped = LinearStages.map_room

    def once(stages: LinearStages, echo: Echo) -> MappedRoom:
        seen = sha256()
        for numbers in (echo.samples, echo.positions, echo.frequencies, echo.transmit_positions):
            seen.update(b"" if numbers is None else numbers.tobytes())
        if seen.digest() not in MAPS:
            MAPS[seen.digest()] = mapped(stages, echo)
        return MAPS[seen.digest()]

    monkeypatch.setattr(LinearStages, "map_room", once)


def only(estimate: Estimate) -> UserEstimate:
    (user,) = estimate.users
    return user


def error_of(user: UserEstimate, truth: Float[np.ndarray, " 3"] = USER) -> float:
    assert user.position is not None
    return float(np.linalg.norm(user.position - truth))


# Answers


def test_a_hidden_user_is_found_over_the_wall(hidden: tuple[Measurement, Estimate]) -> None:
    estimate = hidden[1]
    user = only(estimate)
    assert (user.status, user.bounces, user.name) == ("found", 1, "ann")
    # A wall known to 0.02° and 0.03 mm, 0.3 m before the user: 0.1 mm twice; 5 deviations.
    assert error_of(user) <= 1e-3
    assert user.covariance is not None
    away = (user.position - USER)[:2]
    assert away @ np.linalg.solve(user.covariance[:2, :2], away) <= 25
    assert user.path_length == pytest.approx(np.linalg.norm(IMAGE), abs=1e-4)
    assert user.aoa == pytest.approx(np.arctan2(0.6, 0.02), abs=1e-4)
    assert user.path is not None
    assert np.linalg.norm(np.diff(user.path, axis=0), axis=-1).sum() == pytest.approx(
        user.path_length, abs=1e-9
    )
    (mirror,) = estimate.mirrors
    ends = np.stack([mirror.start, mirror.end])
    found = ends[np.argsort(ends[:, 0])]
    np.testing.assert_allclose(found, WALL, atol=6e-3)  # two cells
    assert mirror.normal @ [0, 1, 0] < 0  # towards the array
    assert mirror.seen_through == ()
    assert mirror.level_db > 20
    *others, medium = estimate.notes
    assert medium.startswith("the medium is not told")  # data that bear no seed may be measured
    assert all("grating lobes" in note for note in others)


def test_a_user_in_sight_is_found_directly_and_over_the_wall(room: Room) -> None:
    # Alone, the straight way at 47° is looked at beyond the 30.5° without grating lobes: nothing
    # stands there, and the level is that of free space.
    doubts = []
    for sources in ((USER,), (USER, IMAGE)):
        user = only(locate(room.measured(room.pilot(*sources))))
        assert (user.status, user.bounces) == ("found", 0)
        assert user.probability is not None
        doubts.append(1 - user.probability)
        assert error_of(user) <= 1e-4  # no wall on the way: 0.01 mm and 0.01 mrad
    assert doubts[1] < doubts[0] / 10  # two paths that agree leave less


def test_several_users_each_have_an_answer(room: Room) -> None:
    pilots = room.pilot(IMAGE), replace(room.pilot(np.array([-0.07, 0.15, 0.0])), user="bob")
    estimate = locate(room.measured(*pilots))
    assert [user.name for user in estimate.users] == ["ann", "bob"]
    assert [chart.user for chart in estimate.maps] == ["ann", "bob"]
    assert error_of(estimate.users[0]) <= 1e-3
    assert error_of(estimate.users[1], np.array([-0.07, 0.15, 0.0])) <= 1e-4


def test_a_wall_seen_through_another_is_unfolded_and_reflects_too(world: Any) -> None:
    # The second wall, 20 cm at 100° through (0.25, 0.3), shows in the first as a ghost behind it.
    frequencies = np.linspace(220e9, 295e9, 401)  # 0.8 m of unambiguous range
    rng = np.random.default_rng(1)
    first = world.rough_line((0.0, 0.3), 45.0, 0.2, rng)
    second = world.rough_line((0.25, 0.3), 100.0, 0.2, rng)
    ghost = mirrored(second, WALL[0], WALL[1])
    parts = [
        world.echo(points, rng, frequencies=frequencies, snr_db=200.0) for points in (first, ghost)
    ]
    samples = world.noisy(parts[0].samples + 3 * parts[1].samples, 20.0, rng)
    echo = replace(parts[0], samples=samples)
    # Up, to the right along y = 0.3, and back at 200°: 0.3 + 0.25 + 0.15 m.
    user = np.array([0.25, 0.3, 0.0]) - 0.15 * np.array(
        [np.cos(np.radians(20)), np.sin(np.radians(20)), 0.0]
    )
    image = np.array([0.0, 0.7, 0.0])
    pilot = Uplink(
        samples=world.noisy(world.pilot(image, frequencies=frequencies), 20.0, rng),
        positions=echo.positions,
        frequencies=frequencies,
        user="ann",
    )
    estimate = locate(Measurement(echo=echo, uplinks=(pilot,), clock_offset=0.0))
    assert [mirror.seen_through for mirror in estimate.mirrors] == [(), (0,)]
    unfolded = estimate.mirrors[1]
    along = np.array([np.cos(np.radians(100)), np.sin(np.radians(100)), 0.0])
    normal = np.array([along[1], -along[0], 0.0])
    middle = 0.5 * (unfolded.start + unfolded.end)
    assert abs((middle - [0.25, 0.3, 0.0]) @ normal) <= 2e-4
    assert abs((middle - [0.25, 0.3, 0.0]) @ along) <= 7e-3  # a cell across the ray
    assert abs(unfolded.normal @ along) <= 3e-3  # its angle, and twice that of the first
    answer = only(estimate)
    assert (answer.status, answer.bounces) == ("found", 2)
    assert error_of(answer, user) <= 1.5e-3


def test_the_images_show_the_wall_and_nothing_behind_it(
    hidden: tuple[Measurement, Estimate],
) -> None:
    raw, corrected = hidden[1].raw_image, hidden[1].corrected_image
    assert raw is not None
    assert corrected is not None
    np.testing.assert_array_equal(raw.grid.x, corrected.grid.x)
    points = raw.grid.points
    beside = (points[..., 1] - points[..., 0] - 0.3) / np.sqrt(2)
    along = (points[..., 0] + points[..., 1] - 0.3) / np.sqrt(2)
    energy = np.abs(raw.values) ** 2
    on_wall = (np.abs(beside) < 5e-3) & (np.abs(along) < 0.1)
    assert energy[on_wall].sum() > 0.5 * energy.sum()
    # Behind the wall as the array sees it: on the ray to a point of it, but farther.
    share = 0.3 / np.where(beside > 1e-2, points[..., 1] - points[..., 0], np.inf)
    shadow = (share > 0) & (np.abs(share * points[..., 0]) < 0.06)
    assert shadow.any()
    assert not corrected.values[shadow].any()
    assert raw.values[shadow].any()


def test_images_are_formed_once_and_only_when_somebody_looks(
    hidden: tuple[Measurement, Estimate], monkeypatch: pytest.MonkeyPatch
) -> None:
    formed: list[str] = []
    for name in ("images_on", "close_up"):
        module = {"images_on": map_images_2d, "close_up": pipeline}[name]
        make = getattr(module, name)

        def noted(*parts: Any, name: str = name, make: Any = make, **more: Any) -> Any:
            formed.append(name)
            return make(*parts, **more)

        monkeypatch.setattr(module, name, noted)
    blind = locate(hidden[0], images=False)
    assert (blind.raw_image, blind.corrected_image, blind.close_ups) == (None, None, ())
    seen = locate(hidden[0])
    assert formed == []
    assert seen.timings.keys() == blind.timings.keys()
    for _ in range(2):
        assert seen.raw_image is not None
        assert seen.corrected_image is not None
        assert len(seen.close_ups) == 1
    assert formed == ["images_on", "close_up"]
    assert {"images", "close-ups"} < seen.timings.keys()
    for one, other in ((seen, hidden[1]), (blind, hidden[1])):
        np.testing.assert_array_equal(only(one).position, only(other).position)


def test_the_progress_ends_where_it_says(room: Room) -> None:
    told: list[tuple[str, int, int]] = []
    locate(room.measured(room.pilot(USER)), progress=lambda *step: told.append(step))
    assert [step[1] for step in told] == sorted(step[1] for step in told)
    assert told[0][1] == 0
    assert told[-1][1] == told[-1][2]


# Another frame


def moved(
    measurement: Measurement, turn: Float[np.ndarray, "3 3"], shift: Float[np.ndarray, " 3"]
) -> Measurement:
    """The same measurement by an array that stands and looks elsewhere, with its scene."""

    def placed(positions: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        return np.asarray(positions @ turn.T + shift)

    echo = measurement.echo
    if echo is not None:
        apart = echo.transmit_positions
        echo = replace(
            echo,
            positions=placed(echo.positions),
            transmit_positions=None if apart is None else placed(apart),
        )
    return replace(
        measurement,
        echo=echo,
        uplinks=tuple(replace(one, positions=placed(one.positions)) for one in measurement.uplinks),
        boresight=turn @ measurement.boresight,
    )


@settings(deadline=None, max_examples=2)
@given(angle=st.floats(-np.pi, np.pi), x=st.floats(-5, 5), y=st.floats(-5, 5))
def test_moving_the_whole_scene_moves_the_answer(
    hidden: tuple[Measurement, Estimate], angle: float, x: float, y: float
) -> None:
    turn, shift = Rotation.from_euler("z", angle).as_matrix(), np.array([x, y, 0.0])
    measurement, still = hidden
    gone = locate(moved(measurement, turn, shift))
    one, other = only(still), only(gone)
    assert (one.status, one.bounces) == (other.status, other.bounces)
    assert one.position is not None
    assert other.position is not None
    assert one.covariance is not None
    assert other.covariance is not None
    assert one.path is not None
    assert other.path is not None
    # The rotation rounds positions by 1e-15 m; searches stop at the same points of their grids.
    np.testing.assert_allclose(other.position, turn @ one.position + shift, atol=1e-6)
    np.testing.assert_allclose(other.path, one.path @ turn.T + shift, atol=1e-6)
    np.testing.assert_allclose(
        other.covariance, turn @ one.covariance @ turn.T, atol=1e-2 * one.covariance.max()
    )
    for before, after in zip(still.mirrors, gone.mirrors, strict=True):
        np.testing.assert_allclose(after.start, turn @ before.start + shift, atol=1e-6)
        np.testing.assert_allclose(after.end, turn @ before.end + shift, atol=1e-6)
        np.testing.assert_allclose(after.normal, turn @ before.normal, atol=1e-5)


def test_an_array_on_a_tripod_images_the_plane_at_its_own_height(
    hidden: tuple[Measurement, Estimate],
) -> None:
    measurement, still = hidden
    high = locate(moved(measurement, np.eye(3), np.array([0.0, 0.0, 1.2])))
    assert only(high).status == "found"
    assert error_of(only(high), USER + np.array([0, 0, 1.2])) == pytest.approx(
        error_of(only(still)), abs=1e-6
    )
    assert high.raw_image is not None
    assert still.raw_image is not None
    peak = np.abs(still.raw_image.values).max()
    # 32-bit phases against another origin: the promise of back-projection.
    assert np.abs(high.raw_image.values).max() == pytest.approx(peak, rel=1e-2)
    assert high.raw_image.grid.z[0] == pytest.approx(1.2)


def test_transmitters_that_stand_apart_move_with_the_array(world: Any) -> None:
    positions = world.array()
    transmitters = positions + np.array([0.03, 0.0, 0.0])
    rng = np.random.default_rng(0)
    points = world.rough_line((0.0, 0.3), 45.0, 0.2, rng, count=400)
    strengths = rng.standard_normal(400) + 1j * rng.standard_normal(400)
    samples = []
    for ends in zip(positions, transmitters, strict=True):
        legs = [np.linalg.norm(points - end, axis=-1) for end in ends]
        phase = np.outer(legs[0] + legs[1], 2 * np.pi * world.band / speed_of_light)
        samples.append(strengths / (legs[0] * legs[1]) @ np.exp(-1j * phase))
    echo = Echo(
        samples=world.noisy(np.array(samples), 20.0, rng),
        positions=positions,
        frequencies=world.band,
        transmit_positions=transmitters,
    )
    turn, shift = Rotation.from_euler("z", 0.7).as_matrix(), np.array([1.0, 2.0, 0.0])
    still = Measurement(echo=echo, uplinks=())
    (before,), (after,) = (locate(one).mirrors for one in (still, moved(still, turn, shift)))
    along = (before.end - before.start) / np.linalg.norm(before.end - before.start)
    assert abs(along @ [1, -1, 0]) <= 2e-3  # 45°, to 0.1°
    np.testing.assert_allclose(after.start, turn @ before.start + shift, atol=1e-6)
    np.testing.assert_allclose(after.end, turn @ before.end + shift, atol=1e-6)


# The clock


def test_a_known_clock_offset_is_taken_out(room: Room) -> None:
    offset = 1e-10  # 3 cm; the user's clock is ahead, so that its pilot seems to arrive early
    plain = room.pilot(USER, IMAGE)
    early = replace(plain, samples=plain.samples * np.exp(2j * np.pi * plain.frequencies * offset))
    told = only(locate(room.measured(early, clock_offset=offset)))
    assert told.status == "found"
    assert error_of(told) <= 1e-4


def ahead(pilot: Uplink, offset: float) -> Uplink:
    """The pilot of a clock that is ahead: it seems to arrive early."""
    turned = pilot.samples * np.exp(2j * np.pi * pilot.frequencies * offset)
    return replace(pilot, samples=turned)


def test_an_unknown_clock_is_found_from_two_paths(room: Room) -> None:
    offset = 5e-11
    pilot = ahead(room.pilot(USER, IMAGE), offset)
    estimate = locate(room.measured(pilot, clock_offset=None))
    user = only(estimate)
    assert (user.status, user.line_of_sight) == ("found", True)
    assert user.clock_offset is not None
    assert user.clock_deviation is not None
    assert abs(user.clock_offset - offset) <= 5 * user.clock_deviation
    assert user.covariance is not None
    assert user.position is not None
    away = (user.position - USER)[:2]
    assert away @ np.linalg.solve(user.covariance[:2, :2], away) <= 25
    assert any("clock offset of 'ann' is unknown; its 2 paths give" in n for n in estimate.notes)


def test_one_path_alone_cannot_tell_an_unknown_clock(room: Room) -> None:
    user = only(locate(room.measured(room.pilot(USER), clock_offset=None)))
    assert user.status == "ambiguous"
    assert error_of(user) <= 1e-4  # the place if the offset is 0, which it is
    assert user.reason is not None
    assert "one path alone cannot tell it" in user.reason
    # By the curvature alone, the place is known less well, but honestly.
    other = user.alternatives[-1]
    assert other.position is not None
    assert other.covariance is not None
    away = (other.position - USER)[:2]
    assert away @ np.linalg.solve(other.covariance[:2, :2], away) <= 25
    assert np.trace(other.covariance) > 10 * np.trace(user.covariance)  # type: ignore[arg-type]


def test_a_clock_that_curvature_refutes_is_never_taken_for_right(room: Room) -> None:
    # 3 cm of 0.44 m: an answer that took the offset to be 0 would be wrong by as much.
    user = only(locate(room.measured(ahead(room.pilot(USER), 1e-10), clock_offset=None)))
    assert user.status == "ambiguous"


# No confident wrong answer


def test_a_wave_from_the_walls_edge_is_no_user(room: Room) -> None:
    edge = WALL[1]
    user = only(locate(room.measured(room.pilot(edge, extra=float(np.linalg.norm(USER - edge))))))
    assert (user.status, user.position) == ("not_found", None)
    assert user.reason is not None
    assert "an edge or rough patch scatters it" in user.reason


def test_a_user_beyond_the_unambiguous_length_is_not_found_and_told_why(room: Room) -> None:
    # c/Δf = 1 m of path.
    user = only(locate(room.measured(room.pilot(np.array([0.3, 1.35, 0.0])))))
    assert user.status == "not_found"
    assert user.reason is not None
    assert "beyond the unambiguous 1.00 m; take smaller frequency steps" in user.reason


def test_two_users_on_one_pilot_are_ambiguous(room: Room) -> None:
    one, other = np.array([0.3, 0.2, 0.0]), np.array([-0.2, 0.3, 0.0])
    user = only(locate(room.measured(room.pilot(one, other))))
    assert user.status == "ambiguous"
    assert error_of(user, one) <= 1e-4
    assert error_of(user.alternatives[0], other) <= 1e-4


def test_noise_alone_is_no_user_and_no_wall(room: Room) -> None:
    rng = np.random.default_rng(4)

    def noise() -> np.ndarray:
        parts = rng.standard_normal((2, *room.echo.samples.shape))
        return np.asarray(parts[0] + 1j * parts[1])

    silent = replace(room.echo, samples=noise())
    pilot = replace(room.pilot(USER), samples=noise())
    estimate = locate(room.measured(pilot, echo=silent))
    assert estimate.mirrors == ()
    assert only(estimate).status == "not_found"


def test_an_echo_of_noise_alone_says_no_more_than_none(room: Room) -> None:
    rng = np.random.default_rng(5)
    parts = rng.standard_normal((2, *room.echo.samples.shape))
    silent = replace(room.echo, samples=parts[0] + 1j * parts[1])
    near = np.array([0.05, 0.3, 0.0])
    user = only(locate(room.measured(room.pilot(near), echo=silent)))
    assert (user.status, user.line_of_sight) == ("ambiguous", None)
    assert error_of(user, near) <= 1e-4
    assert user.reason is not None
    assert "above its noise" in user.reason


def test_without_an_echo_the_place_is_only_a_guess(room: Room) -> None:
    estimate = locate(room.measured(room.pilot(USER), echo=None))
    user = only(estimate)
    assert user.status == "ambiguous"
    assert error_of(user) <= 1e-4
    assert estimate.raw_image is None
    assert estimate.corrected_image is None
    assert any("no echo" in note for note in estimate.notes)


def test_without_an_uplink_there_are_walls_and_no_users(room: Room) -> None:
    estimate = locate(room.measured())
    assert len(estimate.mirrors) == 1
    assert estimate.users == ()
    assert estimate.maps == ()


# What cannot be used


def test_samples_that_are_not_numbers_never_reach_the_estimator(room: Room) -> None:
    samples = room.echo.samples.copy()
    samples[3, 100] = np.nan
    with pytest.raises(MeasurementError, match="echo: 1 of 24096 samples are NaN or infinite"):
        replace(room.echo, samples=samples)


def test_a_frequency_grid_that_is_not_uniform_is_refused(room: Room) -> None:
    keep = np.delete(np.arange(251), 100)
    frequencies = room.echo.frequencies[keep]
    echo = replace(room.echo, samples=room.echo.samples[:, keep], frequencies=frequencies)
    with pytest.raises(MeasurementError, match="the grid is not uniform"):
        locate(Measurement(echo=echo, uplinks=()))
    pilot = room.pilot(USER)
    uneven = replace(pilot, samples=pilot.samples[:, keep], frequencies=frequencies)
    with pytest.raises(MeasurementError, match="the grid is not uniform"):
        locate(Measurement(echo=None, uplinks=(uneven,)))


def test_one_element_has_no_aperture(room: Room) -> None:
    one: dict[str, Any] = {
        "positions": room.echo.positions[:1],
        "samples": room.echo.samples[:1],
    }
    with pytest.raises(MeasurementError, match="one position has no aperture"):
        locate(Measurement(echo=replace(room.echo, **one), uplinks=()))
    with pytest.raises(MeasurementError, match="one position has no aperture"):
        locate(Measurement(echo=None, uplinks=(replace(room.pilot(USER), **one),)))


def test_one_frequency_has_no_bandwidth(room: Room) -> None:
    one: dict[str, Any] = {
        "frequencies": room.echo.frequencies[:1],
        "samples": room.echo.samples[:, :1],
    }
    with pytest.raises(MeasurementError, match="one point has no bandwidth"):
        locate(Measurement(echo=replace(room.echo, **one), uplinks=()))


def test_a_frequency_step_too_coarse_for_an_image_is_refused(room: Room) -> None:
    few = slice(None, None, 25)  # c/2Δf = 2 cm, less than the aperture
    coarse = replace(
        room.echo, samples=room.echo.samples[:, few], frequencies=room.echo.frequencies[few]
    )
    with pytest.raises(MeasurementError, match="frequency"):
        locate(Measurement(echo=coarse, uplinks=()))


@pytest.mark.parametrize("count", [2, 3])
def test_two_or_three_elements_give_no_warning_and_no_certainty(count: int, world: Any) -> None:
    positions = world.array(count)
    rng = np.random.default_rng(1)
    pilot = Uplink(
        samples=world.noisy(world.pilot(np.array([0.1, 0.3, 0.0]), positions=positions), 20.0, rng),
        positions=positions,
        frequencies=world.band,
        user="ann",
    )
    echo = world.echo(world.rough_line((0.0, 0.3), 45.0, 0.2, rng, count=200), rng,
                      positions=positions)  # fmt: skip
    try:
        user = only(locate(Measurement(echo=echo, uplinks=(pilot,), clock_offset=0.0)))
    except MeasurementError:
        return
    if user.status == "found":
        assert user.covariance is not None
        away = (user.position - [0.1, 0.3, 0.0])[:2]  # type: ignore[operator]
        assert away @ np.linalg.solve(user.covariance[:2, :2], away) <= 25


# On the simulator


def test_the_simulated_scene_is_located_from_its_measurement_alone() -> None:
    wall = {
        "kind": "plate", "material": "metal", "centre_m": [0.0, 0.3], "angle_deg": 45.0,
        "length_m": 0.2, "roughness": {"rms_mm": 0.05, "correlation_mm": 0.3},
    }  # fmt: skip
    scenario = parse_scenario(
        {
            "name": "small",
            "radio": {"start_ghz": 220.0, "stop_ghz": 295.0, "points": 251},
            "base_station": {"elements": 96, "spacing_mm": 0.5},
            "objects": {"wall": wall},
            "users": {
                "hidden": {
                    "position_m": [0.35, 0.3],
                    "antenna": {"kind": "gaussian_beam", "sigma_rad": 0.1, "aim": "wall"},
                },
                "plain": {"position_m": [-0.07, 0.15]},  # within the angles that are imaged
            },
            "noise": {"snr_db": 20.0},
        }
    )
    estimate = locate(simulate(scenario, seed=0).measurement)
    hidden, plain = estimate.users
    assert (hidden.status, hidden.bounces) == ("found", 1), hidden.reason
    assert (plain.status, plain.bounces) == ("found", 0), plain.reason
    # The design's floor of a roughness of 0.05/0.3 mm is 0.44 mm at worst, 1 m behind the
    # mirror and over 40 cm of it; here the user is at a third of that, the wall half as long.
    assert error_of(hidden, np.array([0.35, 0.3, 0.0])) <= 1e-3
    # Directly, the isotropic pilot also scatters off the wall: that bends it a little.
    assert error_of(plain, np.array([-0.07, 0.15, 0.0])) <= 1e-3
    (mirror,) = estimate.mirrors
    along = mirror.end - mirror.start
    angle = np.degrees(np.arctan2(along[1], along[0])) % 180
    assert angle == pytest.approx(45.0, abs=0.1)
    offset = (0.5 * (mirror.start + mirror.end) - [0, 0.3, 0]) @ [1, -1, 0] / np.sqrt(2)
    assert abs(offset) <= 1e-4


def test_a_wall_turned_away_gives_no_confident_wrong_answer() -> None:
    # No specular path from the hidden user reaches the array: only scattered energy does.
    wall = {
        "kind": "plate", "material": "metal", "centre_m": [0.0, 0.3], "angle_deg": 20.0,
        "length_m": 0.2, "roughness": {"rms_mm": 0.05, "correlation_mm": 0.3},
    }  # fmt: skip
    scenario = parse_scenario(
        {
            "name": "turned",
            "radio": {"start_ghz": 220.0, "stop_ghz": 295.0, "points": 251},
            "base_station": {"elements": 96, "spacing_mm": 0.5},
            "objects": {"wall": wall},
            "users": {
                "hidden": {
                    "position_m": [0.35, 0.3],
                    "antenna": {"kind": "gaussian_beam", "sigma_rad": 0.1, "aim": "wall"},
                }
            },
            "noise": {"snr_db": 20.0},
        }
    )
    user = only(locate(simulate(scenario, seed=0).measurement))
    if user.status != "found":
        assert user.reason is not None
        return
    assert user.method == "diffuse"
    assert user.position is not None
    assert user.covariance is not None
    apart = user.position[:2] - [0.35, 0.3]
    assert apart @ np.linalg.solve(user.covariance[:2, :2], apart) <= chi2.ppf(0.999, df=2)


def test_a_coarse_spacing_is_said_with_the_angle_at_which_the_image_ends(room: Room) -> None:
    note, _ = locate(Measurement(echo=room.echo, uplinks=())).notes[-2:]  # the last: the medium
    assert "grating lobes" in note
    # (2-22), corrected: arcsin(λ_min/(4Δx)) at 295 GHz and 0.5 mm.
    assert "0.5 mm" in note
    assert "30.5°" in note
