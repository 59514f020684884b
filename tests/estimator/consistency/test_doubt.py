"""What a disagreement of delays and curvatures does to an answer; closed forms of plain waves."""

import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.consistency.doubt import OPENS, WIDENS, Doubted, doubted
from estimator.consistency.pilot_curvature import pilot_lateness
from estimator.consistency.same_samples import refuse_same_samples
from estimator.consistency.stated_heights import height_error
from estimator.geometry.lateness import Lateness, combined
from estimator.localization.stages_2d import LinearStages
from estimator.measurement.model import Echo, MeasurementError, Uplink
from estimator.results.estimate import PathReport, UserEstimate

BAND = np.linspace(220e9, 295e9, 201)
CELL = speed_of_light / 75e9
NOISE = 0.1


def elements(scale: float = 1.0) -> np.ndarray:
    positions = np.zeros((96, 3))
    positions[:, 0] = scale * (np.arange(96) - 47.5) * 0.5e-3
    return positions


def pilot(
    user: tuple[float, float], *, delay: float = 0.0, stated: np.ndarray | None = None
) -> Uplink:
    """A direct wave, as ideal elements receive it, with a cable's delay [s] left in it."""
    lengths = np.linalg.norm(np.array([*user, 0.0]) - elements(), axis=1)
    samples = np.exp(-2j * np.pi * np.outer(lengths / speed_of_light + delay, BAND))
    rng = np.random.default_rng(5)
    samples = samples + NOISE * rng.standard_normal(samples.shape)
    return Uplink(
        samples=samples,
        positions=elements() if stated is None else stated,
        frequencies=BAND,
        user="a",
    )


def late(uplink: Uplink) -> Lateness:
    found = LinearStages().hear(uplink, clock_known=True).paths
    told = pilot_lateness(found, [0])
    assert told is not None
    return told


def answer(*, mirrors: tuple[int, ...] = ()) -> UserEstimate:
    path = PathReport(aoa=1.2, path_length=0.3, share=1.0, mirrors=mirrors, used=True)
    return UserEstimate(
        name="a",
        status="found",
        position=np.array([0.1, 0.2, 0.0]),
        covariance=np.diag([1e-8, 1e-8, 0.0]),
        paths=(path,),
        bounces=len(mirrors),
    )


def judged(
    user: UserEstimate,
    *,
    pilot: Lateness | None = None,
    echo: Lateness | None = None,
    height: float = 0.0,
) -> Doubted:
    return doubted(user, pilot=pilot, echo=echo, height_error=height, bandwidth=75e9, axes=[0, 1])


@pytest.mark.parametrize("user", [(0.1, 0.2), (-0.2, 0.4)])
def test_a_cable_left_in_a_direct_pilot_is_the_difference_of_its_delay_and_its_radius(
    user: tuple[float, float],
) -> None:
    clean, cable = late(pilot(user)), late(pilot(user, delay=3e-11))
    assert clean.deviations < OPENS  # 1 in 1.7 million
    assert cable.deviations > OPENS
    # L²(κ − 1/L) is L − 1/κ to first order: off by the shift over the length, besides the noise.
    shift = 3e-11 * speed_of_light
    exact = shift * (1 + shift / float(np.hypot(*user)))
    assert cable.shift == pytest.approx(exact, abs=5 * cable.deviation)


def test_positions_stated_in_a_wrong_scale_make_curvatures_smaller_by_its_square() -> None:
    told = late(pilot((0.02, 0.25), stated=elements(1.01)))
    # κ/s²: 1 % too far apart, the wave is 2 % of its length too early; s² is 2.01 %.
    assert told.shift == pytest.approx(-0.02 * 0.2508, rel=0.02, abs=5 * told.deviation)
    (check,) = judged(answer(), pilot=told).checks
    assert "positions stated 0.99 % too far apart" in check.text


def test_what_agrees_leaves_the_answer_as_it_is() -> None:
    told = Lateness(shift=2e-4, deviation=1e-4, distance=0.3)
    compared = judged(answer(), pilot=told)
    assert compared.user.status == "found"
    np.testing.assert_array_equal(compared.user.covariance, answer().covariance)
    assert [check.agrees for check in compared.checks] == [True]


def test_within_a_cell_a_disagreement_widens_and_beyond_it_leaves_the_answer_open() -> None:
    for shift, status in ((0.4 * CELL, "found"), (1.1 * CELL, "ambiguous")):
        told = Lateness(shift=shift, deviation=shift / (2 * WIDENS), distance=0.3)
        user = judged(answer(), pilot=told).user
        assert user.status == status
        assert user.covariance is not None
        # In both coordinates of the plane, and in no other.
        np.testing.assert_allclose(np.diag(user.covariance), [shift**2 + 1e-8] * 2 + [0.0])


def test_a_late_echo_says_nothing_of_a_direct_path_and_moves_a_reflected_one_twice() -> None:
    told = Lateness(shift=1.5e-3, deviation=1e-4, distance=0.4)
    direct = judged(answer(), echo=told)
    assert direct.checks == ()
    over_one = judged(answer(mirrors=(0,)), echo=told).user
    assert over_one.covariance is not None
    # A wall that is δ too far moves the image behind it by 2δ at most.
    assert over_one.covariance[0, 0] == pytest.approx(1e-8 + (2 * 1.5e-3) ** 2)
    assert over_one.status == "found"  # within the echo's cell c/2B of 2 mm
    far = Lateness(shift=15e-3, deviation=4e-4, distance=0.4)
    opened = judged(answer(mirrors=(0,)), echo=far).user
    assert opened.status == "ambiguous"
    assert opened.reason is not None
    assert "a cable of 0.1 ± 0.003 ns" in opened.reason


def test_elements_off_the_arrays_plane_are_farther_away_by_pythagoras() -> None:
    raised = pilot((0.1, 0.2), stated=elements() + np.array([0.0, 0.0, 0.1]))
    error = height_error(raised, 0.2)
    assert error == pytest.approx(np.sqrt(0.2**2 + 0.1**2) - 0.2)
    user = judged(answer(), height=error).user
    assert user.status == "ambiguous"
    assert user.reason is not None
    assert "off the plane" in user.reason


def test_latenesses_that_disagree_are_known_no_better_than_they_differ() -> None:
    pair = [Lateness(shift=x, deviation=1e-4, distance=0.3) for x in (0.0, 2e-3)]
    both = combined(pair)
    assert both is not None
    # Birge's ratio: χ² = 2·(1e-3/1e-4)² for one degree of freedom, over 2 weights.
    assert both.deviation == pytest.approx(1e-3)
    assert both.shift == pytest.approx(1e-3)
    assert combined([]) is None


def test_one_recording_mapped_as_echo_and_as_pilot_is_refused() -> None:
    uplink = pilot((0.1, 0.2))
    echo = Echo(samples=uplink.samples, positions=uplink.positions, frequencies=BAND)
    with pytest.raises(MeasurementError, match=r"hold the same samples \(correlation 1.000"):
        refuse_same_samples(echo, uplink)
    refuse_same_samples(echo, pilot((-0.1, 0.25)))  # another wave: no error
