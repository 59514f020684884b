"""What facets scatter of rough and smooth samples, against closed forms."""

from typing import Any

import numpy as np
import pytest
from scipy.constants import speed_of_light

from scenes.files.loading import load_scenario
from scenes.scenario import Scenario, parse_scenario
from scenes.schema.objects import Plate
from scenes.schema.roughness import Roughness
from simulator.antennas.field_pattern import horn_beam_width
from simulator.materials.fresnel_slab import Conductor
from simulator.scene.radio_scene import scenario_materials
from simulator.simulation import simulate
from validation.analytic.rough_plate import coherent_loss, mean_diffuse_power, mirror_link
from validation.experiments.fig02_07_rcs_drywall import links_of, off_specular_deg

SIDE = 0.012
"""Of the sample: some speckles of 330 GHz are 4° wide then, [m]."""


def small_sample(material: str, **roughness: Any) -> Scenario:
    return parse_scenario(
        {
            "name": "small_sample",
            "dimensions": 3,
            "max_bounces": 1,
            "radio": {"start_ghz": 300.0, "stop_ghz": 330.0, "points": 3},
            "base_station": {
                "receivers": {
                    "kind": "arc",
                    "centre_m": [0.0, 0.3],
                    "radius_m": 0.3,
                    "start_deg": -120.0,
                    "stop_deg": -30.0,
                    "points": 20,
                },
                "transmitter": {"position_m": [-0.212132, 0.087868]},
                "antenna": {"kind": "horn", "gain_dbi": 23.0, "aim": "sample"},
            },
            "objects": {
                "sample": {
                    "kind": "plate",
                    "material": material,
                    "centre_m": [0.0, 0.3, 0.0],
                    "length_m": SIDE,
                    "height_m": SIDE,
                    "roughness": {"rms_mm": 0.0, "correlation_mm": 0.4, **roughness},
                }
            },
        }
    )


def samples_of(scene: Scenario, seed: int) -> np.ndarray:
    echo = simulate(scene, seed=seed).measurement.echo
    assert echo is not None
    return echo.samples


@pytest.mark.parametrize(
    ("material", "rms_mm"), [("drywall", 0.02), ("metal", 0.02), ("metal", 0.08)]
)
def test_the_diffuse_mean_of_the_facets_is_the_kirchhoff_integral(
    material: str, rms_mm: float
) -> None:
    scene = small_sample(material, rms_mm=rms_mm)
    plate, seeds = scene.objects["sample"], 8
    assert isinstance(plate, Plate)
    assert plate.roughness is not None
    frequencies = scene.radio.frequencies
    drawn = np.array([samples_of(scene, seed) for seed in range(seeds)])
    smooth = samples_of(small_sample(material), 0)
    links, made = links_of(scene), scenario_materials(scene)["sample"]
    loss = np.array(
        [[coherent_loss(plate, plate.roughness, link, f) for f in frequencies] for link in links]
    )
    expected = np.array(
        [
            [mean_diffuse_power(plate, plate.roughness, made, link, f, cells=40)
             for f in frequencies]
            for link in links
        ]
    )  # fmt: skip
    # Each direction counts alike, whatever its level. Directions 4.7° apart and realisations are
    # independent speckles, frequencies are not counted.
    ratio = (np.abs(drawn - loss * smooth) ** 2 / expected).mean(axis=(0, 2))
    speckles = seeds * len(links)
    # Linear facets of a quarter of the correlation length take up to 5 % at the widest angle.
    assert ratio.mean() == pytest.approx(1.0, abs=4 / np.sqrt(speckles) + 0.05)
    if rms_mm < 0.05:  # first order: small perturbations
        wavenumber = 2 * np.pi * frequencies[-1] / speed_of_light
        assert (2 * wavenumber * plate.roughness.rms) ** 2 < 0.1


def test_for_low_heights_the_diffuse_power_goes_with_their_square() -> None:
    scene = small_sample("metal", rms_mm=1e-3)
    plate, link = scene.objects["sample"], links_of(scene)[3]
    assert isinstance(plate, Plate)
    powers = [
        mean_diffuse_power(
            plate, Roughness(rms_mm=rms, correlation_mm=0.4), Conductor(), link, 330e9, cells=30
        )
        for rms in (1e-4, 1e-3)
    ]
    assert powers[1] / powers[0] == pytest.approx(100.0, rel=1e-3)


def test_in_the_specular_lobe_of_metal_is_the_image_of_the_transmitter() -> None:
    # At 110 GHz the sample takes a ninth of the facets.
    scene = load_scenario(
        "rcs_drywall",
        [
            "objects.sample.material=metal",
            "objects.sample.roughness.rms_mm=0",
            "radio.start_ghz=108",
            "radio.stop_ghz=110",
            "radio.points=2",
            "base_station.receivers.start_deg=-57",
            "base_station.receivers.stop_deg=-33",
            "base_station.receivers.points=9",
        ],
    )
    plate = scene.objects["sample"]
    assert isinstance(plate, Plate)
    links = links_of(scene)
    np.testing.assert_allclose(off_specular_deg(plate, links), np.linspace(-12, 12, 9), atol=1e-6)
    expected = np.array(
        [[mirror_link(plate, link, f) for f in scene.radio.frequencies] for link in links]
    )
    # Over the first Fresnel zone the beams are not flat: the Gaussian integral over the sample,
    # of both patterns and both legs, is that of the mirror times
    #   exp(-j e/(1 - j e) d²/4s²) / (1 - j e),  e = 1/(k r s²),
    # for beams of standard width s that look d off the specular direction.
    width = horn_beam_width(23.0) / (2 * np.sqrt(np.log(2)))
    flatness = 1 / (2 * np.pi * scene.radio.frequencies / speed_of_light * 0.3 * width**2)
    exponent = (off_specular_deg(plate, links)[:, None] * np.pi / 360 / width) ** 2
    expected *= np.exp(-1j * flatness / (1 - 1j * flatness) * exponent) / (1 - 1j * flatness)
    found = samples_of(scene, 0)
    # Beyond the parabola, tan ψ - ψ at the 6° off axis and the edge's e^(-14): below a percent.
    assert np.abs(found / expected - 1).max() < 0.01
