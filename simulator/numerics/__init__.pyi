from .butterfly import LinkPlan, phasor, plan_links, sum_planned
from .nufft_sum import (
    FrequencySum,
    barycentric_basis,
    chebyshev_nodes,
    lagrange_basis,
    nodes_needed,
)

__all__ = [
    "FrequencySum",
    "LinkPlan",
    "barycentric_basis",
    "chebyshev_nodes",
    "lagrange_basis",
    "nodes_needed",
    "phasor",
    "plan_links",
    "sum_planned",
]
