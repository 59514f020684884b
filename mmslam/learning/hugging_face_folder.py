"""A dataset in the layout of the Hugging Face Hub: a card, and a store for each part."""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np

from estimator.measurement.model import MeasurementError
from mmslam.learning.dataset_card import dataset_card
from mmslam.learning.normalisation import ATTRIBUTE, normalisation_constants
from mmslam.learning.part_store import write_part
from mmslam.learning.room_split import split_by_room
from mmslam.learning.stored_samples import open_root, sample_arrays
from mmslam.output import refuse_existing, replacing

CARD = "README.md"


def export_hugging_face(
    store: Path, folder: Path, *, license: str = "unknown", seed: int = 0
) -> dict[str, int]:
    """Write a dataset as a folder with card, parts by room, and normalisation constants.

    Each part is a Zarr store, whose shards and compression are those of the dataset; samples that
    could not be made are left out. A dataset of one frozen room is one part, ``train``.

    Parameters
    ----------
    store
        The dataset.
    folder
        To be made: ``README.md``, ``train.zarr``, ``validation.zarr``, ``test.zarr`` and
        ``normalisation.json``.
    license
        Identifier for the card.
    seed
        Of the division into parts.

    Returns
    -------
    The number of samples of each part.

    Raises
    ------
    MeasurementError
        If it is no dataset, or has two rooms, which cannot be divided.
    OutputError
        If the folder exists, or cannot be written.
    """
    root = open_root(store)
    arrays = sample_arrays(root)
    attributes = root.attrs.asdict()
    if "room" not in arrays or "config" not in attributes:
        raise MeasurementError(
            f"{store}: no dataset, or one of an earlier version that does not say which samples "
            "are in one room; make it anew by `mmslam dataset`"
        )
    rooms, made = np.asarray(arrays["room"][...]), np.asarray(arrays["status"][...]) == 0
    numbers = np.flatnonzero(made)
    if len(np.unique(rooms[numbers])) == 1:
        parts = {"train": numbers}
    else:
        divided = split_by_room(rooms[numbers], seed=seed)
        parts = {part: numbers[some] for part, some in divided.items()}
    with replacing(folder, refuse_existing) as new:
        new.mkdir()
        constants = normalisation_constants(store, parts["train"])
        kept = {path: asdict(one) for path, one in constants.items()}
        shared = {key: value for key, value in attributes.items() if key != ATTRIBUTE}
        for part, some in parts.items():
            told = {**shared, "part": part, "split_seed": seed, ATTRIBUTE: kept}
            write_part(store, new / f"{part}.zarr", some, attributes=told)
        text = json.dumps(kept, indent=2) + "\n"
        (new / "normalisation.json").write_text(text, encoding="utf-8")
        shapes = {}
        for path, array in arrays.items():
            names = getattr(array.metadata, "dimension_names", None) or ()
            sizes = (f"{n} {size}" for n, size in zip(names[1:], array.shape[1:], strict=True))
            about = array.attrs.asdict()
            unit = f" [{about['units']}]" if about.get("units") not in (None, "1") else ""
            shapes[path] = (
                ", ".join(["sample", *sizes]),
                f"{array.dtype}; {about.get('long_name') or ''}{unit}".rstrip("; "),
            )
        card = dataset_card(
            attributes,
            {part: (len(some), len(np.unique(rooms[some]))) for part, some in parts.items()},
            shapes,
            constants,
            name=folder.name,
            license=license,
        )
        (new / CARD).write_text(card, encoding="utf-8")
    return {part: len(some) for part, some in parts.items()}
