"""The angular spectrum against back-projection, and profiles beyond the unambiguous range."""

import numpy as np
import pytest

from estimator.array.windows import survey_weights
from estimator.imaging.energy_region import cells_at, farthest_told, focused
from estimator.imaging.wavenumber.angular_spectrum import angular_spectrum
from estimator.imaging.wavenumber.range_migration import range_migration
from estimator.measurement.model import Echo
from estimator.results.pixel_grid import PixelGrid
from validation.analytic.point_scatterer import point_echo

PLACES = (np.arange(25) - 12) * 5e-3
GRID = PixelGrid.spanning(x=(-0.05, 0.05), y=(0.08, 0.16), z=(-0.05, 0.05), spacing=0.005)
POINTS = np.array([[0.02, 0.1, -0.01], [-0.02, 0.14, 0.02]])


def few(count: int, stop: float = 24e9) -> Echo:
    x, z = np.meshgrid(PLACES, PLACES, indexing="ij")
    positions = np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=-1)
    return point_echo(
        POINTS,
        positions=positions,
        frequencies=np.linspace(22e9, stop, count),
        radar_cross_section=np.ones(2),
    )


@pytest.mark.parametrize("count", [2, 6])
def test_the_angular_spectrum_is_back_projection(count: int) -> None:
    echo = few(count, stop=22.5e9)
    weights = survey_weights(echo)
    image = angular_spectrum(echo, GRID, weights=weights)
    truth = focused(echo, GRID.points, weights)
    # stationary phase errs by 1/(k y) of the image: 2 % at 0.1 m, 22 GHz
    assert np.abs(image - truth).max() < 0.03 * np.abs(truth).max()


def test_range_migration_of_few_frequencies_keeps_the_period_of_the_pixels() -> None:
    echo = few(24, stop=26e9)  # 0.86 m unambiguous: the gate would take more than that
    image, truth = range_migration(echo, GRID), focused(echo, GRID.points, np.ones((1, 1)))
    match = abs(np.vdot(image, truth)) / np.linalg.norm(image) / np.linalg.norm(truth)
    assert match > 0.95


def test_few_frequencies_focus_beyond_their_unambiguous_range() -> None:
    echo = few(6, stop=30e9)  # c/2Δf = 94 mm
    assert farthest_told(echo, ahead=True) > 0.094
    values = np.abs(focused(echo, POINTS, np.ones((1, 1))))
    direct = [
        abs(
            np.mean(
                echo.samples
                * np.exp(
                    4j
                    * np.pi
                    / 299792458.0
                    * np.outer(np.linalg.norm(point - echo.positions, axis=1), echo.frequencies)
                )
            )
        )
        for point in POINTS
    ]
    np.testing.assert_allclose(values, direct, rtol=1e-2)


def test_cells_are_those_of_the_range_and_of_the_aperture_far_away() -> None:
    echo = few(6)
    far = np.array([[0.0, 5.0, 0.0]])
    cells = cells_at(echo, far)[0]
    wavelength = 299792458.0 / 24e9
    np.testing.assert_allclose(cells[[0, 2]], wavelength * 5.0 / (2 * 0.12), rtol=1e-2)
    np.testing.assert_allclose(cells[1], 299792458.0 / (2 * 2e9), rtol=1e-2)
