"""The kernel for few frequencies against the sum in NumPy, and its tables."""

from typing import Any

import numpy as np
import pytest
from scipy.constants import speed_of_light

from scenes.realisations.object_surface import Surface, object_surface
from scenes.scenario import Scenario, parse_scenario
from scenes.schema.antenna import Antenna, Cosine, GaussianBeam, Horn, Isotropic
from simulator.antennas.field_pattern import field_gain
from simulator.antennas.ports import Ports
from simulator.geometry.facets import surface_facets
from simulator.materials.fresnel_slab import (
    Conductor,
    Dielectric,
    Material,
    named_material,
    reflection,
)
from simulator.materials.permittivity import ConstantPermittivity
from simulator.scattering.bistatic_kernel import (
    BistaticKernel,
    Port,
    pattern_table,
    reflection_rows,
)
from simulator.scattering.physical_optics import scattered
from simulator.scene.radio_scene import antenna_pattern

FREQUENCIES = np.linspace(300e9, 330e9, 11)  # more than one kernel's
HORN = Horn(kind="horn", gain_dbi=18.0)
CENTRE = np.array([0.0, 0.2, 0.0])


def scenario(**body: Any) -> Scenario:
    return parse_scenario(
        {
            "name": "small",
            "dimensions": 3,
            "radio": {"start_ghz": 300.0, "stop_ghz": 330.0, "points": 11},
            "base_station": {"elements": 1, "spacing_mm": 1.0},
            "objects": {
                "it": {
                    "kind": "plate",
                    "material": "metal",
                    "centre_m": CENTRE.tolist(),
                    "length_m": 0.012,
                    "height_m": 0.009,
                    "roughness": {"rms_mm": 0.05, "correlation_mm": 0.5},
                    **body,
                }
            },
        }
    )


def cylinder() -> Scenario:
    body = {"kind": "cylinder", "material": "metal", "radius_m": 0.003, "height_m": 0.004}
    return parse_scenario(
        {
            "name": "round",
            "dimensions": 3,
            "radio": {"start_ghz": 300.0, "stop_ghz": 330.0, "points": 11},
            "base_station": {"elements": 1, "spacing_mm": 1.0},
            "objects": {"it": {**body, "centre_m": CENTRE.tolist()}},
        }
    )


def port(position: list[float], antenna: Antenna) -> Port:
    place = np.array(position)
    aim = (CENTRE - place) / np.linalg.norm(CENTRE - place)
    return Port(position=place, aim=aim, pattern=pattern_table(antenna))


def by_numpy(
    surface: Surface, material: Material, transmit: Port, receive: Port, antenna: Antenna,
    lit: np.ndarray | None = None,
) -> np.ndarray:  # fmt: skip
    middle = 2 * speed_of_light / (FREQUENCIES[0] + FREQUENCIES[-1])
    facets = surface_facets(surface, material, wavelength=middle)
    seen = np.ones((1, facets.count), dtype=bool) if lit is None else lit[None]
    ports = [
        Ports(positions=p.position[None], pattern=antenna_pattern(antenna, p.aim), visible=seen)
        for p in (transmit, receive)
    ]
    links = scattered(facets, ports[0], ports[1], FREQUENCIES, waves="spherical")
    return np.asarray(links[0])


MATERIALS = {
    "metal": Conductor(),
    "drywall": named_material("drywall", FREQUENCIES),
    "a lossless pane": Dielectric(
        permittivity=ConstantPermittivity(value=4.0 + 0.0j), thickness=1e-3
    ),
}


@pytest.mark.parametrize("name", MATERIALS)
@pytest.mark.parametrize("receiver", [[0.1, 0.0, 0.03], [-0.12, 0.05, -0.02], [-0.1, 0.0, 0.0]])
def test_the_kernel_sums_what_numpy_sums(name: str, receiver: list[float]) -> None:
    material = MATERIALS[name]
    surface = object_surface(scenario(), "it", seed=1)
    ends = port([-0.1, 0.0, 0.0], HORN), port(receiver, HORN)
    lit = np.random.default_rng(5).random(len(surface.cells)) < 0.9
    found = BistaticKernel(surface, material, FREQUENCIES).link(*ends, lit)
    expected = by_numpy(surface, material, *ends, HORN, lit)
    # Single precision in 3e4 terms, and tables good to 1e-5 of amplitudes around 0.3.
    np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max())


