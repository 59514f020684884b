"""The library of scenarios, and scenarios from files, with overrides by dotted path."""

import copy
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

import numpy as np

from scenes.files.toml_reader import is_file, read_toml
from scenes.files.toml_writer import toml_text
from scenes.meshes.foreign_scene import Geometry
from scenes.scenario import Scenario, ScenarioError, parse_scenario
from scenes.schema.errors import did_you_mean, shown, shown_text

_BEGIN = {
    "objects": "kind",
    "users": "position_m",
    "points": "position_m",
}  # required key of a new table

_OVERRIDE = "override "


def scenario_names() -> tuple[str, ...]:
    """Name the scenarios of the library, in alphabetical order."""
    entries = (entry.name for entry in _folder().iterdir())
    return tuple(sorted(n.removesuffix(".toml") for n in entries if n.endswith(".toml")))


@dataclass(frozen=True, kw_only=True)
class ScenarioSource:
    """A scenario's tables as they were read, from which variants of it are made."""

    origin: str  # the name or the path that was asked for
    tables: Mapping[str, Any]  # as the file holds them, nothing checked
    folder: Path  # that paths of meshes and tables are relative to

    def variant(self, change: Callable[[dict[str, Any]], None] | None = None) -> Scenario:
        """Return the scenario, or what it becomes when its tables are changed.

        Parameters
        ----------
        change
            Changes a copy of the tables in place; None: nothing is changed.

        Raises
        ------
        ScenarioError
            If the variant is impossible.
        """
        return parse_scenario(self.changed(change))

    def changed(self, change: Callable[[dict[str, Any]], None] | None = None) -> dict[str, Any]:
        """Return a changed copy of the tables, with absolute paths, nothing checked."""
        tables: dict[str, Any] = copy.deepcopy(dict(self.tables))
        if change is not None:
            change(tables)
        _resolve_files(tables, self.folder)
        return tables


def scenario_titles() -> dict[str, str]:
    """Return what each scenario of the library shows, in a line, by its name.

    Examples
    --------
    >>> scenario_titles()["slam_2d"]
    'A user without line of sight, found over one rough mirror (thesis 4.9 to 4.12)'
    """
    return {name: str(scenario_source(name).tables.get("title", "")) for name in scenario_names()}


def load_scenario(
    name_or_path: str | Path, overrides: Sequence[str] | Mapping[str, object] = ()
) -> Scenario:
    """Load a scenario of the library, or from a TOML file.

    Parameters
    ----------
    name_or_path
        A name of :func:`scenario_names`, or the path of a TOML file (anything that ends in
        ``.toml``, holds a separator, or is a file). In a file, ``name`` may be missing; it is
        then the file's own name.
    overrides
        Values by dotted key, or ``"dotted.key=VALUE"`` with VALUE a TOML literal, else a string;
        applied in turn before anything is checked. A missing table is made
        (``objects.post.kind`` begins a new object); what the scenario does not know is refused
        as in a file.

    Raises
    ------
    ScenarioError
        If there is no such scenario, the file cannot be read, or the scenario is impossible;
        each line names file, key, value, limit and remedy.

    Examples
    --------
    >>> room = load_scenario("slam_2d", {"objects.wall.angle_deg": 40, "noise.snr_db": 10})
    >>> room.objects["wall"].angle_deg
    40.0
    >>> load_scenario("slam_2d", ["users.user.position_m=[0.9, 0.8]"]).users["user"].position
    array([0.9, 0.8, 0. ])
    """
    name_or_path = str(name_or_path)
    source = scenario_source(name_or_path)
    try:
        if isinstance(overrides, Mapping):
            values = {key: _as_read(value) for key, value in overrides.items()}
            return source.variant(lambda tables: set_keys(tables, values, by=_OVERRIDE))
        return source.variant(lambda tables: _override(tables, overrides))
    except ScenarioError as error:
        if str(error).startswith(("--set ", _OVERRIDE)):
            raise
        lines = [f"{shown_text(name_or_path)}: {line}" for line in str(error).splitlines()]
        raise ScenarioError("\n".join(lines)) from None


def scenario_source(name_or_path: str) -> ScenarioSource:
    """Read a scenario's tables, as :func:`load_scenario` does, without validating them.

    Raises
    ------
    ScenarioError
        If there is no such scenario, or its file cannot be read.
    """
    source: Traversable
    if name_or_path in scenario_names():
        source, folder = _folder() / f"{name_or_path}.toml", Path(str(_folder()))
    elif _is_path(name_or_path):
        source = Path(name_or_path)
        folder = source.parent
    else:
        raise ScenarioError(
            f"scenario {shown_text(name_or_path)!r}: no such name"
            f"{did_you_mean(name_or_path, scenario_names())}; known: "
            f"{', '.join(scenario_names())}; or give the path of a TOML file"
        )
    data = read_toml(
        source,
        name=name_or_path,
        kind="scenario",
        remedy=f"give the path of a TOML file, or one of {', '.join(scenario_names())}",
    )
    data.setdefault("name", source.name.removesuffix(".toml"))
    return ScenarioSource(origin=name_or_path, tables=data, folder=folder)


def set_keys(data: dict[str, Any], values: Mapping[str, object], *, by: str = "--set ") -> None:
    """Set keys of a scenario's tables by their dotted paths, in turn, in place.

    Parameters
    ----------
    data
        The tables. A missing table is made.
    values
        Value by dotted key.
    by
        What asks for it, for messages.

    Raises
    ------
    ScenarioError
        If a key treats a value as a table, or creates an object, a user or a point without its
        required key.
    """
    known = {group: set(_group(data, group)) for group in _BEGIN}
    for key, value in values.items():
        _set(key, value, data, shown_as=f"{by}{shown_text(key)!r}")
    _refuse_new_names(data, known, by)


