"""A slab between two points, against the exact integral over plane waves."""

import numpy as np
import pytest
from scipy.constants import speed_of_light

from simulator.materials.fresnel_slab import Dielectric
from simulator.materials.permittivity import ConstantPermittivity
from simulator.materials.slab_insertion import (
    Crossing,
    bent_rays,
    passage_level,
    passage_nodes,
    through_slabs,
    transported_through,
)

NORMAL = np.array([0.0, 1.0, 0.0])


def slab(thickness: float, permittivity: complex = 2.7 - 0.05j) -> Dielectric:
    return Dielectric(permittivity=ConstantPermittivity(value=permittivity), thickness=thickness)


def exact_insertion(
    material: Dielectric, angle: float, length: float, frequency: float, *, vertical: bool
) -> complex:
    """Divide the field of a line source behind a slab by that without it.

    Both are integrals over plane waves exp(-jk(x sin a + y cos a)), along a path into the complex
    plane of a on which they fall off; the slab's coefficient is worked out from its two faces by
    transfer matrices, not by the simulator's formula.
    """
    wavenumber = 2 * np.pi * frequency / speed_of_light
    permittivity = material.permittivity(np.array([frequency]))[0]
    # Steepest descent for the distance alone: a = angle + t - j·gd(t), of a plane wave's phase
    # k·L·cos(a - angle); T varies slowly beside it.
    steps = np.linspace(-1.2, 1.2, 40001)
    descent = np.arctan(np.sinh(steps))  # Gudermann
    path = angle + descent + 1j * steps
    slope = 1 / np.cosh(steps) + 1j
    wave = np.exp(-1j * wavenumber * length * np.cos(path - angle))
    cosine, inner = np.cos(path), np.sqrt(permittivity - np.sin(path) ** 2)
    once = wavenumber * material.thickness * inner
    ratio = inner / cosine if vertical else inner / (permittivity * cosine)
    through = 1 / (np.cos(once) + 0.5j * (ratio + 1 / ratio) * np.sin(once))
    through = through * np.exp(1j * wavenumber * material.thickness * cosine)
    with_slab, without = (np.sum(wave * one * slope) for one in (through, np.ones_like(wave)))
    return complex(with_slab / without)


@pytest.mark.parametrize("vertical", [True, False])
@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 60.0])
@pytest.mark.parametrize(("thickness", "frequency"), [(12.7e-3, 60e9), (4e-3, 28e9), (2e-3, 300e9)])
def test_behind_a_slab_the_field_is_that_of_all_plane_waves(
    vertical: bool, angle_deg: float, thickness: float, frequency: float
) -> None:
    length, angle = 1.5, np.radians(angle_deg)
    material = slab(thickness)
    expected = exact_insertion(material, angle, length, frequency, vertical=vertical)
    direction = np.array([[np.sin(angle), np.cos(angle), 0.0]])
    found = through_slabs(
        (Crossing(material, NORMAL),),
        direction,
        np.array([length]),
        np.array([frequency]),
        vertical=vertical,
        cylindrical=True,
    )[0, 0]
    # Left out: waves that run to and fro within are shifted by 2s more, and so k(2s)²/2L nearer;
    # r² = 0.2 of the field at 60°, less elsewhere. 1e-3: of the second order in d/L.
    shift = thickness * np.sin(angle) * (1 - np.cos(angle) / np.sqrt(2.7 - np.sin(angle) ** 2))
    apart = 2 * np.pi * frequency / speed_of_light * (2 * shift) ** 2 / (2 * length)
    assert abs(found / expected - 1) <= 0.2 * apart + 1e-3


def test_a_thick_slab_shifts_a_ray_sideways_as_snell_says() -> None:
    material, angle = slab(0.1, 4.0 + 0j), np.radians(45.0)
    direction = np.array([[np.sin(angle), np.cos(angle), 0.0]])
    bent = bent_rays((Crossing(material, NORMAL),), direction, np.array([20.0]), 60e9)
    inner = np.arcsin(np.sin(angle) / 2)
    shift = 0.1 * np.sin(angle - inner) / np.cos(inner)
    turned = np.arctan2(bent.directions[0, 0], bent.directions[0, 1]) - angle
    assert turned == pytest.approx(shift / 20.0, rel=1e-4)  # the tangent for its angle


def test_two_slabs_are_one_after_the_other() -> None:
    one, other = slab(4e-3), slab(2e-3, 5.0 - 0.3j)
    ways = np.array([[0.6, 0.8, 0.0]]), np.array([1e6])  # so far away that nothing bends
    frequencies = np.linspace(28e9, 30e9, 5)
    how = {"vertical": True, "cylindrical": False}
    parts = [
        through_slabs((Crossing(material, NORMAL),), *ways, frequencies, **how)
        for material in (one, other)
    ]
    both = through_slabs(
        (Crossing(one, NORMAL), Crossing(other, -NORMAL)), *ways, frequencies, **how
    )
    assert np.allclose(both, parts[0] * parts[1], rtol=1e-6)


def test_each_polarization_has_its_own_transmission_in_space() -> None:
    crossing = Crossing(slab(6e-3), NORMAL)
    direction, lengths = np.array([[0.6, 0.8, 0.0]]), np.array([2.0])
    frequencies = np.array([60e9, 61e9])
    for vertical, field in ((True, [0.0, 0.0, 1.0]), (False, [0.8, -0.6, 0.0])):
        sent = np.tile(np.array(field) + 0j, (1, 2, 1))
        arrived = transported_through((crossing,), direction, lengths, frequencies, sent)
        factor = through_slabs(
            (crossing,), direction, lengths, frequencies, vertical=vertical, cylindrical=False
        )
        assert np.allclose(arrived, factor[..., None] * sent, atol=1e-12)


def test_nothing_gets_through_what_absorbs_all() -> None:
    crossing = Crossing(slab(0.05, 3.0 - 1.0j), NORMAL)
    assert passage_level((crossing,), np.linspace(220e9, 295e9, 11)) < 1e-10


def test_the_band_is_followed_at_few_frequencies() -> None:
    assert passage_nodes((), 59e9, 61e9) == 1
    thin, thick = (passage_nodes((Crossing(slab(d), NORMAL),), 59e9, 64e9) for d in (1e-3, 2e-2))
    assert 1 < thin < thick < 60
