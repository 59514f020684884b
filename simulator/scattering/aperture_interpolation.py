r"""Interpolation over the aperture of a small patch's scattering, from a few positions.

Without the delay of the patch's centre, the phase of its triangles' sum changes, over a half
aperture :math:`h` along an axis, by at most :math:`\delta = k \rho h / R` for each end that moves,
with the patch's radius :math:`\rho` and its distance :math:`R`. The error of interpolation from M
Chebyshev nodes along that axis is at most :math:`2 (\delta/2)^M / M!`. The logarithmic decrease of
the antennas' patterns over the array adds to :math:`\delta`.
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
"""Allowed numbers of nodes along an axis: few, so that many patches share one. [-]"""

GAIN = 0.75
"""Ratio of nodes to the array's positions above which interpolation saves no time. [-]"""

SAME_PLACE = 1e-9
"""Largest deviation of senders from an affine map of the receivers. [m]"""


@dataclass(frozen=True, kw_only=True)
class Aperture:
    """Positions of links' ends, as affine functions of up to three coordinates."""

    coordinates: Float[np.ndarray, "links axes"]  # of each link, within ±extents [m]
    extents: Float[np.ndarray, " axes"]  # [m]
    receive_middle: Float[np.ndarray, " 3"]  # [m]
    receive_axes: Float[np.ndarray, "axes 3"]  # movement for each coordinate [-]
    send_middle: Float[np.ndarray, " 3"]  # [m]
    send_axes: Float[np.ndarray, "axes 3"]  # [-]

    def nodes(
        self, counts: tuple[int, ...], links: Links
    ) -> tuple[Links, Float[np.ndarray, "links nodes"]]:
        """Return links at the nodes, and the interpolation matrix from these to all links."""
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
    """Return the links' positions by few coordinates; None if senders have no affine map."""
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
    """Count the nodes along each axis that each patch needs; 0 if no allowed number suffices.

    Parameters
    ----------
    aperture, links, patches
        Of the sum.
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
    """Change of a patch's sum in phase or logarithm over half the aperture, for one end. [-]."""
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
    return np.where(np.isnan(turn), 0.0, turn)  # no movement, no change


def _combined(
    weights: Float[np.ndarray, "n axes"], vectors: Float[np.ndarray, "axes 3"]
) -> Float[np.ndarray, "n 3"]:
    return np.asarray(np.einsum("na,ax->nx", weights, vectors))
