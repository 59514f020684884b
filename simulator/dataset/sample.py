"""One sample of a dataset as a row of arrays: drawn, simulated, labelled and padded."""

import json
from collections.abc import Mapping

import numpy as np
import xarray as xr
from scipy.constants import speed_of_light

from estimator.measurement.model import Measurement
from estimator.measurement.store import PARAMETERS, TRUTH
from estimator.measurement.store_attributes import air_attributes
from scenes.sampling.drawn_parameters import Parameter
from scenes.sampling.frozen_rooms import first_sample, room_number
from scenes.sampling.sample_space import Attempt, SampleSpace, impossible_sample
from scenes.scenario import Scenario, ScenarioError
from scenes.schema.objects import Plate
from simulator.dataset.layout import Layout, fits
from simulator.dataset.variables import FAILED, MADE
from simulator.materials.gas_absorption import refractive_index

Row = dict[str, np.ndarray]
"""Values of every variable of the layout, by its key."""


def make_row(space: SampleSpace, layout: Layout, sample: int) -> Row:
    """Draw, simulate and label one sample.

    Parameters
    ----------
    space, layout
        Of the dataset.
    sample
        Its number.

    Returns
    -------
    The row. If the sample cannot be made, its status is :data:`FAILED`, ``failure`` holds the
    reason, and the parameters are those of the last draw.
    """
    attempt = Attempt(values={}, scenario=None)
    problem, redraws = "", 0
    for redraws, attempt in enumerate(space.attempts(sample)):
        problem = attempt.problem
        if attempt.scenario is None:
            continue
        try:
            return _made(space, layout, sample, attempt, attempt.scenario, redraws)
        except ScenarioError as error:  # for instance, nothing is received
            problem = str(error)
        except Exception as error:
            return failed_row(space, layout, sample, f"{type(error).__name__}: {error}", attempt)
    told = str(impossible_sample(sample, space.variations.attempts, problem))
    return failed_row(space, layout, sample, told, attempt)


def failed_row(
    space: SampleSpace, layout: Layout, sample: int, why: str, attempt: Attempt | None = None
) -> Row:
    """Return the row of a sample that could not be made.

    Parameters
    ----------
    space, layout, sample
        As in :func:`make_row`.
    why
        The error message; its first line is kept.
    attempt
        The draw that failed; None: the first possible one, or the last.
    """
    if attempt is None:
        for attempt in space.attempts(sample):
            if attempt.scenario is not None:
                break
    row = _empty(layout)
    row["status"] = np.array(FAILED, dtype="i1")
    line = (why.splitlines() or ["unknown"])[0][:500]
    row["failure"] = np.array(line, dtype=np.dtypes.StringDType())
    if attempt is not None:
        _put_parameters(row, space, attempt.values)
    return row


def _empty(layout: Layout) -> Row:
    return {one.key: one.empty() for one in layout.variables}


def _made(
    space: SampleSpace,
    layout: Layout,
    sample: int,
    attempt: Attempt,
    scenario: Scenario,
    redraws: int,
) -> Row:
    from simulator.simulation import simulate  # Sionna's import takes seconds

    simulation = simulate(
        scenario,
        seed=space.variations.seed,
        sample=sample,
        realisation=first_sample(space, sample),
    )
    measurement = simulation.measurement
    if not fits(layout, measurement):
        raise ValueError(
            "the sample has more elements or frequencies than the dataset has room for"
        )
    row = _empty(layout)
    row["status"] = np.array(MADE, dtype="i1")
    row["redraws"] = np.array(redraws, dtype="i4")
    row["room"] = np.array(room_number(space, sample, attempt.values, scenario), dtype="i8")
    _put_signals(row, layout, measurement)
    _put_geometry(row, scenario, measurement)
    _put_truth(row, layout, scenario, simulation.truth)
    _put_paths(row, layout, scenario)
    _put_parameters(row, space, attempt.values)
    return row


def _put_signals(row: Row, layout: Layout, measurement: Measurement) -> None:
    row["echo_present"] = np.array(measurement.echo is not None, dtype="i1")
    if measurement.echo is not None:
        elements, points = measurement.echo.samples.shape
        row["echo"][:elements, :points] = measurement.echo.samples
    if not layout.users:
        return
    row["uplink_present"][:] = 0
    row["uplink_count"] = np.array(len(measurement.uplinks), dtype="i4")
    for uplink in measurement.uplinks:
        user = layout.users.index(uplink.user)
        elements, points = uplink.samples.shape
        row["uplink"][user, :elements, :points] = uplink.samples
        row["uplink_present"][user] = 1


