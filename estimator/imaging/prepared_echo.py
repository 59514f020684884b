"""A linear array's echo, compressed once for all that look at it."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from estimator.array.windows import SURVEY_TAPER, aperture_taper, frequency_taper
from estimator.imaging.backprojection import Focuser, prepare
from estimator.imaging.range_compression import RangeProfiles, range_profiles
from estimator.measurement.model import Echo


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
