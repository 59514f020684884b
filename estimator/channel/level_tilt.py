r"""How a path's level changes over the band: what absorbs a wave takes more at higher frequencies.

Free space, metal and thick dielectrics act alike on a whole band; roughness, and above all the way
through a wall, take more from its upper end. The pilot is steered at the wave's apparent source and
gated about its delay; a line through its level in decibels, less that of free space
:math:`\lambda / 4 \pi L`, is the tilt.
"""

from dataclasses import replace

import numpy as np
from scipy.constants import speed_of_light

from estimator.channel.lit_elements import part_of
from estimator.channel.path import Path, PathSet
from estimator.geometry.bearing import Bearing
from estimator.measurement.model import Uplink

GATE = 6.0
"""Delays about the path's that are kept, to either side: nearer waves ripple slowly over the band,
and a pane's inner echoes stay. [cells c/B]"""
STEEP = 4
"""Power in the gate's exponent: flat within, and down by 140 dB at twice its width. [-]"""
EDGE = 0.1
"""Share of the band at either end that the gate's transform bends. [-]"""
FEWEST = 32
"""Fewest frequencies of which a tilt is told: so that the gate is narrower than the whole. [-]"""
UNEVEN = 1e-3
"""Differences of the steps over the step up to which frequencies are uniform. [-]"""


def with_level_tilts(uplink: Uplink, found: PathSet) -> PathSet:
    """Add to the paths of a pilot how their levels tilt over the band.

    Parameters
    ----------
    uplink
        The pilot, with positions in the array's frame; of uneven frequencies nothing is told.
    found
        Its paths.
    """
    band = float(np.ptp(uplink.frequencies))
    steps = np.diff(uplink.frequencies)
    if uplink.frequencies.size < FEWEST or not np.allclose(steps, steps[0], rtol=UNEVEN):
        return found
    paths = tuple(replace(path, tilt_db=_tilt(uplink, path, found.how)) for path in found.paths)
    return replace(found, paths=paths, bandwidth=band)


def _tilt(uplink: Uplink, path: Path, how: Bearing) -> float | None:
    """Return the change of a path's level over the band, over that of free space. [dB]."""
    source = path.radius * how.towards(path.free.bearing)
    centre = uplink.positions.mean(axis=0)
    reached = part_of(uplink, None if path.shadow is None else path.shadow.lit)
    lengths = np.linalg.norm(reached.positions - source, axis=-1)
    lengths = lengths - float(np.linalg.norm(centre - source)) + path.free.path_length
    turns = np.exp(2j * np.pi / speed_of_light * lengths[:, None] * uplink.frequencies)
    steered = np.mean(reached.samples * turns, axis=0)
    count = uplink.frequencies.size
    delays = np.fft.fftfreq(count) * count
    gate = np.exp(-((delays / GATE) ** STEEP))
    kept = np.abs(np.fft.fft(np.fft.ifft(steered) * gate))
    cut = slice(round(EDGE * count), count - round(EDGE * count))
    if not np.all(kept[cut] > 0):
        return None
    offsets = (uplink.frequencies[1] - uplink.frequencies[0]) * (
        np.arange(count) - 0.5 * (count - 1)
    )
    slope = np.polyfit(offsets[cut], 20 * np.log10(kept[cut]), 1)[0]
    free_space = 20 * np.log10(float(uplink.frequencies[0] / uplink.frequencies[-1]))
    return float(slope * np.ptp(uplink.frequencies) - free_space)
