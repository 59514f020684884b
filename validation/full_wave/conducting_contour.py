r"""Smooth curves of a conductor's cross-section, on the grids that integrate over them.

A curve :math:`\mathbf r(\theta)` is sampled at equal steps :math:`h` of a periodic parameter,
so that the trapezoidal rule is spectrally accurate.

A closed contour is periodic by itself. On an open strip the current grows as the inverse
square root towards an edge. With

.. math:: s = \frac{L}{2} \Bigl(1 + \frac{\arcsin(\alpha\cos\theta)}{\arcsin\alpha}\Bigr),
          \qquad 0 < \theta < \pi

over the arc length [1]_, the current per step of :math:`\theta` is a smooth, even, periodic
function. With :math:`\alpha = 1/\cosh\delta` close to 1 the points are evenly spaced except near
the ends; :math:`\delta` is the half width of the complex strip in which the map is analytic, and
the error of the rule over N points is :math:`e^{-N\delta}`.

References
----------
.. [1] D. Kosloff, H. Tal-Ezer, "A modified Chebyshev pseudospectral method with an O(1/N) time
   step restriction", J. Comput. Phys. 104, 1993.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline

EDGE_DIGITS = 16.0
r""":math:`N\delta`; the rule's error at the edges is its negative exponential, 1e-7. [-]"""

FINER = 4
"""Integration points of the arc length for each point of a profile. [-]"""


@dataclass(frozen=True, kw_only=True)
class Contour:
    """A conductor's curve, sampled at equal steps of its parameter.

    The points of an open strip begin half a step from its ends, where the parameter reverses.
    """

    points: Float[np.ndarray, "points 2"]  # [m]
    normals: Float[np.ndarray, "points 2"]  # to the right: outward if counter-clockwise
    speeds: Float[np.ndarray, " points"]  # |dr/dθ| [m]
    curvatures: Float[np.ndarray, " points"]  # positive if convex seen along the normal [1/m]
    step: float  # h, of the parameter [rad]
    closed: bool
    schwarzian: Float[np.ndarray, " points"] | None = None  # of the arc over the parameter [-]

    @property
    def count(self) -> int:
        """Number of points."""
        return len(self.speeds)

    @property
    def weights(self) -> Float[np.ndarray, " points"]:
        """Arc length of each point's step. [m]."""
        return self.speeds * self.step

    @property
    def spacing(self) -> float:
        """Largest step of arc length. [m]."""
        return float(self.weights.max())


def open_strip(profile: Float[np.ndarray, "vertices axis"], *, spacing: float) -> Contour:
    """Sample an open strip through the points of a profile.

    The curve is the cubic spline through the points, over the profile's chords; the points have to
    resolve the roughness.

    Parameters
    ----------
    profile
        At least four points from end to end; a third coordinate is left out. [m]
    spacing
        Arc length between points of the grid, at most. [m]

    Raises
    ------
    ValueError
        If points are missing or coincide, or the spacing is not positive.
    """
    _check_spacing(spacing)
    arc = SplineArc(profile)
    # The spacing in the middle is L/(N − 2·EDGE_DIGITS/π): other points are near the edges.
    count = int(np.ceil(arc.length / spacing + 2 * EDGE_DIGITS / np.pi))
    alpha = 1 / np.cosh(EDGE_DIGITS / count)
    step = np.pi / count
    # From the first vertex to the last: cos θ has to rise, so θ runs from π to 0.
    angle = np.pi - step * (np.arange(count) + 0.5)
    place = np.arcsin(alpha * np.cos(angle)) / np.arcsin(alpha)
    rate = alpha * np.sin(angle) / np.sqrt(1 - (alpha * np.cos(angle)) ** 2) / np.arcsin(alpha)
    points, normals, curvatures, pace = arc.sampled(0.5 * arc.length * (1 + place))
    return Contour(
        points=points,
        normals=normals,
        speeds=np.asarray(0.5 * arc.length * rate * pace),
        curvatures=curvatures,
        step=step,
        closed=False,
        schwarzian=_schwarzian(angle, alpha),
    )


