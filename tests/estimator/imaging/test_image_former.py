import numpy as np
import pytest

from estimator.imaging.image_former import FORMERS, form_image
from estimator.results.pixel_grid import PixelGrid
from validation.analytic.point_scatterer import point_echo


@pytest.mark.parametrize("name", sorted(FORMERS))
def test_every_method_images_a_point_through_the_same_interface(name: str) -> None:
    positions = np.stack([np.linspace(-0.03, 0.03, 121), np.zeros(121), np.zeros(121)], axis=1)
    echo = point_echo(
        np.array([[0.01, 0.3, 0.0]]),
        positions=positions,
        frequencies=np.linspace(220e9, 295e9, 201),
        radar_cross_section=np.ones(1),
    )
    grid = PixelGrid.spanning(x=(-0.02, 0.04), y=(0.28, 0.32), spacing=0.5e-3)
    image = form_image(echo, grid, former=FORMERS[name])
    place = np.unravel_index(np.abs(image.values).argmax(), grid.shape)
    np.testing.assert_allclose(image.grid.points[place], [0.01, 0.3, 0.0], atol=0.25e-3)
