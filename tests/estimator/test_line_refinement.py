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


@pytest.mark.parametrize("deviations", [0.5 * MOST_DEVIATIONS, 2.0 * MOST_DEVIATIONS])
def test_a_line_goes_where_the_echo_says_unless_that_contradicts_the_image(
    deviations: float, world: Any
) -> None:
    rng = np.random.default_rng(3)
    echo = world.echo(world.rough_line(MIDDLE, ANGLE, LENGTH, rng, rms=0.0), rng)
    looked = survey(echo)
    (line,) = detect_mirrors(echo, looked)
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
    (refined,) = refine_by_echo(echo, looked, (moved,))
    if deviations > MOST_DEVIATIONS:
        assert refined is moved
    else:
        # From 0.15 mm back to a tenth of that: the fit of a flat wall is good to 2 µm.
        assert abs((refined.middle - centre) @ normal) < 0.1 * ASIDE
