import numpy as np
import pytest
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.channel.angle_range_map_2d import (
    angle_range_map,
    default_angles,
    default_path_lengths,
    polar_points,
)
from estimator.measurement.model import MeasurementError, Uplink

BAND = np.linspace(220e9, 295e9, 151)  # 0.6 m of unambiguous path
CENTRE = np.array([0.5, -0.2, 0.1])


def uplink_from(
    source: Float[np.ndarray, " 3"], positions: Float[np.ndarray, "elements 3"]
) -> Uplink:
    distance = np.linalg.norm(source - positions, axis=1)
    samples = np.exp(-2j * np.pi * distance[:, None] / speed_of_light * BAND)
    return Uplink(samples=samples, positions=positions, frequencies=BAND, user="a")


def linear_array(count: int = 100, spacing: float = 0.5e-3) -> Float[np.ndarray, "elements 3"]:
    positions = np.zeros((count, 3))
    positions[:, 0] = (np.arange(count) - (count - 1) / 2) * spacing
    return np.asarray(positions + CENTRE)


@pytest.mark.parametrize("aoa_deg", [20.0, 70.0, 90.0, 135.0])
def test_a_user_appears_at_its_angle_and_path_length(aoa_deg: float) -> None:
    aoa = np.radians(aoa_deg)
    source = CENTRE + 0.4 * np.array([np.cos(aoa), np.sin(aoa), 0.0])
    angles = aoa + np.linspace(-0.02, 0.02, 21)
    lengths = 0.4 + np.linspace(-0.01, 0.01, 11)
    chart = angle_range_map(uplink_from(source, linear_array()), aoa=angles, path_length=lengths)
    assert np.unravel_index(np.abs(chart.values).argmax(), chart.values.shape) == (10, 5)
    assert abs(chart.values[10, 5] - 1) < 1e-3  # the promise of back-projection
    assert chart.user == "a"


def test_an_array_along_another_axis_measures_from_that_axis() -> None:
    aoa = np.radians(70.0)
    positions = linear_array()[:, [1, 0, 2]]
    centre = positions.mean(axis=0)
    source = centre + 0.4 * np.array([-np.sin(aoa), np.cos(aoa), 0.0])
    chart = angle_range_map(
        uplink_from(source, positions),
        aoa=np.array([aoa]),
        path_length=np.array([0.4]),
        axis=np.array([0.0, 2.0, 0.0]),
        boresight=np.array([-1.0, 5.0, 0.0]),
    )
    assert abs(chart.values[0, 0] - 1) < 1e-3


def test_polar_points_lie_at_their_distance_and_angle() -> None:
    points = polar_points(
        aoa=np.radians([0.0, 60.0, 180.0]), path_length=np.array([2.0]), centre=CENTRE
    )
    expected = CENTRE + np.array([[2.0, 0, 0], [1.0, np.sqrt(3.0), 0], [-2.0, 0, 0]])
    np.testing.assert_allclose(points[:, 0], expected, atol=1e-12)


def test_the_default_grid_samples_a_cell_thrice_within_what_is_unambiguous() -> None:
    uplink = uplink_from(CENTRE + np.array([0.0, 0.4, 0.0]), linear_array())
    angles, lengths = default_angles(uplink), default_path_lengths(uplink)
    wavelength = speed_of_light / BAND[-1]
    beam = 0.886 * wavelength / (99 * 0.5e-3)
    assert np.abs(np.diff(np.cos(angles))).max() <= beam / 3
    assert angles[0] < 1e-6  # d = 0.49 wavelengths: no grating lobes
    assert angles[-1] == pytest.approx(np.pi)
    assert np.diff(lengths).max() <= 0.886 * speed_of_light / 75e9 / 3 * 1.001
    assert 0.5 < lengths[-1] < speed_of_light / 0.5e9
    chart = angle_range_map(uplink, aoa=angles, path_length=lengths)  # must not be refused
    row, column = np.unravel_index(np.abs(chart.values).argmax(), chart.values.shape)
    assert abs(angles[row] - np.pi / 2) < beam
    assert abs(lengths[column] - 0.4) < 0.886 * speed_of_light / 75e9


def test_a_sparse_array_is_looked_at_only_where_it_is_unambiguous() -> None:
    uplink = uplink_from(CENTRE + np.array([0.0, 0.4, 0.0]), linear_array(20, 2e-3))
    assert np.cos(default_angles(uplink)[0]) == pytest.approx(
        speed_of_light / BAND[-1] / (2 * 2e-3), rel=1e-6
    )


def test_impossible_maps_are_refused() -> None:
    uplink = uplink_from(CENTRE + np.array([0.0, 0.4, 0.0]), linear_array())
    ranges, angles = np.array([0.4]), np.array([1.0])
    with pytest.raises(MeasurementError, match=r"from -0\.5.*° to 57.*0…180°"):
        angle_range_map(uplink, aoa=np.array([-0.01, 1.0]), path_length=ranges)
    with pytest.raises(MeasurementError, match="shortest path length is 0 m"):
        angle_range_map(uplink, aoa=angles, path_length=np.array([0.0, 1.0]))
    with pytest.raises(MeasurementError, match="boresight, less its part along the axis"):
        angle_range_map(uplink, aoa=angles, path_length=ranges, boresight=np.array([1.0, 0, 0]))
    with pytest.raises(MeasurementError, match=r"reach 0\.7.*only up to 0\.600"):
        angle_range_map(uplink, aoa=angles, path_length=np.array([0.7]))
    with pytest.raises(MeasurementError, match="an angle needs an aperture"):
        default_angles(uplink, axis=np.array([0.0, 0.0, 1.0]))
    with pytest.raises(MeasurementError, match="hold no range cell"):
        default_path_lengths(uplink, longest=1e-4)
