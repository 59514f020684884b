"""A small room of points in closed form: one tilted rough wall, a post, two users."""

from dataclasses import replace

import numpy as np
import pytest
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.array.planar_array import planar_array, planar_frame, spans_a_plane
from estimator.localization.pipeline import locate
from estimator.measurement.model import Echo, Measurement, MeasurementError
from estimator.results.estimate import Estimate
from validation.analytic.point_scatterer import complex_noise, point_uplink

BAND = np.linspace(57e9, 64e9, 71)  # 1.5 m of unambiguous echo range, 3 m of path
TILT = np.radians(20.0)
NORMAL = np.array([np.sin(TILT), -np.cos(TILT), 0.0])
CENTRE = np.array([0.0, 0.8, 0.0])
HIDDEN_USER = np.array([0.35, 0.45, 0.05])
SEEN_USER = np.array([-0.12, 0.6, -0.1])  # at 11°, within the 13.5° that the echo images
POST = np.array([0.1, 0.55, 0.05])


def elements(count: int = 16) -> Float[np.ndarray, "elements 3"]:
    places = (np.arange(count) - (count - 1) / 2) * 5e-3
    x, z = np.meshgrid(places, places, indexing="ij")
    return np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=-1)


def echo_of(
    points: Float[np.ndarray, "points 3"], strengths: np.ndarray, rng: np.random.Generator
) -> Echo:
    positions = elements()
    samples = np.zeros((len(positions), BAND.size), dtype=np.complex128)
    step = 4 * np.pi * (BAND[1] - BAND[0]) / speed_of_light
    for point, strength in zip(points, strengths, strict=True):
        distance = np.linalg.norm(point - positions, axis=1)
        turns = np.empty_like(samples)
        turns[:] = np.exp(-1j * step * distance)[:, None]
        turns[:, 0] = strength * np.exp(-4j * np.pi * BAND[0] / speed_of_light * distance)
        samples += np.cumprod(turns, axis=1) / distance[:, None] ** 2
    noise = complex_noise(samples.shape, 0.01 * float(np.mean(np.abs(samples) ** 2)), rng)
    return Echo(samples=samples + noise, positions=positions, frequencies=BAND)


def rough_wall(rng: np.random.Generator, count: int = 500) -> tuple[np.ndarray, np.ndarray]:
    along, up = np.cross([0.0, 0.0, 1.0], NORMAL), np.array([0.0, 0.0, 1.0])
    places = rng.uniform(-0.2, 0.2, (count, 2))
    heights = 0.1e-3 * rng.standard_normal((count, 1))
    points = CENTRE + places[:, :1] * along + places[:, 1:] * up + heights * NORMAL
    pair = rng.standard_normal((2, count))
    return points, pair[0] + 1j * pair[1]


@pytest.fixture(scope="module")
def measurement() -> Measurement:
    rng = np.random.default_rng(7)
    points, strengths = rough_wall(rng)
    echo = echo_of(np.vstack([points, POST]), np.append(strengths, 12.0), rng)
    image = HIDDEN_USER - 2 * ((HIDDEN_USER - CENTRE) @ NORMAL) * NORMAL
    uplinks = []
    for name, source in (("hidden", image), ("seen", SEEN_USER)):
        clean = point_uplink(source[None], positions=elements(), frequencies=BAND, user=name)
        power = float(np.mean(np.abs(clean.samples) ** 2))
        noise = complex_noise(clean.samples.shape, 0.01 * power, rng)
        uplinks.append(replace(clean, samples=clean.samples + noise))
    return Measurement(echo=echo, uplinks=tuple(uplinks), clock_offset=0.0)


@pytest.fixture(scope="module")
def estimate(measurement: Measurement) -> Estimate:
    return locate(measurement)


def test_the_rough_wall_is_found_as_one_plane(estimate: Estimate) -> None:
    (mirror,) = estimate.mirrors
    assert mirror.confidence > 0.999
    turn, nod = (float(v) for v in np.sqrt(np.diag(mirror.covariance))[:2])
    # Four deviations each way, of the fit's own: speckle is drawn once.
    assert np.linalg.norm(mirror.normal - NORMAL) < 4 * np.hypot(turn, nod)
    assert np.hypot(turn, nod) < np.radians(0.5)
    assert mirror.corners is not None
    offset = (mirror.corners.mean(axis=0) - CENTRE) @ NORMAL
    assert abs(offset) < 1e-3  # a twentieth of the range cell
    sides = np.ptp(mirror.corners, axis=0)
    # A wall of 0.4 m, within the angles that 5 mm resolve: 13.5°, ±0.19 m at 0.8 m; on either
    # side the tapered cell of 0.05 m adds up to one.
    assert 0.30 < sides[2] < 0.50