def test_a_closed_body_scatters_on_its_outer_side_only() -> None:
    surface = object_surface(cylinder(), "it", seed=0)
    ends = port([-0.1, 0.0, 0.0], HORN), port([0.1, 0.02, 0.0], HORN)
    found = BistaticKernel(surface, Conductor(), FREQUENCIES).link(*ends)
    expected = by_numpy(surface, Conductor(), *ends, HORN)
    np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max())


def test_exchanging_transmitter_and_receiver_changes_nothing_in_a_link() -> None:
    surface = object_surface(scenario(), "it", seed=2)
    kernel = BistaticKernel(surface, MATERIALS["drywall"], FREQUENCIES)
    one, other = port([-0.1, 0.0, 0.01], HORN), port([0.02, 0.03, -0.02], Isotropic())
    there, back = kernel.link(one, other), kernel.link(other, one)
    np.testing.assert_allclose(there, back, atol=1e-6 * np.abs(there).max())


@pytest.mark.parametrize(
    "antenna",
    [
        HORN,
        Horn(kind="horn", gain_dbi=40.0),
        GaussianBeam(kind="gaussian_beam", sigma_rad=0.3),
        Cosine(kind="cosine", exponent=2.0),
    ],
)
def test_the_table_of_a_pattern_is_the_pattern(antenna: Antenna) -> None:
    table = pattern_table(antenna)
    assert table is not None
    angles = np.random.default_rng(1).uniform(0.0, np.pi, 500) ** 2 / np.pi
    place = np.sin(angles / 2) * (len(table) - 1)
    below = place.astype(int)
    found = table[below] + (table[below + 1] - table[below]) * (place - below)
    directions = np.stack([np.sin(angles), 0 * angles, np.cos(angles)], axis=-1)
    expected = field_gain(antenna, np.array([0.0, 0.0, 1.0]), directions)
    # Linear between steps of 3e-5 rad and more, of a beam a degree wide.
    np.testing.assert_allclose(found, expected, atol=2e-5 * float(expected.max()))


def test_no_direction_within_a_ball_gets_more_than_its_bound() -> None:
    rng = np.random.default_rng(2)
    one = port([-0.1, 0.0, 0.0], HORN)
    for _ in range(20):
        centre, radius = rng.uniform(-0.2, 0.4, 3), float(rng.uniform(0.001, 0.05))
        inside = rng.standard_normal((200, 3))
        inside *= radius / np.linalg.norm(inside, axis=-1, keepdims=True)
        towards = centre + inside - one.position
        towards /= np.linalg.norm(towards, axis=-1, keepdims=True)
        gains = field_gain(HORN, one.aim, towards) / 10 ** (HORN.gain_dbi / 20)
        assert gains.max() <= one.bound(centre, radius) * (1 + 1e-4) + 1e-12


def test_coefficients_between_the_angles_of_the_table_are_the_slabs() -> None:
    material = MATERIALS["a lossless pane"]
    rows = reflection_rows(material, FREQUENCIES)
    cosines = np.random.default_rng(3).uniform(0.02, 1.0, 300)
    place = cosines * (rows.shape[1] - 1)
    below = place.astype(int)
    share = (place - below)[:, None]
    found = rows[:, below] + (rows[:, below + 1] - rows[:, below]) * share
    exact = reflection(material, FREQUENCIES, cosines)
    np.testing.assert_allclose(found[..., 0] + 1j * found[..., 1], exact.te.T, atol=2e-5)
    np.testing.assert_allclose(found[..., 2] + 1j * found[..., 3], exact.tm.T, atol=2e-5)


def test_lines_are_refused() -> None:
    flat = parse_scenario(
        {
            "name": "flat",
            "radio": {"start_ghz": 300.0, "stop_ghz": 330.0, "points": 11},
            "base_station": {"elements": 1, "spacing_mm": 1.0},
            "objects": {"it": {"kind": "plate", "material": "metal", "centre_m": [0.0, 0.2],
                               "length_m": 0.01}},
        }
    )  # fmt: skip
    with pytest.raises(ValueError, match=r"'it' is made of lines; the kernel sums triangles"):
        BistaticKernel(object_surface(flat, "it", seed=0), Conductor(), FREQUENCIES)
