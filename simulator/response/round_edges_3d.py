r"""A user's pilot diffracted round edges of opaque plates and boxes, in three dimensions.

Single diffraction at straight edges (UTD, [1]_): on each edge the place where the way from user to
element is shortest, which Keller's law names, with the angle :math:`\beta` between ray and edge,

.. math:: E = E_i \cdot D \sqrt{\frac{s'}{s (s + s')}}\, e^{-jks}, \qquad
          D_{s,h} = \frac{1}{\sin\beta}\, D\bigl(L = \tfrac{s s'}{s + s'} \sin^2\beta\bigr)

where the field along the edge and that across it have coefficients of their own
(:mod:`simulator.scattering.shadow_edge`). Edges end. Of an edge from :math:`t_0` to :math:`t_1`
about that place a share

.. math:: F = \frac{1}{1 - j} \int_{u_0}^{u_1} e^{-j\pi u^2/2}\, du, \qquad
          u = t \sin\beta \sqrt{\frac{k}{\pi}\Bigl(\frac1s + \frac1{s'}\Bigr)}

of the endless edge's wave arrives (stationary phase with finite limits), of which U, one or zero,
is geometrical. Of a screen Kirchhoff's field is the product over both axes, in which the product of
the two remainders F - U belongs to the corner; half of it is given to each of its edges, so that
an edge counts (U + F)/2 times. Pilots are continuous beside the corners of plates too; beside those
of boxes they may jump by some decibels.

As in two dimensions nothing is added where the facets of a conductor radiate the wave already. Left
out: diffraction at two and more edges, as behind a thick box, curved bodies and meshes, echoes,
chains of mirrors, and edges of what transmits waves.

References
----------
.. [1] R. G. Kouyoumjian and P. H. Pathak, "A uniform geometrical theory of diffraction for an edge
   in a perfectly conducting surface", Proc. IEEE 62 (1974) 1448, doi:10.1109/PROC.1974.9651.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Bool, Complex, Float
from scipy.constants import speed_of_light
from scipy.special import fresnel

from scenes.scenario import User
from scenes.schema.objects import Cylinder, MeshFile
from simulator.antennas.field_pattern import field_gain
from simulator.antennas.polarization import antenna_polarization
from simulator.geometry.ray_scene import blocked
from simulator.materials.fresnel_slab import Conductor
from simulator.scattering.shadow_edge import wedge_coefficient
from simulator.scene.radio_scene import RadioScene, scenario_materials
from simulator.specular.free_space import direct_wave

OUT = 2e-5
"""Distance from the edge at which rays to it end: ten times the least clearance of rays. [m]"""

LEAST_SINE = 1e-3
"""Sine of the angle between a ray and an edge below which nothing is diffracted: a ray along the
edge has no place of diffraction. [-]"""


@dataclass(frozen=True, kw_only=True)
class Edge3D:
    """A straight edge of a body."""

    start: Float[np.ndarray, " 3"]  # [m]
    along: Float[np.ndarray, " 3"]  # unit vector
    length: float  # [m]
    inward: Float[np.ndarray, "faces 3"]  # unit vectors along the one or two faces
    exterior: float  # exterior angle (filled with air), over π [-]
    conducts: bool

    def angles(self, ways: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
        """Angles about the edge from its first face through the air to directions. [rad]."""
        first = self.inward[0]
        across = np.cross(self.along, first)
        if len(self.inward) == 2 and across @ self.inward[1] > 0:
            across = -across  # the second face is reached last, through the air
        return np.asarray(np.remainder(np.arctan2(ways @ across, ways @ first), 2 * np.pi))

    def crossings(
        self,
        user: Float[np.ndarray, " 3"],
        elements: Float[np.ndarray, "n 3"],
        otherwise: Float[np.ndarray, " n"],
    ) -> Float[np.ndarray, " n"]:
        """Places along the edge at which straight lines cross its body's middle plane. [m].

        There the edge's end casts its shadow. Lines that do not cross it have another value.
        """
        inward = self.inward.sum(axis=0)
        normal = np.cross(self.along, inward)
        starts, ends = (user - self.start) @ normal, (elements - self.start) @ normal
        crosses = starts * ends < 0
        share = np.divide(starts, starts - ends, out=np.zeros(len(elements)), where=crosses)
        first, last = (user - self.start) @ self.along, (elements - self.start) @ self.along
        return np.where(crosses, first + share * (last - first), otherwise)


def pilot_round_edges_3d(scene: RadioScene, user: User) -> Complex[np.ndarray, "elements freqs"]:
    """Sum a user's pilot over single diffraction at edges.

    Parameters
    ----------
    scene
        The frozen scene, of three dimensions.
    user
        The transmitting user.

    Returns
    -------
    S-parameter at each element. [-]
    """
    pilot = np.zeros((len(scene.elements), scene.scenario.radio.points), dtype=np.complex128)
    for edge in scene_edges_3d(scene):
        some, wave = _round_edge(scene, user, edge)
        pilot[some] += wave
    return pilot


def scene_edges_3d(scene: RadioScene) -> Iterator[Edge3D]:
    """Yield the edges of opaque plates and boxes."""
    scenario, materials = scene.scenario, scenario_materials(scene.scenario)
    up = np.array([0.0, 0.0, 1.0])
    for name, body in scenario.objects.items():
        if isinstance(body, Cylinder | MeshFile) or name in scene.slabs.owners:
            continue
        axes = [body.tangent, up] if body.kind == "plate" else [body.tangent, body.across, up]
        height = 0.0 if body.height_m is None else body.height_m
        sizes = [body.length_m, height]
        if body.kind == "box":
            sizes = [body.length_m, body.depth_m, height]
        for place, (along, length) in enumerate(zip(axes, sizes, strict=True)):
            others = [index for index in range(len(axes)) if index != place]
            for signs in product((-1.0, 1.0), repeat=len(others)):
                middle = body.centre + sum(
                    (
                        sign * sizes[other] / 2 * axes[other]
                        for sign, other in zip(signs, others, strict=True)
                    ),
                    np.zeros(3),
                )
                yield Edge3D(
                    start=middle - length / 2 * along,
                    along=along,
                    length=length,
                    inward=np.stack(
                        [-sign * axes[other] for sign, other in zip(signs, others, strict=True)]
                    ),
                    exterior=2.0 if body.kind == "plate" else 1.5,
                    conducts=isinstance(materials[name], Conductor),
                )


def _round_edge(
    scene: RadioScene, user: User, edge: Edge3D
) -> tuple[np.ndarray, Complex[np.ndarray, "some freqs"]]:
    """Return which elements one edge reaches, and the wave there."""
    elements, frequencies = scene.elements, scene.scenario.radio.frequencies
    there, here = user.position - edge.start, elements - edge.start
    heights = float(there @ edge.along), here @ edge.along
    aside = there - heights[0] * edge.along, here - heights[1][:, None] * edge.along
    radii = float(np.linalg.norm(aside[0])), np.linalg.norm(aside[1], axis=-1)
    share = radii[0] / np.maximum(radii[0] + radii[1], 1e-12)
    place = heights[0] + share * (heights[1] - heights[0])
    incident, outgoing = edge.angles(aside[0][None]), edge.angles(aside[1])
    near = edge.start + np.clip(place, 0.0, edge.length)[:, None] * edge.along
    outward = -edge.inward.sum(axis=0)
    near = near + OUT * outward / np.linalg.norm(outward)
    hidden = blocked(scene.rays, near, np.broadcast_to(user.position, near.shape))
    hidden |= blocked(scene.rays, near, elements)
    rays = edge.start + place[:, None] * edge.along
    ways = rays - user.position, elements - rays
    lengths = np.linalg.norm(ways[0], axis=-1), np.linalg.norm(ways[1], axis=-1)
    sine = radii[1] / np.maximum(lengths[1], 1e-12)
    done = _facets_do(edge, scene, incident, outgoing)
    some = np.flatnonzero(~hidden & ~done & (sine > LEAST_SINE) & (radii[0] > 0))
    if some.size == 0:
        return some, np.empty((0, frequencies.size), dtype=np.complex128)
    before, beyond, sine = lengths[0][some], lengths[1][some], sine[some]
    sent, received = (
        way[some] / length[some, None] for way, length in zip(ways, lengths, strict=True)
    )
    wavenumbers = 2 * np.pi * frequencies / speed_of_light
    along, across = _polarized(scene, user, edge, sent, received)
    wave = np.zeros((some.size, frequencies.size), dtype=np.complex128)
    for share_of_field, reflection in ((along, -1.0), (across, 1.0)):
        coefficient = wedge_coefficient(
            float(incident[0]),
            outgoing[some],
            before * sine**2,
            beyond * sine**2,
            wavenumbers,
            exterior=edge.exterior,
            reflection=reflection if edge.conducts else 0.0,
        )
        wave += share_of_field[:, None] * coefficient
    bend = sine**2 * (1 / before + 1 / beyond)
    crossing = edge.crossings(user.position, elements, place)
    wave *= _ends(edge.length, place[some], crossing[some], bend, wavenumbers)
    wave *= direct_wave(before + beyond, frequencies, waves="spherical")
    wave *= (_gains(scene, user, sent, received) / sine * np.sqrt(1 / before + 1 / beyond))[:, None]
    return some, wave


def _gains(
    scene: RadioScene,
    user: User,
    sent: Float[np.ndarray, "some 3"],
    received: Float[np.ndarray, "some 3"],
) -> Float[np.ndarray, " some"]:
    """Return the product of both antennas' patterns along the rays. [-]."""
    scenario, station = scene.scenario, scene.scenario.base_station
    aims = (
        scenario.aim(user.antenna, user.position),
        scenario.aim(station.antenna, scene.elements.mean(axis=0)),
    )
    gain = field_gain(user.antenna, aims[0], sent)
    return np.asarray(gain * field_gain(station.antenna, aims[1], -received))


