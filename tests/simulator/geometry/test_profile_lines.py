"""Runs of line facets and the edges where they end."""

import numpy as np
import pytest

from scenes.files.loading import load_scenario
from scenes.realisations.object_surface import object_surface
from simulator.geometry.facets import profile_surface
from simulator.geometry.profile_lines import outline


def test_a_box_has_four_faces_and_four_right_angles_of_air() -> None:
    lines = outline(object_surface(load_scenario("nlos_box"), "box", seed=0))
    assert len(lines.runs) == 4
    assert [edge.exterior for edge in lines.corners] == pytest.approx([1.5] * 4)
    met = sorted(facet for edge in lines.corners for facet in edge.facets)
    ends = sorted(int(run.facets[end]) for run in lines.runs for end in (0, -1))
    assert met == ends


def test_the_two_ends_of_a_plate_know_each_other() -> None:
    scenario = load_scenario("slam_2d")
    lines = outline(object_surface(scenario, "wall", seed=0))
    assert len(lines.runs) == 1
    assert [edge.partner for edge in lines.corners] == [1, 0]
    for edge, other in zip(lines.corners, lines.corners[::-1], strict=True):
        assert edge.exterior == 2.0
        inward = (other.place - edge.place) / np.linalg.norm(other.place - edge.place)
        assert edge.inward[0] @ inward > 0.999


def test_a_cylinder_is_one_run_without_edges() -> None:
    scenario = load_scenario("nlos_posts")
    name = next(one for one, body in scenario.objects.items() if body.kind == "cylinder")
    lines = outline(object_surface(scenario, name, seed=0))
    assert [run.closed for run in lines.runs] == [True]
    assert lines.corners == ()


def test_facets_stand_for_the_cubic_through_their_neighbours() -> None:
    # h = x³ - 2x² + x/2 over facets of length d: its mean, and the rise of the best line.
    step = 0.25
    x = step * np.arange(13)
    heights = 1e-3 * (x**3 - 2 * x**2 + x / 2)
    heights[-1], heights[0] = 0.0, 0.0  # the ends are only extrapolated
    lines = outline(profile_surface(np.stack([x, heights, 0 * x], axis=-1)))
    lower, upper = x[1:-1][1:-1][:-1], x[1:-1][1:-1][1:]

    def antiderivative(at: np.ndarray) -> np.ndarray:
        return 1e-3 * (at**4 / 4 - 2 * at**3 / 3 + at**2 / 4)

    def moment(at: np.ndarray) -> np.ndarray:
        return 1e-3 * (at**5 / 5 - at**4 / 2 + at**3 / 6)

    mean = (antiderivative(upper) - antiderivative(lower)) / step
    centre = (lower + upper) / 2
    first = moment(upper) - moment(lower) - centre * (antiderivative(upper) - antiderivative(lower))
    inner = slice(2, -2)
    # The profile runs along +x, and its normal is to the right: heights count downward.
    np.testing.assert_allclose(-lines.runs[0].heights[inner], mean, rtol=1e-9, atol=1e-15)
    rises = lines.edges[inner, 0, 1]
    np.testing.assert_allclose(rises, 12 * first / step**2, rtol=1e-9, atol=1e-15)


def test_a_smooth_surface_is_not_rough() -> None:
    x = np.linspace(0, 1, 40)
    lines = outline(profile_surface(np.stack([x, 0.3 * x, 0 * x], axis=-1)))
    assert not lines.runs[0].rough
