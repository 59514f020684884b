"""Where the model of a scenario is known to leave full wave: told, not refused."""

import numpy as np

from scenes.scenario import Scenario
from scenes.schema.roughness import Roughness

MOST_SLOPE = 0.6
"""Rms slope up to which echo and pilot of a rough line were found within 1 dB of full wave
(:mod:`validation.experiments.full_wave_roughness`). [-]"""

MOST_HORIZONTAL = 0.25
"""The same in the horizontal polarization, where waves run along a conductor; beyond it echoes
off the normal were up to 2 dB too strong. [-]"""

_WAVES = np.linspace(0.0, 12.0, 4001)


def rms_slope(rough: Roughness) -> float:
    """Return the rms slope of a rough line. [-]."""
    if rough.rms == 0:
        return 0.0
    if rough.spectrum == "gaussian":
        return float(np.sqrt(2)) * rough.rms / rough.correlation_length
    waves = _WAVES / rough.inner_cutoff
    power = np.exp(-((waves * rough.inner_cutoff) ** 2) / 4)
    power /= 1 + (waves * rough.correlation_length) ** 2
    return rough.rms * float(np.sqrt(np.sum(waves**2 * power) / np.sum(power)))


def model_notes(scenario: Scenario) -> tuple[str, ...]:
    """Tell which surfaces are so steep that the simulator leaves full wave by more than 1 dB.

    In three dimensions nothing is told: triangles are summed by tangent planes.
    """
    if scenario.dimensions != 2:
        return ()
    most = MOST_SLOPE if scenario.radio.polarization == "vertical" else MOST_HORIZONTAL
    notes = []
    for name, body in scenario.objects.items():
        if body.roughness is None or body.material == "absorber":
            continue
        slope = rms_slope(body.roughness)
        if slope > most:
            notes.append(
                f"objects.{name}.roughness: an rms slope of {slope:.2f} is more than {most:g}, up "
                "to which the simulator was found within 1 dB of full wave; expect its diffuse "
                "echo to be off by more (lower rms_mm or raise correlation_mm)"
            )
    return tuple(notes)
