"""The fit of one line below the cell, on images that are written in closed form."""

from typing import Any

import numpy as np
import pytest
from jaxtyping import Complex, Float

from estimator.array.resolution_cell import Resolution
from estimator.imaging.backprojection import focus, prepare
from estimator.imaging.range_compression import range_profiles
from estimator.walls.fitted_line import FittedLine
from estimator.walls.line_fit_image import fit_line

RESOLUTION = Resolution(along_ray=2e-3, across_ray=1e-2)
REACH = (0.05, 2.0)
TRUE_START, TRUE_END = np.array([-0.1, 0.5, 0.0]), np.array([0.1, 0.56, 0.0])


def stripe(*, level: float = 1.0, background: float = 1e-3, width: float = 2e-3) -> Any:
    """An image that is bright along the true segment, smooth across it, dark elsewhere."""
    along = (TRUE_END - TRUE_START) / np.linalg.norm(TRUE_END - TRUE_START)
    normal = np.array([along[1], -along[0], 0.0])
    length = float(np.linalg.norm(TRUE_END - TRUE_START))

    def image(points: Float[np.ndarray, "*grid 3"]) -> Complex[np.ndarray, "*grid"]:
        beside = (points - TRUE_START) @ normal
        place = (points - TRUE_START) @ along
        inside = (place >= 0) & (place <= length)
        bright = np.sqrt(level) * np.exp(-((beside / width) ** 2)) * inside
        return np.asarray(bright + np.sqrt(background) + 0j)

    return image


def fitted(start: list[float], end: list[float], image: Any) -> FittedLine | None:
    return fit_line(
        image, image, np.array(start), np.array(end), RESOLUTION, reach=REACH, trials=10_000
    )


@pytest.mark.parametrize(
    ("start", "end"),
    [
        pytest.param([-0.1, 0.501, 0.0], [0.1, 0.561, 0.0], id="beside"),
        pytest.param([-0.08, 0.5075, 0.0], [0.08, 0.5525, 0.0], id="tilted"),
        pytest.param([0.0, 0.53, 0.0], [0.09, 0.557, 0.0], id="half of it"),
        pytest.param([0.1, 0.56, 0.0], [-0.1, 0.5, 0.0], id="other way round"),
    ],
)
def test_a_smooth_stripe_is_found_from_any_guess_within_a_cell(
    start: list[float], end: list[float]
) -> None:
    line = fitted(start, end, stripe())
    assert line is not None
    true = (TRUE_END - TRUE_START) / np.linalg.norm(TRUE_END - TRUE_START)
    # Symmetric about the line and without speckle: the summit is exact up to rounding, but the
    # clipped neighbourhood is a tenth of a cell over its length.
    assert abs(line.direction[0] * true[1] - line.direction[1] * true[0]) <= 1e-5
    normal = np.array([true[1], -true[0], 0.0])
    assert abs((line.middle - TRUE_START) @ normal) <= 1e-6
    found = sorted([line.start.tolist(), line.end.tolist()])
    # Sampled twice for each cell of 2 to 3 mm.
    np.testing.assert_allclose(found, [TRUE_START.tolist(), TRUE_END.tolist()], atol=3e-3)
    assert line.confidence == pytest.approx(1.0)
    # The wall is the mean intensity along it, over the plain background beside.
    assert line.level == pytest.approx((1 + np.sqrt(1e-3)) ** 2, rel=1e-3)
    assert line.background == pytest.approx(1e-3 / np.log(2), rel=1e-2)
    assert line.length == pytest.approx(np.linalg.norm(TRUE_END - TRUE_START), abs=6e-3)


def test_no_line_is_found_where_nothing_stands_out() -> None:
    flat = stripe(level=0.0)
    assert fitted([-0.1, 0.5, 0.0], [0.1, 0.56, 0.0], flat) is None


def test_speckle_of_the_background_alone_is_no_confident_line(world: Any) -> None:
    rng = np.random.default_rng(3)
    echo = world.echo(np.array([[0.0, 0.3, 0.0]]), rng, snr_db=-60.0)
    ready = prepare(range_profiles(echo))
    line = fit_line(
        lambda points: focus(ready, points),
        lambda points: focus(ready, points),
        np.array([-0.08, 0.28, 0.0]),
        np.array([0.08, 0.32, 0.0]),
        Resolution(along_ray=2e-3, across_ray=1.2e-2),
        reach=(0.02, 0.45),
        trials=30_000,
    )
    assert line is None or line.confidence < 0.999


def test_what_lies_out_of_reach_is_not_followed() -> None:
    line = fit_line(
        stripe(), stripe(), np.array([-0.1, 0.5, 0.0]), np.array([0.05, 0.545, 0.0]), RESOLUTION,
        reach=(0.05, 0.545), trials=10_000,
    )  # fmt: skip
    assert line is not None
    farthest = max(np.linalg.norm(line.start), np.linalg.norm(line.end))
    # The ends are of points within reach; only the last summit may move them, by half a cell.
    assert farthest <= 0.545 + 2e-3
    assert line.length < 0.9 * np.linalg.norm(TRUE_END - TRUE_START)


def test_the_covariance_shrinks_with_the_length_of_the_wall(world: Any) -> None:
    # Of n independent blocks: offset 1/√n, angle 1/(length·√n). Means over six walls each.
    deviations = []
    for length in (0.1, 0.2):
        some = []
        for seed in range(6):
            rng = np.random.default_rng(seed)
            echo = world.echo(world.rough_line((0.0, 0.3), 20.0, length, rng, count=400), rng)
            ready = prepare(range_profiles(echo))
            half = length / 2 * np.array([np.cos(np.radians(20)), np.sin(np.radians(20)), 0.0])
            line = fit_line(
                lambda points, ready=ready: focus(ready, points),  # type: ignore[misc]
                lambda points, ready=ready: focus(ready, points),  # type: ignore[misc]
                np.array([0.0, 0.3, 0.0]) - half,
                np.array([0.0, 0.3, 0.0]) + half,
                Resolution(along_ray=2e-3, across_ray=1.2e-2),
                reach=(0.02, 0.45),
                trials=30_000,
            )
            assert line is not None
            some.append(np.sqrt(np.diag(line.covariance)))
        deviations.append(np.median(some, axis=0))
    ratio = deviations[0] / deviations[1]
    # Expected 2.8 and 1.4; each median of six deviations is known to some 30 %.
    assert ratio[0] > 1.4
    assert ratio[1] > 0.8
    assert ratio[0] > ratio[1]
