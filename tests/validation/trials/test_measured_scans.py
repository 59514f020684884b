"""Draws of scans without a wall, and a letter that a close scan focuses."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from estimator.imaging.energy_region import cells_at
from estimator.imaging.scene_image import ImageOptions, image_scene
from estimator.measurement.model import Echo, Measurement
from validation.analytic.point_scatterer import point_echo
from validation.trials.measured_scans import KINDS, drawn_scan, facing_echo, letter_points


def test_the_same_seed_draws_the_same_scan_with_what_it_is_of_in_front() -> None:
    for kind in KINDS:
        one, two = (drawn_scan(kind, np.random.default_rng(3), planar=False) for _ in range(2))
        assert one.measurement.echo is not None
        assert two.measurement.echo is not None
        np.testing.assert_array_equal(one.measurement.echo.samples, two.measurement.echo.samples)
        assert np.all(one.scatterers[:, 1] > 0)


def test_a_small_piece_that_faces_the_array_echoes_as_a_point() -> None:
    positions = np.array([[0.0, 0.0, 0.0], [1e-3, 0.0, 0.0]])
    frequencies = np.linspace(20e9, 22e9, 9)
    place = np.array([[0.0, 0.4, 0.0]])
    own = facing_echo(place, np.ones(1, dtype=complex), positions, frequencies)
    point = point_echo(
        place, positions=positions, frequencies=frequencies, radar_cross_section=np.ones(1)
    )
    ratio = own / (point.samples * frequencies)  # λ in the radar equation
    np.testing.assert_allclose(ratio / ratio[0, 0], 1.0, rtol=1e-4)  # cosθ over 1 mm


@pytest.mark.parametrize(("distance", "count"), [(0.1, 6), (0.1, 40)])
def test_a_letter_close_to_the_scan_is_focused(distance: float, count: int) -> None:
    places = (np.arange(45) - 22) * 3e-3
    x, z = np.meshgrid(places, places, indexing="ij")
    positions = np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=-1)
    frequencies = np.linspace(22e9, 26e9, count)
    letter = letter_points(0.06, 2e-3) + np.array([0.0, distance, 0.0])
    samples = facing_echo(letter, np.ones(len(letter), dtype=complex), positions, frequencies)
    measurement = Measurement(
        echo=Echo(samples=samples, positions=positions, frequencies=frequencies), uplinks=()
    )
    options = ImageOptions(low=(-0.05, distance, -0.05), high=(0.05, distance, 0.05), pixel=2e-3)
    made = image_scene(measurement, options=options)
    seen = np.abs(made.image.values[:, 0])
    grid = made.image.grid
    truth = np.zeros(seen.shape)
    columns = [
        np.rint((letter[:, axis] - line[0]) / 2e-3).astype(int)
        for axis, line in ((0, grid.x), (2, grid.z))
    ]
    np.add.at(truth, tuple(columns), 1.0)
    assert made.image.grid.y.size == 1
    assert measurement.echo is not None
    cells = cells_at(measurement.echo, np.array([[0.0, distance, 0.0]]))[0]
    truth = gaussian_filter(truth, 0.6 * cells[[0, 2]] / 2e-3)
    match = (seen * truth).sum() / np.linalg.norm(seen) / np.linalg.norm(truth)
    assert match > 0.9
