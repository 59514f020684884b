"""Ideal points that scatter alike in all directions: targets of known place and level."""

import numpy as np
from jaxtyping import Float
from pydantic import Field

from scenes.schema.quantities import Checked, Position


class PointTarget(Checked):
    """A point of given radar cross-section, without extent and without shadow."""

    position_m: Position = Field(description="the position of the point [m]")
    rcs_m2: float = Field(1e-4, gt=0, le=1e6, description="the radar cross-section [m²]")

    @property
    def position(self) -> Float[np.ndarray, " 3"]:
        """Where the point is [m]."""
        return np.array(self.position_m, dtype=np.float64)
