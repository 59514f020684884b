"""Delay offset and sign of the phase, checked by the curvature of the strongest wavefront."""

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.measurement.delay_by_focus import SINGLE, FocusDelay, focus_delay
from estimator.measurement.model import Echo, MeasurementError, Uplink

SURE = 4.0
"""Deviations by which curvature and delay must differ: by chance once in 16 000 sweeps. [-]"""

CELL_PART = 0.25
"""Of c over the bandwidth: a smaller difference is what an antenna's phase centre or a round target
makes, and moves nothing by more than an eighth of a range cell. [-]"""


def focus_notes(
    name: str, data: Echo | Uplink, boresight: Float[np.ndarray, " 3"], *, clock_known: bool
) -> list[str]:
    """Remark that the wave converges (the other sign), or that its curvature and delay disagree.

    Parameters
    ----------
    name
        File and table.
    data
        The measurement, calibrated as the mapping says.
    boresight
        Where the array looks.
    clock_known
        Whether the delay counts from the transmission; a pilot's may hold a clock's offset.
    """
    found = focus_delay(data, boresight)
    if found is None or found.coherence < SINGLE:
        return []
    if found.curvature < -SURE * found.curvature_deviation:
        return [
            f"{name}: the strongest wave converges upon the array (1/R = {found.curvature:.3g} ± "
            f"{found.curvature_deviation:.2g} 1/m), as of samples of the other sign: set "
            "time_convention to the other one"
        ]
    if not clock_known or not _tells_a_distance(found):
        return []
    cell = speed_of_light / float(np.ptp(data.frequencies))
    if abs(found.excess) < max(SURE * found.excess_deviation, CELL_PART * cell):
        return []
    distance = 1 / found.curvature
    off = found.curvature_deviation * distance**2
    return [
        f"{name}: the strongest point is {distance:.4g} ± {off:.2g} m away by its curvature, "
        f"and its delay is that of a path {found.excess:+.4g} ± {found.excess_deviation:.2g} m "
        f"other: if cables and antennas delay by {1e9 * found.excess / speed_of_light:.4g} ns, add "
        'that to cable_delay_ns (or set cable_delay_ns = "focus"); a round target shortens it too'
    ]


def delay_by_focus(data: Echo | Uplink, boresight: Float[np.ndarray, " 3"]) -> float:
    """Return the path length by which the delay exceeds that of the wavefront's curvature. [m].

    Raises
    ------
    MeasurementError
        If no single point dominates, or its curvature is too uncertain to give a distance.
    """
    found = focus_delay(data, boresight)
    if found is None or found.coherence < SINGLE:
        part = "no wave" if found is None else f"one point's wave holds {found.coherence:.0%}"
        raise MeasurementError(
            f'"focus" needs a single point that is far the strongest ({part} of the power, at '
            f"least {SINGLE:.0%}): put up a corner reflector, subtract what all positions share, "
            "or give the delay"
        )
    if found.curvature <= 0 or not _tells_a_distance(found):
        raise MeasurementError(
            f'"focus" needs a wave whose curvature is known (1/R = {found.curvature:.3g} ± '
            f"{found.curvature_deviation:.2g} 1/m): put the point nearer, or give the delay"
        )
    return found.excess


def _tells_a_distance(found: FocusDelay) -> bool:
    return found.curvature > SURE * found.curvature_deviation
