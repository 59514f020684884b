r"""Number of pilots of a beam search, with and without a channel predicted from the map.

Run as ``python -m validation.experiments.beam_search_pilots [FILE.png]``.

A receiver with one radio chain measures one beam of its array at a time, and needs a pilot for
each. Users are at 100 places of the room of ``slam_2d``: half of them are isotropic, so that the
line of sight is strongest; half aim the 0.1 rad beam of the scenario at the wall, so that the line
of sight is negligible. Three searches:

- *exhaustive*: every beam of the codebook;
- *hierarchical*: from 4 elements on, ever longer parts of the array, the finer beams inside the
  best coarse one and its neighbours (after [1]_);
- *predicted*: the beams within 2.6 deviations of the paths that
  :func:`estimator.prediction.channel_2d.predict_channel` gives for the map and the user's position.

The array is 130 mm long, users are 0.3 to 2 m away: a beam has an angle and a curvature. The
codebook is that of [2]_, uniform in the cosine of the angle and in sin²θ/R. A pilot is one tone at
the centre of the band. What a search finds counts if it is within 1 dB of the codebook's best beam.

Chosen here: SNRs of 20 dB and of 0 dB, of one element on average; positions known to 1 mm … 10 cm
(rms in each coordinate). The walls are those that the estimator finds in the scenario's echo, with
their errors.

Claims that are asserted: at 20 dB every search finds a beam within 1 dB for at least 95 % of the
users; with positions known to 1 cm the prediction then needs less than a hundredth of the
exhaustive search's pilots and less than half of the hierarchical one's; at 0 dB the hierarchical
search loses many users, for its first beams have little gain, and the predicted one does not.
What it also shows: from some 2 cm of uncertainty on, a hierarchical search at a good SNR needs
fewer pilots than a sweep of all beams that the position allows.

References
----------
.. [1] Xiao, He, Xia, Xia, "Hierarchical codebook design for beamforming training in
   millimeter-wave communication", IEEE Trans. Wireless Commun. 15(5), 2016.
.. [2] Cui, Dai, "Channel estimation for extremely large-scale MIMO: far-field or near-field?",
   IEEE Trans. Commun. 70(4), 2022.
"""

# Over 400 lines: codebooks, searches and their scores are one comparison.

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Complex, Float, Int
from matplotlib.axes import Axes
from scipy.constants import speed_of_light

from estimator.geometry.wall_2d import Wall, mirrored
from estimator.mapping.map_2d import build_room_map
from estimator.prediction.channel_2d import predict_channel
from scenes.files.loading import load_scenario
from simulator.simulation import simulate
from validation.analytic.point_scatterer import complex_noise

FREQUENCY = 257.5e9
WAVELENGTH = speed_of_light / FREQUENCY
ELEMENTS, SPACING = 260, 0.5e-3
HALF_WALL = 0.2 / np.sqrt(2) * np.array([1.0, 1.0, 0.0])
MIDDLE = np.array([0.0, 0.8, 0.0])
WALL = Wall(start=MIDDLE - HALF_WALL, end=MIDDLE + HALF_WALL, covariance=np.zeros((2, 2)))
"""The wall of slam_2d."""
BEAM_SIGMA = 0.1  # of the field of a user that aims at the wall [rad]
USERS = 100
DEVIATIONS = (1e-3, 3e-3, 1e-2, 3e-2, 1e-1)  # of the position [m]
SNRS_DB = (20.0, 0.0)
LOSS_DB = 1.0
REACH = 2.6
"""Standard deviations to either side: 99 % of a Gaussian. [-]"""
MOST_CURVATURE = 2.0
"""Largest curvature of the codebook, sin²θ/R of the nearest user. [1/m]"""
FIRST_ELEMENTS = 4
LEAST_FOUND = 0.95


@dataclass(frozen=True, kw_only=True)
class Codebook:
    """Beams of the middle part of the array."""

    cosines: Float[np.ndarray, " beams"]
    curvatures: Float[np.ndarray, " beams"]  # sin²θ/R [1/m]
    weights: Complex[np.ndarray, "beams elements"]  # unit norm


@dataclass(frozen=True, kw_only=True)
class User:
    """A user's position, and the channel of its tone at each element."""

    position: Float[np.ndarray, " 3"]  # [m]
    channel: Complex[np.ndarray, " elements"]


@dataclass(frozen=True, kw_only=True)
class Score:
    """Performance of one search at one SNR."""

    name: str
    snr_db: float
    pilots: float  # mean over the users
    found: float  # share of the users with a beam within LOSS_DB [-]


