r"""Autofocus: positions that err along the line of sight.

A position that errs by δ towards the scene turns all its echoes by :math:`4 \pi f \delta / c`. The
turns that make the image sharpest, :math:`\sum_p |I_p|^4` of its brightest pixels, are found by
the ascent

.. math:: \phi_m = -\arg \sum_p |I_p|^2 I_p^* b_{mp} ,

which never lowers it, with what position m alone gives at each pixel, :math:`b_{mp}`: the sharpness
is convex in the turned contributions, and this maximises its tangent [1]_. A turn is taken as a
shift of the position, so that it is right over a wide band, and shifts by half a wavelength are
tried. A shift or a tilt of all positions moves the image and blurs nothing: these are left as they
are.

References
----------
.. [1] T. J. Kragh, "Monotonic iterative algorithm for minimum-entropy autofocus", Adaptive Sensor
   Array Processing Workshop, 2006; with the sharpness in place of the entropy.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.measurement.model import Echo, MeasurementError, frequency_step

BRIGHTEST = 300
"""Pixels whose sharpness counts. [-]"""
ROUNDS = 8
"""Times that the pixels are focused anew with the shifted positions. [-]"""
STEPS = 15
"""Ascents of each round. [-]"""
CONVERGED = 1e-3
"""Change of all turns, root mean square, that ends a round. [rad]"""
MOST_TERMS = 2e9
"""Positions times pixels times frequencies of one focusing, some ten seconds. [-]"""


@dataclass(frozen=True, kw_only=True)
class Autofocus:
    """Corrected positions, and what the correction did."""

    echo: Echo  # with the corrected positions
    shift: Float[np.ndarray, " positions"]  # along the boresight [m]
    sharpness: float  # Σ|I|⁴ over (Σ|I|²)² of the brightest pixels, over that before [-]


def focus_ranges(
    echo: Echo, points: Float[np.ndarray, "points 3"], boresight: Float[np.ndarray, " 3"]
) -> Autofocus:
    """Find by how much each position errs along the line of sight.

    Parameters
    ----------
    echo
        Of any array, monostatic or not; neighbouring positions need not be alike.
    points
        Pixels around what is bright. [m]
    boresight
        The unit vector along which positions are moved.

    Raises
    ------
    MeasurementError
        If the frequencies are not uniform, or there is more to sum than is affordable.
    """
    count = min(BRIGHTEST, len(points))
    terms = float(len(echo.positions)) * len(points) * echo.frequencies.size
    if terms > MOST_TERMS:
        raise MeasurementError(
            f"autofocus: {terms:.2g} terms to sum, more than {MOST_TERMS:.2g}; give a smaller "
            "region, or fewer positions"
        )
    shift = np.zeros(len(echo.positions))
    moved, first = echo, None
    half = speed_of_light / (2 * float(echo.frequencies.mean()))
    for number in range(ROUNDS):
        image = contributions(moved, points).sum(axis=0)
        bright = points[np.argsort(-np.abs(image), kind="stable")[:count]]
        parts = contributions(moved, bright)
        if first is None:
            first = sharpness(parts.sum(axis=0))
        turn = _sharpest(parts)
        facing = _facing(moved, bright, boresight)
        step = _aside(echo, -turn * half / (2 * np.pi * facing))
        if number:
            step = step + half * _periods(moved, bright, step, boresight, half)
        shift = _aside(echo, shift + step)
        moved = _moved(echo, shift, boresight)
        if np.sqrt(np.mean(step**2)) * 2 * np.pi / half < CONVERGED:
            break
    assert first is not None
    image = contributions(moved, points).sum(axis=0)
    bright = np.sort(np.abs(image))[-count:]
    return Autofocus(echo=moved, shift=shift, sharpness=sharpness(bright) / first)


def sharpness(image: Complex[np.ndarray, " points"] | Float[np.ndarray, " points"]) -> float:
    """Return Σ|I|⁴ over (Σ|I|²)². [-]."""
    power = np.abs(image) ** 2
    return float((power**2).sum() / power.sum() ** 2)


def contributions(
    echo: Echo, points: Float[np.ndarray, "points 3"]
) -> Complex[np.ndarray, "positions points"]:
    """Focus each position alone: what it adds at each point."""
    there = np.linalg.norm(points - echo.positions[:, None], axis=-1)
    ends = echo.positions if echo.transmit_positions is None else echo.transmit_positions
    path = there + (
        there
        if echo.transmit_positions is None
        else np.linalg.norm(points - ends[:, None], axis=-1)
    )
    wave = 2j * np.pi / speed_of_light
    field = np.exp(wave * float(echo.frequencies[0]) * path)
    turn = np.exp(wave * frequency_step(echo.frequencies) * path)
    total = np.zeros(path.shape, dtype=np.complex128)
    for column in echo.samples.T:
        total += column[:, None] * field
        field *= turn
    return total


def _sharpest(parts: Complex[np.ndarray, "positions points"]) -> Float[np.ndarray, " positions"]:
    """Return the turns of all positions that make their sum sharpest. [rad]."""
    turn = np.zeros(len(parts))
    for _ in range(STEPS):
        image = np.exp(1j * turn) @ parts
        better = -np.angle(parts @ (np.abs(image) ** 2 * image.conj()))
        change = np.angle(np.exp(1j * (better - turn)))
        turn = better
        if np.sqrt(np.mean((change - np.mean(change)) ** 2)) < CONVERGED:
            break
    mean = np.angle(np.exp(1j * turn).sum())
    return np.asarray(np.angle(np.exp(1j * (turn - mean))))


def _facing(
    echo: Echo, points: Float[np.ndarray, "points 3"], boresight: Float[np.ndarray, " 3"]
) -> float:
    """Return by how much a path shortens, one way, as a position moves along the boresight."""
    away = points.mean(axis=0) - echo.positions.mean(axis=0)
    return max(float(away @ boresight / np.linalg.norm(away)), 0.1)


def _aside(echo: Echo, shift: Float[np.ndarray, " positions"]) -> Float[np.ndarray, " positions"]:
    """Take a shift and a tilt of the whole array out."""
    places = echo.positions - echo.positions.mean(axis=0)
    columns = np.concatenate([np.ones((len(places), 1)), places], axis=1)
    fitted = columns @ np.linalg.lstsq(columns, shift)[0]
    return np.asarray(shift - fitted)


def _periods(
    echo: Echo,
    points: Float[np.ndarray, "points 3"],
    step: Float[np.ndarray, " positions"],
    boresight: Float[np.ndarray, " 3"],
    half: float,
) -> Float[np.ndarray, " positions"]:
    """Return how many half wavelengths more fit each position over the band better. [-]."""
    image = contributions(_moved(echo, step, boresight), points).sum(axis=0)
    weights = np.abs(image) ** 2 * image.conj()
    tried = np.array([-1.0, 0.0, 1.0])
    fits = [
        np.abs(contributions(_moved(echo, step + one * half, boresight), points) @ weights)
        for one in tried
    ]
    return np.asarray(tried[np.argmax(fits, axis=0)])


def _moved(
    echo: Echo, shift: Float[np.ndarray, " positions"], boresight: Float[np.ndarray, " 3"]
) -> Echo:
    by = shift[:, None] * boresight
    apart = echo.transmit_positions
    return replace(
        echo,
        positions=echo.positions + by,
        transmit_positions=None if apart is None else apart + by,
    )
