r"""Interpolation over the aperture: what a small patch scatters, from a few positions of it.

Once the delay of a patch's centre is taken out, its triangles' sum turns, over a half aperture
:math:`h` along an axis, by at most :math:`\delta = k \rho h / R` for each end that moves, with
the patch's radius :math:`\rho` and its distance :math:`R`. Interpolated from M Chebyshev nodes
along that axis, the error is at most :math:`2 (\delta/2)^M / M!`. The fall of the antennas'
patterns over the array adds to the argument.
"""

import math
from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Float, Int
from scipy.constants import speed_of_light

from simulator.antennas.antenna_pattern import AntennaPattern
from simulator.antennas.links import Links
from simulator.geometry.patches import Patches
from simulator.numerics.nufft_sum import chebyshev_nodes, lagrange_basis

ACCURACY = 3e-5
"""Largest error of the interpolation along one axis, relative to the patch's sum. [-]"""

COUNTS = (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 20, 24, 32, 48, 64)
"""Nodes along an axis that are tried: few choices, so that many patches share one. [-]"""

GAIN = 0.75
"""Share of the array's places above which nodes do not save anything. [-]"""

SAME_PLACE = 1e-9
"""How far senders may be off an affine image of the receivers. [m]"""


@dataclass(frozen=True, kw_only=True)
class Aperture:
    """Where links begin and end, as functions of up to three coordinates."""

    coordinates: Float[np.ndarray, "links axes"]  # of each link, within ±extents [m]
    extents: Float[np.ndarray, " axes"]  # [m]
    receive_middle: Float[np.ndarray, " 3"]  # [m]
    receive_axes: Float[np.ndarray, "axes 3"]  # movement for each coordinate [-]
    send_middle: Float[np.ndarray, " 3"]  # [m]
    send_axes: Float[np.ndarray, "axes 3"]  # [-]

    def nodes(
        self, counts: tuple[int, ...], links: Links
    ) -> tuple[Links, Float[np.ndarray, "links nodes"]]:
        """Place the links that stand for all; and what interpolates from them."""
        along = [
            chebyshev_nodes(-extent, extent, count)
            for extent, count in zip(self.extents, counts, strict=True)
        ]
        grid = np.array(list(product(*along))).reshape(-1, len(counts))
        basis = np.ones((len(self.coordinates), 1))
        for axis, nodes in enumerate(along):
            one = lagrange_basis(nodes, self.coordinates[:, axis])
            basis = (basis[:, :, None] * one.T[:, None, :]).reshape(len(basis), -1)
        receivers = self.receive_middle + _combined(grid, self.receive_axes)
        echo = links.echo
        senders = receivers if echo else self.send_middle + _combined(grid, self.send_axes)
        few = Links(senders=senders, receivers=receivers, sent=links.sent, received=links.received)
        return few, basis


def find_aperture(links: Links) -> Aperture | None:
    """Describe the links' places by few coordinates; None if senders do not follow receivers."""
    middle = (links.receivers.min(axis=0) + links.receivers.max(axis=0)) / 2
    apart = links.receivers - middle
    axes = np.linalg.svd(np.einsum("lx,ly->xy", apart, apart))[2]
    coordinates = _combined(apart, axes.T)
    low, high = coordinates.min(axis=0), coordinates.max(axis=0)
    moving = high - low > 2 * SAME_PLACE
    shift = np.where(moving, (low + high) / 2, 0.0)
    middle = middle + _combined(shift[None], axes)[0]
    if not moving.any():
        return None
    axes, coordinates = axes[moving], (coordinates - shift)[:, moving]
    extents = (high - low)[moving] / 2
    scaled = np.concatenate([np.ones((len(coordinates), 1)), coordinates / extents], axis=1)
    solution = np.linalg.lstsq(scaled, links.senders, rcond=None)[0]
    if np.abs(_combined(scaled, solution) - links.senders).max() > SAME_PLACE:
        return None
    return Aperture(
        coordinates=coordinates,
        extents=extents,
        receive_middle=middle,
        receive_axes=axes,
        send_middle=solution[0],
        send_axes=solution[1:] / extents[:, None],
    )


def node_counts(
    aperture: Aperture, links: Links, patches: Patches, highest: float
) -> Int[np.ndarray, "patches axes"]:
    """Count the nodes along each axis that each patch needs; 0 where none would do.

    Parameters
    ----------
    aperture, links, patches
        Where they are.
    highest
        The highest frequency. [Hz]
    """
    turns = np.zeros((patches.count, len(aperture.extents)))
    ends = [(aperture.receive_middle, aperture.receive_axes, links.received)]
    ends.append((aperture.send_middle, aperture.send_axes, links.sent))
    for middle, axes, pattern in ends:
        steps = aperture.extents * np.sqrt(np.einsum("ax,ax->a", axes, axes))
        turns += _turn(middle, steps, pattern, patches, highest)
    counts = np.zeros(turns.shape, dtype=np.int64)
    for count in reversed(COUNTS):
        enough = 2 * (turns / 2) ** count / math.factorial(count) <= ACCURACY
        counts[enough] = count
    return counts


def _turn(
    middle: Float[np.ndarray, " 3"],
    steps: Float[np.ndarray, " axes"],
    pattern: AntennaPattern,
    patches: Patches,
    highest: float,
) -> Float[np.ndarray, "patches axes"]:
    """By how much a patch's sum turns or falls over half the aperture, for one of its ends."""
    towards = patches.centres - middle
    distance = np.sqrt(np.einsum("px,px->p", towards, towards))
    spread = float(np.sqrt((steps**2).sum())) + patches.radii
    nearest = distance - spread
    near = nearest <= 0
    nearest = np.where(near, 1.0, nearest)
    wavenumber = 2 * np.pi * highest / speed_of_light
    farthest_off = pattern.off_axis(towards / distance[:, None]) + spread / nearest
    argument = wavenumber * patches.radii + pattern.slope_off_axis(farthest_off) + 1.0
    turn: np.ndarray = np.where(near, np.inf, argument / nearest)[:, None] * np.maximum(steps, 0.0)
    return np.where(np.isnan(turn), 0.0, turn)  # what does not move does not turn


def _combined(
    weights: Float[np.ndarray, "n axes"], vectors: Float[np.ndarray, "axes 3"]
) -> Float[np.ndarray, "n 3"]:
    return np.asarray(np.einsum("na,ax->nx", weights, vectors))
