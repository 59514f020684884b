"""The estimator, whole: image, mirrors, angle/range map, paths, position."""

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.angle_range_map import angle_range_map, default_angles, default_path_lengths
from estimator.array_frame import ArrayFrame, array_frame
from estimator.backprojection import focus, prepare
from estimator.estimate import (
    AngleRangeMap,
    Estimate,
    Image,
    Mirror,
    Progress,
    UserEstimate,
)
from estimator.ghost_correction import corrected_image
from estimator.measurement import Echo, Measurement, Uplink, frequency_step
from estimator.mirror_fit import FittedLine
from estimator.mirrors import (
    Survey,
    detect_mirrors,
    echo_reach,
    echo_resolution,
    hides,
    imaged_sine,
    loose_peaks,
    survey,
)
from estimator.paths import find_paths
from estimator.pixel_grid import PixelGrid
from estimator.projection import Wall, mirrored
from estimator.range_profiles import range_profiles
from estimator.resolution import largest_spacing
from estimator.user_decision import decide

PIXELS = 2_000_000
"""Most pixels of an image that is shown; its spacing grows beyond."""
CLOSE_UP = 80
"""Samples of the close-up to either side."""
CLOSE_UP_SAMPLES = 8
"""Samples of the close-up for each resolution cell λ/D or c/B."""
MARGIN = 0.05
"""What an image shows around the outermost things in it. [m]."""

MAP_SAMPLES = 1.5
"""Samples of the angle/range map for each -3 dB width: a peak between them loses 1.3 dB at
most, and is refined off the grid. [-]"""


def locate(measurement: Measurement, *, progress: Progress | None = None) -> Estimate:
    """Find mirrors and users from a measurement alone.

    Parameters
    ----------
    measurement
        Echo and uplinks of a linear array; either may be missing.
    progress
        Told each stage.

    Returns
    -------
    Mirrors, users and the images, all in the world frame.

    Raises
    ------
    MeasurementError
        If the array is not linear or the frequency grid not uniform.
    """
    tell = progress or (lambda stage, done, total: None)
    timings: dict[str, float] = {}
    notes = []
    if measurement.clock_offset is None:
        notes.append("the clock offset of the user is unknown and was taken to be 0")
    echo, uplinks = measurement.echo, _on_our_clock(measurement)
    frequency_step((echo or uplinks[0]).frequencies)  # refused before any work
    positions = (echo or uplinks[0]).positions
    frame = array_frame(positions, measurement.boresight)
    steps = 2 + len(uplinks)

    tell("estimate", 0, steps)
    lines: tuple[FittedLine, ...] = ()
    raw = corrected = None
    walls: tuple[Wall, ...] = ()
    seen: tuple[tuple[int, ...], ...] = ()
    local_echo = looked_over = None
    loose = np.zeros((0, 3))
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
        looked_over = survey(local_echo)
        notes += _aliasing_notes(local_echo)
        lines = detect_mirrors(local_echo, looked_over)
        loose = loose_peaks(local_echo, looked_over, lines)
        lines, walls, seen = _folded(lines)
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
            find_paths(local, looked),
            walls,
            cell=echo_resolution(local_echo).across_ray if local_echo else 0.0,
            imaged=local_echo is not None,
            loose=loose,
        )
        users.append(_in_world(found, frame))
        close_ups.append(_close_up(local, looked, found))
        timings[f"user {uplink.user}"] = time.perf_counter() - started
        tell("estimate", 2 + index, steps)

    if local_echo is not None and looked_over is not None:
        started = time.perf_counter()
        ends = [frame.to_local(user.path) for user in users if user.path is not None]
        raw, corrected = _images(local_echo, looked_over, frame, walls, seen, ends)
        timings["images"] = time.perf_counter() - started
    tell("estimate", steps, steps)
    return Estimate(
        users=tuple(users),
        mirrors=tuple(
            _mirror(frame, line, wall, through)
            for line, wall, through in zip(lines, walls, seen, strict=True)
        ),
        raw_image=raw,
        corrected_image=corrected,
        maps=tuple(maps),
        close_ups=tuple(close_ups),
        notes=tuple(notes),
        timings=timings,
    )


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