def element_places() -> Float[np.ndarray, " elements"]:
    """Return the elements' positions along the array. [m]."""
    places: np.ndarray = (np.arange(ELEMENTS) - (ELEMENTS - 1) / 2) * SPACING
    return places


def codebook(elements: int) -> Codebook:
    """Return the beams of the middle ``elements``.

    Steps are λ/2d in cosθ, with a loss of 0.9 dB half way, and 3λ/d² in the curvature: half of one
    changes the phase at the ends by 3π/8, 0.35 rad rms, a loss of 0.5 dB.
    """
    length = elements * SPACING
    step = WAVELENGTH / (2 * length)
    cosines = np.arange(-1 + step / 2, 1, step)
    bend = 3 * WAVELENGTH / length**2
    count = max(1, int(np.ceil(MOST_CURVATURE / bend)))
    curvatures = (np.arange(count) + 0.5) * MOST_CURVATURE / count
    pairs = np.stack(np.meshgrid(cosines, curvatures, indexing="ij"), axis=-1).reshape(-1, 2)
    places = element_places()
    used = np.abs(places) < length / 2
    # To second order the distance of an element at x is R - x cosθ + x² sin²θ/2R.
    away = -pairs[:, :1] * places + pairs[:, 1:] * places**2 / 2
    weights = used * np.exp(-2j * np.pi * away / WAVELENGTH) / np.sqrt(used.sum())
    return Codebook(cosines=pairs[:, 0], curvatures=pairs[:, 1], weights=weights)


def draw_users(count: int, rng: np.random.Generator) -> list[User]:
    """Draw users in front of the wall whose image in it is visible to the whole array."""
    places = np.zeros((ELEMENTS, 3))
    places[:, 0] = element_places()
    ends = np.stack([WALL.start, WALL.end])
    users: list[User] = []
    while len(users) < count:
        spot = np.append(rng.uniform([0.2, 0.25], [1.2, 1.3]), 0.0)
        image = mirrored(spot, WALL.start, WALL.end)
        # Points at which rays from both ends of the array meet the wall's line, over its length.
        turned = np.cross(ends - image, places[[0, -1], None] - image)[..., 2]
        inside = np.all(turned[:, 0] * turned[:, 1] < 0)
        if spot[1] - spot[0] > 0.75 or image[1] < 0.3 or not inside:
            continue
        aimed = len(users) % 2 == 1
        channel = _wave(spot, places) * _pattern(spot, np.zeros(3), aimed=aimed)
        foot = _bounce(image)
        channel = channel + _wave(image, places) * _pattern(spot, foot, aimed=aimed)
        users.append(User(position=spot, channel=channel))
    return users


def _wave(
    source: Float[np.ndarray, " 3"], places: Float[np.ndarray, "elements 3"]
) -> Complex[np.ndarray, " elements"]:
    away = np.linalg.norm(source - places, axis=-1)
    wave: np.ndarray = np.exp(-2j * np.pi * away / WAVELENGTH) / away
    return wave


