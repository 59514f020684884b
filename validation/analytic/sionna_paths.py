"""Our specular chains against Sionna RT's deterministic path solver, on random 3-D scenes.

Both use the same positions and material constants, nothing else: our chains are images in double
precision with an analytic occlusion test; Sionna's are candidates from launched rays in single
precision, with Mitsuba's intersections.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Complex, Float
from scipy.constants import epsilon_0, speed_of_light
from scipy.spatial.transform import Rotation

from simulator.geometry.mirrors import Mirrors
from simulator.materials.fresnel_slab import Conductor, Dielectric, Material
from simulator.materials.permittivity import ConstantPermittivity
from simulator.specular.image_method import Blocked, find_chains
from simulator.specular.path_field import reflected_field

FREQUENCY = 275e9  # [Hz]
LIMIT_LENGTH = 1e-6  # largest difference of lengths [m]
LIMIT_AMPLITUDE = 0.01  # of amplitudes, over the larger of Sionna's and NULL times free space's [-]

EDGE = 1e-4
"""Distance from an edge below which a path may exist in one result only: Sionna's hits are in
single precision, whose rounding over some metres and several reflections is a few µm. [m]"""

SHORTEST_LEG = 1e-2
"""Shortest leg of a compared path: the path solver drops legs below MIN_SEGMENT_LENGTH. [m]"""

RAYS = 300_000
"""Rays that the path solver launches to find candidates. [-]"""

THICKNESS = (0.5e-3, 5e-3)
"""Range of slab thickness. Beyond some 80 rad of phase across the slab the error of Dr.Jit's
single-precision sine is 1e-4 and more, measured on the solver's own slab formula. [m]"""

NULL = 0.01
"""Least coefficient in the relative error (near a slab's null or Brewster's angle): rounding hits
to 1 µm on a leg of centimetres changes the angle by 1e-4, and the coefficient by as much. [-]"""


@dataclass(frozen=True)
class RandomScene:
    """Plates and boxes, with a source and receivers among them."""

    objects: list[Float[np.ndarray, "_ 4 3"]]  # corners of the faces of each [m]
    constants: list[tuple[complex, float]]  # permittivity and thickness [m] of each
    points: Float[np.ndarray, "points 3"]  # one source, then receivers [m]

    @property
    def corners(self) -> Float[np.ndarray, "mirrors 4 3"]:
        """Corners of all faces [m]."""
        return np.concatenate(self.objects)


