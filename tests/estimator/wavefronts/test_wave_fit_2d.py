from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.measurement.model import Uplink
from estimator.wavefronts.no_wave import NoWaveError
from estimator.wavefronts.wave_fit_2d import (
    SphericalWave,
    WaveStart,
    _linearised,
    fit_spherical_wave,
    fit_spherical_waves,
)
from estimator.wavefronts.wave_model_2d import wave_field

BAND = np.linspace(220e9, 295e9, 41)
GAIN = 0.3 - 0.2j


def elements(count: int = 40, spacing: float = 0.5e-3) -> Float[np.ndarray, "elements 3"]:
    positions = np.zeros((count, 3))
    positions[:, 0] = (np.arange(count) - (count - 1) / 2) * spacing
    return positions


POSITIONS = elements()
BEAM = speed_of_light / 295e9 / np.ptp(POSITIONS[:, 0])  # 0.052 rad
CELL = speed_of_light / 75e9  # 4 mm


def model(
    aoa: float, path_length: float, radius: float, gain: complex = GAIN
) -> Complex[np.ndarray, "elements freqs"]:
    """The wave written out: exp(-jk(r - R_c + R)), falling off from the array's centre."""
    source = radius * np.array([np.cos(aoa), np.sin(aoa), 0.0])
    distances = np.linalg.norm(source - POSITIONS, axis=-1)[:, None]
    wavenumbers = 2 * np.pi * BAND / speed_of_light
    phase = np.exp(-1j * wavenumbers * (distances - radius + path_length))
    return np.asarray(gain * radius / distances * phase)


def pilot(samples: Complex[np.ndarray, "elements freqs"]) -> Uplink:
    return Uplink(samples=samples, positions=POSITIONS, frequencies=BAND, user="a")


def test_the_models_field_is_that_of_a_source_delayed_to_the_path_length() -> None:
    field = wave_field(POSITIONS, BAND, aoa=1.2, path_length=0.9, radius=0.4)
    # 1e3 turns in double precision.
    np.testing.assert_allclose(GAIN * field, model(1.2, 0.9, 0.4), rtol=1e-11)
    # A direct path of the same radius is that of a point source at the array's centre.
    centre = wave_field(np.zeros((1, 3)), BAND, aoa=0.7, path_length=0.5, radius=0.5)[0]
    np.testing.assert_allclose(
        centre, np.exp(-2j * np.pi * BAND * 0.5 / speed_of_light), rtol=1e-11
    )


@settings(deadline=None, max_examples=25)
@given(
    aoa_deg=st.floats(35, 145),
    path_length=st.floats(0.3, 3.0),
    off_beam=st.floats(-0.35, 0.35),
    off_cell=st.floats(-0.35, 0.35),
)
def test_an_exact_wave_is_recovered_to_double_precision(
    aoa_deg: float, path_length: float, off_beam: float, off_cell: float
) -> None:
    aoa = np.radians(aoa_deg)
    wave = fit_spherical_wave(
        pilot(model(aoa, path_length, path_length)),
        # Somewhere in the main lobe, as the best point of a grid is.
        aoa=aoa + off_beam * BEAM / np.sin(aoa),
        path_length=path_length + off_cell * CELL,
    )
    assert wave.aoa == pytest.approx(aoa, abs=1e-12)
    assert wave.path_length == pytest.approx(path_length, abs=1e-12)
    assert wave.radius == wave.path_length
    # 1e-12 m at 295 GHz is 6e-9 rad.
    assert wave.gain == pytest.approx(GAIN, abs=1e-8)
    assert wave.explained == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(
    ("path_length", "radius"), [(0.9, 0.9), (0.9, 0.3), (0.6, 1.9)], ids=["user", "edge", "alias"]
)
def test_a_wave_of_another_curvature_is_recovered_with_it(
    path_length: float, radius: float
) -> None:
    wave = fit_spherical_wave(
        pilot(model(1.4, path_length, radius)),
        aoa=1.4 + 0.2 * BEAM,
        path_length=path_length - 0.2 * CELL,
        radius=1.2 * radius,
    )
    assert wave.aoa == pytest.approx(1.4, abs=1e-11)
    assert wave.path_length == pytest.approx(path_length, abs=1e-11)
    # The radius hangs on a sagitta of 0.05 mm: it is some R²/h² = 1e3 to 1e4 times less sure.
    assert wave.radius == pytest.approx(radius, rel=1e-7)