def override_scenario(scenario: Scenario, overrides: Sequence[str]) -> Scenario:
    """Return a scenario with some keys changed, checked as in :func:`load_scenario`.

    Raises
    ------
    ScenarioError
        If an override cannot be read, or the result is impossible.
    """
    data = tomllib.loads(scenario_to_toml(scenario))
    _override(data, overrides)
    return parse_scenario(data)


def scenario_to_toml(scenario: Scenario) -> str:
    """Write a scenario as TOML, defaults included; loading it gives an equal scenario."""
    return toml_text(_plain(scenario.model_dump(), flat=scenario.dimensions == 2))


def scenario_schema() -> dict[str, Any]:
    """Return the JSON schema of a scenario file, for editors and other programs."""
    schema = Scenario.model_json_schema()
    # JSON knows no infinity; a scenario without noise simply leaves the key out.
    del schema["$defs"]["Noise"]["properties"]["snr_db"]["default"]
    # Read, and turned into objects, before the scenario itself is.
    schema["properties"]["geometry"] = Geometry.model_json_schema()
    return schema


def _folder() -> Traversable:
    return files("scenes") / "library"


def _is_path(text: str) -> bool:
    return text.endswith(".toml") or "/" in text or "\\" in text or is_file(Path(text))


def _override(data: dict[str, Any], overrides: Sequence[str]) -> None:
    known = {group: set(_group(data, group)) for group in _BEGIN}
    for override in overrides:
        key, separator, text = override.partition("=")
        if not separator or not all(part.strip() for part in key.split(".")):
            raise ScenarioError(
                f"--set {shown_text(override)!r}: must be KEY=VALUE with a dotted KEY, such as "
                "objects.wall.angle_deg=35"
            )
        _set(key, _literal(text.strip()), data, shown_as=f"--set {shown_text(override)!r}")
    _refuse_new_names(data, known, "--set ")


def _as_read(value: object) -> object:
    """Convert a Python or NumPy value to the type that a TOML file would give."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return list(value) if isinstance(value, tuple) else value


def _refuse_new_names(data: dict[str, Any], known: Mapping[str, set[str]], by: str) -> None:
    for group, needed in _BEGIN.items():
        for name, table in _group(data, group).items():
            if name not in known[group] and isinstance(table, dict) and needed not in table:
                raise ScenarioError(
                    f"{by}{group}.{shown_text(name)}: no such name"
                    f"{did_you_mean(name, known[group])}; known: "
                    f"{', '.join(sorted(known[group])) or 'none'}; to add one, set "
                    f"{group}.{shown_text(name)}.{needed} as well"
                )


def _group(data: Mapping[str, Any], group: str) -> dict[str, Any]:
    tables = data.get(group)
    return tables if isinstance(tables, dict) else {}


def _set(key: str, value: object, data: dict[str, Any], *, shown_as: str) -> None:
    path = [part.strip() for part in key.split(".")]
    table = data
    for depth, part in enumerate(path[:-1]):
        table = table.setdefault(part, {})
        if not isinstance(table, dict):
            parent = shown_text(".".join(path[: depth + 1]))
            raise ScenarioError(
                f"{shown_as}: {parent} = {shown(table)} is a value, not a table; set "
                f"{parent} itself"
            )
    table[path[-1]] = value


def _literal(text: str) -> object:
    """Read a TOML literal; any other text is returned as a string."""
    try:
        values = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):  # a ValueError: more digits than Python reads
        return text
    return values["value"] if list(values) == ["value"] else text


def _resolve_files(data: dict[str, Any], folder: Path) -> None:
    """Make paths relative to the scenario's file absolute: scenes, meshes, permittivities."""
    geometry = data.get("geometry")
    if isinstance(geometry, dict) and isinstance(geometry.get("file"), str) and geometry["file"]:
        geometry["file"] = _absolute(folder, geometry["file"])
    bodies = list(_group(data, "objects").values())
    for group in ("materials", "objects"):
        bodies += _group(geometry if isinstance(geometry, dict) else {}, group).values()
    for body in bodies:
        tables = (
            [body, body.get("material"), body.get("roughness")] if isinstance(body, dict) else []
        )
        for table in tables:
            if not isinstance(table, dict):
                continue
            for key in ("file", "realisation"):
                if isinstance(table.get(key), str) and table[key]:
                    table[key] = _absolute(folder, table[key])


def _absolute(folder: Path, name: str) -> str:
    try:
        return str((folder / name).resolve())
    except (OSError, RuntimeError, ValueError):  # not a valid file name, or circular links
        return str(folder / name)  # the error is reported when the file is opened


def _is_position(value: Any) -> bool:
    return isinstance(value, tuple) and len(value) == 3 and isinstance(value[0], int | float)


def _plain(table: Mapping[str, Any], *, flat: bool) -> dict[str, object]:
    """Leave out what is not given and, in 2-D, the z = 0 of positions."""
    plain: dict[str, object] = {}
    for key, value in table.items():
        if isinstance(value, Mapping):
            plain[key] = _plain(value, flat=flat)
        elif flat and _is_position(value):
            plain[key] = value[:2]
        elif value is not None:
            plain[key] = value
    return plain
