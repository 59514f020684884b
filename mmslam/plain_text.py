"""Text from data files, made safe for terminals, HTML pages and file names.

A name in somebody's file may hold control characters, which make a terminal write files, move the
cursor or change its title, and marks of writing direction, which show another text than is there
(Unicode Technical Report 36). They are shown by their numbers instead.
"""

import hashlib
import json
import os
from collections.abc import Mapping
from typing import Any

LONGEST_WORD = 200
"""Longest part of a message without a space: what repeats a hostile name is cut. [-]"""

LONGEST_LINE = 2000
"""Longest line of a message. [-]"""

LONGEST_FILE_NAME = 100
"""Of a name that data give, in bytes: something is put before or behind it."""


def visible(text: str) -> str:
    """Return text with control and invisible characters as code numbers; newlines and tabs stay."""
    if text.isprintable():
        return text
    return "".join(sign if sign.isprintable() or sign in "\n\t" else _number(sign) for sign in text)


def message(text: str) -> str:
    """Return text made visible, with overlong words and lines cut, for an error message."""
    return "\n".join(_cut(line) for line in visible(text).split("\n"))


def json_text(document: Mapping[str, Any] | list[Any]) -> str:
    """Write JSON that a terminal may show: what is not printable is escaped, as JSON allows."""
    text = json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False)
    if text.replace("\n", "").isprintable():
        return text
    return "".join(
        sign if sign.isprintable() or sign == "\n" else json.dumps(sign)[1:-1] for sign in text
    )


def file_name(text: str) -> str:
    """Return a safe file name of limited length.

    It has no separator, no invisible character, and nothing that a shell obeys, as users paste the
    paths that commands tell them.
    """
    name = "".join(
        sign if sign.isprintable() and sign not in _SEPARATORS else "_" for sign in text
    ).strip(" .")
    if name.startswith("-"):  # an option
        name = f"_{name[1:]}"
    if len(os.fsencode(name)) > LONGEST_FILE_NAME:
        digest = hashlib.sha256(name.encode("utf-8", "surrogateescape")).hexdigest()[:8]
        name = f"{name[: LONGEST_FILE_NAME // 4 - 9]}-{digest}"  # a sign has 4 bytes at most
    return name or "unnamed"


def drawn_plainly(figure: Any) -> None:
    """Draw the text of a figure literally, without Matplotlib's mathtext between dollar signs.

    Tick labels may be mathtext, and stay so: they get their text only when the figure is drawn.

    Parameters
    ----------
    figure
        Of Matplotlib, before it is drawn; our own labels hold no formula.
    """
    for artist in figure.findobj(lambda one: hasattr(one, "set_parse_math")):
        if "$" in artist.get_text():
            artist.set_parse_math(False)
        artist.set_text(visible(artist.get_text()))


_SEPARATORS = '/\\:*?"<>|' + "$`&;!#'~^%(){}[]"  # of paths on some system or other, and of shells


def _number(sign: str) -> str:
    code = ord(sign)
    return (
        f"\\x{code:02x}"
        if code < 0x100
        else f"\\u{code:04x}"
        if code < 0x10000
        else f"\\U{code:08x}"
    )


def _cut(line: str) -> str:
    words = [
        word if len(word) <= LONGEST_WORD else f"{word[:LONGEST_WORD]}…" for word in line.split(" ")
    ]
    line = " ".join(words)
    return line if len(line) <= LONGEST_LINE else f"{line[:LONGEST_LINE]}…"
