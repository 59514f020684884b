"""Lines of the image that the whole echo refines, and one that it contradicts."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from estimator.geometry.wall_2d import unit_normal
from estimator.imaging.survey_2d import survey
from estimator.walls.fitted_line import FittedLine
from estimator.walls.line_refinement import MOST_DEVIATIONS, refine_by_echo
from estimator.walls.wall_detection_2d import detect_mirrors

MIDDLE, ANGLE, LENGTH = (0.0, 0.28), 25.0, 0.18
ASIDE = 0.15e-3  # much less than a cell of 2 to 3 mm [m]


CENTRE = np.array([*MIDDLE, 0.0])
NORMAL = unit_normal(
    CENTRE, CENTRE + np.array([np.cos(np.radians(ANGLE)), np.sin(np.radians(ANGLE)), 0.0])
)


def beside(line: FittedLine, deviations: float) -> FittedLine:
    """Return a line beside the true one, by so many of the deviations that it states."""
    aside = (ASIDE - (line.middle - CENTRE) @ NORMAL) * NORMAL
    return replace(
        line,
        start=line.start + aside,
        end=line.end + aside,
        covariance=np.diag([np.radians(1.0) ** 2, (ASIDE / deviations) ** 2]),
    )


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
    moved = beside(line, deviations)
    (refined,) = refine_by_echo(echo, survey(echo), (moved,))
    if goes:
        # From 0.15 mm back to a small part of that, even among what is as bright as the wall.
        limit = 0.5 if clutter else 0.1
        assert abs((refined.middle - CENTRE) @ NORMAL) < limit * ASIDE
    else:
        assert refined is moved


def test_where_image_and_echo_disagree_the_line_is_known_less(world: Any) -> None:
    rng = np.random.default_rng(3)
    echo = world.echo(world.rough_line(MIDDLE, ANGLE, LENGTH, rng, rms=0.0), rng)
    looked = survey(echo)
    (line,) = detect_mirrors(echo, looked)
    (agreed,) = refine_by_echo(echo, looked, (beside(line, 1.0),))
    (disputed,) = refine_by_echo(echo, looked, (beside(line, 12.0),))
    np.testing.assert_allclose(disputed.start, agreed.start, atol=1e-12)
    # Variances grow by the square of the difference over both variances, for each of two unknowns.
    excess = ASIDE**2 / ((ASIDE / 12) ** 2 + agreed.covariance[1, 1]) / 2
    np.testing.assert_allclose(disputed.covariance, excess * agreed.covariance, rtol=0.1)
