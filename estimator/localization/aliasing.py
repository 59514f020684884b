"""Notes on arrays and sweeps whose steps are too coarse to image all angles and ranges."""

import numpy as np
from jaxtyping import Bool, Float
from scipy.constants import speed_of_light

from estimator.array.resolution import largest_spacing
from estimator.measurement.model import Echo, frequency_step


def aliasing_notes(
    spacing: float, frequencies: Float[np.ndarray, " freqs"], sine: float
) -> tuple[str, ...]:
    """Say where the image ends because the positions are too far apart to tell more.

    Parameters
    ----------
    spacing
        Of neighbouring positions; in space the larger of both axes'. [m]
    frequencies
        Of the echo. [Hz]
    sine
        Of the angle from boresight within which there are no grating lobes. [-]
    """
    if spacing <= largest_spacing(speed_of_light / float(frequencies[-1])):
        return ()
    return (
        f"positions {1e3 * spacing:.3g} mm apart tell echoes from their grating lobes within "
        f"{np.degrees(np.arcsin(sine)):.1f}° of broadside only; the image ends there",
    )


FEWEST_BEYOND = 5
"""Peaks beyond the unambiguous range from which on a user is told: single ones are told wrongly
where speckle is dense. [-]"""


def range_notes(echo: Echo, beyond: Bool[np.ndarray, " peaks"]) -> tuple[str, ...]:
    """Say that echo from beyond the unambiguous range is left out of the map.

    Parameters
    ----------
    echo
        Of uniform frequencies.
    beyond
        Which peaks of its image are from there.
    """
    count = int(np.count_nonzero(beyond))
    if count < FEWEST_BEYOND:
        return ()
    farthest = speed_of_light / (2 * frequency_step(echo.frequencies))
    return (
        f"{count} peaks of the image have a flatter wavefront than things there would have: they "
        f"are images of something beyond the unambiguous range of {farthest:.3g} m, or of the "
        "imaged angles; no walls and targets are made of them; smaller frequency steps would "
        "show what is farther",
    )
