"""Tables of an estimate's mirrors and targets, for a terminal and a notebook."""

from collections.abc import Sequence
from math import degrees, sqrt

import numpy as np
from jaxtyping import Float

from estimator.results import estimate as plain
from mmslam.table import Table


def mirrors_table(mirrors: Sequence[plain.Mirror]) -> Table:
    """Return a row for each mirror: ends, deviations of angle and offset, mirrors before it."""
    rows = []
    for index, mirror in enumerate(mirrors):
        angle, offset = float(mirror.covariance[0, 0]), float(mirror.covariance[-1, -1])
        rows.append(
            (
                str(index),
                point(mirror.start),
                point(mirror.end),
                f"{degrees(sqrt(angle)):.4f}",
                f"{1e3 * sqrt(offset):.3f}",
                ", ".join(map(str, mirror.seen_through)),
            )
        )
    heads = ("mirror", "from [m]", "to [m]", "± [°]", "± [mm]", "seen through")
    return Table(heads=heads, rows=rows)


def targets_table(targets: Sequence[plain.Target]) -> Table:
    """Return a row for each target: position, ghost, level, mirrors before it."""
    rows = [
        (
            str(index),
            point(target.position),
            point(target.ghost),
            "" if target.level_db is None else f"{target.level_db:.1f}",
            ", ".join(map(str, target.seen_through)),
        )
        for index, target in enumerate(targets)
    ]
    heads = ("target", "position [m]", "image shows it at", "level [dB]", "seen through")
    return Table(heads=heads, rows=rows)


def point(place: Float[np.ndarray, " 3"]) -> str:
    """Write a point; in the plane z = 0, without its z."""
    shown = place[:2] if place[2] == 0 else place
    return "(" + ", ".join(f"{value:.4f}" for value in shown) + ")"
