import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.constants import speed_of_light
from scipy.integrate import solve_ivp

from simulator.materials import fresnel_slab
from simulator.materials.fresnel_slab import Absorber, Conductor, Dielectric
from simulator.materials.permittivity import ConstantPermittivity, MaterialError

FREQUENCIES = np.linspace(220e9, 330e9, 1101)
COSINES = np.cos(np.deg2rad([0.0, 20.0, 45.0, 70.0, 85.0]))


def power(field: np.ndarray) -> np.ndarray:
    squared: np.ndarray = np.abs(field) ** 2
    return squared


def dielectric(value: complex, thickness: float) -> Dielectric:
    return Dielectric(permittivity=ConstantPermittivity(value=complex(value)), thickness=thickness)


def test_a_conductor_reflects_all_and_turns_the_field_across_the_plane_of_incidence() -> None:
    te, tm = fresnel_slab.reflection(Conductor(), FREQUENCIES, COSINES)
    np.testing.assert_array_equal(te, -1)
    np.testing.assert_array_equal(tm, 1)
    for coefficient in fresnel_slab.transmission(Conductor(), FREQUENCIES, COSINES):
        np.testing.assert_array_equal(coefficient, 0)


def test_an_absorber_returns_nothing_and_lets_nothing_through() -> None:
    for function in (fresnel_slab.reflection, fresnel_slab.transmission):
        for coefficient in function(Absorber(), FREQUENCIES, COSINES):
            assert coefficient.shape == (5, 1101)
            np.testing.assert_array_equal(coefficient, 0)


def test_a_dielectric_of_huge_loss_becomes_a_conductor() -> None:
    # |1 + r| ~ 2 cos / sqrt(eps) for TE, 2 / (cos sqrt(eps)) for TM, cos >= 0.08 here.
    te, tm = fresnel_slab.reflection(dielectric(1.0 - 1e12j, np.inf), FREQUENCIES, COSINES)
    np.testing.assert_allclose(te, -1, atol=2e-6)
    np.testing.assert_allclose(tm, 1, atol=2.0 / 0.087 * 1e-6)


def test_a_lossless_slab_ripples_as_the_airy_formula_says() -> None:
    index, thickness, angle = 1.6, 12.7e-3, np.deg2rad(30)
    te, _ = fresnel_slab.reflection(
        dielectric(index**2, thickness), FREQUENCIES, np.array([np.cos(angle)])
    )
    inner = np.sqrt(index**2 - np.sin(angle) ** 2)
    face = ((np.cos(angle) - inner) / (np.cos(angle) + inner)) ** 2
    finesse = 4 * face / (1 - face) ** 2
    ripple = finesse * np.sin(2 * np.pi * FREQUENCIES * inner * thickness / speed_of_light) ** 2
    # The phase reaches 300 rad, of which double precision keeps 1e-13.
    np.testing.assert_allclose(power(te[0]), ripple / (1 + ripple), atol=1e-12)


def test_the_ripple_of_a_slab_repeats_every_c_over_twice_its_optical_thickness() -> None:
    index, thickness = 1.6, 2e-3
    period = speed_of_light / (2 * index * thickness)
    frequencies = 250e9 + period * np.array([0.0, 0.3, 0.5, 1.0, 1.3, 1.5])
    for coefficient in fresnel_slab.reflection(
        dielectric(index**2, thickness), frequencies, np.ones(1)
    ):
        np.testing.assert_allclose(coefficient[0, :3], coefficient[0, 3:], rtol=1e-9)
        assert np.ptp(np.abs(coefficient)) > 0.1


def test_nothing_of_the_field_within_the_plane_is_reflected_at_brewsters_angle() -> None:
    value = 2.56
    cosine = np.cos(np.arctan(np.sqrt(value)))
    for thickness in (1e-3, np.inf):
        te, tm = fresnel_slab.reflection(
            dielectric(value, thickness), FREQUENCIES[500:501], np.array([cosine])
        )
        assert abs(tm[0, 0]) < 1e-14
        assert abs(te[0, 0]) > 0.1


def test_gypsum_at_45_degrees_reflects_horizontal_fields_twice_as_faintly_in_decibels() -> None:
    drywall = fresnel_slab.named_material("drywall", FREQUENCIES)
    te, tm = fresnel_slab.reflection(drywall, FREQUENCIES, np.cos([np.pi / 4]))
    # Rounded to 0.1 dB, for a lossless half space; loss and the far face add 0.05 dB.
    np.testing.assert_allclose(10 * np.log10(power(te)), -9.4, atol=0.1)
    np.testing.assert_allclose(10 * np.log10(power(tm)), -18.7, atol=0.1)
    # At 45 degrees r_TM = r_TE^2 for a half space; the far face adds what survives 25 mm.
    assert np.abs(tm - te**2).max() < 2e-3


def test_drywall_swallows_what_enters_it() -> None:
    drywall = fresnel_slab.named_material("drywall", np.array([275e9]))
    te, _ = fresnel_slab.transmission(drywall, np.array([275e9]), np.ones(1))
    loss_per_cm = -10 * np.log10(power(te[0, 0])) / 1.27
    assert 18 < loss_per_cm < 24  # 'some 20 dB/cm' and 0.5 dB for both faces


