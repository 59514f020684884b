"""Tests whether a scene is nearer than the aperture's length, or the array too large for a room."""

import numpy as np
from scipy.constants import speed_of_light

from estimator.array.planar_array import PlanarArray, planar_reach, planar_resolution
from estimator.array.windows import SURVEY_TAPER, frequency_taper
from estimator.imaging.energy_region import evenly_chosen, farthest_told
from estimator.imaging.range_compression import range_profiles, unambiguous_path
from estimator.measurement.model import Echo, MeasurementError

MOST_WORK = 1.5e11
"""Points times positions of a room's survey up to which it is done: some minutes on two cores.
[-]"""
FEWEST_CELLS = 4.0
"""Range cells between the array and the farthest distance that a room's survey needs. [-]"""


def close_scene(echo: Echo, *, nearest: float, planar: bool) -> str | None:
    """Say why a scene is imaged close by: its strongest thing is nearer than a room's would be.

    Parameters
    ----------
    echo
        In the array's frame.
    nearest
        Least distance of what a survey of the room shows. [m]
    planar
        Whether the array is planar: few frequencies then make a hologram.

    Returns
    -------
    ``None`` if the strongest is farther away; what the positions share counts for nothing.
    """
    unambiguous = unambiguous_path(echo.frequencies) / 2
    cell = speed_of_light / (2 * float(np.ptp(echo.frequencies)))
    told = farthest_told(echo, ahead=True)
    if planar and told > unambiguous:
        return (
            f"the frequency steps are unambiguous to {unambiguous:.3g} m only, the aperture tells "
            f"depths to {told:.3g} m, and anything farther away would appear at a wrong place"
        )
    chosen = evenly_chosen(len(echo.positions))
    samples = echo.samples - echo.samples.mean(axis=0)
    part = Echo(
        samples=samples[chosen] if np.any(samples[chosen]) else echo.samples[chosen],
        positions=echo.positions[chosen],
        frequencies=echo.frequencies,
        transmit_positions=None
        if echo.transmit_positions is None
        else echo.transmit_positions[chosen],
    )
    taper = frequency_taper(echo.frequencies, SURVEY_TAPER)[None, :]
    profiles = range_profiles(part, weights=taper)
    power = (np.abs(profiles.coefficients[..., 0]) ** 2).mean(axis=0)
    strongest = 0.5 * profiles.cell * int(np.argmax(power))
    if strongest > nearest:
        return None
    if strongest < cell and nearest < cell:  # all of it is one range cell
        if not planar:  # nothing tells
            return None
        return (
            f"the strongest echo is within the first range cell of {cell:.3g} m, where delays tell "
            "no wall from a thing nearby: only the aperture tells depths"
        )
    return (
        f"the strongest echo comes from {strongest:.3g} m, nearer than {nearest:.3g} m, from where "
        "on a room is surveyed"
    )


def too_large(echo: Echo, array: PlanarArray) -> str | None:
    """Say why an array is too large, or its frequencies too few, to survey a room with it."""
    try:
        nearest, farthest = planar_reach(array, echo, passes=2)
    except MeasurementError as cause:
        return str(cause)
    resolution = planar_resolution(array, echo)
    sine = array.unaliased(echo.frequencies, passes=2)
    beams = array.beam(echo.frequencies, passes=2)
    points = (farthest - nearest) / resolution.along_ray * float((2 * sine) ** 2 / np.prod(beams))
    if points * len(echo.positions) > MOST_WORK:
        return f"{len(echo.positions)} positions are more than a room is surveyed with"
    if farthest - nearest < FEWEST_CELLS * resolution.along_ray:
        return f"the band of {np.ptp(echo.frequencies) / 1e6:.4g} MHz resolves no ranges in reach"
    return None
