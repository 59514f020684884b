import numpy as np
import pytest
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.channel.steering import angle_spectrum, plane_steering, spherical_steering
from estimator.measurement.model import MeasurementError, Uplink

FREQUENCY = 220e9
WAVENUMBER = 2 * np.pi * FREQUENCY / speed_of_light


def linear_array(count: int) -> Float[np.ndarray, "elements 3"]:
    positions = np.zeros((count, 3))
    positions[:, 0] = (np.arange(count) - (count - 1) / 2) * 0.5e-3
    return positions


@pytest.mark.parametrize("count", [259, 260])
def test_the_spherical_vector_is_3_8_and_3_10_with_the_minus_sign(count: int) -> None:
    positions, aoa, distance = linear_array(count), np.radians(70), 1.8
    d = positions[:, 0]
    length = np.sqrt(distance**2 - 2 * d * distance * np.cos(aoa) + d**2)
    expected = distance / length * np.exp(-1j * WAVENUMBER * (length - distance))
    point = distance * np.array([np.cos(aoa), np.sin(aoa), 0.0])
    found = spherical_steering(point, positions, FREQUENCY)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_the_plane_vector_is_the_spherical_one_far_away() -> None:
    positions, aoa = linear_array(64), np.radians([20.0, 90.0, 110.0])
    far = 1e5 * np.stack([np.cos(aoa), np.sin(aoa), np.zeros(3)], axis=1)
    np.testing.assert_allclose(
        plane_steering(aoa, positions, FREQUENCY),
        spherical_steering(far, positions, FREQUENCY),
        atol=2e-5,  # kD²/8R
    )


def test_any_layout_has_a_vector() -> None:
    rng = np.random.default_rng(0)
    positions = rng.uniform(-0.05, 0.05, (30, 3))
    point = np.array([0.3, 0.5, -0.2])
    centre = positions.mean(axis=0)
    reference = np.linalg.norm(point - centre)
    length = np.linalg.norm(point - positions, axis=1)
    np.testing.assert_allclose(
        spherical_steering(point, positions, FREQUENCY),
        reference / length * np.exp(-1j * WAVENUMBER * (length - reference)),
        atol=1e-9,
    )


def uplink_from(aoa: float, distance: float) -> Uplink:
    positions = linear_array(260)
    source = distance * np.array([np.cos(aoa), np.sin(aoa), 0.0])
    length = np.linalg.norm(source - positions, axis=1)
    samples = (distance / length * np.exp(-1j * WAVENUMBER * length))[:, None]
    return Uplink(samples=samples, positions=positions, frequencies=np.array([FREQUENCY]), user="a")


@pytest.mark.parametrize("aoa_deg", [90.0, 70.0])
def test_the_near_user_appears_at_its_angle_only_in_spherical_waves(aoa_deg: float) -> None:
    # Thesis figures 4.3 to 4.5: 1.8 m, 13 cm at 220 GHz; 0.01° is the bound.
    grid = np.radians(aoa_deg + np.arange(-3, 3, 0.005))
    uplink = uplink_from(np.radians(aoa_deg), 1.8)
    near = np.abs(angle_spectrum(uplink, grid, frequency=FREQUENCY, distance=1.8))
    plane = np.abs(angle_spectrum(uplink, grid, frequency=FREQUENCY))
    assert abs(np.degrees(grid[near.argmax()]) - aoa_deg) <= 0.01
    assert near.max() == pytest.approx(1.0, abs=1e-6)
    # The wavefront bends by 6 rad over the array: a plane wave loses most of the amplitude.
    assert plane.max() < 0.6


@pytest.mark.parametrize("aoa_deg", [90.0, 70.0])
def test_at_20_m_both_models_agree_at_the_peak(aoa_deg: float) -> None:
    grid = np.radians(aoa_deg + np.arange(-1, 1, 0.005))
    uplink = uplink_from(np.radians(aoa_deg), 20.0)
    near = np.abs(angle_spectrum(uplink, grid, frequency=FREQUENCY, distance=20.0))
    plane = np.abs(angle_spectrum(uplink, grid, frequency=FREQUENCY))
    for spectrum in (near, plane):
        assert abs(np.degrees(grid[spectrum.argmax()]) - aoa_deg) <= 0.01
    assert plane.max() == pytest.approx(near.max(), abs=0.03)  # π/8·24.8/20 bends it by 28°


def test_impossible_spectra_are_refused() -> None:
    uplink = uplink_from(1.0, 1.8)
    with pytest.raises(MeasurementError, match="outside the sweep"):
        angle_spectrum(uplink, np.array([1.0]), frequency=1e9)
    with pytest.raises(MeasurementError, match="lies on an element"):
        spherical_steering(uplink.positions[3], uplink.positions, FREQUENCY)
