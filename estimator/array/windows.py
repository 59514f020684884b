"""Windows over frequency and aperture: sidelobes against resolution.

Each is a function of a coordinate that runs from -1/2 to 1/2, so that it serves uneven
samples and holes as well.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Float
from scipy.special import i0

from estimator.measurement.model import Echo, MeasurementError, Uplink

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(128)  # ample for 20 cycles

_NEWTON_STEPS = 6  # four converge to the last digit

_SPANNED = 1e-9  # extent above which an array spans an axis [m]

NAMES = ("rectangular", "hann", "taylor", "kaiser")


@dataclass(frozen=True, kw_only=True)
class Window:
    """A choice of window, with its design value where it has one."""

    name: str = "rectangular"  # one of NAMES
    sidelobe_db: float = -35.0  # Taylor: level of the near sidelobes [dB]
    nearly_equal: int = 5  # Taylor: how many sidelobes on each side are at that level, plus one
    beta: float = 6.0  # Kaiser: 0 is rectangular, 6 has sidelobes near -44 dB

    def __post_init__(self) -> None:
        """Refuse values that make no window."""
        if self.name not in NAMES:
            raise MeasurementError(f"window {self.name!r}; choose one of {', '.join(NAMES)}")
        if not -100 <= self.sidelobe_db <= -14:
            raise MeasurementError(
                f"Taylor window: sidelobes of {self.sidelobe_db:g} dB; choose -100 to -14 dB"
            )
        # Fewer equal sidelobes than about this and the window turns up at its edges.
        least = 2 * (np.arccosh(10 ** (-self.sidelobe_db / 20)) / np.pi) ** 2
        if self.name == "taylor" and self.nearly_equal < least:
            raise MeasurementError(
                f"Taylor window: {self.nearly_equal} nearly equal sidelobes are too few for "
                f"{self.sidelobe_db:g} dB; take at least {int(np.ceil(least))}"
            )
        if not (np.isfinite(self.beta) and self.beta >= 0):
            raise MeasurementError(f"Kaiser window: beta is {self.beta:g}; it must be 0 or more")

    def __call__(self, coordinate: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Evaluate the window at coordinates from -1/2 to 1/2; the middle has weight 1."""
        if self.name == "hann":
            values = np.cos(np.pi * coordinate) ** 2
        elif self.name == "taylor":
            values = _taylor(coordinate, self.sidelobe_db, self.nearly_equal)
        elif self.name == "kaiser":
            inside = np.maximum(1 - (2 * coordinate) ** 2, 0.0)
            values = i0(self.beta * np.sqrt(inside)) / i0(self.beta)
        else:
            values = np.ones_like(coordinate)
        return np.asarray(values)

    @property
    def half_power_width(self) -> float:
        """Width of the window's spectrum between its -3 dB points: 0.886 if rectangular."""
        return _half_power_width(self)

    @property
    def peak_sidelobe_db(self) -> float:
        """Highest sidelobe of the window's spectrum over its peak [dB]."""
        places = np.arange(0.0, 20.0, 0.01)
        levels = np.abs(self._spectrum(places))
        levels /= levels[0]
        first_rise = int(np.argmax(np.diff(levels) > 0))
        return float(20 * np.log10(levels[first_rise:].max()))

    def _spectrum(self, places: Float[np.ndarray, " places"]) -> Float[np.ndarray, " places"]:
        """Transform the even window at ``places`` cycles over its length."""
        x = (_NODES + 1) / 4  # over half the window, because it is even
        return np.asarray(np.cos(2 * np.pi * np.outer(places, x)) @ (_WEIGHTS * self(x)))


RECTANGULAR = Window()


