import numpy as np
import pytest

from simulator.receiver import impairments

FREQUENCIES = np.linspace(220e9, 295e9, 1001)


def delayed(delay: float, rows: int = 1) -> np.ndarray:
    return np.tile(np.exp(-2j * np.pi * FREQUENCIES * delay), (rows, 1))


def test_thermal_noise_lies_the_asked_ratio_below_the_mean_signal() -> None:
    rng = np.random.default_rng(1)
    samples = 1e-6 * (rng.standard_normal((260, 1001)) + 3j)
    noise = impairments.thermal_noise(samples, snr_db=20.0, rng=rng) - samples
    ratio = np.mean(np.abs(samples) ** 2) / np.mean(np.abs(noise) ** 2)
    # The mean of n exponential powers scatters by 1 / sqrt(n); five sigma.
    assert ratio == pytest.approx(100.0, rel=5 / np.sqrt(samples.size))


def test_thermal_noise_is_circular_and_white() -> None:
    samples = np.ones((200, 501), dtype=complex)
    noise = impairments.thermal_noise(samples, snr_db=0.0, rng=np.random.default_rng(2)) - samples
    scatter = 5 / np.sqrt(noise.size)
    assert abs(np.mean(noise**2)) < 2 * scatter
    assert abs(np.mean(noise)) < scatter
    assert abs(np.mean(noise[:, 1:] * noise[:, :-1].conj())) < scatter
    assert abs(np.mean(noise[1:] * noise[:-1].conj())) < scatter


def test_noise_below_a_signal_that_is_not_there_is_refused() -> None:
    with pytest.raises(ValueError, match=r"mean power is 0\.0: nothing reaches the antennas"):
        impairments.thermal_noise(
            np.zeros((2, 3), dtype=complex), snr_db=20.0, rng=np.random.default_rng(0)
        )


@pytest.mark.parametrize("correlation", [0.0, 4.0, 50.0])
def test_phase_noise_has_its_variance_and_correlation_and_leaves_amplitudes(
    correlation: float,
) -> None:
    samples = 2.0 * np.ones((400, 1001), dtype=complex)
    noisy = impairments.phase_noise(
        samples, rms=0.1, correlation=correlation, rng=np.random.default_rng(3)
    )
    np.testing.assert_allclose(np.abs(noisy), 2.0, rtol=1e-14)
    phase = np.angle(noisy).ravel()
    independent = phase.size / max(2 * correlation, 1)
    assert np.std(phase) == pytest.approx(0.1, rel=5 / np.sqrt(2 * independent))
    lag = 3
    expected = np.exp(-lag / correlation) if correlation else 0.0
    measured = np.mean(phase[lag:] * phase[:-lag]) / np.var(phase)
    assert measured == pytest.approx(expected, abs=5 / np.sqrt(independent))


def test_correlated_phase_noise_starts_at_full_strength() -> None:
    one = np.ones((1, 2), dtype=complex)
    first = [
        np.angle(
            impairments.phase_noise(one, rms=0.1, correlation=1e3, rng=np.random.default_rng(seed))[
                0, 0
            ]
        )
        for seed in range(2000)
    ]
    assert np.std(first) == pytest.approx(0.1, rel=5 / np.sqrt(2 * 2000))


def test_gain_ripple_is_a_fainter_copy_later_by_the_reciprocal_of_its_period() -> None:
    step = FREQUENCIES[1] - FREQUENCIES[0]
    period = FREQUENCIES.size * step / 20  # twenty whole ripples: the copy falls on bin 20
    rippled = impairments.gain_ripple(
        delayed(0.0, rows=3), FREQUENCIES, peak_db=0.5, period=period, rng=np.random.default_rng(4)
    )
    np.testing.assert_allclose(rippled, rippled[:1].repeat(3, axis=0), rtol=1e-15)
    response = np.abs(np.fft.ifft(rippled[0]))
    copy = 10 ** (0.5 / 20) - 1
    expected = np.zeros(FREQUENCIES.size)
    expected[[0, 20]] = 1, copy
    # Phases of 2 pi f / period reach 2e3 rad; double precision leaves 1e-12 of them.
    np.testing.assert_allclose(response, expected, atol=1e-11)
    crest_db = 20 * np.log10(np.abs(rippled).max())
    assert crest_db == pytest.approx(0.5, abs=0.5 * (np.pi / 50) ** 2 / 2)  # 50 points a ripple


@pytest.mark.parametrize("dimensions", [2, 3])
def test_jitter_moves_the_antennas_by_its_rms_and_within_their_plane(dimensions: int) -> None:
    nominal = np.zeros((20000, 3))
    moved = impairments.position_jitter(
        nominal, rms=1e-4, dimensions=dimensions, rng=np.random.default_rng(5)
    )
    spread = moved.std(axis=0)
    np.testing.assert_allclose(spread[:dimensions], 1e-4, rtol=5 / np.sqrt(2 * 20000))
    np.testing.assert_array_equal(spread[dimensions:], 0.0)


def test_a_clock_that_is_ahead_shortens_the_delay() -> None:
    seen = impairments.clock_offset(delayed(6e-9), FREQUENCIES, offset=1e-9)
    # Phases near 1e4 rad carry a rounding error of 1e-12 relative.
    np.testing.assert_allclose(seen, delayed(5e-9), atol=1e-10)


def test_the_rounding_error_lies_the_dynamic_range_below_the_strongest_sample() -> None:
    rng = np.random.default_rng(6)
    samples = rng.standard_normal((100, 1001)) + 1j * rng.standard_normal((100, 1001))
    error = impairments.limited_dynamic_range(samples, dynamic_range_db=60.0) - samples
    ratio = np.abs(samples).max() ** 2 / np.mean(np.abs(error) ** 2)
    assert 10 * np.log10(ratio) == pytest.approx(60.0, abs=0.1)  # 5/sqrt(n) is 0.07 dB


def test_an_echo_below_the_dynamic_range_is_lost() -> None:
    samples = np.array([1.0 + 0j, 1e-3])
    rounded = impairments.limited_dynamic_range(samples, dynamic_range_db=40.0)
    assert rounded[1] == 0
    assert impairments.limited_dynamic_range(samples, dynamic_range_db=80.0)[1] != 0


def test_silence_stays_silence() -> None:
    silence = np.zeros(4, dtype=complex)
    np.testing.assert_array_equal(
        impairments.limited_dynamic_range(silence, dynamic_range_db=60.0), silence
    )


def test_the_same_stream_gives_the_same_noise() -> None:
    samples = delayed(1e-9, rows=4)
    first, second = (
        impairments.thermal_noise(samples, snr_db=20.0, rng=np.random.default_rng(7))
        for _ in range(2)
    )
    assert first.tobytes() == second.tobytes()
