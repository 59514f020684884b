import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.imaging.backprojection import backproject, focus, focus_uplink, prepare
from estimator.imaging.profile_tables import POINTS_PER_CELL, is_worth_it
from estimator.imaging.range_compression import RangeProfiles, range_profiles
from estimator.measurement.model import Echo, MeasurementError, Uplink
from estimator.results.pixel_grid import PixelGrid

BAND = np.linspace(220e9, 295e9, 301)  # 0.6 m of unambiguous echo range
RNG = np.random.default_rng(4)
POINTS_NEAR = RNG.uniform([-0.15, 0.2, 0.0], [0.15, 0.5, 0.0], (50, 3))

FLOAT64_ERROR = 1e-3  # promised: -60 dB of the peak of a point target


def linear_array(count: int = 64, spacing: float = 0.5e-3) -> Float[np.ndarray, "positions 3"]:
    positions = np.zeros((count, 3))
    positions[:, 0] = (np.arange(count) - (count - 1) / 2) * spacing
    return positions


def delays(
    points: Float[np.ndarray, "points 3"], ends: Float[np.ndarray, "positions 3"]
) -> Float[np.ndarray, "points positions"]:
    return np.asarray(np.linalg.norm(points[:, None] - ends, axis=-1) / speed_of_light)


def wave(
    delay: Float[np.ndarray, " positions"], frequencies: Float[np.ndarray, " freqs"]
) -> Complex[np.ndarray, "positions freqs"]:
    return np.asarray(np.exp(-2j * np.pi * delay[:, None] * frequencies))


def echo_of(
    target: Float[np.ndarray, " 3"],
    positions: Float[np.ndarray, "positions 3"],
    frequencies: Float[np.ndarray, " freqs"] = BAND,
    transmit: Float[np.ndarray, "positions 3"] | None = None,
) -> Echo:
    back = delays(target[None], positions)[0]
    out = back if transmit is None else delays(target[None], transmit)[0]
    samples = wave(out + back, frequencies)
    return Echo(
        samples=samples, positions=positions, frequencies=frequencies, transmit_positions=transmit
    )


def direct_sum(
    samples: Complex[np.ndarray, "positions freqs"],
    delay: Float[np.ndarray, "points positions"],
    frequencies: Float[np.ndarray, " freqs"],
) -> Complex[np.ndarray, " points"]:
    steer = np.exp(2j * np.pi * delay[..., None] * frequencies)
    return np.asarray(np.einsum("pmn,mn->p", steer, samples) / samples.size)


def noise(positions: int, freqs: int) -> Complex[np.ndarray, "positions freqs"]:
    return RNG.normal(size=(positions, freqs)) + 1j * RNG.normal(size=(positions, freqs))


def test_the_image_is_the_direct_sum_in_float64() -> None:
    positions = linear_array()
    echo = Echo(samples=noise(64, 301), positions=positions, frequencies=BAND)
    direct = direct_sum(echo.samples, 2 * delays(POINTS_NEAR, positions), BAND)
    # Noise of unit power: the bound for a point target holds for each sample's share of it.
    error = np.abs(backproject(echo, POINTS_NEAR) - direct)
    assert error.max() <= FLOAT64_ERROR * np.abs(echo.samples).mean()


def test_the_error_stays_below_60_db_where_a_target_stands() -> None:
    positions = linear_array(1)  # one position: errors of several could average out
    target = np.array([0.03, 0.31, 0.0])
    points = target + np.linspace(0, 2e-3, 101)[:, None] * np.array([0.0, 1.0, 0.0])
    echo = echo_of(target, positions)
    direct = direct_sum(echo.samples, 2 * delays(points, positions), BAND)
    assert np.abs(backproject(echo, points) - direct).max() <= FLOAT64_ERROR


def test_many_points_are_read_from_a_fine_table_to_60_db() -> None:
    positions = linear_array(1)
    target = np.array([0.03, 0.31, 0.0])
    echo = echo_of(target, positions)
    profiles = range_profiles(echo)
    count = int(np.ceil(POINTS_PER_CELL * profiles.coefficients.shape[1]))
    assert is_worth_it(profiles, count)
    assert not is_worth_it(profiles, count - 1)
    points = target + np.linspace(-2e-3, 2e-3, count)[:, None] * np.array([0.0, 1.0, 0.0])
    direct = direct_sum(echo.samples, 2 * delays(points, positions), BAND)
    error = np.abs(backproject(echo, points) - direct)
    assert error.max() <= FLOAT64_ERROR
    assert error.max() > 0.02 * FLOAT64_ERROR  # of the cubics, which few points are read from