@cache
def _half_power_width(window: Window) -> float:
    """Solve for the width by Newton's method.

    It begins on the parabola of the main lobe's top, which is narrower than the lobe and ends where
    that is still steep: from 4 % off, it converges in four steps.
    """
    x = (_NODES + 1) / 4  # over half the window, because it is even
    weights = _WEIGHTS * window(x)
    weights /= weights.sum()
    level = np.sqrt(0.5)
    place = np.sqrt(2 * (1 - level) / (weights @ (2 * np.pi * x) ** 2))
    for _ in range(_NEWTON_STEPS):
        turn = 2 * np.pi * x * place
        place += (weights @ np.cos(turn) - level) / (weights @ (2 * np.pi * x * np.sin(turn)))
    return float(2 * place)


def frequency_taper(
    frequencies: Float[np.ndarray, " freqs"], window: Window
) -> Float[np.ndarray, " freqs"]:
    """Evaluate a window over a sweep, whose ends are half a mean step outside its points."""
    return window(_coordinate(frequencies))


def aperture_taper(
    positions: Float[np.ndarray, "positions 3"], window: Window
) -> Float[np.ndarray, " positions"]:
    """Evaluate a window over an array: a product over each axis that the array spans.

    The axes are the array's principal ones, so a grid of equal sides that is not parallel
    to the world's axes should be given in its own frame.
    """
    centred = positions - positions.mean(axis=0)
    taper = np.ones(len(positions))
    for column in (centred @ _own_axes(centred).T).T:
        if np.ptp(column) > _SPANNED:
            taper = taper * window(_coordinate(column))
    return taper


def _own_axes(centred: Float[np.ndarray, "positions 3"]) -> Float[np.ndarray, "axes 3"]:
    """Choose the world's axes for a planar array that lies along two of them.

    The principal axes of a square array are any two; those of a line are the line.
    """
    principal = np.asarray(np.linalg.svd(centred, full_matrices=False)[2])
    spanned = np.count_nonzero(np.ptp(centred @ principal.T, axis=0) > _SPANNED)
    along_world = np.count_nonzero(np.ptp(centred, axis=0) > _SPANNED)
    return np.eye(3) if spanned == along_world else principal


def _coordinate(samples: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Map samples to -1/2 … 1/2, each standing for a stretch as long as the mean step."""
    low, high = float(samples.min()), float(samples.max())
    if samples.size < 2 or high <= low:
        return np.zeros_like(samples)
    different = np.unique(np.round((samples - low) / (high - low), 9)).size
    length = (high - low) * different / (different - 1)
    return np.asarray((samples - (low + high) / 2) / length)


def _taylor(
    coordinate: Float[np.ndarray, "*n"], sidelobe_db: float, nearly_equal: int
) -> Float[np.ndarray, "*n"]:
    """Taylor's window as its cosine series, normalised to 1 in the middle."""
    a2 = (np.arccosh(10 ** (-sidelobe_db / 20)) / np.pi) ** 2
    orders = np.arange(1, nearly_equal)
    stretch = nearly_equal**2 / (a2 + (nearly_equal - 0.5) ** 2)
    values, middle = np.ones_like(coordinate), 1.0
    for m in orders:
        zeros = np.prod(1 - m**2 / (stretch * (a2 + (orders - 0.5) ** 2)))
        others = np.prod([1 - m**2 / k**2 for k in orders if k != m])
        factor = float((-1) ** (m + 1) * zeros / (2 * others))
        values = values + 2 * factor * np.cos(2 * np.pi * m * coordinate)
        middle += 2 * factor
    return np.asarray(values / middle)


SURVEY_TAPER = Window(name="taylor", sidelobe_db=-50.0, nearly_equal=9)
"""Over the aperture and the band where everything is looked at: its sidelobes are below
:data:`estimator.imaging.peak_detection.DYNAMIC_RANGE`."""


def survey_weights(measured: Echo | Uplink) -> Float[np.ndarray, "positions freqs"]:
    """Return :data:`SURVEY_TAPER` over aperture and band. [-]."""
    taper = aperture_taper(measured.positions, SURVEY_TAPER)
    return np.outer(taper, frequency_taper(measured.frequencies, SURVEY_TAPER))