def _put_geometry(row: Row, scenario: Scenario, measurement: Measurement) -> None:
    places = scenario.base_station.element_positions
    apart = scenario.base_station.transmit_positions(places)
    if "position_count" in row:
        row["aperture_position"][: len(places)] = places
        row["element_position"][: len(places)] = places
        if apart is not None:
            row["transmit_position"][: len(places)] = apart
        row["position_count"] = np.array(len(places), dtype="i4")
        row["boresight"][:] = measurement.boresight
    if "frequency_count" in row:
        frequencies = scenario.radio.frequencies
        row["frequency"][: len(frequencies)] = frequencies
        row["frequency_count"] = np.array(len(frequencies), dtype="i4")
    for key, value in air_attributes(measurement.air).items():
        if key in row:
            row[key] = np.array(value, dtype="f8")
    if "clock_offset" in row and measurement.clock_offset is not None:
        row["clock_offset"] = np.array(measurement.clock_offset, dtype="f8")


def _put_truth(row: Row, layout: Layout, scenario: Scenario, truth: xr.Dataset) -> None:
    names = {"user": layout.users, "wall": layout.walls, "target": layout.targets}
    for dimension, known in names.items():
        labels = [str(label) for label in truth[dimension].values]
        row[f"{TRUTH}/{dimension}_count"] = np.array(len(labels), dtype="i4")
        places = [known.index(label if label in known else f"points.{label}") for label in labels]
        for name, variable in truth.data_vars.items():
            if variable.dims[:1] == (dimension,) and places:
                row[f"{TRUTH}/{name}"][places] = variable.values
    for at, name in enumerate(layout.walls):
        body = scenario.objects.get(name)
        if isinstance(body, Plate) and body.height_m is not None:
            row[f"{TRUTH}/wall_height"][at] = body.height_m


def _put_paths(row: Row, layout: Layout, scenario: Scenario) -> None:
    from simulator.scene.scenario_paths import scenario_paths

    if not layout.users or scenario.base_station.multistatic:
        return
    axis = scenario.base_station.axis
    counts: dict[str, int] = {}
    for name in scenario.users:
        user = layout.users.index(name)
        row[f"{TRUTH}/path_count"][user] = 0
        row[f"{TRUTH}/line_of_sight"][user] = 0
    for path in scenario_paths(scenario):
        if path.kind != "user":
            continue
        user, number = layout.users.index(path.end), counts.get(path.end, 0)
        counts[path.end] = number + 1
        row[f"{TRUTH}/path_count"][user] = number + 1
        if path.bounces == 0 and not path.through:
            row[f"{TRUTH}/line_of_sight"][user] = 1
        if number >= row[f"{TRUTH}/path_angle"].shape[1]:
            continue
        towards = path.vertices[1] - path.vertices[0]
        towards = towards / np.linalg.norm(towards)
        values = {
            "path_angle": np.arccos(np.clip(towards @ axis, -1.0, 1.0)),
            "path_elevation": np.arcsin(np.clip(towards[2], -1.0, 1.0)),
            "path_delay": path.length * refractive_index(scenario.air) / speed_of_light,
            "path_bounces": path.bounces,
            "path_antenna_gain": path.gain_db,
            "path_slabs": len(path.through),
            "path_transmission": path.transmission_db,
        }
        for name, value in values.items():
            row[f"{TRUTH}/{name}"][user, number] = value


def _put_parameters(row: Row, space: SampleSpace, values: Mapping[str, object]) -> None:
    absent = tuple(f"{path}." for path in space.absent(values))
    for one in space.parameters:
        if one.key.startswith(absent):
            continue
        if (found := _stored(one, values.get(one.key))) is not None:
            row[f"{PARAMETERS}/{one.key}"] = found


def _stored(parameter: Parameter, value: object) -> np.ndarray | None:

    if value is None:
        return None
    if parameter.kind == "number":
        assert isinstance(value, int | float)
        return np.array(value, dtype="f8")
    if parameter.kind == "position":
        assert isinstance(value, list | tuple)
        return np.array([*value, 0.0][:3], dtype="f8")
    text = value if isinstance(value, str) else json.dumps(value, sort_keys=True)
    return np.array(text, dtype=np.dtypes.StringDType())
