"""Variations of a scenario: which keys are drawn, from what, how often, and with which seed.

The tables of a dataset's or a sweep's TOML file, typed and checked. Keys are dotted paths as in
``mmslam run --set``; here they may also be nested tables.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BeforeValidator, Field, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from scenes.files.toml_reader import read_toml
from scenes.sampling.distributions import Distribution, Drawn
from scenes.schema.errors import ScenarioError, problems
from scenes.schema.quantities import Checked, Name

MOST_SAMPLES = 100_000_000
"""Most samples of a dataset."""

MOST_ATTEMPTS = 10_000
"""Most draws of one sample; if possible scenes are rarer, the distributions must be narrowed."""

MOST_COPIES = 1000
"""Most copies of one template."""


def _by_dotted_key(value: object) -> object:
    """Flatten nested tables of distributions (a table with a ``kind``) to dotted keys."""
    return _flat(value, lambda table: isinstance(table.get("kind"), str))


def _settings(value: object) -> object:
    """Flatten nested tables of settings; a table under a dotted key is a value by itself."""
    return _flat(value, lambda table: False)


def _flat(value: object, ends_at: Any) -> object:
    if not isinstance(value, Mapping):
        return value
    flat: dict[str, object] = {}
    for key, entry in value.items():
        inside = isinstance(entry, Mapping) and "." not in key and not ends_at(entry)
        if inside and entry:
            below = _flat(entry, ends_at)
            assert isinstance(below, dict)
            flat |= {f"{key}.{rest}": leaf for rest, leaf in below.items()}
        else:
            flat[key] = entry
    return flat


Keys = Annotated[dict[str, Distribution], BeforeValidator(_by_dotted_key)]
DrawnKeys = Annotated[
    dict[str, Annotated[Drawn, Field(discriminator="kind")]], BeforeValidator(_by_dotted_key)
]
Settings = Annotated[dict[str, Any], BeforeValidator(_settings)]


class Number(Checked):
    """A varying number of objects, points or users: copies of one table, or a subset of several."""

    of: str | None = Field(
        None, description="the table that is copied, such as 'objects.post'; or give among"
    )
    among: Annotated[tuple[str, ...], Field(strict=False, min_length=1)] | None = Field(
        None, description="tables of which only some are kept, such as ['objects.a', 'objects.b']"
    )
    least: int = Field(0, ge=0, le=MOST_COPIES, description="the smallest number")
    most: int | None = Field(
        None, ge=0, le=MOST_COPIES, description="the largest number [all that are in among]"
    )
    vary: DrawnKeys = Field(
        default_factory=dict, description="distributions by key of each copy, such as centre_m"
    )

    @model_validator(mode="after")
    def _copies_or_some(self) -> "Number":
        if (self.of is None) == (self.among is None):
            raise PydanticCustomError("number", "needs either of or among; give one of them")
        if self.of is not None and self.most is None:
            raise PydanticCustomError("number", "copies of a table need most; give it")
        if self.among is not None and self.vary:
            raise PydanticCustomError(
                "number", "vary belongs to copies; vary what is in among by the table [vary]"
            )
        if self.among is not None and self.greatest > len(self.among):
            raise PydanticCustomError(
                "number",
                "most = {most} exceeds the {count} tables in among; lower it",
                {"most": self.greatest, "count": len(self.among)},
            )
        if self.least > self.greatest:
            raise PydanticCustomError(
                "number",
                "least = {least} must not exceed most = {most}; swap them",
                {"least": self.least, "most": self.greatest},
            )
        return self

    @property
    def greatest(self) -> int:
        """The largest number."""
        return self.most if self.most is not None else len(self.among or ())


class Variations(Checked):
    """What is varied about a scenario."""

    format: Literal[1] = Field(1, description="the format of this file: 1")
    base: str = Field(
        min_length=1, description="a built-in scenario's name, or a TOML file relative to this one"
    )
    count: int | None = Field(
        None, ge=1, le=MOST_SAMPLES, description="the number of samples [once through the grid]"
    )
    seed: int = Field(0, ge=0, le=2**63 - 1, description="the seed of all that is drawn")
    attempts: int = Field(
        100,
        ge=1,
        le=MOST_ATTEMPTS,
        description="how often a sample may be drawn until it is possible",
    )
    set: Settings = Field(default_factory=dict, description="keys that are the same in all samples")
    vary: Keys = Field(default_factory=dict, description="distributions by dotted key")
    number: dict[Name, Number] = Field(
        default_factory=dict, description="how many objects, points or users there are"
    )

    @model_validator(mode="after")
    def _lists_are_as_long(self) -> "Variations":
        lengths = {
            key: len(drawn.values) for key, drawn in self.vary.items() if drawn.kind == "list"
        }
        if len(set(lengths.values())) > 1:
            told = ", ".join(f"vary.{key}: {length}" for key, length in lengths.items())
            raise PydanticCustomError(
                "lists",
                "lists are gone through side by side, but have different lengths ({told}); make "
                "them as long, or use kind = 'grid' for every combination",
                {"told": told},
            )
        return self

    @property
    def grid(self) -> dict[tuple[str, ...], int]:
        """Steps of each axis of the grid, by the keys that step along it; the last is fastest."""
        axes: dict[tuple[str, ...], int] = {}
        listed = tuple(key for key, drawn in self.vary.items() if drawn.kind == "list")
        for key, drawn in self.vary.items():
            if drawn.kind == "list":
                axes[listed] = len(drawn.values)
            elif drawn.kind == "grid":
                axes[(key,)] = len(drawn.values)
        return axes

    @property
    def grid_size(self) -> int:
        """Number of combinations; 1 without grids and lists."""
        size = 1
        for steps in self.grid.values():
            size *= steps
        return size

    @property
    def samples(self) -> int:
        """Number of samples.

        Raises
        ------
        ScenarioError
            If nothing says how many, or they do not go through the grid once.
        """
        if self.count is None and not self.grid:
            raise ScenarioError("count: missing; give the number of samples")
        if self.count is not None and self.count < self.grid_size:
            raise ScenarioError(
                f"count = {self.count}: the grid has {self.grid_size} combinations; give as many, "
                "or leave count out"
            )
        if self.grid_size > MOST_SAMPLES:
            raise ScenarioError(
                f"vary: the grid has {self.grid_size} combinations, more than {MOST_SAMPLES}; "
                "give fewer values"
            )
        return self.grid_size if self.count is None else self.count


_T = TypeVar("_T", bound=Variations)


def load_variations(config: Path | Mapping[str, Any], model: type[_T]) -> _T:
    """Read variations from a TOML file, or from tables like those of one.

    Parameters
    ----------
    config
        The file, or its tables.
    model
        What it holds: :class:`Variations`, or more.

    Raises
    ------
    ScenarioError
        If it cannot be read, or a key is missing, unknown or impossible: a line for each.
    """
    if isinstance(config, Mapping):
        return _checked(config, model, "")
    return _checked(_tables(config), model, f"{config}: ")


def _tables(path: Path) -> dict[str, Any]:
    return read_toml(
        path,
        name=str(path),
        kind="configuration",
        remedy="give the TOML file that says what varies",
    )


def _checked(tables: Mapping[str, Any], model: type[_T], place: str) -> _T:
    try:
        read = model.model_validate(tables)
        _ = read.samples  # refused now, not when it is first asked for
    except ValidationError as error:
        found = [
            line.removeprefix(": ").replace("the scenario = ", "the configuration = ")
            for line in problems(error, model)
        ]
        raise ScenarioError("\n".join(f"{place}{line}" for line in found)) from None
    except ScenarioError as error:
        raise ScenarioError(f"{place}{error}") from None
    return read
