"""The parts of a track, made from its recipe: inputs and truth, or of the test inputs alone."""

import hashlib
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import zarr

from estimator.measurement.store import PARAMETERS, TRUTH
from estimator.measurement.store_attributes import AIR_KEYS
from mmslam.benchmark.recipe import Recipe, load_recipe, space_of
from mmslam.learning.part_store import write_part
from mmslam.learning.stored_samples import SIGNALS
from mmslam.output import OutputError, refuse_existing, replacing
from simulator.dataset.builder import Tally, make_dataset, plan_dataset
from simulator.dataset.provenance import package_versions
from simulator.dataset.store import DatasetError
from simulator.dataset.task_runner import Workers

ANSWERS = ("redraws", "room", "failure")
"""What a test part does not hold, beside the groups of truth and parameters."""

TOLD = (
    "mmslam_format",
    "dataset_format",
    "conventions",
    "waves",
    "dimensions",
    "boresight",
    "clock_offset_s",
    *AIR_KEYS,
)
"""Attributes of a dataset that a part keeps: without the clock's offset no delay is a length."""


def make_part(
    track: str,
    part: str,
    folder: Path,
    *,
    size: int | None = None,
    workers: Workers | None = None,
    tell: Tally | None = None,
) -> dict[str, Any]:
    """Make one part of a track, in the same bytes whoever makes it with the same versions.

    Parameters
    ----------
    track, part
        Which one.
    folder
        Where ``TRACK-PART.zarr`` and its manifest ``TRACK-PART.json`` are written. Until they are
        there, samples are in ``TRACK-PART.making``, and the same call goes on with them.
    size
        The first samples of the part; None: as many as the recipe says.
    workers
        Where samples are made; None: in this process.
    tell
        Called after each sample.

    Returns
    -------
    The manifest: recipe, version and digest, samples, and the digest of the store's files.

    Raises
    ------
    ScenarioError
        If there is no such track or part.
    OutputError
        If the store is there already, or a sample could not be made.
    """
    recipe = load_recipe(track)
    tables = recipe.tables(part, size)
    target = folder / f"{track}-{part}.zarr"
    if target.exists():
        raise OutputError(refuse_existing(target))
    folder.mkdir(parents=True, exist_ok=True)
    making = folder / f"{track}-{part}.making"
    whole = making / f"{tables['count']}.zarr"
    try:
        job = plan_dataset(tables, whole)
        summary = make_dataset(job, workers=workers or Workers(), tell=tell)
    except DatasetError as error:
        raise OutputError(str(error)) from error
    if summary.failed:
        one = summary.failures[0]
        raise OutputError(
            f"sample {one.sample} of {track}-{part} could not be made: {one.reason}; this is a "
            "fault of the recipe or the simulator, please report it"
        )
    _check_draws(recipe, part, whole, size)
    manifest = {
        "benchmark": track,
        "version": recipe.version,
        "recipe": recipe.digest,
        "part": part,
        "samples": summary.samples,
    }
    kept = {k: v for k, v in zarr.open_group(whole, mode="r").attrs.asdict().items() if k in TOLD}
    with replacing(target, refuse_existing) as new:
        write_part(
            whole,
            new,
            np.arange(summary.samples),
            keep=lambda path: _is_kept(path, recipe, part),
            attributes={**kept, "title": f"{recipe.title}: {part}", **manifest},
        )
        if recipe.channel is not None:
            _put_places(whole, new)
        digest = store_digest(new)
    manifest |= {"digest": digest, "versions": package_versions()}
    text = json.dumps(manifest, indent=2) + "\n"
    target.with_suffix(".json").write_text(text, encoding="utf-8")
    shutil.rmtree(making)
    return manifest


def store_digest(store: Path) -> str:
    """Return a digest of the names and contents of all files of a store.

    Raises
    ------
    OutputError
        If a file or folder in it is a link: what it leads to is no part of the store.
    """
    digest = hashlib.sha256()
    found = sorted(store.rglob("*"))
    for path in found:
        if path.is_symlink():
            raise OutputError(f"{path} is a link; put what it leads to into the store itself")
    for path in (one for one in found if one.is_file()):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(store).as_posix()}\0{len(content)}\0".encode())
        digest.update(content)
    return digest.hexdigest()


def _is_kept(path: str, recipe: Recipe, part: str) -> bool:
    if part != "test":
        return True
    group, _, name = path.rpartition("/")
    if group in (TRUTH, PARAMETERS) or name in ANSWERS:
        return False
    signal = next((one for one in SIGNALS if name.startswith(one)), None)
    return signal is None or signal in recipe.inputs


def _put_places(whole: Path, new: Path) -> None:
    """Add where the users are, whose channels are asked for."""
    places = np.asarray(zarr.open_group(whole, mode="r")[f"{TRUTH}/user_position"])[:, 0]
    array = zarr.open_group(new, mode="r+").create_array(
        "user_position",
        shape=places.shape,
        dtype=places.dtype,
        chunks=places.shape,
        dimension_names=("sample", "axis"),
        attributes={"units": "m", "long_name": "where the channel is asked for"},
    )
    array[...] = places


def _check_draws(recipe: Recipe, part: str, whole: Path, size: int | None) -> None:
    """Make sure that the scorer, which simulates nothing, draws the same rooms."""
    space = space_of(recipe, part, size)
    redraws = np.asarray(zarr.open_group(whole, mode="r")["redraws"])
    for sample, count in enumerate(redraws):
        if space.first(sample)[1] != count:
            raise OutputError(
                f"sample {sample} of {recipe.name}-{part} was drawn again after its simulation; "
                "this is a fault of the recipe, please report it"
            )
