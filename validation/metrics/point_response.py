"""The response to one point along a line: position of its peak and -3 dB width."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, kw_only=True)
class PeakCut:
    """A main lobe along a line."""

    place: float  # of the peak, between the samples; in the coordinate's unit
    width: float  # between the two -3 dB points; in the coordinate's unit
    value: float  # magnitude of the peak [-]


def peak_cut(
    coordinate: Float[np.ndarray, " samples"], magnitude: Float[np.ndarray, " samples"]
) -> PeakCut:
    """Measure the highest lobe of a finely sampled magnitude.

    The peak is the vertex of a parabola through the power of three samples, the -3 dB points are
    interpolated linearly in power: with 20 samples in the width both errors are below 1e-3 of it.

    Parameters
    ----------
    coordinate
        Along the line, in equal steps.
    magnitude
        Of an image or map at these points. [-]

    Raises
    ------
    ValueError
        If the line ends before the lobe has fallen by 3 dB on either side.
    """
    power = magnitude**2
    top = int(np.argmax(power))
    if not 0 < top < power.size - 1:
        raise ValueError("the peak is at an end of the line; make the line longer")
    before, peak, after = power[top - 1 : top + 2]
    bend = before - 2 * peak + after
    shift = 0.5 * (before - after) / bend if bend < 0 else 0.0
    value = peak - 0.25 * (before - after) * shift
    below = power < value / 2
    left, right = np.flatnonzero(below[:top]), np.flatnonzero(below[top:])
    if not left.size or not right.size:
        raise ValueError("the lobe does not fall by 3 dB within the line; make the line longer")
    step = coordinate[1] - coordinate[0]
    ends = []
    for inside, outside in ((left[-1] + 1, left[-1]), (top + right[0] - 1, top + right[0])):
        share = (power[inside] - value / 2) / (power[inside] - power[outside])
        ends.append(coordinate[inside] + share * (coordinate[outside] - coordinate[inside]))
    return PeakCut(
        place=float(coordinate[top] + shift * step),
        width=float(ends[1] - ends[0]),
        value=float(np.sqrt(value)),
    )
