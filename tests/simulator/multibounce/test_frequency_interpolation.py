"""Chains over surfaces and through slabs, interpolated over the band from a few frequencies."""

import numpy as np
import pytest
from scipy.constants import speed_of_light

from simulator.materials.fresnel_slab import Dielectric, reflection
from simulator.materials.permittivity import ConstantPermittivity
from simulator.materials.slab_insertion import inserted
from simulator.multibounce.frequency_interpolation import CHAIN_ACCURACY, nodes_for_chain
from simulator.numerics.nufft_sum import barycentric_basis, chebyshev_nodes

BAND = (220e9, 295e9)
PANE = Dielectric(permittivity=ConstantPermittivity(value=6.3 - 0.05j), thickness=4e-3)
BOARD = Dielectric(permittivity=ConstantPermittivity(value=2.6 - 0.03j), thickness=12.5e-3)


@pytest.mark.parametrize("slabs", [[PANE], [PANE, PANE], [PANE, BOARD, PANE]], ids=len)
@pytest.mark.parametrize("spread", [0.01, 0.25])
def test_as_many_nodes_as_said_interpolate_a_chain_through_slabs(
    slabs: list[Dielectric], spread: float
) -> None:
    frequencies = np.linspace(*BAND, 997)
    count = nodes_for_chain(spread / speed_of_light, [PANE, BOARD], *BAND, slabs=slabs)
    nodes = chebyshev_nodes(*BAND, count)
    basis = barycentric_basis(nodes, frequencies)
    cosines = np.linspace(0.15, 1.0, 23)

    def response(some: np.ndarray) -> np.ndarray:
        product = reflection(PANE, some, cosines).te * reflection(BOARD, some, cosines).te
        for slab in slabs:
            product = product * inserted(slab, some, cosines).te
        delays = np.linspace(-0.5, 0.5, 23)[:, None] * spread / speed_of_light
        return np.asarray(product * np.exp(-2j * np.pi * some * delays))

    error = np.abs(response(nodes) @ basis - response(frequencies)).max()
    # Angles between those at which nodes are counted may ripple a little more.
    assert error <= 2 * CHAIN_ACCURACY


def test_nodes_of_slabs_and_delays_do_not_add_up() -> None:
    delay = 0.25 / speed_of_light
    alone = nodes_for_chain(delay, [PANE], *BAND)
    through = nodes_for_chain(delay, [PANE], *BAND, slabs=[PANE, PANE])
    assert through <= alone + 10