def test_a_user_over_the_wall_and_one_in_sight_are_where_they_are(estimate: Estimate) -> None:
    hidden, seen = estimate.users
    for user, truth, bounces in ((hidden, HIDDEN_USER, 1), (seen, SEEN_USER, 0)):
        assert user.status == "found", user.reason
        assert user.bounces == bounces
        assert user.position is not None
        assert user.covariance is not None
        error = user.position - truth
        # χ² of 3 exceeds 21.1 once in 10⁴.
        assert error @ np.linalg.solve(user.covariance, error) < 21.1
        assert np.linalg.norm(error) < 5e-3  # the acceptance of the scenario room_3d


def test_an_untold_clock_offset_gives_no_certain_wrong_place(measurement: Measurement) -> None:
    # 30 ps are 9 mm: taken to be 0, each of both users would be found 9 mm off, to 0.1 mm.
    user = np.array([0.1, 0.5, 0.05])
    image = user - 2 * ((user - CENTRE) @ NORMAL) * NORMAL
    ways = [
        point_uplink(one[None], positions=elements(), frequencies=BAND, user="over both")
        for one in (user, image)
    ]
    samples = ways[0].samples + ways[1].samples
    power = float(np.mean(np.abs(samples) ** 2))
    noise = complex_noise(samples.shape, 0.01 * power, np.random.default_rng(5))
    heard = (*measurement.uplinks, replace(ways[0], samples=samples + noise))
    ahead = np.exp(2j * np.pi * BAND * 30e-12)
    late = tuple(replace(one, samples=one.samples * ahead) for one in heard)
    estimate = locate(replace(measurement, uplinks=late, clock_offset=None))
    *alone, fixed = estimate.users
    for one in alone:
        assert one.status == "ambiguous"
        assert one.reason is not None
        assert "the user's clock offset is unknown" in one.reason
    assert fixed.status == "found", fixed.reason
    assert fixed.position is not None
    assert fixed.covariance is not None
    error = fixed.position - user
    # χ² of 3 exceeds 21.1 once in 10⁴.
    assert error @ np.linalg.solve(fixed.covariance, error) < 21.1
    assert fixed.clock_offset is not None
    assert fixed.clock_deviation is not None
    assert abs(fixed.clock_offset - 30e-12) < 4 * fixed.clock_deviation
    assert fixed.clock_deviation < 10e-12  # a third of it: 0 is refuted
    assert any("'over both' is unknown; its 2 paths" in note for note in estimate.notes)


@pytest.mark.parametrize("hidden_by_a_post", [False, True])
def test_outside_of_the_imaged_sector_the_straight_way_is_looked_at_by_itself(
    hidden_by_a_post: bool,
) -> None:
    # At 25° aside the array has grating lobes at 5 mm; the wall's speckle repeats there.
    rng = np.random.default_rng(11)
    user = np.array([-0.28, 0.6, 0.0])
    points, strengths = rough_wall(rng)
    if hidden_by_a_post:
        points, strengths = np.vstack([points, 0.6 * user]), np.append(strengths, 12.0)
    clean = point_uplink(user[None], positions=elements(), frequencies=BAND)
    power = float(np.mean(np.abs(clean.samples) ** 2))
    noise = complex_noise(clean.samples.shape, 0.01 * power, rng)
    heard = replace(clean, samples=clean.samples + noise)
    echo = echo_of(points, strengths, rng)
    (found,) = locate(Measurement(echo=echo, uplinks=(heard,), clock_offset=0.0)).users
    assert found.position is not None
    assert np.linalg.norm(found.position - user) < 1e-3
    if hidden_by_a_post:
        assert found.status == "ambiguous"
        assert found.reason is not None
        assert "on the straight way" in found.reason or "straight way passes" in found.reason
    else:
        assert found.status == "found", found.reason


