"""Facets of a dielectric: the slab's coefficient in echo and link, in two and three dimensions."""

from typing import Any

import numpy as np
import pytest
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from scenes.realisations.object_surface import Surface
from scenes.scenario import Scenario, ScenarioError, parse_scenario
from scenes.surfaces.shape import grid_triangles
from simulator.antennas.ports import Ports
from simulator.geometry.facets import Facets, joined, profile_surface, surface_facets
from simulator.geometry.mirrors import Mirrors
from simulator.materials.fresnel_slab import Absorber, Conductor, Dielectric, Material, reflection
from simulator.materials.permittivity import ConstantPermittivity
from simulator.scattering.physical_optics import scattered
from simulator.simulation import simulate
from simulator.specular.image_method import find_chains
from simulator.specular.path_field import specular_response

BAND = np.linspace(220e9, 295e9, 61)
PANE = Dielectric(permittivity=ConstantPermittivity(value=2.5 - 0.05j), thickness=1.5e-3)
OPAQUE = Dielectric(permittivity=ConstantPermittivity(value=2.5 - 0.05j), thickness=np.inf)

SUM_ERROR = 1e-5
"""What the non-uniform FFT and the interpolations add, relative. [-]"""


def wall(material: Material, *, length: float = 0.4, y: float = 0.0) -> Facets:
    count = int(np.ceil(length / (speed_of_light / 295e9 / 4))) + 1
    profile = np.zeros((count, 3))
    profile[:, 0], profile[:, 1] = np.linspace(-length / 2, length / 2, count), y
    return surface_facets(profile_surface(profile), material)


def floor(material: Material, *, side: float, step: float) -> Facets:
    """A horizontal plate at z = 0, seen from above."""
    axis = np.linspace(-side / 2, side / 2, int(np.ceil(side / step)) + 1)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    vertices = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=-1)
    made = Surface(
        name="floor", material="metal", vertices=vertices, mean_vertices=vertices,
        cells=grid_triangles(np.arange(x.size).reshape(x.shape)), closed=False,
    )  # fmt: skip
    return surface_facets(made, material)


def ports(positions: Float[np.ndarray, "ports 3"], facets: Facets, radius: float) -> Ports:
    """Isotropic, behind a window on the surface that hides its edges."""

    def pattern(
        directions: Float[np.ndarray, "facets 3"],
        distances: Float[np.ndarray, " facets"],
        frequencies: Float[np.ndarray, " nodes"],
    ) -> Float[np.ndarray, "1 facets"]:
        away = np.linalg.norm(positions[0] + distances[:, None] * directions, axis=-1) / radius
        smooth = np.cos(np.pi / 2 * np.clip(2 * away - 1, 0, 1)) ** 2
        return np.where(away < 1, smooth, 0.0)[None]

    visible = np.ones((len(positions), facets.count), dtype=bool)
    return Ports(positions=positions, pattern=pattern, visible=visible)


def link(
    facets: Facets, one: Float[np.ndarray, " 3"], other: Float[np.ndarray, " 3"], radius: float,
    band: Float[np.ndarray, " freqs"] = BAND,
) -> Complex[np.ndarray, " freqs"]:  # fmt: skip
    first, second = (ports(end[None], facets, radius) for end in (one, other))
    return np.asarray(scattered(facets, first, second, band, waves="spherical")[0])


@pytest.mark.parametrize("angle_deg", [10.0, 45.0, 65.0])
@pytest.mark.parametrize("slab", [PANE, OPAQUE])
def test_a_mirror_of_a_dielectric_reflects_its_coefficient_at_the_specular_angle(
    angle_deg: float, slab: Dielectric
) -> None:
    angle = np.radians(angle_deg)
    one = 0.3 * np.array([np.sin(angle), -np.cos(angle), 0.0])
    other = one * [-1, 1, 1]
    ratio = link(wall(slab), one, other, 0.15) / link(wall(Conductor()), one, other, 0.15)
    expected = -reflection(slab, BAND, np.array([np.cos(angle)])).te[0]
    # The coefficient varies over the mirror's Fresnel zone, √(λR/2)/cosθ ≈ 1.3 cm of 30 cm:
    # the half angle turns by its square only, 2e-3, at a slab's dΓ/dθ of about 3.
    np.testing.assert_allclose(ratio, expected, atol=6e-3)
    assert np.abs(expected).max() > 0.2


def test_an_echo_is_that_of_a_conductor_times_the_coefficient_at_normal_incidence() -> None:
    array = np.array([[-0.1, -0.3, 0.0]])
    echoes = []
    for material in (PANE, Conductor()):
        facets = wall(material)
        # The window ends where the wall does: the conductor's fringe currents are dark.
        port = ports(array, facets, 0.2)
        echoes.append(scattered(facets, port, port, BAND, waves="spherical"))
    expected = -echoes[1] * reflection(PANE, BAND, np.ones(1)).te[0]
    np.testing.assert_allclose(echoes[0], expected, rtol=1e-12)


def test_an_echo_is_the_link_between_two_antennas_at_one_place() -> None:
    facets, here = wall(PANE), np.array([[0.02, -0.3, 0.0]])
    port = ports(here, facets, 0.3)
    echo = scattered(facets, port, port, BAND, waves="spherical")
    pair = scattered(facets, port, ports(here, facets, 0.3), BAND, waves="spherical")
    assert np.linalg.norm(echo - pair) <= SUM_ERROR * np.linalg.norm(echo)


