import numpy as np
import pytest
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.channel.relax import refine_paths
from estimator.measurement.model import Uplink
from validation.analytic.point_scatterer import complex_noise
from validation.bounds.cramer_rao import cramer_rao_bound


def spherical_wave(
    parameters: Float[np.ndarray, " 4"],
    positions: Float[np.ndarray, "elements 3"],
    frequencies: Float[np.ndarray, " freqs"],
) -> Complex[np.ndarray, "elements freqs"]:
    """Evaluate the model for (angle [rad], path length [m], Re g, Im g).

    Angles are from +x in the plane z = 0, lengths from the origin.
    """
    aoa, path_length, re, im = parameters
    source = path_length * np.array([np.cos(aoa), np.sin(aoa), 0.0])
    distance = np.linalg.norm(source - positions, axis=1)
    turns = np.outer(distance, frequencies / speed_of_light)
    wave = (path_length / distance)[:, None] * np.exp(-2j * np.pi * turns)
    return np.asarray((re + 1j * im) * wave)


def numerical_fisher(
    parameters: Float[np.ndarray, " 4"],
    *,
    noise_variance: float,
    positions: Float[np.ndarray, "elements 3"],
    frequencies: Float[np.ndarray, " freqs"],
) -> Float[np.ndarray, "4 4"]:
    """Return the Fisher information of the whole model by central differences.

    Parameters
    ----------
    parameters
        Angle [rad], path length [m], real and imaginary part of the gain.
    noise_variance
        Per complex sample. [-]
    positions, frequencies
        Elements [m] and sweep [Hz].
    """
    wavenumber = 2 * np.pi * float(frequencies[-1]) / speed_of_light
    size = float(np.abs(parameters[2] + 1j * parameters[3]))
    reach = float(np.abs(positions).max())
    # Steps that turn no phase by more than 1e-3: the differences err by a part in 1e6.
    steps = np.array([1e-3 / (wavenumber * reach), 1e-3 / wavenumber, 1e-4 * size, 1e-4 * size])
    slopes = []
    for index, step in enumerate(steps):
        move = np.zeros(4)
        move[index] = step
        ahead = spherical_wave(parameters + move, positions, frequencies)
        behind = spherical_wave(parameters - move, positions, frequencies)
        slopes.append((ahead - behind).ravel() / (2 * step))
    jacobian = np.stack(slopes)
    return np.asarray(2 / noise_variance * (jacobian.conj() @ jacobian.T).real)


def broadside_range_bound(*, bandwidth: float, samples: int, snr: float) -> float:
    """Return the textbook bound of the range's deviation for a distant source, in metres.

    c / (2π B/√12 √(2 MN SNR)), for a uniform sweep of bandwidth B in hertz.
    """
    rms_bandwidth = bandwidth / np.sqrt(12)
    return float(speed_of_light / (2 * np.pi * rms_bandwidth * np.sqrt(2 * samples * snr)))


def linear_array(count: int, spacing: float = 0.5e-3) -> Float[np.ndarray, "elements 3"]:
    positions = np.zeros((count, 3))
    positions[:, 0] = (np.arange(count) - (count - 1) / 2) * spacing
    return positions


@pytest.mark.parametrize(("aoa_deg", "path_length"), [(90.0, 0.3), (70.0, 1.8), (140.0, 20.0)])
def test_the_formula_agrees_with_the_numerical_fisher_information(
    aoa_deg: float, path_length: float
) -> None:
    positions, frequencies = linear_array(40), np.linspace(220e9, 295e9, 60)
    parameters = np.array([np.radians(aoa_deg), path_length, 0.6, -0.3])
    wave = spherical_wave(parameters, positions, frequencies)
    snr = 100.0
    variance = float(np.mean(np.abs(wave) ** 2)) / snr
    fisher = numerical_fisher(
        parameters, noise_variance=variance, positions=positions, frequencies=frequencies
    )
    bound = cramer_rao_bound(
        aoa=parameters[0],
        path_length=path_length,
        snr=snr,
        positions=positions,
        frequencies=frequencies,
    )
    numerical = np.linalg.inv(fisher)[:2, :2]
    scale = np.sqrt(np.outer(np.diag(bound), np.diag(bound)))
    # The differences err by 1e-6 before the inversion, whose condition costs a few digits.
    np.testing.assert_allclose(numerical / scale, bound / scale, atol=2e-3)


