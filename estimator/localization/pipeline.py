"""The estimator, whole: image, mirrors, angle/range map, paths, position.

One way through for a linear array, whose answer lies in its plane, and for a planar one, which
measures in space: only the stages that image, map and fit differ.
"""

import time
from dataclasses import replace

from estimator.array.planar_array import is_flat, spans_a_plane
from estimator.array.viewpoint import viewpoint
from estimator.imaging.energy_region import middles
from estimator.localization.clock import clock_note, on_our_clock
from estimator.localization.close_up import close_up
from estimator.localization.frames import local_echo, local_uplink, user_in_world
from estimator.localization.stages import MappedRoom, Stages
from estimator.localization.stages_2d import LinearStages
from estimator.localization.stages_3d import PlanarStages
from estimator.localization.stages_free import FreeStages
from estimator.measurement.model import Echo, Measurement, frequency_step
from estimator.positioning.decision_rules import decide
from estimator.positioning.map_context import no_image
from estimator.results.deferred import Deferred
from estimator.results.estimate import AngleRangeMap, DirectionMap, Estimate, Images, Progress


def _stages(
    measurement: Measurement,
) -> tuple[Stages[AngleRangeMap] | Stages[DirectionMap], tuple[str, ...]]:
    """Choose the stages by the array's shape, and say what was assumed."""
    measured = measurement.echo or measurement.uplinks[0]
    places = middles(measured) if isinstance(measured, Echo) else measured.positions
    if not spans_a_plane(places):
        return LinearStages(), ()
    view = viewpoint(places, measurement.boresight)
    told = (view.note,) if view.note else ()
    if view.ahead and is_flat(places):
        return PlanarStages(view=view), told
    return FreeStages(view=view), told


def locate(
    measurement: Measurement, *, images: bool = True, progress: Progress | None = None
) -> Estimate:
    """Find mirrors and users from a measurement alone.

    Parameters
    ----------
    measurement
        Echo and uplinks of a linear or a planar array; either may be missing.
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
        the frequency grid is not uniform, or the waves are such as an array of its shape cannot
        take.
    """
    measured = measurement.echo or measurement.uplinks[0]
    stages, assumed = _stages(measurement)
    tell = progress or (lambda stage, done, total: None)
    timings: dict[str, float] = {}
    notes: list[str] = list(assumed)
    clock_known = measurement.clock_offset is not None
    echo, uplinks = measurement.echo, on_our_clock(measurement)
    frequency_step(measured.frequencies)  # refused before any work
    frame = stages.frame(measurement)
    steps = 2 + len(uplinks)

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
    for index, uplink in enumerate(uplinks):
        started = time.perf_counter()
        local = local_uplink(uplink, frame)
        heard = stages.hear(local, clock_known=clock_known)
        context = no_image() if room is None else room.context
        found = decide(uplink.user, heard.paths, context, clock_known=clock_known)
        if room is not None and clock_known:
            found = room.refined(found, local)
        notes += clock_note(found)
        users.append(user_in_world(found, frame))
        charts.append(heard.chart)
        if isinstance(heard.chart, AngleRangeMap):
            looked.append((local, heard.chart, found))
        timings[f"user {uplink.user}"] = time.perf_counter() - started
        tell("estimate", 2 + index, steps)

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
        timings=timings,
    )
    if not images:
        return estimate
    return replace(estimate, images=Deferred(formed), close_up_maps=Deferred(closer))
