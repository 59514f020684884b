r"""Agreement of stated covariances with actual errors.

An error e of n coordinates with a true covariance C has a normalised square (NEES)
:math:`e^T C^{-1} e` that is χ² distributed with n degrees of freedom: its mean is n, and the
region of probability P around an estimate holds the truth in a share P of all trials, within the
binomial scatter of their number.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.stats import beta, chi2

from estimator.results.estimate import UserEstimate


@dataclass(frozen=True, kw_only=True)
class Coverage:
    """Share of trials whose confidence region held the truth, with its own confidence interval."""

    probability: float  # nominal, of the regions [-]
    share: float  # of the trials whose region held the truth [-]
    low: float  # of the confidence interval of the true share [-]
    high: float
    trials: int

    @property
    def consistent(self) -> bool:
        """Whether the nominal probability lies in the interval."""
        return self.low <= self.probability <= self.high


@dataclass(frozen=True, kw_only=True)
class Consistency:
    """Mean of the normalised squares, and the interval for calibrated covariances."""

    mean: float  # [-]
    expected: float  # the number of coordinates [-]
    low: float  # of the interval in which the mean of calibrated trials lies [-]
    high: float
    trials: int

    @property
    def consistent(self) -> bool:
        """Whether the mean lies in the interval for calibrated covariances."""
        return self.low <= self.mean <= self.high


def normalised_square(
    error: Float[np.ndarray, " axes"], covariance: Float[np.ndarray, "axes axes"]
) -> float:
    """Return the normalised square of one error, e' C⁻¹ e (NEES). [-].

    Raises
    ------
    ValueError
        If the covariance is not positive definite.
    """
    try:
        factor = np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        raise ValueError(
            f"covariance with variances {np.diag(covariance).tolist()} is not positive definite; "
            "give the coordinates that were estimated only (in two dimensions x and y)"
        ) from None
    white = np.linalg.solve(factor, error)
    return float((white**2).sum())


def coverage(
    squares: Sequence[float] | Float[np.ndarray, " trials"],
    *,
    probability: float,
    axes: int,
    confidence: float = 0.95,
) -> Coverage:
    """Count how many errors lie within the region of a probability.

    Parameters
    ----------
    squares
        Normalised squares of the errors. [-]
    probability
        Of the regions.
    axes
        Number of coordinates.
    confidence
        Of the binomial interval (Clopper and Pearson's, which is conservative).

    Raises
    ------
    ValueError
        If there are no trials, or a probability is not between 0 and 1.
    """
    values = np.asarray(squares, dtype=np.float64)
    _check(values.size, probability=probability, confidence=confidence)
    held = int(np.sum(values <= chi2.ppf(probability, axes)))
    tail = (1 - confidence) / 2
    trials = values.size
    return Coverage(
        probability=probability,
        share=held / trials,
        low=float(beta.ppf(tail, held, trials - held + 1)) if held else 0.0,
        high=float(beta.ppf(1 - tail, held + 1, trials - held)) if held < trials else 1.0,
        trials=trials,
    )


def consistency(
    squares: Sequence[float] | Float[np.ndarray, " trials"],
    *,
    axes: int,
    confidence: float = 0.95,
) -> Consistency:
    """Compare the mean of normalised squares with the χ² of calibrated ones.

    Parameters
    ----------
    squares, axes, confidence
        See :func:`coverage`; the sum over N trials has N times the degrees of freedom.

    Raises
    ------
    ValueError
        If there are no trials, or the confidence is not between 0 and 1.
    """
    values = np.asarray(squares, dtype=np.float64)
    _check(values.size, probability=0.5, confidence=confidence)
    tail, freedom = (1 - confidence) / 2, values.size * axes
    return Consistency(
        mean=float(values.mean()),
        expected=float(axes),
        low=float(chi2.ppf(tail, freedom)) / values.size,
        high=float(chi2.ppf(1 - tail, freedom)) / values.size,
        trials=values.size,
    )


def _check(trials: int, *, probability: float, confidence: float) -> None:
    if trials == 0:
        raise ValueError("no trials; give at least one normalised square")
    for name, value in (("probability", probability), ("confidence", confidence)):
        if not 0 < value < 1:
            raise ValueError(f"{name} = {value:g}; it must lie between 0 and 1")


def position_errors(
    answer: UserEstimate, truth: Float[np.ndarray, " 3"]
) -> tuple[float | None, float | None]:
    """Return the error of a position in the plane [m], and its square over its covariance [-].

    Both are ``None`` for an estimate without a position or without its covariance.
    """
    if answer.position is None or answer.covariance is None:
        return None, None
    error = (answer.position - truth)[:2]
    square = normalised_square(error, answer.covariance[:2, :2])
    return float(np.linalg.norm(error)), square
