r"""Full-wave fields on a dense uniform frequency grid, solved for at far fewer frequencies.

Seen from one place, a wall's echo has delays within a window of a few decimetres around that of
its centre. With that delay taken out, a path of the window's end turns by :math:`z = \pi B
\tau` from the band's centre to either end, and as a function of frequency the field is a
polynomial of little more than that degree: it is interpolated from Chebyshev nodes. What
bounces several times comes later and is weaker; a margin is for it, and the result is compared
with direct solutions between the nodes.
"""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from validation.full_wave.strip_scattering import StripFields, StripScene, strip_fields

MARGINS, EXTRA = (1.15, 2.0, 4.0), 30
"""Nodes over the phase z, and nodes more: J_n(z) is below 1e-7 there for z up to 500. Where that
is not enough, as between the flanks of a very rough wall, the next margin is tried. [-]"""

COMPARED = (0.1, 0.37, 0.81)
"""Where in the band the interpolation is compared with a solution. [-]"""

MOST_ERROR = 1e-3
"""Of the interpolation, over the field's norm: 40 dB below a noise of 20 dB SNR. [-]"""


Solved = Callable[[Float[np.ndarray, " wanted"]], Complex[np.ndarray, "ways positions wanted"]]
"""Fields of some ways at all positions, for frequencies in Hz."""


def band_fields(
    scene: StripScene,
    frequencies: Float[np.ndarray, " freqs"],
    *,
    most_error: float = MOST_ERROR,
    folder: Path | None = None,
    workers: int | None = None,
    advance: Callable[[int, int], None] = lambda done, steps: None,
) -> StripFields:
    """Solve for a strip at Chebyshev nodes of a band and interpolate.

    Parameters
    ----------
    scene
        The strip and its sources.
    frequencies
        Where the fields are wanted, increasing. [Hz]
    most_error
        Of the interpolation; where it is not reached, all frequencies are solved for. [-]
    folder, workers, advance
        See :func:`validation.full_wave.strip_scattering.strip_fields`.

    Raises
    ------
    FullWaveError
        If a solution does not satisfy its equation.
    """

    def solved(
        wanted: Float[np.ndarray, " wanted"],
    ) -> Complex[np.ndarray, "ways positions wanted"]:
        fields = strip_fields(scene, wanted, folder=folder, workers=workers, advance=advance)
        return np.concatenate([fields.echo[None], fields.uplinks])

    whole = interpolated_fields(solved, frequencies, *_delays(scene), most_error=most_error)
    return StripFields(echo=whole[0], uplinks=whole[1:])


def interpolated_fields(
    solved: Solved,
    frequencies: Float[np.ndarray, " freqs"],
    delays: Float[np.ndarray, "ways positions"],
    half_window: float,
    *,
    most_error: float = MOST_ERROR,
) -> Complex[np.ndarray, "ways positions freqs"]:
    """Solve at Chebyshev nodes of a band and interpolate; at all frequencies where that fails.

    Parameters
    ----------
    solved
        Solves.
    frequencies
        Where the fields are wanted, increasing. [Hz]
    delays, half_window
        Of each way at each position, and how far from there most of it arrives. [s]
    most_error
        Of the interpolation, over the norm of each way's field. [-]
    """
    for margin in MARGINS:
        needed = nodes_needed(frequencies, half_window, margin)
        if needed + len(COMPARED) >= len(frequencies):
            break
        found, error = _interpolated(solved, frequencies, delays, needed)
        if error < most_error:
            return found
    return solved(frequencies)


def nodes_needed(
    frequencies: Float[np.ndarray, " freqs"], half_window: float, margin: float = MARGINS[0]
) -> int:
    """Return how many nodes carry a band; parameters as in :func:`interpolated_fields`."""
    return math.ceil(margin * np.pi * float(np.ptp(frequencies)) * half_window) + EXTRA


def _interpolated(
    solved: Solved,
    frequencies: Float[np.ndarray, " freqs"],
    delays: Float[np.ndarray, "ways positions"],
    needed: int,
) -> tuple[Complex[np.ndarray, "ways positions freqs"], float]:
    """Return the interpolated fields, and how far they are off between the nodes. [-]."""
    start, stop = float(frequencies[0]), float(frequencies[-1])
    angles = np.pi * (np.arange(needed) + 0.5) / needed
    nodes = 0.5 * (start + stop) - 0.5 * (stop - start) * np.cos(angles)
    between = start + (stop - start) * np.array(COMPARED)
    wanted = np.concatenate([nodes, between])
    fields = solved(wanted)
    smooth = fields * np.exp(2j * np.pi * delays[..., None] * wanted)
    asked = np.concatenate([frequencies, between])
    spread = _chebyshev_interpolation(nodes, angles, asked)
    found = (smooth[..., :needed] @ spread) * np.exp(-2j * np.pi * delays[..., None] * asked)
    missed = found[..., len(frequencies) :] - fields[..., needed:]
    worst = max(
        float(np.linalg.norm(one) / np.linalg.norm(whole))
        for one, whole in zip(missed, fields[..., needed:], strict=True)
    )
    return found[..., : len(frequencies)], worst


def _delays(scene: StripScene) -> tuple[Float[np.ndarray, "ways positions"], float]:
    """Return the delay over the strip's middle, of each way, and the largest departure [s]."""
    wall = scene.profile[:, :2]
    to_array = np.linalg.norm(scene.positions[:, None, :2] - wall, axis=-1)
    ways = [2 * to_array]
    ways += [to_array + np.linalg.norm(user.position - wall, axis=-1) for user in scene.users]
    lengths = np.stack(ways)
    middle = 0.5 * (lengths.max(axis=-1) + lengths.min(axis=-1))
    window = float(np.max(lengths.max(axis=-1) - middle))
    return np.asarray(middle / speed_of_light), window / speed_of_light


def _chebyshev_interpolation(
    nodes: Float[np.ndarray, " nodes"],
    angles: Float[np.ndarray, " nodes"],
    asked: Float[np.ndarray, " asked"],
) -> Float[np.ndarray, "nodes asked"]:
    """Return the barycentric weights of Chebyshev's roots."""
    signed = np.where(np.arange(len(nodes)) % 2 == 0, 1.0, -1.0) * np.sin(angles)
    apart = asked - nodes[:, None]
    hit = apart == 0
    shares = signed[:, None] / np.where(hit, 1.0, apart)
    shares[:, hit.any(axis=0)] = 0.0
    shares[hit] = 1.0
    return np.asarray(shares / shares.sum(axis=0))
