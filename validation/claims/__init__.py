"""All claims, by what they are about."""

from validation.claims import (
    closed_forms,
    diffraction,
    full_wave,
    imaging,
    limits,
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
    *diffraction.CLAIMS,
    *imaging.CLAIMS,
    *full_wave.CLAIMS,
    *thesis.CLAIMS,
    *scenarios.CLAIMS,
    *limits.CLAIMS,
    *random_rooms.CLAIMS,
)
"""In the order in which they are told: physics first, then what is built on it."""
