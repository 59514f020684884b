"""The estimator, whole: image, mirrors, angle/range map, paths, position.

One way through for a linear array, whose answer lies in its plane, and for a planar one, which
measures in space: only the stages that image, map and fit differ.
"""

import time
from dataclasses import replace

import numpy as np

from estimator.array.array_frame import ArrayFrame
from estimator.array.planar_array import is_flat, spans_a_plane
from estimator.array.viewpoint import viewpoint
from estimator.channel.path import PathSet
from estimator.compute.blas_threads import one_blas_thread
from estimator.consistency.doubt import Doubted, doubted
from estimator.consistency.faulty_samples import without_faults
from estimator.consistency.pilot_curvature import pilot_lateness
from estimator.consistency.same_samples import refuse_same_samples
from estimator.consistency.stated_heights import height_error
from estimator.consistency.time_convention import refuse_other_convention
from estimator.imaging.energy_region import middles
from estimator.imaging.scene_image import ImageOptions
from estimator.localization.clock import clock_note, on_our_clock
from estimator.localization.close_up import close_up
from estimator.localization.frames import local_echo, local_uplink, user_in_world
from estimator.localization.listed_users import paths_of_list
from estimator.localization.medium import as_in_vacuum, medium_notes, with_true_times
from estimator.localization.stages import MappedRoom, Stages
from estimator.localization.stages_2d import LinearStages
from estimator.localization.stages_3d import PlanarStages
from estimator.localization.stages_free import FreeStages
from estimator.localization.stages_region import RegionStages
from estimator.measurement.model import (
    Echo,
    Measurement,
    MeasurementError,
    Uplink,
    frequency_step,
)
from estimator.path_consensus.consensus import PathListAnswer, locate_path_lists
from estimator.positioning.decision_rules import decide
from estimator.positioning.map_context import MapContext, no_image
from estimator.results.deferred import Deferred
from estimator.results.estimate import (
    AngleRangeMap,
    Check,
    DirectionMap,
    Estimate,
    Images,
    Progress,
    UserEstimate,
)


def _stages(
    measurement: Measurement, region: ImageOptions | None
) -> tuple[Stages[AngleRangeMap] | Stages[DirectionMap], tuple[str, ...]]:
    """Choose the stages by the array's shape and by what was asked for; say what was assumed."""
    stages, told = _by_shape(measurement)
    if region is None:
        return stages, told
    if measurement.echo is None:
        raise MeasurementError("a region was asked for, but no echo was measured: leave it out")
    view = viewpoint(middles(measurement.echo), measurement.boresight)
    if isinstance(stages, LinearStages):
        return RegionStages[AngleRangeMap](stages=stages, view=view, options=region), told
    return RegionStages[DirectionMap](stages=stages, view=view, options=region), told


def _by_shape(
    measurement: Measurement,
) -> tuple[LinearStages | PlanarStages | FreeStages, tuple[str, ...]]:
    measured = measurement.echo or measurement.uplinks[0]  # lists alone have no array
    places = middles(measured) if isinstance(measured, Echo) else measured.positions
    if not spans_a_plane(places):
        return LinearStages(), ()
    view = viewpoint(places, measurement.boresight)
    told = (view.note,) if view.note else ()
    if view.ahead and is_flat(places):
        return PlanarStages(view=view), told
    return FreeStages(view=view), told


@one_blas_thread()
def locate(
    measurement: Measurement,
    *,
    region: ImageOptions | None = None,
    images: bool = True,
    progress: Progress | None = None,
) -> Estimate:
    """Find mirrors and users from a measurement alone.

    Parameters
    ----------
    measurement
        Echo and uplinks of a linear or a planar array; either may be missing.
    region
        Where to look for targets, in the world's frame: it is imaged, and no walls are looked for.
        ``None``: chosen, and walls are looked for where the array suits.
    images
        Whether images and close-ups can be asked for later; then the answer holds the measurement
        that they are formed of.
    progress
        Told each stage.

    Returns
    -------
    Mirrors, users and the images, all in the world frame; images are formed when asked for.

    Raises
    ------
    MeasurementError
        If there is one position only, pilots came to an array that is neither linear nor planar,
        the frequency grid is not uniform, samples are of the other time convention, the waves are
        such as an array of its shape cannot take, or a region is empty or comes without an echo.
    """
    index = measurement.refractive_index
    found = _in_vacuum(
        as_in_vacuum(measurement),
        medium_index=index,
        region=region,
        images=images,
        progress=progress,
    )
    users = tuple(with_true_times(user, index) for user in found.users)
    return replace(found, users=users, notes=found.notes + medium_notes(measurement, users))