@pytest.mark.parametrize("material", [Conductor(), PANE, OPAQUE])
@pytest.mark.parametrize("flat", [True, False])
def test_transmitter_and_receiver_apart_may_be_exchanged(material: Material, flat: bool) -> None:
    one, other = np.array([-0.2, -0.25, 0.0]), np.array([0.1, -0.35, 0.0])
    facets = wall(material)
    if not flat:
        facets = floor(material, side=8e-3, step=0.25e-3)
        one, other = np.array([-0.2, 0.1, 0.25]), np.array([0.15, 0.05, 0.3])
    there, back = link(facets, one, other, 0.3), link(facets, other, one, 0.3)
    assert np.linalg.norm(there) > 0
    assert np.linalg.norm(there - back) <= 1e-6 * np.linalg.norm(there)


@pytest.mark.parametrize("material", [Conductor(), PANE])
def test_a_floor_between_vertical_antennas_reflects_as_its_specular_path_does(
    material: Material,
) -> None:
    band = np.linspace(57e9, 64e9, 8)
    facets = floor(material, side=0.26, step=speed_of_light / 64e9 / 4)
    one, other = np.array([-0.10, -0.03, 0.10]), np.array([0.10, 0.03, 0.10])
    field = link(facets, one, other, 0.125, band)
    corners = 0.5 * np.array([[[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]], dtype=float)
    mirror = Mirrors(
        corners=corners, materials=(material,), rms_heights=np.zeros(1),
        two_sided=np.ones(1, dtype=bool),
    )  # fmt: skip
    chains = find_chains(
        mirror, one[None], other[None], max_bounces=1, min_bounces=1,
        blocked=lambda starts, ends: np.zeros(len(starts), dtype=bool),
    )  # fmt: skip
    expected = specular_response(mirror, chains, band, (1, 1))[0, 0]
    # The next order of stationary phase is 9/(kL) of a mirror at 45°: 3.5 % here, and 2.2 % and
    # 1.7 % on a scene 1.5 and 2 times as large. The slab's own TM is a fifth of the conductor's
    # near Brewster's angle; there the same order is 4.6 % of it.
    assert np.abs(field / expected - 1).max() <= 0.05


def test_each_material_of_a_scene_is_summed_and_an_absorber_adds_nothing() -> None:
    one, other = np.array([-0.1, -0.3, 0.0]), np.array([0.1, -0.3, 0.0])
    pieces = [
        wall(Conductor(), length=0.05), wall(PANE, length=0.05, y=0.05),
        wall(Absorber(), length=0.02, y=0.1), wall(Conductor(), length=0.05, y=0.15),
    ]  # fmt: skip
    together = link(joined(pieces), one, other, 0.5)
    apart = sum(link(piece, one, other, 0.5) for piece in pieces if piece is not pieces[2])
    assert np.linalg.norm(together - apart) <= SUM_ERROR * np.linalg.norm(together)
    assert len(joined(pieces).by_material) == 3


def scenario(**changes: Any) -> Scenario:
    plate = {"kind": "plate", "centre_m": [0, 0.3], "length_m": 0.05, **changes.pop("plate", {})}
    return parse_scenario(
        {
            "name": "one",
            "radio": {"start_ghz": 220.0, "stop_ghz": 295.0, "points": 31},
            "base_station": {"elements": 3, "spacing_mm": 0.5},
            "objects": {"wall": plate},
            **changes,
        }
    )


def test_scenarios_of_slabs_echo_by_their_coefficients() -> None:
    # Two dielectrics: neither has fringe currents at its edges, which a conductor has.
    echoes, coefficients = [], []
    for permittivity in (2.5 - 0.05j, 6.0 - 0.3j):
        material = {"permittivity": [permittivity.real, -permittivity.imag], "thickness_mm": 1.5}
        found = simulate(scenario(plate={"material": material}), seed=0).measurement.echo
        assert found is not None
        echoes.append(found.samples)
        slab = Dielectric(permittivity=ConstantPermittivity(value=permittivity), thickness=1.5e-3)
        coefficients.append(reflection(slab, np.linspace(220e9, 295e9, 31), np.ones(1)).te[0])
    ratio = coefficients[1] / coefficients[0]
    np.testing.assert_allclose(echoes[1], echoes[0] * ratio, rtol=1e-9)


def test_a_table_of_permittivity_is_read_for_the_simulation(tmp_path: Any) -> None:
    path = tmp_path / "pane.csv"
    path.write_text("frequency_ghz,eps_real,eps_imag\n200,2.5,0.05\n300,2.5,0.05\n")
    echoes = []
    for source in ({"file": str(path)}, {"permittivity": [2.5, 0.05]}):
        plate = {"material": {**source, "thickness_mm": 1.5}}
        found = simulate(scenario(plate=plate), seed=0).measurement.echo
        assert found is not None
        echoes.append(found.samples)
    np.testing.assert_allclose(echoes[0], echoes[1], rtol=1e-9)


@pytest.mark.parametrize(
    ("material", "message"),
    [
        ("chipboard", r"objects\.wall\.material: material 'chipboard': no row .* covers 220-295"),
        (
            {"file": "/none.csv", "thickness_mm": 1.0},
            r"objects\.wall\.material\.file: /none\.csv: cannot",
        ),
        (
            {"permittivity": [2.0, 1e-4], "thickness_mm": 100.0},
            r"objects\.wall\.material: the slab's coefficient ripples too fast",
        ),
    ],
)
def test_a_material_that_is_not_known_over_the_band_is_refused(material: Any, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        simulate(scenario(plate={"material": material}), seed=0)
