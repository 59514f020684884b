"""Sums patch by patch, at few frequencies and few places, against the full sums in NumPy."""

from typing import Any

import numpy as np
import pytest
from jaxtyping import Int

from scenes.realisations.object_surface import Surface
from scenes.schema.antenna import Antenna, Cosine, GaussianBeam, Horn, Isotropic
from scenes.surfaces.height_synthesis import rough_sheet
from scenes.surfaces.shape import grid_triangles
from simulator.antennas.antenna_pattern import AntennaPattern
from simulator.antennas.links import Links
from simulator.antennas.ports import Ports
from simulator.geometry.facets import Facets, joined, surface_facets
from simulator.materials.fresnel_slab import Conductor, Dielectric, Material
from simulator.materials.permittivity import ConstantPermittivity
from simulator.scattering.patch_sum import scattered_by_patches
from simulator.scattering.physical_optics import scattered
from simulator.visibility.seen import Seen

BAND = np.linspace(57e9, 64e9, 51)
PANE = Dielectric(permittivity=ConstantPermittivity(value=2.5 - 0.05j), thickness=6e-3)
AHEAD = np.array([0.0, 1.0, 0.0])

ACCURACY = 2e-4
"""Of sums, relative: single precision (1e-6), interpolation over band and array (3e-5 each axis
of every patch's own sum), and 1e-4 for a dielectric's coefficients. [-]"""

ARRAY = np.stack(
    np.meshgrid(5e-3 * np.arange(-4.0, 4.0), [0.0], 5e-3 * np.arange(-3.0, 3.0), indexing="ij"),
    axis=-1,
).reshape(-1, 3)  # fmt: skip


def plate(material: Material, *, y: float = 0.5, closed: bool = False) -> Facets:
    """A rough plate of 6 cm and 7200 triangles, turned by 25° about z."""
    side, count = 0.06, 61
    axis = np.linspace(-side / 2, side / 2, count)
    x, z = np.meshgrid(axis, axis, indexing="ij")
    height = rough_sheet(
        lengths=(side, side), counts=(count, count), rms=0.25e-3, correlation_length=4e-3,
        spectrum="gaussian", inner_cutoff=0.0, rng=np.random.default_rng(3),
    ).ravel()  # fmt: skip
    cosine, sine = np.cos(0.44), np.sin(0.44)
    vertices = np.stack(
        [cosine * x.ravel() + sine * height, sine * x.ravel() - cosine * height + y, z.ravel()],
        axis=-1,
    )
    made = Surface(
        name="plate", material="metal", vertices=vertices, mean_vertices=vertices,
        cells=grid_triangles(np.arange(x.size).reshape(x.shape)), closed=closed,
    )  # fmt: skip
    return surface_facets(made, material)


def antenna(kind: str, aim: Any = AHEAD) -> AntennaPattern:
    made: dict[str, Antenna] = {
        "horn": Horn(kind="horn", gain_dbi=15.0),
        "cosine": Cosine(kind="cosine", exponent=6.0),
        "beam": GaussianBeam(kind="gaussian_beam", sigma_rad=0.3),
        "isotropic": Isotropic(),
    }
    return AntennaPattern(made[kind], np.asarray(aim) / np.linalg.norm(aim))


def everything(some: Int[np.ndarray, " some"]) -> Seen:
    return Seen(
        always=np.ones(len(some), dtype=bool),
        sometimes=np.empty(0, dtype=np.int64),
        table=np.empty((0, len(ARRAY)), dtype=bool),
    )


def full_sum(facets: Facets, links: Links, visible: Any = True) -> Any:
    seen = np.broadcast_to(visible, (len(ARRAY), facets.count))
    receive = Ports(positions=links.receivers, pattern=links.received, visible=seen)
    if links.echo:
        return scattered(facets, receive, receive, BAND, waves="spherical")
    transmit = Ports(positions=links.senders, pattern=links.sent, visible=seen)
    return scattered(facets, transmit, receive, BAND, waves="spherical")