def _bounce(image: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 3"]:
    """Point of the wall's line, at 45°, on the path from the array's centre to an image. [m]."""
    return np.asarray(image * (MIDDLE[1] - MIDDLE[0]) / (image[1] - image[0]))


def _pattern(
    spot: Float[np.ndarray, " 3"], towards: Float[np.ndarray, " 3"], *, aimed: bool
) -> float:
    """Field of the Gaussian beam (4-1) at the wall's middle, or of an isotropic user."""
    if not aimed:
        return 1.0
    middle = MIDDLE - spot
    away = towards - spot
    cosine = middle @ away / (np.linalg.norm(middle) * np.linalg.norm(away))
    return float(np.exp(-(np.arccos(np.clip(cosine, -1, 1)) ** 2) / (2 * BEAM_SIGMA**2)))


Search = Callable[[User, np.random.Generator, float], tuple[int, int]]
"""Returns the beam of the whole codebook that was found, and the number of pilots."""


def hear(
    weights: Complex[np.ndarray, "beams elements"],
    user: User,
    rng: np.random.Generator,
    noise: float,
) -> Float[np.ndarray, " beams"]:
    """Return each beam's measured magnitude: unit-norm weights pass the noise of one element."""
    heard = weights.conj() @ user.channel
    power: np.ndarray = np.abs(heard + complex_noise(heard.shape, noise, rng)) ** 2
    return power


def exhaustive(book: Codebook) -> Search:
    """Try every beam."""

    def search(user: User, rng: np.random.Generator, noise: float) -> tuple[int, int]:
        return int(np.argmax(hear(book.weights, user, rng, noise))), len(book.cosines)

    return search


def hierarchical(books: Sequence[Codebook]) -> Search:
    """Try all beams of the shortest subarray, then those near the best of the last subarray."""
    near = [_children(coarse, fine) for coarse, fine in pairwise(books)]

    def search(user: User, rng: np.random.Generator, noise: float) -> tuple[int, int]:
        best = int(np.argmax(hear(books[0].weights, user, rng, noise)))
        spent = len(books[0].cosines)
        for children, book in zip(near, books[1:], strict=True):
            tried = children[best]
            best = int(tried[np.argmax(hear(book.weights[tried], user, rng, noise))])
            spent += tried.size
        return best, spent

    return search


def _children(coarse: Codebook, fine: Codebook) -> list[Int[np.ndarray, " beams"]]:
    """Beams of the finer book inside each coarse one, and the next on either side."""
    wide = 0.5 * _step(coarse.cosines) + _step(fine.cosines)
    deep = 0.5 * _step(coarse.curvatures) + 0.5 * _step(fine.curvatures)
    return [
        np.flatnonzero(
            (np.abs(fine.cosines - cosine) < wide) & (np.abs(fine.curvatures - curvature) <= deep)
        )
        for cosine, curvature in zip(coarse.cosines, coarse.curvatures, strict=True)
    ]


def _step(values: Float[np.ndarray, " beams"]) -> float:
    distinct = np.unique(values)
    return float(distinct[1] - distinct[0]) if distinct.size > 1 else 2 * MOST_CURVATURE


def predicted(
    book: Codebook, walls: Sequence[Wall], deviation: float, errors: np.random.Generator
) -> Search:
    """Try the beams that the map and an uncertain position allow."""

    def search(user: User, rng: np.random.Generator, noise: float) -> tuple[int, int]:
        told = user.position + deviation * np.append(errors.standard_normal(2), 0.0)
        tried = beams_to_try(book, walls, told, deviation)
        if not tried.size:
            return 0, 0
        return int(tried[np.argmax(hear(book.weights[tried], user, rng, noise))]), tried.size

    return search


def beams_to_try(
    book: Codebook,
    walls: Sequence[Wall],
    position: Float[np.ndarray, " 3"],
    deviation: float,
) -> Int[np.ndarray, " beams"]:
    """Return the beams within REACH deviations, and half a step, of a predicted path."""
    covariance = deviation**2 * np.diag([1.0, 1.0, 0.0])
    # Near a wall's end a reflection may or may not exist, by the position's uncertainty.
    paths = predict_channel(
        position, covariance, walls, frequency=FREQUENCY, end_slack=REACH * deviation
    )
    wide, deep = 0.5 * _step(book.cosines), 0.5 * _step(book.curvatures)
    allowed = np.zeros(len(book.cosines), dtype=bool)
    for path in paths:
        cosine, sine = np.cos(path.aoa), np.sin(path.aoa)
        curvature = sine**2 / path.radius
        slopes = np.array([2 * sine * cosine / path.radius, -(sine**2) / path.radius**2])
        around = REACH * sine * np.sqrt(path.covariance[0, 0]) + wide
        # Least and largest curvature; beyond the codebook's end, its last value.
        bent = REACH * np.sqrt(slopes @ path.covariance @ slopes) + deep
        curvature = min(curvature, MOST_CURVATURE)
        allowed |= (np.abs(book.cosines - cosine) <= around) & (
            np.abs(book.curvatures - curvature) <= bent
        )
    return np.flatnonzero(allowed)


def score(name: str, search: Search, book: Codebook, users: Sequence[User], snr_db: float) -> Score:
    """Run a search for each user's beam."""
    rng = np.random.default_rng(1)
    spent, good = [], []
    for user in users:
        beam, pilots = search(
            user, rng, float(np.mean(np.abs(user.channel) ** 2)) * 10 ** (-snr_db / 10)
        )
        power = np.abs(book.weights.conj() @ user.channel) ** 2
        good.append(bool(power[beam] >= 10 ** (-LOSS_DB / 10) * power.max()))
        spent.append(pilots)
    return Score(
        name=name,
        snr_db=snr_db,
        pilots=float(np.mean(spent)),
        found=float(np.mean(good)),
    )


def scores(walls: Sequence[Wall], users: Sequence[User]) -> list[Score]:
    """Compare the three searches at all SNRs and uncertainties."""
    lengths = [FIRST_ELEMENTS]
    while lengths[-1] < ELEMENTS:
        lengths.append(min(2 * lengths[-1], ELEMENTS))
    books = [codebook(elements) for elements in lengths]
    book = books[-1]
    table = []
    for snr_db in SNRS_DB:
        searches: list[tuple[str, Search]] = [
            ("exhaustive", exhaustive(book)),
            ("hierarchical", hierarchical(books)),
        ]
        searches += [
            (f"{1e3 * deviation:g} mm", predicted(book, walls, deviation, np.random.default_rng(2)))
            for deviation in DEVIATIONS
        ]
        table += [score(name, search, book, users, snr_db) for name, search in searches]
    return table


def located_walls() -> tuple[Wall, ...]:
    """Find the walls in the scenario's simulated echo."""
    echo = simulate(load_scenario("slam_2d"), seed=0).measurement.echo
    if echo is None:
        raise RuntimeError("slam_2d has no echo")
    return build_room_map(echo).walls


def check(table: Sequence[Score]) -> None:
    """Check the claims.

    Raises
    ------
    RuntimeError
        If one does not hold.
    """
    by = {(one.name, one.snr_db): one for one in table}
    high, low = SNRS_DB
    sweep, tree, told = (by[name, high] for name in ("exhaustive", "hierarchical", "10 mm"))
    for one in table:
        if one.snr_db == high and one.found < LEAST_FOUND:
            raise RuntimeError(
                f"{one.name}, SNR {high:g} dB: {100 * one.found:.0f} % of the users are found, at "
                f"least {100 * LEAST_FOUND:.0f} % are claimed"
            )
    if told.pilots > sweep.pilots / 100 or told.pilots > tree.pilots / 2:
        raise RuntimeError(
            f"the prediction at 10 mm needs {told.pilots:.1f} pilots, the exhaustive search "
            f"{sweep.pilots:.0f}, the hierarchical one {tree.pilots:.1f}"
        )
    tree, told = by["hierarchical", low], by["10 mm", low]
    # The standard deviation of both shares is √(p(1-p)/n): three of their difference.
    scatter = 3 * np.sqrt(2 * 0.25 / USERS)
    if told.found - tree.found < scatter:
        raise RuntimeError(
            f"SNR {low:g} dB: {100 * told.found:.0f} % found by prediction, {100 * tree.found:.0f} "
            f"% by the hierarchical search; {100 * scatter:.0f} % more are claimed"
        )


def draw(axes: Sequence[Axes], table: Sequence[Score]) -> None:
    """Draw pilots, and users found, over the uncertainty of the position."""
    high = SNRS_DB[0]
    for snr_db, line in zip(SNRS_DB, ("-", "--"), strict=True):
        for name, colour in (("exhaustive", "0.3"), ("hierarchical", "tab:orange")):
            (one,) = [one for one in table if (one.name, one.snr_db) == (name, snr_db)]
            if snr_db == high:
                axes[0].axhline(one.pilots, color=colour, label=f"{name}: {one.pilots:.0f}")
            label = f"{name}, SNR {snr_db:g} dB"
            axes[1].axhline(100 * one.found, color=colour, ls=line, label=label)
        ours = [one for one in table if one.name.endswith("mm") and one.snr_db == snr_db]
        deviations = 1e3 * np.array(DEVIATIONS)
        if snr_db == high:
            axes[0].loglog(deviations, [one.pilots for one in ours], "o-", label="predicted")
        axes[1].semilogx(
            deviations,
            [100 * one.found for one in ours],
            "o",
            ls=line,
            color="tab:blue",
            label=f"predicted, SNR {snr_db:g} dB",
        )
    axes[0].set(ylabel="pilots for each user", xlabel="position known to [mm]")
    axes[1].set(
        ylabel=f"users with a beam within {LOSS_DB:g} dB [%]",
        xlabel="position known to [mm]",
        ylim=(0, 103),
    )
    for ax in axes:
        ax.grid(which="both", alpha=0.3)
        ax.legend()


def main(arguments: list[str]) -> None:
    """Search, print, draw, and assert the claims."""
    walls = located_walls()
    table = scores(walls, draw_users(USERS, np.random.default_rng(0)))
    for one in table:
        print(
            f"SNR {one.snr_db:4g} dB  {one.name:>12}: {one.pilots:7.1f} pilots, "
            f"{100 * one.found:5.1f} % within {LOSS_DB:g} dB"
        )
    figure, axes = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    draw(list(axes), table)
    path = Path(arguments[0] if arguments else "beam_search_pilots.png")
    figure.savefig(path, dpi=150)
    print(f"written: {path}")
    check(table)


if __name__ == "__main__":
    main(sys.argv[1:])
