"""What is said of an array whose positions are too far apart to image all angles."""

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.array.resolution import largest_spacing


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
