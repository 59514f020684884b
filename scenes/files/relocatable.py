"""Scenarios that can be moved: their meshes and tables in a folder beside them."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenes.files.loading import scenario_to_toml
from scenes.files.toml_writer import toml_text
from scenes.scenario import Scenario


@dataclass(frozen=True, kw_only=True)
class Relocatable:
    """A scenario's tables with relative paths, and the files that belong at them."""

    tables: dict[str, Any]
    files: Mapping[str, Path]  # where each is now, by its path relative to the scenario's file

    @property
    def toml(self) -> str:
        """The scenario's file."""
        return toml_text(self.tables)


def relocatable(scenario: Scenario) -> Relocatable:
    """Lay a scenario out so that, with its files copied beside it, it can be moved anywhere.

    Meshes, height maps and tables of permittivity go to the folder ``NAME_files`` under their
    own names, with a number where two differ in their folder only.

    Parameters
    ----------
    scenario
        As it was loaded: its paths lead to its files.
    """
    tables = tomllib.loads(scenario_to_toml(scenario))
    places: dict[Path, str] = {}
    for body in tables.get("objects", {}).values():
        for table in (body, body["material"], body.get("roughness")):
            if not isinstance(table, dict):
                continue
            for key in [key for key in ("file", "realisation") if key in table]:
                source = Path(table[key]).resolve()
                if source not in places:
                    places[source] = _free(f"{scenario.name}_files", source, places.values())
                table[key] = places[source]
    return Relocatable(tables=tables, files={place: source for source, place in places.items()})


def _free(folder: str, source: Path, taken: Any) -> str:
    # Case does not tell files apart everywhere.
    used = {place.casefold() for place in taken}
    names = [source.name, *(f"{source.stem}_{n}{source.suffix}" for n in range(2, len(used) + 2))]
    return next(f"{folder}/{name}" for name in names if f"{folder}/{name}".casefold() not in used)
