r"""Range compression: from samples over frequency to a profile over path length.

A profile is demodulated by a centre frequency, so that it is band-limited around zero, and
stored as one cubic polynomial per cell. Reading it anywhere then costs two packet loads
instead of a sum over the frequencies.
"""

from dataclasses import dataclass, replace

import finufft
import numpy as np
import scipy.fft
from jaxtyping import Complex, Complex64, Float
from scipy.constants import speed_of_light

from estimator.measurement.model import Echo, MeasurementError, Uplink

CELLS_PER_SAMPLE = 2.0
"""Least number of profile cells for each frequency sample. [-]

A cubic at Chebyshev nodes errs by at most (π/4)⁴/192 (-54 dB) for the outermost frequency
and by a fifth of it in the mean over the band: below -67 dB of the peak of a point target.
"""

UNEVEN_STEPS = 1e-3
"""Departure from a uniform frequency grid, over the step, from which on the profiles are
summed as they are: at the far end of the unambiguous range it is a phase of 2π·1e-3. [-]"""

OFF_GRID = 1e-2
"""Departure from a grid with holes, over its step, from which on the median step counts: over a
hundred steps it would alias to another range. [-]"""

NUFFT_ERROR = 1e-6
"""Relative error of the non-uniform FFT: that of the float32 it is stored in. [-]"""

_ORDER = 4  # coefficients of a cubic


@dataclass(frozen=True, kw_only=True, eq=False)
class RangeProfiles:
    r"""Range profiles of an array, ready to be focused on any points.

    Near cell ``k`` the profile of channel ``m`` at the path length (k + v)·cell is
    :math:`\sum_i` ``coefficients[m, k, i]`` :math:`v^i`, for |v| ≤ ½.
    """

    coefficients: Complex64[np.ndarray, "channels cells 4"]
    cell: float  # path length per cell [m]
    carrier: float  # frequency taken out of the profiles [Hz]
    unambiguous: float  # longest path without aliasing [m]
    legs: tuple[Float[np.ndarray, "channels 3"], ...]  # ends at the array of each path's legs [m]
    passes: int  # how often each leg is travelled: 2 in a monostatic echo
    gain: float  # sum of all weights: what an ideal unit point target adds up to


def range_profiles(
    data: Echo | Uplink,
    *,
    weights: Float[np.ndarray, "#channels #freqs"] | None = None,
) -> RangeProfiles:
    r"""Compress an echo or an uplink over frequency.

    Evaluates, for every channel and on a fine grid of path lengths L,

    .. math:: g_m(L) = \sum_n w_{mn} s_{mn} e^{+j 2 \pi (f_n - f_c) L / c}

    by FFT, or by a non-uniform FFT where the frequencies are uneven or have holes.

    Parameters
    ----------
    data
        Samples :math:`s_{mn}` at positions and frequencies.
    weights
        Taper :math:`w_{mn}` over positions and frequencies; ``None``: all one. [-]

    Returns
    -------
    The profiles, to be used as often as needed.

    Raises
    ------
    MeasurementError
        If there is one frequency only, or the weights do not fit or sum to nothing.
    """
    samples, frequencies = data.samples, data.frequencies
    if frequencies.size < 2:
        raise MeasurementError(
            "frequency: one point has no bandwidth; range needs at least two frequencies"
        )
    tapered, gain = _taper(samples, weights)
    unambiguous = unambiguous_path(frequencies)
    middle = frequencies.size // 2
    carrier = float(frequencies[middle])
    step = speed_of_light / unambiguous
    offsets = (frequencies - carrier) / step  # whole numbers on a uniform grid
    span = int(np.ceil((frequencies[-1] - frequencies[0]) / step)) + 1
    cells = int(scipy.fft.next_fast_len(int(np.ceil(CELLS_PER_SAMPLE * span))))
    phase = 2 * np.pi * offsets / cells  # from one cell to the next
    fit = _cubic_of_a_phase(phase)
    whole = np.rint(offsets).astype(np.int64)
    if np.abs(offsets - whole).max() <= UNEVEN_STEPS:
        spectrum = np.zeros((len(samples), cells, _ORDER), dtype=np.complex64)
        values, cubics = tapered.astype(np.complex64)[:, :, None], fit.astype(np.complex64)
        if int(whole[-1] - whole[0]) == whole.size - 1:  # no holes: two blocks, before and from 0
            below = int(np.searchsorted(whole, 0))
            np.multiply(values[:, :below], cubics[:below], out=spectrum[:, cells - below :])
            np.multiply(values[:, below:], cubics[below:], out=spectrum[:, : whole.size - below])
        else:
            spectrum[:, whole] = values * cubics
        table = scipy.fft.ifft(spectrum, axis=1, norm="forward", workers=-1, overwrite_x=True)
    else:
        # No period: two more cells, for lengths that round up to the unambiguous one.
        table = _nonuniform(tapered[:, :, None] * fit, phase, cells + 2)
    two_way = isinstance(data, Echo) and data.transmit_positions is None
    legs: tuple[Float[np.ndarray, "channels 3"], ...] = (data.positions,)
    if isinstance(data, Echo) and data.transmit_positions is not None:
        legs = (data.transmit_positions, data.positions)
    return RangeProfiles(
        coefficients=table,
        cell=unambiguous / cells,
        carrier=carrier,
        unambiguous=unambiguous,
        legs=legs,
        passes=2 if two_way else 1,
        gain=gain,
    )