def test_a_scattered_wave_is_not_explained_with_the_curvature_of_its_delay() -> None:
    scattered = pilot(model(1.4, 0.9, 0.15))
    bound = fit_spherical_wave(scattered, aoa=1.4, path_length=0.9)
    free = fit_spherical_wave(scattered, aoa=1.4, path_length=0.9, radius=0.2)
    assert bound.explained < 0.98 < free.explained


def numeric_fisher(*, free: bool) -> Float[np.ndarray, "parameters parameters"]:
    """Fisher information per unit noise variance of (aoa, R[, R_c]), gain unknown too."""
    aoa, length = 1.3, 0.6

    def field(x: Float[np.ndarray, " parameters"]) -> Complex[np.ndarray, " samples"]:
        radius = x[2] if free else x[1]
        return model(x[0], x[1], radius, complex(x[-2], x[-1])).ravel()

    point = np.array([aoa, length, *([length] if free else []), GAIN.real, GAIN.imag])
    steps = np.array([1e-7, 1e-8, *([1e-6] if free else []), 1e-6, 1e-6])
    columns = [
        (field(point + step) - field(point - step)) / (2 * step.sum()) for step in np.diag(steps)
    ]
    jacobian = np.stack(columns, axis=-1)
    # Circular noise of variance 1: information 2·Re JᴴJ.
    return np.asarray(2 * np.real(jacobian.conj().T @ jacobian))


TRIALS = 150
"""The relative deviation of a variance from n trials is √(2/n): 8 %; four of them are 33 %."""

NOISE = 0.05  # standard deviation of each sample: 17 dB below the wave


@pytest.fixture(scope="module", params=[False, True], ids=["bound", "free"])
def trials(request: Any) -> tuple[bool, list[SphericalWave]]:
    rng, free = np.random.default_rng(8), bool(request.param)
    clean = pilot(model(1.3, 0.6, 0.6))
    waves = []
    for _ in range(TRIALS):
        parts = rng.standard_normal((2, *clean.samples.shape)) * NOISE / np.sqrt(2)
        one = replace(clean, samples=clean.samples + parts[0] + 1j * parts[1])
        waves.append(
            fit_spherical_wave(one, aoa=1.3, path_length=0.6, radius=0.6 if free else None)
        )
    return free, waves


def answers(waves: list[SphericalWave], *, free: bool) -> Float[np.ndarray, "trials parameters"]:
    rows = [[wave.aoa, wave.path_length, wave.radius][: 3 if free else 2] for wave in waves]
    return np.array(rows)


def test_the_scatter_comes_down_to_the_cramer_rao_bound(
    trials: tuple[bool, list[SphericalWave]],
) -> None:
    free, waves = trials
    size = 3 if free else 2
    bound = NOISE**2 * np.linalg.inv(numeric_fisher(free=free))[:size, :size]
    errors = answers(waves, free=free) - np.array([1.3, 0.6, 0.6])[:size]
    scatter = errors.T @ errors / TRIALS
    # In the bound's own axes, each direction is a variance of 150 trials, of expectation 1.
    white = np.linalg.inv(np.linalg.cholesky(bound))
    spread = np.linalg.eigvalsh(white @ scatter @ white.T)
    assert np.all(np.abs(spread - 1) <= 4 * np.sqrt(2 / TRIALS)), spread
    # No bias beyond four standard errors of the mean.
    deviations = np.sqrt(np.diag(bound) / TRIALS)
    assert np.all(np.abs(errors.mean(axis=0)) <= 4 * deviations)


