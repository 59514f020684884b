"""The kernel for millions of triangles against the same sums in NumPy and taken directly."""

from typing import Any

import numpy as np
import pytest
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from scenes.realisations.object_surface import Surface
from scenes.surfaces.height_synthesis import rough_sheet
from scenes.surfaces.shape import grid_triangles
from simulator.antennas.ports import Pattern, Ports, isotropic
from simulator.geometry.facets import Facets, joined, surface_facets
from simulator.materials.fresnel_slab import Conductor, Dielectric, Material
from simulator.materials.permittivity import ConstantPermittivity
from simulator.scattering import physical_optics
from simulator.scattering.physical_optics import facet_transform, scattered

BAND = np.linspace(220e9, 295e9, 101)
PANE = Dielectric(permittivity=ConstantPermittivity(value=2.5 - 0.05j), thickness=1.5e-3)
ELEMENTS = np.array([[-0.05, -0.02, 0.01], [0.0, 0.0, 0.0], [0.06, 0.01, -0.02]])

ACCURACY = 1e-4
"""What is asked of the kernel's sums, relative; single precision and few nodes. [-]"""


def plate(
    material: Material | None = None, *, y: float = 0.3, turned: float = 0.5, closed: bool = False
) -> Facets:
    """A rough plate of 3200 triangles, turned about z."""
    side, count = 10e-3, 41
    axis = np.linspace(-side / 2, side / 2, count)
    x, z = np.meshgrid(axis, axis, indexing="ij")
    height = rough_sheet(
        lengths=(side, side), counts=(count, count), rms=0.1e-3, correlation_length=1e-3,
        spectrum="gaussian", inner_cutoff=0.0, rng=np.random.default_rng(3),
    ).ravel()  # fmt: skip
    cosine, sine = np.cos(turned), np.sin(turned)
    vertices = np.stack(
        [cosine * x.ravel() + sine * height, sine * x.ravel() - cosine * height + y, z.ravel()],
        axis=-1,
    )
    made = Surface(
        name="plate", material="metal", vertices=vertices, mean_vertices=vertices,
        cells=grid_triangles(np.arange(x.size).reshape(x.shape)), closed=closed,
    )  # fmt: skip
    return surface_facets(made, material)


def beam(
    directions: Float[np.ndarray, "facets 3"],
    distances: Float[np.ndarray, " facets"],
    frequencies: Float[np.ndarray, " nodes"],
) -> Float[np.ndarray, "1 facets"]:
    return np.asarray(np.exp(-30 * (1 - directions[:, 1]))[None])


def ports(
    facets: Facets, positions: Float[np.ndarray, "ports 3"] = ELEMENTS,
    pattern: Pattern = isotropic, nodes: int = 1,
) -> Ports:  # fmt: skip
    rng = np.random.default_rng(7)
    visible = rng.random((len(positions), facets.count)) < 0.8
    return Ports(positions=positions, pattern=pattern, visible=visible, nodes=nodes)


def both(
    monkeypatch: pytest.MonkeyPatch, facets: Facets, transmit: Ports, receive: Ports
) -> tuple[Complex[np.ndarray, "links freqs"], Complex[np.ndarray, "links freqs"]]:
    found = []
    for fewest in (10**12, 1):
        monkeypatch.setattr(physical_optics, "FEWEST_FOR_KERNEL", fewest)
        found.append(scattered(facets, transmit, receive, BAND, waves="spherical"))
    return found[0], found[1]


@pytest.mark.parametrize("pattern", [isotropic, beam])
@pytest.mark.parametrize("closed", [False, True])
def test_echoes_of_the_kernel_are_those_of_numpy(
    monkeypatch: pytest.MonkeyPatch, pattern: Any, closed: bool
) -> None:
    facets = plate(closed=closed)
    array = ports(facets, pattern=pattern)
    slow, fast = both(monkeypatch, facets, array, array)
    assert np.linalg.norm(slow) > 0
    assert 0 < np.linalg.norm(fast - slow) <= ACCURACY * np.linalg.norm(slow)


@pytest.mark.parametrize("single", [True, False])
def test_links_of_the_kernel_are_those_of_numpy(
    monkeypatch: pytest.MonkeyPatch, single: bool
) -> None:
    facets = plate()
    user = np.array([[0.2, 0.1, 0.15]]) if single else ELEMENTS + np.array([0.2, 0.1, 0.15])
    slow, fast = both(monkeypatch, facets, ports(facets, user, beam), ports(facets))
    assert np.linalg.norm(slow) > 0
    assert 0 < np.linalg.norm(fast - slow) <= ACCURACY * np.linalg.norm(slow)


def test_a_dielectric_beside_a_conductor_echoes_in_the_kernel_as_in_numpy(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    facets = joined([plate(PANE), plate(Conductor(), y=0.32)])
    array = ports(facets)
    slow, fast = both(monkeypatch, facets, array, array)
    assert 0 < np.linalg.norm(fast - slow) <= ACCURACY * np.linalg.norm(slow)


def test_what_varies_over_the_band_is_left_to_numpy(monkeypatch: pytest.MonkeyPatch) -> None:
    slab, wall = plate(PANE), plate()
    for facets, receive in ((slab, ports(slab)), (wall, ports(wall, nodes=2))):
        slow, same = both(monkeypatch, facets, ports(facets, ELEMENTS[::-1]), receive)
        np.testing.assert_array_equal(slow, same)


def test_the_kernels_echo_is_the_direct_sum(monkeypatch: pytest.MonkeyPatch) -> None:
    facets = plate()
    array = ports(facets)
    fast = both(monkeypatch, facets, array, array)[1]
    wavenumbers = 2 * np.pi * BAND / speed_of_light
    for position, seen, spectrum in zip(array.positions, array.visible, fast, strict=True):
        towards = position - facets.centres
        distance = np.linalg.norm(towards, axis=-1)
        unit = towards / distance[:, None]
        amplitude = np.abs(np.einsum("fx,fx->f", unit, facets.normals)) * facets.sizes * seen
        slopes = 2 * np.einsum("fx,fsx->fs", unit, facets.edges)
        shape = facet_transform(wavenumbers[:, None, None] * slopes)
        terms = amplitude / distance**2 * shape * np.exp(-2j * wavenumbers[:, None] * distance)
        expected = -1j / (4 * np.pi) * terms.sum(axis=-1)
        assert np.linalg.norm(spectrum - expected) <= ACCURACY * np.linalg.norm(expected)


def test_each_link_is_told_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(physical_optics, "FEWEST_FOR_KERNEL", 1)
    facets = joined([plate(PANE), plate(Conductor(), y=0.32)])
    array = ports(facets, np.repeat(ELEMENTS, 4, axis=0) + 1e-3 * np.arange(12)[:, None])
    done: list[int] = []
    scattered(facets, array, array, BAND, waves="spherical", advance=lambda: done.append(1))
    assert len(done) == 12


def test_the_kernel_repeats_its_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    facets = plate()
    array = ports(facets)
    first, second = (both(monkeypatch, facets, array, array)[1] for _ in range(2))
    assert first.tobytes() == second.tobytes()
