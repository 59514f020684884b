"""Short tables: aligned text for a terminal, HTML for a notebook."""

import html as _html
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from mmslam.plain_text import visible


@dataclass(frozen=True, kw_only=True)
class Table:
    """Rows of text below a title and, if there are any, column heads.

    Examples
    --------
    >>> print(text([Table(title="walls", heads=("wall", "length"), rows=(("0", "0.40 m"),))]))
    walls
    wall  length
    0     0.40 m
    """

    rows: Sequence[Sequence[str]]
    heads: Sequence[str] = ()
    title: str = ""


def text(tables: Iterable[Table]) -> str:
    """Write tables as lines of aligned columns, one below the other."""
    lines: list[str] = []
    for table in tables:
        if not table.rows and not table.title:
            continue
        lines += [visible(table.title)] if table.title else []
        shown = [*([table.heads] if table.heads and table.rows else []), *table.rows]
        body = [[visible(cell) for cell in row] for row in shown]
        widths = [max(map(len, column)) for column in zip(*body, strict=True)]
        for row in body:
            cells = [cell.ljust(width) for cell, width in zip(row, widths, strict=True)]
            lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)


def html(tables: Iterable[Table], *, picture: str = "") -> str:
    """Write tables as HTML.

    Parameters
    ----------
    tables
        One below the other.
    picture
        A PNG in base64 that stands above them; "": none does.
    """
    parts = ["<div>"]
    if picture:
        parts.append(f'<img src="data:image/png;base64,{picture}" alt="plan of what was found">')
    for table in tables:
        if not table.rows and not table.title:
            continue
        parts.append("<table>")
        if table.title:
            parts.append(f"<caption>{_html.escape(visible(table.title))}</caption>")
        if table.heads and table.rows:
            parts.append(_row(table.heads, "th"))
        parts += [_row(row, "td") for row in table.rows]
        parts.append("</table>")
    return "".join([*parts, "</div>"])


def _row(cells: Sequence[str], tag: str) -> str:
    inside = "".join(
        f'<{tag} style="text-align:left">{_html.escape(visible(cell))}</{tag}>' for cell in cells
    )
    return f"<tr>{inside}</tr>"
