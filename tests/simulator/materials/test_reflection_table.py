import numpy as np
import pytest

from simulator.materials.fresnel_slab import (
    Conductor,
    Dielectric,
    Material,
    named_material,
    reflection,
)
from simulator.materials.permittivity import ConstantPermittivity
from simulator.materials.reflection_table import TABLE_ACCURACY, reflection_table

BAND = np.linspace(220e9, 330e9, 23)
SLABS = {
    "drywall": named_material("drywall", BAND),
    "a clear pane": Dielectric(
        permittivity=ConstantPermittivity(value=6.3 - 0.02j), thickness=3e-3
    ),
    "a conductor": Conductor(),
}


@pytest.mark.parametrize("material", SLABS.values(), ids=SLABS.keys())
def test_the_table_gives_the_slabs_coefficient_at_any_angle(material: Material) -> None:
    cosines = np.random.default_rng(0).uniform(0.0, 1.0, 300)
    table = reflection_table(material, BAND)
    exact = reflection(material, BAND, cosines).te.T
    tabulated = table.at(table.places(cosines), slice(None))
    # The table is tried out at every third frequency; single precision adds 1e-7.
    assert np.abs(tabulated - exact).max() <= 2 * TABLE_ACCURACY
    one = table.at(table.places(cosines), 7)
    assert np.abs(one - exact[7]).max() <= 2 * TABLE_ACCURACY


def test_grazing_and_normal_incidence_are_in_the_table() -> None:
    table = reflection_table(SLABS["drywall"], BAND)
    ends = table.at(table.places(np.array([0.0, 1.0])), slice(None))
    exact = reflection(SLABS["drywall"], BAND, np.array([0.0, 1.0])).te.T
    np.testing.assert_allclose(ends, exact, atol=1e-6)  # single precision
