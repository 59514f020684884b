"""Numbers in a text file, and the names of its columns, as programs and instruments write them.

Supported are RFC 4180 (quoted names with commas in them), semicolons with decimal commas, tabs and
blanks, names in a remark above the numbers (CST), a line of units below them, analysers' BEGIN and
END, complex numbers (``1.5-2i``; magnitude and degrees as ADS writes them, ``0.2 / -30.5``), files
without names, and texts in UTF-8, UTF-16 or Windows' own code.
"""

import cmath
import csv
import io
import itertools
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Num

from estimator.measurement.model import MeasurementError

REMARKS = "#%!"
"""Signs at a line's begin that make it a remark."""

LARGEST_TEXT = 2**30
"""Largest text file that is read [byte]."""

PLAIN = 0.5
"""Part of the signs of a text of numbers that ASCII has at least, whatever code it is in. [-]"""

_DELIMITERS = (",", ";", "\t", None)  # None: any number of blanks
_RULE = re.compile(r"[-=_\s]*")
_FRAME = re.compile(r"(BEGIN\b.*|END)\s*", re.IGNORECASE)
"""Lines around the numbers in the files of network analysers."""
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")


@dataclass(frozen=True, kw_only=True)
class TextColumns:
    """The columns of a text file; without names of their own they are called 0, 1, 2, …."""

    names: list[str]
    values: Num[np.ndarray, "rows columns"]  # complex if a column is


def read_columns(path: Path) -> TextColumns:
    """Read a table of real or complex numbers.

    Raises
    ------
    MeasurementError
        If it is no text, a column has no name of its own, or a number is missing.
    """
    head, body = _split(_text(path))
    first = body.split("\n", 1)[0]
    delimiter, decimal_comma = _delimiter(head, first)
    names = _names(path, head, delimiter, len(_fields(first, delimiter)))
    if not body.strip():
        raise MeasurementError(f"{path}: no row of numbers after the header; it may be truncated")
    try:
        values = _numbers(body, delimiter, decimal_comma, quote='"')
    except ValueError as error:
        why = str(error).split("; use `usecols`", maxsplit=1)[0].rstrip(".")
        raise MeasurementError(
            f"{path}: {why} (rows are counted after the header); give a number in every column"
        ) from None
    if values.shape[1] != len(names):
        raise MeasurementError(
            f"{path}: {len(names)} columns in the header, {values.shape[1]} in the rows; it may "
            "be truncated"
        )
    bad = ~np.isfinite(values)
    if bad.any():
        row, column = np.argwhere(bad)[0]
        raise MeasurementError(
            f"{path}: row {row + 1} after the header: {names[column]} is {values[row, column]}; "
            "measure again or remove that position"
        )
    return TextColumns(names=names, values=values)


def read_matrix(path: Path) -> np.ndarray:
    """Read a matrix of real or complex numbers (``1.5-2j``, ``1.5-2i``) without any names.

    Raises
    ------
    MeasurementError
        If it is no text, or its lines are no rows of numbers.
    """
    head, body = _split(_text(path))
    if head and not head[-1].startswith(tuple(REMARKS)):
        raise MeasurementError(
            f"{path}: the first line is {head[-1][:80]!r}, names of columns; name one by variable"
        )
    if not body.strip():
        raise MeasurementError(f"{path}: no row of numbers; it may be truncated")
    first = body.split("\n", 1)[0]
    delimiter, decimal_comma = _delimiter([], first)
    try:
        return _numbers(body, delimiter, decimal_comma)
    except ValueError as error:
        raise MeasurementError(f"{path}: {error}; every line must be a row of numbers") from None


def _numbers(
    body: str, delimiter: str | None, decimal_comma: bool, quote: str | None = None
) -> Num[np.ndarray, "rows columns"]:
    """Read rows of numbers; complex ones if the first row holds one."""
    first = body.split("\n", 1)[0]
    body = body.replace(",", ".") if decimal_comma else body
    fields = _fields(first, delimiter)
    options: dict[str, Any] = {}
    if not all(_is_number(one.replace(",", ".") if decimal_comma else one) for one in fields):
        if all(_is_number(one) or _is_complex(one) for one in fields):
            options = {"dtype": np.complex128, "converters": _complex}
    return np.loadtxt(
        io.StringIO(body), delimiter=delimiter, comments=REMARKS[0], quotechar=quote, ndmin=2,
        **options,
    )  # fmt: skip