def _folded(
    lines: Sequence[FittedLine],
) -> tuple[tuple[FittedLine, ...], tuple[Wall, ...], tuple[tuple[int, ...], ...]]:
    """Fold lines that are seen through others; those seen directly come first.

    A line whose midpoint is hidden behind a mirror is a wall's ghost: mirroring it about that
    mirror gives its true place.
    """
    direct = [a for a in lines if not any(hides(b, a.middle) for b in lines if b is not a)]
    ordered, walls = list(direct), [_wall(line) for line in direct]
    seen: list[tuple[int, ...]] = [()] * len(direct)
    for line in lines:
        if any(line is other for other in direct):
            continue
        through = next((i for i, wall in enumerate(direct) if hides(wall, line.middle)), None)
        if through is None:
            continue  # hidden by a ghost alone: over more mirrors than are folded here
        ordered.append(line)
        first = walls[through]
        ends = mirrored(np.stack([line.start, line.end]), first.start, first.end)
        walls.append(Wall(start=ends[0], end=ends[1], covariance=line.covariance))
        seen.append((through,))
    return tuple(ordered), tuple(walls), tuple(seen)


def _wall(line: FittedLine) -> Wall:
    return Wall(start=line.start, end=line.end, covariance=line.covariance)


def _mirror(frame: ArrayFrame, line: FittedLine, wall: Wall, through: tuple[int, ...]) -> Mirror:
    along = wall.end - wall.start
    normal = np.array([along[1], -along[0], 0.0]) / np.linalg.norm(along)
    middle = 0.5 * (wall.start + wall.end)
    if normal @ middle > 0:  # towards the array
        normal = -normal
    return Mirror(
        start=frame.to_world(wall.start),
        end=frame.to_world(wall.end),
        normal=frame.turned_to_world(normal),
        covariance=wall.covariance,
        confidence=line.confidence,
        level_db=float(10 * np.log10(line.level / line.background)),
        seen_through=through,
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


def _images(
    echo: Echo,
    looked_over: Survey,
    frame: ArrayFrame,
    walls: Sequence[Wall],
    seen: Sequence[tuple[int, ...]],
    paths: Sequence[Float[np.ndarray, "_ 3"]],
) -> tuple[Image, Image]:
    """Form the raw and the corrected image on one grid, around what was found."""
    focuser = prepare(range_profiles(echo))
    nearest, farthest = echo_reach(echo)
    sine = imaged_sine(echo)

    def focus_in_reach(points: Float[np.ndarray, "*grid 3"]) -> np.ndarray:
        """Focus where range and angle are unambiguous; elsewhere there is no image: 0."""
        distance = np.linalg.norm(points, axis=-1)
        inside = (distance > nearest) & (distance < farthest)
        inside &= (points[..., 1] > 0) & (np.abs(points[..., 0]) < sine * distance)
        values = np.zeros(points.shape[:-1], dtype=np.complex128)
        values[inside] = focus(focuser, points[inside])
        return values

    shown = [np.zeros((1, 3)), echo.positions, looked_over.peaks, *paths]
    shown += [np.stack([wall.start, wall.end]) for wall in walls]
    grid = _grid(frame.to_world(np.concatenate(shown)), echo_resolution(echo).along_ray)
    points = frame.to_local(grid.points)
    direct = [wall for wall, through in zip(walls, seen, strict=True) if not through]
    raw = focus_in_reach(points)
    corrected = corrected_image(focus_in_reach, points, direct)
    return Image(values=raw, grid=grid), Image(values=corrected, grid=grid)


def _grid(shown: Float[np.ndarray, "points 3"], cell: float) -> PixelGrid:
    """Cover all points that are to be seen, with two pixels a range cell if affordable."""
    low, high = shown.min(axis=0) - MARGIN, shown.max(axis=0) + MARGIN
    spacing = max(0.5 * cell, float(np.sqrt(np.prod((high - low)[:2]) / PIXELS)))
    return PixelGrid.spanning(
        x=(float(low[0]), float(high[0])),
        y=(float(low[1]), float(high[1])),
        z=float(shown[:, 2].mean()),
        spacing=spacing,
    )
