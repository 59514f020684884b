import numpy as np
import pytest
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.array.windows import Window, aperture_taper, frequency_taper
from estimator.imaging.backprojection import backproject
from estimator.imaging.wavenumber.range_migration import range_migration
from estimator.measurement.model import Echo, MeasurementError
from estimator.results.pixel_grid import PixelGrid

# The bound: -40 dB of the peak, for directions that the aperture samples.
ALIKE = 10 ** (-40 / 20)


def positions_on_a_line(count: int = 120) -> Float[np.ndarray, "positions 3"]:
    positions = np.zeros((count, 3))
    positions[:, 0] = (np.arange(count) - (count - 1) / 2) * 0.5e-3
    return positions


def echo_of(
    targets: Float[np.ndarray, "targets 3"],
    positions: Float[np.ndarray, "positions 3"],
    frequencies: Float[np.ndarray, " freqs"],
) -> Echo:
    samples: Complex[np.ndarray, "positions freqs"]
    samples = np.zeros((len(positions), len(frequencies)), dtype=complex)
    for target in targets:
        distance = np.linalg.norm(target - positions, axis=1)
        samples += np.exp(-4j * np.pi * distance[:, None] / speed_of_light * frequencies)
    return Echo(samples=samples, positions=positions, frequencies=frequencies)


TARGETS = np.array([[0.0, 0.35, 0.0], [0.05, 0.42, 0.0], [-0.06, 0.3, 0.0]])
BAND = np.linspace(220e9, 295e9, 301)
GRID = PixelGrid.spanning(x=(-0.08, 0.08), y=(0.27, 0.45), spacing=1e-3)


def largest_difference(echo: Echo, grid: PixelGrid) -> float:
    reference = backproject(echo, grid.points)
    difference = np.abs(range_migration(echo, grid) - reference)
    return float(difference.max() / np.abs(reference).max())


def test_both_image_formers_give_the_same_image() -> None:
    assert largest_difference(echo_of(TARGETS, positions_on_a_line(), BAND), GRID) < ALIKE


@pytest.mark.parametrize("spacing", [0.37e-3, 1.7e-3])
def test_a_grid_that_shares_no_step_with_the_aperture_gives_the_same_image(
    spacing: float,
) -> None:
    grid = PixelGrid.spanning(x=(-0.08, 0.08), y=(0.27, 0.45), spacing=spacing)
    assert largest_difference(echo_of(TARGETS, positions_on_a_line(), BAND), grid) < ALIKE


def test_a_point_focuses_to_one_where_it_stands() -> None:
    x, y, _ = TARGETS[1]
    grid = PixelGrid.plane(x=np.array([x]), y=np.array([y]))
    image = range_migration(echo_of(TARGETS[1:2], positions_on_a_line(), BAND), grid)
    # Magnitude and phase: stationary phase leaves the edges of aperture and band.
    assert abs(image[0, 0] - 1) < ALIKE


def test_holes_in_the_aperture_and_the_sweep_are_zeros() -> None:
    positions = np.delete(positions_on_a_line(), [5, 6, 40, 41, 42, 90], axis=0)
    frequencies = np.delete(BAND, slice(100, 110))
    assert largest_difference(echo_of(TARGETS, positions, frequencies), GRID) < ALIKE


def test_uneven_positions_and_frequencies_give_the_same_image() -> None:
    rng = np.random.default_rng(2)
    positions = positions_on_a_line()
    positions[:, 0] += rng.uniform(-0.1e-3, 0.1e-3, len(positions))
    frequencies = BAND + rng.uniform(-0.2, 0.2, BAND.size) * (BAND[1] - BAND[0])
    assert largest_difference(echo_of(TARGETS, positions, frequencies), GRID) < ALIKE


def test_an_array_elsewhere_in_the_world_gives_the_same_image() -> None:
    shift = np.array([3.0, -2.0, 0.7])
    echo = echo_of(TARGETS + shift, positions_on_a_line() + shift, BAND)
    grid = PixelGrid.plane(x=GRID.x + 3.0, y=GRID.y - 2.0, z=0.7)
    assert largest_difference(echo, grid) < ALIKE


def test_tapers_act_alike_in_both() -> None:
    echo = echo_of(TARGETS, positions_on_a_line(), BAND)
    hann = Window(name="hann")
    weights = aperture_taper(echo.positions, hann)[:, None] * frequency_taper(BAND, hann)
    reference = backproject(echo, GRID.points, weights=weights)
    difference = range_migration(echo, GRID, weights=weights) - reference
    assert np.abs(difference).max() < ALIKE * np.abs(reference).max()


def test_a_planar_aperture_images_a_volume() -> None:
    x, z = np.meshgrid(np.arange(24), np.arange(20), indexing="ij")
    positions = np.stack([x.ravel(), np.zeros(480), z.ravel()], axis=1) * 0.6e-3
    positions -= positions.mean(axis=0)
    targets = np.array([[0.01, 0.15, -0.02], [-0.02, 0.17, 0.01]])
    echo = echo_of(targets, positions, np.linspace(220e9, 280e9, 81))
    grid = PixelGrid.spanning(x=(-0.03, 0.03), y=(0.14, 0.18), z=(-0.03, 0.03), spacing=1.2e-3)
    # The planar weights are those of stationary phase in two dimensions: the ends of this
    # aperture, only 12 wavelengths wide, are what is left.
    assert largest_difference(echo, grid) < 10 ** (-35 / 20)


def test_what_range_migration_cannot_do_is_refused() -> None:
    echo = echo_of(TARGETS, positions_on_a_line(), BAND)
    samples, positions = echo.samples, echo.positions
    bistatic = Echo(
        samples=samples, positions=positions, frequencies=BAND, transmit_positions=positions + 0.1
    )
    with pytest.raises(MeasurementError, match="takes a monostatic echo"):
        range_migration(bistatic, GRID)
    with pytest.raises(MeasurementError, match="one point has no bandwidth"):
        range_migration(
            Echo(samples=samples[:, :1], positions=positions, frequencies=BAND[:1]), GRID
        )
    bent = positions.copy()
    bent[:, 1] = positions[:, 0] ** 2
    with pytest.raises(MeasurementError, match="all at one y"):
        range_migration(Echo(samples=samples, positions=bent, frequencies=BAND), GRID)
    with pytest.raises(MeasurementError, match=r"images the plane it lies in \(z = 0 m\)"):
        range_migration(echo, PixelGrid.plane(x=GRID.x, y=GRID.y, z=0.1))
    with pytest.raises(MeasurementError, match=r"reach 0\.9.* only up to 0\.600 m"):
        range_migration(echo, PixelGrid.plane(x=GRID.x, y=np.array([0.9])))
    x, z = np.meshgrid(np.arange(6.0), np.arange(5.0))
    uneven = np.stack([x.ravel() + 0.12345 * (z.ravel() % 2), 0 * x.ravel(), z.ravel()], axis=1)
    planar = Echo(samples=samples[:30], positions=1e-3 * uneven, frequencies=BAND)
    with pytest.raises(MeasurementError, match="off the planar aperture's grid"):
        range_migration(planar, GRID)
