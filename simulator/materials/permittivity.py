r"""Complex relative permittivity over frequency: constant, after ITU-R P.2040-4, or tabulated.

The permittivity is :math:`\varepsilon = \varepsilon' - j \varepsilon''` with the time convention
exp(+jωt), so losses have :math:`\varepsilon'' > 0`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import epsilon_0

from scenes.schema.errors import ScenarioError
from scenes.schema.permittivity_table import (
    band_problem,
    read_permittivity_table,
    table_problem,
    value_problem,
)

WIDEST_GAP = 1.1
"""Ratio of frequencies without a row between two that are joined: most tables go from 100 to 110
GHz, in the middle of what is sold as W band. [-]"""

ROUNDING = 1e-9
"""Relative error of frequencies that are compared. [-]"""


class MaterialError(ValueError):
    """A material cannot be used; the message names it, the value, the limit and the remedy."""


@dataclass(frozen=True, kw_only=True)
class ConstantPermittivity:
    """The same permittivity at all frequencies."""

    value: complex  # ε' - jε'' [-]

    def __post_init__(self) -> None:
        """Refuse a permittivity below that of vacuum, or one with gain."""
        _check_permittivity("the constant permittivity", np.array([self.value], dtype=complex))

    def __call__(self, frequencies: Float[np.ndarray, " freqs"]) -> Complex[np.ndarray, " freqs"]:
        """Return the constant, once for each frequency."""
        return np.full(frequencies.shape, self.value, dtype=np.complex128)


@dataclass(frozen=True, kw_only=True)
class PowerLawPermittivity:
    r"""The model of ITU-R P.2040-4, section 2.1.4, with b = 0: constant ε', conductivity c·f^d.

    The frequency f is in GHz, and :math:`\varepsilon'' = \sigma / (2 \pi f \varepsilon_0)`.
    """

    name: str
    real: float  # ε' [-]
    factor: float  # c [S/m]
    exponent: float  # d [-]
    lowest: float  # [Hz]
    highest: float  # [Hz]

    @classmethod
    def of_conductivity(cls, real: float, conductivity: float) -> "PowerLawPermittivity":
        """Make the permittivity of a constant conductivity [S/m], at any frequency."""
        return cls(
            name="a conductivity",
            real=real,
            factor=conductivity,
            exponent=0.0,
            lowest=0.0,
            highest=np.inf,
        )

    def __call__(self, frequencies: Float[np.ndarray, " freqs"]) -> Complex[np.ndarray, " freqs"]:
        """Evaluate the power law, within the band it was fitted to."""
        _check_band(
            f"the ITU-R P.2040-4 row of {self.name!r}", frequencies, self.lowest, self.highest
        )
        return self.law(frequencies)

    def law(self, frequencies: Float[np.ndarray, " freqs"]) -> Complex[np.ndarray, " freqs"]:
        """Evaluate the power law at any frequency."""
        conductivity = self.factor * (frequencies / 1e9) ** self.exponent
        return self.real - 1j * conductivity / (2.0 * np.pi * frequencies * epsilon_0)


@dataclass(frozen=True, kw_only=True)
class JoinedPermittivity:
    """Two rows of ITU-R P.2040-4 that meet, or nearly, within a band.

    Around where they meet both laws are averaged with weights that are linear in the logarithm of
    the frequency: a step there would ring in the range profiles of a sweep across it.
    """

    lower: PowerLawPermittivity
    upper: PowerLawPermittivity

    def __call__(self, frequencies: Float[np.ndarray, " freqs"]) -> Complex[np.ndarray, " freqs"]:
        """Evaluate both laws, within the band that the two were fitted to together."""
        _check_band(
            f"the ITU-R P.2040-4 rows of {self.lower.name!r}",
            frequencies,
            self.lower.lowest,
            self.upper.highest,
        )
        meet = np.sort([self.lower.highest, self.upper.lowest]) * [1 / WIDEST_GAP, WIDEST_GAP]
        share = np.clip(np.log(frequencies / meet[0]) / np.log(meet[1] / meet[0]), 0.0, 1.0)
        joined: np.ndarray = (1 - share) * self.lower.law(frequencies) + share * self.upper.law(
            frequencies
        )
        return joined


@dataclass(frozen=True, kw_only=True)
class TabulatedPermittivity:
    """Measured permittivity, linear in frequency between the entries of a table."""

    name: str
    frequencies: Float[np.ndarray, " entries"]  # increasing [Hz]
    values: Complex[np.ndarray, " entries"]  # ε' - jε'' [-]

    def __post_init__(self) -> None:
        """Refuse a table whose frequencies do not rise or whose material is not passive."""
        if problem := table_problem(self.frequencies, self.values):
            raise MaterialError(f"{self.name}: {problem}")

    def __call__(self, frequencies: Float[np.ndarray, " freqs"]) -> Complex[np.ndarray, " freqs"]:
        """Interpolate the table, within the band it covers."""
        _check_band(self.name, frequencies, float(self.frequencies[0]), float(self.frequencies[-1]))
        values: np.ndarray = np.interp(frequencies, self.frequencies, self.values)
        return values


@dataclass(frozen=True, kw_only=True)
class PermittivityInMedium:
    """A permittivity relative to that of the medium around, over the frequencies times its index.

    Beyond the band it is that of the band's end.
    """

    permittivity: "Permittivity"
    refractive_index: float  # of the medium [-]
    band: tuple[float, float]  # of the radio's own frequencies [Hz]

    def __call__(self, frequencies: Float[np.ndarray, " freqs"]) -> Complex[np.ndarray, " freqs"]:
        """Evaluate it at the frequencies over the index."""
        own = np.clip(frequencies / self.refractive_index, *self.band)
        relative: np.ndarray = self.permittivity(own) / self.refractive_index**2
        return relative


Permittivity = (
    ConstantPermittivity
    | PowerLawPermittivity
    | JoinedPermittivity
    | TabulatedPermittivity
    | PermittivityInMedium
)
"""Complex relative permittivity as a function of frequency."""


ITU_ROWS: Mapping[str, tuple[tuple[float, float, float, float, float], ...]] = {
    "concrete": ((1, 100, 5.24, 0.0462, 0.7822), (110, 330, 5.17, 0.0145, 1.0900)),
    "brick": ((1, 40, 3.91, 0.0238, 0.16), (110, 330, 4.15, 0.0006, 1.5712)),
    "plasterboard": (
        (1, 100, 2.73, 0.0085, 0.9395),
        (110, 330, 2.56, 0.0001, 1.7799),
        (100, 400, 2.65, 0.0002, 1.598),
    ),
    "wood": (
        (0.001, 100, 1.99, 0.0047, 1.0718),
        (110, 330, 1.82, 0.0040, 1.0761),
        (100, 400, 2.1183, 0.0055, 1.1113),
    ),
    "glass": (
        (0.1, 100, 6.31, 0.0036, 1.3394),
        (220, 450, 5.79, 0.0004, 1.658),
        (100, 400, 6.5767, 0.0012, 1.4697),
    ),
    "ceiling_board": (
        (1, 100, 1.48, 0.0011, 1.0750),
        (220, 450, 1.52, 0.0029, 1.029),
        (100, 400, 1.2567, 0.00013, 1.454),
    ),
    "chipboard": ((1, 100, 2.58, 0.0217, 0.7800), (100, 200, 2.16, 0.0023, 1.359)),
    "plywood": ((1, 40, 2.71, 0.33, 0.0), (110, 330, 1.94, 0.0067, 0.9982)),
    "marble": ((1, 60, 7.074, 0.0055, 0.9262), (110, 330, 7.94, 0.0001, 1.7330)),
    "floorboard": ((50, 100, 3.66, 0.0044, 1.3515), (100, 400, 3.1575, 0.001675, 1.32775)),
}
"""Rows of Table 3 of ITU-R P.2040-4: lowest and highest frequency [GHz], ε', c, d. If two cover a
band, the first is used."""


def itu_permittivity(
    name: str, frequencies: Float[np.ndarray, " freqs"], *, beyond: bool = False
) -> PowerLawPermittivity | JoinedPermittivity:
    """Pick the row of ITU-R P.2040-4 that covers the whole band, or join two that meet in it.

    Parameters
    ----------
    name
        Of the material.
    frequencies
        The band. [Hz]
    beyond
        Whether a band that no row covers is taken from the nearest rows: between two rows both laws
        are averaged as where two meet, below the lowest and above the highest the law goes on.

    Raises
    ------
    MaterialError
        If there is no such material, or no row for the band and none may be taken.
    """
    if name not in ITU_ROWS:
        raise MaterialError(f"unknown ITU material {name!r}; known: {', '.join(ITU_ROWS)}")
    low, high = frequencies.min() / 1e9, frequencies.max() / 1e9
    laws = [
        PowerLawPermittivity(
            name=name,
            real=real,
            factor=factor,
            exponent=exponent,
            lowest=lowest * 1e9,
            highest=highest * 1e9,
        )
        for lowest, highest, real, factor, exponent in ITU_ROWS[name]
    ]

    def begins(law: PowerLawPermittivity) -> bool:
        return bool(law.lowest / 1e9 <= low)

    def ends(law: PowerLawPermittivity) -> bool:
        return bool(high <= law.highest / 1e9)

    for law in laws:
        if begins(law) and ends(law):
            return law
    for lower in filter(begins, laws):
        for upper in filter(ends, laws):
            if upper.lowest <= WIDEST_GAP * (1 + ROUNDING) * lower.highest:
                return JoinedPermittivity(lower=lower, upper=upper)
    if beyond:
        return _nearest(laws, low * 1e9, high * 1e9)
    rows = ", ".join(f"{row[0]:g}-{row[1]:g}" for row in ITU_ROWS[name])
    raise MaterialError(
        f"material {name!r}: no row of ITU-R P.2040-4 covers {low:g}-{high:g} GHz (rows: {rows} "
        "GHz); give the permittivity itself, a table, or beyond_itu = true with its name and "
        "thickness (for a foreign scene: in [geometry]), which takes the nearest rows"
    )


def _nearest(
    laws: list[PowerLawPermittivity], low: float, high: float
) -> PowerLawPermittivity | JoinedPermittivity:
    """Extend the laws nearest to a band over it; frequencies in Hz."""
    below = [law for law in laws if law.lowest <= low]
    above = [law for law in laws if high <= law.highest]
    lower = max(below, key=lambda law: law.highest, default=None)
    upper = min(above, key=lambda law: law.lowest, default=None)
    if lower is not None and upper is not None:
        return JoinedPermittivity(lower=lower, upper=upper)
    nearest = lower or upper or laws[0]
    return replace(nearest, lowest=min(nearest.lowest, low), highest=max(nearest.highest, high))


def read_permittivity(path: Path) -> TabulatedPermittivity:
    """Read a table with the columns ``frequency_ghz,eps_real,eps_imag`` (ε'' positive: loss).

    Raises
    ------
    MaterialError
        If the file, a column or a number cannot be read.
    """
    try:
        table = read_permittivity_table(path)
    except ScenarioError as error:
        raise MaterialError(str(error)) from error
    return TabulatedPermittivity(name=str(path), frequencies=table.frequencies, values=table.values)


def conductivity(
    permittivity: Complex[np.ndarray, " freqs"], frequencies: Float[np.ndarray, " freqs"]
) -> Float[np.ndarray, " freqs"]:
    r"""Return the conductivity in S/m, :math:`2 \pi f \varepsilon_0 \varepsilon''`.

    Radio materials of Sionna RT are described by it and the real part of the permittivity.
    """
    sigma: np.ndarray = -2.0 * np.pi * frequencies * epsilon_0 * permittivity.imag
    return sigma


def _check_permittivity(name: str, values: Complex[np.ndarray, " entries"]) -> None:
    if problem := value_problem(values):
        raise MaterialError(f"{name}: {problem}")


def _check_band(
    name: str, frequencies: Float[np.ndarray, " freqs"], lowest: float, highest: float
) -> None:
    if problem := band_problem(frequencies, lowest, highest):
        raise MaterialError(f"{name} {problem}")
