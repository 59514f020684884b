"""The simulator against full-wave solutions, stored ones and our own."""

from validation.claim import Claim, Effort, Finding, Row, Tell
from validation.full_wave_ghosts import LEAST_CORRELATION as GHOST_CORRELATION
from validation.full_wave_ghosts import MOST_LEVEL_DB as GHOST_LEVEL_DB
from validation.full_wave_ghosts import compare_ghosts
from validation.full_wave_reference import (
    LEAST_CORRELATION,
    MOST_LEVEL_DB,
    compare_with_full_wave,
)
from validation.reference import ROUGH_WALL, TWO_CYLINDERS

STORED = "2-D method of moments, TM, 0.15 mm rms, 1 mm correlation; checked to 4e-6"


def rough_wall(effort: Effort, tell: Tell) -> Finding:
    """Compare echo and pilots of a rough wall with a stored full-wave solution."""
    rows = []
    for one in compare_with_full_wave(ROUGH_WALL):
        name = one.name.replace("_", ", ")
        rows += [
            Row(
                name=f"{name}: complex correlation",
                stated=STORED,
                measured=one.correlation,
                low=LEAST_CORRELATION,
                origin="physical optics reaches 0.993 (echo) and 0.996 … 0.999 (pilots)",
            ),
            Row(
                name=f"{name}: level",
                stated=STORED,
                measured=one.level_db,
                unit="dB",
                low=-MOST_LEVEL_DB,
                high=MOST_LEVEL_DB,
                origin="physical optics is 1.1 dB (echo) and 0.5 dB (pilots) above full wave",
            ),
        ]
    tell(1, 1)
    return Finding(rows=rows)


def ghosts(effort: Effort, tell: Tell) -> Finding:
    """Compare the echo of two cylinders seen over the rough wall with full wave."""
    correlation, level = compare_ghosts(TWO_CYLINDERS, ROUGH_WALL)
    tell(1, 1)
    return Finding(
        rows=[
            Row(
                name="hidden cylinders' part of the echo: complex correlation",
                stated=STORED,
                measured=correlation,
                low=GHOST_CORRELATION,
                origin="physical optics twice reaches 0.985 on the whole reference",
            ),
            Row(
                name="hidden cylinders' part of the echo: level",
                stated=STORED,
                measured=level,
                unit="dB",
                low=-GHOST_LEVEL_DB,
                high=GHOST_LEVEL_DB,
                origin="0.6 dB below full wave on the whole reference",
            ),
        ]
    )


CLAIMS = (
    Claim(
        key="full_wave_wall",
        title="A rough wall's echo and pilots are those of full wave",
        source="the stored full-wave reference of the thesis' SLAM scene",
        measure=rough_wall,
    ),
    Claim(
        key="full_wave_ghosts",
        title="Ghosts of hidden cylinders, with their clouds, are those of full wave",
        source="the stored full-wave reference with two cylinders",
        measure=ghosts,
        minutes=0.5,
    ),
)
