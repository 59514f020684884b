"""Realisations against what was asked of them.

Unless said otherwise, an estimate is averaged over independent realisations, and must lie
within 4.5 standard errors (taken from their scatter) of its closed form: seeds are fixed, and
of a hundred such checks none would fail by chance (7e-6 each).
"""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import erfc, j0
from scipy.stats import kstest

from scenes.surfaces.height_synthesis import rough_profile, rough_sheet

RMS, LENGTH, CUTOFF = 0.05e-3, 0.3e-3, 0.03e-3
STANDARD_ERRORS = 4.5


def rng(number: int) -> np.random.Generator:
    return np.random.default_rng([20, number])


def profile(number: int, **changes: Any) -> np.ndarray:
    options: dict[str, Any] = dict(
        length=0.03,
        count=401,
        rms=RMS,
        correlation_length=LENGTH,
        spectrum="gaussian",
        inner_cutoff=0.0,
        rng=rng(number),
    )
    return rough_profile(**(options | changes))


def sheet(number: int, **changes: Any) -> np.ndarray:
    options: dict[str, Any] = dict(
        lengths=(0.006, 0.0045),
        counts=(81, 61),
        rms=RMS,
        correlation_length=LENGTH,
        spectrum="gaussian",
        inner_cutoff=0.0,
        rng=rng(number),
    )
    return rough_sheet(**(options | changes))


def assert_mean_is(estimates: np.ndarray, expected: float) -> None:
    error = estimates.std(ddof=1) / np.sqrt(len(estimates))
    assert abs(estimates.mean() - expected) < STANDARD_ERRORS * error


def exponential_correlation(s: float) -> float:
    """exp(-|s|/l) smoothed by exp(-s²/c²), over its value at 0."""
    a = CUTOFF / (2 * LENGTH)

    def smoothed(s: float) -> float:
        left = np.exp(-s / LENGTH) * erfc(a - s / CUTOFF)
        right = np.exp(s / LENGTH) * erfc(a + s / CUTOFF)
        return float(left + right)

    return smoothed(s) / smoothed(0.0)


def test_the_mean_square_height_is_the_one_asked_for() -> None:
    squares = np.array([np.mean(profile(n) ** 2) for n in range(200)])
    # ∫ρ² ds = l √(π/2): that many independent lengths are in each realisation.
    expected_scatter = RMS**2 * np.sqrt(2 * LENGTH * np.sqrt(np.pi / 2) / 0.03)
    assert_mean_is(squares, RMS**2)
    # The scatter of 200 is itself known to 1/√400; four of those.
    assert squares.std(ddof=1) == pytest.approx(expected_scatter, rel=0.2)


@pytest.mark.parametrize("lag", [1, 2, 4, 6, 8, 40])
def test_heights_of_a_gaussian_surface_are_correlated_as_a_gaussian(lag: int) -> None:
    step = 0.03 / 400
    products = []
    for number in range(200):
        heights = profile(number)
        products.append(np.mean(heights[:-lag] * heights[lag:]))
    assert_mean_is(np.array(products), RMS**2 * np.exp(-((lag * step / LENGTH) ** 2)))


@pytest.mark.parametrize("lag", [1, 2, 5, 10, 20, 40])
def test_heights_of_an_exponential_surface_are_correlated_as_one(lag: int) -> None:
    step = CUTOFF / 2
    products = []
    for number in range(200):
        heights = profile(
            number, length=1000 * step, count=1001, spectrum="exponential", inner_cutoff=CUTOFF
        )
        products.append(np.mean(heights[:-lag] * heights[lag:]))
    assert_mean_is(np.array(products), RMS**2 * exponential_correlation(lag * step))


