"""An echo and a pilot that are one and the same recording, mapped twice."""

import numpy as np

from estimator.measurement.model import Echo, MeasurementError, Uplink

SAME = 0.9
"""Correlation of an echo with a pilot from which they are one recording: 0.99 between two of 20 dB
over noise. One of a room with another is a number of the order of one over the number of resolved
delays and angles. [-]"""


def refuse_same_samples(echo: Echo, uplink: Uplink) -> None:
    """Refuse a pilot whose samples are the echo's.

    Raises
    ------
    MeasurementError
        If both correlate by more than :data:`SAME`.
    """
    if echo.samples.shape != uplink.samples.shape:
        return
    inner = abs(complex(np.vdot(echo.samples, uplink.samples)))
    size = float(np.linalg.norm(echo.samples)) * float(np.linalg.norm(uplink.samples))
    if inner > SAME * size:
        raise MeasurementError(
            f"echo and uplink of {uplink.user!r} hold the same samples (correlation "
            f"{inner / size:.3f}; the limit is {SAME}): one of both was mapped from the wrong "
            "parameter; the echo is S11, or S21 between two antennas of the array, the pilot S21 "
            "from the user's antenna"
        )
