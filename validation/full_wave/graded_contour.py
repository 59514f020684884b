r"""Closed contours with corners, on grids that are graded towards them.

A side from corner to corner has points at half steps :math:`\tau = \tfrac12, \tfrac32, \dots` of a
parameter with

.. math:: \frac{ds}{d\tau} = \Delta\, I_{\tau/M}(p, p)

at either end, with the regularised incomplete beta function :math:`I`, which rises from 0 to 1 over
M points as :math:`\tau^p`, and evenly spaced points between. A singularity that is a power of the
distance from a corner becomes, per step, a smooth function of :math:`\tau` [1]_, up to an order
that grows with p.

References
----------
.. [1] R. Kress, "A Nyström method for boundary integral equations in domains with corners",
   Numer. Math. 58, 1990.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.special import betainc

from validation.full_wave.conducting_contour import Contour, SplineArc

ORDER, RISE = 5, 40
"""p, and M: the points over which the spacing rises from a corner of 90° or more; for sharper ones,
whose sides are close to each other, inversely proportional to the angle. The error of fields of a
conducting wedge of 90° is then some 1e-5. [-]"""

LEAST_ANGLE = float(np.deg2rad(10.0))
"""Least angle of a corner. [rad]"""

CLOSE = 1e-9
"""Largest distance between the end of a side and the start of the next, over its length. [-]"""


def cornered_contour(
    sides: Sequence[Float[np.ndarray, "_ 2"]], spacings: Sequence[float]
) -> Contour:
    """Sample a closed contour with a corner between every two sides.

    Parameters
    ----------
    sides
        Points of each side, counter-clockwise, from corner to corner; two for a straight side, at
        least four for a curve (a cubic spline). [m]
    spacings
        Arc length between the points of each side, at most. [m]

    Raises
    ------
    ValueError
        If the sides do not close, run clockwise, meet too sharply, or a spacing is not positive.
    """
    for index, side in enumerate(sides):
        gap = float(np.hypot(*(sides[(index + 1) % len(sides)][0] - side[-1])))
        if gap > CLOSE * float(np.hypot(*np.ptp(side, axis=0))):
            raise ValueError(
                f"side {index} ends {gap:g} m from where the next one starts; a contour must close"
            )
        if not spacings[index] > 0:
            raise ValueError(f"spacing = {spacings[index]} m must be positive; give a length")
    outline = np.concatenate([side[:-1] for side in sides])
    after = np.roll(outline, -1, axis=0)
    if not np.sum(outline[:, 0] * after[:, 1] - outline[:, 1] * after[:, 0]) > 0:
        raise ValueError("the sides run clockwise; turn them, so that their normals look out")
    rises = [_rise(side, sides[index - 1]) for index, side in enumerate(sides)]
    parts = [
        _side(side, spacing, first, last)
        for side, spacing, first, last in zip(
            sides, spacings, rises, [*rises[1:], rises[0]], strict=True
        )
    ]
    points, normals, curvatures, speeds = (np.concatenate(one) for one in zip(*parts, strict=True))
    return Contour(
        points=points,
        normals=normals,
        speeds=speeds,
        curvatures=curvatures,
        step=1.0,
        closed=True,
    )


def box(
    centre: Float[np.ndarray, " 2"], size: tuple[float, float], angle: float, *, spacing: float
) -> Contour:
    """Sample a rectangle, rotated by an angle in rad; lengths in m."""
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    corners = centre + 0.5 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * size @ axes
    sides = [np.stack([corners[one], corners[(one + 1) % 4]]) for one in range(4)]
    return cornered_contour(sides, [spacing] * 4)


def _rise(side: Float[np.ndarray, "vertices 2"], before: Float[np.ndarray, "others 2"]) -> int:
    """Return the points over which the spacing rises from a corner."""
    ahead, back = side[1] - side[0], before[-2] - before[-1]
    cosine = float(ahead @ back / (np.hypot(*ahead) * np.hypot(*back)))
    angle = float(np.arccos(np.clip(cosine, -1.0, 1.0)))
    if angle < LEAST_ANGLE:
        raise ValueError(
            f"two sides meet at {np.rad2deg(angle):.3g}°, less than the "
            f"{np.rad2deg(LEAST_ANGLE):.3g}° that can be sampled; blunt the corner"
        )
    return round(RISE * max(1.0, 0.5 * np.pi / angle))


def _side(
    side: Float[np.ndarray, "vertices 2"], spacing: float, first: int, last: int
) -> tuple[
    Float[np.ndarray, "n 2"],
    Float[np.ndarray, "n 2"],
    Float[np.ndarray, " n"],
    Float[np.ndarray, " n"],
]:
    if len(side) == 2:
        side = side[0] + np.linspace(0, 1, 4)[:, None] * (side[1] - side[0])
    arc = SplineArc(side)
    # Points in the rise at either end cover half the arc of evenly spaced ones.
    rising = 0.5 * (first + last)
    count = max(int(np.ceil(arc.length / spacing + rising)), first + last)
    step = arc.length / (count - rising)
    index = np.arange(count) + 0.5
    start, end = np.minimum(index / first, 1.0), np.minimum((count - index) / last, 1.0)
    rate = betainc(ORDER, ORDER, start) * betainc(ORDER, ORDER, end)
    along = _risen(index, first) * step
    backward = arc.length - _risen(count - index, last) * step
    along = np.where(index > first, backward, along)
    points, normals, curvatures, pace = arc.sampled(along)
    return points, normals, curvatures, np.asarray(step * rate * pace)


def _risen(index: Float[np.ndarray, " n"], rise: int) -> Float[np.ndarray, " n"]:
    r"""Integrate the rise from a corner, :math:`\int_0^x I_t = x I_x(p, p) - I_x(p + 1, p)/2`."""
    part = np.minimum(index / rise, 1.0)
    rising = rise * (part * betainc(ORDER, ORDER, part) - 0.5 * betainc(ORDER + 1, ORDER, part))
    return np.asarray(rising + np.maximum(index - rise, 0.0))
