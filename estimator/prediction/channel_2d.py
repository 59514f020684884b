r"""A user's channel, predicted from the map: the paths, with angle, delay and level.

The line of sight, mirrors by the method of images, and one scattering by a target.
Extents are finite, and what another wall hides is left out. The inputs are estimates; their
covariances are carried to each path's angle and length to first order. A position that was itself
found over a wall errs together with that wall, and the path that it came from is better known
than either: ``over`` says so.

Levels: free space :math:`\lambda / 4 \pi L` between isotropic antennas, times what
:mod:`estimator.prediction.wall_reflection` knows of each wall. A target has the radar cross-section
of its own echo, in all directions.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.array.array_frame import ArrayFrame
from estimator.geometry.path_covariance import (
    input_covariance,
    path_covariance,
    polar_slopes,
    rests_on,
)
from estimator.geometry.specular_chains import Chain, checked_bounces, image_over
from estimator.geometry.specular_chains_2d import possible_chains
from estimator.geometry.wall_2d import Wall, crossing, mirrored
from estimator.prediction.wall_reflection import Reflections, wall_reflections
from estimator.results.estimate import Estimate, Target, UserEstimate

USUAL_BOUNCES = 3
"""Mirrors in a chain unless asked for more: three take 18 dB, as walls are taken to reflect."""
SCATTER_DEVIATION_DB = 6.0
"""How far a target's cross-section towards the user may be from that of its echo: over angles,
that of a few scattering centres is exponential, 5.6 dB in decibels (Swerling 1). [dB]"""


@dataclass(frozen=True, kw_only=True)
class PredictedPath:
    """One path of the channel, in the array's frame."""

    walls: Chain  # from the array outward; () is direct
    target: int | None  # index of the target that scatters it, None without
    vertices: Float[np.ndarray, "vertices 3"]  # array, bounces, user [m]
    aoa: float  # from the array's axis [rad]
    path_length: float  # [m]
    covariance: Float[np.ndarray, "2 2"]  # of (aoa [rad], path length [m])
    radius: float  # of the wave's curvature at the array; a target's distance [m]
    gain: float  # of the amplitude between isotropic antennas [-]
    gain_deviation_db: float
    margin: float  # least distance of a bounce from an end of its wall; inf without [m]

    @property
    def delay(self) -> float:
        """Time of flight. [s]."""
        return self.path_length / speed_of_light

    @property
    def delay_deviation(self) -> float:
        """Standard deviation of the time of flight. [s]."""
        return float(np.sqrt(self.covariance[1, 1])) / speed_of_light

    @property
    def level_db(self) -> float:
        """Level of the gain. [dB]."""
        return float(20 * np.log10(self.gain))


