r"""MUSIC with spatial smoothing: angles closer together than the beam is wide.

All paths of one user carry the same pilot, so that one snapshot has rank one and MUSIC
finds nothing. Averaging over shifted parts of the array (forward and backward) restores the
rank. Shifting needs plane waves: the curvature of the wavefront from a given direction and
distance is taken out first, which serves sources near that place. The spectra of many
frequencies are averaged, each with its own steering vectors.
"""

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.channel.angle_range_map_2d import X_AXIS, Y_AXIS, polar_points
from estimator.measurement.model import MeasurementError, Uplink

SUBARRAY = (2, 3)
"""Elements of each shifted part over all, as a fraction. Parts of P of M elements, shifted forward
and backward, tell K < P paths, and restore a rank of K ≤ 2 (M − P + 1): both allow most at
P = 2 (M + 1)/3 (Pillai and Kwon, IEEE Trans. ASSP 37, 1989). [-]"""
LEAST_OUTSIDE = 1e-15
"""Least share of a steering vector in the noise space, about float64's rounding: the spectrum stays
finite. [-]"""
UNEVEN = 1e-3
"""Deviation of a spacing over their mean up to which an array is uniform: a phase of 3e-3 rad at
half a wavelength. [-]"""
SPACING = 0.5
"""Distance of path lengths whose waves span those between two limits: two a cell, so that lengths
between them are spanned as well. [cells c/B]"""
FREQUENCIES = 64
"""Frequencies that are used, evenly over the sweep: more gain little. [-]"""


def music_spectrum(
    uplink: Uplink,
    aoa: Float[np.ndarray, " angles"],
    *,
    paths: int,
    towards: float = np.pi / 2,
    distance: float | None = None,
    path_length: tuple[float, float] | None = None,
    subarray: int | None = None,
    axis: Float[np.ndarray, " 3"] = X_AXIS,
    boresight: Float[np.ndarray, " 3"] = Y_AXIS,
) -> Float[np.ndarray, " angles"]:
    r"""Evaluate the smoothed MUSIC pseudo-spectrum of a uniform linear array.

    Parameters
    ----------
    uplink
        Pilot of one user.
    aoa
        Angles from the array's axis. [rad]
    paths
        Dimension of the signal space.
    towards, distance
        Direction [rad] and distance [m] of the wavefront whose curvature is taken out;
        no distance: the waves are plane.
    path_length
        Only paths between these lengths are looked at; ``None``: all. [m]
    subarray
        Elements of each shifted part; ``None``: two thirds of the array.
    axis, boresight
        Unit vectors along the array and to the side of the sources.

    Returns
    -------
    1 / (mean share of the steering vector in the noise space); peaks at sources. [-]

    Raises
    ------
    MeasurementError
        If the array is not uniform along the axis or too small for so many paths.
    """
    offsets = uplink.positions - uplink.positions.mean(axis=0)
    along = offsets @ axis / np.linalg.norm(axis)
    order = np.argsort(along)
    spacing = _uniform_spacing(along[order])
    count = along.size
    part = subarray if subarray is not None else SUBARRAY[0] * count // SUBARRAY[1]
    if not (0 < paths < part <= count) or 2 * (count - part + 1) < paths:
        raise MeasurementError(
            f"{count} elements in parts of {part} cannot tell {paths} paths apart; the parts need "
            "more elements than paths, and half as many shifts as paths"
        )
    samples, frequencies = _selected(uplink, path_length)
    share = np.zeros(aoa.size)
    for spectrum, frequency in zip(samples.T, frequencies, strict=True):
        wavenumber = 2 * np.pi * frequency / speed_of_light
        flat = spectrum[order]
        if distance is not None:
            place = polar_points(
                aoa=np.array([towards]),
                path_length=np.array([distance]),
                centre=np.zeros(3),
                axis=axis,
                boresight=boresight,
            )[0, 0]
            length = np.linalg.norm(place - offsets[order], axis=1)
            bend = length - distance + along[order] * np.cos(towards)
            flat = flat * np.exp(1j * wavenumber * bend)
        windows = np.lib.stride_tricks.sliding_window_view(flat, part)
        snapshots = np.vstack([windows, windows[:, ::-1].conj()])
        signal = np.linalg.svd(snapshots, full_matrices=False)[2][:paths]
        steering = np.exp(
            1j * wavenumber * spacing * np.outer(np.cos(aoa), np.arange(part) - (part - 1) / 2)
        )
        inside = (np.abs(steering @ signal.conj().T) ** 2).sum(axis=1) / part
        share += np.maximum(1 - inside, LEAST_OUTSIDE)
    return np.asarray(frequencies.size / share)


def _uniform_spacing(along: Float[np.ndarray, " elements"]) -> float:
    if along.size < 3:
        raise MeasurementError(f"{along.size} elements; MUSIC needs at least three")
    steps = np.diff(along)
    spacing = float(steps.mean())
    if not spacing > 0 or np.abs(steps - spacing).max() > UNEVEN * spacing:
        raise MeasurementError(
            f"elements are {1e3 * steps.min():.4g} to {1e3 * steps.max():.4g} mm apart along the "
            "axis; smoothing needs a uniform linear array"
        )
    return spacing


def _selected(
    uplink: Uplink, path_length: tuple[float, float] | None
) -> tuple[Complex[np.ndarray, "elements chosen"], Float[np.ndarray, " chosen"]]:
    """Choose some frequencies, after cutting path lengths out if that is asked."""
    samples, frequencies = uplink.samples, uplink.frequencies
    if path_length is not None:
        low, high = path_length
        bandwidth = float(frequencies[-1] - frequencies[0])
        if not 0 <= low < high or (high - low) * bandwidth < speed_of_light:
            raise MeasurementError(
                f"path lengths {low:g} … {high:g} m hold less than one range cell "
                f"({speed_of_light / bandwidth:.3g} m)"
            )
        # Projection onto the lengths' own waves, over the same frequencies: no new grid.
        cells = np.arange(low, high, SPACING * speed_of_light / bandwidth)
        basis = np.exp(-2j * np.pi * np.outer(frequencies, cells) / speed_of_light)
        q = np.linalg.qr(basis)[0]
        samples = (samples @ q.conj()) @ q.T
    chosen = np.unique(np.linspace(0, frequencies.size - 1, FREQUENCIES).astype(np.int64))
    return samples[:, chosen], frequencies[chosen]
