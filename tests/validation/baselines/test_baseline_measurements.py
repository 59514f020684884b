import numpy as np
import pytest
from jaxtyping import Complex, Float

from validation.analytic.point_scatterer import complex_noise, point_uplink
from validation.baselines.angle_difference import from_differences
from validation.baselines.arrivals import (
    first_arrival,
    first_sparse_arrival,
    plane_wave_angle,
    strength_db,
)
from validation.baselines.fingerprinting import nearest
from validation.baselines.multiband_toa import in_channels
from validation.baselines.multilateration import multilaterate
from validation.baselines.room import ANCHORS
from validation.baselines.rssi_ranging import path_loss
from validation.baselines.scatterer_paths import BouncePath, departure, intersect, user_array

FREQUENCIES = np.linspace(220e9, 295e9, 501)
CELL = 299792458 / 75e9
PLACES = np.stack([anchor.position for anchor in ANCHORS])

USERS = [np.array([0.2, 0.4]), np.array([0.9, 1.3])]


def pulses(*paths: tuple[float, float]) -> Complex[np.ndarray, " freqs"]:
    """Sum paths of (length [m], amplitude)."""
    waves = [
        amplitude * np.exp(-2j * np.pi * FREQUENCIES * length / 299792458)
        for length, amplitude in paths
    ]
    return np.asarray(np.sum(waves, axis=0))


@pytest.mark.parametrize("place", USERS)
def test_exact_distances_give_the_place(place: Float[np.ndarray, " 2"]) -> None:
    distances = np.linalg.norm(place - PLACES, axis=-1)
    for relative in (False, True):
        found = multilaterate(PLACES, distances, relative=relative)
        np.testing.assert_allclose(found, place, atol=1e-6)  # the solver's tolerance, 1e-12 of cost
    late = multilaterate(PLACES, distances + 0.7, clock_known=False)
    # Compact receivers: the flat hyperbolas lose three digits of range.
    np.testing.assert_allclose(late, place, atol=1e-4)


def test_a_first_path_counts_before_a_stronger_one() -> None:
    both = pulses((0.500, 0.5), (0.800, 1.0))
    # The other path's sidelobes, -31 dB below Hann's window and falling, shift it by little.
    assert first_arrival(both, FREQUENCIES) == pytest.approx(0.500, abs=CELL / 100)
    weak = pulses((0.500, 0.05), (0.800, 1.0))
    assert first_arrival(weak, FREQUENCIES) == pytest.approx(0.800, abs=CELL / 100)


def test_a_comb_of_channels_tells_the_first_path_nevertheless() -> None:
    chosen = in_channels(FREQUENCIES)
    assert 0.15 < chosen.mean() < 0.25  # eight channels of 2 GHz of 75 GHz
    both = pulses((0.500, 0.5), (0.800, 1.0))[chosen]
    found = first_sparse_arrival(both, FREQUENCIES[chosen])
    assert found == pytest.approx(0.500, abs=CELL / 20)


def test_noise_alone_arrives_never() -> None:
    noise = complex_noise((501,), 1.0, np.random.default_rng(5))
    assert first_arrival(noise, FREQUENCIES) is None
    chosen = in_channels(FREQUENCIES)
    assert first_sparse_arrival(noise[chosen], FREQUENCIES[chosen]) is None


def test_a_distant_source_has_the_angle_of_its_plane_wave() -> None:
    positions = np.zeros((16, 3))
    positions[:, 0] = (np.arange(16) - 7.5) * 0.5e-3
    source = 50.0 * np.array([[np.cos(1.1), np.sin(1.1), 0.0]])
    pilot = point_uplink(source, positions=positions, frequencies=FREQUENCIES[::50])
    assert plane_wave_angle(pilot) == pytest.approx(1.1, abs=1e-5)
    twice = point_uplink(2 * source, positions=positions, frequencies=FREQUENCIES[::50])
    # Friis: 6.02 dB for twice the distance.
    assert strength_db(pilot) - strength_db(twice) == pytest.approx(6.0206, abs=1e-3)


def test_free_space_loses_twenty_decibels_a_decade() -> None:
    distances = np.array([0.2, 0.5, 1.0, 2.0])
    slope, level = path_loss(distances, -40.0 - 20 * np.log10(distances))
    assert (slope, level) == pytest.approx((-20.0, -40.0))


def test_a_surveyed_place_is_its_own_nearest() -> None:
    places = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [2.0, 2.0]])
    prints = places @ np.array([[3.0, 1.0], [0.0, 2.0]])
    np.testing.assert_allclose(nearest(places, prints, prints[1]), places[1], atol=1e-6)


@pytest.mark.parametrize(("place", "turn"), [(USERS[0], 0.4), (USERS[1], -0.3)])
def test_differences_of_angles_give_the_place_whatever_the_orientation(
    place: Float[np.ndarray, " 2"], turn: float
) -> None:
    towards = PLACES - place
    angles = np.arctan2(towards[:, 1], towards[:, 0]) + turn
    np.testing.assert_allclose(from_differences(PLACES, angles), place, atol=1e-5)


def bounced(user: Float[np.ndarray, " 2"], at: Float[np.ndarray, " 2"]) -> BouncePath:
    """Go from the user by a place to a station at the origin."""
    leg = float(np.linalg.norm(at - user))
    return BouncePath(
        arrives_from=at / np.linalg.norm(at),
        leaves_to=(at - user) / leg,
        length=float(np.linalg.norm(at)) + leg,
    )


def test_two_bounced_paths_or_a_direct_one_fix_the_user() -> None:
    user, station = np.array([0.6, 0.7]), np.zeros(2)
    paths = [bounced(user, np.array([-0.1, 0.8])), bounced(user, np.array([0.9, 0.2]))]
    by_bounces = intersect(station, paths).position
    assert by_bounces is not None
    np.testing.assert_allclose(by_bounces, user, atol=1e-12)
    reach = float(np.linalg.norm(user))
    direct = BouncePath(arrives_from=user / reach, leaves_to=-user / reach, length=reach)
    by_sight = intersect(station, [direct, *paths]).position
    assert by_sight is not None
    np.testing.assert_allclose(by_sight, user, atol=1e-12)


def test_one_bounced_path_or_parallel_ones_leave_a_line() -> None:
    user = np.array([0.6, 0.7])
    one = bounced(user, np.array([-0.1, 0.8]))
    alone = intersect(np.zeros(2), [one])
    assert alone.position is None
    assert alone.reason is not None
    assert "line of places" in alone.reason
    twice = intersect(np.zeros(2), [one, one])
    assert twice.position is None
    assert twice.reason is not None
    assert "parallel" in twice.reason


@pytest.mark.parametrize("angle", [0.3, 2.5, 4.0])
def test_the_users_array_tells_where_a_path_leaves(angle: float) -> None:
    offsets = user_array()
    towards = np.array([np.cos(angle), np.sin(angle)])
    gains = np.exp(2j * np.pi * 257.5e9 / 299792458 * (offsets @ towards))
    found = departure(gains, offsets, 257.5e9)
    assert np.degrees(np.arccos(min(1.0, float(found @ towards)))) < 0.03  # a grid of 0.05°
