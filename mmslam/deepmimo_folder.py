r"""Specular paths of a scenario in the folder layout of DeepMIMO (version 4).

The base station transmits from the middle of its array, the users receive; the links are
reciprocal. Each path has a power of :math:`20 \log_{10} |S|`, where S is the S-parameter at the
middle of the band, and the phase of S there, so that

.. math:: H(f_c + k \Delta f) = \sum_p |S_p| e^{j \varphi_p} e^{-j 2 \pi k \Delta f \tau_p}

is what DeepMIMO computes over the subcarriers. It takes plane waves over an array: near fields,
facets, edges and the diffuse background are in ``uplink.npz`` beside, element by element.
"""

import json
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.measurement.model import MeasurementError
from mmslam.output import OutputError, refuse_existing, replacing
from mmslam.pipeline import simulate
from scenes.scenario import Noise, Scenario

if TYPE_CHECKING:
    from simulator.scene.user_paths import UserPath

LAYOUT = "4.0.5"
"""Version of DeepMIMO whose layout is written."""

MOST_PATHS = 25
"""Paths of a user that DeepMIMO loads: the strongest are kept. [-]"""

MOST_INTERACTIONS = 10
"""Interactions of a path for which it has places. [-]"""

_PAIR = "t000_tx000_r001"  # set and number of the transmitter, set of the receivers


def to_deepmimo(scenario: Scenario, folder: str | Path, *, seed: int = 0) -> Path:
    """Write the paths between a scenario's base station and users as DeepMIMO loads them.

    Parameters
    ----------
    scenario
        In space, with users.
    folder
        To be made; its name, in small letters, is the scenario's name in DeepMIMO, which looks
        for it in its folder of scenarios (``deepmimo_scenarios``).
    seed
        Of the roughness, in the channels beside.

    Returns
    -------
    The folder: eleven matrices, ``params.json``, an empty scene, and ``uplink.npz`` with the
    channels of every element (``uplink``: users, elements, frequencies).

    Raises
    ------
    MeasurementError
        If there are no users, or the scenario has two dimensions.
    OutputError
        If the folder exists, or its name has capital letters.

    Examples
    --------
    >>> import mmslam
    >>> small = {"dimensions": 3, "radio.points": 5, "base_station.elements": [2, 2]}
    >>> small["users.ann.position_m"] = [0.3, 1.0, 0.2]
    >>> scenario = mmslam.load_scenario("point_scatterers", small)
    >>> folder = mmslam.to_deepmimo(scenario, "free_space")
    >>> (folder / "params.json").is_file()
    True
    """
    folder = Path(folder)
    if scenario.dimensions != 3 or not scenario.users or scenario.max_bounces < 1:
        raise MeasurementError(
            f"scenario {scenario.name!r}: dimensions = {scenario.dimensions}, max_bounces = "
            f"{scenario.max_bounces} and {len(scenario.users)} users; DeepMIMO's paths need 3, at "
            "least 1, and at least one user"
        )
    if folder.name != folder.name.lower():
        raise OutputError(f"{folder}: DeepMIMO looks for names in small letters; rename it")
    from simulator.materials.gas_absorption import refractive_index
    from simulator.scene.user_paths import user_paths  # Sionna's import takes seconds

    paths = user_paths(scenario)
    quiet = scenario.model_copy(update={"noise": Noise()})
    pilots = {one.user: one.samples for one in simulate(quiet, seed=seed).uplinks}
    elements = scenario.base_station.element_positions
    matrices = _matrices(list(paths.values()), refractive_index(scenario.air))
    matrices["rx_pos"] = np.array([user.position for user in scenario.users.values()])
    matrices["tx_pos"] = elements.mean(axis=0)[None]
    heard = [any(abs(one.gain) > 0 for one in some) for some in paths.values()]
    with replacing(folder, refuse_existing) as new:
        new.mkdir()
        for name, values in matrices.items():
            held: dict[str, Any] = {name: values.astype(np.float32)}
            np.savez_compressed(new / f"{name}_{_PAIR}.npz", **held)
        np.savez_compressed(new / "vertices.npz", vertices=np.zeros((0, 3), dtype=np.float32))
        (new / "objects.json").write_text("[]", encoding="utf-8")
        told = json.dumps(_parameters(scenario, sum(heard)), indent=2)
        (new / "params.json").write_text(told, encoding="utf-8")
        silent = np.zeros((len(elements), scenario.radio.points), dtype=np.complex128)
        np.savez_compressed(
            new / "uplink.npz",
            uplink=np.array([pilots.get(name, silent) for name in scenario.users]),
            element_position=elements,
            frequency=scenario.radio.frequencies,
            user=np.array(list(scenario.users)),
        )
    return folder


