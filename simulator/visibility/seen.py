"""Result of a visibility test: the facets that antennas see."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int


@dataclass(frozen=True, kw_only=True)
class Seen:
    """Which triangles are seen over which links, from both of their ends."""

    always: Bool[np.ndarray, " facets"]
    sometimes: Int[np.ndarray, " some"]  # indices; all others are never seen
    table: Bool[np.ndarray, "some links"]
