"""Recipes of the benchmark: configuration, seeds, version and a digest of all of them."""

import hashlib
import json
from importlib.resources import files
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from scenes.files.toml_reader import read_toml
from scenes.schema.errors import ScenarioError, problems
from scenes.schema.quantities import Checked
from simulator.dataset.config import DatasetConfig, identity

TRACKS = ("mirrors", "user", "channel")
"""Find the mirrors, locate the user, predict the channel."""

PARTS = ("train", "validation", "test")


class Part(Checked):
    """One part of a track: its rooms are drawn with a seed of its own."""

    seed: int = Field(ge=0, description="of all that is drawn")
    samples: int = Field(ge=1, le=100_000, description="number of samples unless --size says else")


class ChannelGrid(Checked):
    """Where a predicted channel is compared."""

    elements: int = Field(ge=2, description="evenly spread over the array")
    frequencies: int = Field(ge=2, description="evenly spread over the band")


class Recipe(Checked):
    """A track of the benchmark."""

    format: Literal[1]
    name: str
    version: str
    title: str
    digest: str = Field(description="of all else, and of the base scenario")
    inputs: Annotated[tuple[str, ...], Field(strict=False, min_length=1)]
    channel: ChannelGrid | None = None
    parts: dict[str, Part]
    dataset: dict[str, Any] = Field(description="as for `mmslam dataset`, without count and seed")

    def tables(self, part: str, size: int | None = None) -> dict[str, Any]:
        """Return the configuration of one part's dataset.

        Parameters
        ----------
        part
            Its name.
        size
            The first samples of it; None: as many as the recipe says. Sample n is the same in all
            sizes.

        Raises
        ------
        ScenarioError
            If there is no such part, or the size is none.
        """
        if part not in self.parts:
            raise ScenarioError(f"part = {part!r}: give one of {', '.join(self.parts)}")
        count = self.parts[part].samples if size is None else size
        if count < 1:
            raise ScenarioError(f"size = {count}: give 1 or more samples")
        return {**self.dataset, "count": count, "seed": self.parts[part].seed}


def load_recipe(track: str) -> Recipe:
    """Read the recipe of a track, and check that nothing of it was changed.

    Raises
    ------
    ScenarioError
        If there is no such track, or the digest is not that of the recipe.
    """
    if track not in TRACKS:
        raise ScenarioError(f"track = {track!r}: give one of {', '.join(TRACKS)}")
    name = f"{track}.toml"
    source = files("mmslam.benchmark") / "recipes" / name
    tables = read_toml(source, name=name, kind="recipe", remedy="install mmslam again")
    try:
        recipe = Recipe.model_validate(tables)
    except ValidationError as error:
        raise ScenarioError("\n".join(f"{name}: {x}" for x in problems(error, Recipe))) from None
    found = recipe_digest(recipe)
    if found != recipe.digest:
        raise ScenarioError(
            f"{name}: its content or its base scenario was changed (digest {found}, frozen as "
            f"{recipe.digest}); a changed recipe is another benchmark: give it a version and "
            "digest of its own"
        )
    return recipe


def recipe_digest(recipe: Recipe) -> str:
    """Return the digest of a recipe without its own, and of its base scenario."""
    content = recipe.model_dump(mode="json", exclude={"digest"})
    content["base"] = identity(space_of(recipe, "train"))["base"]
    told = json.dumps(content, sort_keys=True, ensure_ascii=False)
    return hashlib.sha256(told.encode()).hexdigest()


def space_of(recipe: Recipe, part: str, size: int | None = None) -> Any:
    """Return the sample space of one part."""
    from scenes.files.loading import scenario_source

    config = DatasetConfig.model_validate(recipe.tables(part, size))
    return config.space(scenario_source(config.base))