def test_the_reported_covariance_is_that_of_the_scatter(
    trials: tuple[bool, list[SphericalWave]],
) -> None:
    free, waves = trials
    size = 3 if free else 2
    bound = NOISE**2 * np.linalg.inv(numeric_fisher(free=free))[:size, :size]
    reported = np.mean([wave.covariance for wave in waves], axis=0)
    white = np.linalg.inv(np.linalg.cholesky(bound))
    # What is left of noise's own variance in 37 modes of 40 elements, where it is above its
    # expectation: E max(χ²₇₄/74 − 1, 0) = 0.066, twice (amplitude and phase); one trial in a
    # hundred has more. Noise itself is known to a few parts in a hundred.
    spread = np.linalg.eigvalsh(white @ reported @ white.T)
    assert np.all((spread > 0.95) & (spread < 1.25)), spread


def test_the_reported_covariance_is_as_large_for_noise_that_hangs_together() -> None:
    # The same noise on ten neighbouring elements: a quarter as many independent ones.
    rng = np.random.default_rng(9)
    clean = pilot(model(1.3, 0.6, 0.6))
    waves = []
    for _ in range(150):
        parts = rng.standard_normal((2, 10, BAND.size)) * NOISE / np.sqrt(2)
        noise = np.repeat(parts[0] + 1j * parts[1], 4, axis=0)
        one = replace(clean, samples=clean.samples + noise)
        waves.append(fit_spherical_wave(one, aoa=1.3, path_length=0.6))
    errors = answers(waves, free=False) - np.array([1.3, 0.6])
    reported = np.mean([wave.covariance for wave in waves], axis=0)
    ratio = np.diag(reported) / np.mean(errors**2, axis=0)
    # White noise alone would be reported four times too small: 0.25. This noise is in the
    # amplitude as much as in the phase, while the bend of a mirror's wave is counted as phase
    # alone: twice too large at most, and 1.3 times for the few modes that tell it. A mean of
    # 150 is within 4·√(2/150) = 46 % of either.
    assert np.all((ratio > 0.54) & (ratio < 2 * 1.3 * 1.46)), ratio


@settings(deadline=None, max_examples=10)
@given(turn=st.floats(-np.pi, np.pi), scale=st.floats(1e-8, 1e3))
def test_gain_and_phase_of_the_receiver_do_not_move_the_answer(turn: float, scale: float) -> None:
    rng = np.random.default_rng(3)
    noise = 0.05 * (rng.standard_normal((2, 40, 41)) * [[[1]], [[1j]]]).sum(axis=0)
    samples = model(1.3, 0.6, 0.6) + noise
    first = fit_spherical_wave(pilot(samples), aoa=1.3, path_length=0.6)
    factor = scale * np.exp(1j * turn)
    other = fit_spherical_wave(pilot(factor * samples), aoa=1.3, path_length=0.6)
    # Both stop within 1e-4 standard deviations of the summit.
    deviation = np.sqrt(np.diag(first.covariance))
    assert abs(other.aoa - first.aoa) <= 2e-4 * deviation[0]
    assert abs(other.path_length - first.path_length) <= 2e-4 * deviation[1]
    np.testing.assert_allclose(other.covariance, first.covariance, rtol=1e-2)


def test_a_mirror_image_of_the_pilot_has_the_supplementary_angle() -> None:
    samples = model(1.2, 0.6, 0.6) + 0.01
    one = fit_spherical_wave(pilot(samples), aoa=1.2, path_length=0.6)
    other = fit_spherical_wave(pilot(samples[::-1].copy()), aoa=np.pi - 1.2, path_length=0.6)
    assert other.aoa == pytest.approx(np.pi - one.aoa, abs=1e-12)
    assert other.path_length == pytest.approx(one.path_length, abs=1e-12)


def test_a_start_far_from_any_peak_explains_next_to_nothing() -> None:
    # Between sidelobes the iteration climbs one of them, 13 dB and more down.
    clean = pilot(model(1.3, 0.6, 0.6))
    for beams in (-3.0, -2.75, -2.5, -2.25, 2.5, 4.5):
        for cells in (-2.0, -1.5, 0.0, 2.0):
            wave = fit_spherical_wave(clean, aoa=1.3 + beams * BEAM, path_length=0.6 + cells * CELL)
            assert wave.explained < 0.1


