import math

import numpy as np
import pytest
from scipy.constants import speed_of_light

from simulator.materials.fresnel_slab import (
    Absorber,
    Conductor,
    Dielectric,
    named_material,
    reflection,
    slab,
)
from simulator.materials.permittivity import ConstantPermittivity, MaterialError
from simulator.materials.sionna_materials import (
    ABSORBER_WAVELENGTHS,
    radio_material,
    scattering_coefficient,
    sionna_slab,
)

FREQUENCY = 275e9


def permittivity(made: tuple[float, float, float, float], frequency: float) -> np.ndarray:
    """Sionna's own relation (its equation for η): ε' - j conductivity/(ωε₀)."""
    loss = made[1] / (2 * math.pi * frequency * 8.8541878128e-12)
    return np.array([made[0] - 1j * loss])


@pytest.mark.parametrize("angle_deg", [0.0, 45.0, 70.0])
def test_what_is_not_scattered_is_the_coherent_loss_of_a_rough_surface(angle_deg: float) -> None:
    rms, angle = 0.15e-3, math.radians(angle_deg)
    wavenumber = 2 * math.pi * FREQUENCY / speed_of_light
    coherent = math.exp(-2 * (wavenumber * rms * math.cos(angle)) ** 2)  # design, section 3
    scattered = scattering_coefficient(rms, FREQUENCY, angle=angle)
    assert math.sqrt(1 - scattered**2) == pytest.approx(coherent, rel=1e-12)


def test_a_smooth_surface_scatters_nothing_and_a_very_rough_one_everything() -> None:
    assert scattering_coefficient(0.0, FREQUENCY) == 0.0
    assert scattering_coefficient(5e-3, FREQUENCY) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("name", ["drywall", "wood", "concrete", "cardboard"])
@pytest.mark.parametrize("cosine", [1.0, math.sqrt(0.5)])
def test_a_slab_of_sionna_reflects_as_ours_does(name: str, cosine: float) -> None:
    frequencies = np.array([FREQUENCY])
    ours = named_material(name, frequencies)
    made = sionna_slab(ours, FREQUENCY)
    theirs, _ = slab(permittivity(made, FREQUENCY), made.thickness, frequencies, np.array([cosine]))
    expected = reflection(ours, frequencies, np.array([cosine]))
    # A half space becomes a layer with 60 dB of loss each way; twice through it and the far
    # face leave 1e-6.
    np.testing.assert_allclose(theirs.te, expected.te, atol=2e-6)
    np.testing.assert_allclose(theirs.tm, expected.tm, atol=2e-6)


def test_a_metal_reflects_all_but_what_ten_megasiemens_lose() -> None:
    made = sionna_slab(Conductor(), FREQUENCY)
    back, _ = slab(
        permittivity(made, FREQUENCY), made.thickness, np.array([FREQUENCY]), np.array([1.0])
    )
    # |R| = 1 - 2 √(ε₀ω/(2·conductivity)): 0.18 % at 275 GHz
    assert abs(back.te[0, 0]) == pytest.approx(1.0, abs=2.5e-3)


def test_an_absorber_neither_reflects_nor_transmits() -> None:
    made = sionna_slab(Absorber(), FREQUENCY)
    assert made.thickness == pytest.approx(ABSORBER_WAVELENGTHS * speed_of_light / FREQUENCY)
    back, through = slab(
        permittivity(made, FREQUENCY),
        made.thickness,
        np.array([FREQUENCY]),
        np.array([1.0, math.sqrt(0.5)]),
    )
    assert 20 * np.log10(np.abs(back.te).max()) < -45.0
    assert 20 * np.log10(np.abs(through.te).max()) < -120.0
    assert made.scattering_coefficient == 0.0


def test_an_opaque_material_without_loss_is_no_layer() -> None:
    glassy = Dielectric(permittivity=ConstantPermittivity(value=4.0 + 0j), thickness=math.inf)
    with pytest.raises(MaterialError, match="give it a loss or a thickness"):
        sionna_slab(glassy, FREQUENCY)


def test_a_radio_material_outside_of_a_scene_keeps_sionnas_defaults() -> None:
    made = radio_material("/wall", Conductor(), rms_height=0.1e-3)
    made.frequency_update()
    assert made.scattering_coefficient[0] == 0.0
