"""The pilot of a user by Sionna RT's path solver, in the scene's own file.

Coefficients of the path solver are those of one frequency: slabs of brick ripple by decibels over
0.4 GHz. So it is asked at several frequencies of the band.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Complex, Float

from scenes.scenario import Scenario
from simulator.materials.permittivity import conductivity, itu_permittivity


class SolvedPilot(NamedTuple):
    """What the path solver finds between a user and the elements."""

    samples: Complex[np.ndarray, "elements some"]  # S-parameters at some frequencies [-]
    delays: tuple[Float[np.ndarray, " paths"], ...]  # of each element's paths [s]
    gains: tuple[Complex[np.ndarray, " paths"], ...]  # at the last of the frequencies [-]


def solved_pilots(
    scenario: Scenario, file: Path, frequencies: Float[np.ndarray, " some"]
) -> Mapping[str, SolvedPilot]:
    """Solve for the specular paths of each user.

    Parameters
    ----------
    scenario
        Says where the elements and users stand, how many bounces count, and whether slabs pass
        waves. Antennas are taken as isotropic and vertical.
    file
        The scene, as Sionna RT loads it. Materials that it does not know at a frequency take the
        nearest rows of ITU-R P.2040-4 there.
    frequencies
        [Hz]
    """
    import sionna.rt as rt

    scene = rt.load_scene(str(file), merge_shapes=False)
    scene.tx_array = scene.rx_array = rt.PlanarArray(
        num_rows=1, num_cols=1, pattern="iso", polarization="V"
    )
    elements = scenario.base_station.element_positions
    for index, place in enumerate(elements):
        scene.add(rt.Receiver(f"/element {index}", place.tolist()))
    solver = rt.PathSolver(deterministic=True)
    found = {}
    for name, user in scenario.users.items():
        scene.add(rt.Transmitter("/user", user.position.tolist()))
        samples = np.zeros((len(elements), len(frequencies)), dtype=np.complex128)
        for column, frequency in enumerate(frequencies.tolist()):
            _tune(scene, frequency)
            paths = solver(
                scene,
                max_depth=scenario.max_bounces,
                refraction=scenario.effects.transmission,
                synthetic_array=False,
                seed=0,
            )
            gains, delays = paths.cir(normalize_delays=False, out_type="numpy")
            gains, delays = (np.reshape(v, (len(elements), -1)) for v in (gains, delays))
            samples[:, column] = np.where(delays >= 0, gains, 0).sum(axis=1)
        kept = [delay >= 0 for delay in delays]
        found[name] = SolvedPilot(
            samples=samples,
            delays=tuple(
                delay[some].astype(float) for delay, some in zip(delays, kept, strict=True)
            ),
            gains=tuple(gain[some] for gain, some in zip(gains, kept, strict=True)),
        )
        scene.remove("/user")
    return found


def _tune(scene: Any, frequency: float) -> None:
    """Set a scene's frequency; Sionna refuses materials beyond their band: these get constants."""
    import mitsuba as mi

    for material in scene.radio_materials.values():
        known = material.frequency_update_callback
        if known is None:
            continue
        try:
            known(mi.Float(frequency))  # in its precision: marble is known up to 60 GHz
        except ValueError:
            at = np.array([frequency])
            permittivity = itu_permittivity(material.itu_type, at, beyond=True)(at)
            constants = float(permittivity.real[0]), float(conductivity(permittivity, at)[0])
            material.frequency_update_callback = _always(constants)
    scene.frequency = frequency


def _always(constants: tuple[float, float]) -> Callable[[object], tuple[float, float]]:
    def of(_: object) -> tuple[float, float]:
        return constants

    return of
