"""A wall's plane below the resolution cell, in images known in closed form."""

import numpy as np
import pytest
from jaxtyping import Complex, Float

from estimator.array.resolution_cell import Resolution
from estimator.geometry.wall_3d import PlaneWall
from estimator.walls.plane_fit import LEAN, plane_axes, refine_plane

BEAM = 0.2  # where the wall's brightness has fallen to 1/e [m]
HALF = 0.35  # of the square that is fitted [m]


def square(centre: Float[np.ndarray, " 3"], axes: Float[np.ndarray, "2 3"]) -> PlaneWall:
    corners = centre + HALF * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ axes
    return PlaneWall(corners=corners, centre=centre, axes=axes, covariance=np.zeros((3, 3)))


@pytest.mark.parametrize("resolution", [(0.021, 0.016), (0.01, 0.036)])
@pytest.mark.parametrize("angle_deg", [25.0, 40.0, 60.0])
def test_a_beam_on_a_slanted_wall_does_not_turn_it(
    resolution: tuple[float, float], angle_deg: float
) -> None:
    angle = np.radians(angle_deg)
    centre = np.array([0.0, 1.6, 0.0])
    axes = plane_axes(np.array([np.sin(angle), -np.cos(angle), 0.0]))
    cell = Resolution(along_ray=resolution[0], across_ray=resolution[1])

    def focus(points: Float[np.ndarray, "*grid 3"]) -> Complex[np.ndarray, "*grid"]:
        """Return the root of the intensity that a cell of Gaussian shape shows of a beam's spot.

        The integral of exp(-s²/BEAM² - (p - s)ᵀ P (p - s)) over the plane, in closed form.
        """
        reach = np.linalg.norm(points, axis=-1)[..., None, None]
        ray = points[..., None] / reach
        radial = ray * np.swapaxes(ray, -1, -2)
        precision = (
            radial / cell.along_ray**2 + (np.eye(3) - radial) / (cell.across_ray * reach) ** 2
        )
        away = (points - centre)[..., None]
        inner = np.eye(2) / BEAM**2 + axes @ precision @ axes.T
        pull = axes @ precision @ away
        exponent = np.swapaxes(pull, -1, -2) @ np.linalg.solve(inner, pull)
        exponent -= np.swapaxes(away, -1, -2) @ precision @ away
        value = np.exp(0.5 * exponent[..., 0, 0]) / np.linalg.det(inner) ** 0.25
        return np.asarray(value.astype(np.complex128))

    wall = square(centre, axes)
    start = wall.moved(np.array([2e-3, -1e-3, 1e-3]))
    found = refine_plane(focus, start, cell)
    assert found is not None
    edge = float(cell.cell(centre, wall.normal)) / HALF
    turn = found.normal - wall.normal
    # Along the normal alone, samples would turn it by 0.03 to 1 cell at its edges.
    assert np.linalg.norm(turn) < 2 * LEAN[0] * edge  # two deviations
