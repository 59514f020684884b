"""Checking every claim: the table, the figures, and the page of results."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from mmslam.output import OutputError, reserved
from mmslam.terminal.interruption import ResumableInterruption
from mmslam.terminal.stage_progress import StageProgress
from validation.claims import ALL_CLAIMS
from validation.harness.claim import Claim, Effort, Tell
from validation.harness.claim_runs import (
    ClaimRun,
    claims_digest,
    run_claims,
    run_document,
    write_aside,
)
from validation.harness.results_page import drifted, read_record, record_results, to_text

SUMMARY = "claims.json"
_WIDTH = 150  # of the table where there is no terminal, in characters


def chosen_claims(only: Sequence[str], *, quick: bool) -> tuple[Claim, ...]:
    """Choose claims by their keys; without keys, all, or all that have a quick form.

    Raises
    ------
    OutputError
        If there is no such claim.
    """
    known = {claim.key: claim for claim in ALL_CLAIMS}
    for key in only:
        if key not in known:
            raise OutputError(f"--only {key}: no such claim; known: {', '.join(known)}")
        if quick and not known[key].quick:
            raise OutputError(f"--only {key}: it has no quick form; leave --quick out")
    picked = [claim for claim in ALL_CLAIMS if claim.key in only] if only else list(ALL_CLAIMS)
    return tuple(claim for claim in picked if claim.quick or not quick)


def check_claims(
    only: Sequence[str], *, quick: bool, folder: Path, fresh: bool, shown: Callable[[Any], None]
) -> Mapping[str, Any]:
    """Measure claims, show each when it is done, and write everything to a folder.

    Parameters
    ----------
    only
        Keys of claims; empty: all.
    quick
        Whether the quick form of each claim is measured.
    folder
        Where each claim's numbers and figure and ``claims.json`` are written. Results of an
        earlier run of the same code are reused, so that an interrupted run resumes.
    fresh
        Whether all are measured again instead.
    shown
        Called with each table or text to be printed.

    Returns
    -------
    The document for JSON.

    Raises
    ------
    OutputError
        If there is no such claim, or the folder holds something else.
    ResumableInterruption
        On Ctrl-C; the message says how to resume.
    """
    claims, effort = chosen_claims(only, quick=quick), _effort(quick)
    _refuse_foreign(folder)
    with reserved(folder):
        return _checked(claims, effort, folder, fresh=fresh, shown=shown)


def _checked(
    claims: Sequence[Claim],
    effort: Effort,
    folder: Path,
    *,
    fresh: bool,
    shown: Callable[[Any], None],
) -> Mapping[str, Any]:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / SUMMARY).touch()
    runs = []
    with StageProgress() as progress:

        def told(claim: Claim) -> Tell:
            return lambda done, count: progress(claim.key, done, count)

        try:
            for run in run_claims(claims, effort=effort, folder=folder, fresh=fresh, told=told):
                runs.append(run)
                shown(claim_table(run))
        except KeyboardInterrupt:
            raise ResumableInterruption(
                f"interrupted; {len(runs)} of {len(claims)} claims are kept in {folder}: the same "
                "command goes on"
            ) from None
    document = {
        "effort": effort,
        "code": claims_digest(),
        "passed": all(run.passed for run in runs),
        "claims": [run_document(run) for run in runs],
    }
    write_aside(folder / SUMMARY, to_text(document))
    return document


def refuse_impossible(
    only: Sequence[str], *, quick: bool, record: Path | None, against: Path | None
) -> None:
    """Refuse, before any measurement, options whose results cannot be recorded or compared.

    Raises
    ------
    OutputError
        If only some claims are chosen but all are to be recorded, or no recorded results exist to
        compare with.
    """
    effort = _effort(quick)
    if record is not None and only:
        raise OutputError(
            f"--record {record}: keeps all claims, and --only {only[0]} leaves others out; leave "
            "--only out"
        )
    if against is not None and read_record(against, effort) is None:
        raise OutputError(
            f"--against {against}: no {effort}.json there; make it with --record {against}"
        )


def record_run(document: Mapping[str, Any], folder: Path, run_folder: Path) -> None:
    """Record the results of all claims in the documentation.

    Raises
    ------
    OutputError
        If a claim could not be measured.
    """
    missing = [claim["key"] for claim in document["claims"] if claim["problem"] is not None]
    if missing:
        raise OutputError(
            f"--record {folder}: {', '.join(missing)} could not be measured; nothing was kept"
        )
    record_results(document, folder, run_folder)


def drift(document: Mapping[str, Any], folder: Path) -> list[str]:
    """Compare a run with the recorded results; return a line for each figure that differs."""
    return drifted(document, read_record(folder, document["effort"]) or {"claims": []})


def claim_table(run: ClaimRun) -> Table:
    """Lay out a claim's figures beside what is stated and the limits."""
    verdict = "pass" if run.passed else "FAIL"
    seconds = "kept" if run.kept else f"{run.seconds:.1f} s"
    table = Table(
        title=Text(f"{verdict}  {run.claim.title}  [{run.claim.key}, {seconds}]"),
        title_justify="left",
        title_style="bold green" if run.passed else "bold red",
        caption=Text("\n".join([*_problem(run), *run.remarks])),
        caption_justify="left",
        show_lines=False,
        expand=True,
    )
    for heading, ratio in (("figure", 4), ("measured", 2), ("limit", 2), ("stated", 3)):
        table.add_column(heading, ratio=ratio, overflow="fold")
    table.add_column("where the limit comes from", ratio=5, overflow="fold")
    table.add_column("", width=4)
    for row in run.rows:
        table.add_row(
            Text(row.name),
            Text(row.value),
            Text(row.limits),
            Text(row.stated),
            Text(row.origin),
            Text("pass" if row.passed else "FAIL", style="green" if row.passed else "bold red"),
        )
    return table


def summary_line(document: Mapping[str, Any]) -> str:
    """Count what passed and what did not."""
    claims = document["claims"]
    rows = [row for claim in claims for row in claim["rows"]]
    failed = [claim["key"] for claim in claims if not claim["passed"]]
    text = f"{sum(row['passed'] for row in rows)} of {len(rows)} figures within their limits"
    return f"{text}; failed: {', '.join(failed)}" if failed else f"{text}; no claim failed"


@contextmanager
def console_on_stdout() -> Iterator[Console]:
    """Yield a console on the present stdout, even if stdout is redirected in the block."""
    with os.fdopen(os.dup(1), "w", encoding="utf-8") as stream:
        width = None if stream.isatty() else _WIDTH
        yield Console(file=stream, highlight=False, width=width)


def _problem(run: ClaimRun) -> list[str]:
    return [] if run.problem is None else [f"could not be measured: {run.problem}"]


def _effort(quick: bool) -> Effort:
    return "quick" if quick else "full"


def _refuse_foreign(folder: Path) -> None:
    if folder.is_file():
        raise OutputError(f"--out {folder}: is a file; give a folder")
    if folder.is_dir() and any(folder.iterdir()) and not (folder / SUMMARY).is_file():
        raise OutputError(
            f"--out {folder}: holds files that `mmslam validate` did not write; give another "
            "folder, or empty it"
        )
