"""The samples of varied scenarios: sample n depends on (seed, n) alone, not on the process.

Every key has a random stream of its own, so that varying one more key does not redraw the
others. Where what was drawn is impossible (a user inside a wall, solids that overlap), all keys
are drawn again; so the samples follow the distributions *given that the scene is possible*.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from scenes.files.loading import ScenarioSource, scenario_names, scenario_source, set_keys
from scenes.files.toml_reader import is_file
from scenes.meshes.foreign_scene import with_geometry
from scenes.random_streams import random_stream
from scenes.sampling.distributions import Drawn, Grid, Listed, Stepped
from scenes.sampling.drawn_parameters import Parameter, parameter_of
from scenes.sampling.variations import Variations
from scenes.scenario import Scenario, ScenarioError, parse_scenario
from scenes.schema.base_station import BaseStation
from scenes.schema.errors import did_you_mean, problems, shown
from scenes.schema.quantities import Checked
from scenes.schema.radio import Radio

GROUPS = ("objects", "points", "users")
"""Tables of which there may be a varying number."""

MOST_EXTREMES = 200
"""Most values of one key that are checked before any work. [-]"""


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """One draw of a sample: its scenario, or why it is impossible."""

    values: Mapping[str, object]  # as drawn, by key
    scenario: Scenario | None
    problem: str = ""


@dataclass(frozen=True)
class SampleSpace:
    """A base scenario and the distributions of the keys that vary."""

    source: ScenarioSource
    variations: Variations

    def attempts(self, sample: int) -> Iterator[Attempt]:
        """Yield draws of one sample, up to the number of attempts that the variations allow.

        Parameters
        ----------
        sample
            Its number.
        """
        seed = self.variations.seed
        streams: dict[str, np.random.Generator] = {}

        def stream(name: str) -> np.random.Generator:
            # Kept between attempts: each attempt continues the streams of the one before.
            if name not in streams:
                streams[name] = random_stream(seed, sample, name)
            return streams[name]

        for _ in range(self.variations.attempts):
            values = self._values(sample, stream)
            try:
                scenario = parse_scenario(self.tables(values))
            except ScenarioError as error:
                yield Attempt(values=values, scenario=None, problem=str(error))
            else:
                yield Attempt(values=values, scenario=scenario)

    def first(self, sample: int) -> tuple[Attempt, int]:
        """Return a sample's first possible attempt, and how many before were not.

        Raises
        ------
        ScenarioError
            If none is possible.
        """
        attempt = None
        for redraws, attempt in enumerate(self.attempts(sample)):
            if attempt.scenario is not None:
                return attempt, redraws
        assert attempt is not None  # there is one attempt at least
        raise impossible_sample(sample, self.variations.attempts, attempt.problem)

    def tables(self, values: Mapping[str, object]) -> dict[str, Any]:
        """Return the scenario's tables with values set, nothing checked.

        Parameters
        ----------
        values
            By key, as :class:`Attempt` holds them.
        """

        def change(tables: dict[str, Any]) -> None:
            set_keys(tables, self.variations.set, by="set.")
            copies = self._copies
            mine = {
                key: value
                for key, value in values.items()
                if key not in copies and not key.startswith("number.")
            }
            set_keys(tables, mine, by="vary.")
            self._put(tables, values)

        return self.source.changed(change)

    def check(self) -> Attempt:
        """Check that every key exists, and that the ends of its distribution are allowed values.

        Returns
        -------
        The first possible attempt of sample 0.

        Raises
        ------
        ScenarioError
            If a key is unknown, a value out of its limits, or no draw of sample 0 is possible;
            a line for each problem.
        """
        found: list[str] = list(self._number_problems())
        if found:
            raise ScenarioError("\n".join(found))
        some = next(self.attempts(0)).values
        for key, drawn in {**self.variations.vary, **self._copies}.items():
            for value in drawn.extremes()[:MOST_EXTREMES]:
                lines = _problems_of_keys(self.tables({**some, key: value}))
                mine = tuple(f"{key}{sign}" for sign in (" =", ":", "."))
                found += [f"vary.{line}" for line in lines if line.startswith(mine)]
        lines = _problems_of_keys(self.tables(some)) if self.variations.set else []
        for key in self.variations.set:
            mine = tuple(f"{key}{sign}" for sign in (" =", ":", "."))
            found += [f"set.{line}" for line in lines if line.startswith(mine)]
        if found:
            raise ScenarioError("\n".join(dict.fromkeys(found)))
        return self.first(0)[0]

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """All keys that are drawn, in the order in which they are stored."""
        numbers = [
            Parameter(key=f"number.{name}", kind="number", unit="1")
            for name in self.variations.number
        ]
        drawn: dict[str, Drawn | Stepped] = {**self.variations.vary, **self._copies}
        return (*(parameter_of(key, one) for key, one in drawn.items()), *numbers)

    def absent(self, values: Mapping[str, object]) -> tuple[str, ...]:
        """Name the tables, such as ``objects.post``, that a draw leaves out."""
        return tuple(
            path
            for name, number in self.variations.number.items()
            for path in number.among or ()
            if values.get(f"number.{name}.without.{path}")
        )

    def names(self, group: str) -> tuple[str, ...]:
        """Name all objects, points or users that a sample may have, in order."""
        names = list(self._some_tables.get(group, {}))
        for number in self.variations.number.values():
            for path in number.among or ():
                kind, name = path.split(".")
                if kind == group and name not in names:
                    names.append(name)
            if number.of is not None:
                kind, name = number.of.split(".")
                if kind == group:
                    known = [_copy(name, index) for index in range(1, number.greatest + 1)]
                    names += [one for one in known if one not in names]
        return tuple(sorted(names, key=self._order(group)))

    def kinds(self) -> dict[str, frozenset[str]]:
        """Return what kinds of body each object may be, by its name."""
        base = self._base_tables.get("objects", {})
        copied = {
            _copy(number.of.split(".")[1], index): number.of.split(".")[1]
            for number in self.variations.number.values()
            if number.of is not None
            for index in range(1, number.greatest + 1)
        }
        found = {}
        for name in self.names("objects"):
            template = base.get(copied.get(name, name), {})
            kinds = {template.get("kind")}
            for key, drawn in {**self.variations.vary, **self._copies}.items():
                if key == f"objects.{name}.kind":
                    kinds |= set(drawn.extremes())
                elif key == f"objects.{name}":
                    kinds |= {one.get("kind") for one in drawn.extremes() if isinstance(one, dict)}
            found[name] = frozenset(str(kind) for kind in kinds if kind)
        return found

    def varies(self, prefix: str) -> bool:
        """Tell whether a key or anything below it may differ from sample to sample."""
        keys = [*self.variations.vary, *self._copies]
        return any((key + ".").startswith(prefix + ".") for key in keys) or any(
            prefix.startswith(key + ".") for key in keys
        )

    def most(self) -> tuple[int, int]:
        """Return the largest number of elements and of frequencies that a sample may have."""
        stations, radios = [self._some_tables], [self._some_tables]
        some = next(self.attempts(0)).values
        for key, drawn in self.variations.vary.items():
            if key.split(".")[0] in ("base_station", "radio"):
                variants = [self.tables({**some, key: value}) for value in drawn.extremes()]
                stations += variants
                radios += variants
        elements = [_of(BaseStation, one["base_station"], "element_count") for one in stations]
        points = [_of(Radio, one["radio"], "points") for one in radios]
        return max(elements), max(points)

    @cached_property
    def _some_tables(self) -> dict[str, Any]:
        """Return the tables of the first possible sample, imported geometry included."""
        tables = self.tables(next(self.attempts(0)).values)
        return dict(with_geometry(tables))

    def _order(self, group: str) -> Any:
        # Base scenario's order first, copies after the template's place.
        base = {name: at for at, name in enumerate(self._base_names(group))}
        copies = {}
        for number in self.variations.number.values():
            if number.of is not None and number.of.startswith(group + "."):
                name = number.of.split(".")[1]
                for index in range(1, number.greatest + 1):
                    copies[_copy(name, index)] = (base.get(name, len(base)), index)
        return lambda name: copies.get(name, (base.get(name, len(base)), 0))

    @cached_property
    def _base_tables(self) -> dict[str, Any]:
        tables = self.source.changed(lambda t: set_keys(t, self.variations.set, by="set."))
        return dict(with_geometry(tables))

    def _base_names(self, group: str) -> list[str]:
        return list(self._base_tables.get(group, {}))

    @cached_property
    def _copies(self) -> dict[str, Drawn]:
        """Distributions of all possible copies' keys."""
        found: dict[str, Drawn] = {}
        for number in self.variations.number.values():
            if number.of is not None:
                for index in range(1, number.greatest + 1):
                    for key, drawn in number.vary.items():
                        found[f"{_copy(number.of, index)}.{key}"] = drawn
        return found

    def _values(self, sample: int, stream: Any) -> dict[str, object]:
        values: dict[str, object] = {}
        steps = self._steps(sample)
        for key, drawn in self.variations.vary.items():
            if isinstance(drawn, Grid | Listed):
                values[key] = drawn.values[steps[key]]
            else:
                values[key] = drawn.draw(stream(f"vary/{key}"))
        for name, number in self.variations.number.items():
            rng = stream(f"number/{name}")
            count = int(rng.integers(number.least, number.greatest, endpoint=True))
            values[f"number.{name}"] = count
            if number.among is not None:
                kept = {int(i) for i in rng.permutation(len(number.among))[:count]}
                for place, path in enumerate(number.among):
                    if place not in kept:
                        values[f"number.{name}.without.{path}"] = True
            for index in range(1, count + 1) if number.of is not None else ():
                for key, drawn in number.vary.items():
                    full = f"{_copy(str(number.of), index)}.{key}"
                    values[full] = drawn.draw(stream(f"vary/{full}"))
        return values

    def _steps(self, sample: int) -> dict[str, int]:
        """Return each stepped key's place in its values: the last axis steps fastest."""
        steps: dict[str, int] = {}
        for keys, length in reversed(self.variations.grid.items()):
            sample, at = divmod(sample, length)
            steps |= dict.fromkeys(keys, at)
        return steps

    def _put(self, tables: dict[str, Any], values: Mapping[str, object]) -> None:
        """Replace each template by its copies, and remove the tables that this sample lacks."""
        for name, number in self.variations.number.items():
            for path in number.among or ():
                if values.get(f"number.{name}.without.{path}"):
                    group, one = path.split(".")
                    tables.get(group, {}).pop(one, None)
            if number.of is None:
                continue
            group, one = number.of.split(".")
            count = values.get(f"number.{name}", 0)
            assert isinstance(count, int)
            rebuilt: dict[str, Any] = {}
            for key, table in tables[group].items():
                if key != one:
                    rebuilt[key] = table
                    continue
                for index in range(1, count + 1):
                    copied: dict[str, Any] = {"it": _deep(table)}
                    mine = {
                        f"it.{rest}": values[f"{_copy(number.of, index)}.{rest}"]
                        for rest in number.vary
                        if f"{_copy(number.of, index)}.{rest}" in values
                    }
                    set_keys(copied, mine, by=f"number.{name}.vary.")
                    rebuilt[_copy(one, index)] = copied["it"]
            tables[group] = rebuilt

    def _number_problems(self) -> Iterator[str]:
        tables = self.source.changed(lambda t: set_keys(t, self.variations.set, by="set."))
        for name, number in self.variations.number.items():
            key = "of" if number.of is not None else "among"
            for path in [number.of] if number.of is not None else (number.among or ()):
                group, _, one = path.partition(".")
                known = list(tables.get(group, {})) if group in GROUPS else []
                if one not in known:
                    told = [f"{g}.{n}" for g in GROUPS for n in tables.get(g, {})]
                    yield (
                        f"number.{name}.{key} = {shown(path)}: no such table"
                        f"{did_you_mean(path, told)}; known: {', '.join(told) or 'none'}"
                    )
                elif number.of is not None:
                    for index in range(1, number.greatest + 1):
                        if _copy(one, index) in known:
                            yield (
                                f"number.{name}.of = {shown(path)}: its copies would be called "
                                f"{_copy(one, index)!r}, as another table is; rename that"
                            )


