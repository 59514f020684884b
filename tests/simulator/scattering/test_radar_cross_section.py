"""Facets against series and closed forms: plate, sphere, cylinder, and the rough plate's loss."""

import numpy as np
import pytest
import trimesh
from scipy.constants import speed_of_light

from scenes.realisations.object_surface import Surface
from simulator.geometry.facets import surface_facets
from simulator.geometry.ray_scene import facets_visible
from simulator.scattering.physical_optics import scattered
from validation.analytic.canonical_scatterers import (
    cylinder_echo_over_series,
    facets_cross_section,
    half_shadowed_plate,
    mean_specular_field,
    plate_cross_section,
    plate_facets,
    ports,
    sphere_series,
)


@pytest.mark.parametrize("tilt_deg", [0.0, 30.0, 90.0])
def test_a_plates_pattern_is_within_a_fifth_of_a_decibel_down_to_25_decibels(
    tilt_deg: float,
) -> None:
    width, height, band = 30e-3, 20e-3, np.linspace(220e9, 295e9, 4)
    facets = plate_facets(width, height, step=0.25e-3)
    # 20 D²/λ with the diagonal: 25.6 m at the highest frequency.
    distance = 20 * (width**2 + height**2) * band[-1] / speed_of_light
    angles, tilt = np.radians(np.linspace(-25.0, 25.0, 121)), np.radians(tilt_deg)
    sideways = np.sin(angles)
    outward = np.stack([np.cos(tilt) * sideways, -np.cos(angles), np.sin(tilt) * sideways], axis=-1)
    wavelengths = speed_of_light / band
    expected = plate_cross_section((width, height), outward, wavelengths)
    measured = facets_cross_section(facets, outward, distance, band)
    above = expected > expected.max(axis=0) * 10**-2.5
    assert np.count_nonzero(above) > 40
    error_db = 10 * np.log10(measured[above] / expected[above])
    # The claim. A 40th of a wavelength of curvature at the corners explains it near the nulls.
    assert np.abs(error_db).max() <= 0.2
    # And the plate's peak itself: 4πA²/λ².
    peak_db = 10 * np.log10(measured[60] / (4 * np.pi * (width * height / wavelengths) ** 2))
    assert np.abs(peak_db).max() <= 0.01


def test_the_series_of_a_large_sphere_is_its_shadow_area() -> None:
    assert sphere_series(np.array([300.0]))[0] == pytest.approx(1.0, abs=0.01)
    # Rayleigh: 9 (ka)^4.
    assert sphere_series(np.array([0.01]))[0] == pytest.approx(9e-8, rel=1e-3)


def test_a_spheres_echo_is_that_of_its_series() -> None:
    radius, size = 0.02, np.linspace(20.0, 45.0, 101)
    band = size * speed_of_light / (2 * np.pi * radius)
    ball = trimesh.creation.icosphere(subdivisions=6, radius=radius)
    vertices = np.array(ball.vertices, dtype=np.float64)
    facets = surface_facets(
        Surface(
            name="ball",
            material="metal",
            vertices=vertices,
            mean_vertices=vertices,
            cells=np.array(ball.faces, dtype=np.int64),
            closed=True,
        )
    )
    assert facets.extent <= speed_of_light / band[-1] / 4
    outward = np.array([[0.3, -0.9, 0.1]]) / np.linalg.norm([0.3, -0.9, 0.1])
    measured = facets_cross_section(facets, outward, 40.0, band)[0] / (np.pi * radius**2)
    error_db = 10 * np.log10(measured / sphere_series(size))
    # Physical optics ends at the shadow's edge: 1/(2ka) of the field, 0.22 dB at 20.
    assert np.abs(error_db).max() <= 0.5


def test_a_cylinders_echo_is_that_of_its_series() -> None:
    assert 2 * np.pi * 220e9 / speed_of_light * 0.005 >= 20
    ratio = cylinder_echo_over_series()
    error_db = 20 * np.log10(np.abs(ratio))
    assert np.abs(error_db).max() <= 0.5
    # Its phase too: the shadow's edge and the next order in 1/ka = 0.04.
    assert np.abs(np.angle(ratio)).max() <= 0.06


@pytest.mark.slow
def test_a_rough_plates_mean_echo_falls_by_the_coherent_loss() -> None:
    # 20 plates of 50² patches (a correlation length each way): 5e4 independent patches.
    levels = np.array([0.0, 0.3, 0.6, 0.9, 1.2])  # k·rms·cosθ
    ratio = mean_specular_field(levels, side=50e-3, length=1e-3, draws=20)
    expected = np.exp(-2 * levels**2)
    # Half the square of a length decorrelates at 1.2: 5e4 of those leave 4 % of the field there.
    np.testing.assert_allclose(ratio, expected, rtol=0.1)


def test_a_rough_plate_with_traced_shadows_is_reciprocal() -> None:
    made = half_shadowed_plate()
    facets = made.facets
    assert facets is not None
    ends = np.array([[-0.15, 0.02, 0.05], [0.1, -0.03, -0.04]])
    one, other = (
        ports(end[None], facets, facets_visible(made.rays, facets, end[None])) for end in ends
    )
    assert 0.2 < one.visible.mean() < 0.95
    there = scattered(facets, one, other, made.scenario.radio.frequencies, waves="spherical")
    back = scattered(facets, other, one, made.scenario.radio.frequencies, waves="spherical")
    assert np.linalg.norm(there - back) <= 1e-6 * np.linalg.norm(there)
