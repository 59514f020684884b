from .butterfly import LinkPlan, phasor, plan_links, sum_planned
from .delay_weighting import NeighbourGrid, decayed, neighbour_grid
from .nufft_sum import (
    FrequencySum,
    barycentric_basis,
    chebyshev_nodes,
    lagrange_basis,
    nodes_needed,
)
from .vectors import added, at_least, chosen, cross, dot, scaled, square_root

__all__ = [
    "FrequencySum",
    "LinkPlan",
    "NeighbourGrid",
    "added",
    "at_least",
    "barycentric_basis",
    "chebyshev_nodes",
    "chosen",
    "cross",
    "decayed",
    "dot",
    "lagrange_basis",
    "neighbour_grid",
    "nodes_needed",
    "phasor",
    "plan_links",
    "scaled",
    "square_root",
    "sum_planned",
]
