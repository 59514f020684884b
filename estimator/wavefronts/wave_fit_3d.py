r"""Maximum-likelihood fit of one wavefront to a planar array, below the grid, in float64.

One model serves the uplink (n = 1 pass) and the monostatic echo (n = 2):

.. math:: s_{mf} = \alpha \frac{R}{\ell_m} e^{-j n k_f \ell_m}, \qquad
          \ell_m = R + \frac{S_m}{1 + \sqrt{1 + \kappa S_m}}, \quad
          S_m = \kappa q_m^2 - 2 \hat s \cdot q_m,

in which :math:`\ell_m - R = |\hat s / \kappa - q_m| - 1 / \kappa` without its cancellation, for
any curvature :math:`\kappa` of the wavefront at the array's centre, zero included:

- a user seen directly or over flat mirrors has :math:`\kappa = 1/R` (its image radiates);
- a wave that a point scatters on its way is rounder: :math:`\kappa > 1/R`;
- a point target's echo has :math:`\kappa = 1/R`, that of a flat wall met head-on
  :math:`\kappa = 0`: each element sees the foot of its own perpendicular, so
  :math:`\ell_m = d - n \cdot q_m`, and the fit is that of the plane itself.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.measurement.model import Echo, Uplink
from estimator.wavefronts.no_wave import NoWaveError

ITERATIONS = 15
"""Most Gauss-Newton steps. [-]"""
CONVERGED = 1e-2
"""Step at which the iteration ends, in standard deviations of the parameters. [-]"""
LONGEST_STEP = 0.5
"""Largest step, in main lobes: the model is linear over less. [-]"""
FARTHEST = 2.0
"""Distance from its start, in main lobes, beyond which a fit has left its peak. [-]"""
NARROWEST_BAND = 1e-3
"""Bandwidth over the highest frequency that the length's main lobe is taken of at least. [-]"""
CURVATURES = (-0.5, 0.9)
"""Curvatures, times half the aperture's diagonal, between which a fit stays: at 1 the source would
be at the array's corner. [-]"""

SLOPE_STEP = 1e-6
"""Of central differences: as far from rounding as from the curvature. [-], [m], [1/m]"""

TILES = 5
"""Tiles of the array along each axis; residuals of different tiles count as independent."""


@dataclass(frozen=True, kw_only=True)
class Wavefront:
    """One wave in the array's frame and how well it is known."""

    cosines: tuple[float, float]  # of the direction it comes from, along x and z [-]
    path_length: float  # from its delay; of an echo the distance [m]
    curvature: float  # of the wavefront at the array's centre [1/m]
    gain: complex  # field at the array's centre, at zero path length [-]
    covariance: Float[np.ndarray, "parameters parameters"]  # of cosines, length (, curvature)
    explained: float  # share of the samples' energy [-]
    passes: int

    @property
    def bearing(self) -> Float[np.ndarray, " 2"]:
        """What a planar array measures of the direction: its cosines. [-]."""
        return np.array(self.cosines)

    @property
    def curvature_deviation(self) -> float:
        """Standard deviation of the curvature; 0 where it was not fitted. [1/m]."""
        return float(np.sqrt(self.covariance[3, 3])) if len(self.covariance) > 3 else 0.0

    @property
    def direction(self) -> Float[np.ndarray, " 3"]:
        """Unit vector from the array's centre to where the wave comes from."""
        return towards(*self.cosines)


def towards(along: float, up: float) -> Float[np.ndarray, " 3"]:
    """Return the unit vector with given direction cosines along x and z, in front (y ≥ 0)."""
    return np.array([along, np.sqrt(max(1 - along**2 - up**2, 0.0)), up])


