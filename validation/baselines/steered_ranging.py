"""An angle of arrival at a low band steers a mmWave beam, which measures the range.

Represents hybrids of a low and a high band: the low band finds the direction, so that the high
band needs no search of beams (Nitsche et al., "Steering with eyes closed", INFOCOM 2015, ranging
added). Infrastructure: one base station with a second array of 8 elements for 28 GHz, half a
wavelength apart (37 mm), beside ours, of which 32 elements form the plane-wave beams of a codebook
λ/2D apart (with all 260 the near field, in which such beams lose gain, would extend to 29 m). The
direction is that of the best beam, interpolated between its neighbours' powers; the position is at
the measured range along it. It assumes that the path is direct.
"""

from dataclasses import replace

import numpy as np
from scipy.constants import speed_of_light

from scenes.schema.radio import Radio
from validation.baselines.arrivals import first_arrival, plane_wave_angle
from validation.baselines.room import Fix, Room

LOW = Radio(start_ghz=27.5, stop_ghz=28.5, points=11)
"""The low band: 1 GHz about 28 GHz, as in 5G. [GHz]"""
LOW_ELEMENTS = 8
"""Antennas of the low band's array: 37 mm. [-]"""
BEAM_ELEMENTS = 32
"""Elements of ours that form a beam: beyond 0.44 m they are in the far field. [-]"""
MOST_BEAMS = 64
"""Beams listed on either side of the low band's direction: 0.034 in cosine apart, they cover all
directions; those in the low band's beam are tried. [-]"""


def steered_ranging(room: Room) -> Fix:
    """Find the direction at the low band, the best beam near it, and the range in that beam."""
    own = room.own_array
    low = replace(own, elements=LOW_ELEMENTS, spacing=LOW.shortest_wavelength / 2)
    coarse = plane_wave_angle(room.pilot(low, radio=LOW))
    pilot = room.pilot(replace(own, elements=min(BEAM_ELEMENTS, own.elements)))
    count = len(pilot.positions)
    width = speed_of_light / LOW.centre_frequency / (LOW_ELEMENTS * low.spacing)
    step = speed_of_light / float(pilot.frequencies.mean()) / (2 * count * own.spacing)
    near = step * np.round(np.cos(coarse) / step + np.arange(-MOST_BEAMS, MOST_BEAMS + 1))
    beams = near[(np.abs(near - np.cos(coarse)) <= width / 2 + step) & (np.abs(near) < 1)]
    along = (np.arange(count) - (count - 1) / 2) * own.spacing
    wavenumbers = 2 * np.pi * pilot.frequencies / speed_of_light
    outputs = [
        (np.exp(-1j * beam * np.outer(along, wavenumbers)) * pilot.samples).sum(axis=0)
        for beam in beams
    ]
    powers = np.array([float((np.abs(output) ** 2).sum()) for output in outputs])
    best = int(np.argmax(powers))
    cosine = float(beams[best])
    if 0 < best < len(beams) - 1:
        before, here, after = np.log(powers[best - 1 : best + 2])
        cosine += step * float(0.5 * (before - after) / (before - 2 * here + after))
    length = first_arrival(outputs[best], pilot.frequencies)
    if length is None:
        return Fix(position=None, reason="no beam hears the user")
    axis = pilot.positions[-1] - pilot.positions[0]
    angle = np.arctan2(axis[1], axis[0]) + np.arccos(cosine)
    return Fix(position=own.position + length * np.array([np.cos(angle), np.sin(angle)]))
