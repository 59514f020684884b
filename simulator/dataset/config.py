"""The configuration of a dataset: variations of a scenario, and how they are stored."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from scenes.files.loading import ScenarioSource
from scenes.files.toml_writer import toml_text
from scenes.sampling.frozen_rooms import Rooms, RoomSpace
from scenes.sampling.sample_space import SampleSpace
from scenes.sampling.variations import Variations
from scenes.schema.errors import ScenarioError
from simulator.dataset.provenance import code_digest, package_versions

FORMAT = 1
"""Version of the format of datasets. [-]"""


class DatasetConfig(Variations):
    """Contents of a dataset's TOML file."""

    precision: Literal["single", "double"] = Field(
        "single", description="'single' (complex64) or 'double' (complex128) for echo and uplink"
    )
    most_paths: int = Field(
        8, ge=1, le=1000, description="the largest number of paths that is stored for each user"
    )
    rooms: Rooms | None = Field(
        None, description="rooms that hold several samples each [every sample has its own]"
    )

    def space(self, source: ScenarioSource) -> SampleSpace:
        """Return the samples of a base scenario."""
        if self.rooms is None:
            return SampleSpace(source, self)
        return RoomSpace(source, self, self.rooms)


def identity(space: SampleSpace) -> dict[str, str]:
    """Return all that a dataset's bytes depend on; samples of different ones must not be mixed.

    Returns
    -------
    ``config`` (JSON), ``base`` (the base scenario as TOML; files by their digest), ``versions``
    (JSON) and ``code`` (a digest of the packages' code).

    Raises
    ------
    ScenarioError
        If a file of the base scenario cannot be read.
    """
    return {
        "config": json.dumps(space.variations.model_dump(), sort_keys=True, ensure_ascii=False),
        "base": content_text(space.source.changed()),
        "versions": json.dumps(package_versions(), sort_keys=True),
        "code": code_digest(),
    }


def content_text(tables: dict[str, Any]) -> str:
    """Write a scenario's tables as TOML, with digests of their files in place of paths.

    Parameters
    ----------
    tables
        With absolute paths; changed in place.

    Raises
    ------
    ScenarioError
        If a file cannot be read.
    """
    for body in _with_files(tables):
        try:
            content = Path(body["file"]).read_bytes()
        except OSError as error:
            raise ScenarioError(
                f"base: its file {body['file']} cannot be read ({error.strerror}); put it there"
            ) from None
        digest = hashlib.sha256(content).hexdigest()[:16]
        body["file"] = f"{Path(body['file']).name} (sha256 {digest}…)"
    return toml_text(tables)


def differences(one: Mapping[str, str], other: Mapping[str, str]) -> list[str]:
    """Return the parts in which two identities differ; of configurations, the keys."""
    found = []
    for part in sorted({*one, *other}):
        if one.get(part) == other.get(part):
            continue
        if part in ("config", "versions"):
            mine, theirs = (json.loads(which.get(part) or "{}") for which in (one, other))
            keys = sorted(
                key for key in {*mine, *theirs} if mine.get(key, None) != theirs.get(key, None)
            )
            found.append(f"{part} ({', '.join(keys)})")
        else:
            found.append({"base": "base scenario", "code": "code of mmslam"}.get(part, part))
    return found


def _with_files(table: Any) -> Iterator[dict[str, Any]]:
    if isinstance(table, dict):
        if isinstance(table.get("file"), str):
            yield table
        for inner in table.values():
            yield from _with_files(inner)
