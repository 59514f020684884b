import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jaxtyping import Float, Int

from scenes.realisations.object_surface import Surface
from simulator.geometry.facets import joined, profile_surface, surface_facets


def surface(
    vertices: list[list[float]], cells: list[list[int]], *, closed: bool = False
) -> Surface:
    points: Float[np.ndarray, "vertices 3"] = np.array(vertices, dtype=np.float64)
    indices: Int[np.ndarray, "cells corners"] = np.array(cells)
    return Surface(
        name="body",
        material="metal",
        vertices=points,
        mean_vertices=points,
        cells=indices,
        closed=closed,
    )


def test_a_line_cell_is_a_facet_with_its_normal_to_the_right_of_the_way() -> None:
    facets = surface_facets(surface([[0, 0, 0], [3, 4, 0]], [[0, 1]]))
    np.testing.assert_allclose(facets.centres, [[1.5, 2, 0]])
    np.testing.assert_allclose(facets.normals, [[0.8, -0.6, 0]])
    np.testing.assert_allclose(facets.sizes, [5])
    np.testing.assert_allclose(facets.edges, [[[3, 4, 0]]])
    assert facets.extent == 5
    assert facets.two_sided.all()


def test_a_triangle_is_a_facet_with_its_area_and_right_handed_normal() -> None:
    facets = surface_facets(surface([[0, 0, 1], [4, 0, 1], [0, 3, 1]], [[0, 1, 2]], closed=True))
    np.testing.assert_allclose(facets.centres, [[4 / 3, 1, 1]])
    np.testing.assert_allclose(facets.normals, [[0, 0, 1]])
    np.testing.assert_allclose(facets.sizes, [6])
    assert facets.count == 1
    assert not facets.two_sided.any()


@settings(deadline=None, max_examples=30)
@given(st.lists(st.tuples(st.floats(0.01, 1.0), st.floats(-0.5, 0.5)), min_size=3, max_size=12))
def test_the_facets_of_a_closed_contour_have_no_net_normal(
    steps: list[tuple[float, float]],
) -> None:
    # Gauss: the integral of the outward normal over a closed surface vanishes.
    radii = np.array([radius for radius, _ in steps])
    angles = 2 * np.pi * np.arange(len(radii)) / len(radii)
    vertices = np.stack([radii * np.cos(angles), radii * np.sin(angles), 0 * radii], axis=-1)
    first = np.arange(len(radii))
    facets = surface_facets(
        surface(
            vertices.tolist(),
            np.stack([first, (first + 1) % len(radii)], axis=-1).tolist(),
            closed=True,
        )
    )
    net = facets.normals.T @ facets.sizes
    np.testing.assert_allclose(net, 0, atol=1e-14 * len(radii))
    # Counter-clockwise, so outward: ∮ r·n = 2 × area > 0.
    assert np.einsum("fx,fx,f->", facets.centres, facets.normals, facets.sizes) > 0


def test_joined_facets_keep_their_order_and_their_sides() -> None:
    open_one = surface_facets(surface([[0, 0, 0], [1, 0, 0]], [[0, 1]]))
    closed_one = surface_facets(surface([[0, 1, 0], [1, 1, 0]], [[0, 1]], closed=True))
    both = joined([open_one, closed_one])
    assert both.count == 2
    np.testing.assert_array_equal(both.two_sided, [True, False])
    np.testing.assert_allclose(both.centres[1], closed_one.centres[0])


def test_nothing_cannot_be_joined() -> None:
    with pytest.raises(ValueError, match="no scattering object"):
        joined([])


def test_a_profile_becomes_an_open_conducting_surface_of_its_points() -> None:
    profile = np.array([[0.0, 0.8, 0.0], [0.1, 0.81, 0.0], [0.2, 0.8, 0.0]])
    wall = profile_surface(profile)
    assert (wall.material, wall.closed, wall.name) == ("metal", False, "wall")
    facets = surface_facets(wall)
    assert facets.count == 2
    # Along +x the normals look down, towards an array that looks up at the wall.
    assert np.all(facets.normals[:, 1] < 0)
