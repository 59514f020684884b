import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenes.schema.antenna import Antenna, Cosine, GaussianBeam, Horn, Isotropic
from simulator.antennas import field_pattern

POLAR_NODES = np.polynomial.legendre.leggauss(400)
BORESIGHT = np.array([0.0, 1.0, 0.0])


def towards(*angles: float) -> np.ndarray:
    """Directions in the plane z = 0 at an angle from the boresight."""
    angle = np.array(angles)
    return np.stack([np.sin(angle), np.cos(angle), np.zeros_like(angle)], axis=-1)


def radiated_power(antenna: Antenna) -> float:
    """Mean of the gain over the sphere, by Gauss-Legendre in the polar cosine about z.

    The aim is oblique to the grid, so nothing about the antenna's own axis is assumed.
    """
    cosine, weight = POLAR_NODES
    azimuth = 2 * np.pi * np.arange(800) / 800
    sine = np.sqrt(1 - cosine**2)
    directions = np.stack(
        [
            sine[:, None] * np.cos(azimuth),
            sine[:, None] * np.sin(azimuth),
            np.broadcast_to(cosine[:, None], (400, 800)),
        ],
        axis=-1,
    )
    gain = field_pattern.field_gain(antenna, np.array([0.3, -2.0, 1.1]), directions) ** 2
    return float(weight @ gain.mean(axis=1) / 2)


def test_an_isotropic_antenna_has_no_preferred_direction() -> None:
    gain = field_pattern.field_gain(Isotropic(), np.zeros(3), towards(0.0, 0.4, 2.0, np.pi))
    np.testing.assert_array_equal(gain, 1.0)


@given(sigma=st.floats(0.02, 1.0), turns=st.floats(0.0, 3.0))
def test_a_gaussian_beam_falls_to_the_closed_form_off_its_axis(sigma: float, turns: float) -> None:
    angle = min(turns * sigma, 3.1)
    antenna = GaussianBeam(kind="gaussian_beam", sigma_rad=sigma)
    field = field_pattern.field_gain(antenna, 2.5 * BORESIGHT, towards(angle))
    # The angle comes from a cosine, whose rounding moves the square of the angle by 4 eps.
    np.testing.assert_allclose(
        field, np.exp(-(angle**2) / (2 * sigma**2)), rtol=1e-14 / sigma**2 + 1e-14
    )


def test_the_peak_of_a_gaussian_beam_does_not_depend_on_its_width() -> None:
    for sigma in (0.05, 0.1, 0.5):
        antenna = GaussianBeam(kind="gaussian_beam", sigma_rad=sigma)
        assert field_pattern.field_gain(antenna, BORESIGHT, towards(0.0)) == 1.0


def test_a_horn_has_its_gain_on_axis_and_half_of_it_at_half_its_beam_width() -> None:
    antenna = Horn(kind="horn", gain_dbi=23.0)
    half_width = np.deg2rad(12.7) / 2
    gain_db = 20 * np.log10(field_pattern.field_gain(antenna, BORESIGHT, towards(0.0, half_width)))
    # 12.7 degrees is rounded to 0.05, which moves the -3 dB point by 2 * 3 dB * 0.05 / 12.7.
    np.testing.assert_allclose(gain_db - 23.0, [0.0, 10 * np.log10(0.5)], atol=0.025)
    assert np.rad2deg(field_pattern.horn_beam_width(23.0)) == pytest.approx(12.7, abs=0.05)


def test_the_main_beam_of_a_horn_holds_the_stated_part_of_its_power() -> None:
    # Small-angle closed form G sigma^2 / 4 = pi^2 / (16 ln 2); sin(x) < x takes sigma^2 / 6 off.
    antenna = Horn(kind="horn", gain_dbi=23.0)
    sigma = field_pattern.horn_beam_width(23.0) / (2 * np.sqrt(np.log(2)))
    expected = np.pi**2 / (16 * np.log(2)) * (1 - sigma**2 / 6)
    assert radiated_power(antenna) == pytest.approx(expected, rel=sigma**4)


@pytest.mark.parametrize("gain_dbi", [0.0, 6.0, 20.0])
def test_no_horn_radiates_more_than_it_is_fed(gain_dbi: float) -> None:
    assert 0.4 < radiated_power(Horn(kind="horn", gain_dbi=gain_dbi)) < 1


@pytest.mark.parametrize("exponent", [1.0, 2.0, 8.0, 30.5])
def test_a_cosine_antenna_radiates_all_its_power_in_front(exponent: float) -> None:
    antenna = Cosine(kind="cosine", exponent=exponent)
    # The kink at the equator limits the quadrature to about one cell, 1/400, times the
    # slope of the pattern there, which vanishes for exponents above 1.
    assert radiated_power(antenna) == pytest.approx(1.0, abs=4e-4)
    on_axis, behind = field_pattern.field_gain(antenna, BORESIGHT, towards(0.0, 2.0))
    assert on_axis**2 == pytest.approx(2 * (exponent + 1))
    assert behind == 0


def test_a_cosine_antenna_of_exponent_zero_fills_the_half_space_evenly() -> None:
    antenna = Cosine(kind="cosine", exponent=0.0)
    field = field_pattern.field_gain(antenna, BORESIGHT, towards(0.0, 1.5, 1.6, np.pi))
    np.testing.assert_allclose(field, [np.sqrt(2), np.sqrt(2), 0, 0])


def test_elevation_counts_as_much_as_azimuth() -> None:
    antenna = Horn(kind="horn", gain_dbi=20.0)
    up = np.array([[0.0, np.cos(0.2), np.sin(0.2)]])
    assert field_pattern.field_gain(antenna, BORESIGHT, up) == pytest.approx(
        field_pattern.field_gain(antenna, BORESIGHT, towards(0.2)), rel=1e-14
    )


def test_an_antenna_aimed_at_itself_is_refused() -> None:
    antenna = Horn(kind="horn", gain_dbi=20.0)
    with pytest.raises(ValueError, match=r"aim \[0\.0, 0\.0, 0\.0\] has no direction"):
        field_pattern.field_gain(antenna, np.zeros(3), towards(0.0))