@dataclass(frozen=True)
class Path:
    """A specular path."""

    length: float  # [m]
    amplitude: complex  # without the delay's phase [-]
    points: Float[np.ndarray, "points 3"]  # source, hits, receiver [m]

    @property
    def shortest_leg(self) -> float:
        """Length of its shortest leg [m]."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).min())


Paths = dict[tuple[int, tuple[int, ...]], Path]  # by receiver and sequence of faces


def _plate_or_box(rng: np.random.Generator, upright: bool) -> np.ndarray:
    box = rng.random() < 0.3
    half = rng.uniform(0.05, 0.15, 3) if box else np.array([*rng.uniform(0.12, 0.38, 2), 0.0])
    faces = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            face = np.empty((4, 3))
            face[:, axis] = side
            face[:, (axis + 1) % 3] = side * np.array([-1, 1, 1, -1])
            face[:, (axis + 2) % 3] = [-1, -1, 1, 1]
            faces.append(face * half)
    quadrilaterals = np.array(faces if box else faces[-1:])
    if upright:  # like the walls of most scenes; a plate stands on its edge
        stand = np.eye(3) if box else Rotation.from_euler("x", 90, degrees=True).as_matrix()
        turn = Rotation.from_euler("z", rng.uniform(0, 2 * np.pi)).as_matrix() @ stand
    else:
        turn = Rotation.random(rng=rng).as_matrix()
    moved: np.ndarray = quadrilaterals @ turn.T + rng.uniform(-0.5, 0.5, 3)
    return moved


def _crossings(corners: np.ndarray, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return which segments (first axis) cross which rectangles (second axis)."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0]
    normals = np.cross(first, second)
    before = np.einsum("smx,mx->sm", starts[:, None] - corners[:, 0], normals)
    after = np.einsum("smx,mx->sm", ends[:, None] - corners[:, 0], normals)
    crosses: np.ndarray = before * after < 0
    share = np.divide(before, before - after, out=np.zeros_like(before), where=crosses)
    hits = starts[:, None] + share[..., None] * (ends - starts)[:, None] - corners[:, 0]
    for side in (first, second):
        along = np.einsum("smx,mx->sm", hits, side) / np.einsum("mx,mx->m", side, side)
        crosses &= (along >= 0) & (along <= 1)
    return crosses


def _edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return faces.reshape(-1, 3), np.roll(faces, -1, axis=1).reshape(-1, 3)


def _holds(faces: np.ndarray, point: np.ndarray) -> bool:
    """Return whether a point is inside a box."""
    normals = np.cross(faces[:, 1] - faces[:, 0], faces[:, 3] - faces[:, 0])
    return len(faces) > 1 and bool(np.all(np.sum(normals * (point - faces[:, 0]), axis=1) < 0))


def random_scene(seed: int) -> RandomScene:
    """Return six to nine plates and boxes in a cubic metre that do not intersect."""
    rng = np.random.default_rng(seed)
    objects: list[np.ndarray] = []
    count = rng.integers(6, 10)
    while len(objects) < count:
        new = _plate_or_box(rng, upright=seed % 3 == 0)
        if not any(
            _crossings(new, *_edges(old)).any()
            or _crossings(old, *_edges(new)).any()
            or _holds(old, new[0, 0])
            or _holds(new, old[0, 0])
            for old in objects
        ):
            objects.append(new)
    points: list[np.ndarray] = []
    while len(points) < 9:
        point = rng.uniform(-0.5, 0.5, 3)
        if not any(_holds(faces, point) for faces in objects):
            points.append(point)
    constants = [
        (1.0 - 1e9j, 0.1)  # practically a conductor
        if rng.random() < 0.3
        else (complex(rng.uniform(1.5, 6.0), -rng.uniform(0.0, 0.3)), rng.uniform(*THICKNESS))
        for _ in objects
    ]
    return RandomScene(objects, constants, np.array(points))


def our_paths(scene: RandomScene, blocked: Blocked | None = None) -> Paths:
    """Find chains of up to three mirrors; occlusion is analytic unless ``blocked`` is given."""
    surfaces: list[Material] = []
    for (permittivity, thickness), faces in zip(scene.constants, scene.objects, strict=True):
        perfect = permittivity.imag < -1e6
        slab = Dielectric(
            permittivity=ConstantPermittivity(value=permittivity), thickness=thickness
        )
        surfaces += [Conductor() if perfect else slab] * len(faces)
    sides = [len(faces) == 1 for faces in scene.objects for _ in faces]
    mirrors = Mirrors(
        corners=scene.corners,
        materials=tuple(surfaces),
        rms_heights=np.zeros(len(surfaces)),
        two_sided=np.array(sides),
    )
    source, receivers = scene.points[:1], scene.points[1:]

    def crossed(starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
        met: np.ndarray = np.any(_crossings(scene.corners, starts, ends), axis=1)
        return met

    found = {}
    for chain in find_chains(mirrors, source, receivers, blocked=blocked or crossed):
        field = reflected_field(mirrors, chain, np.array([FREQUENCY]))[:, 0]
        spread = speed_of_light / FREQUENCY / (4 * np.pi * chain.lengths)
        for index, receiver in enumerate(np.nonzero(chain.valid)[1].tolist()):
            points = np.array([source[0], *chain.vertices[index], receivers[receiver]])
            found[receiver, chain.mirrors] = Path(
                float(chain.lengths[index]), complex(field[index] * spread[index]), points
            )
    return found


def solver_scene(scene: RandomScene) -> tuple[Any, list[Any]]:
    """Build Sionna's scene, and its objects in our order."""
    import mitsuba as mi
    import sionna.rt as rt

    theirs = rt.Scene()
    theirs.frequency = FREQUENCY
    theirs.tx_array = rt.PlanarArray(num_rows=1, num_cols=1, pattern="iso", polarization="V")
    theirs.rx_array = theirs.tx_array
    bodies = []
    for index, (faces, (permittivity, thickness)) in enumerate(
        zip(scene.objects, scene.constants, strict=True)
    ):
        first = 4 * np.arange(len(faces))[:, None, None]
        triangles = first + np.array([[0, 1, 2], [0, 2, 3]])
        mesh = mi.Mesh(f"object-{index}", 4 * len(faces), 2 * len(faces))
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = mi.Float(faces.ravel().astype(np.float32))
        parameters["faces"] = mi.UInt32(triangles.ravel().astype(np.uint32))
        parameters.update()
        material = rt.RadioMaterial(
            f"material-{index}",
            relative_permittivity=permittivity.real,
            conductivity=-permittivity.imag * 2 * np.pi * FREQUENCY * epsilon_0,
            thickness=thickness,
        )
        bodies.append(rt.SceneObject(mi_mesh=mesh, name=f"object-{index}", radio_material=material))
    theirs.edit(add=bodies)
    return theirs, bodies