def _polarized(
    scene: RadioScene,
    user: User,
    edge: Edge3D,
    sent: Float[np.ndarray, "some 3"],
    received: Float[np.ndarray, "some 3"],
) -> tuple[Float[np.ndarray, " some"], Float[np.ndarray, " some"]]:
    """Return what both antennas share of the field along the edge's plane, and across it. [-].

    Both signs are those of the forward direction, where the wave keeps its polarization.
    """
    scenario, station = scene.scenario, scene.scenario.base_station
    ends = (
        antenna_polarization(user.antenna, scenario.aim(user.antenna, user.position)),
        antenna_polarization(
            station.antenna, scenario.aim(station.antenna, scene.elements.mean(axis=0))
        ),
    )
    fields = ends[0].field(sent), ends[1].field(-received)
    parts = []
    for way, field in zip((sent, received), fields, strict=True):
        across = np.cross(edge.along, way)
        across /= np.linalg.norm(across, axis=-1, keepdims=True)
        along = np.cross(across, way)
        parts.append([np.einsum("ex,ex->e", field, axis) for axis in (along, across)])
    return parts[0][0] * parts[1][0], parts[0][1] * parts[1][1]


def _ends(
    length: float,
    place: Float[np.ndarray, " some"],
    crossing: Float[np.ndarray, " some"],
    bend: Float[np.ndarray, " some"],
    wavenumbers: Float[np.ndarray, " freqs"],
) -> Complex[np.ndarray, "some freqs"]:
    """Return how often the wave of the endless edge counts. [-]."""
    scale = np.sqrt(bend[:, None] * wavenumbers / np.pi)
    low, high = (fresnel(scale * (end - place)[:, None]) for end in (0.0, length))
    share = ((high[1] - low[1]) - 1j * (high[0] - low[0])) / (1 - 1j)
    on_it = (crossing >= 0.0) & (crossing <= length)
    return np.asarray((on_it[:, None] + share) / 2)


def _facets_do(
    edge: Edge3D,
    scene: RadioScene,
    incident: Float[np.ndarray, " 1"],
    outgoing: Float[np.ndarray, " n"],
) -> Bool[np.ndarray, " n"]:
    """Return for which elements the facets of a conductor already radiate the diffracted wave."""
    if not edge.conducts or scene.scenario.max_bounces == 0:
        return np.zeros(outgoing.shape, dtype=bool)
    if len(edge.inward) == 1:  # a plate: both before it, or both behind
        return np.asarray((incident < np.pi) == (outgoing < np.pi))
    last = edge.exterior * np.pi
    first = (incident < np.pi) & (outgoing < np.pi)
    second = (incident > last - np.pi) & (outgoing > last - np.pi)
    return np.asarray(first | second)