def about_another_centre(wave: Wavefront, centre: Float[np.ndarray, " 3"]) -> Wavefront:
    """Describe a wave at another point: its direction, length and curvature there.

    Parameters
    ----------
    wave
        At the origin.
    centre
        Where it is described. [m]

    Returns
    -------
    The same field; positions are then those over that point.
    """
    free = len(wave.covariance) == 4
    values = np.array([*wave.cosines, wave.path_length, wave.curvature])[: len(wave.covariance)]

    def moved(values: Float[np.ndarray, " parameters"]) -> Float[np.ndarray, " parameters"]:
        bend = float(values[3]) if free else 1 / float(values[2])
        ray = towards(float(values[0]), float(values[1])) - bend * centre
        root = float(np.linalg.norm(ray))
        here = centre[None, :]
        length = _lengths(here, float(values[0]), float(values[1]), float(values[2]), bend)[0][0]
        return np.array([ray[0] / root, ray[2] / root, length, bend / root])[: values.size]

    there = moved(values)
    units = np.eye(values.size) * SLOPE_STEP
    slopes = np.stack([moved(values + unit) - moved(values - unit) for unit in units], axis=-1)
    slopes /= 2 * SLOPE_STEP
    return replace(
        wave,
        cosines=(float(there[0]), float(there[1])),
        path_length=float(there[2]),
        curvature=float(there[3]) if free else 1 / float(there[2]),
        # The field is taken at zero path length, over which it grows.
        gain=wave.gain * wave.path_length / float(there[2]),
        covariance=slopes @ wave.covariance @ slopes.T,
    )


def wavefront_field(
    positions: Float[np.ndarray, "elements 3"],
    frequencies: Float[np.ndarray, " freqs"],
    wave: Wavefront,
) -> Complex[np.ndarray, "elements freqs"]:
    """Evaluate a wave's field at the elements. [-]."""
    lengths = _lengths(positions, *wave.cosines, wave.path_length, wave.curvature)[0]
    return wave.gain * _field(lengths, wave.path_length, frequencies, wave.passes)


def fit_wavefront(
    measured: Echo | Uplink,
    *,
    cosines: tuple[float, float],
    path_length: float,
    curvature: float | None = None,
) -> Wavefront:
    """Refine a wave that was found on a grid.

    Parameters
    ----------
    measured
        Samples at positions in the array's frame.
    cosines, path_length
        Where it was found, within its main lobe. [-], [m]
    curvature
        Start of a fit of the curvature as well; ``None``: it is tied to the length, 1/R. [1/m]

    Returns
    -------
    The wave. Its covariance is robust: what the model leaves over may be correlated over
    neighbouring elements and all frequencies (the sandwich over tiles of the array).

    Raises
    ------
    NoWaveError
        If the iteration leaves the neighbourhood of the start.
    """
    passes = 2 if isinstance(measured, Echo) else 1
    free = curvature is not None
    parameters = np.array([*cosines, path_length] + ([curvature] if curvature is not None else []))
    start = parameters.copy()
    wavenumbers = 2 * np.pi * passes * measured.frequencies / speed_of_light
    extent = np.ptp(measured.positions, axis=0)
    half = 0.5 * float(np.linalg.norm(extent))
    lobe = np.array(
        [
            2 * np.pi / (wavenumbers[-1] * extent[0]),
            2 * np.pi / (wavenumbers[-1] * extent[2]),
            2 * np.pi / max(np.ptp(wavenumbers), NARROWEST_BAND * wavenumbers[-1]),
            2 * np.pi / (wavenumbers[-1] * 0.5 * half**2),
        ]
    )[: parameters.size]
    energy = float(np.vdot(measured.samples, measured.samples).real)
    for _ in range(ITERATIONS):
        normal, scores, _, explained = _linearised(measured, wavenumbers, parameters, passes)
        step = np.linalg.solve(normal, scores.sum(axis=0))[2:]
        # Far from the summit the linear model overshoots.
        step = step / max(1.0, float(np.max(np.abs(step) / (LONGEST_STEP * lobe))))
        parameters = parameters + step
        gone = np.abs(parameters[:3] - start[:3]) > FARTHEST * lobe[:3]
        if np.any(gone) or parameters[0] ** 2 + parameters[1] ** 2 >= 1 or parameters[2] <= 0:
            raise NoWaveError(f"no summit within two main lobes of {start[:3]}")
        if free and not CURVATURES[0] / half < parameters[3] < CURVATURES[1] / half:
            raise NoWaveError(f"the curvature runs off to {parameters[3]:.3g}/m")
        deviation = np.sqrt(np.diag(np.linalg.inv(normal))[2:])
        noise = np.sqrt(energy * max(1 - explained, 1e-12) / measured.samples.size)
        if np.all(np.abs(step) < CONVERGED * deviation * noise + 1e-14):
            break
    normal, scores, gain, explained = _linearised(measured, wavenumbers, parameters, passes)
    sums = np.stack([scores[members].sum(axis=0) for members in _tiles(measured.positions)])
    bread = np.linalg.inv(normal)
    freedom = len(sums) / max(len(sums) - len(bread), 1)
    covariance = freedom * bread @ (sums.T @ sums) @ bread
    length = float(parameters[2])
    return Wavefront(
        cosines=(float(parameters[0]), float(parameters[1])),
        path_length=length,
        curvature=float(parameters[3]) if free else 1 / length,
        gain=gain,
        covariance=covariance[2:, 2:],
        explained=explained,
        passes=passes,
    )