def link(kind: str, *, echo: bool, user: str = "isotropic") -> Links:
    pattern = antenna(kind)
    if echo:
        return Links(senders=ARRAY, receivers=ARRAY, sent=pattern, received=pattern)
    place = np.array([0.35, 0.1, 0.05])
    senders = np.broadcast_to(place, ARRAY.shape)
    aimed = antenna(user, np.array([0.0, 0.5, 0.0]) - place)
    return Links(senders=senders, receivers=ARRAY, sent=aimed, received=pattern)


@pytest.fixture(autouse=True)
def _by_numpy(monkeypatch: pytest.MonkeyPatch) -> None:
    from simulator.scattering import physical_optics

    monkeypatch.setattr(physical_optics, "FEWEST_FOR_KERNEL", 10**12)


def error(found: Any, exact: Any) -> float:
    assert np.linalg.norm(exact) > 0
    return float(np.linalg.norm(found - exact) / np.linalg.norm(exact))


@pytest.mark.parametrize("kind", ["isotropic", "horn", "cosine", "beam"])
def test_an_echo_patch_by_patch_is_the_full_sum(kind: str) -> None:
    facets, links = plate(Conductor()), link(kind, echo=True)
    found = scattered_by_patches(facets, links, everything, BAND)
    assert 0 < error(found, full_sum(facets, links)) <= ACCURACY


def test_a_pilot_over_a_dielectric_and_a_conductor_is_the_full_sum() -> None:
    facets = joined([plate(PANE), plate(Conductor(), y=0.53, closed=True)])
    links = link("horn", echo=False, user="cosine")
    found = scattered_by_patches(facets, links, everything, BAND)
    assert error(found, full_sum(facets, links)) <= ACCURACY


def test_facets_seen_from_a_part_of_the_array_count_for_that_part() -> None:
    facets, links = plate(Conductor()), link("horn", echo=True)
    facets = facets.part(np.arange(0, facets.count, 3))
    rng = np.random.default_rng(5)
    visible = rng.random((len(ARRAY), facets.count)) < 0.5
    visible[:, rng.random(facets.count) < 0.4] = True
    visible[:, rng.random(facets.count) < 0.2] = False

    def look(some: Int[np.ndarray, " some"]) -> Seen:
        here = visible[:, some]
        always = np.asarray(here.all(axis=0))
        mixed = np.flatnonzero(here.any(axis=0) & ~always)
        return Seen(always=always, sometimes=mixed, table=here[:, mixed].T.copy())

    found = scattered_by_patches(facets, links, look, BAND)
    assert error(found, full_sum(facets, links, visible)) <= ACCURACY


def test_antennas_that_follow_no_common_motion_are_summed_one_by_one() -> None:
    facets, rng = plate(Conductor()), np.random.default_rng(2)
    links = Links(
        senders=ARRAY + rng.normal(scale=0.01, size=ARRAY.shape) + np.array([0.1, 0.0, 0.0]),
        receivers=ARRAY,
        sent=antenna("horn"),
        received=antenna("horn"),
    )
    found = scattered_by_patches(facets, links, everything, BAND)
    assert error(found, full_sum(facets, links)) <= ACCURACY


def test_exchanging_both_ends_changes_nothing() -> None:
    facets, links = plate(PANE), link("horn", echo=False, user="beam")
    back = Links(
        senders=links.receivers, receivers=links.senders, sent=links.received, received=links.sent
    )
    one = scattered_by_patches(facets, links, everything, BAND)
    other = scattered_by_patches(facets, back, everything, BAND)
    # Forward the array is interpolated, backward too: both within what is asked of them.
    assert error(one, other) <= ACCURACY


def test_the_sum_repeats_its_bytes_and_tells_each_link_once() -> None:
    facets, links = plate(PANE), link("horn", echo=True)
    told: list[int] = []
    first = scattered_by_patches(facets, links, everything, BAND, advance=lambda: told.append(1))
    second = scattered_by_patches(facets, links, everything, BAND)
    assert first.tobytes() == second.tobytes()
    assert len(told) == len(ARRAY)
