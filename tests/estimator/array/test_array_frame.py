import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from estimator.array.array_frame import STRAIGHTNESS, array_frame
from estimator.measurement.model import MeasurementError

BORESIGHT = np.array([0.0, 1.0, 0.0])


def along_x(count: int = 9, spacing: float = 0.5e-3) -> Float[np.ndarray, "positions 3"]:
    positions = np.zeros((count, 3))
    positions[:, 0] = spacing * (np.arange(count) - (count - 1) / 2)
    return positions


def test_an_array_along_x_that_looks_along_y_is_in_its_own_frame() -> None:
    frame = array_frame(along_x(), BORESIGHT)
    np.testing.assert_allclose(frame.axes, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(frame.origin, 0, atol=1e-18)


def test_a_reversed_list_of_elements_has_the_same_frame() -> None:
    frame = array_frame(along_x()[::-1].copy(), BORESIGHT)
    np.testing.assert_allclose(frame.axes, np.eye(3), atol=1e-15)


def test_an_array_that_looks_the_other_way_has_its_axis_turned_round() -> None:
    frame = array_frame(along_x(), -BORESIGHT)
    np.testing.assert_allclose(frame.axes, np.diag([-1.0, -1.0, 1.0]), atol=1e-15)


def test_an_array_that_looks_up_is_allowed() -> None:
    frame = array_frame(along_x(), np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(np.linalg.det(frame.axes), 1, atol=1e-15)
    np.testing.assert_allclose(frame.to_local(np.array([[0.0, 0.0, 2.0]])), [[0, 2, 0]], atol=1e-15)


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 10_000), shift=st.tuples(*[st.floats(-50, 50)] * 3))
def test_the_frame_is_a_rigid_motion_there_and_back(
    seed: int, shift: tuple[float, float, float]
) -> None:
    rng = np.random.default_rng(seed)
    turn = Rotation.random(rng=rng).as_matrix()
    positions = along_x() @ turn.T + np.array(shift)
    frame = array_frame(positions, turn @ BORESIGHT)
    # The axis points to the right of the boresight as seen from above, wherever "up" was turned;
    # coordinates of up to 50 m in double precision are 7e-15 m apart.
    right = np.sign(turn[2, 2])
    np.testing.assert_allclose(frame.to_local(positions), right * along_x(), atol=1e-12)
    np.testing.assert_allclose(frame.axes @ frame.axes.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(frame.axes) == pytest.approx(1.0)
    points = rng.uniform(-2, 2, (4, 3))
    np.testing.assert_allclose(frame.to_local(frame.to_world(points)), points, atol=1e-9)
    np.testing.assert_allclose(
        frame.turned_to_world(points), frame.to_world(points) - frame.origin, atol=1e-12
    )


def test_a_boresight_rounded_to_three_digits_does_not_bend_space() -> None:
    # 0.03° off the perpendicular, as a measured or rounded boresight may be: 0.5 mm at 1 m.
    slant = 5e-4
    frame = array_frame(along_x(), np.array([np.sin(slant), np.cos(slant), 0.0]))
    points = np.array([[1.0, 0.8, 0.0], [0.0, 2.0, 0.0]])
    np.testing.assert_allclose(frame.to_world(frame.to_local(points)), points, atol=1e-9)
    np.testing.assert_allclose(
        np.linalg.norm(frame.to_local(points), axis=-1), np.linalg.norm(points, axis=-1), rtol=1e-9
    )


def test_positions_with_a_little_jitter_still_make_a_line() -> None:
    jitter = np.random.default_rng(1).uniform(-1, 1, (200, 3)) * 0.4 * STRAIGHTNESS
    frame = array_frame(along_x(200) + jitter, BORESIGHT)
    # The slope that 0.04 mm of scatter gives a line of 0.1 m, over 200 points: 1e-4.
    np.testing.assert_allclose(frame.axes, np.eye(3), atol=5e-4)


def test_one_position_has_no_frame() -> None:
    with pytest.raises(MeasurementError, match="one position has no aperture"):
        array_frame(np.zeros((1, 3)), BORESIGHT)


def test_positions_off_a_line_are_refused_with_the_distance() -> None:
    bent = along_x()
    bent[4, 1] += 0.3e-3
    with pytest.raises(MeasurementError, match=r"up to 0\.\d+ mm off a line, the limit is 0\.1 mm"):
        array_frame(bent, BORESIGHT)


def test_a_boresight_along_the_array_is_refused_with_the_angle() -> None:
    for angle, told in ((60.0, "60.00°"), (0.0, "0.00°"), (89.9, "89.90°")):
        boresight = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0.0])
        with pytest.raises(MeasurementError, match=f"{told} from the array's axis"):
            array_frame(along_x(), boresight)
