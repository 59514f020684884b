"""Which chain of mirrors each path came over: the likeliest pairing at each place of the user."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from estimator.path_consensus.flat_mirrors import Mirrors, chains_of
from estimator.path_consensus.listed_paths import ListedPaths, log_normal
from estimator.path_consensus.path_levels import level_gains

BY_ORDER = (0.3, 0.4, 0.2, 0.1)
"""Prior probabilities that a path is the direct one, or has met one, two or three mirrors, each
shared by all such chains. Listed paths of drawn open rooms are 0.09, 0.43, 0.42 and 0.06 of all,
of those with a screen 0.04, 0.27, 0.45 and 0.24 (``python -m validation.experiments.thresholds
lists``); but lists of few paths hold the strongest ones, and these have met few mirrors. What a
path's prior is wrong by, 2 for the direct one and less for others as a logarithm, is a part of what
a path that fits gains. [-]"""


@dataclass(frozen=True, kw_only=True)
class Explanation:
    """Chains of paths, and by how much likelier they are than paths from anywhere."""

    chain: Int[np.ndarray, " paths"]  # index of the chain; −1: of none
    gain: Float[np.ndarray, " paths"]  # log-likelihood over that of a path from anywhere [-]


def likelihoods(
    paths: ListedPaths,
    rows: Int[np.ndarray, " rows"],
    mirrors: Mirrors,
    users: Float[np.ndarray, "candidates #rows axes"],
    offset: float,
    around: Float[np.ndarray, "candidates #rows axes axes"] | None = None,
) -> Float[np.ndarray, "candidates rows chains"]:
    """Return how much likelier each path is over each chain than from anywhere, as logarithms.

    Parameters
    ----------
    paths, rows
        All paths, and those that are looked at.
    mirrors
        The mirrors.
    users
        Where the user may be, for each of these paths or for all of them. [m]
    offset
        By which lengths are longer than listed. [m]
    around
        Covariance of these places. [m²]
    """
    turn, shift = mirrors.images
    images = np.einsum("kij,crj->crki", turn, users) + shift
    total = paths.covariance(offset)[rows][None, :, None]
    if around is not None:
        total = total + np.einsum("kij,crjl,kml->crkim", turn, around, turn)
    density = paths.log_spread(offset)[rows] - paths.log_clutter
    likely = log_normal(paths.images(offset)[rows][None, :, None] - images, total)
    able = mirrors.reflects(users.reshape(-1, paths.axes)).reshape(*users.shape[:2], len(shift))
    likely += density[:, None] + log_priors(len(mirrors))
    excess = paths.excess_db(offset)
    if excess is not None:
        orders = [len(chain) for chain in chains_of(len(mirrors))]
        likely += level_gains(excess[rows], paths.level_deviation_db)[:, orders]
    return np.where(able, likely, -np.inf)


def log_priors(count: int) -> Float[np.ndarray, " chains"]:
    """Return the logarithms of the prior probabilities of all chains over so many mirrors."""
    chains = chains_of(count)
    orders = np.array([len(chain) for chain in chains])
    return np.asarray(np.log(np.array(BY_ORDER)[orders] / np.bincount(orders)[orders]))


def paired(likely: Float[np.ndarray, "rows chains"]) -> tuple[np.ndarray, np.ndarray]:
    """Pair paths with chains, each at most once; return the chains (−1: none) and the gains."""
    from scipy.optimize import linear_sum_assignment  # takes long to import

    useful = np.maximum(likely, 0.0)
    chain = np.full(len(likely), -1)
    gain = np.zeros(len(likely))
    for row, column in zip(*linear_sum_assignment(-useful), strict=True):
        if useful[row, column] > 0:
            chain[row], gain[row] = column, useful[row, column]
    return chain, gain


def explained(
    paths: ListedPaths,
    mirrors: Mirrors,
    users: Float[np.ndarray, "places axes"],
    offset: float,
    user_covariance: Float[np.ndarray, "places axes axes"] | None = None,
) -> Explanation:
    """Pair the paths of all places; of places that are NaN, none."""
    chain = np.full(paths.place.size, -1)
    gain = np.zeros(paths.place.size)
    rows = np.flatnonzero(np.isfinite(users).all(axis=1)[paths.place])
    where = paths.place[rows]
    around = None if user_covariance is None else user_covariance[where][None]
    likely = likelihoods(paths, rows, mirrors, users[where][None], offset, around)[0]
    for place in np.unique(where):
        here = where == place
        chain[rows[here]], gain[rows[here]] = paired(likely[here])
    return Explanation(chain=chain, gain=gain)


def candidate_users(
    paths: ListedPaths, rows: Int[np.ndarray, " rows"], mirrors: Mirrors, offset: float
) -> tuple[Float[np.ndarray, "candidates axes"], Float[np.ndarray, "candidates axes axes"]]:
    """Return where the user may be if one of a place's paths came over one chain, unfolded. [m]."""
    seen, spread = paths.images(offset)[rows], paths.covariance(offset)[rows]
    turn, shift = mirrors.images
    users = np.einsum("kji,rkj->rki", turn, seen[:, None] - shift)
    around = np.einsum("kji,rjl,klm->rkim", turn, spread, turn)
    able = mirrors.reflects(users.reshape(-1, paths.axes)).reshape(*users.shape[:2], len(shift))
    kept = np.diagonal(able, axis1=1, axis2=2)
    return users[kept], around[kept]