class Solved(NamedTuple):
    """Result of the path solver, for one source and single antennas."""

    bodies: list[Any]  # as the scene's objects
    valid: Bool[np.ndarray, "receivers paths"]
    delays: Float[np.ndarray, "receivers paths"]  # [s]
    amplitudes: Complex[np.ndarray, "receivers paths"]  # [-]
    kinds: np.ndarray  # of interaction, [depth, receivers, paths]; 0 beyond the last
    shapes: np.ndarray  # body of each interaction
    triangles: np.ndarray  # triangle of each, in its body
    vertices: np.ndarray  # point of each, with x, y, z last [m]

    def points(
        self, scene: RandomScene, receiver: int, index: int
    ) -> Float[np.ndarray, "points 3"]:
        """Return the points of a path: source, interactions, receiver. [m]."""
        depth = int(np.count_nonzero(self.kinds[:, receiver, index]))
        hits = self.vertices[:depth, receiver, index].astype(float)
        return np.array([scene.points[0], *hits, scene.points[1 + receiver]])


def solved(scene: RandomScene, *, max_depth: int, refraction: bool) -> Solved:
    """Run the path solver on a scene."""
    import sionna.rt as rt

    theirs, bodies = solver_scene(scene)
    theirs.add(rt.Transmitter("source", position=scene.points[0].tolist()))
    for index, point in enumerate(scene.points[1:]):
        theirs.add(rt.Receiver(f"receiver-{index}", position=point.tolist()))
    paths = rt.PathSolver(deterministic=True)(
        theirs,
        max_depth=max_depth,
        samples_per_src=RAYS,
        los=True,
        specular_reflection=True,
        diffuse_reflection=False,
        refraction=refraction,
        synthetic_array=False,
        seed=1,
    )
    valid, delays = (field.numpy()[:, 0, 0, 0] for field in (paths.valid, paths.tau))
    amplitudes = (paths.a[0].numpy() + 1j * paths.a[1].numpy())[:, 0, 0, 0]
    kinds, shapes, triangles, vertices = (
        field.numpy()[:, :, 0, 0, 0]
        for field in (paths.interactions, paths.objects, paths.primitives, paths.vertices)
    )
    return Solved(bodies, valid, delays, amplitudes, kinds, shapes, triangles, vertices)


