"""The user's clock offset: a known one is corrected, an estimated one is reported."""

from dataclasses import replace

import numpy as np

from estimator.measurement.model import Measurement, Uplink
from estimator.results.estimate import UserEstimate


def on_our_clock(measurement: Measurement) -> tuple[Uplink, ...]:
    """Take a known offset of the user's clock out of its pilot.

    A clock that is ahead by δ sends early: the pilot's delay appears δ too short.
    """
    offset = measurement.clock_offset or 0.0
    return tuple(
        replace(
            uplink,
            samples=uplink.samples * np.exp(-2j * np.pi * uplink.frequencies * offset),
        )
        for uplink in measurement.uplinks
    )


def clock_note(found: UserEstimate) -> list[str]:
    """Say what a user's unknown clock was found to be off by."""
    if found.clock_offset is None or found.clock_deviation is None or found.status != "found":
        return []
    paths = sum(path.used for path in found.paths)
    return [
        f"the clock offset of {found.name!r} is unknown; its {paths} paths give "
        f"{1e9 * found.clock_offset:.4f} ± {1e9 * found.clock_deviation:.4f} ns"
    ]
