"""Error messages about a scenario, each with key, value, limit and remedy."""

import difflib
import reprlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

NAME_TAG, TABLE_TAG = "[name]", "[table]"
"""Mark in pydantic's locations whether a name or a table was read; no key of a scenario's."""

_LONGEST_TEXT = 200  # of what a message repeats, in characters
MOST_PROBLEMS = 50
"""Most problems of one input that are told: a list of thousands of wrong items has one each. [-]"""

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 60
_SHORT.maxdict = _SHORT.maxlist = _SHORT.maxtuple = 4


class ScenarioError(ValueError):
    """A scenario is invalid: one line per problem, each with key, value, limit and remedy."""


def did_you_mean(wrong: str, known: Iterable[str]) -> str:
    """Suggest the closest known word: ``" (did you mean 'wall'?)"``, or nothing."""
    if len(wrong) > _LONGEST_TEXT:  # the comparison takes time in proportion to its square
        return ""
    close = difflib.get_close_matches(wrong, list(known), n=1, cutoff=0.6)
    return f" (did you mean {close[0]!r}?)" if close else ""


def shown(value: object) -> str:
    """Show a value in an error message as TOML writes it, shortened."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        value = list(value)
    try:
        return _SHORT.repr(value)
    except ValueError:  # a whole number of more digits than Python writes
        return "a number of thousands of digits"


def shown_text(text: str) -> str:
    """Show a name or another text from elsewhere in an error message, shortened."""
    return text if len(text) <= _LONGEST_TEXT else f"{text[:_LONGEST_TEXT]}…"


def problems(
    error: ValidationError, model: type[BaseModel], *, of_keys_only: bool = False
) -> list[str]:
    """Turn pydantic's findings into lines that name the key, the value and the remedy.

    Parameters
    ----------
    error
        What pydantic found in the input of ``model``.
    model
        The model that was read; its field descriptions serve as remedies.
    of_keys_only
        Report single keys only, not conflicts between keys that are each valid, such as objects
        that overlap.
    """
    lines: list[str] = []
    findings = error.errors(include_url=False)
    for finding in findings[:MOST_PROBLEMS]:
        context: dict[str, Any] = finding.get("ctx", {})
        if "problems" in context:  # found after all keys were read, one line each
            lines += [] if of_keys_only else context["problems"]
            continue
        place = _place(finding["loc"], model)
        lines.append(_line(place, finding["type"], finding["msg"], context, finding["input"]))
    if len(findings) > MOST_PROBLEMS:
        lines.append(f"… and {len(findings) - MOST_PROBLEMS} more problems; mend these first")
    return list(dict.fromkeys(lines))


@dataclass(frozen=True, kw_only=True)
class _Place:
    """Where in a scenario a finding is."""

    path: list[str]  # dotted path, without pydantic's own marks
    table: type[BaseModel]  # the table that holds (or lacks) the last key
    field: FieldInfo | None  # what the last key means; None for names and unknown keys
    choices: list[type[BaseModel]]  # the kinds of table that may stand there


def _line(place: _Place, kind: str, message: str, context: dict[str, Any], value: object) -> str:
    key = shown_text(".".join(map(shown_text, place.path)))
    remedy = (place.field.description if place.field else None) or ""
    kinds = [tag for choice in place.choices for tag in _tags(choice)]
    match kind:
        case "missing":
            return f"{key}: missing; give {remedy or 'it'}"
        case "extra_forbidden":
            known = list(place.table.model_fields)
            hint = did_you_mean(place.path[-1], known)
            where = "".join(f" for kind {tag!r}" for tag in _tags(place.table))
            other = "; to change the kind, replace the whole table" if where else ""
            return f"{key}: unknown key{hint}; known{where}: {', '.join(known)}{other}"
        case "union_tag_not_found":
            return f"{key}.kind: missing; give one of {', '.join(kinds)}"
        case "union_tag_invalid":
            tag = shown_text(str(context["tag"]))
            return (
                f"{key}.kind = {tag!r}: unknown kind{did_you_mean(tag, kinds)}; "
                f"use one of {', '.join(kinds)}"
            )
        case "model_type" | "model_attributes_type" | "dict_type":
            return f"{key or 'the scenario'} = {shown(value)}: must be a table of keys"
    if message.startswith("Input should"):
        message = "must" + message.removeprefix("Input should")
    if remedy and ";" not in message:
        message += f"; give {remedy}"
    if isinstance(value, Mapping):  # its message names the keys in it that matter
        return f"{key}: {message}"
    return f"{key} = {shown(value)}: {message}"


def _place(location: tuple[int | str, ...], model: type[BaseModel]) -> _Place:
    """Walk a pydantic location, in which the kind of a table follows its name."""
    path: list[str] = []
    table, choices = model, [model]
    field: FieldInfo | None = None
    steps = list(location)
    while steps:
        step = steps.pop(0)
        if step == "[key]":  # pydantic's mark: the name itself is wrong
            break
        path.append(str(step))
        if isinstance(step, int):  # an entry of a list: the list's field still says what it is
            continue
        field = table.model_fields.get(step)
        choices = list(_models(field.annotation)) if field else []
        if field and _origin(field.annotation) is dict and steps:
            path.append(str(steps.pop(0)))
            field = None
        inner = choices
        if steps and steps[0] in (NAME_TAG, TABLE_TAG):
            steps.pop(0)
        if len(choices) > 1 and steps and steps[0] != "[key]":
            tag = steps.pop(0)
            inner = [choice for choice in choices if tag in _tags(choice)]
        if inner and steps and steps[0] != "[key]":
            table = inner[0]
    return _Place(path=path, table=table, field=field, choices=choices)


def _origin(annotation: Any) -> Any:
    while get_origin(annotation) is Annotated:
        annotation = get_args(annotation)[0]
    return get_origin(annotation)


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _models(part)


def _tags(model: type[BaseModel]) -> Sequence[str]:
    field = model.model_fields.get("kind")
    return get_args(field.annotation) if field else ()
