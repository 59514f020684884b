r"""Samples of the other time convention, told by their focus.

Recorded as :math:`e^{-j\omega t}`, a wave of delay :math:`\tau` appears here with the delay
:math:`c/\Delta f - \tau` (of a path), from the other side, and converging: nothing real does. Its
samples' conjugate is focused, at the length and with the curvature that belong together; the
samples are not. So both are focused at the delays that hold most energy, in all directions, and the
brightest decides. A flat wave (from far away, or over a mirror that faces the array) is none of
both: it is tried as well, and where it is brightest nothing is said.

Along a line of elements a wave from (u, w) is bent by :math:`(1 - u^2) / 2R`, whatever its other
cosine w: so of a planar array its middle row and its middle column are tried, as two lines.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.array.planar_array import planar_array, spans_a_plane
from estimator.imaging.phase_curvature import profiles_at
from estimator.imaging.range_compression import RangeProfiles, range_profiles
from estimator.measurement.model import Echo, MeasurementError, Uplink

BRIGHTER = 3.0
"""Intensity of the conjugate's focus over that of the samples, from which they are of the other
convention. Echoes and pilots of the rooms of :mod:`validation.trials.contradictory_data` and of
five of the library have 1.0 at most, with half of the positions lost too, as any true wave is more
like a flat one than like one that converges, and 287 random rooms 1.3; conjugated, pilots over a
rough wall near by have 2.1, all others 3.2 to 21. [-]"""
DELAYS = 2
"""Strongest delays at which is focused, for time: one decides. [-]"""
MIDDLE = 1 / 8
"""Part of the array over which energies are summed: there the length of a wave from aside changes
by a cell or two. [-]"""
NEAREST = 0.5
"""Distance below which nothing is focused, over the array's extent. [-]"""
STEPS = 1.2
"""Directions for each cell λ/nD: between two, a peak loses 2.6 dB, alike in both. [-]"""
FEWEST = 3
"""Fewest elements of a line: two tell no curvature. [-]"""
FLAT = 1e4
"""Least distance of a point whose wave is flat: it bends by 0.08 rad over 1 m at 300 GHz. [m]"""


def refuse_other_convention(data: Echo | Uplink, name: str) -> None:
    """Refuse samples of a linear or planar array that only their conjugate explains.

    Parameters
    ----------
    data
        In the array's frame: its line along x, or its plane along x and z, boresight along y.
    name
        What it is called.

    Raises
    ------
    MeasurementError
        If the conjugate is focused brighter by :data:`BRIGHTER`.
    """
    ratio = brighter_conjugated(data)
    if ratio > BRIGHTER:
        raise MeasurementError(
            f"{name}: all waves converge, and the conjugated samples are focused "
            f"{10 * np.log10(ratio):.0f} dB brighter (the limit is {10 * np.log10(BRIGHTER):.0f} "
            "dB): they are of the other time convention; import them with time_convention = "
            '"exp(-jwt)", or conjugate them'
        )


def brighter_conjugated(data: Echo | Uplink) -> float:
    """Return the brightest focus of the conjugate over that of the samples themselves. [-].

    0 where no line of elements tells it.
    """
    both = np.array([_focused(line) for line in _lines(data)]).reshape(-1, 2).sum(axis=0)
    return float(both[1] / both[0]) if both[0] > 0 else 0.0


def _lines(data: Echo | Uplink) -> tuple[Echo | Uplink, ...]:
    """Return a linear array itself; of a planar one its middle row and its middle column, along x.

    Transmitters that stand apart from a planar array's receivers make no rows: nothing is returned.
    """
    if not spans_a_plane(data.positions):
        return (data,)
    if isinstance(data, Echo) and data.transmit_positions is not None:
        return ()
    lines = []
    spacing = planar_array(data.positions).spacing
    for along, across, apart in ((0, 2, spacing[1]), (2, 0, spacing[0])):
        places = data.positions[:, across]
        middle = places[np.argmin(np.abs(places))]
        chosen = np.flatnonzero(np.abs(places - middle) < 0.5 * apart)
        chosen = chosen[np.argsort(data.positions[chosen, along], kind="stable")]
        # The other axis is turned away: along a line a wave is bent whatever its cosine there.
        turned = data.positions[chosen][:, [along, 1, across]] - np.array([0.0, 0.0, middle])
        lines.append(replace(data, samples=data.samples[chosen], positions=turned))
    return tuple(lines)


def _focused(data: Echo | Uplink) -> tuple[float, float]:
    """Return the brightest focus of the samples of a line, and of their conjugate. [-]."""
    extent = float(np.ptp(data.positions[:, 0]))
    wave = speed_of_light / float(data.frequencies[-1])
    if len(data.positions) < FEWEST or extent < wave:
        return 0.0, 0.0
    ways = 2 if isinstance(data, Echo) else 1
    # All directions: a user beside the array is focused in his own, or his conjugate is brighter.
    steps = int(np.ceil(2 * STEPS * ways * extent / wave))
    sines = np.linspace(-1.0, 1.0, steps + 1)
    same = range_profiles(data)
    longest = same.unambiguous / ways
    ranges = _strongest(same, NEAREST * extent * ways) / ways
    flat = _brightest(same, ranges + longest * np.ceil(FLAT / longest), sines)
    here = max(flat, _brightest(same, ranges, sines))
    # A profile with a period is, of the conjugate, the conjugate of the same at minus the length.
    other, sign = same, -1.0
    if same.coefficients.shape[1] != round(longest * ways / same.cell):
        other, sign = range_profiles(replace(data, samples=data.samples.conj())), 1.0
    there = max(flat, _brightest(other, longest - ranges, sines, sign))
    return here, there


def _strongest(profiles: RangeProfiles, nearest: float) -> Float[np.ndarray, " lengths"]:
    """Return the path lengths with most energy, not within a length of either end. [m].

    They are those of the array's middle: from aside, its ends hear a wave many cells sooner and
    later, and focused at their length it would be dim.
    """
    channels = len(profiles.coefficients)
    half = max(1, round(0.5 * MIDDLE * channels))
    middle = profiles.coefficients[channels // 2 - half : channels // 2 + half + 1, :, 0]
    energy = (np.abs(middle) ** 2).sum(axis=0).astype(float)
    cells = energy.size
    away = np.arange(cells) * profiles.cell
    energy[np.minimum(away, profiles.unambiguous - away) < nearest] = 0.0
    beside = max(2, cells // 200)
    found: list[float] = []
    while len(found) < DELAYS and energy.any():
        at = int(np.argmax(energy))
        found.append(float(away[at]))
        energy[max(0, at - beside) : at + beside + 1] = 0.0
    return np.array(found)


def _brightest(
    profiles: RangeProfiles,
    ranges: Float[np.ndarray, " ranges"],
    sines: Float[np.ndarray, " sines"],
    sign: float = 1.0,
) -> float:
    """Return the largest intensity in a plane at some ranges, with the lengths' sign. [-]."""
    most = 0.0
    for reach in ranges:
        x, y = reach * sines, reach * np.sqrt(1 - sines**2)
        path = sum(
            np.sqrt((x[:, None] - a) ** 2 + (y[:, None] - b) ** 2 + c**2)
            for a, b, c in (ends.T for ends in profiles.legs)
        )
        read = profiles_at(profiles, sign * profiles.passes * path)
        focused = np.abs(read.sum(axis=-1)) ** 2
        most = max(most, float(focused.max()))
    return most
