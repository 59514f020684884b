r"""Full-wave fields on a dense uniform frequency grid, interpolated from few solutions.

At one position, a wall's echo has delays within a window of a few decimetres around that of its
centre. Without that delay, the phase of a path at the window's end changes by :math:`z = \pi B
\tau` from the band's centre to either end, and the field is approximated by a polynomial in
frequency of little more than that degree: it is interpolated from Chebyshev nodes. Multiple
bounces are later and weaker; the degree has a margin for them, and the result is compared with
direct solutions between the nodes.
"""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from validation.full_wave.strip_scattering import StripFields, StripScene, strip_fields

MARGINS, EXTRA = (1.15, 2.0, 4.0), 30
"""Number of nodes over the phase z, and additional nodes: J_n(z) is below 1e-7 there for z up to
500. If the error is too large, as between the flanks of a very rough wall, the next margin is
tried. [-]"""

COMPARED = (0.1, 0.37, 0.81)
"""Relative positions in the band at which the interpolation is compared with solutions. [-]"""

MOST_ERROR = 1e-3
"""Largest interpolation error over the field's norm: 40 dB below the noise at 20 dB SNR. [-]"""


Solved = Callable[[Float[np.ndarray, " wanted"]], Complex[np.ndarray, "ways positions wanted"]]
"""Returns the fields of some links at all positions, for frequencies in Hz."""


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
        Of the result, increasing. [Hz]
    most_error
        Of the interpolation; if it is exceeded, all frequencies are solved for. [-]
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
    """Solve at Chebyshev nodes of a band and interpolate; if that fails, solve at all frequencies.

    Parameters
    ----------
    solved
        Solver for given frequencies.
    frequencies
        Of the result, increasing. [Hz]
    delays, half_window
        Delay of each link at each position, and half width of the window of delays. [s]
    most_error
        Of the interpolation, over the norm of each link's field. [-]
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
    """Return the number of nodes for a band; parameters as in :func:`interpolated_fields`."""
    return math.ceil(margin * np.pi * float(np.ptp(frequencies)) * half_window) + EXTRA


def _interpolated(
    solved: Solved,
    frequencies: Float[np.ndarray, " freqs"],
    delays: Float[np.ndarray, "ways positions"],
    needed: int,
) -> tuple[Complex[np.ndarray, "ways positions freqs"], float]:
    """Return the interpolated fields, and their relative error between the nodes. [-]."""
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
    """Return each link's delay over the strip's middle, and the largest deviation from it [s]."""
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
    """Return the interpolation matrix from Chebyshev nodes, by the barycentric formula."""
    signed = np.where(np.arange(len(nodes)) % 2 == 0, 1.0, -1.0) * np.sin(angles)
    apart = asked - nodes[:, None]
    hit = apart == 0
    shares = signed[:, None] / np.where(hit, 1.0, apart)
    shares[:, hit.any(axis=0)] = 0.0
    shares[hit] = 1.0
    return np.asarray(shares / shares.sum(axis=0))