def test_the_range_bound_of_the_slam_scene_is_0_03_micrometres_at_40_db() -> None:
    positions, frequencies = linear_array(260), np.linspace(220e9, 295e9, 1001)
    textbook = broadside_range_bound(bandwidth=75e9, samples=260 * 1001, snr=1e4)
    assert textbook == pytest.approx(0.03e-6, rel=0.05)  # the issue gives one digit
    # Far away; nearer the bend of the wavefront tells the range as well.
    bound = cramer_rao_bound(
        aoa=np.pi / 2, path_length=1e3, snr=1e4, positions=positions, frequencies=frequencies
    )
    assert np.sqrt(bound[1, 1]) == pytest.approx(textbook, rel=2e-3)  # 1001 points, not infinite


MANY = pytest.param(2000, marks=pytest.mark.slow)  # a minute each


@pytest.mark.parametrize("trials", [200, MANY])
@pytest.mark.parametrize("snr_db", [10.0, 40.0])
def test_refinement_reaches_the_bound_without_bias(snr_db: float, trials: int) -> None:
    rng = np.random.default_rng(int(snr_db))
    positions, frequencies = linear_array(16), np.linspace(220e9, 295e9, 24)
    truth = np.array([np.radians(70.0), 0.4])
    wave = spherical_wave(np.array([*truth, 1.0, 0.0]), positions, frequencies)
    snr = 10 ** (snr_db / 10)
    variance = float(np.mean(np.abs(wave) ** 2)) / snr
    errors = np.empty((trials, 2))
    for trial in range(trials):
        gain = np.exp(2j * np.pi * rng.uniform())
        uplink = Uplink(
            samples=gain * wave + complex_noise(wave.shape, variance, rng),
            positions=positions,
            frequencies=frequencies,
            user="a",
        )
        (path,) = refine_paths(uplink, truth[None] + rng.uniform(-1, 1, 2) * [5e-3, 5e-4])
        errors[trial] = [path.aoa - truth[0], path.path_length - truth[1]]
    bound = cramer_rao_bound(
        aoa=truth[0], path_length=truth[1], snr=snr, positions=positions, frequencies=frequencies
    )
    ratio = errors.var(axis=0) / np.diag(bound)
    bias = np.abs(errors.mean(axis=0)) / np.sqrt(np.diag(bound))
    # What was asked, 1.15 and 0.1, or four deviations of so many trials if these are more: of 2000,
    # a variance scatters by 3 % and a mean by 0.022 deviations.
    assert np.all(ratio < 1 + max(0.15, 4 * np.sqrt(2 / trials)))
    assert np.all(ratio > 1 - 4 * np.sqrt(2 / trials))
    assert np.all(bias < max(0.1, 4 / np.sqrt(trials)))


def test_the_reported_covariance_is_that_of_the_bound() -> None:
    rng = np.random.default_rng(3)
    positions, frequencies = linear_array(40), np.linspace(220e9, 295e9, 60)
    truth = np.array([np.radians(110.0), 0.45])
    wave = spherical_wave(np.array([*truth, 1.0, 0.0]), positions, frequencies)
    variance = float(np.mean(np.abs(wave) ** 2)) / 100
    uplink = Uplink(
        samples=wave + complex_noise(wave.shape, variance, rng),
        positions=positions,
        frequencies=frequencies,
        user="a",
    )
    (path,) = refine_paths(uplink, truth[None])
    bound = cramer_rao_bound(
        aoa=truth[0], path_length=truth[1], snr=100.0, positions=positions, frequencies=frequencies
    )
    # The noise is estimated from 2400 complex samples: 2 % of deviation, 4 of them.
    np.testing.assert_allclose(np.diag(path.covariance) / np.diag(bound), 1.0, atol=0.08)
