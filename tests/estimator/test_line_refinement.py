"""Lines of the image that the whole echo refines, and one that it contradicts."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from estimator.line_refinement import MOST_DEVIATIONS, refine_by_echo
from estimator.mirror_fit import FittedLine
from estimator.mirrors import detect_mirrors, survey
from estimator.projection import unit_normal

MIDDLE, ANGLE, LENGTH = (0.0, 0.28), 25.0, 0.18
ASIDE = 0.15e-3  # much less than a cell of 2 to 3 mm [m]


@pytest.mark.parametrize(
    ("deviations", "clutter", "goes"),
    [
        (0.5 * MOST_DEVIATIONS, False, True),
        (0.5 * MOST_DEVIATIONS, True, True),
        (2.0 * MOST_DEVIATIONS, False, True),
        (2.0 * MOST_DEVIATIONS, True, False),
    ],
)
def test_a_line_goes_where_the_echo_says_unless_that_contradicts_the_image(
    deviations: float, clutter: bool, goes: bool, world: Any
) -> None:
    rng = np.random.default_rng(3)
    echo = world.echo(world.rough_line(MIDDLE, ANGLE, LENGTH, rng, rms=0.0), rng)
    (line,) = detect_mirrors(echo, survey(echo))
    if clutter:  # as bright as the wall together, strewn over its ranges
        strewn = np.column_stack([rng.uniform([-0.1, 0.2], [0.1, 0.34], (1000, 2)), np.zeros(1000)])
        echo = replace(echo, samples=echo.samples + world.echo(strewn, rng).samples)
    along = np.array([np.cos(np.radians(ANGLE)), np.sin(np.radians(ANGLE)), 0.0])
    centre = np.array([*MIDDLE, 0.0])
    normal = unit_normal(centre, centre + along)
    aside = ASIDE - (line.middle - centre) @ normal
    moved: FittedLine = replace(
        line,
        start=line.start + aside * normal,
        end=line.end + aside * normal,
        covariance=np.diag([np.radians(1.0) ** 2, (ASIDE / deviations) ** 2]),
    )
    (refined,) = refine_by_echo(echo, survey(echo), (moved,))
    if goes:
        # From 0.15 mm back to a small part of that, even among what is as bright as the wall.
        limit = 0.5 if clutter else 0.1
        assert abs((refined.middle - centre) @ normal) < limit * ASIDE
    else:
        assert refined is moved
