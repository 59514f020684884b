r"""The depth of a flat thing that faces a planar aperture, by least squares over its reflectivity.

A flat surface that faces the array reflects as a plate: its wave is flatter than a point's from the
same depth, and its image is brightest beyond it, by as much as the delays leave open. So its depth
is not where the image peaks, but where a surface of that width explains the samples. With a
free reflectivity :math:`\rho` on the plane at depth y, inside of the width that is seen,

.. math:: \min_\rho \sum_{p, f} \left| S_{pf} - \sum_q \rho_q
          \frac{e^{-2 \pi j f \ell_{pq}(y) / c}}{r_{pq}^2} \right|^2

is least at the true depth: on any other plane the surface's wave is wider than that.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.imaging.energy_region import cells_at, evenly_chosen, middles, some_positions
from estimator.measurement.model import Echo

FEWEST_POSITIONS = 400
"""Positions that are used at least, if there are as many: all over the array. [-]"""
EQUATIONS = 3
"""Samples for each unknown of the reflectivity, so that noise is not fitted. [-]"""
FEW_UNKNOWNS = 200
"""Pixels up to which the fit takes a second, and is always made. [-]"""
MOST_UNKNOWNS = 1500
"""Pixels of the surface up to which its depth is fitted, for time: some ten seconds. [-]"""
OPEN = 6.0
"""Range cells over the depth that the aperture resolves, from which delays leave the depth open.
[-]"""
PIXEL = 0.8
"""Spacing of the pixels. [cells]"""
MARGIN = 0.5
"""Cells around the width that is seen, which ends 10 dB below the peak. [cells]"""
NEAREST = 0.35
"""Least depth tried over that where the image peaks. Of a letter as wide as half the array, close
to it, with one range cell, the image peaks 2.4 times as far. [-]"""
CELLS_AWAY = 2.0
"""Range cells around the peak within which the depth is tried. [cells c/2B]"""
DEPTHS = 10
"""Depths of the first round; each further one tries six between the neighbours of the best. [-]"""
ROUNDS = 2
"""Rounds after the first: the last is 1/16 of the first's step. [-]"""
ITERATIONS = 15
"""Of conjugate gradients: they explained 99 % of one letter at an SNR of 20 dB. [-]"""
EXPLAINED = 0.85
"""Share of the energy that the surface must explain: nothing else is there. [-]"""
BETTER = 0.5
"""Energy left at the depth found, over that left where the image peaks, from which it is taken.
[-]"""
SHARED = 1e-6
"""Share of energy in the positions' mean below which the mean was taken out: then out of the
surface's wave as well. [-]"""


@dataclass(frozen=True, kw_only=True)
class FacingSurface:
    """A flat thing that faces the array."""

    depth: float  # [m]
    explained: float  # share of the samples' energy [-]


def facing_surface(
    echo: Echo, peak: Float[np.ndarray, " 3"], low: Float[np.ndarray, " 3"], high: np.ndarray
) -> FacingSurface | None:
    """Fit the depth of a thing as a flat surface that faces a planar array.

    Parameters
    ----------
    echo
        In the array's frame: it looks along y.
    peak
        Where the image is brightest. [m]
    low, high
        Ends of what is seen of it, of which x and z count. [m]

    Returns
    -------
    ``None`` if the array is no plane, or the surface explains little, or no better elsewhere than
    at the peak.

    Examples
    --------
    >>> import numpy as np
    >>> from estimator.measurement.model import Echo
    >>> u = 0.02 * np.arange(-8.0, 9.0)
    >>> x, z = (axis.ravel() for axis in np.meshgrid(u, u))
    >>> places = np.stack([x, 0 * x, z], axis=-1)
    >>> band = np.linspace(9e9, 9.5e9, 11)
    >>> plate = np.stack(np.meshgrid(0.01 * np.arange(-5, 6), 0.3, 0.01 * np.arange(-5, 6)), -1)
    >>> r = np.linalg.norm(places[:, None] - plate.reshape(-1, 3), axis=-1)
    >>> waves = [np.sum(np.exp(-4j * np.pi * f / 299792458 * r) / r**2, axis=1) for f in band]
    >>> echo = Echo(samples=np.stack(waves, 1), positions=places, frequencies=band)
    >>> ends = np.array([0.05, 0.0, 0.05])
    >>> found = facing_surface(echo, np.array([0.0, 0.36, 0.0]), -ends, ends)
    >>> abs(found.depth - 0.3) < 2e-3
    True
    """
    places = middles(echo)
    wavelength = speed_of_light / float(echo.frequencies[-1])
    if np.ptp(places[:, 2]) < wavelength or np.ptp(places[:, 1]) > wavelength / 8:
        return None
    array = float(places[:, 1].mean())
    away = float(peak[1]) - array
    if away <= 0:
        return None
    range_cell = speed_of_light / (2 * float(np.ptp(echo.frequencies)))
    fine, coarse = cells_at(echo, peak * [1, 0, 1] + [[0, array + 0.5 * away, 0], [0, peak[1], 0]])
    for cells in (fine, coarse):
        x, z = np.meshgrid(
            *(_line(low[axis], high[axis], cells[axis], peak[axis]) for axis in (0, 2)),
            indexing="ij",
        )
        if x.size <= MOST_UNKNOWNS:
            break
    left_open = range_cell > OPEN * fine[1]
    if x.size > (MOST_UNKNOWNS if left_open else FEW_UNKNOWNS):
        return None
    surface = np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=-1)
    span = CELLS_AWAY * range_cell
    first, last = array + max(NEAREST * away, away - span), array + min(1.5 * away, away + span)
    part = _thinned(echo, unknowns=x.size, depth=last - first)

    def explained(depth: float) -> float:
        return _explained(part, surface + np.array([0.0, depth, 0.0]))

    depths = np.linspace(first, last, DEPTHS)
    step = float(depths[1] - depths[0])
    shares = [explained(float(depth)) for depth in depths]
    best, most = float(depths[int(np.argmax(shares))]), max(shares)
    for _ in range(ROUNDS):
        step /= 4
        for depth in (best + step * np.array([-3, -2, -1, 1, 2, 3])).tolist():
            share = explained(depth)
            if share > most:
                best, most = depth, share
    here = explained(float(peak[1]))
    if most < EXPLAINED or 1 - most > BETTER * (1 - here):
        return None
    return FacingSurface(depth=best, explained=most)


