import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.imaging.backprojection import backproject
from validation.analytic.point_scatterer import complex_noise, point_echo, point_uplink

FREQUENCIES = np.linspace(220e9, 295e9, 201)
POSITIONS = np.stack([np.linspace(-0.02, 0.02, 30), np.zeros(30), np.zeros(30)], axis=1)


def test_a_sphere_of_known_cross_section_obeys_the_radar_equation() -> None:
    echo = point_echo(
        np.array([[0.0, 0.5, 0.0]]),
        positions=np.zeros((1, 3)),
        frequencies=np.array([3e11]),
        radar_cross_section=np.array([1e-4]),
    )
    # the power form of the textbook
    wavelength = speed_of_light / 3e11
    power = wavelength**2 * 1e-4 / ((4 * np.pi) ** 3 * 0.5**4)
    assert np.abs(echo.samples[0, 0]) ** 2 == pytest.approx(power, rel=1e-12)
    assert np.angle(echo.samples[0, 0] * np.exp(4j * np.pi * 0.5 / wavelength)) == pytest.approx(
        0.0, abs=1e-9
    )


def test_a_free_space_link_obeys_friis() -> None:
    uplink = point_uplink(
        np.array([[0.0, 2.0, 0.0]]), positions=np.zeros((1, 3)), frequencies=np.array([3e11])
    )
    assert np.abs(uplink.samples[0, 0]) == pytest.approx(
        speed_of_light / 3e11 / (4 * np.pi * 2.0), rel=1e-12
    )


def test_cylindrical_waves_spread_by_the_root_of_the_length() -> None:
    sources = np.array([[0.0, 0.5, 0.0]])
    near, far = (
        np.abs(
            point_uplink(
                scale * sources,
                positions=np.zeros((1, 3)),
                frequencies=np.array([3e11]),
                waves="cylindrical",
            ).samples[0, 0]
        )
        for scale in (1, 4)
    )
    assert near / far == pytest.approx(2.0)
    two_d, three_d = (
        point_echo(
            sources,
            positions=np.zeros((1, 3)),
            frequencies=np.array([3e11]),
            radar_cross_section=np.ones(1),
            waves=waves,
        ).samples[0, 0]
        for waves in ("cylindrical", "spherical")
    )
    assert two_d / three_d == pytest.approx(1.0)  # the root of 2 x 0.5 m


def test_position_phase_and_amplitude_come_back_from_the_image() -> None:
    # 0.05 cell, 5°, 0.2 dB over the image: the bounds.
    rng = np.random.default_rng(8)
    for target in rng.uniform([-0.1, 0.2, 0.0], [0.1, 0.35, 0.0], (12, 3)):
        phase = float(rng.uniform(-np.pi, np.pi))
        echo = point_echo(
            target[None],
            positions=POSITIONS,
            frequencies=FREQUENCIES,
            radar_cross_section=np.ones(1),
            phase=np.array([phase]),
        )
        cells = np.array([speed_of_light / (2 * 75e9), 1.17e-3 * target[1] / (2 * 0.04), 1.0])
        steps = np.linspace(-0.5, 0.5, 81)
        peaks = []
        along = target / np.linalg.norm(target)
        across = np.array([along[1], -along[0], 0.0])
        for direction, cell in ((along, cells[0]), (across, cells[1])):
            cut = np.abs(backproject(echo, target + (steps * cell)[:, None] * direction))
            peaks.append(steps[int(cut.argmax())])
        assert np.abs(peaks).max() <= 0.05
        value = backproject(echo, target[None])[0]
        assert abs(np.angle(value * np.exp(-1j * phase), deg=True)) < 5
        wavelength = speed_of_light / np.mean(FREQUENCIES)
        expected = wavelength / ((4 * np.pi) ** 1.5 * float(target @ target))
        assert abs(20 * np.log10(abs(value) / expected)) < 0.2


def test_noise_has_its_variance_in_each_complex_sample() -> None:
    noise = complex_noise((200_000,), 3.0, np.random.default_rng(1))
    # 1/√n of an exponential variable's deviation, four times
    assert np.mean(np.abs(noise) ** 2) == pytest.approx(3.0, rel=4 / np.sqrt(2e5))
