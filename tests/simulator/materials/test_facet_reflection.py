"""Fresnel coefficients of facets: half angles, vertical antennas, and their interpolation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jaxtyping import Float

from scenes.schema.materials import MATERIALS
from simulator.antennas.polarization import VERTICAL, Polarization
from simulator.materials import fresnel_slab
from simulator.materials.facet_reflection import (
    Legs,
    Shares,
    angle_class,
    echo_coefficient,
    facet_coefficients,
    half_angle_cosine,
    mirror_shares,
    reflection_nodes,
)
from simulator.materials.fresnel_slab import Conductor, Dielectric, named_material
from simulator.materials.permittivity import (
    ConstantPermittivity,
    MaterialError,
    TabulatedPermittivity,
)
from simulator.numerics.nufft_sum import ACCURACY, chebyshev_nodes, lagrange_basis

BAND = np.linspace(220e9, 330e9, 7)
PANE = Dielectric(permittivity=ConstantPermittivity(value=2.5 - 0.05j), thickness=1.5e-3)


def random_directions(rng: np.random.Generator, count: int) -> Float[np.ndarray, "n 3"]:
    vectors = rng.standard_normal((count, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


Fields = tuple[np.ndarray, np.ndarray]


def vertical(transmit: np.ndarray, receive: np.ndarray) -> Fields:
    return VERTICAL.field(-transmit), VERTICAL.field(-receive)


def vertical_shares(transmit: np.ndarray, receive: np.ndarray) -> Shares:
    sent, received = vertical(transmit, receive)
    return mirror_shares(Legs(transmit.T, receive.T, sent.T, received.T))


def test_scenarios_and_the_simulator_know_the_same_names() -> None:
    assert set(MATERIALS) == {"metal", "absorber", *fresnel_slab.THICKNESS}
    for name in set(MATERIALS) - {"chipboard"}:  # whose last row ends at 200 GHz
        named_material(name, BAND)


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10_000))
def test_at_the_specular_point_half_the_angle_between_the_legs_is_that_of_incidence(
    seed: int,
) -> None:
    rng = np.random.default_rng(seed)
    normal, transmit = random_directions(rng, 2)
    receive = 2 * (transmit @ normal) * normal - transmit
    cosine = half_angle_cosine(transmit[None], receive[None])[0]
    assert cosine == pytest.approx(abs(transmit @ normal), abs=1e-12)


def dyad_link(te: complex, tm: complex, transmit: np.ndarray, receive: np.ndarray) -> complex:
    """Vertical fields by explicit vectors: sent, split at the bisecting mirror, received."""
    up = np.array([0.0, 0.0, 1.0])
    inward, outward = -transmit, receive
    sent = up - (up @ inward) * inward
    heard = up - (up @ outward) * outward
    across = np.cross(inward, transmit + receive)
    across /= np.linalg.norm(across)
    split_in, split_out = np.cross(inward, across), np.cross(outward, across)
    link = te * (heard @ across) * (across @ sent) + tm * (heard @ split_out) * (split_in @ sent)
    return complex(link / np.linalg.norm(sent) / np.linalg.norm(heard))


@settings(deadline=None, max_examples=50)
@given(seed=st.integers(0, 10_000))
def test_a_vertical_link_is_split_at_the_bisecting_mirror(seed: int) -> None:
    rng = np.random.default_rng(seed)
    transmit, receive = random_directions(rng, 2)
    shares = vertical_shares(transmit[None], receive[None])
    te, tm = 0.3 - 0.2j, -0.7 + 0.1j
    link = shares.te[0] * te + shares.tm[0] * tm
    # Rounding, over the squared sine between the legs that both are divided by.
    tolerance = 1e-14 / max(1 - (transmit @ receive) ** 2, 1e-10)
    assert link == pytest.approx(dyad_link(te, tm, transmit, receive), abs=max(tolerance, 1e-12))


def test_in_the_horizontal_plane_all_of_it_is_te() -> None:
    angles = np.radians([10.0, 80.0, 170.0])
    transmit = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=-1)
    receive = np.array([[1.0, 0.0, 0.0]]).repeat(3, axis=0)
    shares = vertical_shares(transmit, receive)
    np.testing.assert_allclose(shares.te, 1.0, atol=1e-12)
    np.testing.assert_allclose(shares.tm, 0.0, atol=1e-12)


def test_a_conducting_floor_keeps_a_vertical_field_and_a_wall_turns_it_round() -> None:
    slope = np.sqrt(0.5)
    up, along = np.array([[slope, 0, slope]]), np.array([[-slope, 0, slope]])
    floor = facet_coefficients(Conductor(), up, along, BAND, fields=vertical(up, along))
    assert floor[0, 0] == pytest.approx(1.0, abs=1e-12)
    left, right = np.array([[slope, slope, 0]]), np.array([[-slope, slope, 0]])
    for fields in (None, vertical(left, right)):
        wall = facet_coefficients(Conductor(), left, right, BAND, fields=fields)
        assert wall[0, 0] == pytest.approx(-1.0, abs=1e-12)


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10_000))
def test_whatever_returns_to_where_it_came_from_is_turned_round(seed: int) -> None:
    directions = random_directions(np.random.default_rng(seed), 5)
    fields = vertical(directions, directions)
    values = facet_coefficients(Conductor(), directions, directions, BAND, fields=fields)
    np.testing.assert_allclose(values, -1.0, atol=1e-12)
    slab = facet_coefficients(PANE, directions, directions, BAND, fields=fields)
    np.testing.assert_allclose(slab, echo_coefficient(PANE, BAND)[:, None].repeat(5, 1), atol=1e-9)


def test_legs_that_are_almost_one_reflect_as_one() -> None:
    # 10 µm apart at 1 m and 10 cm: on both sides of where the split is no longer computed.
    base = np.array([0.3, -0.9, 0.2])
    for apart in (1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 1e-9):
        pair = np.stack([base, base + apart * np.array([0.5, 0.1, 0.7])])
        one, other = (pair / np.linalg.norm(pair, axis=-1, keepdims=True))[:, None]
        fields = vertical(one, other)
        value = facet_coefficients(Conductor(), one, other, BAND, fields=fields)[0, 0]
        # The field turns by the angle between the legs, which counts squared; and rounding.
        assert value == pytest.approx(-1.0, abs=2 * apart**2 + 1e-5)


def test_a_vertical_antenna_has_no_field_along_its_axis() -> None:
    up, aside = np.array([[0.0, 0.0, 1.0]]), np.array([[1.0, 0.0, 0.0]])
    for one, other in ((up, aside), (aside, up), (up, up)):
        shares = vertical_shares(one, other)
        assert (shares.te[0], shares.tm[0]) == (0.0, 0.0)


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10_000), flat=st.booleans())
def test_both_ends_count_alike(seed: int, flat: bool) -> None:
    rng = np.random.default_rng(seed)
    one, other = random_directions(rng, 60), random_directions(rng, 60)
    axes = random_directions(rng, 2)
    sent, received = (
        Polarization(axis=axis, cross_polar=cross).field(-ends)
        for axis, cross, ends in zip(axes, (0.1, 0.0), (one, other), strict=True)
    )
    for material in (Conductor(), PANE):
        there = facet_coefficients(
            material, one, other, BAND, fields=None if flat else (sent, received)
        )
        back = facet_coefficients(
            material, other, one, BAND, fields=None if flat else (received, sent)
        )
        np.testing.assert_allclose(there, back, atol=1e-12)


def test_many_angles_are_interpolated_to_the_accuracy_of_the_sum() -> None:
    angles = np.radians(np.linspace(20.0, 70.0, 2000))
    transmit = np.stack([np.sin(angles), np.cos(angles), 0 * angles], axis=-1)
    receive = transmit * [-1, 1, 1]
    values = facet_coefficients(PANE, transmit, receive, BAND, fields=None)
    exact = fresnel_slab.reflection(PANE, BAND, np.cos(angles)).te.T
    error = np.abs(values - exact).max()
    assert error <= 3 * ACCURACY  # it is tried out halfway between the nodes only
    assert error > 0  # it is not the same sum


SLABS = [
    Dielectric(permittivity=ConstantPermittivity(value=2.0 - 0.001j), thickness=0.1e-3),
    Dielectric(permittivity=ConstantPermittivity(value=2.0 - 0.001j), thickness=1e-3),
    named_material("drywall", BAND),
    named_material("glass", BAND),
]


@pytest.mark.parametrize("slab", SLABS)
def test_the_nodes_follow_a_slabs_ripple(slab: Dielectric) -> None:
    nodes = chebyshev_nodes(220e9, 330e9, reflection_nodes(slab, 220e9, 330e9))
    rng = np.random.default_rng(1)
    frequencies, cosines = rng.uniform(220e9, 330e9, 300), rng.uniform(0.1, 1.0, 40)
    basis = lagrange_basis(nodes, frequencies)
    sampled = fresnel_slab.reflection(slab, nodes, cosines)
    exact = fresnel_slab.reflection(slab, frequencies, cosines)
    for part, true in zip(sampled, exact, strict=True):
        # Angles between those that were tried add some.
        assert np.abs(part @ basis - true).max() <= 3 * ACCURACY


def test_the_longer_a_slab_delays_the_more_nodes_it_takes() -> None:
    counts = [reflection_nodes(slab, 220e9, 330e9) for slab in SLABS[:2]]
    assert 1 < counts[0] < counts[1]
    half_space = Dielectric(permittivity=ConstantPermittivity(value=2 - 0.1j), thickness=np.inf)
    assert reflection_nodes(half_space, 220e9, 330e9) == 1
    assert reflection_nodes(Conductor(), 220e9, 330e9) == 1


def test_links_are_sorted_by_their_most_grazing_angle() -> None:
    assert angle_class(np.array([0.9, 0.4, 0.7])) == 0.35
    assert angle_class(np.array([0.001])) == 0.02
    assert angle_class(np.zeros(0)) == 0.85
    # At grazing incidence a slab is an ever sharper resonator.
    counts = [reflection_nodes(SLABS[1], 220e9, 330e9, lowest=c) for c in (0.02, 0.1, 0.5, 0.85)]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] > counts[-1]


def test_a_tables_kinks_are_followed_as_well_as_they_can_be() -> None:
    table = TabulatedPermittivity(
        name="table", frequencies=np.array([2.0e11, 2.6e11, 3.4e11]),
        values=np.array([2.0 - 0.1j, 2.1 - 0.12j, 2.15 - 0.2j]),
    )  # fmt: skip
    opaque = Dielectric(permittivity=table, thickness=np.inf)
    assert reflection_nodes(opaque, 220e9, 330e9) == 192


def test_a_slab_that_ripples_too_fast_is_refused() -> None:
    thick = Dielectric(permittivity=ConstantPermittivity(value=2.0 - 1e-4j), thickness=0.1)
    with pytest.raises(MaterialError, match=r"ripples too fast over 220-330 GHz.*thinner"):
        reflection_nodes(thick, 220e9, 330e9)
