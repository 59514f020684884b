"""Runs claims one after the other, and stores each result, so that a run can be resumed."""

import hashlib
import json
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from simulator.dataset.provenance import code_digest, package_versions
from validation.harness.claim import Claim, Effort, Finding, Row, Tell

OUR_PACKAGES = ("scenes", "simulator", "estimator", "validation")


@dataclass(frozen=True, kw_only=True)
class ClaimRun:
    """A claim's figures, measured now or reused from an earlier run of the same code."""

    claim: Claim
    rows: tuple[Row, ...]
    remarks: tuple[str, ...]
    seconds: float
    picture: str | None  # file name in the run's folder
    problem: str | None = None  # error message, if it raised
    kept: bool = False  # reused from an earlier run

    @property
    def passed(self) -> bool:
        """Whether all figures are within their limits."""
        return self.problem is None and all(row.passed for row in self.rows)


def claims_digest() -> str:
    """Return a digest of all that figures depend on: sources, scenes, versions of libraries."""
    ours = code_digest(OUR_PACKAGES, (".py", ".toml", ".ply", ".npz"))
    return hashlib.sha256(f"{ours} {package_versions()}".encode()).hexdigest()[:16]


def run_claims(
    claims: Sequence[Claim],
    *,
    effort: Effort,
    folder: Path,
    fresh: bool = False,
    told: Callable[[Claim], Tell] = lambda claim: lambda done, count: None,
) -> Iterator[ClaimRun]:
    """Measure claims; each one's figures are on the disk before the next begins.

    Parameters
    ----------
    claims
        The claims, in order.
    effort
        Quick forms have fewer seeds and points, but the same limits.
    folder
        Where ``KEY.json`` and ``KEY.png`` of each claim are written, atomically.
    fresh
        Whether existing figures are measured again. Those of other code or of the other effort
        always are.
    told
        Returns the progress function of a claim.

    Yields
    ------
    Each claim's figures when measured. A claim that raises has failed; the others continue.
    """
    folder.mkdir(parents=True, exist_ok=True)
    digest = claims_digest()
    for claim in claims:
        kept = None if fresh else _kept(claim, folder, digest, effort)
        if kept is not None:
            yield kept
            continue
        started = time.perf_counter()
        rows: tuple[Row, ...] = ()
        remarks: tuple[str, ...] = ()
        picture = problem = None
        try:
            finding = claim.measure(effort, told(claim))
            rows, remarks = tuple(finding.rows), tuple(finding.remarks)
            picture = _drawn(claim, finding, folder)
        except Exception as error:
            # If only the drawing failed, the figures are kept.
            problem = f"{type(error).__name__}: {error}"
        run = ClaimRun(
            claim=claim,
            rows=rows,
            remarks=remarks,
            seconds=time.perf_counter() - started,
            picture=picture,
            problem=problem,
        )
        if problem is None:
            write_aside(folder / f"{claim.key}.json", _text(run, digest, effort))
        yield run


def run_document(run: ClaimRun) -> dict[str, Any]:
    """Return a claim's figures as plain JSON; infinite values and NaN become null."""
    rows = [asdict(row) | {"passed": row.passed} for row in run.rows]
    for row in rows:
        if row["measured"] != row["measured"] or abs(row["measured"]) == float("inf"):
            row["measured"] = None
    return {
        "key": run.claim.key,
        "title": run.claim.title,
        "source": run.claim.source,
        "passed": run.passed,
        "problem": run.problem,
        "remarks": list(run.remarks),
        "picture": run.picture,
        "rows": rows,
    }


def rows_of(document: Mapping[str, Any]) -> tuple[Row, ...]:
    """Read the rows of a document of :func:`run_document`."""
    rows = []
    for row in document["rows"]:
        values = {key: value for key, value in row.items() if key != "passed"}
        if values["measured"] is None:
            values["measured"] = float("nan")
        rows.append(Row(**values))
    return tuple(rows)


def write_aside(path: Path, content: str | bytes) -> None:
    """Write a temporary file, then rename it, so that it is complete or absent."""
    aside = path.with_name(f".{path.name}.partial")
    aside.write_bytes(content.encode() if isinstance(content, str) else content)
    os.replace(aside, path)


def _text(run: ClaimRun, digest: str, effort: Effort) -> str:
    document = {"digest": digest, "effort": effort, "seconds": run.seconds, **run_document(run)}
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


def _kept(claim: Claim, folder: Path, digest: str, effort: Effort) -> ClaimRun | None:
    try:
        found = json.loads((folder / f"{claim.key}.json").read_text(encoding="utf-8"))
        if (found["digest"], found["effort"]) != (digest, effort):
            return None
        if found["picture"] is not None and not (folder / found["picture"]).is_file():
            return None
        return ClaimRun(
            claim=claim,
            rows=rows_of(found),
            remarks=tuple(found["remarks"]),
            seconds=float(found["seconds"]),
            picture=found["picture"],
            kept=True,
        )
    except (OSError, ValueError, KeyError, TypeError):
        return None  # absent, or not readable: measure again


def _drawn(claim: Claim, finding: Finding, folder: Path) -> str | None:
    if finding.draw is None:
        return None
    figure = Figure(figsize=(12, 7), layout="constrained")
    finding.draw(figure)
    name = f"{claim.key}.png"
    aside = folder / f".{claim.key}.partial.png"
    figure.savefig(aside, dpi=90, metadata={"Software": None})
    os.replace(aside, folder / name)
    return name
