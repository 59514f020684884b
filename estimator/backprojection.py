r"""Back-projection for any aperture onto any points, and its one-way version for an uplink.

Phases are kept to float64's accuracy with arithmetic in float32: distances are taken
relative to the array's centre, where :math:`r_m - R = (q^2 - 2 p \cdot q) / (r_m + R)` has no
cancellation, and what is common to all channels is applied once per point in float64.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator import engine
from estimator.measurement import Echo, MeasurementError, Uplink
from estimator.range_profiles import RangeProfiles, range_profiles

POINTS_PER_LANE = 4
"""Points that share each load of an antenna position; 4 was fastest on AVX-512. [-]"""


@dataclass(frozen=True, eq=False)
class Focuser:
    """Range profiles that lie in the memory of the device that focuses them."""

    profiles: RangeProfiles
    table: Any  # Float: two packets of four for each channel and cell
    antennas: tuple[Any, ...]  # Float, one per leg: (-2q, |q|²) for each channel
    centres: tuple[Float[np.ndarray, " 3"], ...]  # the origin of each leg's q [m]


def backproject(
    echo: Echo,
    pixels: Float[np.ndarray, "*grid 3"],
    *,
    weights: Float[np.ndarray, "#positions #freqs"] | None = None,
) -> Complex[np.ndarray, "*grid"]:
    r"""Form a SAR image by back-projection.

    Evaluates (2-9) of the thesis for free space, on points instead of wavenumbers:

    .. math:: I(p) = \frac{1}{\sum w_{mn}} \sum_{m,n} w_{mn} s_{mn}
              e^{+j 2 \pi f_n (\lVert p - t_m \rVert + \lVert p - q_m \rVert) / c}

    with the transmit positions :math:`t_m = q_m` in a monostatic echo.

    Parameters
    ----------
    echo
        Stepped-frequency echo :math:`s_{mn}`.
    pixels
        Pixel centres :math:`p` in the world frame. [m]
    weights
        Taper :math:`w_{mn}`; ``None``: all one. [-]

    Returns
    -------
    Complex image; an ideal unit point target peaks at 1. The error against the direct sum
    in float64 stays below -60 dB of that. [-]

    Raises
    ------
    MeasurementError
        If a pixel lies beyond the unambiguous range or is not finite.
    """
    return focus(prepare(range_profiles(echo, weights=weights)), pixels)


def focus_uplink(
    uplink: Uplink,
    points: Float[np.ndarray, "*grid 3"],
    *,
    weights: Float[np.ndarray, "#elements #freqs"] | None = None,
    amplitude_ratio: bool = False,
) -> Complex[np.ndarray, "*grid"]:
    r"""Match one user's pilot to a spherical wave from each point, over the whole band.

    .. math:: A(p) = \frac{\sum_{m,n} w_{mn} a_m s_{mn} e^{+j 2 \pi f_n r_m / c}}
              {\sum_{m,n} w_{mn} a_m^2}

    with :math:`a_m = 1`, or the ratio (3-10) :math:`a_m = R / r_m`, R from the centre of the
    array.

    Parameters
    ----------
    uplink
        Pilot :math:`s_{mn}` at the elements.
    points
        Candidate sources in the world frame. [m]
    weights
        Taper :math:`w_{mn}`; ``None``: all one. [-]
    amplitude_ratio
        Whether the wave's decay along the array is matched too; then the weights must not
        vary over the elements.

    Returns
    -------
    Complex amplitude at the array's centre that a source at the point would explain. [-]

    Raises
    ------
    MeasurementError
        If a point lies beyond the unambiguous path or is not finite.
    """
    if amplitude_ratio and weights is not None and np.ptp(weights, axis=0).any():
        raise MeasurementError(
            "a taper over the elements and the amplitude ratio exclude each other; "
            "taper over frequency only"
        )
    focuser = prepare(range_profiles(uplink, weights=weights))
    return focus(focuser, points, amplitude_ratio=amplitude_ratio)


def prepare(profiles: RangeProfiles) -> Focuser:
    """Move range profiles to the device, to focus them several times.

    Raises
    ------
    MeasurementError
        If they are too many for the device's 32-bit addresses.
    """
    arrays = engine.arrays()
    coefficients = profiles.coefficients
    if coefficients.size * 2 >= 2**32:
        raise MeasurementError(
            f"{coefficients.shape[0]} positions x {coefficients.shape[1]} range cells are more "
            "than 32-bit addresses reach; image the positions in parts and add the images"
        )
    centres = tuple(leg.mean(axis=0) for leg in profiles.legs)
    antennas = tuple(
        _own(arrays.Float(_antenna_table(leg - centre)))
        for leg, centre in zip(profiles.legs, centres, strict=True)
    )
    flat = np.ascontiguousarray(coefficients).view(np.float32).ravel()
    table = _own(arrays.Float(flat))
    return Focuser(profiles, table, antennas, centres)


def focus(
    focuser: Focuser, points: Float[np.ndarray, "*grid 3"], *, amplitude_ratio: bool = False
) -> Complex[np.ndarray, "*grid"]:
    """Focus prepared range profiles on points.

    Parameters
    ----------
    focuser
        What :func:`prepare` returned.
    points
        Points of any grid, in the world frame. [m]
    amplitude_ratio
        Weigh with the ratio (3-10) of distances, centre over element.

    Returns
    -------
    Complex amplitudes. [-]

    Raises
    ------
    MeasurementError
        If a point lies beyond the unambiguous range or is not finite.
    """
    shape = points.shape[:-1]
    if not points.size:
        return np.zeros(shape, dtype=np.complex128)
    order = _axes_by_range(points, focuser.centres[-1])
    ordered = np.moveaxis(points, order, range(len(order)))
    flat = np.ascontiguousarray(ordered.reshape(-1, 3), dtype=np.float64)
    _refuse_points_out_of_range(focuser, flat)
    image = _focus(focuser, flat, amplitude_ratio).reshape(ordered.shape[:-1])
    return np.moveaxis(image, range(len(order)), order).copy()


def _own(mapped: Any) -> Any:
    """Copy an array into Dr.Jit's memory: it loads no packets from memory that NumPy aligned."""
    copy = mapped + dr.opaque(type(mapped), 0.0)
    dr.eval(copy)
    return copy


