"""The estimator, whole: image, mirrors, angle/range map, paths, position."""

import time
from dataclasses import replace

import numpy as np
from scipy.constants import speed_of_light

from estimator.array.array_frame import ArrayFrame, array_frame
from estimator.array.linear_array import echo_reach, echo_resolution, imaged_sine
from estimator.array.planar_array import spans_a_plane
from estimator.array.resolution import largest_spacing
from estimator.array.resolution_cell import Resolution
from estimator.channel.angle_range_map_2d import (
    angle_range_map,
    default_angles,
    default_path_lengths,
)
from estimator.channel.path_extraction_2d import find_paths
from estimator.localization.locate_3d import locate_in_space
from estimator.mapping.map_2d import build_room_map, mirrors_in_world, targets_in_world
from estimator.mapping.map_images import room_images
from estimator.measurement.model import Echo, Measurement, Uplink, frequency_step
from estimator.positioning.diffuse_fallback import with_diffuse_search
from estimator.positioning.position_decision_2d import decide
from estimator.results.estimate import AngleRangeMap, Estimate, Progress, UserEstimate

NO_IMAGE = Resolution(along_ray=0.0, across_ray=0.0)
CLOSE_UP = 80
"""Samples of the close-up to either side."""
CLOSE_UP_SAMPLES = 8
"""Samples of the close-up for each resolution cell λ/D or c/B."""

MAP_SAMPLES = 1.5
"""Samples of the angle/range map for each -3 dB width: a peak between them loses 1.3 dB at
most, and is refined off the grid. [-]"""


def locate(measurement: Measurement, *, progress: Progress | None = None) -> Estimate:
    """Find mirrors and users from a measurement alone.

    Parameters
    ----------
    measurement
        Echo and uplinks of a linear or a planar array; either may be missing.
    progress
        Told each stage.

    Returns
    -------
    Mirrors, users and the images, all in the world frame.

    Raises
    ------
    MeasurementError
        If the array is neither linear nor planar, or the frequency grid not uniform.
    """
    if spans_a_plane((measurement.echo or measurement.uplinks[0]).positions):
        return locate_in_space(measurement, progress=progress)
    tell = progress or (lambda stage, done, total: None)
    timings: dict[str, float] = {}
    notes = []
    clock_known = measurement.clock_offset is not None
    echo, uplinks = measurement.echo, _on_our_clock(measurement)
    frequency_step((echo or uplinks[0]).frequencies)  # refused before any work
    positions = (echo or uplinks[0]).positions
    frame = array_frame(positions, measurement.boresight)
    steps = 2 + len(uplinks)

    tell("estimate", 0, steps)
    raw = corrected = None
    local_echo = None
    room = None
    if echo is None:
        notes.append("no echo was measured, so nothing is known of mirrors")
    else:
        started = time.perf_counter()
        apart = echo.transmit_positions
        local_echo = replace(
            echo,
            positions=frame.to_local(echo.positions),
            transmit_positions=None if apart is None else frame.to_local(apart),
        )
        notes += _aliasing_notes(local_echo)
        room = build_room_map(local_echo)
        timings["mirrors"] = time.perf_counter() - started
    tell("estimate", 1, steps)

    users, maps, close_ups = [], [], []
    for index, uplink in enumerate(uplinks):
        started = time.perf_counter()
        local = replace(uplink, positions=frame.to_local(uplink.positions))
        looked = angle_range_map(
            local,
            aoa=default_angles(local, cells=MAP_SAMPLES),
            path_length=default_path_lengths(local, cells=MAP_SAMPLES),
            centre=np.zeros(3),
        )
        maps.append(looked)
        found = decide(
            uplink.user,
            find_paths(local, looked, clock_known=clock_known),
            room.walls if room else (),
            resolution=echo_resolution(local_echo) if local_echo else NO_IMAGE,
            imaged=local_echo is not None,
            unassigned_peaks=room.unassigned_peaks if room else np.zeros((0, 3)),
            wall_covariance=room.joint_covariance if room else None,
            clock_known=clock_known,
            reach=echo_reach(local_echo)[1] if local_echo else np.inf,
            widest=imaged_sine(local_echo) if local_echo else 1.0,
            contrast=room.survey.contrast if room else 0.0,
        )
        if room and clock_known:
            found = with_diffuse_search(found, local, room.lines, room.walls, room.seen_through)
        notes += _clock_note(found)
        users.append(_in_world(found, frame))
        close_ups.append(_close_up(local, looked, found))
        timings[f"user {uplink.user}"] = time.perf_counter() - started
        tell("estimate", 2 + index, steps)

    if local_echo is not None and room is not None:
        started = time.perf_counter()
        ends = [frame.to_local(user.path) for user in users if user.path is not None]
        raw, corrected = room_images(local_echo, room, frame, ends)
        timings["images"] = time.perf_counter() - started
    tell("estimate", steps, steps)
    return Estimate(
        users=tuple(users),
        mirrors=mirrors_in_world(room, frame) if room else (),
        targets=targets_in_world(room, frame) if room else (),
        raw_image=raw,
        corrected_image=corrected,
        maps=tuple(maps),
        close_ups=tuple(close_ups),
        notes=tuple(notes),
        timings=timings,
    )


