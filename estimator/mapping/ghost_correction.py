"""Ghost correction: what the image shows behind mirrors is unfolded to its true place."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int

from estimator.geometry.flat_wall import FlatWall
from estimator.geometry.specular_chains import Chain, image_over, seen_over
from estimator.imaging.focusing import Focus


@dataclass(frozen=True, kw_only=True)
class Unfolded:
    """Complex amplitudes at true places, and over which mirrors each was seen."""

    values: Complex[np.ndarray, "*grid"]
    chains: tuple[Chain, ...]
    chain: Int[np.ndarray, "*grid"]  # index into chains; -1 where nothing is seen


def corrected_image(
    focus: Focus,
    points: Float[np.ndarray, "*grid 3"],
    walls: Sequence[FlatWall],
    chains: Iterable[Chain],
    *,
    raw: Complex[np.ndarray, "*grid"] | None = None,
    skin: float = 0.0,
) -> Unfolded:
    """Focus the echo on points where things really are.

    The raw image shows a point at its image over each chain of mirrors over which the array (at
    the origin) sees it. The value of the brightest image point is kept; it is focused exactly
    there, without
    interpolation, and views over different chains are not added.

    Parameters
    ----------
    focus
        Focuses the echo; it is given only points that are seen.
    points
        Points in the array's frame. [m]
    walls
        All mirrors, at their true place.
    chains
        Over which anything may be seen, the empty one among them: what
        :mod:`estimator.geometry.specular_chains_2d` or its twin in space gives.
    raw
        What is focused on the points themselves, if that is known already. [-]
    skin
        How thick the image of a wall is: so far behind it is still the wall itself. [m]
    """
    flat = points.reshape(-1, 3)
    values = np.zeros(len(flat), dtype=np.complex128)
    source = np.full(len(flat), -1, dtype=np.int64)
    shown_over: list[Chain] = []
    for chain in chains:
        images = image_over(flat, walls, chain)
        seen = np.flatnonzero(seen_over(images, walls, chain, skin=skin))
        if not seen.size:
            continue
        shown = focus(images[seen]) if chain or raw is None else raw.ravel()[seen]
        brighter = (source[seen] < 0) | (np.abs(shown) > np.abs(values[seen]))
        values[seen[brighter]] = shown[brighter]
        source[seen[brighter]] = len(shown_over)
        shown_over.append(chain)
    grid = points.shape[:-1]
    return Unfolded(
        values=values.reshape(grid), chains=tuple(shown_over), chain=source.reshape(grid)
    )
