r"""Posterior probability of each explanation of a user's paths.

An explanation h says over which mirrors some of the paths come; the others it leaves unexplained.
With the paths' bearings and lengths z, their covariance S (walls' errors in it), a flat prior over
places u, and the level e of each path,

.. math:: p(h \mid z) \propto \pi_h [ \int N(z; z_h(u), S)\, \frac{du}{A} ]
          \prod_{i \in h} p(e_i \mid n_i) \prod_{k} \frac{q_k}{\pi L} .

The second product is over the paths k that are left. The integral is that of a Gaussian about the
least-squares solution (Laplace's approximation): several paths that agree on one position weigh
about a million times as much as one of them alone, because independent paths would rarely agree by
chance. :math:`\pi_h` is the probability that the
rays hit the walls within their extents as h says. A further hypothesis is *none of them*: a path
was reflected by one more mirror, which the map does not show. Its weight is the product of a
prior, of what the image shows where that mirror would have to be, and of the likelihood of the
path's level, since each reflection attenuates.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from estimator.channel.path import Path, PathSet
from estimator.geometry.path_tracing import trace
from estimator.geometry.specular_chains import Chain
from estimator.positioning.blockage import WITH_A_MIRROR, Sight, chance_of_blockage
from estimator.positioning.level_likelihood import (
    BLOCKED,
    SMOOTH_METAL,
    Way,
    by_tilt,
    level_density,
    path_excess_db,
    told_excess_db,
)
from estimator.positioning.los_check import StraightWay
from estimator.positioning.map_context import MapContext
from estimator.positioning.weighted_least_squares import Consensus
from estimator.prediction.wall_reflection import excess_db

CERTAIN = 0.999
"""Posterior probability of a place from which it is ``found``: one wrong answer in a thousand,
where the model holds. [-]"""

UNSEEN = 0.05
"""Prior probability that a strong path which seems direct comes over a mirror that the map does not
show. In 2500 random rooms, by the image method, 176 of 2079 strongest paths were reflected ones,
some over walls that are seen. [-]"""

CLEAR_UNSEEN = 5e-4
"""The probability of a mirror on a way that is shown clear, where levels tell nothing. Antennas
with a gain are aimed at what they see; the image alone decides then. [-]"""

UNEXPLAINED_UNSEEN = 10.0
"""How much likelier an unseen mirror is for one path if another as strong comes over one for sure:
nothing that the map shows explains it. [-]"""

FURTHER: Mapping[Sight, float] = {"clear": 5e-4, "between ends": 0.05, "behind a point": 0.02}
"""The probability of one more mirror on a way beyond the first that is known, where nothing, a
mirror's two ends or its near end alone are about it. [-]"""

UNEXPLAINED = 0.1
"""Prior probability of a path that nothing explains and that is as strong as the answer's. Of one
that is stronger it falls with the fourth power of the ratio: a quarter of the energy does not
decide (1 in 1000). [-]"""
FEEBLE = 0.25
"""Share of energy, over the strongest path's, below which an unexplained path is usual: on its
shadow boundary an edge scatters half of the field that meets it, a quarter of the energy, and less
beside it. It is not reached in five of the rooms of ``python -m validation.experiments.thresholds
decisions``: half and twice of it change nothing. [-]"""
USUAL = 0.5
"""Prior probability of those, scattering by edges and rough patches: that there is one is as likely
as not. An answer that leaves one more of them loses ln 2 of the ln 1000 that make it certain. In
the same rooms nothing changes with half of it and with 0.9. [-]"""
EARLIER = 1e-5
"""Probability that a path which passes for a mirror's is there before the direct one: no way is
shorter than the straight one, and what is taken for one then is none. [-]"""
EARLIER_CELLS = 4.0
"""Cells c/2B of the image by which it must be shorter: two of the pilot's. [cells]"""
BESIDE_CELL = 3.0
"""Cells of the image within which another path is a part of the same wave: bent by roughness, it is
fitted by two. [cells]"""

LARGER_PART = 2.0
"""Share of energy, over that of the path beside it, from which a path is no part of the other's
wave but the other way round. [-]"""

PART = 0.1
"""Share of energy, over a path's, from which another beside it is a part of the same wave: a tenth
moves its level by 0.4 dB. [-]"""

RINGS = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0)
"""Angles beside a path's own, over its reach of two deviations, at which its ray is tried: half a
deviation apart, and beyond two of them one, to the fourth. A level may say a thousand times over
that a ray passes beside a wall. [-]"""

NO_SHADOW = 0.25
"""Probability that what shadows a part of the array is nothing that the map shows: so in one of the
four shadowed waves of 66 random rooms. [-]"""

