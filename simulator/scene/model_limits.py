"""Surfaces for which the model is known to deviate from full wave: reported, not refused."""

from dataclasses import replace

import numpy as np

from scenes.realisations.object_surface import object_surface
from scenes.scenario import Scenario
from simulator.geometry.profile_lines import Run, outline

MOST_SLOPE = {"vertical": 0.6, "horizontal": 0.25}
"""Rms slope of a rough line, by polarization, up to which its echo and pilot were found within 1 dB
of full wave (:mod:`validation.experiments.full_wave.roughness`). In the horizontal one waves run
along a conductor, and an echo at 45° was 2 dB too strong beyond. [-]"""


def rms_slope(run: Run) -> float:
    """Return the rms slope of a run's heights, sampled at its facets. [-]."""
    if not run.rough:
        return 0.0
    return float(np.sqrt(np.mean(np.diff(run.heights) ** 2))) / run.step


def model_notes(scenario: Scenario, *, seed: int) -> tuple[str, ...]:
    """Return notes on surfaces so steep that the simulator deviates from full wave by over 1 dB.

    Only in two dimensions: in three, triangles are summed by another method.

    Parameters
    ----------
    scenario, seed
        Which realisation.
    """
    if scenario.dimensions != 2:
        return ()
    polarization = scenario.radio.polarization
    notes = []
    for name, body in scenario.objects.items():
        if body.material == "absorber":
            continue
        surface = object_surface(scenario, name, seed=seed)
        runs = (replace(run, count=len(surface.cells)) for run in outline(surface).runs)
        slope = max((rms_slope(run) for run in runs), default=0.0)
        if slope > MOST_SLOPE[polarization]:
            notes.append(
                f"objects.{name}.roughness: an rms slope of {slope:.2f} is more than "
                f"{MOST_SLOPE[polarization]:g}, up to which the simulator was found within 1 dB of "
                "full wave; its echo may be off by more (lower rms_mm, or raise correlation_mm)"
            )
    return tuple(notes)
