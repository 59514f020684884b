"""Prints what an experiment measured beside its limits, and refuses what falls outside."""

from collections.abc import Sequence

from validation.claim import Row


def row_line(row: Row) -> str:
    """Describe one figure in a line."""
    unit = f" {row.unit}" if row.unit else ""
    verdict = "holds" if row.passed else "FAILS"
    return f"{verdict}: {row.name}: {row.measured:.4g}{unit} ({row.stated}; {row.limits})"


def conclude(rows: Sequence[Row]) -> None:
    """Print all figures.

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
