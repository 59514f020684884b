"""Tables of measured permittivity, read from a file and checked before anything is simulated."""

import csv
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Complex, Float

from scenes.schema.errors import ScenarioError

COLUMNS = ("frequency_ghz", "eps_real", "eps_imag")
"""First line of a table; the last column is ε'', positive for a loss."""

LARGEST_FILE = 10 * 2**20
"""Largest table that is read [byte]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PermittivityTable:
    """A permittivity over frequency."""

    frequencies: Float[np.ndarray, " entries"]  # increasing [Hz]
    values: Complex[np.ndarray, " entries"]  # ε' - jε'' [-]


def read_permittivity_table(path: Path) -> PermittivityTable:
    """Read a CSV table with the columns ``frequency_ghz,eps_real,eps_imag``.

    Raises
    ------
    ScenarioError
        If the file, a column or a number cannot be read, or the numbers are no permittivity of
        a passive material over frequency.
    """
    try:
        if not path.is_file():
            path.stat()  # says so if there is nothing
            raise ScenarioError(f"{path}: not a file; give the path of a CSV table")
        if path.stat().st_size > LARGEST_FILE:
            raise ScenarioError(
                f"{path}: {path.stat().st_size} bytes are more than a table's {LARGEST_FILE}; "
                "is it another file?"
            )
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = _rows(path, file)
    except (OSError, ValueError, csv.Error) as error:
        if isinstance(error, ScenarioError):
            raise
        raise ScenarioError(
            f"{path}: cannot be read as a CSV table ({error}); give the path of one that begins "
            f"with the line {','.join(COLUMNS)}"
        ) from error
    table = np.array(rows, dtype=np.float64).reshape(-1, 3)
    made = PermittivityTable(frequencies=table[:, 0] * 1e9, values=table[:, 1] - 1j * table[:, 2])
    if problem := table_problem(made.frequencies, made.values):
        raise ScenarioError(f"{path}: {problem}")
    return made


def _rows(path: Path, lines: Iterable[str]) -> list[list[float]]:
    reader = csv.DictReader(lines, skipinitialspace=True)
    missing = [name for name in COLUMNS if name not in (reader.fieldnames or ())]
    if missing:
        raise ScenarioError(
            f"{path}: the first line lacks {', '.join(missing)}; it must be {','.join(COLUMNS)}"
        )
    rows = []
    for row in reader:
        try:
            rows.append([float(row[name]) for name in COLUMNS])
        except (TypeError, ValueError):
            raise ScenarioError(
                f"{path}, line {reader.line_num}: not three numbers; write {','.join(COLUMNS)} in "
                "each line"
            ) from None
    return rows


def table_problem(
    frequencies: Float[np.ndarray, " entries"], values: Complex[np.ndarray, " entries"]
) -> str | None:
    """Say what is wrong with a permittivity over frequency, if anything is."""
    rising = np.all(np.diff(frequencies) > 0) and np.all(frequencies > 0)
    if frequencies.size < 2 or not rising or not np.isfinite(frequencies).all():
        return (
            f"{frequencies.size} frequencies; a table needs at least two, positive and "
            "increasing: sort the rows and keep one of each"
        )
    return value_problem(values)


def value_problem(values: Complex[np.ndarray, " entries"]) -> str | None:
    """Name the first value that is no permittivity of a passive dielectric, if there is one."""
    wrong = ~(np.isfinite(values) & (values.real >= 1.0) & (values.imag <= 0.0))
    if not np.any(wrong):
        return None
    value = values[np.argmax(wrong)]
    return (
        f"{value.real:g} - {0.0 - value.imag:g}j is no permittivity of a passive dielectric; the "
        "real part must be at least 1 and the loss at least 0"
    )


def band_problem(
    frequencies: Float[np.ndarray, " freqs"], lowest: float, highest: float
) -> str | None:
    """Say how a radio's band leaves that of a material, if it does."""
    # One part in 1e9 forgives the rounding of GHz to Hz.
    if frequencies.min() >= lowest * (1 - 1e-9) and frequencies.max() <= highest * (1 + 1e-9):
        return None
    return (
        f"covers {lowest / 1e9:g}-{highest / 1e9:g} GHz, but the radio uses "
        f"{frequencies.min() / 1e9:g}-{frequencies.max() / 1e9:g} GHz; "
        "narrow the band or give a wider table"
    )
