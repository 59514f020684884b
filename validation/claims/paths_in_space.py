"""Paths in space over several surfaces: each beside a closed form or a sum by brute force."""

from validation.experiments.paths_in_space import compared_paths
from validation.harness.claim import Claim, Effort, Finding, Tell


def beside_their_truths(effort: Effort, tell: Tell) -> Finding:
    """Simulate what used to be missing, or too strong."""
    rows = []
    for one in compared_paths(quick=effort == "quick"):
        rows.append(one.row())
        tell(len(rows), len(rows) + 1)
    tell(len(rows), len(rows))
    return Finding(rows=rows)


CLAIMS = (
    Claim(
        key="paths_in_space",
        title="Corners, tilted plates and bodies over walls echo as their truths say",
        source="E. F. Knott, J. F. Shaeffer, M. T. Tuley, Radar Cross Section, 1993",
        measure=beside_their_truths,
        minutes=3.0,
    ),
)
