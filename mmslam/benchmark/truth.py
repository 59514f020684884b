"""The truth of a part, made from its recipe when predictions are scored."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int

from mmslam.benchmark.recipe import Recipe, space_of
from scenes.realisations.object_surface import plate_segment
from scenes.scenario import Noise, Scenario
from scenes.schema.objects import Plate

SNR_STEP = 15.0
"""SNR that divides samples into those with little and with much noise. [dB]"""

ROUGH = 0.07
"""Rms height over wavelength 1.3 mm, 1/18, from which most of a wall's echo at 45° is diffuse:
exp(−2 (k σ cos 45°)²) is 0.6 in amplitude, 0.35 in power. [mm]"""


@dataclass(frozen=True, kw_only=True)
class SampleTruth:
    """What is true of one sample."""

    user: Float[np.ndarray, " 2"]  # [m]
    walls: Float[np.ndarray, "walls 2 2"]  # ends of each [m]
    difficulty: dict[str, str]  # by what, and how difficult


def part_truth(recipe: Recipe, part: str, size: int | None = None) -> list[SampleTruth]:
    """Return the truth of all samples of a part; nothing is simulated."""
    return [_truth(scenario) for scenario in scenarios(recipe, part, size)]


def scenarios(recipe: Recipe, part: str, size: int | None = None) -> Iterator[Scenario]:
    """Yield the scenario of each sample."""
    space = space_of(recipe, part, size)
    for sample in range(space.variations.samples):
        scenario = space.first(sample)[0].scenario
        assert scenario is not None  # or it would have raised
        yield scenario


def true_channels(
    recipe: Recipe, part: str, size: int | None = None
) -> Complex[np.ndarray, "samples elements freqs"]:
    """Simulate the noise-free channels of a part's users, on the recipe's grid."""
    from simulator.simulation import simulate  # Sionna's import takes seconds

    found = []
    seed = recipe.parts[part].seed
    for sample, scenario in enumerate(scenarios(recipe, part, size)):
        quiet = scenario.model_copy(update={"noise": Noise()})
        (uplink,) = simulate(quiet, seed=seed, sample=sample).measurement.uplinks
        rows, columns = grid(recipe, *uplink.samples.shape)
        found.append(uplink.samples[np.ix_(rows, columns)])
    return np.stack(found)


def grid(
    recipe: Recipe, elements: int, frequencies: int
) -> tuple[Int[np.ndarray, " rows"], Int[np.ndarray, " columns"]]:
    """Return the indices of elements and frequencies at which channels are compared."""
    assert recipe.channel is not None
    return (
        np.linspace(0, elements - 1, recipe.channel.elements).round().astype(np.int64),
        np.linspace(0, frequencies - 1, recipe.channel.frequencies).round().astype(np.int64),
    )


def _truth(scenario: Scenario) -> SampleTruth:
    plates = [one for one in scenario.objects.values() if isinstance(one, Plate)]
    rms = max((one.roughness.rms * 1e3 for one in plates if one.roughness is not None), default=0)
    clutter = len(scenario.objects) - len(plates)
    return SampleTruth(
        user=next(iter(scenario.users.values())).position[:2],
        walls=np.array([np.stack(plate_segment(one))[:, :2] for one in plates]),
        difficulty={
            "walls": str(len(plates)),
            "roughness": "rough" if rms >= ROUGH else "smooth",
            "SNR": "low" if scenario.noise.snr_db < SNR_STEP else "high",
            "clutter": "posts" if clutter else "none",
        },
    )
