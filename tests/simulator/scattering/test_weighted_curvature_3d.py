"""Rough facets in space against small perturbations, the tangent plane, and each other."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jaxtyping import Float

from scenes.realisations.object_surface import Surface
from scenes.surfaces.height_synthesis import rough_sheet
from scenes.surfaces.shape import grid_triangles
from simulator.antennas.antenna_pattern import ISOTROPIC
from simulator.antennas.links import Links
from simulator.antennas.polarization import VERTICAL, Polarization, field_vector
from simulator.antennas.ports import Ports, isotropic
from simulator.geometry.facets import Facets, surface_facets
from simulator.materials.facet_reflection import Legs, conductor_mirror
from simulator.materials.fresnel_slab import Conductor, Dielectric, Material
from simulator.materials.permittivity import ConstantPermittivity
from simulator.scattering import physical_optics
from simulator.scattering.bistatic_kernel import BistaticKernel, Port
from simulator.scattering.patch_sum import scattered_by_patches
from simulator.scattering.physical_optics import scattered
from simulator.scattering.weighted_curvature_3d import (
    ConductorKernel,
    DielectricKernel,
    curvature_weight,
)
from simulator.visibility.seen import Seen

PERMITTIVITY = 2.56 - 0.1j
UP = np.array([0.0, 0.0, 1.0])
BAND = np.linspace(228e9, 232e9, 6)
MATERIALS: list[Material] = [
    Conductor(),
    Dielectric(permittivity=ConstantPermittivity(value=PERMITTIVITY), thickness=np.inf),
]


def random_legs(rng: np.random.Generator) -> Legs:
    """Two directions above the plane, and a field across each."""
    parts = []
    for _ in range(2):
        direction = rng.standard_normal(3)
        direction[2] = abs(direction[2]) + 0.1
        direction /= np.linalg.norm(direction)
        parts += [direction, np.array(field_vector(direction, rng.standard_normal(3)))]
    return Legs(parts[0], parts[2], parts[1], parts[3])


def kernel(legs: Legs, permittivity: complex | None) -> ConductorKernel | DielectricKernel:
    return ConductorKernel(legs) if permittivity is None else DielectricKernel(legs, permittivity)


def tangent(legs: Legs, permittivity: complex | None) -> complex:
    """K by the Fresnel coefficients, with vectors written out."""
    both = legs.transmit + legs.receive
    half = float(both @ both) / 2
    if permittivity is None:
        return half * complex(conductor_mirror(legs))
    cosine = np.sqrt(half / 2)
    inner = np.sqrt(permittivity - 1 + cosine**2)
    te = (cosine - inner) / (cosine + inner)
    tm = (permittivity * cosine - inner) / (permittivity * cosine + inner)
    across = np.cross(legs.receive, legs.transmit)
    across /= max(float(np.linalg.norm(across)), 1e-30)
    share = float(legs.received @ across) * float(legs.sent @ across)
    return complex(half * (te * share + tm * (float(conductor_mirror(legs)) + share)))


@pytest.mark.parametrize("degrees", [20.0, 30.0, 45.0, 60.0, 70.0])
@pytest.mark.parametrize("permittivity", [None, PERMITTIVITY, 6.0 - 1.0j])
def test_towards_where_it_came_from_the_sum_is_rices_first_order(
    degrees: float, permittivity: complex | None
) -> None:
    # Backscatter of S. O. Rice, Commun. Pure Appl. Math. 4 (1951) 351, in the form that textbooks
    # of remote sensing print: twice cos² of the angle times the polarization amplitude.
    angle = np.radians(degrees)
    cosine, sine2 = np.cos(angle), np.sin(angle) ** 2
    there = np.array([np.sin(angle), 0.0, cosine])
    fields = {"h": np.array([0.0, 1.0, 0.0]), "v": np.array([-cosine, 0.0, np.sin(angle)])}
    for name, field in fields.items():
        legs = Legs(there, there, field, field)
        found = tangent(legs, permittivity) + kernel(legs, permittivity)(UP)
        if permittivity is None:
            expected: complex = -2 * cosine**2 if name == "h" else -2 * (1 + sine2)
        else:
            inner = np.sqrt(permittivity - sine2)
            if name == "h":
                alpha = (cosine - inner) / (cosine + inner)
            else:
                alpha = (permittivity - 1) * (sine2 - permittivity * (1 + sine2))
                alpha /= (permittivity * cosine + inner) ** 2
            expected = 2 * cosine**2 * alpha
        assert found == pytest.approx(expected, rel=1e-12)


@settings(deadline=None, max_examples=50)
@given(seed=st.integers(0, 10_000), dielectric=st.booleans())
def test_b_is_k_where_the_surface_mirrors_one_antenna_into_the_other(
    seed: int, dielectric: bool
) -> None:
    rng = np.random.default_rng(seed)
    legs = random_legs(rng)
    of = kernel(legs, PERMITTIVITY if dielectric else None)
    mirror = legs.transmit + legs.receive
    mirror /= np.linalg.norm(mirror)
    aside = np.cross(mirror, rng.standard_normal(3))
    values = [
        abs(complex(of((mirror + step * aside) / np.linalg.norm(mirror + step * aside))))
        for step in (0.0, 1e-3, 2e-3)
    ]
    assert values[0] < 1e-13
    assert values[2] == pytest.approx(4 * values[1], rel=0.05, abs=1e-9)  # to second order


@settings(deadline=None, max_examples=50)
@given(seed=st.integers(0, 10_000), dielectric=st.booleans())
def test_the_added_weight_is_b_minus_k_to_first_order_and_nothing_for_a_mirror(
    seed: int, dielectric: bool
) -> None:
    rng = np.random.default_rng(seed)
    legs = random_legs(rng)
    of = kernel(legs, PERMITTIVITY if dielectric else None)
    both = legs.transmit + legs.receive
    lateral = both - both[2] * UP
    assert curvature_weight(of, legs, UP, np.zeros(3), 1.0) == pytest.approx(0.0, abs=1e-12)
    mirroring = -lateral / both[2]
    assert curvature_weight(of, legs, UP, mirroring, 1.0) == pytest.approx(0.0, abs=1e-12)
    # A wave of heights has slopes along q; by parts, -2 (B - K) (q·∇h)/q² is 2jk (B - K) h.
    small = 1e-6 * lateral
    found = curvature_weight(of, legs, UP, small, 1.0) / 1e-6
    assert found == pytest.approx(-2 * complex(of(UP)), rel=1e-4, abs=1e-5)


@settings(deadline=None, max_examples=50)
@given(seed=st.integers(0, 10_000), dielectric=st.booleans())
def test_both_ends_count_alike(seed: int, dielectric: bool) -> None:
    rng = np.random.default_rng(seed)
    legs = random_legs(rng)
    swapped = Legs(legs.receive, legs.transmit, legs.received, legs.sent)
    slope = np.array([*rng.uniform(-0.3, 0.3, 2), 0.0])
    permittivity = PERMITTIVITY if dielectric else None
    there = curvature_weight(kernel(legs, permittivity), legs, UP, slope, 0.7)
    back = curvature_weight(kernel(swapped, permittivity), swapped, UP, slope, 0.7)
    assert there == pytest.approx(back, rel=1e-12)


@pytest.mark.parametrize("permittivity", [None, PERMITTIVITY])
def test_in_the_plane_of_incidence_nothing_is_cross_polar_to_first_order(
    permittivity: complex | None,
) -> None:
    for one, other in ((0.4, -0.9), (0.7, 0.7), (1.1, 0.2)):
        ways = [np.array([np.sin(a), 0.0, np.cos(a)]) for a in (one, other)]
        across, within = np.array([0.0, 1.0, 0.0]), np.array([-np.cos(other), 0.0, np.sin(other)])
        legs = Legs(ways[0], ways[1], across, within)
        assert tangent(legs, permittivity) == pytest.approx(0.0, abs=1e-14)
        assert kernel(legs, permittivity)(UP) == pytest.approx(0.0, abs=1e-14)


def rough_plate() -> Surface:
    """A plate of 10 x 8 mm, 0.05 mm rms and 0.4 mm long, facing +z."""
    counts = (101, 81)
    heights = rough_sheet(
        lengths=(0.01, 0.008), counts=counts, rms=5e-5, correlation_length=4e-4,
        spectrum="gaussian", inner_cutoff=0.0, rng=np.random.default_rng(4),
    )  # fmt: skip
    x, y = np.meshgrid(*(1e-4 * (np.arange(n) - n // 2) for n in counts), indexing="ij")
    mean = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=-1)
    return Surface(
        name="plate", material="metal", vertices=mean + heights.ravel()[:, None] * UP,
        mean_vertices=mean, cells=grid_triangles(np.arange(x.size).reshape(x.shape)), closed=False,
    )  # fmt: skip


PLACES = np.array([[0.12, 0.03, 0.2], [0.121, 0.03, 0.2], [0.12, 0.031, 0.201]])
APART = np.array([[-0.05, 0.1, 0.25]] * 3)
SLANTED = Polarization(axis=np.array([0.3, 1.0, 0.2]) / np.sqrt(1.13), cross_polar=0.1)


def everything(some: np.ndarray) -> Seen:
    return Seen(
        always=np.ones(len(some), dtype=bool),
        sometimes=np.empty(0, dtype=np.int64),
        table=np.empty((0, 3), dtype=bool),
    )


def ports(places: Float[np.ndarray, "n 3"], facets: Facets, polarization: Polarization) -> Ports:
    seen = np.ones((len(places), facets.count), dtype=bool)
    return Ports(positions=places, pattern=isotropic, visible=seen, polarization=polarization)


@pytest.mark.parametrize("material", MATERIALS, ids=["metal", "dielectric"])
def test_all_kernels_weigh_rough_facets_as_numpy_does(
    material: Material, monkeypatch: pytest.MonkeyPatch
) -> None:
    surface = rough_plate()
    facets = surface_facets(surface, material)
    own = ports(PLACES, facets, SLANTED)
    sent, received = (replace(ISOTROPIC, polarization=p) for p in (VERTICAL, SLANTED))
    for transmit in (own, ports(APART, facets, VERTICAL)):
        monkeypatch.setattr(physical_optics, "FEWEST_FOR_KERNEL", 10**12)
        exact = scattered(facets, transmit, own, BAND, waves="spherical")
        norm = np.linalg.norm(exact)
        monkeypatch.setattr(physical_optics, "FEWEST_FOR_KERNEL", 1)
        by_kernel = scattered(facets, transmit, own, BAND, waves="spherical")
        # Single precision, and what three nodes leave of a facet: as without roughness.
        assert np.linalg.norm(by_kernel - exact) <= 1e-4 * norm
        echo = transmit is own
        links = Links(
            senders=PLACES if echo else APART,
            receivers=PLACES,
            sent=received if echo else sent,
            received=received,
        )
        by_patches = scattered_by_patches(facets, links, everything, BAND)
        assert np.linalg.norm(by_patches - exact) <= 2e-4 * norm
        if not echo:
            ends = [
                Port(position=place, aim=UP, pattern=None, polarization=p)
                for place, p in ((APART[0], VERTICAL), (PLACES[0], SLANTED))
            ]
            found = BistaticKernel(surface, material, BAND).link(ends[0], ends[1])
            assert np.linalg.norm(found - exact[0]) <= 1e-4 * np.linalg.norm(exact[0])


def test_roughness_of_one_sign_of_height_keeps_a_link_reciprocal() -> None:
    surface = rough_plate()
    for material in MATERIALS:
        facets = surface_facets(surface, material, wavelength=1.3e-3)
        one, other = ports(PLACES[:1], facets, SLANTED), ports(APART[:1], facets, VERTICAL)
        there = scattered(facets, one, other, BAND, waves="spherical")
        back = scattered(facets, other, one, BAND, waves="spherical")
        assert np.linalg.norm(there - back) <= 1e-6 * np.linalg.norm(there)
