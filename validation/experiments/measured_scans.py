"""False mirrors and false targets in scans of scenes without walls.

Run as ``python -m validation.experiments.measured_scans [DRAWS] [FIRST]``: number of draws of each
kind (:mod:`validation.trials.measured_scans`), with a linear and a planar array, and first seed.

Not in the thesis. Claim that is asserted: no mirror has a confidence above 0.99, in scans without a
wall. Targets within 10 dB of the strongest and farther than three cells from all scatterers are
counted: this is printed, not asserted. Seeds below 1000 were used for tuning; judge on others.
"""

import sys

import numpy as np

from estimator.imaging.energy_region import cells_at
from estimator.localization.pipeline import locate
from estimator.results.estimate import Estimate
from validation.trials.measured_scans import KINDS, DrawnScan, drawn_scan

DRAWS = 30
FIRST = 1000
CERTAIN = 0.99
"""Confidence above which a mirror counts as false. [-]"""
FAINTEST_DB = -10.0
"""Least level of a counted false target, relative to the strongest target. [dB]"""
CELLS = 3.0
"""Distance from all scatterers above which a target is false. [cells]"""


def false_targets(scan: DrawnScan, estimate: Estimate) -> int:
    """Count the targets far from all scatterers."""
    if not estimate.targets or scan.measurement.echo is None:
        return 0
    strongest = max(target.level_db or -np.inf for target in estimate.targets)
    cells = cells_at(scan.measurement.echo, scan.scatterers)
    if not scan.planar:
        cells[:, 2] = np.inf
    count = 0
    for target in estimate.targets:
        apart = np.abs(target.position - scan.scatterers) / cells
        strong = (target.level_db or -np.inf) > strongest + FAINTEST_DB
        count += bool(strong and apart.max(axis=1).min() > CELLS)
    return count


def main(draws: int = DRAWS, first: int = FIRST) -> int:
    """Print the counts of each kind; return the number of false mirrors."""
    certain_all = 0
    print("kind        array   scans  certain mirrors  other mirrors  with target  false targets")
    for kind in KINDS:
        for planar in (False, True):
            certain = other = found = wrong = 0
            for seed in range(first, first + draws):
                rng = np.random.default_rng([seed, KINDS.index(kind), int(planar)])
                scan = drawn_scan(kind, rng, planar=planar)
                estimate = locate(scan.measurement, images=False)
                sure = sum(mirror.confidence > CERTAIN for mirror in estimate.mirrors)
                certain += sure > 0
                other += len(estimate.mirrors) > sure
                found += len(estimate.targets) > 0
                wrong += false_targets(scan, estimate) > 0
            certain_all += certain
            array = "plane" if planar else "line"
            row = f"{kind:<11} {array:<6} {draws:6d} {certain:16d} {other:14d}"
            print(f"{row} {found:12d} {wrong:14d}", flush=True)
    print(f"certain mirrors in {2 * len(KINDS) * draws} scans without a wall: {certain_all}")
    return certain_all


if __name__ == "__main__":
    sys.exit(min(main(*(int(argument) for argument in sys.argv[1:])), 1))
