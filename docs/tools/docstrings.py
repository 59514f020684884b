"""An extension of griffe, which reads our sources without running them.

Docstrings are turned into Markdown. A key of a scenario or a field of a result has no docstring:
its description (pydantic's ``Field(description=…)``) or the comment on its line takes the place.
"""

import ast
import importlib.util
import re
from pathlib import Path
from typing import Any

import griffe

_spec = importlib.util.spec_from_file_location(
    "restructured_text", Path(__file__).with_name("restructured_text.py")
)
assert _spec is not None
assert _spec.loader is not None
_restructured_text = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(_restructured_text)


class Docstrings(griffe.Extension):
    """Make the docstrings of all objects readable as Markdown."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Change one object's docstring."""
        if obj.docstring is not None:
            obj.docstring.value = _restructured_text.to_markdown(obj.docstring.value)
        elif isinstance(obj, griffe.Attribute):
            told = _description(obj) or _comment(obj)
            if told:
                plain = _without_links(told)
                obj.docstring = griffe.Docstring(plain, lineno=obj.lineno, parent=obj)


def _without_links(text: str) -> str:
    """Keep brackets from being taken for links, but for those within code."""
    parts = text.split("`")
    parts[::2] = [re.sub(r"([\[\]])", r"\\\1", part) for part in parts[::2]]
    return "`".join(parts)


def _description(attribute: griffe.Attribute) -> str | None:
    found = re.search(r"description=((?:'[^']*'|\"[^\"]*\"|\s)+)", str(attribute.value or ""))
    if found is None:
        return None
    try:
        return str(ast.literal_eval(f"({found[1]})"))
    except (SyntaxError, ValueError):
        return None


def _comment(attribute: griffe.Attribute) -> str | None:
    """Return the comment behind a field of a class."""
    if not isinstance(attribute.parent, griffe.Class) or attribute.lineno is None:
        return None
    if not isinstance(attribute.filepath, Path):
        return None
    line = attribute.filepath.read_text(encoding="utf-8").splitlines()[attribute.lineno - 1]
    found = re.search(r"  # (?!type:|fmt:|noqa)(.+)$", line)
    return found[1] if found else None
