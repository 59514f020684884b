"""The estimator in space, whole: volume, walls, targets, direction map, paths, position."""

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.array.array_frame import ArrayFrame
from estimator.array.planar_array import planar_array, planar_frame, planar_resolution
from estimator.array.resolution import largest_spacing
from estimator.array.resolution_cell import Resolution
from estimator.channel.angle_range_map_3d import direction_map
from estimator.channel.path_extraction_3d import LEAST_SHARE, find_space_paths
from estimator.mapping.map_3d import SpaceMap, build_space_map, corrected_values
from estimator.measurement.model import Measurement, MeasurementError, Uplink, frequency_step
from estimator.positioning.position_decision_3d import decide_in_space
from estimator.results.estimate import Estimate, Image, Mirror, Progress, Target, UserEstimate
from estimator.results.pixel_grid import PixelGrid

VOXELS = 1_500_000
"""Most voxels of an image; its spacing grows beyond."""
MARGIN = 0.05
"""What an image shows around the outermost things in it, over their extent. [-]"""


def locate_in_space(measurement: Measurement, *, progress: Progress | None = None) -> Estimate:
    """Find walls, targets and users from the measurement of a planar array alone.

    Parameters
    ----------
    measurement
        Echo and uplinks; either may be missing.
    progress
        Told each stage.

    Returns
    -------
    Mirrors, targets, users and the images, all in the world frame.

    Raises
    ------
    MeasurementError
        If the array is not planar, or the frequency grid not uniform.
    """
    tell = progress or (lambda stage, done, total: None)
    timings: dict[str, float] = {}
    notes: list[str] = []
    if measurement.clock_offset is None and measurement.uplinks:
        notes.append("the clock offset of the user is unknown and was taken to be 0")
    echo, uplinks = measurement.echo, measurement.uplinks
    if measurement.waves != "spherical":
        raise MeasurementError(
            f"waves = {measurement.waves!r}: a planar array measures in space, where waves are "
            "spherical; measure with a linear array, or give the measurement its true waves"
        )
    measured = echo if echo is not None else uplinks[0]
    frequency_step(measured.frequencies)  # refused before any work
    frame = planar_frame(measured.positions, measurement.boresight)
    steps = 2 + len(uplinks)

    tell("estimate", 0, steps)
    room: SpaceMap | None = None
    cell = 0.0
    if echo is None:
        notes.append("no echo was measured, so nothing is known of mirrors")
    else:
        started = time.perf_counter()
        if echo.transmit_positions is not None:
            raise MeasurementError(
                "echo: transmit positions stand apart; in space only a monostatic echo is imaged"
            )
        local_echo = replace(echo, positions=frame.to_local(echo.positions))
        array = planar_array(local_echo.positions)
        room = build_space_map(local_echo, array)
        resolution = planar_resolution(array, local_echo)
        cell = resolution.across_ray
        sine = array.unaliased(echo.frequencies, passes=2)
        shortest = speed_of_light / float(echo.frequencies[-1])
        if max(array.spacing) > largest_spacing(shortest):
            notes.append(
                f"positions {1e3 * max(array.spacing):.3g} mm apart tell echoes from their grating "
                f"lobes within {np.degrees(np.arcsin(sine)):.1f}° of broadside only; the image "
                "ends there"
            )
        timings["map"] = time.perf_counter() - started
    tell("estimate", 1, steps)

    users, maps = [], []
    for index, uplink in enumerate(_on_our_clock(uplinks, measurement.clock_offset)):
        started = time.perf_counter()
        local = replace(uplink, positions=frame.to_local(uplink.positions))
        array = planar_array(local.positions)
        looked = direction_map(local, array, least_share=LEAST_SHARE)
        maps.append(looked)
        found = decide_in_space(
            uplink.user,
            find_space_paths(local, array, looked),
            room.walls if room is not None else (),
            cell=cell,
            imaged=room is not None,
            contrast=room.survey.contrast if room is not None else 0.0,
        )
        users.append(_in_world(found, frame))
        timings[f"user {uplink.user}"] = time.perf_counter() - started
        tell("estimate", 2 + index, steps)

    raw = corrected = None
    if room is not None:
        started = time.perf_counter()
        paths = [frame.to_local(user.path) for user in users if user.path is not None]
        raw, corrected = _images(room, frame, resolution, paths)
        timings["images"] = time.perf_counter() - started
    tell("estimate", steps, steps)
    return Estimate(
        users=tuple(users),
        mirrors=() if room is None else _mirrors(room, frame),
        targets=() if room is None else _targets(room, frame),
        raw_image=raw,
        corrected_image=corrected,
        direction_maps=tuple(maps),
        notes=tuple(notes),
        timings=timings,
    )