LEAST_CHAIN = 1e-12
"""Least probability of a chain that no ray about a path meets: its logarithm stays finite. [-]"""


def chain_probabilities(
    length: float, path: Path, room: MapContext, found: PathSet, reach: float
) -> dict[Chain, float]:
    """Return how probable the mirrors are that a path's ray may meet.

    Parameters
    ----------
    length
        Of the path. [m]
    path, room, found
        The path, the map, and what the array measures.
    reach
        Angle by which the ray may be off a wall's end: two deviations. [rad]
    """
    bearing, how = path.wave.bearing, found.how
    weights: dict[Chain, float] = {}

    def met_from(start: Float[np.ndarray, " 3"], image: Float[np.ndarray, " 3"]) -> Chain:
        way = image - start
        far = float(np.linalg.norm(way))
        return trace(way / far, far, room.walls, start=start)[1]

    def meet(turned: np.ndarray, weight: float) -> None:
        image = length * how.towards(turned)
        if path.shadow is None:
            chain = met_from(np.zeros(3), image)
        else:
            # What shadows some elements takes them another chain.
            chain = met_from(path.shadow.reached, image)
            if met_from(path.shadow.dark, image) == chain:
                weight *= NO_SHADOW
        weights[chain] = weights.get(chain, 0.0) + weight

    meet(bearing, 1.0)
    for ring in RINGS:
        around = how.around(bearing, ring * reach)
        for turned in around:
            meet(turned, 2 * float(np.exp(-0.5 * (2 * ring) ** 2)) / len(around))
    total = sum(weights.values())
    return {chain: weight / total for chain, weight in weights.items()}


def log_weight(
    consensus: Consensus,
    found: PathSet,
    room: MapContext,
    chains: Mapping[int, Mapping[Chain, float]],
) -> float:
    """Weigh one explanation; see the module's equation."""
    total = consensus.log_evidence - np.log(_area(found))
    used = {one.path: one.chain for one in consensus.sightings}
    strongest = max(found.paths[index].share for index in used)
    straight = next((found.paths[i].wave.path_length for i, c in used.items() if not c), None)
    early = EARLIER_CELLS * room.resolution.along_ray
    for index, chain in used.items():
        path = found.paths[index]
        total += np.log(max(chains[index].get(chain, 0.0), LEAST_CHAIN))
        excess = level_of(path, found, room)
        if excess is not None:
            first = arrives_first(path, found, room)
            blocked = BLOCKED
            if chain and first:
                blocked = chance_of_blockage(consensus.position, room, found.how)
            tilted = tilt_ratio(path, found, room, way="reflected", over="direct")
            weight = level_density(excess, len(chain), first=first, blocked=blocked, tilted=tilted)
            total += np.log(weight)
    for index in chains:
        if index in used:
            continue
        path = found.paths[index]
        whole = [
            found.paths[other].share
            for other in used
            if beside(path, found.paths[other], room)
            and path.share < LARGER_PART * found.paths[other].share
        ]
        if whole:
            # A part of a wave that is explained: the larger part is likelier to be where it is.
            total += np.log(max(whole) / (max(whole) + path.share))
            continue
        total += np.log(_unexplained(path.share / strongest) / _directions(found, path))
        if straight is not None and path.wave.path_length < straight - early:
            total += np.log(EARLIER)
        excess = level_of(path, found, room)
        if excess is not None:
            total += np.log(level_density(excess, 2))
    return float(total)


def level_of(path: Path, found: PathSet, room: MapContext) -> float | None:
    """Return a path's level over that of free space; None if it is not informative. [dB].

    A wavefront distorted by roughness may have been fitted by two waves: then the level is that of
    all the pilot's power that the other paths do not hold.
    """
    parts = _parts(path, found, room)
    if not parts:
        return path_excess_db(path, found.frequency)
    if found.frequency is None or found.power is None:
        return None
    rest = 1.0 - sum(
        one.share for one in found.paths if one is not path and all(one is not p for p in parts)
    )
    if not rest > 0:
        return None
    amplitude = float(np.sqrt(rest * found.power))
    return told_excess_db(excess_db(amplitude, path.wave.path_length, found.frequency))


def _parts(path: Path, found: PathSet, room: MapContext) -> list[Path]:
    """Return the other parts of a path's wave, none if all of them are small."""
    parts = [other for other in found.paths if other is not path and beside(path, other, room)]
    return parts if any(other.share > PART * path.share for other in parts) else []


def tilt_ratio(path: Path, found: PathSet, room: MapContext, *, way: Way, over: Way) -> float:
    """Return how much likelier a path's tilt is for one way than for another; 1 if unknown. [-].

    One part of a wave that roughness bends has a tilt of its own, which tells nothing.
    """
    if path.tilt_db is None or found.bandwidth is None or found.frequency is None:
        return 1.0
    if _parts(path, found, room):
        return 1.0
    return by_tilt(path.tilt_db, found.frequency, found.bandwidth, way=way, over=over)