class SplineArc:
    """The cubic spline through the points of a profile, over its own arc length.

    Parameters
    ----------
    profile
        At least four points from end to end; a third coordinate is left out. [m]
    periodic
        Whether the last point is the first one, and the curve smooth there.

    Raises
    ------
    ValueError
        If points are missing or coincide.
    """

    def __init__(
        self, profile: Float[np.ndarray, "vertices axis"], *, periodic: bool = False
    ) -> None:
        chords = np.hypot(*np.diff(profile[:, :2], axis=0).T)
        if len(profile) < 4 or not np.all(chords > 0):
            raise ValueError(
                f"a strip through {len(profile)} points, the shortest step "
                f"{chords.min(initial=np.inf):g} m: at least four points that differ are needed"
            )
        ends = np.concatenate([[0.0], np.cumsum(chords)])
        self._curve = CubicSpline(
            ends, profile[:, :2], bc_type="periodic" if periodic else "not-a-knot"
        )
        self._slope = self._curve.derivative()
        inner = np.arange(FINER * (len(ends) - 1) + 1) / FINER
        fine = np.interp(inner, np.arange(len(ends)), ends)
        length = CubicSpline(fine, np.hypot(*self._slope(fine).T)).antiderivative()(fine)
        self._parameter = CubicSpline(length, fine)
        self.length = float(length[-1])  # [m]

    def sampled(
        self, along: Float[np.ndarray, " n"]
    ) -> tuple[
        Float[np.ndarray, "n 2"],
        Float[np.ndarray, "n 2"],
        Float[np.ndarray, " n"],
        Float[np.ndarray, " n"],
    ]:
        """Return points [m], normals, curvatures [1/m], and arc length per unit of ``along``."""
        where = self._parameter(along)
        tangent, bend = self._slope(where), self._curve.derivative(2)(where)
        pace = np.hypot(*tangent.T)
        return (
            np.asarray(self._curve(where)),
            np.stack([tangent[:, 1], -tangent[:, 0]], axis=-1) / pace[:, None],
            _curvature(tangent, bend),
            np.asarray(pace * self._parameter(along, 1)),
        )


def _schwarzian(angle: Float[np.ndarray, " n"], alpha: float) -> Float[np.ndarray, " n"]:
    r"""Return :math:`g' - g^2/2` with :math:`g = s''/s'` of the strip's map. [-]."""
    sine, cosine = np.sin(angle), np.cos(angle)
    rest = 1 - (alpha * cosine) ** 2
    growth = cosine / sine - alpha**2 * sine * cosine / rest
    bend = (cosine**2 - sine**2) / rest - 2 * (alpha * sine * cosine / rest) ** 2
    return np.asarray(-1 / sine**2 - alpha**2 * bend - 0.5 * growth**2)


def closed_contour(
    curve: Callable[[Float[np.ndarray, " n"]], Float[np.ndarray, "derivatives n 2"]], count: int
) -> Contour:
    """Sample a smooth closed curve.

    Parameters
    ----------
    curve
        Function from the parameter, 0 to 2π counter-clockwise, to position and two derivatives.
    count
        Points.

    Raises
    ------
    ValueError
        If the curve runs clockwise: its normals would point inward.
    """
    angle = 2 * np.pi * np.arange(count) / count
    points, tangent, bend = curve(angle)
    area = float(np.sum(points[:, 0] * tangent[:, 1] - points[:, 1] * tangent[:, 0]))
    if not area > 0:
        raise ValueError("the closed curve runs clockwise; turn it, so that its normals look out")
    speeds = np.hypot(*tangent.T)
    return Contour(
        points=points,
        normals=np.stack([tangent[:, 1], -tangent[:, 0]], axis=-1) / speeds[:, None],
        speeds=speeds,
        curvatures=_curvature(tangent, bend),
        step=2 * np.pi / count,
        closed=True,
    )


def closed_profile(vertices: Float[np.ndarray, "vertices axis"], *, spacing: float) -> Contour:
    """Sample a smooth closed curve through points, evenly.

    Parameters
    ----------
    vertices
        Counter-clockwise, the first one not repeated; a third coordinate is left out. [m]
    spacing
        Arc length between points of the grid, at most. [m]

    Raises
    ------
    ValueError
        If points are missing or coincide, or run clockwise, or the spacing is not positive.
    """
    _check_spacing(spacing)
    round_ = np.concatenate([vertices, vertices[:1]])[:, :2]
    if not np.sum(round_[:-1, 0] * round_[1:, 1] - round_[:-1, 1] * round_[1:, 0]) > 0:
        raise ValueError("the closed curve runs clockwise; turn it, so that its normals look out")
    arc = SplineArc(round_, periodic=True)
    count = max(int(np.ceil(arc.length / spacing)), 32)
    points, normals, curvatures, pace = arc.sampled(arc.length * np.arange(count) / count)
    return Contour(
        points=points,
        normals=normals,
        speeds=np.asarray(arc.length / (2 * np.pi) * pace),
        curvatures=curvatures,
        step=2 * np.pi / count,
        closed=True,
    )


def circle(centre: Float[np.ndarray, " 2"], radius: float, *, spacing: float) -> Contour:
    """Sample a circle.

    Parameters
    ----------
    centre, radius
        [m].
    spacing
        Arc length between points, at most. [m]
    """
    _check_spacing(spacing)

    def curve(angle: Float[np.ndarray, " n"]) -> Float[np.ndarray, "3 n 2"]:
        ray = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        along = np.stack([-np.sin(angle), np.cos(angle)], axis=-1)
        return np.stack([centre + radius * ray, radius * along, -radius * ray])

    return closed_contour(curve, max(int(np.ceil(2 * np.pi * radius / spacing)), 32))


def _curvature(
    tangent: Float[np.ndarray, "n 2"], bend: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, " n"]:
    turning = tangent[:, 0] * bend[:, 1] - tangent[:, 1] * bend[:, 0]
    return np.asarray(turning / np.hypot(*tangent.T) ** 3)


def _check_spacing(spacing: float) -> None:
    if not spacing > 0:
        raise ValueError(f"spacing = {spacing} m must be positive; give a length")
