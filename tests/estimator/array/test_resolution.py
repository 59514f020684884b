import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.array.field_regions import (
    curvature,
    far_field_distance,
    field_region,
    fresnel_distance,
)
from estimator.array.resolution import (
    aliased,
    aliasing_note,
    angular_resolution,
    cell_at,
    cross_range_resolution,
    largest_frequency_step,
    largest_spacing,
    phase_per_frequency_step,
    range_resolution,
    unaliased_sine,
    unambiguous_range,
)
from estimator.imaging.backprojection import backproject
from estimator.measurement.model import Echo, MeasurementError


def wavelength(frequency: float) -> float:
    return speed_of_light / frequency


def linear_array(count: int = 260, spacing: float = 0.5e-3) -> np.ndarray:
    positions = np.zeros((count, 3))
    positions[:, 0] = (np.arange(count) - (count - 1) / 2) * spacing
    return positions


def test_the_lab_has_a_range_cell_of_1_21_mm() -> None:
    # 110 GHz: c/2B is 1.36 mm (the thesis prints 1.5 mm for "100 GHz").
    assert range_resolution(110e9) == pytest.approx(0.8859 * 1.3627e-3, rel=1e-4)
    assert range_resolution(110e9, passes=1) == pytest.approx(2 * range_resolution(110e9))


@pytest.mark.parametrize(
    ("frequency", "distance", "cell"), [(220e9, 1.8, 14.3e-3 * 2 / 2), (275e9, 2.8, 20.8e-3)]
)
def test_the_uplink_has_the_cross_range_cell_of_the_design(
    frequency: float, distance: float, cell: float
) -> None:
    # The design's figures: 14.3 mm at 1.8 m and 20.8 mm at 2.8 m, of an aperture of 13 cm,
    # each at its scene's own centre frequency; it rounds to three digits.
    centre = {1.8: 257.5e9, 2.8: 275e9}[distance]
    found = cross_range_resolution(
        wavelength=wavelength(centre), distance=distance, aperture_length=0.13, passes=1
    )
    assert found == pytest.approx(cell, rel=0.005)


def test_an_echo_resolves_twice_as_finely_as_an_uplink() -> None:
    one = angular_resolution(wavelength=1e-3, aperture_length=0.1, passes=1)
    assert angular_resolution(wavelength=1e-3, aperture_length=0.1, passes=2) == one / 2


def test_the_thesis_spacing_serves_targets_up_to_30_degrees_at_295_ghz() -> None:
    # (2-22) with the angle: 0.5 mm passes up to |sin φ| = 0.5, and not for all angles.
    shortest = wavelength(295e9)
    assert unaliased_sine(0.5e-3, shortest) == pytest.approx(0.508, abs=1e-3)
    assert largest_spacing(shortest, angle=np.radians(30)) > 0.5e-3
    assert largest_spacing(shortest) == pytest.approx(shortest / 4)
    assert largest_spacing(shortest, passes=1) == pytest.approx(shortest / 2)
    assert largest_spacing(shortest, angle=0.0) == float("inf")


def test_complex_samples_are_unambiguous_up_to_half_the_wave_of_the_step() -> None:
    step = 75e6
    limit = unambiguous_range(step)
    assert limit == pytest.approx(1.9986, rel=1e-4)
    assert largest_frequency_step(limit) == pytest.approx(step)
    assert phase_per_frequency_step(limit, step) == pytest.approx(2 * np.pi)
    assert unambiguous_range(step, passes=1) == pytest.approx(2 * limit)


def half_power_width(place: np.ndarray, level: np.ndarray) -> float:
    """Width of the main lobe between its -3 dB points, linearly between samples."""
    half = level.max() / np.sqrt(2)
    peak = int(level.argmax())
    left = peak - int(np.argmax(level[peak::-1] < half))
    right = peak + int(np.argmax(level[peak:] < half))
    low = np.interp(half, level[left : left + 2], place[left : left + 2])
    high = np.interp(half, level[right : right - 2 : -1], place[right : right - 2 : -1])
    return float(high - low)


