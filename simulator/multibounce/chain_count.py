"""Chains of surfaces in two dimensions: their enumeration, and the amount of work."""

from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Float

from scenes.schema.errors import ScenarioError
from simulator.geometry.faces import Face
from simulator.visibility.mutual_visibility import MutualVisibility

MOST_LINKS = 2**35
"""Most links between facets over all chains: at a hundred frequencies and some 5 ns each, an hour
or a few. [-]"""

PORTS_PER_LINK = 32
"""Antennas whose products take as long as the phase factor of the link that they share. [-]"""

OUTLINE = 64
"""Points that represent a surface where only directions matter. [-]"""

Sees = MutualVisibility
"""Returns which facets of two faces see each other, and through which slabs."""


def chains_to(
    target: int, faces: Sequence[Face], sees: Sees, seen_directly: Sequence[bool], most: int
) -> Iterator[tuple[int, ...]]:
    """Yield the chains of 1 to ``most`` faces that lead to another one.

    Parameters
    ----------
    target
        Index of the last face.
    faces
        Sides of the surfaces.
    sees
        Their mutual visibility, in line of sight or through slabs.
    seen_directly
        Which faces may be the first.
    most
        Most faces before the target.

    Yields
    ------
    Indices of faces in order, without the target. No face is followed by one of the same surface.
    """
    if most < 1:
        return
    for place, face in enumerate(faces):
        if face.surface == faces[target].surface or not sees.sights(face, faces[target]):
            continue
        if seen_directly[place]:
            yield (place,)
        for chain in chains_to(place, faces, sees, seen_directly, most - 1):
            yield (*chain, place)


def check_chains(faces: Sequence[Face], *, max_bounces: int, elements: int, users: int) -> None:
    """Refuse chains of more surfaces than can be summed, before any summation.

    Parameters
    ----------
    faces
        Sides of the surfaces.
    max_bounces
        Most surfaces of a chain.
    elements
        Antennas of the echo.
    users
        Antennas that transmit pilots.

    Raises
    ------
    ScenarioError
        If there are too many links; the message names the largest possible number of bounces.
    """
    links = _links_of_chains(faces, max_bounces)
    work = [
        users * sum(links[: max(0, most - 1)])
        + (1 + elements / PORTS_PER_LINK) * sum(links[: most // 2])
        for most in range(max_bounces + 1)
    ]
    if not work or work[-1] <= MOST_LINKS:
        return
    possible = max(most for most, links_there in enumerate(work) if links_there <= MOST_LINKS)
    raise ScenarioError(
        f"max_bounces = {max_bounces}: the chains of up to {max_bounces} surfaces make "
        f"{work[-1]:.2g} links between facets, more than {MOST_LINKS:.2g}; set max_bounces = "
        f"{possible}, make surfaces shorter or less finely rough (roughness.correlation_mm), or "
        "lower radio.stop_ghz"
    )


def _links_of_chains(faces: Sequence[Face], max_bounces: int) -> list[float]:
    """Count the links between facets in all chains of two, three, … faces that face each other."""
    pairs = np.array(
        [[one.count * other.count * _face(one, other) for other in faces] for one in faces],
        dtype=np.float64,
    ).reshape(len(faces), len(faces))
    chains, links, found = np.ones(len(faces)), np.zeros(len(faces)), []
    for _ in range(2, max_bounces + 1):
        links = links @ (pairs > 0) + chains @ pairs
        chains = chains @ (pairs > 0)
        found.append(float(links.sum()))
    return found


def _face(one: Face, other: Face) -> bool:
    """Return whether parts of two faces of different surfaces face each other."""
    return one.surface != other.surface and _before(one, other) and _before(other, one)


def _before(face: Face, other: Face) -> bool:
    some, points = outline(face.centres), outline(other.centres)
    normals = outline(face.normals)
    return bool((np.einsum("pfx,fx->pf", points[:, None] - some, normals) > 0).any())


def outline(values: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "some 2"]:
    """Return about :data:`OUTLINE` evenly chosen values, if there are more."""
    return values[:: max(1, len(values) // OUTLINE)]