def arrives_first(path: Path, found: PathSet, room: MapContext) -> bool:
    """Tell whether no mirror-like path is shorter than a path, beyond the resolution."""
    early = EARLIER_CELLS * room.resolution.along_ray
    return not any(
        one.specular and one.wave.path_length < path.wave.path_length - early for one in found.paths
    )


def beside(one: Path, other: Path, room: MapContext) -> bool:
    """Tell whether two paths may be parts of one wave that roughness bends."""
    apart = np.abs(one.wave.bearing - other.wave.bearing)
    # The uplink's cells are twice the echo's.
    near = 2 * BESIDE_CELL * room.resolution.across_ray
    late = abs(one.wave.path_length - other.wave.path_length)
    return bool(np.all(apart < near) and late < 2 * BESIDE_CELL * room.resolution.along_ray)


def unseen_odds(
    explanation: Consensus,
    found: PathSet,
    room: MapContext,
    way: StraightWay,
) -> float:
    """Return the odds that a lone path came over one more mirror than it is said to. [-].

    Parameters
    ----------
    explanation
        Of the path.
    found, room
        The paths and the map.
    way
        What the image shows of the way on which that mirror would be: the straight way of a direct
        path, the legs beyond the first mirror of one that was reflected.
    """
    (only,) = explanation.sightings
    path = found.paths[only.path]
    more = UNEXPLAINED_UNSEEN if strong_unexplained(explanation, found, room) else 1.0
    excess = level_of(path, found, room)
    if only.chain:
        odds = FURTHER.get(way.sight, FURTHER["clear"])
    elif excess is None and way.sight in ("clear", "clear aside"):
        odds = CLEAR_UNSEEN
    else:
        odds = UNSEEN / (1 - UNSEEN) * WITH_A_MIRROR[way.sight]
    tilted = tilt_ratio(path, found, room, way="reflected", over="direct")
    if excess is None:
        # One mirror tilts a level as the next one does: of a reflected path it tells nothing.
        lossy = way.edges.lossy * (1.0 if only.chain else tilted)
        odds *= SMOOTH_METAL * way.edges.metal + (1 - SMOOTH_METAL) * lossy
    if excess is not None:
        bounces = len(only.chain)
        first = arrives_first(path, found, room)
        hidden = BLOCKED if bounces else way.blocked
        more_mirrors = level_density(
            excess,
            bounces + 1,
            first=first,
            blocked=hidden,
            tilted=tilted * way.edges.lossy,
            smooth=way.edges.metal,
        )
        odds *= more_mirrors / level_density(excess, bounces, first=first, tilted=tilted)
    return odds * more


def strong_unexplained(explanation: Consensus, found: PathSet, room: MapContext) -> bool:
    """Tell whether a mirror-like path about as strong as an explanation's is left over.

    One that comes from where the image shows nothing, and is longer, may come over walls that no
    image shows, such as a floor: it says nothing of others.
    """
    used = [found.paths[one.path] for one in explanation.sightings]
    energy = sum(path.share for path in used)
    shortest = min(path.wave.path_length for path in used)
    for index, path in enumerate(found.paths):
        if not path.specular or index in {one.path for one in explanation.sightings}:
            continue
        strong = path.share > FEEBLE * energy and not any(beside(path, u, room) for u in used)
        shown = room.shows(found.how.towards(path.wave.bearing))
        if strong and (shown or path.wave.path_length < shortest):
            return True
    return False


def _unexplained(ratio: float) -> float:
    """Return the prior probability of a path over its share in that of the explained ones."""
    if ratio < FEEBLE:
        return USUAL
    return UNEXPLAINED / max(ratio, 1.0) ** 4


def _directions(found: PathSet, path: Path) -> float:
    """Return the extent of what a path may be: bearings times lengths. [rad m] or [m]."""
    flat = len(found.how.coordinates) == 2
    return float((np.pi if flat else 2 * np.pi) * path.unambiguous)


def normalised(weights: Sequence[float]) -> Float[np.ndarray, " weights"]:
    """Turn logarithms of weights into probabilities."""
    values = np.exp(np.array(weights) - max(weights))
    return np.asarray(values / values.sum())


def _area(found: PathSet) -> float:
    """Area, or volume, in which a user may be: half a disk, or half a ball. [m²] or [m³]."""
    reach = max(path.unambiguous for path in found.paths)
    flat = len(found.how.coordinates) == 2
    return float(np.pi / 2 * reach**2 if flat else 2 * np.pi / 3 * reach**3)
