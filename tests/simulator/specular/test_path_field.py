from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.constants import speed_of_light
from scipy.spatial.transform import Rotation
from scipy.special import hankel2

from simulator.antennas.polarization import Polarization
from simulator.geometry.mirrors import Mirrors
from simulator.materials import fresnel_slab
from simulator.materials.fresnel_slab import Absorber, Conductor, Dielectric, Material
from simulator.materials.permittivity import ConstantPermittivity
from simulator.specular import path_field
from simulator.specular.free_space import direct_wave
from simulator.specular.image_method import find_chains
from simulator.specular.path_field import reflected_field, specular_response

FREQUENCIES = np.linspace(220e9, 330e9, 101)
WAVENUMBERS = 2 * np.pi * FREQUENCIES / speed_of_light
GYPSUM = Dielectric(permittivity=ConstantPermittivity(value=2.56 - 0.05j), thickness=3e-3)


def clear_air(starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    return np.zeros(len(starts), dtype=bool)


def plane(normal: list[float], material: Material, *, rms: float = 0.0) -> Mirrors:
    """A square of 20 m through the origin."""
    unit = np.array(normal) / np.linalg.norm(normal)
    first = np.cross(unit, np.eye(3)[np.argmin(np.abs(unit))])
    first /= np.linalg.norm(first)
    second = np.cross(unit, first)
    square = 10 * np.array([-first - second, first - second, first + second, second - first])
    return join([(square, material, rms)])


def join(parts: list[tuple[np.ndarray, Material, float]]) -> Mirrors:
    return Mirrors(
        corners=np.array([corners for corners, _, _ in parts]),
        materials=tuple(material for _, material, _ in parts),
        rms_heights=np.array([rms for _, _, rms in parts]),
        two_sided=np.ones(len(parts), dtype=bool),
    )


def along(axis: Any) -> dict[str, Any]:
    """Both antennas polarized along one axis."""
    both = Polarization(axis=np.array(axis))
    return {"sent": both, "received": both}


def reflected(
    mirrors: Mirrors, source: list[float], receiver: list[float], **options: Any
) -> np.ndarray:
    """The field over the single path of one bounce, over frequency."""
    ends = np.array([source]), np.array([receiver])
    (chain,) = find_chains(mirrors, *ends, blocked=clear_air, min_bounces=1, max_bounces=1)
    field: np.ndarray = reflected_field(mirrors, chain, FREQUENCIES, **options)[0]
    return field


def test_a_free_space_link_is_the_wavelength_over_four_pi_times_the_distance() -> None:
    link = direct_wave(np.array([1.8]), FREQUENCIES, waves="spherical")[0]
    wavelengths = speed_of_light / FREQUENCIES
    np.testing.assert_allclose(np.abs(link), wavelengths / (4 * np.pi * 1.8), rtol=1e-14)
    delays = np.angle(link * np.exp(1j * WAVENUMBERS * 1.8))
    np.testing.assert_allclose(delays, 0, atol=1e-11)  # 1e4 rad at double precision


def test_a_cylindrical_wave_is_the_far_field_of_a_line_source() -> None:
    link = direct_wave(np.array([0.7]), FREQUENCIES, waves="cylindrical")[0]
    # The next term of the Hankel function is 1 / (8 k L).
    np.testing.assert_allclose(
        link, -0.25j * hankel2(0, 0.7 * WAVENUMBERS), rtol=1 / (8 * 0.7 * WAVENUMBERS[0]) * 1.01
    )


def test_a_conducting_wall_turns_a_vertical_field_round() -> None:
    wall = plane([0.0, 1.0, 0.0], Conductor())
    field = reflected(wall, [-0.5, 0.8, 0.0], [0.9, 0.3, 0.0])
    np.testing.assert_allclose(field, -1, rtol=1e-14)


def test_a_wall_reflects_a_vertical_field_as_te_at_every_frequency() -> None:
    wall = plane([0.0, 1.0, 0.0], GYPSUM)
    field = reflected(wall, [-0.5, 0.5, 0.0], [0.5, 0.5, 0.0])
    te, _ = fresnel_slab.reflection(GYPSUM, FREQUENCIES, np.array([np.cos(np.pi / 4)]))
    np.testing.assert_allclose(field, te[0], rtol=1e-12)
    assert np.ptp(np.abs(field)) > 0.05  # the slab's ripple is in it


def test_a_floor_reflects_a_vertical_field_as_tm() -> None:
    floor = plane([0.0, 0.0, 1.0], GYPSUM)
    field = reflected(floor, [-1.0, 0.0, 0.5], [1.0, 0.0, 0.5])
    _, tm = fresnel_slab.reflection(GYPSUM, FREQUENCIES, np.array([1 / np.sqrt(5)]))
    np.testing.assert_allclose(field, tm[0], rtol=1e-12)


def test_nothing_vertical_leaves_a_floor_at_brewsters_angle() -> None:
    lossless = Dielectric(permittivity=ConstantPermittivity(value=4.0 + 0j), thickness=np.inf)
    field = reflected(plane([0.0, 0.0, 1.0], lossless), [-1.0, 0.0, 0.5], [1.0, 0.0, 0.5])
    np.testing.assert_allclose(field, 0, atol=1e-14)  # tan(angle) = 2 = index


def test_the_image_of_a_vertical_dipole_over_a_conducting_floor_is_in_phase() -> None:
    floor = plane([0.0, 0.0, 1.0], Conductor())
    field = reflected(floor, [-1.0, 0.0, 0.5], [1.0, 0.0, 0.5])
    np.testing.assert_allclose(field, 1, rtol=1e-14)


def test_an_absorbing_wall_ends_the_path() -> None:
    wall = plane([0.0, 1.0, 0.0], Absorber())
    np.testing.assert_array_equal(reflected(wall, [-0.5, 0.8, 0.0], [0.9, 0.3, 0.0]), 0)


def test_normal_incidence_turns_every_polarization_round() -> None:
    wall = plane([1.0, 1.0, 0.0], Conductor())
    for polarization in ([0.0, 0.0, 1.0], [1.0, -1.0, 0.3]):
        field = reflected(wall, [1.0, 1.0, 0.0], [1.5, 1.5, 0.0], **along(polarization))
        np.testing.assert_allclose(field, -1, rtol=1e-12)


def test_an_antenna_sends_nothing_along_its_axis() -> None:
    floor = plane([0.0, 0.0, 1.0], Conductor())
    np.testing.assert_array_equal(reflected(floor, [0.3, 0.2, 1.0], [0.3, 0.2, 2.0]), 0)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_conductors_reflect_fields_as_image_theory_says(seed: int) -> None:
    # Over a conductor the image of a current is turned about the plane: E' = -(E - 2 (E n) n).
    rng = np.random.default_rng(seed)
    planes = [plane(rng.standard_normal(3).tolist(), Conductor()).corners[0] for _ in range(3)]
    mirrors = join([(corners, Conductor(), 0.0) for corners in planes])
    points = rng.uniform(-2, 2, (6, 3))
    polarization = rng.standard_normal(3)
    for chain in find_chains(mirrors, points[:3], points[3:], blocked=clear_air):
        field = Polarization(axis=polarization).field(chain.directions[:, 0])
        for mirror in chain.mirrors:
            field = -mirrors.turned(field, mirror)
        received = Polarization(axis=polarization).field(chain.directions[:, -1])
        expected = np.sum(field * received, axis=1)
        found = reflected_field(mirrors, chain, FREQUENCIES[:1], **along(polarization))
        np.testing.assert_allclose(found[:, 0], expected, atol=1e-13)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_exchanging_transmitter_and_receiver_changes_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    parts: list[tuple[np.ndarray, Material, float]] = []
    choices: list[tuple[float, Material]] = [(0.0, GYPSUM), (5e-5, GYPSUM), (2e-5, Conductor())]
    for rms, material in choices:
        corners = plane(rng.standard_normal(3).tolist(), material).corners[0]
        parts.append((corners, material, rms))
    mirrors = join(parts)
    here, there = rng.uniform(-2, 2, (2, 3)), rng.uniform(-2, 2, (3, 3))
    polarization = rng.standard_normal(3)

    def response(sources: np.ndarray, receivers: np.ndarray) -> np.ndarray:
        chains = find_chains(mirrors, sources, receivers, blocked=clear_air)
        shape = (len(sources), len(receivers))
        sent, received = along(polarization).values()
        return specular_response(mirrors, chains, FREQUENCIES, shape, sent=sent, received=received)

    forth, back = response(here, there), response(there, here)
    # Phases of 1e5 rad (10 m) keep 1e-11; the design asks for 1e-6.
    np.testing.assert_allclose(
        forth, back.transpose(1, 0, 2), atol=1e-9 * np.abs(forth).max(), rtol=0
    )


def test_turning_the_whole_scene_and_its_polarization_changes_nothing() -> None:
    rng = np.random.default_rng(3)
    turn = Rotation.random(rng=rng).as_matrix()
    wall = plane([0.2, 1.0, 0.3], GYPSUM)
    turned = join([(wall.corners[0] @ turn.T, GYPSUM, 0.0)])
    source, receiver = np.array([-0.5, 0.8, 0.1]), np.array([0.9, 0.7, -0.2])
    vertical = np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(
        reflected(turned, (turn @ source).tolist(), (turn @ receiver).tolist(),
                  **along(turn @ vertical)),
        reflected(wall, source.tolist(), receiver.tolist(), **along(vertical)),
        rtol=1e-10,
    )  # fmt: skip


def test_roughness_takes_its_coherent_loss_at_each_bounce() -> None:
    rms = 5e-5
    smooth, rough = (plane([0.0, 1.0, 0.0], GYPSUM, rms=value) for value in (0.0, rms))
    ends = [-0.5, 0.5, 0.0], [0.5, 0.5, 0.0]
    ratio = reflected(rough, *ends) / reflected(smooth, *ends)
    phase = WAVENUMBERS * rms * np.cos(np.pi / 4)
    np.testing.assert_allclose(ratio, np.exp(-2 * phase**2), rtol=1e-12)


def test_two_rays_over_a_floor_interfere() -> None:
    floor = plane([0.0, 0.0, 1.0], Conductor())
    ends = np.array([[0.0, 0.0, 0.5]]), np.array([[2.0, 0.0, 0.3]])
    chains = find_chains(floor, *ends, blocked=clear_air)
    response = specular_response(floor, chains, FREQUENCIES, (1, 1))[0, 0]
    direct, bounced = np.hypot(2.0, 0.2), np.hypot(2.0, 0.8)
    expected = sum(np.exp(-1j * WAVENUMBERS * r) / (2 * WAVENUMBERS * r) for r in (direct, bounced))
    np.testing.assert_allclose(response, expected, atol=1e-10 * np.abs(expected).max())


def test_patterns_weigh_paths_by_where_they_leave_and_arrive() -> None:
    wall = plane([0.0, 1.0, 0.0], Conductor())
    ends = np.array([[-1.0, 1.0, 0.0]]), np.array([[2.0, 2.0, 0.0]])
    chains = find_chains(wall, *ends, blocked=clear_air, min_bounces=1)
    plain = specular_response(wall, chains, FREQUENCIES, (1, 1))
    weighted = specular_response(
        wall,
        chains,
        FREQUENCIES,
        (1, 1),
        transmit=lambda directions: directions @ np.array([1.0, -1.0, 0.0]),
        receive=lambda directions: directions @ np.array([0.0, -1.0, 0.0]),
    )
    # Both legs at 45 degrees: leaving along (1, -1), seen from the receiver along (-1, -1).
    np.testing.assert_allclose(weighted, plain * np.sqrt(2) * np.sqrt(0.5), rtol=1e-12)


def test_links_without_a_path_stay_silent() -> None:
    wall = plane([0.0, 1.0, 0.0], Conductor())
    response = specular_response(wall, (), FREQUENCIES, (2, 3))
    np.testing.assert_array_equal(response, np.zeros((2, 3, 101)))


def test_summing_in_pieces_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    wall = plane([0.0, 1.0, 0.2], GYPSUM)
    points = np.random.default_rng(5).uniform([-1, 0.5, -1], [1, 2, 1], (12, 3))
    chains = find_chains(wall, points[:4], points[4:], blocked=clear_air)
    whole = specular_response(wall, chains, FREQUENCIES, (4, 8))
    monkeypatch.setattr(path_field, "SAMPLES_AT_ONCE", 1)
    np.testing.assert_array_equal(specular_response(wall, chains, FREQUENCIES, (4, 8)), whole)