def _antenna_table(positions: Float[np.ndarray, "channels 3"]) -> Float[np.ndarray, " values"]:
    squares = (positions**2).sum(axis=1, keepdims=True)
    return np.hstack([-2 * positions, squares]).astype(np.float32).ravel()


def _axes_by_range(
    points: Float[np.ndarray, "*grid 3"], centre: Float[np.ndarray, " 3"]
) -> tuple[int, ...]:
    """Order a grid's axes so that range varies least along the last one.

    Points that are worked on together then read the same few cells of each profile.
    """
    dims = points.ndim - 1
    middle = tuple(size // 2 for size in points.shape[:-1])
    changes = []
    for axis in range(dims):
        line = points[(*middle[:axis], slice(None), *middle[axis + 1 :])]
        distance = np.linalg.norm(line - centre, axis=-1)
        changes.append(np.abs(np.diff(distance)).mean() if distance.size > 1 else np.inf)
    return tuple(int(axis) for axis in np.argsort(changes, kind="stable")[::-1])


def _refuse_points_out_of_range(focuser: Focuser, points: Float[np.ndarray, "points 3"]) -> None:
    profiles = focuser.profiles
    bad = int(np.count_nonzero(~np.isfinite(points).all(axis=1)))
    if bad:
        raise MeasurementError(f"{bad} of {len(points)} pixels have NaN or infinite coordinates")
    reach = np.zeros(len(points))  # upper bound of each point's longest path
    for leg, centre in zip(profiles.legs, focuser.centres, strict=True):
        size = np.linalg.norm(leg - centre, axis=1).max()
        reach += profiles.passes * (_norm(points - centre) + size)
    doubtful = points[reach > profiles.unambiguous]
    longest = 0.0
    for legs in zip(*profiles.legs, strict=True) if len(doubtful) else ():
        path = profiles.passes * sum((_norm(doubtful - end) for end in legs), np.zeros(1))
        longest = max(longest, float(path.max()))
    if longest > profiles.unambiguous:
        ways = profiles.passes * len(profiles.legs)
        raise MeasurementError(
            f"pixels reach {longest / ways:.3f} m from the array, but the frequency step is "
            f"unambiguous only up to {profiles.unambiguous / ways:.3f} m; take smaller frequency "
            "steps or a nearer grid"
        )


def _norm(vectors: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, " points"]:
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", vectors, vectors)))


def _focus(
    focuser: Focuser, points: Float[np.ndarray, "points 3"], amplitude_ratio: bool
) -> Complex[np.ndarray, " points"]:
    """Run the kernel: one lane for every few points, one loop over the channels.

    Everything that varies from call to call enters as an array or an opaque value, so that
    Dr.Jit compiles once for each number of legs and kind of weighting.
    """
    arrays = engine.arrays()
    profiles = focuser.profiles
    channels = len(profiles.coefficients)
    count = len(points)
    lanes = -(-count // POINTS_PER_LANE)
    coordinates = [arrays.Float64(np.ascontiguousarray(points[:, i])) for i in range(3)]
    last = dr.opaque(arrays.UInt32, count - 1)
    per_cell = dr.opaque(arrays.Float64, profiles.passes / profiles.cell)
    turns_per_cell = profiles.carrier * profiles.cell / speed_of_light
    turns = dr.opaque(arrays.Float64, turns_per_cell)
    end = dr.opaque(arrays.Float64, channels)

    lane = arrays.UInt32(dr.arange(arrays.UInt32, lanes))
    groups = []
    for i in range(POINTS_PER_LANE):
        index = dr.minimum(lane * POINTS_PER_LANE + i, last)
        point = [dr.gather(arrays.Float64, axis, index) for axis in coordinates]
        groups.append(_point_state(arrays, point, focuser.centres, per_cell))
    sums = _sum_over_channels(arrays, focuser, groups, per_cell, turns, amplitude_ratio)

    norm = dr.opaque(arrays.Float64, 1.0 / profiles.gain)
    results = []
    for group, (re, im, weight) in zip(groups, sums, strict=True):
        # The phase of the path to the centre, reduced to one turn in float64.
        turn = group["cells"] * turns
        sine, cosine = dr.sincos((turn - dr.round(turn)) * (2 * np.pi))
        scale = norm
        if amplitude_ratio:
            scale = norm * end / arrays.Float64(weight)
        re, im = arrays.Float64(re), arrays.Float64(im)
        results.append(((re * cosine - im * sine) * scale, (re * sine + im * cosine) * scale))
    dr.eval(results)  # together: one kernel
    image = np.empty((lanes, POINTS_PER_LANE), dtype=np.complex128)
    for i, (re, im) in enumerate(results):
        image.real[:, i], image.imag[:, i] = re.numpy(), im.numpy()
    return image.ravel()[:count]


def _point_state(
    arrays: Any, point: list[Any], centres: tuple[Float[np.ndarray, " 3"], ...], per_cell: Any
) -> dict[str, Any]:
    """Work out in float64 what a point needs in the loop, and round it to float32."""
    cells = arrays.Float64(0)
    legs = []
    for centre in centres:
        p = [x - dr.opaque(arrays.Float64, float(c)) for x, c in zip(point, centre, strict=True)]
        square = dr.fma(p[0], p[0], dr.fma(p[1], p[1], p[2] * p[2]))
        distance = dr.sqrt(square)
        cells = cells + distance * per_cell
        legs.append(tuple(arrays.Float(value) for value in (*p, distance, square)))
    whole = dr.round(cells)
    return {
        "legs": legs,
        "cells": cells,
        "cell": arrays.Int32(whole),
        "fraction": arrays.Float(cells - whole),
    }


def _by_three(values: list[Any] | tuple[Any, ...]) -> list[tuple[Any, Any, Any]]:
    return list(zip(values[0::3], values[1::3], values[2::3], strict=True))


def _sum_over_channels(
    arrays: Any,
    focuser: Focuser,
    groups: list[dict[str, Any]],
    per_cell: Any,
    turns: Any,
    amplitude_ratio: bool,
) -> list[tuple[Any, Any, Any]]:
    """Add up all channels for each group of points, less the phase to the centre."""
    channels, cells, _ = focuser.profiles.coefficients.shape
    end = dr.opaque(arrays.UInt32, channels)
    stride = dr.opaque(arrays.UInt32, cells)
    scale, turns = arrays.Float(per_cell), arrays.Float(turns)
    # A point on an antenna at the centre has 0/0 here; its path difference is 0 then.
    tiny = 1e-30

    def add_channel(channel: Any, row: Any, *sums: Any) -> tuple[Any, ...]:
        ends = [dr.gather(arrays.Array4f, antennas, channel) for antennas in focuser.antennas]
        totals = []
        for group, (re, im, weight) in zip(groups, _by_three(sums), strict=True):
            shift = arrays.Float(0)
            for (x, y, z, distance, square), q in zip(group["legs"], ends, strict=True):
                excess = dr.fma(x, q[0], dr.fma(y, q[1], dr.fma(z, q[2], q[3])))
                length = dr.sqrt(dr.maximum(square + excess, 0.0))
                shift = shift + excess / (distance + length + tiny)
            shift = shift * scale
            place = group["fraction"] + shift
            whole = dr.round(place)
            v = place - whole
            packet = 2 * (row + arrays.UInt32(group["cell"] + arrays.Int32(whole)))
            low = dr.gather(arrays.Array4f, focuser.table, packet)
            high = dr.gather(arrays.Array4f, focuser.table, packet + 1)
            profile_re = dr.fma(v, dr.fma(v, dr.fma(v, high[2], high[0]), low[2]), low[0])
            profile_im = dr.fma(v, dr.fma(v, dr.fma(v, high[3], high[1]), low[3]), low[1])
            turn = shift * turns
            sine, cosine = dr.sincos((turn - dr.round(turn)) * (2 * np.pi))
            if amplitude_ratio:
                ratio = distance / dr.maximum(length, tiny)
                sine, cosine, weight = sine * ratio, cosine * ratio, dr.fma(ratio, ratio, weight)
            re = dr.fma(profile_re, cosine, dr.fma(-profile_im, sine, re))
            im = dr.fma(profile_re, sine, dr.fma(profile_im, cosine, im))
            totals += [re, im, weight]
        return (channel + 1, row + stride, *totals)

    width = dr.width(groups[0]["cells"])
    zeros = [dr.zeros(arrays.Float, width) for _ in range(3 * len(groups))]
    start = (arrays.UInt32(0), arrays.UInt32(0), *zeros)
    _, _, *sums = dr.while_loop(start, lambda channel, *_: channel < end, add_channel)
    return _by_three(sums)
