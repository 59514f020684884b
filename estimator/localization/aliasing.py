"""Notes on arrays and sweeps whose steps are too coarse to image all angles and ranges."""

from collections.abc import Sequence

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


def order_notes(
    distances: Sequence[float], orders: Sequence[Float[np.ndarray, " orders"]], step: float
) -> tuple[str, ...]:
    """Say of which walls the frequency step does not tell how far away they are.

    Parameters
    ----------
    distances
        Of the walls' planes from the array, as they are imaged. [m]
    orders
        Of each, how probable it is that it stands there, or farther by one or more steps.
    step
        Distance after which ranges repeat, c/2Δf. [m]
    """
    notes = []
    for distance, chances in zip(distances, orders, strict=True):
        others = np.flatnonzero(chances[1:]) + 1
        if others.size:
            there = " or ".join(f"{distance + order * step:.2f} m" for order in others)
            notes.append(
                f"the wall that faces the array at {distance:.2f} m may stand at {there} as well: "
                f"ranges repeat every {step:.2f} m, and its reflection is a flat wave from any "
                "distance; smaller frequency steps would tell"
            )
    return tuple(notes)


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
