r"""Waves that meet several flat plates in turn: physical optics on each of them, by brute force.

Each plate is cut into cells much smaller than a wavelength, and every cell of one sends to each
cell of the next. With the distances :math:`r`, the cosines :math:`c` of the directions to what
comes before and after a cell, and the plates' reflection :math:`\Gamma_n`,

.. math:: S = \frac{\lambda}{4\pi} \frac{e^{-jkr_0}}{r_0} \prod_n \frac{jk}{4\pi} \Gamma_n
          \left[c^-_n \left(1 + \tfrac{1}{jkr_{n-1}}\right)
              + c^+_n \left(1 + \tfrac{1}{jkr_n}\right)\right] \frac{e^{-jkr_n}}{r_n} \Delta A

summed over the cells of all plates: Kirchhoff's integral, once for each plate. No rays, no images;
the work grows as the product of the cells of two neighbours.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

CELLS_PER_WAVELENGTH = 5.0
"""Cells along a wavelength: smooth integrands are then summed to a percent and better, as
halving the cells shows. [-]"""


class PlateCells(NamedTuple):
    """A parallelogram cut into cells."""

    centres: Float[np.ndarray, "cells 3"]  # [m]
    normal: Float[np.ndarray, " 3"]  # unit vector
    area: float  # of one [m²]
    reflection: complex  # of the field, -1 for a conductor and a field along it [-]


def plate_cells(
    corner: Float[np.ndarray, " 3"],
    sides: Float[np.ndarray, "2 3"],
    *,
    spacing: float,
    reflection: complex = -1.0,
) -> PlateCells:
    """Cut a parallelogram into cells.

    Parameters
    ----------
    corner, sides
        One of its corners and the sides from there. [m]
    spacing
        Largest side of a cell. [m]
    reflection
        Coefficient of the field. [-]
    """
    counts = [max(1, int(np.ceil(np.linalg.norm(side) / spacing))) for side in sides]
    shares = [(np.arange(count) + 0.5) / count for count in counts]
    centres = corner + shares[0][:, None, None] * sides[0] + shares[1][None, :, None] * sides[1]
    across = np.cross(sides[0], sides[1])
    whole = float(np.linalg.norm(across))
    return PlateCells(
        centres.reshape(-1, 3), across / whole, whole / (counts[0] * counts[1]), reflection
    )


def over_plates(
    plates: Sequence[PlateCells],
    sender: Float[np.ndarray, " 3"],
    receiver: Float[np.ndarray, " 3"],
    frequency: float,
) -> complex:
    """Sum what isotropic antennas exchange over plates in the given order, nothing in the way.

    Returns
    -------
    S-parameter. [-]
    """
    wavenumber = 2 * np.pi * frequency / speed_of_light
    # Field at the places of the latest plate; and the same, times the cosine it arrives at.
    field, slanted = _step(
        np.ones(1, dtype=np.complex128), None, sender[None], plates[0].centres, None,
        plates[0].normal, wavenumber,
    )  # fmt: skip
    for plate, after in zip(plates, [*plates[1:], None], strict=True):
        there = receiver[None] if after is None else after.centres
        weight = 1j * wavenumber / (4 * np.pi) * plate.reflection * plate.area
        field, slanted = _step(
            weight * field,
            weight * slanted,
            plate.centres,
            there,
            plate.normal,
            None if after is None else after.normal,
            wavenumber,
        )
    return complex(field[0] / (2 * wavenumber))  # λ/4π


def _step(
    field: Complex[np.ndarray, " here"],
    slanted: Complex[np.ndarray, " here"] | None,
    here: Float[np.ndarray, "here 3"],
    there: Float[np.ndarray, "there 3"],
    normal_here: Float[np.ndarray, " 3"] | None,
    normal_there: Float[np.ndarray, " 3"] | None,
    wavenumber: float,
) -> tuple[Complex[np.ndarray, " there"], Complex[np.ndarray, " there"]]:
    """Send from all places of one plate to all of the next."""
    arrived = np.zeros(len(there), dtype=np.complex128)
    with_cosine = np.zeros(len(there), dtype=np.complex128)
    for some in np.array_split(np.arange(len(there)), 1 + len(here) * len(there) // 2_000_000):
        apart = there[some, None] - here
        length = np.sqrt(np.einsum("ijx,ijx->ij", apart, apart))
        wave = np.exp(-1j * wavenumber * length) / length
        near = 1 + 1 / (1j * wavenumber * length)
        if normal_here is None or slanted is None:
            sent = wave * field
        else:
            outgoing = np.abs(np.einsum("ijx,x->ij", apart, normal_here)) / length
            sent = wave * (slanted + field * outgoing * near)
        arrived[some] = sent.sum(axis=1)
        if normal_there is not None:
            incoming = np.abs(np.einsum("ijx,x->ij", apart, normal_there)) / length
            with_cosine[some] = (sent * incoming * near).sum(axis=1)
    return arrived, with_cosine