@pytest.mark.parametrize("spectrum", ["gaussian", "exponential"])
@pytest.mark.parametrize("band", [(1, 40), (40, 100), (100, 160)])
def test_every_band_of_the_spectrum_holds_its_power(spectrum: str, band: tuple[int, int]) -> None:
    length, count = 0.03, 4000
    k = 2 * np.pi * np.arange(*band) / length
    if spectrum == "gaussian":
        density = np.sqrt(np.pi) * LENGTH * np.exp(-((k * LENGTH / 2) ** 2))
    else:
        a = CUTOFF / (2 * LENGTH)
        kept = np.exp(a**2) * erfc(a)
        density = 2 * LENGTH / (1 + (k * LENGTH) ** 2) * np.exp(-((k * CUTOFF / 2) ** 2)) / kept
    ratios = []
    for number in range(30):
        heights = profile(
            number,
            length=length,
            count=count,
            spectrum=spectrum,
            inner_cutoff=CUTOFF,
            periodic=True,
        )
        power = np.abs(np.fft.rfft(heights, norm="forward")[slice(*band)]) ** 2
        ratios.append(power / (RMS**2 * density / length))
    mean = float(np.mean(ratios))
    # Each ratio is exponentially distributed with mean and deviation 1.
    assert abs(mean - 1) < STANDARD_ERRORS / np.sqrt(np.size(ratios))


@pytest.mark.parametrize("spectrum", ["gaussian", "exponential"])
def test_heights_are_normally_distributed(spectrum: str) -> None:
    # Every 100 points, 25 correlation lengths apart, are independent.
    heights = np.concatenate(
        [profile(n, spectrum=spectrum, inner_cutoff=CUTOFF)[::100] for n in range(400)]
    )
    assert kstest(heights / RMS, "norm").pvalue > 1e-4


def test_slopes_of_a_gaussian_surface_are_root_two_rms_over_the_correlation_length() -> None:
    step = LENGTH / 64  # the difference quotient is within (step/l)²/4 = 6e-5 of the slope
    squares = []
    for number in range(100):
        heights = profile(number, length=4000 * step, count=4001)
        squares.append(np.mean((np.diff(heights) / step) ** 2))
    assert_mean_is(np.array(squares), 2 * (RMS / LENGTH) ** 2)


def test_realisations_are_not_forced_to_the_mean_statistics() -> None:
    short = np.array([profile(n, length=0.003, count=41) for n in range(50)])
    # Ten correlation lengths: the mean of each is far from zero, its rms from the one asked.
    assert short.mean(axis=1).std() > 0.2 * RMS
    assert (short**2).mean(axis=1).std() > 0.2 * RMS**2


