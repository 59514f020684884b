"""An image as a function of points: the echo is focused wherever it is asked for."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Complex, Float

from estimator.array.windows import SURVEY_TAPER, aperture_taper, frequency_taper
from estimator.imaging.backprojection import Focuser, focus, prepare
from estimator.imaging.range_compression import RangeProfiles, range_profiles
from estimator.measurement.model import Echo

Focus = Callable[[Float[np.ndarray, "*grid 3"]], Complex[np.ndarray, "*grid"]]
"""Focuses the echo on points."""


def focus_within(focuser: Focuser, farthest: float) -> Focus:
    """Return a function that focuses an echo on points of any grid.

    Parameters
    ----------
    focuser
        The prepared echo, in the array's frame.
    farthest
        Distance up to which ranges are unambiguous; the image is 0 beyond. [m]
    """

    def focused(points: Float[np.ndarray, "*grid 3"]) -> Complex[np.ndarray, "*grid"]:
        inside = np.einsum("...x,...x->...", points, points) < farthest**2
        if np.all(inside):
            return focus(focuser, points)
        values = np.zeros(points.shape[:-1], dtype=np.complex128)
        values[inside] = focus(focuser, points[inside])
        return values

    return focused


@dataclass(frozen=True, eq=False)
class PreparedEcho:
    """Range profiles of an echo, without a taper and with the survey's; each is made when asked."""

    echo: Echo  # in the array's frame

    @cached_property
    def plain(self) -> Focuser:
        """Without a taper."""
        return prepare(range_profiles(self.echo))

    @cached_property
    def over_band(self) -> RangeProfiles:
        """Tapered over the band alone."""
        across = frequency_taper(self.echo.frequencies, SURVEY_TAPER)
        return range_profiles(self.echo, weights=across[None, :])

    @cached_property
    def tapered(self) -> Focuser:
        """Tapered over aperture and band: :func:`estimator.array.windows.survey_weights`."""
        along = aperture_taper(self.echo.positions, SURVEY_TAPER)
        band = self.over_band
        coefficients = band.coefficients * along.astype(np.float32)[:, None, None]
        gain = band.gain / len(along) * float(along.sum())
        return prepare(replace(band, coefficients=coefficients, gain=gain))