def solver_paths(scene: RandomScene) -> Paths:
    """Return the path solver's paths of up to three bounces."""
    them = solved(scene, max_depth=3, refraction=False)
    first_face = dict(
        zip(
            [body.object_id for body in them.bodies],
            np.cumsum([0, *map(len, scene.objects[:-1])]).tolist(),
            strict=True,
        )
    )
    found = {}
    for receiver, index in np.argwhere(them.valid).tolist():
        points = them.points(scene, receiver, index)
        sequence = tuple(
            first_face[int(them.shapes[bounce, receiver, index])]
            + int(them.triangles[bounce, receiver, index]) // 2
            for bounce in range(len(points) - 2)
        )
        key = (receiver, sequence)
        if key in found:
            raise ValueError(f"the path solver has found the chain {key} twice")
        found[key] = Path(
            float(them.delays[receiver, index]) * speed_of_light,
            complex(them.amplitudes[receiver, index]),
            points,
        )
    return found


def distance_from_edges(path: Path, corners: np.ndarray) -> float:
    """Return the shortest distance between any leg of a path and any edge of the scene. [m]."""
    starts, ends = _edges(corners)
    nearest = np.inf
    for here, there in zip(path.points[:-1], path.points[1:], strict=True):
        leg, side, gap = there - here, ends - starts, starts - here
        # Closest points of two segments: stationary point, clipped to one, then to the other.
        a, b, c = leg @ leg, side @ leg, np.sum(side**2, axis=1)
        d, e = gap @ leg, np.sum(gap * side, axis=1)
        determinant = np.maximum(a * c - b**2, 1e-30)
        on_leg = np.clip((d * c - b * e) / determinant, 0, 1)
        on_side = np.clip((b * on_leg - e) / c, 0, 1)
        on_leg = np.clip((d + b * on_side) / a, 0, 1)
        apart = gap + on_side[:, None] * side - on_leg[:, None] * leg
        nearest = min(nearest, float(np.linalg.norm(apart, axis=1).min()))
    return nearest


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Comparison of the paths of both methods in one scene."""

    bounces: tuple[int, ...]  # of each path found by both
    length: float  # largest difference of lengths [m]
    amplitude: float  # largest difference of amplitudes, relative to Sionna's [-]
    alone: tuple[tuple[int, tuple[int, ...]], ...]  # found by one only, far from edges

    @property
    def passed(self) -> bool:
        """Whether they agree within :data:`LIMIT_LENGTH` and :data:`LIMIT_AMPLITUDE`."""
        close = self.length <= LIMIT_LENGTH and self.amplitude < LIMIT_AMPLITUDE
        return close and bool(self.bounces) and not self.alone


def compare_paths(scene: RandomScene) -> Comparison:
    """Find the paths of a scene by both methods.

    Paths within :data:`EDGE` of an edge, or with a leg that the solver drops, may be found by one
    only.
    """
    ours, theirs = our_paths(scene), solver_paths(scene)
    alone = []
    for key in sorted(ours.keys() ^ theirs.keys()):
        path = ours[key] if key in ours else theirs[key]
        undecided = distance_from_edges(path, scene.corners) < EDGE
        if not undecided and not (key in ours and path.shortest_leg < SHORTEST_LEG):
            alone.append(key)
    both = sorted(ours.keys() & theirs.keys())
    lengths = [abs(ours[key].length - theirs[key].length) for key in both]
    amplitudes = []
    for key in both:
        free_space = speed_of_light / FREQUENCY / (4 * np.pi * ours[key].length)
        scale = max(abs(theirs[key].amplitude), NULL * free_space)
        amplitudes.append(abs(ours[key].amplitude - theirs[key].amplitude) / scale)
    return Comparison(
        bounces=tuple(len(sequence) for _, sequence in both),
        length=max(lengths, default=0.0),
        amplitude=max(amplitudes, default=0.0),
        alone=tuple(alone),
    )
