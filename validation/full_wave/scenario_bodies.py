"""Conversion of a two-dimensional scenario to bodies of the full-wave solver.

A metal plate is a strip of zero thickness. A dielectric plate is a board: its front, on the array's
side, has the plate's position and roughness; its thickness extends behind it, and its back is flat.
Cylinders and boxes are solid: of metal, or of a homogeneous dielectric, which is the meaning of an
opaque material (of infinite thickness).
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light
from scipy.spatial import cKDTree

from scenes.realisations.object_surface import object_surface
from scenes.scenario import Scenario, ScenarioError
from scenes.schema.antenna import Antenna, GaussianBeam, Isotropic
from scenes.schema.objects import Box, Cylinder, MeshFile, Plate
from simulator.materials.fresnel_slab import Absorber, Conductor, Dielectric, Material
from simulator.scene.radio_scene import scenario_materials
from validation.full_wave.boundary_equations import Body
from validation.full_wave.conducting_contour import Contour, circle, closed_profile
from validation.full_wave.graded_contour import cornered_contour
from validation.full_wave.line_source import LineSource
from validation.full_wave.profile_scattering import POINTS_PER_WAVELENGTH, profile_body

PER_CORRELATION_LENGTH = 4.0
"""Grid points for each correlation length: the error of a board's echo is 1e-4 at slopes of 0.25
rms. [-]"""

PROFILE_POINTS = 10.0
"""Points of a profile for each correlation length: jumps in the third derivative of a spline
through fewer have an effect, 5e-4 of the echo at 4. [-]"""

LEAST_GAP = 3.0
"""Least distance of bodies from each other, and of antennas from bodies, in steps of the grid: the
quadrature needs fields that are smooth from point to point. [-]"""


@dataclass(frozen=True, kw_only=True)
class ScenarioBodies:
    """The bodies of a scenario, sampled for each frequency."""

    names: tuple[str, ...]
    make: tuple[Callable[[float], Body], ...]  # from a frequency in Hz

    def at(self, frequency: float) -> list[Body]:
        """Sample all bodies for a frequency in Hz."""
        return [one(frequency) for one in self.make]


def scenario_bodies(scenario: Scenario, *, seed: int, sample: int = 0) -> ScenarioBodies:
    """Freeze a scenario's surfaces and convert them to bodies.

    Parameters
    ----------
    scenario
        Two-dimensional.
    seed, sample
        Which realisation; the same as the simulator's.

    Raises
    ------
    ScenarioError
        If parts of the scenario cannot be solved for; the message lists all of them.
    """
    found = _general_problems(scenario)
    materials: dict[str, Material] = {}
    if scenario.dimensions == 2:
        materials = scenario_materials(scenario)
        for name, material in materials.items():
            found += _object_problems(scenario, name, material)
    if found:
        raise ScenarioError("\n".join(found))
    make = tuple(
        _maker(scenario, name, material, seed=seed, sample=sample)
        for name, material in materials.items()
    )
    bodies = ScenarioBodies(names=tuple(materials), make=make)
    if found := _gap_problems(scenario, bodies):
        raise ScenarioError("\n".join(found))
    return bodies


def line_source(
    scenario: Scenario, antenna: Antenna, position: Float[np.ndarray, " 3"]
) -> LineSource:
    """Return the line source of an antenna; a Gaussian beam has a complex position."""
    place = position[:2]
    if isinstance(antenna, GaussianBeam):
        aim = scenario.aim(antenna, position)[:2]
        return LineSource(position=place, aim=aim, width=antenna.sigma_rad)
    return LineSource(position=place)


def _general_problems(scenario: Scenario) -> list[str]:
    station, found = scenario.base_station, []
    if scenario.dimensions != 2:
        found.append(
            f"dimensions = {scenario.dimensions}: full wave solves 2 dimensions only; leave "
            "--full-wave out"
        )
    if scenario.waves != "cylindrical":
        found.append(
            f"waves = {scenario.waves!r}: full wave in 2-D has cylindrical waves; give "
            "--set waves=cylindrical"
        )
    if station.multistatic or station.transmit_offset is not None:
        found.append(
            "base_station: its antennas stand apart (transmit_offset_m, receivers or transmitter), "
            "but full wave takes an array that hears its own echo; remove these keys"
        )
    if not isinstance(station.antenna, Isotropic):
        found.append(
            f"base_station.antenna.kind = {station.antenna.kind!r}: full wave takes an isotropic "
            "array; remove the table base_station.antenna"
        )
    for name, user in scenario.users.items():
        if not isinstance(user.antenna, Isotropic | GaussianBeam):
            found.append(
                f"users.{name}.antenna.kind = {user.antenna.kind!r}: full wave takes 'isotropic' "
                "and 'gaussian_beam'; give one of them"
            )
    if scenario.points:
        found.append(
            f"points.{next(iter(scenario.points))}: a point target has no surface that full wave "
            "could solve for; give a small cylinder, or remove it"
        )
    if not scenario.objects:
        found.append("objects: there are none, and nothing to solve for; add a plate or a post")
    return found


def _object_problems(scenario: Scenario, name: str, material: Material) -> list[str]:
    body, key = scenario.objects[name], f"objects.{name}"
    if isinstance(body, MeshFile) or body.realisation is not None:
        return [f"{key}: full wave takes plates, cylinders and boxes, and no mesh file"]
    match material:
        case Absorber():
            return [
                f"{key}.material = 'absorber': no wave equation has a perfect absorber; remove "
                "the object, or give it a lossy dielectric"
            ]
        case Dielectric(thickness=thickness) if isinstance(body, Plate) and np.isinf(thickness):
            return [
                f"{key}.material: a plate of infinite thickness (an opaque material) has no back; "
                "give it a thickness_mm, such as 12.7"
            ]
        case Dielectric(thickness=thickness) if not isinstance(body, Plate | MeshFile):
            if np.isfinite(thickness):
                return [
                    f"{key}.material: a {body.kind} with walls of {thickness * 1e3:g} mm is "
                    "hollow, which full wave does not solve for; set thickness_mm = inf for a "
                    "solid one"
                ]
        case _:
            pass
    return []


def _maker(
    scenario: Scenario, name: str, material: Material, *, seed: int, sample: int
) -> Callable[[float], Body]:
    body = scenario.objects[name]
    spacing, detail = scenario.facet_spacing(name), np.inf
    rough = body.roughness is not None and body.roughness.rms > 0
    if body.roughness is not None and rough:
        detail = body.roughness.correlation_length / PER_CORRELATION_LENGTH
        spacing = min(spacing, body.roughness.correlation_length / PROFILE_POINTS)
    surface = object_surface(scenario, name, seed=seed, sample=sample, spacing=spacing)
    line = surface.vertices[:, :2]

    def value(frequency: float) -> complex | None:
        if isinstance(material, Conductor):
            return None
        assert isinstance(material, Dielectric)
        return complex(material.permittivity(np.array([frequency]))[0])

    def step(frequency: float) -> float:
        permittivity = value(frequency)
        index = 1.0 if permittivity is None else max(1.0, float(np.sqrt(permittivity).real))
        coarse = speed_of_light / frequency / index / POINTS_PER_WAVELENGTH
        return float(min(coarse, detail))

    match body:
        case Plate():
            # A board's front faces the left of its profile: towards the array.
            towards = scenario.base_station.element_positions.mean(axis=0) - body.centre
            front = line[::-1] if towards @ body.normal > 0 else line
            thickness = material.thickness if isinstance(material, Dielectric) else None

            def plate(frequency: float) -> Body:
                return profile_body(
                    front,
                    frequency,
                    permittivity=value(frequency),
                    thickness=thickness,
                    detail=detail,
                )

            return plate
        case Cylinder():

            def contour(frequency: float) -> Contour:
                if rough:
                    return closed_profile(line, spacing=step(frequency))
                return circle(body.centre[:2], body.radius_m, spacing=step(frequency))
        case Box():
            sides = _sides(body, surface.mean_vertices[:, :2], line)

            def contour(frequency: float) -> Contour:
                return cornered_contour(sides, [step(frequency)] * len(sides))
        case _:
            raise AssertionError(f"{name}: {body.kind}")
    return lambda frequency: Body(contour=contour(frequency), permittivity=value(frequency))


def _sides(
    box: Box, mean: Float[np.ndarray, "vertices 2"], line: Float[np.ndarray, "vertices 2"]
) -> list[Float[np.ndarray, "_ 2"]]:
    """Divide a box's outline at its corners."""
    along, across = box.length_m / 2 * box.tangent[:2], box.depth_m / 2 * box.across[:2]
    corners = [box.centre[:2] + one * along + two * across for one in (-1, 1) for two in (-1, 1)]
    at = sorted(int(np.argmin(np.hypot(*(mean - corner).T))) for corner in corners)
    around = np.concatenate([line, line[: at[0] + 1]])
    ends = [*at, len(line) + at[0]]
    sides = [around[first : last + 1] for first, last in pairwise(ends)]
    return [side if len(side) >= 4 else side[[0, -1]] for side in sides]


