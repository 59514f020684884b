"""Confidence intervals by the bootstrap: samples are drawn again, each with all that is in it."""

import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.stats import DegenerateDataWarning, bootstrap

RESAMPLES = 2000
"""Sets of samples that are drawn: the ends of a 95 % interval rest on 50 of them each. [-]"""

CONFIDENCE = 0.95
"""Probability of the intervals. [-]"""


@dataclass(frozen=True, kw_only=True)
class Metric:
    """A figure over many samples, with its interval."""

    value: float | None  # None: nothing to measure, or without bound
    low: float | None
    high: float | None
    unit: str

    def document(self) -> dict[str, Any]:
        """Return it for JSON."""
        return asdict(self)


def metric(
    statistic: Callable[..., float], *values: Float[np.ndarray, " samples"], unit: str
) -> Metric:
    """Return a statistic of samples with its percentile interval.

    Parameters
    ----------
    statistic
        Of one or more arrays with a value for each sample. It may be infinite.
    values
        The arrays; a drawn set takes the same samples of each.
    unit
        Of the statistic.
    """
    told = statistic(*values)
    if len(values[0]) < 2:
        return Metric(value=_finite(told), low=None, high=None, unit=unit)
    with np.errstate(invalid="ignore"), warnings.catch_warnings():
        # Of the library's own interval, which is not used: infinite or equal values.
        warnings.simplefilter("ignore", DegenerateDataWarning)
        drawn = bootstrap(
            values,
            statistic,
            n_resamples=RESAMPLES,
            paired=True,
            vectorized=False,
            method="percentile",
            rng=np.random.default_rng(0),
        ).bootstrap_distribution
    drawn = np.sort(drawn[~np.isnan(drawn)])
    if drawn.size == 0:
        return Metric(value=_finite(told), low=None, high=None, unit=unit)
    tail = (1 - CONFIDENCE) / 2
    low, high = np.quantile(drawn, [tail, 1 - tail], method="inverted_cdf")
    return Metric(value=_finite(told), low=_finite(low), high=_finite(high), unit=unit)


def quantile(share: float) -> Callable[[Float[np.ndarray, " n"]], float]:
    """Return a function that gives the smallest value not exceeded by a share of all."""

    def of(values: Float[np.ndarray, " n"]) -> float:
        known = np.sort(values)  # infinite ones last
        return float(known[max(int(np.ceil(share * len(known) - 1e-9)), 1) - 1])

    return of


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
