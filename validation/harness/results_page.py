"""The page of results in the documentation, generated from runs of the claims.

A folder of the documentation keeps the figures of the last full and the last quick run
(``full.json``, ``quick.json``), and the page and its pictures made from them. Continuous
integration repeats the quick ones and compares: it fails if a stated figure has changed.
"""

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from validation.harness.claim import Effort, Row
from validation.harness.claim_runs import rows_of, write_aside

PAGE = "index.md"
FORMS: tuple[Effort, ...] = ("quick", "full")
"""Forms of claims; the page shows the last one that was measured."""

HEAD = """# Results

What `mmslam validate` measured: each claim with what the thesis or the theory says, our figure,
its limit, and where that comes from. The command makes this page (`--record docs/results`).
Continuous integration measures the quick forms again and fails if one of their figures, kept in
`quick.json` beside this page, no longer holds.
"""

DRIFT = 0.05
"""Largest change of a figure, relative to the larger of itself and its limits: other processors
round differently, and a figure far below its limit may consist of rounding only. [-]"""

Document = Mapping[str, Any]


def record_results(document: Document, folder: Path, run_folder: Path) -> None:
    """Store a run's figures and pictures, and generate the page.

    Parameters
    ----------
    document
        Of a run of all claims.
    folder
        In the documentation; it may hold the other form's run.
    run_folder
        With the run's pictures.
    """
    folder.mkdir(parents=True, exist_ok=True)
    effort = document["effort"]
    for claim in document["claims"]:
        if claim["picture"] is not None:
            copy = folder / f".{claim['picture']}.partial"
            shutil.copyfile(run_folder / claim["picture"], copy)
            copy.replace(folder / f"{effort}_{claim['picture']}")
    write_aside(folder / f"{effort}.json", to_text(document))
    page = recorded_page(folder)
    write_aside(folder / PAGE, page)
    for form in FORMS:
        for picture in folder.glob(f"{form}_*.png"):
            if f"({picture.name})" not in page:
                picture.unlink()


def recorded_page(folder: Path) -> str:
    """Generate the page from the stored runs: the full form of each claim if there is one."""
    kept = {effort: read_record(folder, effort) for effort in FORMS}
    chosen: dict[str, tuple[Effort, Mapping[str, Any]]] = {}
    for effort in FORMS:
        for claim in (kept[effort] or {"claims": []})["claims"]:
            chosen[claim["key"]] = (effort, claim)
    parts = [HEAD, _sources(kept), _count([claim for _, claim in chosen.values()])]
    parts += [_section(claim, effort) for effort, claim in chosen.values()]
    return "\n".join(parts)


def read_record(folder: Path, effort: str) -> Document | None:
    """Read the stored figures of a form, None if there are none."""
    file = folder / f"{effort}.json"
    if not file.is_file():
        return None
    found: Document = json.loads(file.read_text(encoding="utf-8"))
    return found


def drifted(now: Document, stated: Document) -> list[str]:
    """Return a line for each stated figure that has changed.

    A stated figure that was not measured counts as changed, unless its claim was not run.
    """
    found = []
    measured = {claim["key"]: {row.name: row for row in rows_of(claim)} for claim in now["claims"]}
    for claim in stated["claims"]:
        if claim["key"] not in measured:
            continue
        for row in rows_of(claim):
            again = measured[claim["key"]].get(row.name)
            what = f"{claim['key']}, {row.name}"
            if again is None:
                found.append(f"{what}: stated as {row.value}, not measured now")
            elif not _same(row, again):
                found.append(f"{what}: stated as {row.value}, measured {again.value}")
    return found


def to_text(document: Document) -> str:
    """Write a document as JSON."""
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


def _same(stated: Row, again: Row) -> bool:
    limits = [abs(limit) for limit in (stated.low, stated.high) if limit is not None]
    scale = max([abs(stated.measured), *limits])
    return abs(again.measured - stated.measured) <= DRIFT * scale


def _sources(kept: Mapping[Effort, Document | None]) -> str:
    """Return the sources' versions of both forms, also if they differ."""
    codes = {effort: document["code"] for effort, document in kept.items() if document is not None}
    told = ", ".join(f"{effort} forms by sources `{code}`" for effort, code in codes.items())
    if len(set(codes.values())) > 1:
        told += ", which differ: one form was recorded later than the other"
    return f"Measured: {told} (a digest of ours and of the libraries' versions).\n"


def _count(claims: list[Mapping[str, Any]]) -> str:
    rows = [row for claim in claims for row in rows_of(claim)]
    within = sum(row.passed for row in rows)
    return f"{within} of {len(rows)} figures of {len(claims)} claims are within their limits.\n"


def _section(claim: Mapping[str, Any], effort: str) -> str:
    form = "" if effort == "full" else " Quick form."
    lines = [f"## {claim['title']}", "", f"`{claim['key']}`: {claim['source']}.{form}", ""]
    if claim["problem"] is not None:
        lines += [f"Could not be measured: {claim['problem']}", ""]
    rows = rows_of(claim)
    if rows:
        lines.append("| figure | stated | measured | limit | where the limit comes from | |")
        lines.append("|---|---|---|---|---|---|")
    for row in rows:
        verdict = "pass" if row.passed else "**fails**"
        cells = (row.name, row.stated, row.value, row.limits, row.origin, verdict)
        lines.append("| " + " | ".join(_cell(text) for text in cells) + " |")
    lines.append("")
    for remark in claim["remarks"]:
        lines += [remark, ""]
    if claim["picture"] is not None:
        lines += [f"![{claim['title']}]({effort}_{claim['picture']})", ""]
    return "\n".join(lines)


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
