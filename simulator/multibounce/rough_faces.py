"""Rough faces in chains of surfaces: small-slope weights as monopole and dipole sources.

Chains use the weights of :mod:`simulator.scattering.small_slope_2d` at one frequency, over the
tangent plane's coefficient there, and no fringe currents at edges. The second order is evaluated
for the direction to the middle of the target's visible part.
"""

from typing import Any

import numpy as np
from jaxtyping import Bool, Complex64, Float, Float32

from simulator.geometry.faces import Face
from simulator.scattering.small_slope_2d import MOST_ALONG, RoughLine, kernels

LEAST_SPAN = 1e-3
"""Least half angle between the directions at which a rough wall's weights are matched. [rad]"""

MOST_OBLIQUE = np.radians(89.0)
"""Most oblique direction at which they are evaluated. [rad]"""

OUTLINE = 16
"""Facets of a target that represent the directions to it. [-]"""


def rough_sources(
    wall: Face,
    origins: Float[np.ndarray, "ports wall 2"],
    targets: Float[np.ndarray, "target 2"],
    seen: Bool[np.ndarray, "wall target"],
    frequency: float,
) -> Float32[np.ndarray, "3 ports wall"] | Complex64[np.ndarray, "3 ports wall"]:
    r"""Write a rough wall's weights as a monopole and a dipole at each facet.

    The weight :math:`2B/QR` (:mod:`simulator.scattering.small_slope_2d`, first order) is in place
    of :math:`\cos\theta_{in} + \cos\theta_{out}`. It is matched in three directions that span the
    target's visible part by :math:`a + b\,\hat u\cdot\hat t + c\,\hat u\cdot\hat n`: between them
    the error is of third order in the angle they span.

    Parameters
    ----------
    wall
        The face, some of it rough.
    origins
        Origins of the wave. [m]
    targets, seen
        Facets to which it propagates, and which facets of the wall see them.
    frequency
        At which a dielectric's kernels are evaluated, over its coefficient there. [Hz]

    Returns
    -------
    a, b and c; 0, 0 and 1 for smooth facets. [-]
    """
    normal = wall.normals
    tangent = normal[:, ::-1] * np.array([-1.0, 1.0])
    met = targets[seen.any(axis=0)]
    middle = met.mean(axis=0)
    met = met[np.linspace(0, len(met) - 1, min(len(met), OUTLINE)).round().astype(np.int64)]
    ways = unit(met[:, None] - wall.centres)  # [met, wall, 2]
    along, upright = np.einsum("mwx,wx->mw", ways, tangent), np.einsum("mwx,wx->mw", ways, normal)
    angle = np.arctan2(along, upright)
    low, high = angle.min(axis=0), angle.max(axis=0)
    margin = np.maximum((high - low) / 2, LEAST_SPAN)
    centre = np.clip((low + high) / 2, -MOST_OBLIQUE, MOST_OBLIQUE)
    arriving = unit(origins - wall.centres)
    sent = _ways(arriving, tangent, normal)
    flat = half_angle_cosines(wall, origins, middle)
    at = np.array([frequency])
    how: dict[str, Any] = {"polarization": wall.polarization, "half_space": True}
    shape = sent[0].shape
    columns, values = [], []
    for share in (-1.0, 0.0, 1.0):
        # If the middle is at a limit, the three angles must still differ.
        limit = MOST_OBLIQUE + LEAST_SPAN
        out = np.clip(centre + share * margin, -limit, limit)
        receive = np.broadcast_to(np.sin(out), shape), np.broadcast_to(np.cos(out), shape)
        columns.append(np.stack([np.ones_like(out), np.sin(out), np.cos(out)], axis=-1))
        pair = [(t.ravel(), q.ravel()) for t, q in (sent, receive)]
        bragg = kernels(wall.material, pair[0], pair[1], at, **how).bragg.reshape(shape)
        values.append(2 * bragg / (sent[1] + receive[1]))
    # Angle of the mirror at which the table's coefficient is taken.
    ones = flat.ravel()
    sides = np.sqrt(1 - ones**2), ones
    mirrored = kernels(wall.material, (-sides[0], ones), (sides[0], ones), at, **how).mirror
    coefficient = mirrored.reshape(shape) / (2 * flat**2)
    matrix = np.stack(columns, axis=1)  # [wall, 3, 3]
    wanted = np.moveaxis(np.stack(values) / coefficient, 0, -1)  # [ports, wall, 3]
    found = np.moveaxis(np.linalg.solve(matrix, wanted[..., None])[..., 0], -1, 0)
    outward = np.clip(np.sin(centre), -MOST_ALONG, MOST_ALONG)
    found = found * second_order(wall, sent, (outward, np.sqrt(1 - outward**2)), frequency)
    plain = np.array([0.0, 0.0, 1.0])[:, None, None]
    return np.where(wall.rough, found, plain).astype(np.complex64)


