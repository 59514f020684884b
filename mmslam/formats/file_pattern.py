"""Patterns of file names that tell where a sweep was taken: ``x{x}_z{z}.s2p``.

``{x}``, ``{y}`` and ``{z}`` are numbers (in ``12p5`` the p is the decimal point), ``{index}``
counts, and ``*`` is whatever varies without meaning.
"""

import re

COORDINATES = ("x", "y", "z")

MOST_STARS = 2
"""Most stars of a pattern: each more takes the length of a name as many times as long. [-]"""

_MOST_DIGITS = 9  # of a number in a file's name, before and behind its point

_FIELD = re.compile(r"\{(\w*)\}|(\*)")
_NUMBERS = {
    "index": rf"(?P<index>\d{{1,{_MOST_DIGITS}}})",
    **{
        axis: rf"(?P<{axis}>[+-]?\d{{1,{_MOST_DIGITS}}}(?:[.p]\d{{1,{_MOST_DIGITS}}})?)"
        for axis in COORDINATES
    },
}


def fields_of_pattern(pattern: str) -> list[str]:
    """Name the fields of a pattern of file names.

    Raises
    ------
    ValueError
        If a field is unknown or repeated, or there is none.
    """
    fields = [match[1] for match in _FIELD.finditer(pattern) if match[2] is None]
    if pattern.count("*") > MOST_STARS:
        raise ValueError(f"files: at most {MOST_STARS} stars can be told apart; use fewer")
    unknown = [field for field in fields if field not in _NUMBERS]
    if unknown or not fields or len(set(fields)) < len(fields):
        raise ValueError(
            f"files = {pattern!r}: use {{x}}, {{y}} and {{z}}, or {{index}}, each at most once, "
            "and * for what varies without meaning"
        )
    return fields


def expression_of_pattern(pattern: str) -> re.Pattern[str]:
    """Return the regular expression of a pattern, with a group for each field."""
    parts, end = [], 0
    for match in _FIELD.finditer(pattern):
        parts.append(re.escape(pattern[end : match.start()]))
        parts.append(".*" if match[2] else _NUMBERS[match[1]])
        end = match.end()
    return re.compile("".join(parts) + re.escape(pattern[end:]), re.IGNORECASE)