def _line(low: float, high: float, cell: float, middle: float) -> Float[np.ndarray, " pixels"]:
    """Sample a width and half a cell on both sides of it. [m]."""
    first, last = min(low, middle) - MARGIN * cell, max(high, middle) + MARGIN * cell
    return np.linspace(first, last, max(3, int(np.ceil((last - first) / (PIXEL * cell))) + 1))


def _thinned(echo: Echo, *, unknowns: int, depth: float) -> Echo:
    """Take as many positions and frequencies as tell the unknowns, and the depths apart."""
    band = float(np.ptp(echo.frequencies))
    wanted = int(np.ceil(2 * band * depth / speed_of_light)) + 2
    kept = np.unique(
        np.rint(np.linspace(0, echo.frequencies.size - 1, min(wanted, echo.frequencies.size)))
    ).astype(int)
    most = max(FEWEST_POSITIONS, int(np.ceil(EQUATIONS * unknowns / kept.size)))
    part = some_positions(echo, evenly_chosen(len(echo.positions), most))
    samples = part.samples
    shared = samples.mean(axis=0)
    energy = float(np.vdot(samples, samples).real)
    without = float(np.vdot(echo.samples.mean(axis=0), echo.samples.mean(axis=0)).real)
    if without * len(samples) < SHARED * energy:
        samples = samples - shared
    return Echo(
        samples=samples[:, kept],
        positions=part.positions,
        frequencies=part.frequencies[kept],
        transmit_positions=part.transmit_positions,
    )


def _explained(part: Echo, points: Float[np.ndarray, "points 3"]) -> float:
    """Return the share of energy that a reflectivity at some points explains. [-]."""
    received = np.linalg.norm(part.positions[:, None] - points, axis=-1)
    sent = received
    if part.transmit_positions is not None:
        sent = np.linalg.norm(part.transmit_positions[:, None] - points, axis=-1)
    turns = 2 * np.pi / speed_of_light * part.frequencies[None, :, None]
    waves = np.exp(-1j * turns * (sent + received)[:, None]) / (sent * received)[:, None]
    shared = np.abs(part.samples.mean(axis=0)).max()
    if shared < SHARED * np.abs(part.samples).max():
        waves = waves - waves.mean(axis=0, keepdims=True)
    matrix = waves.reshape(-1, len(points)).astype(np.complex64)
    wanted = part.samples.reshape(-1).astype(np.complex64)
    wanted /= np.linalg.norm(wanted)
    matrix /= np.abs(matrix).max()
    return 1 - _left(matrix, wanted)


def _left(
    matrix: Complex[np.ndarray, "samples points"], wanted: Complex[np.ndarray, " samples"]
) -> float:
    """Return the energy left after some conjugate gradients of least squares. [-]."""
    residual = wanted.copy()
    gradient = matrix.conj().T @ residual
    along, steep = gradient, float(np.vdot(gradient, gradient).real)
    for _ in range(min(ITERATIONS, matrix.shape[1])):
        shown = matrix @ along
        size = float(np.vdot(shown, shown).real)
        if size == 0:
            break
        residual = residual - steep / size * shown
        gradient = matrix.conj().T @ residual
        before, steep = steep, float(np.vdot(gradient, gradient).real)
        along = gradient + steep / before * along if before else gradient
    return float(np.vdot(residual, residual).real)