def slab_by_integration(
    value: complex, thickness: float, frequency: float, cosine: float, *, electric: bool
) -> tuple[complex, complex, float]:
    """Reflection, transmission and absorbed part of the power, by solving Maxwell's equations.

    Nothing of Fresnel: u = E_y (TE) or η0 H_y (TM) obeys (u'/p)' + k²(ε - sin²)/p u = 0 with
    p = 1 or ε. It is integrated from an outgoing wave at the far face to the near one.
    """
    wavenumber = 2 * np.pi * frequency / speed_of_light
    weight = 1.0 if electric else value
    sine_squared = 1 - cosine**2
    outgoing = -1j * wavenumber * cosine

    def derivative(_: float, state: np.ndarray) -> np.ndarray:
        field, flux, _absorbed = state  # flux = u' / p
        slope = -(wavenumber**2) * (value - sine_squared) / weight * field
        if electric:
            intensity = abs(field) ** 2
        else:  # E_x = j u' / (k ε), E_z = sin u / ε
            intensity = abs(flux / wavenumber) ** 2 + sine_squared * abs(field / value) ** 2
        return np.array([weight * flux, slope, wavenumber * -value.imag * intensity / cosine])

    solution = solve_ivp(
        derivative,
        (thickness, 0.0),
        np.array([1.0, outgoing, 0.0], dtype=complex),
        rtol=1e-11,
        atol=1e-13,
        method="DOP853",
    )
    field, flux, absorbed = solution.y[:, -1]
    incident = (field + flux / outgoing) / 2
    reflected = (field - flux / outgoing) / 2
    return reflected / incident, 1 / incident, -absorbed.real / abs(incident) ** 2


@settings(max_examples=25, deadline=None)
@given(
    real=st.floats(1.2, 8.0),
    loss=st.floats(0.0, 1.0),
    waves=st.floats(0.05, 4.0),
    degrees=st.floats(0.0, 85.0),
    electric=st.booleans(),
)
def test_what_a_slab_neither_reflects_nor_transmits_is_absorbed_inside_it(
    real: float, loss: float, waves: float, degrees: float, electric: bool
) -> None:
    frequency, cosine = 275e9, float(np.cos(np.deg2rad(degrees)))
    value, thickness = real - 1j * loss, waves * speed_of_light / frequency
    reflected, transmitted, absorbed = slab_by_integration(
        value, thickness, frequency, cosine, electric=electric
    )
    polarization = 0 if electric else 1
    slab = dielectric(value, thickness)
    arguments = (slab, np.array([frequency]), np.array([cosine]))
    r = fresnel_slab.reflection(*arguments)[polarization][0, 0]
    t = fresnel_slab.transmission(*arguments)[polarization][0, 0]
    assert power(r) + power(t) + absorbed == pytest.approx(1.0, abs=1e-8)  # of the integration
    # The magnetic field's own coefficient is that of the TM field in the signs used here.
    assert r == pytest.approx(reflected, abs=1e-8)
    assert t == pytest.approx(transmitted, abs=1e-8)


def test_an_infinitely_thick_slab_is_the_limit_of_thick_ones() -> None:
    thick = fresnel_slab.reflection(dielectric(2.0 - 0.1j, 0.2), FREQUENCIES, COSINES)
    opaque = fresnel_slab.reflection(dielectric(2.0 - 0.1j, np.inf), FREQUENCIES, COSINES)
    np.testing.assert_allclose(thick, opaque, atol=1e-14)  # 0.4 m at 140 Np/m and more


def test_a_vanishing_slab_is_not_there() -> None:
    arguments = (dielectric(3.0 - 0.1j, 1e-12), FREQUENCIES, COSINES)
    # Reflection is of the order k d (ε - 1) / cos.
    np.testing.assert_allclose(fresnel_slab.reflection(*arguments), 0, atol=7e3 * 1e-12 * 2 / 0.087)
    np.testing.assert_allclose(fresnel_slab.transmission(*arguments), 1, atol=1e-6)


@pytest.mark.parametrize("name", ["metal", "absorber", "drywall", "cardboard", "concrete", "wood"])
def test_every_named_material_is_passive_over_the_band(name: str) -> None:
    material = fresnel_slab.named_material(name, FREQUENCIES)
    reflected = fresnel_slab.reflection(material, FREQUENCIES, COSINES)
    transmitted = fresnel_slab.transmission(material, FREQUENCIES, COSINES)
    for r, t in zip(reflected, transmitted, strict=True):
        assert np.all(power(r) + power(t) <= 1 + 1e-12)


def test_a_thickness_of_ones_own_replaces_the_default() -> None:
    material = fresnel_slab.named_material("glass", np.array([60e9]), thickness=6e-3)
    assert isinstance(material, Dielectric)
    assert material.thickness == 6e-3


def test_an_unknown_material_is_refused_with_the_known_ones() -> None:
    with pytest.raises(MaterialError, match="unknown material 'cheese'; known: metal, absorber"):
        fresnel_slab.named_material("cheese", FREQUENCIES)


def test_a_slab_without_thickness_is_refused() -> None:
    with pytest.raises(MaterialError, match=r"thickness is 0\.0 m; it must be positive"):
        dielectric(2.0, 0.0)
