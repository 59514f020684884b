"""The resolution cell of an aperture: c/2B along the ray, λ/2D times the range across it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from estimator.array.resolution import HALF_POWER
from estimator.array.windows import SURVEY_TAPER


@dataclass(frozen=True, kw_only=True)
class Resolution:
    """Resolution of an aperture, along and across the ray from its centre."""

    along_ray: float  # [m]
    across_ray: float  # per metre of range: an angle [rad]

    def cell(
        self, points: Float[np.ndarray, "*n 3"], direction: Float[np.ndarray, " 3"]
    ) -> Float[np.ndarray, "*n"]:
        """Width of the resolution cell along a direction, for an array at the origin. [m]."""
        reach = np.linalg.norm(points, axis=-1)
        radial = np.abs(points @ direction) / reach
        crossing = np.sqrt(np.clip(1 - radial**2, 0.0, None))
        width = 1 / np.hypot(radial / self.along_ray, crossing / (self.across_ray * reach))
        return np.asarray(width)


def coarse_resolution(fine: Resolution) -> Resolution:
    """Return the resolution of the survey, which its taper widens by 1.54.

    Parameters
    ----------
    fine
        Of the untapered echo.
    """
    wider = SURVEY_TAPER.half_power_width / HALF_POWER
    return Resolution(along_ray=wider * fine.along_ray, across_ray=wider * fine.across_ray)
