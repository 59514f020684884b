"""Table of an experiment's figures with their limits; raises if one is outside."""

from collections.abc import Callable, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from validation.harness.claim import Row


def row_line(row: Row) -> str:
    """Return the line of one figure."""
    unit = f" {row.unit}" if row.unit else ""
    verdict = "holds" if row.passed else "FAILS"
    return f"{verdict}: {row.name}: {row.measured:.4g}{unit} ({row.stated}; {row.limits})"


def conclude(rows: Sequence[Row]) -> None:
    """Print all figures, and check them.

    Raises
    ------
    RuntimeError
        If one of them is outside its limits.
    """
    for row in rows:
        print(row_line(row))
    failed = [row for row in rows if not row.passed]
    if failed:
        raise RuntimeError(
            f"{len(failed)} of {len(rows)} claims fail: "
            + "; ".join(
                f"{row.name} ({row.measured:.4g} {row.unit}, {row.limits})" for row in failed
            )
        )


def conclude_with_figure(
    path: Path, size: tuple[float, float], draw: Callable[[Figure], None], rows: Sequence[Row]
) -> None:
    """Write an experiment's figure, then print and check its numbers.

    Parameters
    ----------
    path
        PNG file.
    size
        Width and height of the figure. [inch]
    draw
        Function that draws into the figure.
    rows
        See :func:`conclude`.
    """
    figure = plt.figure(figsize=size, layout="constrained")
    draw(figure)
    figure.savefig(path, dpi=150)
    print(f"written: {path}")
    conclude(rows)