def _text(path: Path) -> str:
    try:
        size = path.stat().st_size
        if size > LARGEST_TEXT:
            raise MeasurementError(
                f"{path}: {size} bytes are more than {LARGEST_TEXT}; save it as .npy, or import "
                "in parts"
            )
        written = path.read_bytes()
        if written.startswith(_UTF_16):
            return _lines(written.decode("utf-16"))
        if b"\0" in written[:4096]:
            raise MeasurementError(f"{path}: cannot be read as text (it holds binary data)")
        try:
            return _lines(written.decode("utf-8-sig"))
        except UnicodeDecodeError:  # every byte is a character of it: signs of names may be wrong
            text = written.decode("cp1252", errors="replace")
            if sum(sign.isascii() for sign in text) < PLAIN * len(text):
                raise
            return _lines(text)
    except (OSError, UnicodeDecodeError) as error:
        raise MeasurementError(f"{path}: cannot be read as text ({error})") from None


def _lines(text: str) -> str:
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _split(text: str) -> tuple[list[str], str]:
    """Separate what stands above the numbers (remarks, perhaps names) from them."""
    stream = io.StringIO(text)
    head = []
    for line in stream:
        if not line.strip():
            continue
        if line[0] in REMARKS:
            head.append(line.strip())
            continue
        if _FRAME.fullmatch(line):
            continue
        rest = "".join(
            one
            for one in stream
            if not one.startswith(tuple(REMARKS)) and not _FRAME.fullmatch(one)
        )
        if any(_is_row(line, delimiter) for delimiter in _DELIMITERS):
            return head, line + rest
        return [*head, line.strip()], _without_units(rest.lstrip("\n"))
    return head, ""


def _without_units(body: str) -> str:
    """Drop a line below the names that holds no digit: the columns' units."""
    first, _, rest = body.partition("\n")
    numbered = any(sign.isdigit() for sign in first) or "nan" in first.lower()
    return body if numbered or not rest.strip() else rest


def _delimiter(head: list[str], first: str) -> tuple[str | None, bool]:
    for delimiter in _DELIMITERS:
        fields = _fields(first, delimiter)
        named = _header(head, delimiter, len(fields)) if head else None
        fits = named is not None or not head or head[-1].startswith(tuple(REMARKS))
        if len(fields) > 1 and fits and all(_is_number(one) or _is_complex(one) for one in fields):
            return delimiter, False
    for delimiter in (";", "\t", None):  # where a comma is the decimal sign
        fields = _fields(first, delimiter)
        if "," in first and all(_is_number(one.replace(",", ".")) for one in fields):
            return delimiter, True
    names = head[-1] if head else first
    return max((",", ";", "\t"), key=names.count), False


def _names(path: Path, head: list[str], delimiter: str | None, count: int) -> list[str]:
    if not head:
        if not count:
            raise _nameless(path, "")
        return [str(column) for column in range(count)]
    if not head[-1].startswith(tuple(REMARKS)):  # a line of names
        names = [name.strip().strip('"') for name in _fields(head[-1], delimiter)]
        if len(set(names)) < len(names) or not all(names):
            raise _nameless(path, head[-1])
        return names
    return _header(head, delimiter, count) or [str(column) for column in range(count)]


def _header(head: list[str], delimiter: str | None, count: int) -> list[str] | None:
    """Find the names in the lines above the numbers: the last that has one for each column."""
    for line in reversed(head):
        text = line.lstrip(REMARKS).strip()
        if _RULE.fullmatch(text):
            continue
        names = [name.strip() for name in _fields(text, delimiter)]
        if len(names) == count and len(set(names)) == count and all(names):
            return names
    return None


def _fields(line: str, delimiter: str | None) -> list[str]:
    line = line.strip("\r\n") if delimiter == "\t" else line.strip()
    if not line:
        return []
    if delimiter is None:
        blanks = re.sub(r"\s+", " ", line)
        return next(csv.reader([blanks], delimiter=" "))
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
    except csv.Error:
        return line.split(delimiter)


def _is_row(line: str, delimiter: str | None) -> bool:
    fields = _fields(line, delimiter)
    return bool(fields) and all(
        _is_number(one.replace(",", ".")) or _is_complex(one) for one in fields
    )


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _is_complex(text: str) -> bool:
    try:
        _complex(text)
    except ValueError:
        return False
    return any(sign.isdigit() for sign in text)


def _complex(text: str) -> complex:
    plain = "".join(itertools.chain(text.split()))
    size, polar, angle = plain.partition("/")
    if polar:
        return cmath.rect(float(size), math.radians(float(angle)))
    return complex(plain[:-1] + "j" if plain.endswith("i") else plain)


def _nameless(path: Path, line: str) -> MeasurementError:
    return MeasurementError(
        f"{path}: the first line is {line[:80]!r}; it must name the columns, each once"
    )