@pytest.mark.parametrize("target", [(0.0, 0.8), (0.3, 0.7), (-0.2, 0.3), (0.0, 0.15)], ids=str)
def test_a_point_is_as_wide_as_its_cell_on_and_off_the_axis_and_near(
    target: tuple[float, float],
) -> None:
    positions = linear_array()
    frequencies = np.linspace(220e9, 295e9, 501)
    place = np.array([*target, 0.0])
    distance = np.linalg.norm(place - positions, axis=1)
    samples = np.exp(-4j * np.pi * distance[:, None] / speed_of_light * frequencies)
    echo = Echo(samples=samples, positions=positions, frequencies=frequencies)
    cell = cell_at(place, positions=positions, frequencies=frequencies)
    along = place / np.linalg.norm(place)
    across = np.array([along[1], -along[0], 0.0])
    offsets = np.linspace(-2, 2, 801)
    for direction, width in ((along, cell.along_range), (across, cell.across)):
        cut = np.abs(backproject(echo, place + (offsets * width)[:, None] * direction))
        assert half_power_width(offsets, cut) == pytest.approx(1.0, rel=0.05)  # the 5 %


def test_the_cell_of_a_distant_point_is_that_of_the_formula() -> None:
    angle = np.radians(40)
    point = 5.0 * np.array([np.sin(angle), np.cos(angle), 0.0])
    cell = cell_at(point, positions=linear_array(), frequencies=np.array([250e9, 260e9]))
    expected = cross_range_resolution(
        wavelength=wavelength(255e9), distance=5.0, aperture_length=0.1295, angle=angle
    )
    assert cell.across == pytest.approx(expected, rel=1e-3)  # (D/R)²/8 is 1e-4


def test_points_among_the_grating_lobes_are_told_with_the_numbers() -> None:
    positions, frequencies = linear_array(), np.array([220e9, 295e9])
    points = np.array([[0.0, 1.0, 0.0], [1.0, 1.0, 0.0]])
    outside = aliased(points, positions=positions, frequencies=frequencies)
    np.testing.assert_array_equal(outside, [False, True])
    note = aliasing_note(points, positions=positions, frequencies=frequencies)
    assert note is not None
    assert "50 % of the points lie more than 30.5° off broadside" in note
    assert "all angles need 0.254 mm" in note
    for some, passes in ((points[:1], 2), (points, 1)):
        assert (
            aliasing_note(some, positions=positions, frequencies=frequencies, passes=passes) is None
        )


def test_a_hole_in_the_aperture_is_no_coarser_sampling() -> None:
    positions = np.delete(linear_array(), slice(100, 110), axis=0)
    points = np.array([[0.4, 1.0, 0.0]])
    assert not aliased(points, positions=positions, frequencies=np.array([220e9, 295e9])).any()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: range_resolution(0.0), "bandwidth is 0"),
        (lambda: range_resolution(1e9, passes=3), "passes is 3"),
        (lambda: unambiguous_range(-1.0), "frequency_step is -1"),
        (lambda: largest_frequency_step(float("nan")), "longest is nan"),
        (
            lambda: angular_resolution(wavelength=1e-3, aperture_length=0.1, angle=np.pi / 2),
            "90° off broadside",
        ),
        (
            lambda: cell_at(
                linear_array().mean(axis=0),
                positions=linear_array(),
                frequencies=np.array([1e9, 2e9]),
            ),
            "no range direction",
        ),
        (
            lambda: cell_at(
                np.array([1.0, 0.0, 0.0]),
                positions=linear_array(2),
                frequencies=np.array([1e9, 2e9]),
            ),
            "no cross-range",
        ),
        (
            lambda: aliased(
                np.ones((1, 3)), positions=np.zeros((1, 3)), frequencies=np.array([1e9])
            ),
            "one position has no aperture",
        ),
        (lambda: fresnel_distance(0.0, 1e-3), "aperture length is 0 m"),
        (lambda: far_field_distance(0.1, -1.0), "wavelength is -1 m"),
        (lambda: field_region(0.0, 0.1, 1e-3), "distance is 0 m"),
    ],
)
def test_impossible_values_are_refused(call: object, message: str) -> None:
    with pytest.raises(MeasurementError, match=message):
        call()  # type: ignore[operator]


def test_the_thesis_array_has_its_far_field_beyond_24_8_m() -> None:
    # So the thesis' "far field" at 20 m is still radiating near field.
    shortest = wavelength(220e9)
    assert far_field_distance(0.13, shortest) == pytest.approx(24.8, abs=0.05)
    assert field_region(20.0, 0.13, shortest) == "radiating near field"
    assert field_region(25.0, 0.13, shortest) == "far field"
    assert field_region(0.5, 0.13, shortest) == "reactive near field"
    assert fresnel_distance(0.13, shortest) == pytest.approx(0.787, abs=1e-3)
    assert curvature(far_field_distance(0.13, shortest), 0.13, shortest) == pytest.approx(np.pi / 8)
