"""All claims about the software that are checked, by subject."""

from validation.claims import (
    closed_forms,
    diffraction,
    full_wave,
    imaging,
    limits,
    paths_in_space,
    propagation,
    random_rooms,
    scenarios,
    thesis,
    transmission,
)
from validation.harness.claim import Claim

ALL_CLAIMS: tuple[Claim, ...] = (
    *closed_forms.CLAIMS,
    *propagation.CLAIMS,
    *transmission.CLAIMS,
    *paths_in_space.CLAIMS,
    *diffraction.CLAIMS,
    *imaging.CLAIMS,
    *full_wave.CLAIMS,
    *thesis.CLAIMS,
    *scenarios.CLAIMS,
    *limits.CLAIMS,
    *random_rooms.CLAIMS,
)
"""All claims in the order of the results page: physics first, then estimation."""
