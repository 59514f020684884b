"""The position error bound of a scenario's user: its specular paths, patterns and materials.

The paths are those of the simulator, traced to each element over the smooth mean surfaces:
finite mirrors, occlusion, antenna patterns, Fresnel coefficients at every frequency and the
coherent loss of roughness. Diffuse scattering is neither signal nor noise here; its effect is in
:mod:`validation.bounds.roughness_floor`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Complex, Float

from scenes.scenario import Scenario
from simulator.geometry.mean_surfaces import mean_surfaces
from simulator.geometry.mirrors import Mirrors
from simulator.geometry.ray_scene import blocked, build_scene
from simulator.scene.array_antennas import array_group, user_group
from simulator.scene.radio_scene import scenario_materials
from simulator.scene.scene_mirrors import scene_mirrors
from simulator.specular.image_method import find_chains
from simulator.specular.path_field import specular_response
from validation.bounds.no_bound import NoBound
from validation.bounds.position_bound import Plane, PositionBound, position_error_bound


@dataclass(frozen=True, kw_only=True)
class UserWaves:
    """Noise-free waves of one user at the array, over each sequence of mirrors."""

    paths: tuple[tuple[int, ...], ...]  # mirrors of each, from the array outward
    waves: Complex[np.ndarray, "paths elements freqs"]  # S-parameters; 0 without a path [-]
    planes: tuple[Plane, ...]  # of all mirrors, with their centres as reference points
    owners: tuple[str, ...]  # name of the object of each mirror
    positions: Float[np.ndarray, "elements 3"]  # [m]
    frequencies: Float[np.ndarray, " freqs"]  # [Hz]


def user_waves(scenario: Scenario, user: str, *, weakest_db: float = -60.0) -> UserWaves:
    """Trace a user's specular paths to every element.

    Parameters
    ----------
    scenario
        With an array: separate receivers do not receive users.
    user
        Its name.
    weakest_db
        Paths below this level, relative to the strongest, are left out. [dB]

    Raises
    ------
    ValueError
        If there is no such user, or no path.
    """
    if user not in scenario.users:
        known = ", ".join(scenario.users) or "none"
        raise ValueError(f"scenario {scenario.name!r} has no user {user!r}; it has: {known}")
    elements = scenario.base_station.element_positions
    frequencies = scenario.radio.frequencies
    array, sender = array_group(scenario, elements), user_group(scenario, user)
    found = scene_mirrors(scenario, scenario_materials(scenario), (array,))
    rays = build_scene(mean_surfaces(scenario))
    chains = find_chains(
        found.mirrors,
        sender.positions,
        elements,
        blocked=partial(blocked, rays),
        clearance=rays.clearance,
        max_bounces=scenario.max_bounces,
    )
    waves = [
        specular_response(
            found.mirrors,
            [chain],
            frequencies,
            (1, len(elements)),
            transmit=sender.pattern.towards,
            receive=array.pattern.towards,
            waves=scenario.waves,
        )[0]
        for chain in chains
    ]
    del rays
    levels = np.array([float(np.mean(np.abs(wave) ** 2)) for wave in waves])
    kept = np.flatnonzero(levels > 10 ** (weakest_db / 10) * levels.max(initial=0.0))
    if not kept.size:
        raise NoBound(
            f"scenario {scenario.name!r}: no specular path leads from {user!r} to the array; "
            "move the user or what hides it"
        )
    return UserWaves(
        paths=tuple(chains[index].mirrors[::-1] for index in kept),
        waves=np.stack([waves[index] for index in kept]),
        planes=mirror_planes(found.mirrors, elements.mean(axis=0)),
        owners=found.owners,
        positions=elements,
        frequencies=frequencies,
    )


def mirror_planes(mirrors: Mirrors, seen_from: Float[np.ndarray, " 3"]) -> tuple[Plane, ...]:
    """Return mirrors' planes at their centres, with normals to the side of a place."""
    planes = []
    for corners, normal in zip(mirrors.corners, mirrors.normals, strict=True):
        centre = corners.mean(axis=0)
        side = 1.0 if normal @ (seen_from - centre) >= 0 else -1.0
        planes.append(Plane(point=centre, normal=side * normal))
    return tuple(planes)


def scenario_position_bound(
    scenario: Scenario,
    user: str,
    *,
    snr_db: float | None = None,
    wall_covariance: Mapping[str, Float[np.ndarray, "inputs inputs"]] | None = None,
    clock_deviation: float | None = None,
    gains_known: bool = False,
) -> PositionBound:
    """Bound the covariance of a scenario's user, with the scenarios' definition of SNR.

    Parameters
    ----------
    scenario, user
        The scene, and the user's name.
    snr_db
        Mean power of the noise-free samples over the noise's variance; ``None``: the scenario's.
        Infinite is refused: the bound would be 0. [dB]
    wall_covariance
        Prior covariance, about its centre, of each object whose position is estimated too, with
        entries in the order of :func:`validation.bounds.position_bound.position_error_bound`; each
        face of a body has it, independently. Other objects are known exactly.
    clock_deviation
        Of the user's clock; ``None``: 0 if the scenario's clock is known, else infinite. [s]
    gains_known
        Whether the complex gains of all paths are known.

    Raises
    ------
    ValueError
        If there is no such user or path, or the position is not determined.
    """
    level = scenario.noise.snr_db if snr_db is None else snr_db
    if not np.isfinite(level):
        raise NoBound(f"snr_db = {level}: without noise the bound is 0; give a finite level")
    if clock_deviation is None:
        clock_deviation = 0.0 if scenario.impairments.clock_known else float("inf")
    heard = user_waves(scenario, user)
    estimated = dict(wall_covariance or {})
    unknown = sorted(set(estimated) - set(heard.owners))
    if unknown:
        raise ValueError(
            f"wall_covariance names {', '.join(unknown)}, but the mirrors of scenario "
            f"{scenario.name!r} are: {', '.join(sorted(set(heard.owners))) or 'none'}"
        )
    met = sorted({index for path in heard.paths for index in path})
    covariance = None
    dimensions = scenario.dimensions
    if any(heard.owners[index] in estimated for index in met):
        covariance = np.zeros((len(met) * dimensions,) * 2)
        for place, index in enumerate(met):
            # A variance of 0 has no inverse: 1e-12 rad and m count as exactly known.
            known = 1e-24 * np.eye(dimensions)
            at = slice(place * dimensions, (place + 1) * dimensions)
            covariance[at, at] = estimated.get(heard.owners[index], known)
    return position_error_bound(
        scenario.users[user].position,
        positions=heard.positions,
        frequencies=heard.frequencies,
        snr=10 ** (level / 10),
        planes=[heard.planes[index] for index in met],
        paths=[tuple(met.index(index) for index in path) for path in heard.paths],
        waves=heard.waves,
        dimensions=dimensions,
        gains_known=gains_known,
        plane_covariance=covariance,
        clock_deviation=clock_deviation,
    )
