import numpy as np
import pytest
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.imaging.aperture_parts import PolarGrid, cheapest_plan, line_of
from estimator.imaging.backprojection import backproject, focus, prepare
from estimator.imaging.factorised import factorised_backproject
from estimator.imaging.polar_image import focus_polar, polar_points
from estimator.imaging.range_compression import range_profiles
from estimator.measurement.model import Echo, MeasurementError, Uplink
from estimator.results.pixel_grid import PixelGrid

BAND = np.linspace(220e9, 295e9, 401)  # 0.8 m of unambiguous echo range
RNG = np.random.default_rng(20)
TARGETS = RNG.uniform([-0.3, 0.2, 0.0], [0.3, 0.5, 0.0], (12, 3))
ORIGIN, X = np.zeros(3), np.array([1.0, 0.0, 0.0])
SINES = np.linspace(-0.9, 0.9, 301)
RANGES = np.arange(0.12, 0.72, 1.5e-3)


def array(count: int = 200, spacing: float = 0.5e-3) -> Float[np.ndarray, "positions 3"]:
    return np.asarray((np.arange(count) - (count - 1) / 2)[:, None] * spacing * X)


def echo_of(
    targets: Float[np.ndarray, "targets 3"], positions: Float[np.ndarray, "positions 3"]
) -> Echo:
    samples = np.zeros((len(positions), BAND.size), dtype=complex)
    for target in targets:
        delay = 2 * np.linalg.norm(target - positions, axis=1) / speed_of_light
        samples += np.exp(-2j * np.pi * delay[:, None] * BAND)
    return Echo(samples=samples, positions=positions, frequencies=BAND)


@pytest.mark.parametrize("error", [1e-2, 1e-3, 1e-4])
def test_a_polar_image_of_parts_is_that_of_all_channels_to_the_error_asked_for(
    error: float,
) -> None:
    focuser = prepare(range_profiles(echo_of(TARGETS, array())))
    grid = PolarGrid(RANGES, SINES)
    line = line_of(focuser, ORIGIN, X)
    assert line is not None
    far = PolarGrid(RANGES[RANGES > 0.3], SINES)
    assert cheapest_plan(focuser, line, far, error) is not None
    exact = focus(focuser, polar_points(grid, ORIGIN, X))
    image = focus_polar(focuser, grid, centre=ORIGIN, axis=X, error=error)
    # Both read profiles that err by -76 dB of all targets' sum.
    floor = 2e-4
    assert np.abs(image - exact).max() <= error * np.abs(exact).max() + floor
    smooth = focus_polar(focuser, grid, centre=ORIGIN, axis=X, error=error, carrier=False)
    np.testing.assert_allclose(np.abs(smooth), np.abs(image), atol=1e-6)


def test_without_an_error_all_channels_are_added() -> None:
    focuser = prepare(range_profiles(echo_of(TARGETS, array())))
    grid = PolarGrid(RANGES, SINES)
    exact = focus(focuser, polar_points(grid, ORIGIN, X))
    image = focus_polar(focuser, grid, centre=ORIGIN, axis=X, error=0.0)
    assert np.abs(image - exact).max() < 1e-4 * np.abs(exact).max()  # float32 on both sides


def test_a_pilot_focuses_on_a_polar_grid_as_on_its_points() -> None:
    positions = array()
    source = np.array([0.3, 0.5, 0.0])
    delay = np.linalg.norm(source - positions, axis=1) / speed_of_light
    samples = np.exp(-2j * np.pi * delay[:, None] * BAND)
    uplink = Uplink(samples=samples, positions=positions, frequencies=BAND, user="a")
    focuser = prepare(range_profiles(uplink))
    grid = PolarGrid(np.arange(0.2, 1.4, 2e-3), np.linspace(-0.9, 0.9, 201))
    exact = focus(focuser, polar_points(grid, ORIGIN, X))
    image = focus_polar(focuser, grid, centre=ORIGIN, axis=X)
    assert np.abs(image - exact).max() <= 1e-3


@pytest.mark.parametrize("error", [1e-2, 1e-3])
def test_a_factorised_image_is_the_exact_one_to_the_error_asked_for(error: float) -> None:
    turn = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    shift = np.array([1.0, -2.0, 0.5])
    positions = array() @ turn.T + shift
    echo = echo_of(TARGETS @ turn.T + shift, positions)
    grid = PixelGrid.plane(x=np.linspace(-0.1, 0.1, 240), y=np.linspace(0.25, 0.45, 240))
    points = grid.points @ turn.T + shift
    exact = backproject(echo, points)
    image = factorised_backproject(echo, points, error=error)
    assert image.shape == exact.shape
    assert np.abs(image - exact).max() <= error * np.abs(exact).max()
    assert np.abs(image - exact).max() > 0  # it is another method


def test_a_point_target_focuses_to_one_where_it_stands() -> None:
    target = np.array([0.04, 0.31, 0.0])
    grid = PixelGrid.plane(
        x=np.linspace(0.0, 0.08, 201), y=np.linspace(0.27, 0.35, 201)
    )  # its middle is the target
    image = factorised_backproject(echo_of(target[None], array()), grid.points)
    assert abs(image.reshape(201, 201)[100, 100] - 1) <= 2e-3  # of both methods


def test_a_curved_array_is_back_projected_exactly() -> None:
    positions = array(64)
    positions[:, 1] = positions[:, 0] ** 2
    echo = echo_of(TARGETS, positions)
    points = PixelGrid.plane(x=np.linspace(-0.05, 0.05, 90), y=np.linspace(0.3, 0.4, 90)).points
    np.testing.assert_array_equal(factorised_backproject(echo, points), backproject(echo, points))


def test_pixels_beyond_the_unambiguous_range_are_refused() -> None:
    echo = echo_of(TARGETS, array(64))
    with pytest.raises(MeasurementError, match="unambiguous only up to"):
        factorised_backproject(echo, np.array([[0.0, 0.9, 0.0]]))
    focuser = prepare(range_profiles(echo))
    with pytest.raises(MeasurementError, match="unambiguous only up to"):
        focus_polar(focuser, PolarGrid(np.array([0.3, 0.9]), SINES), centre=ORIGIN, axis=X)
