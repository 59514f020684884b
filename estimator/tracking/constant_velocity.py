r"""Constant velocity with white acceleration noise: Kalman filter and smoother.

Over a time :math:`T`, for each coordinate, with the acceleration's spectral density :math:`q`,

.. math:: F = \begin{pmatrix} 1 & T \\ 0 & 1 \end{pmatrix}, \quad
          Q = q \begin{pmatrix} T^3/3 & T^2/2 \\ T^2/2 & T \end{pmatrix}

(eq. 6.2.2-4 of [1]_). The smoother is that of Rauch, Tung and Striebel [2]_.

References
----------
.. [1] Bar-Shalom, Li, Kirubarajan, "Estimation with Applications to Tracking and Navigation",
   Wiley, 2001.
.. [2] Rauch, Tung, Striebel, "Maximum likelihood estimates of linear dynamic systems", AIAA
   Journal 3(8), 1965.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, kw_only=True)
class State:
    """Positions [m], then velocities [m/s], in one, two or three coordinates."""

    mean: Float[np.ndarray, " states"]
    covariance: Float[np.ndarray, "states states"]


@dataclass(frozen=True, kw_only=True)
class Update:
    """A state that knows one measured position more."""

    state: State
    distance: float  # of the position from what was expected, squared, over its covariance [-]
    log_density: float  # of the position, as it was expected


def acceleration_noise(gap: float, acceleration: float) -> Float[np.ndarray, "2 2"]:
    """Return what the acceleration adds to (position, velocity) over a time.

    Parameters
    ----------
    gap
        The time. [s]
    acceleration
        Spectral density. [m²/s³]
    """
    return acceleration * np.array([[gap**3 / 3, gap**2 / 2], [gap**2 / 2, gap]])


def moved(state: State, gap: float, acceleration: float) -> State:
    """Predict a state over a time [s], with a spectral density of the acceleration [m²/s³]."""
    forward = _forward(gap, state)
    noise = np.kron(acceleration_noise(gap, acceleration), np.eye(state.mean.size // 2))
    return State(
        mean=forward @ state.mean, covariance=forward @ state.covariance @ forward.T + noise
    )


def updated(
    state: State, position: Float[np.ndarray, " n"], covariance: Float[np.ndarray, "n n"]
) -> Update:
    """Correct a predicted state by a measured position [m], [m²]."""
    size = position.size
    off = position - state.mean[:size]
    expected = state.covariance[:size, :size] + covariance
    distance = float(off @ np.linalg.solve(expected, off))
    gain = np.linalg.solve(expected, state.covariance[:size]).T
    # Joseph's form: it stays positive under rounding.
    kept = np.eye(2 * size) - gain @ np.eye(size, 2 * size)
    return Update(
        state=State(
            mean=state.mean + gain @ off,
            covariance=kept @ state.covariance @ kept.T + gain @ covariance @ gain.T,
        ),
        distance=distance,
        log_density=-0.5 * (distance + float(np.linalg.slogdet(2 * np.pi * expected)[1])),
    )


def smoothed(
    states: Sequence[State], times: Sequence[float], acceleration: float
) -> tuple[State, ...]:
    """Let each filtered state know the later ones as well.

    Parameters
    ----------
    states
        After the update at each time.
    times
        [s]
    acceleration
        Spectral density. [m²/s³]
    """
    backward = [states[-1]]
    for index in reversed(range(len(states) - 1)):
        here, later, gap = states[index], backward[-1], times[index + 1] - times[index]
        ahead = moved(here, gap, acceleration)
        gain = np.linalg.solve(ahead.covariance, _forward(gap, here) @ here.covariance).T
        backward.append(
            State(
                mean=here.mean + gain @ (later.mean - ahead.mean),
                covariance=here.covariance + gain @ (later.covariance - ahead.covariance) @ gain.T,
            )
        )
    return tuple(reversed(backward))


def _forward(gap: float, state: State) -> np.ndarray:
    return np.kron(np.array([[1.0, gap], [0.0, 1.0]]), np.eye(state.mean.size // 2))