def test_a_fit_that_leaves_what_is_possible_finds_no_wave() -> None:
    rng = np.random.default_rng(0)
    noise = rng.standard_normal((40, 41)) + 1j * rng.standard_normal((40, 41))
    # An eighth of a cell before the array: the nearest summit of the noise is behind it.
    with pytest.raises(NoWaveError, match="no peak within two main lobes of"):
        fit_spherical_wave(pilot(noise), aoa=1.3, path_length=CELL / 8)


def test_noise_alone_has_no_peak_that_explains_it() -> None:
    rng = np.random.default_rng(2)
    noise = rng.standard_normal((40, 41)) + 1j * rng.standard_normal((40, 41))
    try:
        wave = fit_spherical_wave(pilot(noise), aoa=1.3, path_length=0.6)
    except NoWaveError:
        return
    # The maximum of n exponentials over n is ln(n)/n: 0.5 % of 1640 samples.
    assert wave.explained < 0.02


def test_the_likelihoods_curvature_is_that_of_differences() -> None:
    rng = np.random.default_rng(1)
    noise = 0.1 * (rng.standard_normal((40, 41)) + 1j * rng.standard_normal((40, 41)))
    samples = model(1.3, 0.8, 0.5) + model(1.35, 0.81, 0.81, gain=0.2j) + noise
    places = [np.array([1.302, 0.8003, 0.52]), np.array([1.349, 0.8099])]  # free, and bound
    state = _linearised(pilot(samples), 2 * np.pi * BAND / speed_of_light, places, [None, None])

    def half_energy(columns: Float[np.ndarray, " 9"]) -> float:
        """Half of what is left, with the amplitude ratios as they are."""
        left, first = samples.copy(), 0
        for gain, values in zip(state.gains, places, strict=True):
            step = columns[first : first + 2 + len(values)]
            first += len(step)
            before, after = (
                wave_field(POSITIONS, BAND, aoa=p[0], path_length=p[1], radius=p[-1])
                for p in (values, values + step[2:])
            )
            wave = after / np.abs(after) * np.abs(before)
            left -= gain * (1 + step[0] + 1j * step[1]) * wave
        return 0.5 * float(np.vdot(left, left).real)

    scale = 1 / np.sqrt(np.diag(state.normal))
    steps = np.diag(1e-3 * scale)
    differences = np.array(
        [
            [
                half_energy(a + b) - half_energy(a - b) - half_energy(b - a) + half_energy(-a - b)
                for b in steps
            ]
            for a in steps
        ]
    ) / (4e-6)
    scaled = state.hessian * np.outer(scale, scale)
    # Steps of 1e-3 of a column: the error of second differences is of the order of their squares,
    # times what the fourth derivative is larger.
    np.testing.assert_allclose(differences, scaled, atol=1e-4)
    assert np.abs(scaled - state.normal * np.outer(scale, scale)).max() > 1e-2


def test_two_waves_half_a_cell_apart_converge_to_a_summit_of_the_likelihood() -> None:
    rng = np.random.default_rng(3)
    noise = 0.02 * (rng.standard_normal((40, 41)) + 1j * rng.standard_normal((40, 41)))
    apart = 0.6 * BEAM
    samples = model(1.3, 0.8, 0.8) + model(1.3 + apart, 0.8, 0.8, gain=0.3 + 0.1j) + noise
    starts = [
        WaveStart(aoa=aoa + 0.2 * BEAM, path_length=0.8005, radius=0.8)
        for aoa in (1.3, 1.3 + apart)
    ]
    fitted = fit_spherical_waves(pilot(samples), starts)
    places = [np.array([one.aoa, one.path_length, one.radius]) for one in fitted.waves]
    state = _linearised(pilot(samples), 2 * np.pi * BAND / speed_of_light, places, [None, None])
    # The slope left would move no parameter by more than the step at which the fit ends.
    step = np.linalg.solve(state.hessian, state.scores.sum(axis=0))
    deviations = np.sqrt(
        np.diag(np.linalg.inv(state.normal)) * np.mean(np.abs(state.residual) ** 2) / 2
    )
    assert np.all(np.abs(step) < 0.02 * deviations)
