"""A small deterministic TOML writer: tables, strings, numbers, booleans and flat lists.

Python reads TOML with its standard library, but does not write it.
"""

import math
import re
from collections.abc import Iterator, Mapping

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\t": "\\t", "\r": "\\r"}


def toml_text(table: Mapping[str, object]) -> str:
    """Write nested tables as TOML; reading it again gives equal tables.

    Parameters
    ----------
    table
        Keys with strings, numbers, booleans, lists of those, or further tables. Keys whose
        value is None are left out.

    Raises
    ------
    TypeError
        If a value is of another type.
    """
    return "\n\n".join("\n".join(lines) for lines in _tables(table, ())) + "\n"


def _tables(table: Mapping[str, object], path: tuple[str, ...]) -> Iterator[list[str]]:
    lines = [
        f"{_key(key)} = {_value(value)}"
        for key, value in table.items()
        if value is not None and not isinstance(value, Mapping)
    ]
    inner = {key: value for key, value in table.items() if isinstance(value, Mapping)}
    if path and (lines or not inner):
        lines.insert(0, f"[{'.'.join(_key(part) for part in path)}]")
    if lines:
        yield lines
    for key, value in inner.items():
        yield from _tables(value, (*path, key))


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _string(key)


def _string(text: str) -> str:
    signs = (
        _ESCAPES.get(sign) or (sign if sign.isprintable() else f"\\U{ord(sign):08x}")
        for sign in text
    )
    return f'"{"".join(signs)}"'


def _value(value: object) -> str:
    match value:
        case bool():
            return str(value).lower()
        case int():
            return str(int(value))
        case float():
            return repr(float(value)) if math.isfinite(value) else f"{value:f}"
        case str():
            return _string(value)
        case list() | tuple():
            return f"[{', '.join(_value(entry) for entry in value)}]"
    raise TypeError(f"TOML has no {type(value).__name__} ({value!r}); give a number or a string")