def _on_our_clock(uplinks: Sequence[Uplink], offset: float | None) -> tuple[Uplink, ...]:
    """Take a known offset of the user's clock out of its pilot.

    A clock that is ahead by δ sends early: the pilot's delay appears δ too short.
    """
    return tuple(
        replace(
            uplink,
            samples=uplink.samples * np.exp(-2j * np.pi * uplink.frequencies * (offset or 0.0)),
        )
        for uplink in uplinks
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


def _mirrors(room: SpaceMap, frame: ArrayFrame) -> tuple[Mirror, ...]:
    mirrors = []
    for plane, wall, through in zip(room.planes, room.walls, room.seen_through, strict=True):
        places = (wall.corners - wall.centre) @ wall.axes.T
        middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
        sides = np.array([[places[:, 0].min(), middle[1]], [places[:, 0].max(), middle[1]]])
        ends = frame.to_world(wall.centre + sides @ wall.axes)
        mirrors.append(
            Mirror(
                start=ends[0],
                end=ends[1],
                normal=frame.turned_to_world(wall.normal),
                covariance=wall.covariance,
                confidence=plane.confidence,
                level_db=float(10 * np.log10(plane.level / max(plane.background, 1e-300))),
                seen_through=through,
                corners=frame.to_world(wall.corners),
            )
        )
    return tuple(mirrors)


def _targets(room: SpaceMap, frame: ArrayFrame) -> tuple[Target, ...]:
    return tuple(
        Target(
            position=frame.to_world(target.position),
            ghost=frame.to_world(target.ghost),
            seen_through=target.seen_through,
            level_db=float(10 * np.log10(target.level)),
            ends=frame.to_world(target.ends),
        )
        for target in room.targets
    )


def _images(
    room: SpaceMap,
    frame: ArrayFrame,
    resolution: Resolution,
    paths: Sequence[Float[np.ndarray, "_ 3"]],
) -> tuple[Image, Image]:
    """Read the raw and the corrected image on one grid, around what was found."""
    looked = room.survey
    shown = [looked.peaks, *paths]
    shown += [wall.corners for wall in room.walls] + [plane.wall.corners for plane in room.planes]
    shown += [np.vstack([target.position, target.ends]) for target in room.targets]
    if not sum(len(part) for part in shown):  # nothing at all: the whole volume
        shown = [looked.ranges[-1] * np.array([[-0.2, 1.0, -0.2], [0.2, 0.5, 0.2]])]
    places = frame.to_world(np.concatenate(shown))
    low, high = places.min(axis=0), places.max(axis=0)
    middle = float(np.median(np.linalg.norm(np.concatenate(shown), axis=1)))
    # The tapered main lobe reaches 1.7 cells beyond what it shows.
    margin = MARGIN * float((high - low).max()) + 2 * resolution.across_ray * middle
    low, high = low - margin, high + margin
    fine, coarse = 0.5 * resolution.along_ray, 0.5 * resolution.across_ray * middle
    # The world's axis nearest to the boresight is sampled as the range is.
    spacing = np.where(np.abs(frame.axes[1]) > 0.5, fine, max(fine, coarse))
    spacing = spacing * max(1.0, (float(np.prod((high - low) / spacing)) / VOXELS) ** (1 / 3))
    grid = PixelGrid.spanning(
        x=(float(low[0]), float(high[0])),
        y=(float(low[1]), float(high[1])),
        z=(float(low[2]), float(high[2])),
        spacing=(float(spacing[0]), float(spacing[1]), float(spacing[2])),
    )
    points = frame.to_local(grid.points)
    return (
        Image(values=looked.at(points), grid=grid),
        Image(
            values=corrected_values(looked, points, room.walls, skin=2 * resolution.along_ray),
            grid=grid,
        ),
    )
