"""Our paths through slabs against Sionna RT's with refraction, on random 3-D scenes.

Both model thin plates whose coefficient multiplies the field. Sionna's paths ignore the air in the
slab's place and the refraction of rays, which affects the phase only.
"""

from dataclasses import dataclass

import numpy as np
from scipy.constants import speed_of_light

from simulator.geometry.mirrors import Mirrors
from simulator.geometry.slabs import Slabs
from simulator.materials.fresnel_slab import Dielectric
from simulator.materials.permittivity import ConstantPermittivity
from simulator.specular.image_method import find_chains
from simulator.specular.path_field import specular_response
from validation.analytic.sionna_paths import (
    EDGE,
    FREQUENCY,
    SHORTEST_LEG,
    THICKNESS,
    Path,
    RandomScene,
    distance_from_edges,
    random_scene,
    solved,
)

REFRACTION = 4
"""Sionna's code of an interaction by transmission. [-]"""

MOST_MET = 3
"""Most interactions of a path, reflections and transmissions together. [-]"""

WEAKEST_DB = 30.0
"""Level below a receiver's strongest path down to which paths are compared. [dB]"""

Met = tuple[int, bool]
"""A plate, and whether the path is transmitted by it."""

Paths = dict[tuple[int, tuple[Met, ...]], Path]
"""Paths by receiver and sequence of interactions."""


def slab_scene(seed: int) -> RandomScene:
    """Return upright and tilted plates in a cubic metre, all of them slabs."""
    drawn, rng = random_scene(seed), np.random.default_rng((seed, 17))
    plates = [faces for faces in drawn.objects if len(faces) == 1]
    constants = [
        (complex(rng.uniform(1.5, 6.0), -rng.uniform(0.0, 0.1)), rng.uniform(*THICKNESS))
        for _ in plates
    ]
    return RandomScene(plates, constants, drawn.points)


def our_paths(scene: RandomScene) -> Paths:
    """Find paths with up to three interactions with plates."""
    materials = tuple(
        Dielectric(permittivity=ConstantPermittivity(value=value), thickness=thickness)
        for value, thickness in scene.constants
    )
    mirrors = Mirrors(
        corners=scene.corners,
        materials=materials,
        rms_heights=np.zeros(len(materials)),
        two_sided=np.ones(len(materials), dtype=bool),
    )
    slabs = Slabs(faces=mirrors, owners=tuple(f"plate {n}" for n in range(len(materials))))
    source, receivers = scene.points[:1], scene.points[1:]
    found: Paths = {}
    for chain in find_chains(
        mirrors, source, receivers, blocked=lambda a, b: np.zeros(len(a), dtype=bool), slabs=slabs
    ):
        response = specular_response(
            mirrors, [chain], np.array([FREQUENCY]), (1, len(receivers)), slabs=slabs
        )[0, :, 0]
        for index, receiver in enumerate(np.nonzero(chain.valid)[1].tolist()):
            points = np.array([source[0], *chain.vertices[index], receivers[receiver]])
            crossed = chain.crossed[index].tolist() if chain.crossed is not None else []
            met: list[Met] = []
            for leg, one in enumerate(crossed):
                way = points[leg : leg + 2]
                faces = [face for face in range(len(slabs)) if one >> face & 1]
                heights = [abs(float(mirrors.heights(way[0], face))) for face in faces]
                across = [abs(float(mirrors.normals[f] @ (way[1] - way[0]))) for f in faces]
                order = np.argsort(np.divide(heights, across))
                met += [(faces[place], True) for place in order]
                met += [(chain.mirrors[leg], False)] if leg < len(chain.mirrors) else []
            if len(met) <= MOST_MET:
                path = Path(float(chain.lengths[index]), complex(response[receiver]), points)
                found[receiver, tuple(met)] = path
    return found


def solver_paths(scene: RandomScene) -> Paths:
    """Return the path solver's paths, with refraction."""
    them = solved(scene, max_depth=MOST_MET, refraction=True)
    plate = {body.object_id: index for index, body in enumerate(them.bodies)}
    found: Paths = {}
    for receiver, index in np.argwhere(them.valid).tolist():
        points = them.points(scene, receiver, index)
        met = tuple(
            (
                plate[int(them.shapes[step, receiver, index])],
                bool(them.kinds[step, receiver, index] == REFRACTION),
            )
            for step in range(len(points) - 2)
        )
        length = float(them.delays[receiver, index]) * speed_of_light
        found[receiver, met] = Path(length, complex(them.amplitudes[receiver, index]), points)
    return found


@dataclass(frozen=True, kw_only=True)
class Compared:
    """Comparison of the paths of both methods in one scene."""

    through: int  # paths through at least one slab, found by both
    level: float  # largest difference of levels [dB]
    length: float  # largest difference of lengths [m]
    alone: tuple[tuple[int, tuple[Met, ...]], ...]  # found by one only, far from edges


def compare_transmission(scene: RandomScene) -> Compared:
    """Compare the paths of a scene by both methods, without faint ones and those near edges."""
    ours, theirs = our_paths(scene), solver_paths(scene)
    strongest: dict[int, float] = {}
    for found in (ours, theirs):
        for (receiver, _), path in found.items():
            strongest[receiver] = max(strongest.get(receiver, 0.0), abs(path.amplitude))
    alone, both = [], []
    for key in sorted(ours.keys() | theirs.keys()):
        path = ours.get(key) or theirs[key]
        faint = 10 ** (-WEAKEST_DB / 20) * strongest[key[0]]
        if abs(path.amplitude) < faint or distance_from_edges(path, scene.corners) < EDGE:
            continue
        if key in ours and key in theirs:
            both.append(key)
        elif not (key in ours and path.shortest_leg < SHORTEST_LEG):
            alone.append(key)
    levels = [abs(20 * np.log10(abs(ours[k].amplitude / theirs[k].amplitude))) for k in both]
    return Compared(
        through=sum(any(through for _, through in key[1]) for key in both),
        level=float(max(levels, default=0.0)),
        length=max((abs(ours[k].length - theirs[k].length) for k in both), default=0.0),
        alone=tuple(alone),
    )
