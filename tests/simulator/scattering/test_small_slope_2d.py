"""The small-slope approximation against limits and conservation laws that it must keep."""

import numpy as np
import pytest
from scipy.constants import speed_of_light

from scenes.schema.radio import Polarization
from simulator.materials.fresnel_slab import Conductor, Dielectric, Material
from simulator.materials.permittivity import ConstantPermittivity
from simulator.scattering.small_slope_2d import RoughLine, echo_weights, extended, kernels

FREQUENCY = 260e9
WAVELENGTH = speed_of_light / FREQUENCY
NODES = np.array([FREQUENCY])
POLARIZATIONS: tuple[Polarization, ...] = ("vertical", "horizontal")


def half_space(permittivity: complex) -> Dielectric:
    return Dielectric(permittivity=ConstantPermittivity(value=permittivity), thickness=np.inf)


def ways(sine: float) -> tuple[np.ndarray, np.ndarray]:
    return np.array([sine]), np.array([np.sqrt(1 - sine**2)])


def line(
    heights: np.ndarray, step: float, material: Material, polarization: Polarization
) -> RoughLine:
    return RoughLine(
        heights=heights,
        step=step,
        closed=True,
        material=material,
        polarization=polarization,
        nodes=NODES,
    )


@pytest.mark.parametrize("polarization", POLARIZATIONS)
@pytest.mark.parametrize("material", [Conductor(), half_space(2.5 - 0.1j)])
def test_towards_the_mirror_a_slight_wave_and_a_tangent_plane_scatter_alike(
    material: Material, polarization: Polarization
) -> None:
    both = kernels(material, ways(-0.6), ways(0.6), NODES, polarization=polarization)
    np.testing.assert_allclose(both.bragg, both.mirror, rtol=1e-12)


@pytest.mark.parametrize("polarization", POLARIZATIONS)
def test_a_dielectric_of_large_permittivity_scatters_as_a_conductor(
    polarization: Polarization,
) -> None:
    x = np.arange(256) / 256
    heights = 0.05 * WAVELENGTH * np.cos(2 * np.pi * x)
    found = [
        line(heights, 4 * WAVELENGTH / 256, material, polarization).weights(
            ways(0.3), ways(0.5), side=1.0, monostatic=False
        )
        for material in (half_space(1e10 + 0j), Conductor())
    ]
    if polarization == "horizontal":  # a dielectric's second order is left out there
        found = [np.broadcast_to(part.mean(), part.shape) for part in found]
    # Fields enter by 1/√ε.
    np.testing.assert_allclose(found[0], found[1], atol=1e-4)


@pytest.mark.parametrize("polarization", POLARIZATIONS)
@pytest.mark.parametrize("material", [Conductor(), half_space(2.5 - 0.1j)])
def test_weights_do_not_tell_which_end_transmits(
    material: Material, polarization: Polarization
) -> None:
    heights = 1e-4 * np.random.default_rng(1).standard_normal(200)
    rough = line(heights, 2e-4, material, polarization)
    there = rough.weights(ways(0.2), ways(-0.7), side=1.0, monostatic=False)
    back = rough.weights(ways(-0.7), ways(0.2), side=1.0, monostatic=False)
    np.testing.assert_allclose(there, back, rtol=1e-10)


@pytest.mark.parametrize("polarization", POLARIZATIONS)
@pytest.mark.parametrize("material", [Conductor(), half_space(2.5 - 0.1j)])
def test_a_flat_surface_that_is_moved_stays_a_flat_surface(
    material: Material, polarization: Polarization
) -> None:
    moved, still = (
        line(np.full(64, height), 2e-4, material, polarization).weights(
            ways(0.2), ways(-0.7), side=1.0, monostatic=False
        )
        for height in (1e-4, 0.0)
    )
    # In the horizontal polarization waves along a conductor are damped, by 1e-3 of q².
    np.testing.assert_allclose(moved, still, rtol=3e-3 if polarization == "horizontal" else 1e-10)


@pytest.mark.parametrize(("polarization", "tolerance"), [("vertical", 1e-5), ("horizontal", 1e-4)])
def test_a_corrugated_conductor_returns_all_power(
    polarization: Polarization, tolerance: float
) -> None:
    # Floquet orders of a plane wave; what is left out is of the fourth order of heights (1e-6),
    # and in the horizontal polarization the damping of waves along the surface, 1e-3 of 0.02.
    period, sine, depth = 1.7 * WAVELENGTH, 0.35, 0.006 * WAVELENGTH
    count = 512
    x = period * np.arange(count) / count
    heights = depth * np.cos(2 * np.pi * x / period)
    rough = line(heights, period / count, Conductor(), polarization)
    wavenumber = 2 * np.pi / WAVELENGTH
    power = {}
    for order in range(-6, 7):
        out = -sine + order * WAVELENGTH / period  # towards the receiver
        if abs(out) >= 1:
            continue
        there = ways(sine), ways(out)
        weights = rough.weights(*there, side=1.0, monostatic=False)[0]
        total = there[0][1] + there[1][1]
        phase = np.exp(1j * wavenumber * (total * heights + (sine + out) * x))
        amplitude = (weights * phase).mean() / (2 * there[1][1][0])
        power[order] = abs(amplitude) ** 2 * there[1][1][0] / there[0][1][0]
    scattered = sum(value for order, value in power.items() if order != 0)
    assert scattered > 20 * tolerance
    assert sum(power.values()) == pytest.approx(1.0, abs=tolerance)


def test_small_heights_echo_by_the_cosine_squared() -> None:
    # Perturbation theory of small heights: 2 cos²θ for the vertical polarization and
    # 2 (1 + sin²θ) for the horizontal one, where the tangent plane has 2 at any angle.
    for sine in (0.34, 0.71, 0.94):
        vertical, horizontal = (
            kernels(Conductor(), ways(sine), ways(sine), NODES, polarization=one).bragg[0, 0]
            for one in POLARIZATIONS
        )
        assert vertical == pytest.approx(-2 * (1 - sine**2))
        assert horizontal == pytest.approx(2 * (1 + sine**2))


def test_the_grid_of_directions_gives_what_each_direction_gives() -> None:
    heights = 5e-5 * np.convolve(
        np.random.default_rng(3).standard_normal(400), np.hanning(9), "same"
    )
    rough = line(heights, 7.5e-5, Conductor(), "vertical")
    some = np.arange(100, 300)
    found = echo_weights(rough, side=1.0)(np.full(some.size, 0.4137), some)
    exact = rough.weights(ways(0.4137), ways(0.4137), side=1.0, monostatic=True)[:, some]
    assert np.linalg.norm(found - exact) < 2e-3 * np.linalg.norm(exact)


def test_a_line_goes_on_beyond_its_ends_without_a_kink() -> None:
    # Facets' centres on a straight slope that ends at height 0: beyond, it is that slope still.
    step, slope = 1e-5, 0.2
    heights = slope * step * (np.arange(400) - 399.5)
    after = extended(heights, step)[395:405]
    before = np.roll(extended(heights[::-1], step), 5)[:10]
    for joint in (after, before[::-1]):
        # The fade over 10 mm takes (π/2 · 5/400)² of the last heights: less than 0.1 %.
        np.testing.assert_allclose(np.diff(joint), slope * step, rtol=1e-3)
