"""The card of a dataset: a README with YAML front matter, written from its configuration."""

import json
from collections.abc import Mapping
from typing import Any

import yaml

from estimator.measurement.store import TRUTH
from mmslam.learning.normalisation import Constants
from scenes.files.toml_writer import toml_text

SIZES = {1e3: "n<1K", 1e4: "1K<n<10K", 1e5: "10K<n<100K", 1e6: "100K<n<1M", 1e7: "1M<n<10M"}
"""Size categories of cards, by the number of samples below which they hold."""


def dataset_card(
    attributes: Mapping[str, Any],
    parts: Mapping[str, tuple[int, int]],
    shapes: Mapping[str, tuple[str, str]],
    constants: Mapping[str, Constants],
    *,
    name: str,
    license: str,
) -> str:
    """Return the text of the card.

    Parameters
    ----------
    attributes
        Of the dataset's store.
    parts
        Samples and rooms of each part.
    shapes
        Dimensions with their lengths, and description with unit, of each variable.
    constants
        Normalisation constants, of the training part.
    name
        Of the dataset.
    license
        Identifier, as the Hugging Face Hub knows it.
    """
    count = sum(samples for samples, _ in parts.values())
    size = next((told for below, told in SIZES.items() if count < below), "n>10M")
    front = {
        "pretty_name": name,
        "license": license,
        "size_categories": [size],
        "task_categories": ["other"],
        "tags": ["radio-slam", "radar", "sar", "mmwave", "terahertz", "localization", "zarr"],
        "dataset_info": {
            "splits": [{"name": part, "num_examples": n} for part, (n, _) in parts.items()]
        },
    }
    config = json.loads(str(attributes["config"]))
    versions = json.loads(str(attributes["versions"]))
    one_room = len(parts) == 1
    lines = [
        "---",
        yaml.safe_dump(front, sort_keys=False, allow_unicode=True).rstrip(),
        "---",
        "",
        f"# {name}",
        "",
        f"{attributes.get('title')}, simulated by mmslam {versions.get('mmslam')}. "
        f"Seed {attributes['seed']}; sample n depends on the seed and n alone.",
        "",
        f"Conventions: {attributes.get('conventions')}. Padding is NaN, −1 among whole numbers.",
        "",
        "## Parts",
        "",
        (
            "All samples are in one frozen room, so there is no test part: its wall would be "
            "in training too."
            if one_room
            else "Divided by room: no wall, with its roughness, is in two parts."
        ),
        "",
        "| part | samples | rooms |",
        "|---|---:|---:|",
        *(f"| `{part}.zarr` | {n} | {rooms} |" for part, (n, rooms) in parts.items()),
        "",
        "```python",
        "import xarray as xr",
        "",
        'samples = xr.open_zarr("train.zarr", consolidated=False)',
        f'truth = xr.open_zarr("train.zarr", group="{TRUTH}", consolidated=False)',
        "```",
        "",
        "## Variables",
        "",
        "| variable | dimensions | |",
        "|---|---|---|",
        *(f"| `{path}` | {of} | {told} |" for path, (of, told) in shapes.items()),
        "",
        "## Normalisation",
        "",
        f"Over the part `{next(iter(parts))}`: (value − mean) / scale has a mean square of 1. They "
        "are in `normalisation.json` too.",
        "",
        "| variable | mean | scale |",
        "|---|---:|---:|",
        *(f"| `{path}` | {one.mean:.9g} | {one.scale:.9g} |" for path, one in constants.items()),
        "",
        "## How it was made",
        "",
        "The configuration, for `mmslam dataset`:",
        "",
        "```toml",
        toml_text(without_none(config)).rstrip(),
        "```",
        "",
        "The base scenario:",
        "",
        "```toml",
        str(attributes["base"]).rstrip(),
        "```",
        "",
        "Versions: " + ", ".join(f"{key} {value}" for key, value in versions.items()) + ".",
        "",
    ]
    return "\n".join(lines)


def without_none(value: Any) -> Any:
    """Return tables without keys that have no value, and with lists in place of tuples."""
    if isinstance(value, Mapping):
        return {key: without_none(one) for key, one in value.items() if one is not None}
    return [without_none(one) for one in value] if isinstance(value, list | tuple) else value
