"""Links through slabs summed by blocks, against each link by itself."""

from functools import partial

import numpy as np
import pytest
from scipy.constants import speed_of_light

from simulator.materials.fresnel_slab import Dielectric
from simulator.materials.insertion_table import InsertionTable
from simulator.materials.permittivity import ConstantPermittivity
from simulator.materials.slab_insertion import Crossing
from simulator.multibounce.links_through_slabs import BlockInsertions, SlabVariation
from simulator.numerics.butterfly import LINK_ACCURACY, plan_links, sum_planned

NODES = np.linspace(220e9, 295e9, 6)
WALL = np.stack([np.linspace(-0.1, 0.1, 900), np.full(900, 0.2)], axis=-1)
TARGET = np.stack([np.linspace(0.0, 0.3, 1000), np.linspace(0.55, 0.7, 1000)], axis=-1)


def slab(permittivity: complex, thickness: float) -> InsertionTable:
    material = Dielectric(
        permittivity=ConstantPermittivity(value=permittivity), thickness=thickness
    )
    return InsertionTable.of(Crossing(material, np.array([0.0, 1.0, 0.0])), NODES, "vertical")


PANE = (6.3 - 0.2j, 6e-3)
BOARD = (2.6 - 0.05j, 12.5e-3)


@pytest.mark.parametrize("slabs", [[PANE], [BOARD], [PANE, BOARD]], ids=["pane", "board", "both"])
def test_blocks_send_through_slabs_what_their_facets_send(
    slabs: list[tuple[complex, float]],
) -> None:
    tables = [slab(*one) for one in slabs]
    seen = np.ones((len(WALL), len(TARGET)), dtype=bool)
    plan = plan_links(WALL, TARGET, seen, float(NODES[-1]), variation=SlabVariation(tables))
    inserted = BlockInsertions.of(plan, tables)
    assert inserted is not None
    assert len(plan.pairs) > 0
    rng = np.random.default_rng(3)
    sources = (rng.standard_normal((3, 2, 900)) + 1j * rng.standard_normal((3, 2, 900))).astype(
        np.complex64
    )
    between = TARGET - WALL[:, None]
    distance = np.linalg.norm(between, axis=-1)
    ways = between / distance[..., None]
    for node in (0, 3, 5):
        per_metre = float(NODES[node]) / speed_of_light
        summed = sum_planned(
            plan,
            sources,
            len(TARGET),
            float(NODES[node]),
            partial(inserted.at, node=node, per_metre=per_metre),
        )
        longer = sum(one.bending(ways, distance) for one in tables)
        turns = (distance + longer) * per_metre
        links = np.exp(-2j * np.pi * (turns - np.rint(turns))) / np.sqrt(distance)
        for one in tables:
            links = links * one.table.at(one.places(ways), node)
        links = np.where(plan.left, 0.0, links)
        expected = sources[0] @ links
        for axis in (0, 1):
            expected = expected + sources[1 + axis] @ (links * ways[..., axis])
        # The bound is of each contribution over the slabs' largest transmission.
        error = np.linalg.norm(summed[0] - expected) / np.linalg.norm(expected)
        assert error <= LINK_ACCURACY


def test_the_same_direction_needs_no_more_points() -> None:
    one = SlabVariation([slab(*PANE)])
    assert one(np.tile([0.6, 0.8], (3, 1))) == 0
    spread = [np.stack([np.sin(a), np.cos(a)], axis=-1) for a in (
        np.linspace(0.4, 0.42, 3), np.linspace(0.4, 0.7, 3)
    )]  # fmt: skip
    assert 0 < one(spread[0]) < one(spread[1])