def test_a_post_in_front_of_the_wall_is_a_target_and_no_wall(estimate: Estimate) -> None:
    direct = [target for target in estimate.targets if not target.seen_through]
    nearest = min(direct, key=lambda target: float(np.linalg.norm(target.position - POST)))
    # Half a range cell of 21 mm along and half a cross-range cell (0.6 m · λ/2D) across.
    assert np.linalg.norm(nearest.position - POST) < 0.5 * np.hypot(0.021, 0.6 * 0.033)


def test_the_volume_shows_the_post_where_it_is(estimate: Estimate) -> None:
    image = estimate.raw_image
    assert image is not None
    near = np.linalg.norm(image.grid.points - POST, axis=-1) < 0.06
    place = image.grid.points[near][int(np.argmax(np.abs(image.values[near])))]
    assert np.linalg.norm(place - POST) < 0.5 * np.hypot(0.021, 0.6 * 0.033)


def test_noise_alone_makes_no_wall_no_target_and_no_certain_user(measurement: Measurement) -> None:
    rng = np.random.default_rng(2)
    samples = complex_noise((len(elements()), BAND.size), 1e-6, rng)
    echo = Echo(samples=samples, positions=elements(), frequencies=BAND)
    found = locate(Measurement(echo=echo, uplinks=measurement.uplinks[:1], clock_offset=0.0))
    assert found.mirrors == ()
    assert found.targets == ()
    (user,) = found.users
    assert user.status == "ambiguous"
    assert user.reason is not None
    assert "above its noise" in user.reason


def test_turning_the_whole_world_turns_the_answer(measurement: Measurement) -> None:
    uplink = measurement.uplinks[1]
    turn = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # −90° about z
    moved = Measurement(
        echo=None,
        uplinks=(replace(uplink, positions=uplink.positions @ turn.T + [1.0, 2.0, 0.5]),),
        boresight=turn @ np.array([0.0, 1.0, 0.0]),
        clock_offset=0.0,
    )
    plain = locate(replace(measurement, echo=None, uplinks=(uplink,))).users[0]
    turned = locate(moved).users[0]
    assert plain.position is not None
    assert turned.position is not None
    np.testing.assert_allclose(turned.position, turn @ plain.position + [1.0, 2.0, 0.5], atol=1e-6)
    assert plain.status == "ambiguous"  # nothing is known of mirrors without an echo
    assert turned.elevation == pytest.approx(plain.elevation, abs=1e-6)


def test_a_sparse_arrays_grating_lobe_is_not_taken_for_the_user() -> None:
    positions = 3.0 * elements(12)  # 15 mm, three wavelengths: lobes every 0.33 in the cosine
    user = np.array([0.3, 0.8, 0.1])  # at a cosine of 0.35, outside of the sector of ±0.16
    uplink = point_uplink(user[None], positions=positions, frequencies=BAND)
    found = locate(Measurement(echo=None, uplinks=(uplink,), clock_offset=0.0)).users[0]
    assert found.position is not None
    assert np.linalg.norm(found.position - user) < 1e-4


def test_a_crooked_line_is_no_plane_and_a_bent_plane_is_refused() -> None:
    line = np.zeros((50, 3))
    line[:, 0] = np.arange(50) * 1e-3
    line[:, 2] = 1e-3 * np.sin(np.arange(50))
    assert not spans_a_plane(line)
    assert spans_a_plane(elements())
    bent = elements()
    bent[:, 1] = bent[:, 0] ** 2
    with pytest.raises(MeasurementError, match="off a plane"):
        planar_frame(bent, np.array([0.0, 1.0, 0.0]))
    with pytest.raises(MeasurementError, match="perpendicular to the array"):
        planar_frame(elements(), np.array([0.0, 0.8, 0.6]))


def test_an_arrays_aperture_and_spacing_are_measured_through_jitter() -> None:
    jitter = 1e-5 * np.random.default_rng(0).standard_normal((256, 3))
    array = planar_array(elements() + jitter)
    np.testing.assert_allclose(array.aperture, 0.075, atol=1e-4)
    np.testing.assert_allclose(array.spacing, 5e-3, rtol=1e-2)


def test_waves_of_the_plane_are_refused_of_a_planar_array(measurement: Measurement) -> None:
    wrong = replace(measurement, waves="cylindrical")
    with pytest.raises(MeasurementError, match="spherical"):
        locate(wrong)