def test_a_fine_table_of_strong_and_weak_positions_keeps_the_image() -> None:
    positions = linear_array(8)
    samples = noise(8, 301) * np.logspace(0, -3, 8)[:, None]
    echo = Echo(samples=samples, positions=positions, frequencies=BAND)
    points = RNG.uniform([-0.15, 0.2, 0.0], [0.15, 0.5, 0.0], (5000, 3))
    direct = direct_sum(samples, 2 * delays(points, positions), BAND)
    error = np.abs(backproject(echo, points) - direct)
    # Noise of unit power: the bound for a point target holds for each sample's share of it.
    assert error.max() <= FLOAT64_ERROR * np.abs(samples).mean()


@pytest.mark.parametrize("place", [(0.0, 0.3, 0.0), (0.1, 0.25, 0.02), (-0.2, 0.4, -0.1)])
def test_a_point_target_focuses_to_one_where_it_stands(place: tuple[float, ...]) -> None:
    target = np.array(place)
    image = backproject(echo_of(target, linear_array()), target[None])
    assert abs(image[0] - 1) <= FLOAT64_ERROR  # magnitude and phase


def test_a_source_focuses_to_one_where_it_stands() -> None:
    source = np.array([0.5, 0.8, 0.1])
    positions = linear_array()
    samples = wave(delays(source[None], positions)[0], BAND)
    uplink = Uplink(samples=samples, positions=positions, frequencies=BAND, user="a")
    assert abs(focus_uplink(uplink, source[None])[0] - 1) <= FLOAT64_ERROR


def test_a_decaying_wave_matches_its_amplitude_at_the_centre() -> None:
    source = np.array([0.02, 0.05, 0.0])
    positions = linear_array()
    distance = np.linalg.norm(source - positions, axis=1)
    ratio = np.linalg.norm(source) / distance
    samples = 0.3j * ratio[:, None] * wave(distance / speed_of_light, BAND)
    uplink = Uplink(samples=samples, positions=positions, frequencies=BAND, user="a")
    matched = focus_uplink(uplink, source[None], amplitude_ratio=True)
    assert abs(matched[0] - 0.3j) <= 0.3 * FLOAT64_ERROR


def test_separate_transmitters_focus_to_one() -> None:
    target = np.array([0.04, 0.3, 0.0])
    receive = linear_array()
    transmit = np.broadcast_to([0.1, 0.0, 0.05], receive.shape).copy()
    echo = echo_of(target, receive, transmit=transmit)
    points = np.vstack([target, POINTS_NEAR])
    direct = direct_sum(echo.samples, delays(points, receive) + delays(points, transmit), BAND)
    image = backproject(echo, points)
    assert abs(image[0] - 1) <= FLOAT64_ERROR
    assert np.abs(image - direct).max() <= FLOAT64_ERROR


def test_exchanging_transmitters_and_receivers_changes_nothing() -> None:
    first, second = linear_array(), linear_array() + np.array([0.0, 0.0, 0.03])
    samples = noise(64, 301)
    one = Echo(samples=samples, positions=first, frequencies=BAND, transmit_positions=second)
    two = Echo(samples=samples, positions=second, frequencies=BAND, transmit_positions=first)
    difference = np.abs(backproject(one, POINTS_NEAR) - backproject(two, POINTS_NEAR))
    assert difference.max() <= 2 * FLOAT64_ERROR * np.abs(samples).mean()


@settings(max_examples=10, deadline=None)
@given(
    shift=st.tuples(*[st.floats(-20, 20, allow_subnormal=False)] * 3),
    turn=st.floats(0, 2 * np.pi, allow_subnormal=False),
)
def test_moving_the_whole_scene_moves_the_image(
    shift: tuple[float, float, float], turn: float
) -> None:
    target = np.array([0.05, 0.3, 0.01])
    echo = echo_of(target, linear_array())
    rotation = np.array(
        [[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1.0]]
    )
    moved = Echo(
        samples=echo.samples,
        positions=echo.positions @ rotation.T + shift,
        frequencies=BAND,
    )
    points = np.vstack([target, POINTS_NEAR])
    difference = backproject(moved, points @ rotation.T + shift) - backproject(echo, points)
    # Both err by up to -60 dB, and independently so: cells and centres fall elsewhere.
    assert np.abs(difference).max() <= 2 * FLOAT64_ERROR


def test_mirroring_the_scene_mirrors_the_image() -> None:
    echo = echo_of(np.array([0.05, 0.3, 0.0]), linear_array())
    mirrored = Echo(samples=echo.samples[::-1], positions=echo.positions, frequencies=BAND)
    flip = np.array([-1.0, 1.0, 1.0])
    difference = backproject(mirrored, POINTS_NEAR * flip) - backproject(echo, POINTS_NEAR)
    assert np.abs(difference).max() <= 2 * FLOAT64_ERROR


def test_a_grid_of_any_shape_gives_the_same_values_as_its_list_of_points() -> None:
    echo = echo_of(np.array([0.02, 0.3, 0.0]), linear_array())
    grid = PixelGrid.volume(
        x=np.linspace(-0.03, 0.03, 7), y=np.linspace(0.2, 0.4, 11), z=np.linspace(0, 0.1, 3)
    )
    image = backproject(echo, grid.points)
    assert image.shape == (7, 11, 3)
    np.testing.assert_allclose(
        image.ravel(), backproject(echo, grid.points.reshape(-1, 3)), atol=1e-6
    )


