r"""Mirrors that the paths of many places agree on.

If the user stands at u and one more path comes from v over one mirror, the mirror is halfway
between, at right angles to v − u. So each path proposes one. It then predicts where the user is
seen over it at every other place; a true one is there each time, while those that came about by two
reflections, by scattering or by chance are not.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from estimator.path_consensus.listed_paths import ListedPaths, log_normal

APART = 2.0
"""Least distance of an image from the user, over its deviations, from which a mirror between them
has a direction. [-]"""


@dataclass(frozen=True, kw_only=True)
class Proposal:
    """The mirror with most votes."""

    normal: Float[np.ndarray, " axes"]
    offset: float  # [m]
    votes: int  # places at which a path comes over it
    gain: float  # log-likelihood over that of paths from anywhere [-]
    voters: Bool[np.ndarray, " paths"]


def proposed_mirror(
    paths: ListedPaths,
    users: Float[np.ndarray, "places axes"],
    user_covariance: Float[np.ndarray, "places axes axes"],
    free: Bool[np.ndarray, " paths"],
    offset: float,
) -> Proposal | None:
    """Find the mirror that most paths agree on.

    Parameters
    ----------
    paths
        All paths.
    users, user_covariance
        Where the user is at each place; NaN where it is not known. [m], [m²]
    free
        Paths that nothing explains yet.
    offset
        By which lengths are longer than listed. [m]
    """
    seen, spread = paths.images(offset), paths.covariance(offset)
    known = np.isfinite(users).all(axis=1)
    free = free & known[paths.place] & (paths.length + offset > 0)
    rows = np.flatnonzero(free)
    if not rows.size:
        return None
    axes = paths.axes
    user, around = users[paths.place[rows]], user_covariance[paths.place[rows]]
    between = seen[rows] - user
    distance = np.linalg.norm(between, axis=1)
    least = APART * np.sqrt(np.trace(spread[rows] + around, axis1=1, axis2=2) / axes)
    normal = between / np.maximum(distance, 1e-9)[:, None]
    middle = 0.5 * (seen[rows] + user)
    height = np.einsum("ci,ci->c", normal, middle)
    able = (distance > least) & (height > 0)
    rows, normal, middle, height, distance = (
        one[able] for one in (rows, normal, middle, height, distance)
    )
    around = around[able]
    if not rows.size:
        return None
    places = np.flatnonzero(known)
    others = users[places]
    ahead = height[:, None] - normal @ others.T  # candidates × places
    predicted = others + 2 * ahead[..., None] * normal[:, None, :]
    unit = np.eye(axes)
    outer = normal[:, :, None] * normal[:, None, :]
    across = unit - outer
    lever = middle[:, None, :] - others[None]
    by_turn = (
        2
        * (normal[:, None, :, None] * lever[..., None, :] + ahead[..., None, None] * unit)
        @ (across / distance[:, None, None])[:, None]
    )
    by_image = by_turn + outer[:, None]
    by_user = outer[:, None] - by_turn
    own = unit - 2 * outer
    total = (
        by_image @ spread[rows][:, None] @ by_image.swapaxes(-1, -2)
        + by_user @ around[:, None] @ by_user.swapaxes(-1, -2)
        + own[:, None] @ user_covariance[places] @ own[:, None].swapaxes(-1, -2)
    )
    index = np.full(paths.places, -1)
    index[places] = np.arange(places.size)
    tried = np.flatnonzero(free)
    column = index[paths.place[tried]]
    likely = (
        log_normal(seen[tried] - predicted[:, column], total[:, column] + spread[tried])
        + paths.log_spread(offset)[tried]
        - paths.log_clutter
    )
    likely[:, :] = np.where(ahead[:, column] > 0, likely, -np.inf)
    likely[paths.place[tried][None] == paths.place[rows][:, None]] = -np.inf  # its own place
    gains = np.zeros((rows.size, places.size))
    np.maximum.at(gains.T, column, likely.T)
    best = int(np.argmax(gains.sum(axis=1)))
    voters = np.zeros(paths.place.size, dtype=bool)
    chosen = likely[best]
    for place in range(places.size):
        here = np.flatnonzero((column == place) & (chosen > 0))
        if here.size:
            voters[tried[here[np.argmax(chosen[here])]]] = True
    voters[rows[best]] = True
    return Proposal(
        normal=normal[best],
        offset=float(height[best]),
        votes=int((gains[best] > 0).sum()) + 1,
        gain=float(gains[best].sum()),
        voters=voters,
    )