@pytest.mark.parametrize("spectrum", ["gaussian", "exponential"])
@pytest.mark.parametrize("coarser", [2, 5, 40, 400])
def test_more_samples_show_the_same_surface_more_finely(spectrum: str, coarser: int) -> None:
    fine = profile(3, spectrum=spectrum, inner_cutoff=CUTOFF)
    coarse = profile(3, spectrum=spectrum, inner_cutoff=CUTOFF, count=400 // coarser + 1)
    np.testing.assert_allclose(coarse, fine[::coarser], atol=1e-12 * RMS)  # rounding


def test_the_ends_of_a_line_know_nothing_of_each_other() -> None:
    ends = np.array([profile(n, length=0.003, count=41)[[0, -1]] for n in range(2000)])
    assert_mean_is(ends[:, 0] * ends[:, 1], RMS**2 * np.exp(-100.0))


def test_a_line_shorter_than_its_correlation_length_is_a_piece_of_a_longer_one() -> None:
    products = []
    for number in range(2000):
        ends = profile(number, length=LENGTH / 2, count=3)
        products.append(ends[0] * ends[-1])
    assert_mean_is(np.array(products), RMS**2 * np.exp(-0.25))


def test_a_closed_line_goes_on_where_it_began() -> None:
    step = 0.03 / 400
    products = []
    for number in range(400):
        heights = profile(number, count=400, periodic=True)
        products.append(heights[0] * heights[-1])
    assert_mean_is(np.array(products), RMS**2 * np.exp(-((step / LENGTH) ** 2)))


def test_the_same_stream_gives_the_same_bytes() -> None:
    assert profile(5).tobytes() == profile(5).tobytes()
    assert sheet(5).tobytes() == sheet(5).tobytes()


def test_a_smooth_surface_has_no_heights() -> None:
    assert not profile(0, rms=0.0).any()
    assert not sheet(0, rms=0.0).any()


def test_a_sheet_has_the_mean_square_height_asked_for() -> None:
    assert_mean_is(np.array([np.mean(sheet(n) ** 2) for n in range(150)]), RMS**2)


@pytest.mark.parametrize("lag", [(2, 0), (0, 2), (4, 0), (0, 4), (3, 3), (3, -3), (0, 30)])
def test_a_sheet_is_correlated_alike_in_every_direction(lag: tuple[int, int]) -> None:
    step = 0.006 / 80
    assert step == pytest.approx(0.0045 / 60)
    i, j = lag
    products = []
    for number in range(150):
        heights = sheet(number)
        if j < 0:
            heights = heights[:, ::-1]
        first, second = heights[i:, abs(j) :], heights[: 81 - i, : 61 - abs(j)]
        products.append(np.mean(first * second))
    distance = np.hypot(i, j) * step
    assert_mean_is(np.array(products), RMS**2 * np.exp(-((distance / LENGTH) ** 2)))


@pytest.mark.parametrize("lag", [1, 4, 16])
def test_an_exponential_sheet_is_correlated_as_one(lag: int) -> None:
    step = CUTOFF / 2

    def transform(s: float) -> float:  # Hankel transform of the spectrum
        def integrand(k: float) -> float:
            smooth = np.exp(-((k * CUTOFF / LENGTH) ** 2) / 4)
            return float(k * smooth * (1 + k**2) ** -1.5 * j0(k * s / LENGTH))

        return quad(integrand, 0, 8 * LENGTH / CUTOFF, limit=500)[0]

    products = []
    for number in range(60):
        heights = sheet(
            number,
            lengths=(100 * step, 120 * step),
            counts=(101, 121),
            spectrum="exponential",
            inner_cutoff=CUTOFF,
        )
        products.append(np.mean(heights[lag:] * heights[:-lag]))
    assert_mean_is(np.array(products), RMS**2 * transform(lag * step) / transform(0.0))


@pytest.mark.parametrize("coarser", [2, 5])
def test_a_finer_sheet_is_the_same_sheet(coarser: int) -> None:
    coarse = sheet(4, counts=(80 // coarser + 1, 60 // coarser + 1))
    np.testing.assert_allclose(coarse, sheet(4)[::coarser, ::coarser], atol=1e-12 * RMS)


def test_a_sheet_can_close_in_one_direction_only() -> None:
    step = 0.006 / 80
    around, along = [], []
    for number in range(60):
        heights = sheet(number, counts=(80, 61), periodic=(True, False))
        around.append(np.mean(heights[0] * heights[-1]))
        along.append(np.mean(heights[:, 0] * heights[:, -1]))
    assert_mean_is(np.array(around), RMS**2 * np.exp(-((step / LENGTH) ** 2)))
    assert_mean_is(np.array(along), 0.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"length": 0.0}, "length must be positive"),
        ({"length": np.inf}, "length must be positive"),
        ({"count": 1}, "at least 2 heights are needed"),
        ({"count": 0, "periodic": True}, "at least 1 heights are needed"),
        ({"rms": -1e-3}, r"rms = -0\.001 m must be zero or more"),
        ({"rms": np.nan}, "rms = nan m must be zero or more"),
        ({"correlation_length": 0.0}, r"correlation_length = 0\.0 m must be positive"),
        ({"spectrum": "exponential"}, r"inner_cutoff = 0\.0 m must be positive"),
    ],
)
def test_an_impossible_surface_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        profile(0, **changes)


def test_an_impossible_sheet_is_refused() -> None:
    with pytest.raises(ValueError, match="length must be positive"):
        sheet(0, lengths=(0.1, -0.1))
    with pytest.raises(ValueError, match="at least 2 heights"):
        sheet(0, counts=(5, 1))
    with pytest.raises(ValueError, match="rms = nan"):
        sheet(0, rms=np.nan)