def predict_channel(
    position: Float[np.ndarray, " 3"],
    covariance: Float[np.ndarray, "3 3"],
    walls: Sequence[Wall],
    *,
    frequency: float,
    targets: Sequence[Target] = (),
    over: Chain = (),
    reflections: Reflections | None = None,
    wall_covariance: Float[np.ndarray, "parameters parameters"] | None = None,
    max_bounces: int = USUAL_BOUNCES,
    end_slack: float = 0.0,
) -> tuple[PredictedPath, ...]:
    r"""Predict the paths from a user to a linear array at the origin, along +x.

    The image of the user over a chain of mirrors is where the array sees it: its direction is
    the angle of arrival, its distance the path length.

    Parameters
    ----------
    position, covariance
        The user's, in the array's frame; only x and y count. [m], [m²]
    walls
        All mirrors, at their true place. They hide what is behind them.
    frequency
        At which the levels hold. [Hz]
    targets
        What else scatters, in the array's frame. What has ``ends`` hides as a wall does.
    over
        Mirrors over which the position was found, from the array outward, so that the errors of
        both belong together; () for a position that does not rest on the walls.
    reflections
        Of the walls; None: what is assumed of walls of which nothing is known.
    wall_covariance
        Of all walls' (angle, offset), one wall after the other; None: walls err independently,
        each as its own covariance says.
    max_bounces
        Most mirrors in a chain, 0 to 8.
    end_slack
        By how much a wall may reflect beyond either end, for images that tell an end only
        within a cell. [m]

    Returns
    -------
    The paths that arrive from before the array (y > 0), strongest first.

    Raises
    ------
    ValueError
        If the position's covariance is smaller than the walls of ``over`` alone make it, or
        ``max_bounces`` is out of range.
    """
    known = reflections or wall_reflections(len(walls))
    wavelength = speed_of_light / frequency
    opaque = [(wall.start, wall.end) for wall in walls]
    wide = [target.ends for target in targets]
    screens = opaque + [(ends[0], ends[1]) for ends in wide if ends is not None]
    user = np.array([position[0], position[1], 0.0])
    inputs = input_covariance(user, covariance, walls, over, wall_covariance)
    paths = []
    doors = [_lengthened(wall, end_slack) for wall in walls]
    for chain in possible_chains(doors, deepest=checked_bounces(max_bounces)):
        traced = _trace(user, doors, chain, screens)
        if traced is None:
            continue
        vertices, margin = traced
        image = image_over(user, walls, chain)
        length = float(np.linalg.norm(image))
        level, deviation = known.over(chain)
        paths.append(
            PredictedPath(
                walls=chain,
                target=None,
                vertices=vertices,
                aoa=float(np.arctan2(image[1], image[0])),
                path_length=length,
                covariance=path_covariance(user, inputs, walls, chain),
                radius=length,
                gain=wavelength / (4 * np.pi * length) * 10 ** (level / 20),
                gain_deviation_db=deviation,
                margin=margin - end_slack,
            )
        )
    paths += [
        path
        for index, target in enumerate(targets)
        if (path := _scattered(index, target, user, covariance, known, screens))
    ]
    return tuple(sorted(paths, key=lambda path: -path.gain))


def predict_user_channel(
    estimate: Estimate,
    user: UserEstimate,
    frame: ArrayFrame,
    *,
    frequency: float,
    reflections: Reflections | None = None,
    max_bounces: int = USUAL_BOUNCES,
) -> tuple[PredictedPath, ...]:
    """Predict the channel of a user that was located, from the map located with it.

    Parameters
    ----------
    estimate
        The whole answer, in the world's frame.
    user
        One with a position.
    frame
        The array's, as :func:`estimator.array.array_frame.array_frame` finds it. The paths are in
        it.
    frequency, reflections, max_bounces
        As in :func:`predict_channel`.

    Raises
    ------
    ValueError
        If the user has no position.
    """
    if user.position is None or user.covariance is None or user.path is None:
        raise ValueError(
            f"user {user.name!r} is {user.status} and has no position; "
            "a channel can be predicted from a position only"
        )
    walls = [
        Wall(
            start=frame.to_local(mirror.start),
            end=frame.to_local(mirror.end),
            covariance=mirror.covariance,
        )
        for mirror in estimate.mirrors
    ]
    targets = [
        replace(
            target,
            position=frame.to_local(target.position),
            ghost=frame.to_local(target.ghost),
            ends=None if target.ends is None else frame.to_local(target.ends),
            covariance=None
            if target.covariance is None
            else frame.axes @ target.covariance @ frame.axes.T,
        )
        for target in estimate.targets
    ]
    place = frame.to_local(user.position)
    spread = frame.axes @ user.covariance @ frame.axes.T
    over = _walls_at(frame.to_local(user.path[1:-1]), walls)
    # An answer joined from several paths rests on the walls of one of them less than that
    # path alone would.
    if over and not rests_on(place, input_covariance(place, spread, walls, (), None), walls, over):
        over = ()
    return predict_channel(
        place,
        spread,
        walls,
        frequency=frequency,
        targets=targets,
        over=over,
        reflections=reflections,
        max_bounces=max_bounces,
    )


def _walls_at(bounces: Float[np.ndarray, "bounces 3"], walls: Sequence[Wall]) -> Chain:
    """Tell on which wall's line each bounce lies."""
    chain = []
    for bounce in bounces:
        beside = [abs(_height(bounce, wall)) for wall in walls]
        chain.append(int(np.argmin(beside)))
    return tuple(chain)


