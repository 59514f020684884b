"""Reflection coefficients of many facets at many frequencies, interpolated over the angle."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Complex64, Float, Float32, Int

from scenes.schema.radio import Polarization
from simulator.materials.fresnel_slab import Conductor, Material, reflection

TABLE_ACCURACY = 1e-5
"""Largest error of a coefficient half way between two angles of the table. [-]"""

MOST_ANGLES = 2**15
"""Most angles of a table. Within a degree of grazing, the fastest ripples of a slab of low loss
are then not resolved. [-]"""


@dataclass(frozen=True, kw_only=True)
class Angles:
    """Positions of cosines in a table: index of the angle below, and weight of the one above."""

    below: Int[np.ndarray, "*n"]
    share: Float32[np.ndarray, "*n"]  # weight of the angle above


@dataclass(frozen=True, kw_only=True)
class ReflectionTable:
    """Coefficients of the field along z, at cosines of incidence evenly spaced from 0 to 1."""

    samples: Complex64[np.ndarray, "freqs angles"]

    def places(self, cosines: Float[np.ndarray, "*n"]) -> Angles:
        """Look up where cosines lie in the table."""
        steps = cosines * (self.samples.shape[1] - 1)
        below = np.minimum(steps.astype(np.int32), max(self.samples.shape[1] - 2, 0))
        return Angles(below=below, share=(steps - below).astype(np.float32))

    def at(self, angles: Angles, frequency: int | slice) -> Complex64[np.ndarray, "..."]:
        """Interpolate at one frequency (shape [*n]) or several ([freqs, *n]); n may be 1."""
        row = self.samples[frequency]
        if row.shape[-1] == 1:
            return row.reshape(*row.shape[:-1], *(1 for _ in angles.below.shape))
        low = row[..., angles.below]
        return np.asarray(low + (row[..., angles.below + 1] - low) * angles.share)


def reflection_table(
    material: Material,
    frequencies: Float[np.ndarray, " freqs"],
    *,
    polarization: Polarization = "vertical",
) -> ReflectionTable:
    """Tabulate a material's coefficient.

    Parameters
    ----------
    material
        Of the surface.
    frequencies
        Any grid. [Hz]
    polarization
        Vertical: the electric field is along z; horizontal: the magnetic field is.

    Returns
    -------
    The table of fewest angles whose error is below :data:`TABLE_ACCURACY`; a single one for a
    conductor.
    """
    vertical = polarization == "vertical"

    def exact_at(some: Float[np.ndarray, " n"], cosines: Float[np.ndarray, " m"]) -> np.ndarray:
        both = reflection(material, some, cosines)
        return both.te if vertical else both.tm

    if isinstance(material, Conductor):
        return ReflectionTable(
            samples=np.full((frequencies.size, 1), -1.0 if vertical else 1.0, np.complex64)
        )
    return tabulated(exact_at, frequencies)


def tabulated(
    exact_at: Callable[
        [Float[np.ndarray, " n"], Float[np.ndarray, " m"]], Complex[np.ndarray, "m n"]
    ],
    frequencies: Float[np.ndarray, " freqs"],
) -> ReflectionTable:
    """Tabulate a coefficient at the fewest angles whose error is below :data:`TABLE_ACCURACY`.

    Parameters
    ----------
    exact_at
        The coefficient as a function of frequency and cosine of incidence.
    frequencies
        Any grid. [Hz]
    """
    some = frequencies[:: max(1, frequencies.size // 8)]
    count = 64
    while count < MOST_ANGLES:
        exact = exact_at(some, np.linspace(0.0, 1.0, 2 * count + 1))
        tried = (exact[:-1:2] + exact[2::2]) / 2
        if float(np.abs(tried - exact[1::2]).max()) <= TABLE_ACCURACY:
            break
        count *= 2
    cosines = np.linspace(0.0, 1.0, count + 1)
    return ReflectionTable(samples=exact_at(frequencies, cosines).T.astype(np.complex64))
