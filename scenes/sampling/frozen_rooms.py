"""Rooms that hold several samples each: one frozen realisation, while users or the station move.

Without them every sample has walls of its own. With ``[rooms]``, samples are in rooms of equal
number, one room after the other; what belongs to the room (``objects``, ``points``, and their
number) is drawn once for it, as for its first sample, and so is the roughness of its surfaces.
Users, station, radio and noise are each sample's own, and so are the keys in ``moving``.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from pydantic import Field

from scenes.sampling.distributions import Grid, Listed
from scenes.sampling.sample_space import Attempt, SampleSpace
from scenes.scenario import Scenario
from scenes.schema.errors import ScenarioError, did_you_mean, shown
from scenes.schema.quantities import Checked

OF_ROOM = ("objects", "points", "geometry")
"""Tables of a scenario that make up its room."""


class Rooms(Checked):
    """How many rooms there are, and what moves in them."""

    count: int = Field(ge=1, description="number of rooms; samples are divided among them evenly")
    moving: tuple[str, ...] = Field(
        (),
        strict=False,
        description="varied objects or points that are drawn for each sample, though their "
        "roughness is the room's, such as ['objects.post']",
    )


@dataclass(frozen=True)
class RoomSpace(SampleSpace):
    """Samples of which several are in one room."""

    rooms: Rooms

    def attempts(self, sample: int) -> Iterator[Attempt]:
        """Yield draws of one sample in its room; none but one where the room is impossible."""
        try:
            self._drawn_room(first_sample(self, sample))
        except ScenarioError as error:
            yield Attempt(values={}, scenario=None, problem=str(error))
            return
        yield from super().attempts(sample)

    def check(self) -> Attempt:
        """Check the rooms and all keys, as :meth:`SampleSpace.check` does."""
        if found := list(self._room_problems()):
            raise ScenarioError("\n".join(found))
        return super().check()

    @property
    def samples_each(self) -> int:
        """Samples of a room."""
        return self.variations.samples // self.rooms.count

    def _values(self, sample: int, stream: Any) -> dict[str, object]:
        drawn = super()._values(sample, stream)
        own = {key: value for key, value in drawn.items() if not is_of_room(self, key)}
        return {**own, **self._drawn_room(first_sample(self, sample))}

    def _drawn_room(self, first: int) -> Mapping[str, object]:
        if first not in self._latest:
            attempt, _ = SampleSpace(self.source, self.variations).first(first)
            drawn = {k: value for k, value in attempt.values.items() if is_of_room(self, k)}
            self._latest.clear()  # a worker goes through one room after the other
            self._latest[first] = drawn
        return self._latest[first]

    @cached_property
    def _latest(self) -> dict[int, Mapping[str, object]]:
        return {}

    def _room_problems(self) -> Iterator[str]:
        count, samples = self.rooms.count, self.variations.samples
        if samples % count:
            yield (
                f"rooms.count = {count} does not divide the {samples} samples evenly; give a count "
                f"of {samples + count - samples % count}, or another number of rooms"
            )
        varied = self.variations.vary
        for path in self.rooms.moving:
            if path.split(".")[0] not in OF_ROOM:
                yield (
                    f"rooms.moving: {shown(path)} is no part of a room, and each sample's own "
                    "anyway; leave it out"
                )
            elif not any((key + ".").startswith(path + ".") for key in varied):
                yield (
                    f"rooms.moving: {shown(path)} is not varied{did_you_mean(path, list(varied))}; "
                    "give it a distribution in [vary]"
                )
        for key, drawn in varied.items():
            if is_of_room(self, key) and isinstance(drawn, Grid | Listed):
                yield (
                    f"vary.{key}: a {drawn.kind} steps from sample to sample, but it belongs to "
                    "the room; draw it ('choice', 'uniform', …), or put it in rooms.moving"
                )


def first_sample(space: SampleSpace, sample: int) -> int:
    """Return the first sample in the room of a sample: whose roughness all in the room have."""
    if not isinstance(space, RoomSpace):
        return sample
    return sample - sample % space.samples_each


def is_of_room(space: SampleSpace, key: str) -> bool:
    """Tell whether a drawn key belongs to the room, not to the sample in it."""
    moving = space.rooms.moving if isinstance(space, RoomSpace) else ()
    parts = key.split(".")
    if parts[0] == "number":
        number = space.variations.number.get(parts[1])
        paths = [] if number is None else [number.of] if number.of else list(number.among or ())
        return any(str(path).split(".")[0] in OF_ROOM for path in paths)
    return parts[0] in OF_ROOM and not any((key + ".").startswith(f"{one}.") for one in moving)


def room_number(
    space: SampleSpace, sample: int, values: Mapping[str, object], scenario: Scenario
) -> int:
    """Return the number of a sample's room: samples of one dataset with equal ones share walls.

    It is a digest of what was drawn of the room and, if a surface is rough by a spectrum, of the
    realisation. So samples that differ in users alone are in one room if all walls are smooth.

    Parameters
    ----------
    space, sample
        The sample.
    values
        As drawn, by key.
    scenario
        Of the sample.

    Returns
    -------
    Zero or more, below 2⁶³.
    """
    drawn = {key: value for key, value in values.items() if is_of_room(space, key)}
    rough = any(
        body.roughness is not None
        and body.roughness.rms > 0
        and body.roughness.measured is None  # heights of a file are the same in every sample
        for body in scenario.objects.values()
    )
    realisation = [space.variations.seed, first_sample(space, sample)] if rough else []
    told = json.dumps([drawn, realisation], sort_keys=True)
    return int.from_bytes(hashlib.sha256(told.encode()).digest()[:8]) >> 1
