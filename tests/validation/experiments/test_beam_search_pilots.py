from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.geometry.wall_2d import mirrored
from validation.experiments import beam_search_pilots as experiment
from validation.experiments.beam_search_pilots import (
    DEVIATIONS,
    ELEMENTS,
    LOSS_DB,
    SNRS_DB,
    WALL,
    Codebook,
    Score,
    User,
    beams_to_try,
    check,
    codebook,
    draw,
    draw_users,
    element_places,
    exhaustive,
    hierarchical,
)


@pytest.fixture(scope="module")
def book() -> Codebook:
    return codebook(ELEMENTS)


@pytest.fixture(scope="module")
def users() -> list[User]:
    return draw_users(8, np.random.default_rng(3))


def loss_db(book: Codebook, beam: int, user: User) -> float:
    power = np.abs(book.weights.conj() @ user.channel) ** 2
    return float(10 * np.log10(power.max() / power[beam]))


def test_some_beam_of_the_codebook_is_good_for_every_wave(book: Codebook) -> None:
    rng = np.random.default_rng(0)
    places = element_places()
    assert np.linalg.norm(book.weights, axis=1) == pytest.approx(np.ones(len(book.cosines)))
    for _ in range(20):
        cosine, curvature = rng.uniform(-0.9, 0.9), rng.uniform(0.1, 1.9)
        away = -cosine * places + curvature * places**2 / 2
        wave = np.exp(-2j * np.pi * away * experiment.FREQUENCY / speed_of_light)
        best = np.abs(book.weights.conj() @ wave).max() ** 2 / ELEMENTS
        # A quarter of a null width beside the beam, and a bend of 0.35 rad rms: 0.9 dB + 0.5 dB.
        assert -1.5 < 10 * np.log10(best) <= 1e-9


def test_users_are_where_the_whole_array_sees_them_in_the_wall(users: list[User]) -> None:
    along = WALL.end - WALL.start
    for user in users:
        image = mirrored(user.position, WALL.start, WALL.end)
        for place in (element_places()[0], element_places()[-1]):
            way = image - np.array([place, 0.0, 0.0])
            system = np.stack([way[:2], -along[:2]], axis=1)
            reach, share = np.linalg.solve(system, (WALL.start - [place, 0.0, 0.0])[:2])
            assert 0 < share < 1
            assert 0 < reach < 1


def test_users_that_look_at_the_wall_have_no_line_of_sight_to_speak_of(
    book: Codebook, users: list[User]
) -> None:
    for index, user in enumerate(users):
        direct = user.position[0] / np.linalg.norm(user.position)
        best = int(np.argmax(np.abs(book.weights.conj() @ user.channel)))
        over_wall = abs(book.cosines[best] - direct) > 0.05  # several beams
        assert over_wall == (index % 2 == 1)


def test_without_noise_every_search_finds_a_good_beam(book: Codebook, users: list[User]) -> None:
    rng = np.random.default_rng(0)
    books = [codebook(elements) for elements in (4, 8, 16, 32, 64, 128)] + [book]
    tree = hierarchical(books)
    for user in users:
        beam, spent = exhaustive(book)(user, rng, 0.0)
        assert (loss_db(book, beam, user), spent) == (0.0, len(book.cosines))
        beam, spent = tree(user, rng, 0.0)
        assert loss_db(book, beam, user) < LOSS_DB
        assert spent < len(book.cosines) / 20
        tried = beams_to_try(book, [WALL], user.position, 1e-4)
        assert min(loss_db(book, int(one), user) for one in tried) < LOSS_DB
        assert tried.size <= 8  # two paths; two beams beside each other in angle, two in curvature


def test_the_less_is_known_the_more_beams_are_tried(book: Codebook, users: list[User]) -> None:
    for user in users[:3]:
        tried = [
            set(beams_to_try(book, [WALL], user.position, deviation).tolist())
            for deviation in DEVIATIONS
        ]
        assert all(few <= more for few, more in pairwise(tried))
        assert len(tried[-1]) > 10 * len(tried[0])


def table(**changes: tuple[float, float]) -> list[Score]:
    """What is claimed, with some (pilots, found) of the searches at the lower SNR changed."""
    names = {"exhaustive": (4470.0, 1.0), "hierarchical": (56.0, 1.0)}
    names |= {f"{1e3 * deviation:g} mm": (20.0, 1.0) for deviation in DEVIATIONS}
    low = names | {"hierarchical": (56.0, 0.6)}
    return [
        Score(name=name, snr_db=snr_db, pilots=pilots, found=found)
        for snr_db, rows in zip(SNRS_DB, (names | changes, low), strict=True)
        for name, (pilots, found) in rows.items()
    ]


def test_the_claims_hold_or_are_refuted() -> None:
    check(table())
    with pytest.raises(RuntimeError, match="94 % of the users are found"):
        check(table(hierarchical=(56.0, 0.94)))
    with pytest.raises(RuntimeError, match=r"needs 20\.0 pilots"):
        check(table(hierarchical=(30.0, 1.0)))
    blind = [
        Score(name=one.name, snr_db=one.snr_db, pilots=one.pilots, found=1.0) for one in table()
    ]
    with pytest.raises(RuntimeError, match="by the hierarchical search"):
        check(blind)


def test_the_figure_shows_all_searches() -> None:
    figure, axes = plt.subplots(1, 2)
    draw(list(axes), table())
    labels = axes[0].get_legend_handles_labels()[1]
    assert labels == ["exhaustive: 4470", "hierarchical: 56", "predicted"]
    plt.close(figure)
