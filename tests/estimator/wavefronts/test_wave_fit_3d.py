import numpy as np
import pytest
from jaxtyping import Float

from estimator.measurement.model import Echo, Uplink
from estimator.wavefronts.curvature_search_3d import search_wavefront
from estimator.wavefronts.no_wave import NoWaveError
from estimator.wavefronts.wave_fit_3d import Wavefront, fit_wavefront, towards, wavefront_field
from validation.analytic.point_scatterer import complex_noise, point_echo, point_uplink

BAND = np.linspace(57e9, 64e9, 36)


def planar_array(count: int = 12, spacing: float = 5e-3) -> Float[np.ndarray, "elements 3"]:
    places = (np.arange(count) - (count - 1) / 2) * spacing
    x, z = np.meshgrid(places, places, indexing="ij")
    return np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=-1)


def flat_echo(normal: Float[np.ndarray, " 3"], distance: float) -> Echo:
    """Echo of an endless wall: each element sees its own image in it."""
    positions = planar_array()
    images = positions + 2 * (distance - positions @ normal)[:, None] * normal
    lengths = np.linalg.norm(images - positions, axis=1)
    phase = -2j * np.pi * np.outer(lengths, BAND / 299792458.0)
    return Echo(samples=np.exp(phase) / lengths[:, None], positions=positions, frequencies=BAND)


def test_a_source_near_the_array_is_found_exactly_without_noise() -> None:
    source = np.array([0.25, 1.1, -0.2])
    distance = float(np.linalg.norm(source))
    uplink = point_uplink(source[None], positions=planar_array(), frequencies=BAND)
    cosines = (source[0] / distance + 0.01, source[2] / distance - 0.008)
    wave = fit_wavefront(uplink, cosines=cosines, path_length=distance + 0.008)
    # A hundredth of a deviation ends the iteration, and without noise that is rounding.
    np.testing.assert_allclose(wave.path_length * wave.direction, source, atol=1e-6)
    free = fit_wavefront(
        uplink, cosines=cosines, path_length=distance + 0.008, curvature=0.7 / distance
    )
    assert free.curvature == pytest.approx(1 / distance, rel=1e-3)
    residual = uplink.samples - wavefront_field(uplink.positions, BAND, free)
    # The gain's λ/4πR is fitted by its mean over the band: ±6 % at its ends.
    assert np.linalg.norm(residual) < 0.05 * np.linalg.norm(uplink.samples)


def test_the_echo_of_a_wall_met_head_on_is_flat_and_gives_its_plane() -> None:
    normal = towards(0.08, -0.05)
    echo = flat_echo(normal, 1.3)
    start = search_wavefront(echo, cosines=(0.06, -0.04), path_length=1.31)
    wave = fit_wavefront(
        echo, cosines=start.cosines, path_length=start.path_length, curvature=start.curvature
    )
    np.testing.assert_allclose(wave.direction, normal, atol=1e-5)
    assert wave.path_length == pytest.approx(1.3, abs=1e-5)
    assert abs(wave.curvature) < 1e-2 / 1.3


def test_the_echo_of_a_point_has_the_curvature_of_its_distance() -> None:
    target = np.array([0.1, 1.2, 0.05])
    distance = float(np.linalg.norm(target))
    echo = point_echo(
        target[None],
        positions=planar_array(),
        frequencies=BAND,
        radar_cross_section=np.array([1e-2]),
    )
    cosines = (target[0] / distance, target[2] / distance)
    wave = fit_wavefront(echo, cosines=cosines, path_length=distance, curvature=0.5 / distance)
    assert wave.curvature == pytest.approx(1 / distance, rel=1e-3)


def test_in_white_noise_the_errors_have_the_covariance_that_is_claimed() -> None:
    source = np.array([-0.2, 1.5, 0.3])
    distance = float(np.linalg.norm(source))
    clean = point_uplink(source[None], positions=planar_array(), frequencies=BAND)
    rng = np.random.default_rng(4)
    variance = float(np.mean(np.abs(clean.samples) ** 2))  # 0 dB in each sample
    squares = []
    for _ in range(40):
        noise = complex_noise(clean.samples.shape, variance, rng)
        noisy = Uplink(
            samples=clean.samples + noise,
            positions=clean.positions,
            frequencies=BAND,
            user="user",
        )
        cosines = (source[0] / distance, source[2] / distance)
        wave = fit_wavefront(noisy, cosines=cosines, path_length=distance)
        error = np.array([*wave.cosines, wave.path_length])
        error -= np.array([*cosines, distance])
        squares.append(error @ np.linalg.solve(wave.covariance, error))
    # χ² of 3 over 40 trials has a mean of 3 ± 0.39; the sandwich of 25 tiles scatters by itself
    # and widens it to Hotelling's 3·20/(20 − 4). Four deviations of the mean around that.
    assert 2.0 < np.mean(squares) < 5.4


def test_a_curvature_inside_of_the_aperture_is_refused() -> None:
    source = np.array([[0.3, 1.0, 0.0]])
    uplink = point_uplink(source, positions=planar_array(), frequencies=BAND)
    with pytest.raises(NoWaveError, match="runs off"):
        fit_wavefront(uplink, cosines=(0.29, 0.0), path_length=1.04, curvature=30.0)


def test_a_waves_field_is_the_point_sources() -> None:
    source = np.array([0.1, 0.9, 0.2])
    distance = float(np.linalg.norm(source))
    positions = planar_array()
    wave = Wavefront(
        cosines=(source[0] / distance, source[2] / distance),
        path_length=distance,
        curvature=1 / distance,
        gain=1.0 + 0.0j,
        covariance=np.zeros((3, 3)),
        explained=1.0,
        passes=1,
    )
    lengths = np.linalg.norm(source - positions, axis=1)
    expected = (
        distance / lengths[:, None] * np.exp(-2j * np.pi * np.outer(lengths, BAND / 299792458.0))
    )
    np.testing.assert_allclose(wavefront_field(positions, BAND, wave), expected, atol=1e-9)