def _matrices(users: Sequence[Sequence["UserPath"]], index: float) -> dict[str, np.ndarray]:
    """Return powers [dB], phases and angles [degree], delays [s] and interactions of all paths."""
    shape = (len(users), MOST_PATHS)
    names = ("power", "phase", "delay", "aoa_az", "aoa_el", "aod_az", "aod_el", "inter")
    found = {name: np.full(shape, np.nan) for name in names}
    found["inter_pos"] = np.full((*shape, MOST_INTERACTIONS, 3), np.nan)
    for row, paths in enumerate(users):
        heard = [one for one in paths if abs(one.gain) > 0]
        for column, path in enumerate(heard[:MOST_PATHS]):
            places = path.vertices[::-1]  # from the base station onward
            place = row, column
            found["power"][place] = 20 * np.log10(abs(path.gain))
            found["phase"][place] = np.degrees(np.angle(path.gain))
            found["delay"][place] = path.length * index / speed_of_light
            found["aod_az"][place], found["aod_el"][place] = _angles(places[1] - places[0])
            found["aoa_az"][place], found["aoa_el"][place] = _angles(places[-2] - places[-1])
            codes = ["4" * count for count in path.slabs[::-1]]  # of what each leg goes through
            found["inter"][place] = float("1".join(codes) or 0)
            inner = places[1:-1][:MOST_INTERACTIONS]
            if not any(codes):  # places of transmission are not kept
                found["inter_pos"][(*place, slice(len(inner)))] = inner
    return found


def _angles(direction: Float[np.ndarray, " 3"]) -> tuple[float, float]:
    """Return azimuth from +x and angle from +z. [degree]."""
    x, y, z = direction / np.linalg.norm(direction)
    return float(np.degrees(np.arctan2(y, x))), float(np.degrees(np.arccos(np.clip(z, -1, 1))))


def _parameters(scenario: Scenario, heard: int) -> dict[str, Any]:
    most = scenario.max_bounces
    sets = {
        f"txrx_set_{number}": {
            "name": name,
            "id_orig": number,
            "id": number,
            "is_tx": number == 0,
            "is_rx": number == 1,
            "num_points": points,
            "num_active_points": active,
            "num_ant": 1,
            "dual_pol": False,
            "ant_rel_positions": [[0, 0, 0]],
            "array_orientation": [0, 0, 0],
            "grid_spacing": None,
        }
        for number, (name, points, active) in enumerate(
            [("base_station", 1, 1), ("users", len(scenario.users), heard)]
        )
    }
    tracer = {
        "raytracer_name": "mmslam",
        "raytracer_version": metadata.version("mmslam"),
        "frequency": scenario.radio.centre_frequency,
        "max_path_depth": most,
        "max_reflections": most,
        "max_diffractions": 0,
        "max_scattering": 0,
        "max_transmissions": most if scenario.effects.transmission else 0,
        "num_rays": 0,
        "synthetic_array": True,
        "raw_params": {},
    }
    scene = {"num_scenes": 1, "n_objects": 0, "n_vertices": 0, "n_faces": 0}
    return {
        "version": LAYOUT,
        "rt_params": tracer,
        "txrx_sets": sets,
        "materials": {},
        "scene": {**scene, "n_triangular_faces": 0, "objects": []},
    }
