import numpy as np
import pytest

from estimator.imaging.backprojection import backproject
from estimator.measurement.model import Echo
from estimator.results.estimate import Image
from estimator.results.pixel_grid import PixelGrid
from validation.analytic.point_scatterer import point_echo
from validation.metrics.image_quality import image_entropy, main_lobe, sidelobe_ratios

TARGET = np.array([0.0, 0.6, 0.0])
FREQUENCIES = np.linspace(220e9, 260e9, 241)
WIDTHS = np.array([299792458 / (2 * 40e9), 299792458 / 240e9 * 0.6 / (2 * 0.04)])


def echo_of_a_point() -> Echo:
    positions = np.zeros((81, 3))
    positions[:, 0] = np.linspace(-0.02, 0.02, 81)
    return point_echo(
        TARGET[None],
        positions=positions,
        frequencies=FREQUENCIES,
        radar_cross_section=np.array([1e-4]),
    )


def focused(echo: Echo, grid: PixelGrid) -> Image:
    return Image(values=backproject(echo, grid.points), grid=grid)


def test_the_entropy_counts_the_pixels_that_hold_the_image() -> None:
    values = np.zeros((20, 30), dtype=np.complex128)
    values[3, 4] = 2j
    assert image_entropy(values) == pytest.approx(0.0, abs=1e-12)
    values[5:8, 9] = -2.0
    assert image_entropy(values) == pytest.approx(np.log(4))
    assert image_entropy(np.ones((20, 30), dtype=np.complex128)) == pytest.approx(np.log(600))
    with pytest.raises(ValueError, match="zero everywhere"):
        image_entropy(np.zeros((2, 2), dtype=np.complex128))


def test_the_ratios_of_a_sinc_are_the_textbook_ones() -> None:
    x = np.linspace(-400, 400, 80_001)
    found = sidelobe_ratios(np.sinc(x).astype(np.complex128), np.abs(x) <= 1)
    assert found.peak_db == pytest.approx(-13.26, abs=0.01)
    # Beyond 400 zeros lies 1/(2π²·400) of the energy: 0.006 dB of what is outside.
    assert found.integrated_db == pytest.approx(-9.68, abs=0.02)


def test_a_points_image_has_the_sidelobes_of_a_rectangular_aperture() -> None:
    echo = echo_of_a_point()
    across = PixelGrid.plane(x=np.linspace(-0.06, 0.06, 1201), y=np.array([0.6]))
    image = focused(echo, across)
    lobe = main_lobe(image, peak=TARGET, axes=np.array([[1.0, 0.0, 0.0]]), half_widths=WIDTHS[1:])
    found = sidelobe_ratios(image.values, lobe)
    # The widths vary by a sixth over the band, which fills the zeros and shifts them.
    assert found.peak_db == pytest.approx(-13.26, abs=0.5)


def test_an_error_of_the_phases_defocuses() -> None:
    echo = echo_of_a_point()
    grid = PixelGrid.plane(x=np.linspace(-0.05, 0.05, 101), y=np.linspace(0.58, 0.62, 81))
    bent = np.exp(1j * 3.0 * (echo.positions[:, :1] / 0.02) ** 2)
    blurred = Echo(
        samples=echo.samples * bent, positions=echo.positions, frequencies=echo.frequencies
    )
    sharp, broad = focused(echo, grid), focused(blurred, grid)
    assert image_entropy(broad.values) > image_entropy(sharp.values) + 0.1
    axes = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    lobe = main_lobe(sharp, peak=TARGET, axes=axes, half_widths=WIDTHS)
    good, bad = (sidelobe_ratios(image.values, lobe) for image in (sharp, broad))
    assert bad.peak_db > good.peak_db + 3
    assert bad.integrated_db > good.integrated_db + 3


def test_a_main_lobe_that_leaves_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="leaves nothing to compare"):
        sidelobe_ratios(np.ones(4, dtype=np.complex128), np.ones(4, dtype=bool))