def second_order(
    face: Face,
    transmit: tuple[Float[np.ndarray, "ports facets"], Float[np.ndarray, "ports facets"]],
    receive: tuple[Float[np.ndarray, "#ports facets"], Float[np.ndarray, "#ports facets"]]
    | tuple[Float[np.ndarray, " facets"], Float[np.ndarray, " facets"]],
    frequency: float,
) -> Complex64[np.ndarray, "ports facets"]:
    """Return the weights of the second order over those of the first, at rough facets. [-]."""
    shape = transmit[0].shape
    factor = np.ones(shape, dtype=np.complex64)
    into = tuple(np.broadcast_to(part, shape) for part in receive)
    for run in face.runs:
        here = np.flatnonzero(run.places[face.source] >= 0)
        if here.size == 0 or not run.rough:
            continue
        places = run.places[face.source[here]]
        line = RoughLine(
            heights=run.heights,
            step=run.step,
            closed=run.closed,
            material=face.material,
            polarization=face.polarization,
            nodes=np.array([frequency]),
        )
        for port in range(shape[0]):
            sent, heard = ((t[port, here], q[port, here]) for t, q in (transmit, into))
            second = line.second_order(sent, heard, places, side=float(face.side))
            factor[port, here] = 1 + second[0]
    return factor


def rough_factor(
    face: Face,
    one: Float[np.ndarray, "ports facets 2"],
    other: Float[np.ndarray, "ports facets 2"],
    frequency: float,
) -> Complex64[np.ndarray, "ports facets"]:
    """Weights of a rough target, over those of its tangent planes, between two directions. [-]."""
    tangent = face.normals[:, ::-1] * np.array([-1.0, 1.0])
    sent, heard = (_ways(way, tangent, face.normals) for way in (one, other))
    pair = [(t.ravel(), q.ravel()) for t, q in (sent, heard)]
    both = kernels(
        face.material,
        pair[0],
        pair[1],
        np.array([frequency]),
        polarization=face.polarization,
        half_space=True,
    )
    square = (sent[1] + heard[1]).ravel() ** 2
    along = (sent[0] + heard[0]).ravel() ** 2
    factor = both.bragg[0] / both.mirror[0] * (square + along) / square
    factor = factor.reshape(sent[0].shape) * second_order(face, sent, heard, frequency)
    return np.where(face.rough, factor, 1.0).astype(np.complex64)


def _ways(
    directions: Float[np.ndarray, "ports facets 2"],
    tangent: Float[np.ndarray, "facets 2"],
    normal: Float[np.ndarray, "facets 2"],
) -> tuple[Float[np.ndarray, "ports facets"], Float[np.ndarray, "ports facets"]]:
    """Components along and normal to a mean surface, limited to :data:`MOST_OBLIQUE`."""
    along = np.einsum("pfx,fx->pf", directions, tangent)
    upright = np.einsum("pfx,fx->pf", directions, normal)
    return along, np.maximum(upright, np.cos(MOST_OBLIQUE))


def half_angle_cosines(
    face: Face,
    one: Float[np.ndarray, "#ports #facets 2"] | Float[np.ndarray, " 2"],
    other: Float[np.ndarray, "#ports #facets 2"] | Float[np.ndarray, " 2"],
) -> Float[np.ndarray, "ports facets"]:
    """Cosines of half the angle at each facet between the directions to two points. [-]."""
    both = unit(one - face.centres) + unit(other - face.centres)
    return np.asarray(np.minimum(np.hypot(both[..., 0], both[..., 1]) / 2, 1.0))


def unit(vectors: Float[np.ndarray, "*n 2"]) -> Float[np.ndarray, "*n 2"]:
    """Return vectors of length 1 in the same directions."""
    unit: np.ndarray = vectors / np.hypot(vectors[..., :1], vectors[..., 1:])
    return unit