def _clock_note(found: UserEstimate) -> list[str]:
    """Say what a user's unknown clock was found to be off by."""
    if found.clock_offset is None or found.clock_deviation is None or found.status != "found":
        return []
    paths = sum(path.used for path in found.paths)
    return [
        f"the clock offset of {found.name!r} is unknown; its {paths} paths give "
        f"{1e9 * found.clock_offset:.4f} ± {1e9 * found.clock_deviation:.4f} ns"
    ]


def _aliasing_notes(echo: Echo) -> list[str]:
    """Say where the image ends because the positions are too far apart to tell more."""
    sine = imaged_sine(echo)
    spacing = float(np.ptp(echo.positions[:, 0])) / (len(echo.positions) - 1)
    if spacing <= largest_spacing(speed_of_light / float(echo.frequencies[-1])):
        return []
    return [
        f"positions {1e3 * spacing:.3g} mm apart tell echoes from their grating lobes within "
        f"{np.degrees(np.arcsin(sine)):.1f}° of broadside only; the image ends there"
    ]


def _close_up(uplink: Uplink, looked: AngleRangeMap, found: UserEstimate) -> AngleRangeMap:
    """Map the surroundings of the answer, or of the map's peak without one, finely."""
    if found.aoa is not None and found.path_length is not None:
        aoa, length = found.aoa, found.path_length
    else:
        peak = np.unravel_index(int(np.argmax(np.abs(looked.values))), looked.values.shape)
        aoa, length = float(looked.aoa[peak[0]]), float(looked.path_length[peak[1]])
    steps = np.arange(-CLOSE_UP, CLOSE_UP + 1) / CLOSE_UP_SAMPLES
    beam = speed_of_light / float(uplink.frequencies.mean()) / float(np.ptp(uplink.positions[:, 0]))
    cosines = np.cos(aoa) - beam * steps
    lengths = length + speed_of_light / float(np.ptp(uplink.frequencies)) * steps
    lengths = lengths[(lengths > looked.path_length[0]) & (lengths < looked.path_length[-1])]
    return angle_range_map(
        uplink,
        aoa=np.arccos(cosines[np.abs(cosines) < 1]),
        path_length=lengths,
        centre=np.zeros(3),
    )


def _on_our_clock(measurement: Measurement) -> tuple[Uplink, ...]:
    """Take a known offset of the user's clock out of its pilot.

    A clock that is ahead by δ sends early: the pilot's delay appears δ too short.
    """
    offset = measurement.clock_offset or 0.0
    return tuple(
        replace(
            uplink,
            samples=uplink.samples * np.exp(-2j * np.pi * uplink.frequencies * offset),
        )
        for uplink in measurement.uplinks
    )


def _in_world(user: UserEstimate, frame: ArrayFrame) -> UserEstimate:
    if user.position is None or user.covariance is None or user.path is None:
        return user
    return replace(
        user,
        position=frame.to_world(user.position),
        covariance=frame.axes.T @ user.covariance @ frame.axes,
        path=frame.to_world(user.path),
        alternatives=tuple(_in_world(other, frame) for other in user.alternatives),
    )
