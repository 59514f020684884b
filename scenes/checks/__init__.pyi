from .facet_budget import facet_counts, facet_problems
from .files import file_problems
from .multistatic import antenna_places, multistatic_problems
from .placement import inconsistencies, signed_distance

__all__ = [
    "antenna_places",
    "facet_counts",
    "facet_problems",
    "file_problems",
    "inconsistencies",
    "multistatic_problems",
    "signed_distance",
]