def _in_vacuum(
    measurement: Measurement,
    *,
    medium_index: float,
    region: ImageOptions | None,
    images: bool,
    progress: Progress | None,
) -> Estimate:
    if measurement.echo is None and not measurement.uplinks:
        return _by_lists(measurement, region)
    measured = measurement.echo or measurement.uplinks[0]
    stages, assumed = _stages(measurement, region)
    tell = progress or (lambda stage, done, total: None)
    timings: dict[str, float] = {}
    notes: list[str] = list(assumed)
    clock_known = measurement.clock_offset is not None
    echo, uplinks = measurement.echo, on_our_clock(measurement)
    frequency_step(measured.frequencies)  # refused before any work
    if echo is not None:
        for uplink in uplinks:
            refuse_same_samples(echo, uplink)
        screened = without_faults(echo, "echo")
        echo = screened.data
        notes += screened.notes
    heard_by = [without_faults(one, f"pilot of {one.user!r}") for one in uplinks]
    notes += [note for one in heard_by for note in one.notes]
    uplinks = tuple(one.data for one in heard_by)
    frame = stages.frame(measurement)
    if isinstance(stages, LinearStages | PlanarStages):
        if echo is not None:
            refuse_other_convention(local_echo(echo, frame), "echo")
        for uplink in uplinks:
            refuse_other_convention(local_uplink(uplink, frame), f"uplink of {uplink.user!r}")
    steps = 2 + len(uplinks) + bool(measurement.path_lists)

    tell("estimate", 0, steps)
    room: MappedRoom | None = None
    if echo is None:
        notes.append("no echo was measured, so nothing is known of mirrors")
    else:
        started = time.perf_counter()
        room = stages.map_room(local_echo(echo, frame))
        notes += room.notes
        timings["mirrors"] = time.perf_counter() - started
    tell("estimate", 1, steps)

    users, charts, looked = [], [], []
    checks: tuple[Check, ...] = ()
    for index, uplink in enumerate(uplinks):
        started = time.perf_counter()
        local = local_uplink(uplink, frame)
        heard = stages.hear(local, clock_known=clock_known)
        context = no_image() if room is None else room.context
        found = decide(uplink.user, heard.paths, context, clock_known=clock_known)
        if room is not None and clock_known:
            found = room.refined(found, local)
        compared = _compared(found, heard.paths, context, local, clock_known=clock_known)
        found, checks = compared.user, (*checks, *compared.checks)
        notes += clock_note(with_true_times(found, medium_index))
        users.append(user_in_world(found, frame))
        charts.append(heard.chart)
        if isinstance(heard.chart, AngleRangeMap):
            looked.append((local, heard.chart, found))
        timings[f"user {uplink.user}"] = time.perf_counter() - started
        tell("estimate", 2 + index, steps)

    if measurement.path_lists:
        started = time.perf_counter()
        context = no_image() if room is None else room.context
        linear = isinstance(stages, LinearStages)
        beside = _beside_echo(measurement, frame, context, linear=linear)
        users += beside.users
        notes += beside.notes
        timings["path lists"] = time.perf_counter() - started

    def formed() -> Images:
        started = time.perf_counter()
        ends = [frame.to_local(user.path) for user in users if user.path is not None]
        made = Images() if room is None else room.images(frame, ends)
        timings["images"] = time.perf_counter() - started
        return made

    def closer() -> tuple[AngleRangeMap, ...]:
        started = time.perf_counter()
        made = tuple(close_up(*one) for one in looked)
        timings["close-ups"] = time.perf_counter() - started
        return made

    tell("estimate", steps, steps)
    estimate = Estimate(
        users=tuple(users),
        mirrors=() if room is None else room.mirrors(frame),
        targets=() if room is None else room.targets(frame),
        maps=tuple(chart for chart in charts if isinstance(chart, AngleRangeMap)),
        direction_maps=tuple(chart for chart in charts if isinstance(chart, DirectionMap)),
        notes=tuple(notes),
        checks=checks,
        timings=timings,
    )
    if not images:
        return estimate
    return replace(estimate, images=Deferred(formed), close_up_maps=Deferred(closer))


def _by_lists(measurement: Measurement, region: ImageOptions | None) -> Estimate:
    """Locate the users of path lists where nothing else was measured."""
    if region is not None:
        raise MeasurementError("a region was asked for, but no echo was measured: leave it out")
    started = time.perf_counter()
    found = locate_path_lists(measurement.path_lists, clock_offset=measurement.clock_offset)
    return Estimate(
        users=found.users,
        mirrors=found.mirrors,
        notes=found.notes,
        timings={"path lists": time.perf_counter() - started},
    )


def _beside_echo(
    measurement: Measurement, frame: ArrayFrame, context: MapContext, *, linear: bool
) -> PathListAnswer:
    """Locate the users of path lists over the walls that an echo shows."""
    lists, offset = measurement.path_lists, measurement.clock_offset
    if offset is None or not context.imaged:
        found = locate_path_lists(lists, clock_offset=offset)
        why = "the users' clock is unknown" if context.imaged else "the echo shows no room"
        note = f"{why}: lists of paths are located by the mirrors that they agree on themselves"
        return replace(found, mirrors=(), notes=(*found.notes, note))
    users, left = [], 0
    for one in lists:
        paths, out = paths_of_list(one, frame, linear=linear, clock_offset=offset)
        left += out
        users.append(user_in_world(decide(one.user, paths, context), frame))
    notes: tuple[str, ...] = ()
    if left:
        notes = (f"{left} listed paths come from behind the array or are faint; they were left",)
    return PathListAnswer(users=tuple(users), mirrors=(), notes=notes)


def _compared(
    found: UserEstimate,
    paths: PathSet,
    context: MapContext,
    uplink: Uplink,
    *,
    clock_known: bool,
) -> Doubted:
    """Hold the delays that an answer rests on against curvatures."""
    if found.method != "paths":
        return Doubted(user=found, checks=())
    used = [index for index, path in enumerate(found.paths) if path.used]
    flat = len(paths.how.coordinates) == 2
    return doubted(
        found,
        # An unknown clock is solved for: its delays are no lengths.
        pilot=pilot_lateness(paths, used) if clock_known else None,
        echo=context.late,
        height_error=height_error(uplink, found.path_length or 0.0) if flat else 0.0,
        bandwidth=float(np.ptp(uplink.frequencies)),
        axes=paths.how.coordinates,
    )