def _height(point: Float[np.ndarray, " 3"], wall: Wall) -> float:
    between = point - mirrored(point, wall.start, wall.end)
    return 0.5 * float(np.linalg.norm(between))


_Screens = Sequence[tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]]


def _trace(
    user: Float[np.ndarray, " 3"],
    walls: Sequence[Wall],
    chain: Chain,
    screens: _Screens,
) -> tuple[Float[np.ndarray, "vertices 3"], float] | None:
    """Find the bounces of the path to an image, mirror by mirror; None if there is no such path."""
    vertices, margin = [np.zeros(3)], np.inf
    for bounce, index in enumerate(chain):
        image = image_over(user, walls, chain[bounce:])
        if not bounce and image[1] <= 0:
            return None
        way = image - vertices[-1]
        far = float(np.linalg.norm(way))
        wall = walls[index]
        hit = crossing(vertices[-1], way / far, wall.start, wall.end) if far > 0 else None
        if hit is None or hit[0] >= far:
            return None
        margin = min(margin, hit[1])
        vertices.append(vertices[-1] + hit[0] * way / far)
    if not chain and user[1] <= 0:
        return None
    vertices.append(user)
    # The walls come first among the screens; a leg begins and ends on its own.
    ends = [{met for met in pair if met is not None} for pair in pairwise((None, *chain, None))]
    for (start, end), own in zip(pairwise(vertices), ends, strict=True):
        if _hidden(start, end, [one for at, one in enumerate(screens) if at not in own]):
            return None
    return np.stack(vertices), margin


def _lengthened(wall: Wall, slack: float) -> Wall:
    along = wall.end - wall.start
    more = slack * along / float(np.linalg.norm(along))
    return replace(wall, start=wall.start - more, end=wall.end + more)


def _hidden(
    start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"], screens: _Screens
) -> bool:
    far = float(np.linalg.norm(end - start))
    if far == 0:
        return False
    hits = [crossing(start, (end - start) / far, *screen) for screen in screens]
    return any(hit is not None and hit[0] < far for hit in hits)


def _scattered(
    index: int,
    target: Target,
    user: Float[np.ndarray, " 3"],
    covariance: Float[np.ndarray, "3 3"],
    known: Reflections,
    screens: _Screens,
) -> PredictedPath | None:
    r"""Predict the path over one target: :math:`\lambda \sqrt\sigma / (4\pi)^{3/2} R_1 R_2`.

    Its echo from :math:`R_0`, the distance of its ghost, gives
    :math:`\sqrt\sigma = |S| (4\pi)^{3/2} R_0^2 / \lambda`; a mirror on the way took its part of
    it twice. The wavelength cancels.
    """
    place = np.array([target.position[0], target.position[1], 0.0])
    legs = place, user - place
    near, far = (float(np.linalg.norm(leg)) for leg in legs)
    if target.level_db is None or place[1] <= 0 or min(near, far) == 0:
        return None
    others = screens
    if target.ends is not None:  # its own face does not hide it
        others = [screen for screen in screens if not np.array_equal(screen[0], target.ends[0])]
    if _hidden(np.zeros(3), place, others) or _hidden(place, user, others):
        return None
    level, deviation = known.over([*target.seen_through, *target.seen_through])
    echoed = float(np.linalg.norm(target.ghost))
    gain = 10 ** ((target.level_db - level) / 20) * echoed**2 / (near * far)
    spread = np.zeros((3, 3)) if target.covariance is None else target.covariance
    onward = legs[1][:2] / far
    angle, out = polar_slopes(place[:2])
    by_target = np.stack([angle, out - onward])
    by_user = np.stack([np.zeros(2), onward])
    return PredictedPath(
        walls=(),
        target=index,
        vertices=np.stack([np.zeros(3), place, user]),
        aoa=float(np.arctan2(place[1], place[0])),
        path_length=near + far,
        covariance=by_target @ spread[:2, :2] @ by_target.T
        + by_user @ covariance[:2, :2] @ by_user.T,
        radius=near,
        gain=gain,
        gain_deviation_db=float(np.hypot(deviation, SCATTER_DEVIATION_DB)),
        margin=np.inf,
    )