def repeated(profiles: RangeProfiles, longest: float) -> RangeProfiles:
    """Continue profiles periodically beyond the unambiguous path.

    On a uniform frequency grid the sum over frequencies has this period. What tells the periods
    apart then is the aperture: near it a wavefront is round enough.

    Parameters
    ----------
    profiles
        Of uniform frequencies.
    longest
        Path length that must be covered. [m]
    """
    times = int(np.ceil(longest / profiles.unambiguous))
    cells = round(profiles.unambiguous / profiles.cell)
    if times < 2 or profiles.coefficients.shape[1] != cells:
        return profiles
    return replace(
        profiles,
        coefficients=np.tile(profiles.coefficients, (1, times, 1)),
        unambiguous=times * profiles.unambiguous,
    )


def unambiguous_path(frequencies: Float[np.ndarray, " freqs"]) -> float:
    """Return the longest path length that a sweep tells from shorter ones, in metres.

    It is c/Δf, with the step of the uniform grid on which the frequencies lie, also where
    some of that grid are missing; on uneven frequencies, with their median step.
    """
    steps = np.diff(frequencies)
    smallest = float(steps.min())
    multiples = np.rint(steps / smallest)
    grid = float((frequencies[-1] - frequencies[0]) / multiples.sum())
    places = (frequencies - frequencies[0]) / grid
    if np.abs(places - np.rint(places)).max() > OFF_GRID:
        grid = float(np.median(steps))
    return speed_of_light / grid


def _taper(
    samples: Complex[np.ndarray, "channels freqs"],
    weights: Float[np.ndarray, "#channels #freqs"] | None,
) -> tuple[Complex[np.ndarray, "channels freqs"], float]:
    if weights is None:
        return samples, float(samples.size)
    if any(size not in (1, full) for size, full in zip(weights.shape, samples.shape, strict=True)):
        raise MeasurementError(
            f"weights of shape {weights.shape} do not fit samples of shape {samples.shape}"
        )
    full = np.broadcast_to(weights, samples.shape)
    gain = float(full.sum())
    if not gain > 0:
        raise MeasurementError(f"the weights sum to {gain:g}; a taper needs a positive sum")
    return full * samples, gain


def _cubic_of_a_phase(phase: Float[np.ndarray, " freqs"]) -> Complex[np.ndarray, "freqs 4"]:
    """Fit exp(j·phase·v) over |v| ≤ ½ by a cubic in v, through the Chebyshev nodes."""
    nodes = 0.5 * np.cos(np.pi * (2 * np.arange(_ORDER) + 1) / (2 * _ORDER))
    to_coefficients = np.linalg.inv(np.vander(nodes, _ORDER, increasing=True))
    fit: Complex[np.ndarray, "freqs 4"] = np.exp(1j * np.outer(phase, nodes)) @ to_coefficients.T
    return fit


