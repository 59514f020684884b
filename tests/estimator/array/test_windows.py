import numpy as np
import pytest
from scipy.constants import speed_of_light
from scipy.signal import windows as scipy_windows

from estimator.array.windows import Window, aperture_taper, frequency_taper
from estimator.imaging.backprojection import backproject
from estimator.measurement.model import Echo, MeasurementError


@pytest.mark.parametrize(
    ("window", "sidelobe_db", "width"),
    [
        (Window(), -13.26, 0.886),
        (Window(name="hann"), -31.47, 1.441),
        (Window(name="taylor", sidelobe_db=-35.0, nearly_equal=5), -35.0, 1.19),
        (Window(name="kaiser", beta=0.0), -13.26, 0.886),
        (Window(name="kaiser", beta=2 * np.pi), -46.0, 1.43),
    ],
    ids=lambda value: getattr(value, "name", None),
)
def test_windows_have_their_textbook_sidelobes_and_widths(
    window: Window, sidelobe_db: float, width: float
) -> None:
    # Harris (1978) gives three digits; Taylor's design level is met to a few tenths of a dB.
    assert window.peak_sidelobe_db == pytest.approx(sidelobe_db, abs=0.6)
    assert window.half_power_width == pytest.approx(width, rel=0.01)


@pytest.mark.parametrize("count", [64, 65])
def test_windows_over_uniform_samples_are_those_of_scipy(count: int) -> None:
    frequencies = np.linspace(220e9, 295e9, count)
    taylor = frequency_taper(frequencies, Window(name="taylor", sidelobe_db=-30.0, nearly_equal=4))
    expected = scipy_windows.taylor(count, nbar=4, sll=30, norm=False)
    np.testing.assert_allclose(taylor / taylor.max(), expected / expected.max(), atol=1e-12)


def test_a_taper_of_an_array_does_not_depend_on_where_it_stands() -> None:
    positions = np.zeros((9, 3))
    positions[:, 0] = np.arange(9)
    hann = Window(name="hann")
    taper = aperture_taper(positions, hann)
    turned = positions @ np.array([[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1.0]]) + 5.0
    np.testing.assert_allclose(taper, np.cos(np.pi * np.arange(-4, 5) / 9) ** 2, atol=1e-12)
    np.testing.assert_allclose(aperture_taper(turned[:, [2, 0, 1]], hann), taper, atol=1e-9)


def test_a_planar_array_is_tapered_along_both_axes() -> None:
    x, z = np.meshgrid(np.arange(5.0), np.arange(7.0), indexing="ij")
    positions = np.stack([x.ravel(), np.zeros(35), z.ravel()], axis=1)
    taper = aperture_taper(positions, Window(name="hann")).reshape(5, 7)
    first = np.cos(np.pi * np.arange(-2, 3) / 5) ** 2
    second = np.cos(np.pi * np.arange(-3, 4) / 7) ** 2
    np.testing.assert_allclose(taper, np.outer(first, second), atol=1e-12)


def test_the_image_of_a_point_has_the_sidelobes_of_its_window() -> None:
    positions = np.zeros((1, 3))
    frequencies = np.linspace(220e9, 295e9, 501)
    target = np.array([0.0, 0.4, 0.0])
    samples = np.exp(-4j * np.pi * 0.4 / speed_of_light * frequencies)[None]
    echo = Echo(samples=samples, positions=positions, frequencies=frequencies)
    cell = speed_of_light / (2 * 75e9)
    offsets = np.arange(-12, 12, 0.02)
    points = target + offsets[:, None] * cell * np.array([0.0, 1.0, 0.0])
    for window in (Window(), Window(name="hann"), Window(name="taylor")):
        weights = frequency_taper(frequencies, window)[None]
        cut = 20 * np.log10(np.abs(backproject(echo, points, weights=weights)) + 1e-6)
        outside = np.abs(offsets) > window.half_power_width * 1.6
        assert cut.max() == pytest.approx(0.0, abs=0.01)
        # The samples are finitely many: 501 of them move a sidelobe by a few hundredths.
        assert cut[outside].max() == pytest.approx(window.peak_sidelobe_db, abs=0.3)


def test_windows_that_cannot_be_are_refused() -> None:
    with pytest.raises(MeasurementError, match="'hamming'; choose one of"):
        Window(name="hamming")
    with pytest.raises(MeasurementError, match="sidelobes of -5 dB"):
        Window(name="taylor", sidelobe_db=-5.0)
    with pytest.raises(MeasurementError, match="2 nearly equal sidelobes are too few"):
        Window(name="taylor", sidelobe_db=-50.0, nearly_equal=2)
    with pytest.raises(MeasurementError, match="beta is -1"):
        Window(name="kaiser", beta=-1.0)
