"""Ghost correction: what the image shows behind a mirror is folded back to its true place."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Complex, Float

from estimator.mirror_fit import Focus
from estimator.projection import Wall, mirrored


def corrected_image(
    focus: Focus, points: Float[np.ndarray, "*grid 3"], walls: Sequence[Wall]
) -> Complex[np.ndarray, "*grid"]:
    """Focus the echo on points where things really are.

    A point that the array (at the origin) sees directly keeps its value; hidden ones have
    none. To either comes what the raw image shows at its image in each mirror, if the ray
    there passes through the mirror's extent. Values are focused there, not interpolated, so
    they stay complex and exact.

    Parameters
    ----------
    focus
        Focuses the echo; it is given only points within its reach.
    points
        Points in the array's frame. [m]
    walls
        Mirrors that are seen directly.

    Returns
    -------
    Complex amplitudes. [-]
    """
    flat = points.reshape(-1, 3)
    values = np.zeros(len(flat), dtype=np.complex128)
    direct = ~np.any([_hidden(flat, wall) for wall in walls] or [np.zeros(len(flat), bool)], axis=0)
    values[direct] = focus(flat[direct])
    for wall in walls:
        ghosts = mirrored(flat, wall.start, wall.end)
        through = _hidden(ghosts, wall)
        values[through] += focus(ghosts[through])
    return values.reshape(points.shape[:-1])


def _hidden(points: Float[np.ndarray, "n 3"], wall: Wall) -> Bool[np.ndarray, " n"]:
    """Tell which points the array sees through a wall: the line of sight crosses it."""
    along = wall.end - wall.start
    normal = np.array([along[1], -along[0]])
    towards = points[:, :2] @ normal
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (wall.start[:2] @ normal) / towards  # of the way to the point
        meets = share[:, None] * points[:, :2] - wall.start[:2]
        place = meets @ along[:2] / (along @ along)
    crossed: np.ndarray = (share > 0) & (share < 1) & (place >= 0) & (place <= 1)
    return crossed