def _nonuniform(
    cubic: Complex[np.ndarray, "channels freqs 4"], phase: Float[np.ndarray, " freqs"], cells: int
) -> Complex64[np.ndarray, "channels cells 4"]:
    """Sum exp(j·phase·k) over uneven frequencies for the cells k = 0 … cells - 1."""
    channels, freqs, order = cubic.shape
    # finufft counts its modes from -cells/2; the shift moves cell 0 there.
    shifted = cubic * np.exp(1j * phase * (cells // 2))[None, :, None]
    strengths = np.ascontiguousarray(shifted.transpose(0, 2, 1)).reshape(-1, freqs)
    sums = finufft.nufft1d1(phase, strengths, cells, eps=NUFFT_ERROR, isign=1, nthreads=1)
    table = np.empty((channels, cells, order), dtype=np.complex64)
    table[:] = sums.reshape(channels, order, cells).transpose(0, 2, 1)
    return table


def refuse_points_out_of_range(
    profiles: RangeProfiles, points: Float[np.ndarray, "3 points"]
) -> None:
    """Refuse points that cannot be focused.

    Raises
    ------
    MeasurementError
        If a point lies beyond the unambiguous range or is not finite.
    """
    low, high = points.min(axis=1), points.max(axis=1)  # NaN if any is
    if not np.all(np.isfinite([low, high])):
        bad = int(np.count_nonzero(~np.isfinite(points).all(axis=0)))
        raise MeasurementError(
            f"{bad} of {points.shape[1]} pixels have NaN or infinite coordinates"
        )
    # The triangle inequality over the arrays' centres is quick, and mostly enough.
    if _longest_about(profiles, points) <= profiles.unambiguous:
        return
    corners = np.array(np.meshgrid(*np.stack([low, high], axis=1))).reshape(3, -1)
    # A length is convex, over the points' places and over the antennas': at most what corners of
    # the boxes around them give.
    if np.all(_longest_possible(profiles, corners) <= profiles.unambiguous):
        return
    bound = _longest_possible(profiles, points)
    longest = _longest_path(profiles, points[:, bound > profiles.unambiguous])
    if longest > profiles.unambiguous:
        ways = profiles.passes * len(profiles.legs)
        raise MeasurementError(
            f"pixels reach {longest / ways:.3f} m from the array, but the frequency step is "
            f"unambiguous only up to {profiles.unambiguous / ways:.3f} m; take smaller frequency "
            "steps or a nearer grid"
        )


def _longest_about(profiles: RangeProfiles, points: Float[np.ndarray, "3 points"]) -> float:
    """Bound all paths by those to the antennas' centres. [m]."""
    ways = 0.0
    for leg in profiles.legs:
        centre = leg.mean(axis=0)
        square = sum((row - middle) ** 2 for row, middle in zip(points, centre, strict=True))
        ways += float(np.sqrt(np.max(square)) + np.linalg.norm(leg - centre, axis=-1).max())
    return profiles.passes * ways


def _longest_possible(
    profiles: RangeProfiles, points: Float[np.ndarray, "3 points"]
) -> Float[np.ndarray, " points"]:
    """Bound the paths from points to the antennas. [m]."""
    ways = np.sum([_farthest_corner(leg, points) for leg in profiles.legs], axis=0)
    return np.asarray(profiles.passes * ways)


def _farthest_corner(
    leg: Float[np.ndarray, "channels 3"], points: Float[np.ndarray, "3 points"]
) -> Float[np.ndarray, " points"]:
    """Distance of each point to the farthest corner of the box around a leg's antennas. [m]."""
    low, high = leg.min(axis=0)[:, None], leg.max(axis=0)[:, None]
    far = np.maximum(np.abs(points - low), np.abs(points - high))
    distance: np.ndarray = np.sqrt(np.einsum("xp,xp->p", far, far))
    return distance


def _longest_path(profiles: RangeProfiles, points: Float[np.ndarray, "3 points"]) -> float:
    longest = 0.0
    for channel in zip(*profiles.legs, strict=True) if points.size else ():
        path = sum(np.linalg.norm(points - end[:, None], axis=0) for end in channel)
        longest = max(longest, profiles.passes * float(np.max(path)))
    return longest