def _gap_problems(scenario: Scenario, bodies: ScenarioBodies) -> list[str]:
    """Return messages on bodies and antennas that are too close to each other."""
    frequency = float(scenario.radio.frequencies[-1])
    contours = [body.contour for body in bodies.at(frequency)]
    trees = [cKDTree(contour.points) for contour in contours]
    gaps = [LEAST_GAP * contour.spacing for contour in contours]
    found = []
    for one, other in combinations(range(len(trees)), 2):
        gap = max(gaps[one], gaps[other])
        near = float(np.min(trees[one].query(contours[other].points)[0]))
        if near < gap or _inside(contours[one], contours[other].points[:1])[0]:
            found.append(
                f"objects.{bodies.names[one]} and objects.{bodies.names[other]} are "
                f"{near * 1e3:.3g} mm apart or cross; full wave needs {gap * 1e3:.3g} mm between "
                "bodies: move one of them"
            )
    places = {
        "base_station": scenario.base_station.element_positions[:, :2],
        **{f"users.{name}": user.position[None, :2] for name, user in scenario.users.items()},
    }
    for key, points in places.items():
        for name, tree, contour, gap in zip(bodies.names, trees, contours, gaps, strict=True):
            near = float(np.min(tree.query(points)[0]))
            if near < gap or _inside(contour, points).any():
                found.append(
                    f"{key} is within objects.{name}, or {near * 1e3:.3g} mm from it; full wave "
                    f"needs {gap * 1e3:.3g} mm between antennas and bodies: move one of them"
                )
    return found


def _inside(contour: Contour, points: Float[np.ndarray, "points 2"]) -> np.ndarray:
    """Return which points are inside a closed contour, by its winding number."""
    if not contour.closed:
        return np.zeros(len(points), dtype=bool)
    away = contour.points - points[:, None]
    distance = np.einsum("pix,pix->pi", away, away)
    flux = np.sum(
        np.einsum("pix,ix->pi", away, contour.normals) * contour.weights / distance, axis=1
    )
    return np.asarray(flux > np.pi)
