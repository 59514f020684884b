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
from validation.analytic.slab_plane_waves import slab_over_air

NORMAL = np.array([0.0, 1.0, 0.0])


def slab(thickness: float, permittivity: complex = 2.7 - 0.05j) -> Dielectric:
    return Dielectric(permittivity=ConstantPermittivity(value=permittivity), thickness=thickness)


@pytest.mark.parametrize("vertical", [True, False])
@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 60.0])
@pytest.mark.parametrize(("thickness", "frequency"), [(12.7e-3, 60e9), (4e-3, 28e9), (2e-3, 300e9)])
def test_behind_a_slab_the_field_is_that_of_all_plane_waves(
    vertical: bool, angle_deg: float, thickness: float, frequency: float
) -> None:
    length, angle = 1.5, np.radians(angle_deg)
    material = slab(thickness)
    expected = slab_over_air(
        2.7 - 0.05j, thickness, angle=angle, length=length, frequency=frequency, vertical=vertical
    )
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

    def passed(*crossings: Crossing) -> np.ndarray:
        return through_slabs(crossings, *ways, frequencies, vertical=True, cylindrical=False)

    both = passed(Crossing(one, NORMAL), Crossing(other, -NORMAL))
    parts = [passed(Crossing(material, NORMAL)) for material in (one, other)]
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