def open_sample_space(variations: Variations, folder: Path) -> SampleSpace:
    """Find the base scenario of some variations.

    Parameters
    ----------
    variations
        As they were read.
    folder
        That of their file: a path in ``base`` is relative to it.

    Raises
    ------
    ScenarioError
        If there is no such scenario.
    """
    base = variations.base
    if base not in scenario_names() and is_file(folder / base):
        base = str(folder / base)
    try:
        return SampleSpace(scenario_source(base), variations)
    except ScenarioError as error:
        raise ScenarioError(f"base: {error}") from None


def impossible_sample(sample: int, attempts: int, problem: str) -> ScenarioError:
    """Say that no draw of a sample is possible."""
    last = problem.splitlines()[0] if problem else "unknown"
    return ScenarioError(
        f"sample {sample}: none of {attempts} draws is possible; the last one: {last}. Narrow the "
        "distributions, or raise attempts"
    )


def _problems_of_keys(tables: dict[str, Any]) -> list[str]:
    try:
        Scenario.model_validate(with_geometry(tables))
    except ValidationError as error:
        return problems(error, Scenario, of_keys_only=True)
    except ScenarioError:  # the geometry's, which no draw has chosen
        return []
    return []


def _copy(name: str, index: int) -> str:
    return f"{name}_{index}"


def _deep(table: Any) -> Any:
    return {key: _deep(one) for key, one in table.items()} if isinstance(table, dict) else table


def _of(model: type[Checked], table: Any, name: str) -> int:
    try:
        return int(getattr(model.model_validate(table), name))
    except ValidationError:
        return 0
