"""The motion model against closed forms, the Riccati equation and batch least squares."""

import numpy as np
import pytest
from scipy.linalg import block_diag, expm, solve_discrete_are
from scipy.stats import chi2

from estimator.tracking.constant_velocity import State, acceleration_noise, moved, smoothed, updated

DENSITY = 0.5


def test_a_user_that_is_left_alone_goes_straight_on() -> None:
    state = State(mean=np.array([1.0, 2.0, 0.3, -0.4]), covariance=np.zeros((4, 4)))
    ahead = moved(state, 2.0, DENSITY)
    np.testing.assert_allclose(ahead.mean, [1.6, 1.2, 0.3, -0.4])
    # White acceleration for 2 s: position variance q T³/3, velocity variance q T.
    assert np.diag(ahead.covariance) == pytest.approx([DENSITY * 8 / 3] * 2 + [DENSITY * 2] * 2)


def test_two_short_predictions_are_one_long_one() -> None:
    state = State(mean=np.array([0.0, 1.0]), covariance=np.array([[2.0, 0.3], [0.3, 1.0]]))
    once = moved(state, 0.7, DENSITY)
    twice = moved(moved(state, 0.3, DENSITY), 0.4, DENSITY)
    np.testing.assert_allclose(once.mean, twice.mean, rtol=1e-12)
    np.testing.assert_allclose(once.covariance, twice.covariance, rtol=1e-12)


def test_the_noise_is_that_of_van_loans_integral() -> None:
    gap, drift = 0.8, np.array([[0.0, 1.0], [0.0, 0.0]])
    power = np.diag([0.0, DENSITY])
    exponential = expm(np.block([[-drift, power], [np.zeros((2, 2)), drift.T]]) * gap)
    expected = exponential[2:, 2:].T @ exponential[:2, 2:]
    np.testing.assert_allclose(acceleration_noise(gap, DENSITY), expected, rtol=1e-12)


def test_the_filter_settles_where_the_riccati_equation_says() -> None:
    gap, variance = 0.2, 0.01
    state = State(mean=np.zeros(2), covariance=np.diag([1.0, 1.0]))
    for _ in range(200):
        state = updated(moved(state, gap, DENSITY), np.zeros(1), np.array([[variance]])).state
    forward, seen = np.array([[1.0, gap], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    ahead = solve_discrete_are(
        forward.T, seen.T, acceleration_noise(gap, DENSITY), np.array([[variance]])
    )
    np.testing.assert_allclose(moved(state, gap, DENSITY).covariance, ahead, rtol=1e-9)


def test_a_position_has_the_density_that_was_expected() -> None:
    state = State(mean=np.array([0.5, 0.0]), covariance=np.diag([3.0, 1.0]))
    update = updated(state, np.array([2.5]), np.array([[1.0]]))
    assert update.distance == pytest.approx(1.0)  # 2 m off, 4 m² of variance
    assert np.exp(update.log_density) == pytest.approx(np.exp(-0.5) / np.sqrt(2 * np.pi * 4))
    assert update.state.mean == pytest.approx([2.0, 0.0])  # three parts to one
    assert update.state.covariance[0, 0] == pytest.approx(0.75)


def drawn(rng: np.random.Generator, times: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """True states and measured positions of one user in the plane."""
    truth = [np.concatenate([rng.standard_normal(2), rng.standard_normal(2)])]
    for gap in np.diff(times):
        noise = np.kron(acceleration_noise(float(gap), DENSITY), np.eye(2))
        forward = np.kron(np.array([[1.0, gap], [0.0, 1.0]]), np.eye(2))
        truth.append(rng.multivariate_normal(forward @ truth[-1], noise))
    measured = [rng.multivariate_normal(state[:2], spread) for state in truth]
    return np.concatenate([truth, measured], axis=1)


def filtered(measured: np.ndarray, times: np.ndarray, spread: np.ndarray) -> list[State]:
    state = State(mean=np.zeros(4), covariance=np.eye(4))
    states = [updated(state, measured[0], spread).state]
    for gap, place in zip(np.diff(times), measured[1:], strict=True):
        states.append(updated(moved(states[-1], float(gap), DENSITY), place, spread).state)
    return states


def test_the_smoother_is_least_squares_over_the_whole_way() -> None:
    rng = np.random.default_rng(0)
    times = np.array([0.0, 0.2, 0.3, 0.9, 1.0, 1.6])
    spread = np.array([[0.02, 0.005], [0.005, 0.01]])
    measured = drawn(rng, times, spread)[:, 4:]
    states = smoothed(filtered(measured, times, spread), times.tolist(), DENSITY)
    # All unknowns at once: the prior, five motions and six positions, each weighed.
    count = 4 * times.size
    rows, weights, right = [np.eye(4, count)], [np.eye(4)], [np.zeros(4)]
    for index in range(times.size - 1):
        gap = float(times[index + 1] - times[index])
        row = np.zeros((4, count))
        row[:, 4 * index : 4 * index + 4] = -np.kron(np.array([[1.0, gap], [0.0, 1.0]]), np.eye(2))
        row[:, 4 * index + 4 : 4 * index + 8] = np.eye(4)
        rows.append(row)
        weights.append(np.linalg.inv(np.kron(acceleration_noise(float(gap), DENSITY), np.eye(2))))
        right.append(np.zeros(4))
    for index, place in enumerate(measured):
        row = np.zeros((2, count))
        row[:, 4 * index : 4 * index + 2] = np.eye(2)
        rows.append(row)
        weights.append(np.linalg.inv(spread))
        right.append(place)
    design, weight = np.concatenate(rows), block_diag(*weights)
    covariance = np.linalg.inv(design.T @ weight @ design)
    solution = covariance @ design.T @ weight @ np.concatenate(right)
    for index, state in enumerate(states):
        own = slice(4 * index, 4 * index + 4)
        # The batch matrix has a condition of 1e6.
        np.testing.assert_allclose(state.mean, solution[own], atol=1e-8)
        np.testing.assert_allclose(state.covariance, covariance[own, own], atol=1e-8)


def test_errors_are_as_large_as_the_covariances_say() -> None:
    trials, spread = 200, np.array([[0.02, 0.005], [0.005, 0.01]])
    times = np.array([0.0, 0.3, 0.5, 1.0, 1.2])
    rng = np.random.default_rng(2)
    squared = np.zeros((2, times.size))
    errors = np.zeros((3, times.size))
    for _ in range(trials):
        both = drawn(rng, times, spread)
        truth, measured = both[:, :4], both[:, 4:]
        ahead = filtered(measured, times, spread)
        back = smoothed(ahead, times.tolist(), DENSITY)
        errors[0] += np.sum((measured - truth[:, :2]) ** 2, axis=1)
        for row, states in enumerate((ahead, back)):
            for index, state in enumerate(states):
                off = state.mean - truth[index]
                squared[row, index] += off @ np.linalg.solve(state.covariance, off)
                errors[row + 1, index] += off[:2] @ off[:2]
    # Each sum is χ² with four degrees for each trial; ten sums, one false alarm in 1000.
    low, high = (float(chi2.ppf(share, df=4 * trials)) for share in (5e-5, 1 - 5e-5))
    assert np.all((squared > low) & (squared < high))
    # Smoothed beats filtered beats raw, but for the ends, where they know the same.
    raw, forward, whole = errors[0], errors[1], errors[2]
    assert np.all(forward < raw)
    assert np.all(whole[:-1] < forward[:-1])
    assert whole[-1] == pytest.approx(forward[-1])