def _tiles(positions: Float[np.ndarray, "elements 3"]) -> list[np.ndarray]:
    """Split the array into tiles of neighbouring elements."""
    index = np.zeros(len(positions), dtype=np.int64)
    for axis in (0, 2):
        column = positions[:, axis]
        share = (column - column.min()) / np.ptp(column)
        index = TILES * index + np.minimum((share * TILES).astype(np.int64), TILES - 1)
    return [np.flatnonzero(index == tile) for tile in np.unique(index)]


def _lengths(
    positions: Float[np.ndarray, "elements 3"],
    along: float,
    up: float,
    path_length: float,
    curvature: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return each element's length and its slopes by both cosines and by the curvature."""
    ahead = np.sqrt(1 - along**2 - up**2)
    across = positions @ np.array([along, ahead, up])
    square = np.einsum("mx,mx->m", positions, positions)
    bent = curvature * square - 2 * across
    root = np.sqrt(np.maximum(1 + curvature * bent, 1e-12))
    excess = bent / (1 + root)
    by_along = -(positions[:, 0] - along / ahead * positions[:, 1]) / root
    by_up = -(positions[:, 2] - up / ahead * positions[:, 1]) / root
    by_curvature = (square + across * excess) / ((1 + root) * root)
    return path_length + excess, by_along, by_up, by_curvature


def _field(
    lengths: Float[np.ndarray, " elements"],
    path_length: float,
    frequencies: Float[np.ndarray, " freqs"],
    passes: int,
) -> Complex[np.ndarray, "elements freqs"]:
    turns = np.outer(lengths, passes * frequencies / speed_of_light)
    field: np.ndarray = (path_length / lengths)[:, None] * np.exp(
        -2j * np.pi * (turns - np.round(turns))
    )
    return field


def _linearised(
    measured: Echo | Uplink,
    wavenumbers: Float[np.ndarray, " freqs"],
    parameters: Float[np.ndarray, " parameters"],
    passes: int,
) -> tuple[np.ndarray, np.ndarray, complex, float]:
    """Return JᵀJ, each element's Jᵀe, the gain and the share of energy.

    Columns of J: real and imaginary part of the relative gain, then the parameters. The
    amplitude's own dependence on them carries 1/(kR)² of their information: left out.
    """
    free = parameters.size == 4
    length = float(parameters[2])
    bend = float(parameters[3]) if free else 1 / length
    lengths, by_along, by_up, by_bend = _lengths(
        measured.positions, float(parameters[0]), float(parameters[1]), length, bend
    )
    field = _field(lengths, length, measured.frequencies, passes)
    gain = np.vdot(field, measured.samples) / np.vdot(field, field).real
    model = gain * field
    energy = float(np.vdot(measured.samples, measured.samples).real)
    explained = float(np.vdot(model, model).real) / energy
    by_length = np.ones_like(by_bend) if free else 1 - by_bend * bend**2
    columns = [by_along, by_up, by_length] + ([by_bend] if free else [])
    slopes = np.stack(columns, axis=-1)
    # With J = model·(1, j, −jk·slope): JᵀJ and Jᵀe separate into sums over frequency.
    power = np.abs(model) ** 2
    by_order = np.stack([(power * wavenumbers**order).sum(axis=1) for order in range(3)], axis=-1)
    size = 2 + slopes.shape[1]
    normal = np.zeros((size, size))
    normal[0, 0] = normal[1, 1] = by_order[:, 0].sum()
    normal[1, 2:] = normal[2:, 1] = -(by_order[:, 1, None] * slopes).sum(axis=0)
    normal[2:, 2:] = np.einsum("m,mi,mj->ij", by_order[:, 2], slopes, slopes)
    against = np.conj(model) * (measured.samples - model)
    plain, weighted = against.sum(axis=1), (against * wavenumbers).sum(axis=1)
    scores = np.column_stack([plain.real, plain.imag, -weighted.imag[:, None] * slopes])
    return normal, scores, complex(gain), explained