def test_profiles_that_are_reused_give_the_same_image() -> None:
    echo = echo_of(np.array([0.02, 0.3, 0.0]), linear_array())
    focuser = prepare(range_profiles(echo))
    for points in (POINTS_NEAR[:3], POINTS_NEAR, POINTS_NEAR[0]):
        np.testing.assert_array_equal(focus(focuser, points), backproject(echo, points))


def test_no_points_give_an_empty_image() -> None:
    echo = echo_of(np.array([0.02, 0.3, 0.0]), linear_array())
    assert backproject(echo, np.zeros((0, 3))).shape == (0,)


def test_a_taper_leaves_the_peak_at_one() -> None:
    target = np.array([0.02, 0.3, 0.0])
    weights = np.hanning(64)[:, None] * np.hanning(301)
    image = backproject(echo_of(target, linear_array()), target[None], weights=weights)
    assert abs(image[0] - 1) <= FLOAT64_ERROR


def test_points_up_to_the_unambiguous_range_focus() -> None:
    limit = speed_of_light / (2 * (BAND[1] - BAND[0]))
    positions = linear_array(1)
    target = np.array([0.0, limit * (1 - 1e-9), 0.0])
    assert abs(backproject(echo_of(target, positions), target[None])[0] - 1) <= FLOAT64_ERROR


def test_a_point_on_an_antenna_focuses() -> None:
    positions = linear_array(65)
    for index in (0, 32):  # 32: also the array's centre
        target = positions[index]
        image = backproject(echo_of(target, positions), target[None])
        assert abs(image[0] - 1) <= FLOAT64_ERROR


@pytest.mark.parametrize(
    "frequencies",
    [
        pytest.param(np.delete(BAND, slice(100, 140)), id="hole"),
        pytest.param(BAND[RNG.permutation(301)[:200]], id="random part"),
        pytest.param(BAND + RNG.uniform(-0.4, 0.4, 301) * (BAND[1] - BAND[0]), id="uneven"),
    ],
)
def test_uneven_frequencies_and_holes_focus_like_the_direct_sum(
    frequencies: Float[np.ndarray, " freqs"],
) -> None:
    frequencies = np.sort(frequencies)
    positions = linear_array()
    target = np.array([0.02, 0.3, 0.0])
    echo = echo_of(target, positions, frequencies)
    points = np.vstack([target, POINTS_NEAR])
    direct = direct_sum(echo.samples, 2 * delays(points, positions), frequencies)
    assert np.abs(backproject(echo, points) - direct).max() <= FLOAT64_ERROR


def test_pixels_beyond_the_unambiguous_range_are_refused_with_the_numbers() -> None:
    echo = echo_of(np.array([0.0, 0.3, 0.0]), linear_array())
    with pytest.raises(MeasurementError, match=r"reach 0\.7\d+ m .* only up to 0\.600 m"):
        backproject(echo, np.array([[0.0, 0.7, 0.0]]))


def test_pixels_that_are_not_finite_are_refused() -> None:
    echo = echo_of(np.array([0.0, 0.3, 0.0]), linear_array())
    with pytest.raises(MeasurementError, match="1 of 2 pixels have NaN"):
        backproject(echo, np.array([[0.0, 0.3, 0.0], [0.0, np.nan, 0.0]]))


def test_one_frequency_is_refused() -> None:
    echo = Echo(samples=noise(64, 1), positions=linear_array(), frequencies=BAND[:1])
    with pytest.raises(MeasurementError, match="one point has no bandwidth"):
        backproject(echo, POINTS_NEAR)


def test_a_taper_without_weight_is_refused() -> None:
    echo = echo_of(np.array([0.0, 0.3, 0.0]), linear_array())
    with pytest.raises(MeasurementError, match="weights sum to 0"):
        backproject(echo, POINTS_NEAR, weights=np.zeros((1, 1)))


def test_a_taper_over_elements_excludes_the_amplitude_ratio() -> None:
    positions = linear_array()
    uplink = Uplink(samples=noise(64, 301), positions=positions, frequencies=BAND, user="a")
    with pytest.raises(MeasurementError, match="exclude each other"):
        focus_uplink(uplink, POINTS_NEAR, weights=np.hanning(64)[:, None], amplitude_ratio=True)


def test_profiles_too_large_for_the_device_are_refused() -> None:
    huge = np.broadcast_to(np.zeros(1, dtype=np.complex64), (2**15, 2**15, 4))
    profiles = RangeProfiles(
        coefficients=huge,
        cell=1.0,
        carrier=1.0,
        unambiguous=1.0,
        legs=(np.zeros((2**15, 3)),),
        passes=2,
        gain=1.0,
    )
    with pytest.raises(MeasurementError, match="32-bit addresses"):
        prepare(profiles)
