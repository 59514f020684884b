r"""Back-projection for any aperture onto any points, and its one-way version for an uplink.

Phases are kept to float64's accuracy with arithmetic in float32: distances are taken
relative to the array's centre, where :math:`r_m - R = (q^2 - 2 p \cdot q) / (r_m + R)` has no
cancellation, and what is common to all channels is applied once per point in float64.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import drjit as dr
import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.compute import engine
from estimator.compute.sincos import sincos_of_turns
from estimator.imaging.profile_tables import (
    CubicTable,
    FineTable,
    ProfileTable,
    cubic_table,
    fine_table,
    is_worth_it,
)
from estimator.imaging.range_compression import (
    RangeProfiles,
    range_profiles,
    refuse_points_out_of_range,
)
from estimator.measurement.model import Echo, MeasurementError, Uplink

POINTS_PER_LANE = 4
"""Points that share each load of an antenna position; 4 was fastest on AVX-512. [-]."""

FLAT = 1e-10
"""Extent below which an array does not span an axis: a phase of 1e-6 at 300 GHz. [m]."""


@dataclass(frozen=True, eq=False)
class Leg:
    """One end of the paths, in coordinates that the array spans: one if it is linear."""

    ends: Float[np.ndarray, "channels 3"]  # in the world frame [m]
    centre: Float[np.ndarray, " 3"]  # their mean [m]
    axes: Float[np.ndarray, "spanned 3"]  # unit vectors
    coordinates: tuple[Any, ...]  # Float: the ends along each axis, from the centre [m]


@dataclass(frozen=True, eq=False)
class Focuser:
    """Range profiles that lie in the memory of the device that focuses them."""

    profiles: RangeProfiles
    legs: tuple["Leg", ...]

    @cached_property
    def cubic(self) -> CubicTable:
        """For few points."""
        return cubic_table(self.profiles)

    @cached_property
    def fine(self) -> FineTable:
        """For many points: slow to make, fast to read."""
        return fine_table(self.profiles, self.cubic)


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
    focuser = Focuser(profiles, tuple(_leg(arrays, ends) for ends in profiles.legs))
    _ = focuser.cubic  # refused before any point is
    return focuser


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
    order = _axes_by_range(points, focuser.legs[-1].centre)
    ordered = np.moveaxis(points, order, range(len(order)))
    columns = np.moveaxis(ordered, -1, 0).reshape(3, -1).astype(np.float64)
    refuse_points_out_of_range(focuser.profiles, columns)
    image = _focus(focuser, columns, amplitude_ratio).reshape(ordered.shape[:-1])
    return np.moveaxis(image, range(len(order)), order).copy()


def _leg(arrays: Any, ends: Float[np.ndarray, "channels 3"]) -> Leg:
    centre = ends.mean(axis=0)
    directions = np.linalg.svd(ends - centre, full_matrices=False)[2]
    along = (ends - centre) @ directions.T
    spanned = np.abs(along).max(axis=0) > FLAT
    coordinates = [arrays.Float(column.astype(np.float32)) for column in along[:, spanned].T]
    return Leg(ends, centre, directions[spanned], tuple(coordinates))


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


def _focus(
    focuser: Focuser, columns: Float[np.ndarray, "3 points"], amplitude_ratio: bool
) -> Complex[np.ndarray, " points"]:
    """Run the kernel: one lane for every few points, one loop over the channels.

    Everything that varies from call to call enters as an array or an opaque value, so that
    Dr.Jit compiles once for each kind of array and weighting.
    """
    arrays = engine.arrays()
    profiles = focuser.profiles
    count = columns.shape[1]
    lanes = -(-count // POINTS_PER_LANE)
    coordinates = [arrays.Float64(column) for column in columns]
    last = dr.opaque(arrays.UInt32, count - 1)
    per_cell = dr.opaque(arrays.Float64, profiles.passes / profiles.cell)
    turns = dr.opaque(arrays.Float64, profiles.carrier * profiles.cell / speed_of_light)

    lane = dr.arange(arrays.UInt32, lanes)
    groups = []
    for i in range(POINTS_PER_LANE):
        index = dr.minimum(lane * POINTS_PER_LANE + i, last)
        point = [dr.gather(arrays.Float64, axis, index) for axis in coordinates]
        groups.append(_point_state(arrays, point, focuser.legs, per_cell))
    table: ProfileTable = focuser.fine if is_worth_it(profiles, count) else focuser.cubic
    sums = sum_over_channels(
        arrays,
        table,
        groups,
        per_cell,
        turns,
        places=partial(_places, arrays, focuser.legs),
        channels=(0, dr.opaque(arrays.UInt32, len(profiles.coefficients))),
        amplitude_ratio=amplitude_ratio,
    )

    norm = dr.opaque(arrays.Float64, table.scale / profiles.gain)
    channels = dr.opaque(arrays.Float64, len(profiles.coefficients))
    results = []
    for group, (re, im, weight) in zip(groups, sums, strict=True):
        # The phase of the path to the centre, reduced to one turn in float64.
        turn = group["cells"] * turns
        sine, cosine = dr.sincos((turn - dr.round(turn)) * (2 * np.pi))
        scale = norm * channels / arrays.Float64(weight) if amplitude_ratio else norm
        re, im = arrays.Float64(re), arrays.Float64(im)
        results.append(((re * cosine - im * sine) * scale, (re * sine + im * cosine) * scale))
    dr.eval(results)  # together: one kernel
    image = np.empty((lanes, POINTS_PER_LANE), dtype=np.complex128)
    for i, (re, im) in enumerate(results):
        image.real[:, i], image.imag[:, i] = re.numpy(), im.numpy()
    return image.ravel()[:count]


def _point_state(
    arrays: Any, point: list[Any], legs: tuple[Leg, ...], per_cell: Any
) -> dict[str, Any]:
    """Work out in float64 what a point needs in the loop, and round it to float32."""
    cells = arrays.Float64(0)
    states = []
    for leg in legs:
        p = [x - _opaque(arrays, c) for x, c in zip(point, leg.centre, strict=True)]
        square = dr.fma(p[0], p[0], dr.fma(p[1], p[1], p[2] * p[2]))
        distance = dr.sqrt(square)
        cells = cells + distance * per_cell
        twice = [
            2 * sum(_opaque(arrays, a) * x for a, x in zip(axis, p, strict=True))
            for axis in leg.axes
        ]
        states.append(tuple(arrays.Float(value) for value in (distance, square, *twice)))
    return point_state(arrays, states, cells)


def _places(arrays: Any, legs: tuple[Leg, ...], channel: Any) -> list[list[Any]]:
    return [[dr.gather(arrays.Float, axis, channel) for axis in leg.coordinates] for leg in legs]


def point_state(arrays: Any, legs: list[tuple[Any, ...]], cells: Any) -> dict[str, Any]:
    """Keep what a point needs in the loop: of each leg, and the path to the centre in cells."""
    whole = dr.round(cells)
    return {
        "legs": legs,
        "cells": cells,
        "cell": arrays.Int32(whole),
        "fraction": arrays.Float(cells - whole),
    }


def _opaque(arrays: Any, value: float) -> Any:
    return dr.opaque(arrays.Float64, float(value))


def sum_over_channels(
    arrays: Any,
    table: ProfileTable,
    groups: list[dict[str, Any]],
    per_cell: Any,
    turns: Any,
    *,
    places: Callable[[Any], list[list[Any]]],
    channels: tuple[Any, Any],
    amplitude_ratio: bool = False,
) -> list[tuple[Any, Any, Any]]:
    """Add up some channels for each group of points, less the phase to the centre.

    Parameters
    ----------
    arrays
        The backend's types.
    table
        Profiles of all channels.
    groups
        What :func:`point_state` returned.
    per_cell, turns
        Cells for each metre of a leg, and turns of the carrier for each cell.
    places
        Returns each leg's coordinates of a channel, from the centre that the points count from.
    channels
        The first, and the one after the last.
    amplitude_ratio
        As in :func:`focus`.

    Returns
    -------
    Real and imaginary parts in the table's scale, and the sums of squared ratios.
    """
    stride = dr.opaque(arrays.UInt32, table.cells)
    scale, turns = arrays.Float(per_cell), arrays.Float(turns)
    # A point on an antenna at the centre has 0/0 here; its path difference is 0 then.
    tiny = 1e-30

    def add_channel(channel: Any, row: Any, *sums: Any) -> tuple[Any, ...]:
        ends = places(channel)
        totals = []
        for group, (re, im, weight) in zip(groups, _by_three(sums), strict=True):
            shift, ratio = arrays.Float(0), arrays.Float(1)
            for (distance, square, *twice), q in zip(group["legs"], ends, strict=True):
                # |p - q|² - |p|², without cancellation of what q does not change
                excess = sum((a * (a - two) for a, two in zip(q, twice, strict=True)), 0.0)
                length = dr.sqrt(dr.maximum(square + excess, 0.0))
                shift = shift + excess / (distance + length + tiny)
                if amplitude_ratio:
                    ratio = ratio * distance / dr.maximum(length, tiny)
            shift = shift * scale
            place = (group["fraction"] + shift) * table.finer
            whole = dr.round(place)
            cell = arrays.UInt32(table.finer * group["cell"] + arrays.Int32(whole))
            profile_re, profile_im = table.read(arrays, row, cell, place - whole)
            turn = shift * turns
            sine, cosine = sincos_of_turns(turn)
            if amplitude_ratio:
                sine, cosine, weight = sine * ratio, cosine * ratio, dr.fma(ratio, ratio, weight)
            re = dr.fma(profile_re, cosine, dr.fma(-profile_im, sine, re))
            im = dr.fma(profile_re, sine, dr.fma(profile_im, cosine, im))
            totals += [re, im, weight]
        return (channel + 1, row + stride, *totals)

    width = dr.width(groups[0]["cells"])
    zeros = [dr.zeros(arrays.Float, width) for _ in range(3 * len(groups))]
    first = arrays.UInt32(channels[0])
    start = (first, first * stride, *zeros)
    _, _, *sums = dr.while_loop(start, lambda channel, *_: channel < channels[1], add_channel)
    return _by_three(sums)


def _by_three(values: list[Any] | tuple[Any, ...]) -> list[tuple[Any, Any, Any]]:
    return list(zip(values[0::3], values[1::3], values[2::3], strict=True))
