"""What antennas see of a flat face over mirrors: their images, the part in view, a place on it."""

import numpy as np
from jaxtyping import Bool, Float

from simulator.geometry.mirrors import Mirrors
from simulator.geometry.polygon_clipping import Polygons, clipped, within_view
from simulator.specular.image_method import ON_PLANE

PULLED = 0.02
"""Share of the way to the middle of a face by which the place that rays are sent to is moved off
its edge, at most: rays start off faces by micrometres, which hide their very edges. [-]"""


def image_over(
    mirrors: Mirrors, leg: tuple[int, ...], places: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n 3"]:
    """Mirror places about each face of a leg in turn."""
    for mirror in leg:
        places = mirrors.images(places, mirror)
    return places


def reflected_by(
    mirrors: Mirrors, leg: tuple[int, ...], places: Float[np.ndarray, "n 3"]
) -> Bool[np.ndarray, " n"]:
    """Tell which antennas each mirror of a leg reflects."""
    reflects = np.ones(len(places), dtype=bool)
    for mirror in leg:
        heights = mirrors.heights(places, mirror)
        reflects &= (np.abs(heights) if mirrors.two_sided[mirror] else heights) > ON_PLANE
        places = mirrors.images(places, mirror)
    return reflects


def seen_over(
    mirrors: Mirrors,
    leg: tuple[int, ...],
    eyes: Float[np.ndarray, "links 3"],
    polygons: Polygons,
    normal: Float[np.ndarray, " 3"],
) -> Polygons:
    """Keep what antennas' images see of polygons through all mirrors of a leg."""
    left = polygons
    planes = []
    for place, mirror in enumerate(leg):
        corners = mirrors.corners[mirror]
        for later in leg[place + 1 :]:  # unfolded: all in the space of the last
            corners = mirrors.images(corners, later)
        planes.append(corners)
    for place, corners in enumerate(planes):
        window = np.repeat(corners[None], len(eyes), axis=0)
        if place:
            window = _beyond(window, planes[place - 1], eyes)
        left = within_view(left, eyes, window, normal)
    return _beyond(left, planes[-1], eyes) if planes else left


def _beyond(
    polygons: Polygons, corners: Float[np.ndarray, "4 3"], eyes: Float[np.ndarray, "links 3"]
) -> Polygons:
    """Keep the part of polygons on the other side of a plane than the eyes."""
    normal = np.cross(corners[2] - corners[0], corners[3] - corners[1])
    normal /= np.linalg.norm(normal)
    side = -np.sign((eyes - corners[0]) @ normal)
    return clipped(polygons, side[:, None] * ((polygons - corners[0]) @ normal))


def nearest_places(
    sources: Float[np.ndarray, "links 3"],
    receivers: Float[np.ndarray, "links 3"],
    polygons: Polygons,
    normal: Float[np.ndarray, " 3"],
) -> Float[np.ndarray, "links 3"]:
    """Find the places of polygons next to straight lines through their plane, off the edges."""
    base = polygons[:, 0]
    below = np.einsum("lx,x->l", sources - base, normal)
    above = np.einsum("lx,x->l", receivers - base, normal)
    share = below / (below - above)
    meets = sources + share[:, None] * (receivers - sources)
    along = np.roll(polygons, -1, axis=1) - polygons
    squared = np.einsum("lcx,lcx->lc", along, along)
    towards = meets[:, None] - polygons
    beside = np.einsum("lcx,lcx->lc", towards, along) / np.maximum(squared, 1e-30)
    on_edge = polygons + np.clip(beside, 0.0, 1.0)[..., None] * along
    apart = np.einsum("lcx,lcx->lc", on_edge - meets[:, None], on_edge - meets[:, None])
    nearest = np.take_along_axis(on_edge, apart.argmin(axis=1)[:, None, None], axis=1)[:, 0]
    turns = np.einsum("lcx,x->lc", np.cross(along, towards), normal)
    inside = (turns >= 0).all(axis=1) | (turns <= 0).all(axis=1)
    place = np.where(inside[:, None], meets, nearest)
    inward = polygons.mean(axis=1) - place
    far = np.sqrt(np.einsum("lx,lx->l", inward, inward))
    margin = np.where(inside, np.sqrt(apart.min(axis=1)), 0.0)
    wanted = np.maximum(1.0 - margin / np.maximum(PULLED * far, 1e-12), 0.0)
    return np.asarray(place + PULLED * wanted[:, None] * inward)
