r"""Maximum-likelihood fit of one spherical wave to an uplink, below the grid, in float64.

The model is (3-10) of the thesis with the delay and the curvature of the wavefront as
separate lengths,

.. math:: u_{mn} = \alpha \frac{R_c}{r_m} e^{-j k_n (r_m - R_c + R)}, \qquad
          r_m = \lVert R_c\,\hat s(\theta) - q_m \rVert .

A direct path, or one over flat mirrors, has :math:`R_c = R`: the image of the user radiates
as the user does. A wave that a point (an edge, a rough patch) scatters keeps the path's
delay, but its curvature is that of the last leg alone. Comparing both tells them apart.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.measurement import Uplink

ITERATIONS = 30
CONVERGED = 1e-2
"""Step at which the iteration ends, in standard deviations of the parameters. [-]."""

BLOCKS = 16
"""Blocks of neighbouring elements whose residuals count as independent."""


@dataclass(frozen=True, kw_only=True)
class SphericalWave:
    """One wave in the array's frame and how well it is known."""

    aoa: float  # from the array's axis [rad]
    path_length: float  # from its delay [m]
    radius: float  # of curvature [m]
    gain: complex  # field at the array's centre, at zero path length [-]
    covariance: Float[np.ndarray, "parameters parameters"]  # of aoa, path length (, radius)
    explained: float  # share of the uplink's energy [-]


def wave_field(
    positions: Float[np.ndarray, "elements 3"],
    frequencies: Float[np.ndarray, " freqs"],
    *,
    aoa: float,
    path_length: float,
    radius: float,
) -> Complex[np.ndarray, "elements freqs"]:
    """Evaluate the model's field at unit gain, for elements in the array's frame. [-]."""
    source = radius * np.array([np.cos(aoa), np.sin(aoa), 0.0])
    distances = np.linalg.norm(source - positions, axis=-1)
    lengths = distances - radius + path_length
    turns = np.outer(lengths, frequencies / speed_of_light)
    field: np.ndarray = (radius / distances)[:, None] * np.exp(
        -2j * np.pi * (turns - np.round(turns))
    )
    return field


def fit_spherical_wave(
    uplink: Uplink, *, aoa: float, path_length: float, radius: float | None = None
) -> SphericalWave:
    """Refine a peak of the angle/range map, for elements in the array's frame.

    Parameters
    ----------
    uplink
        The pilot, with positions in the array's frame.
    aoa, path_length
        The peak on the grid, within its main lobe. [rad], [m]
    radius
        Start of a fit of the radius of curvature as well; ``None``: it is taken to be the
        path length. [m]

    Returns
    -------
    The wave. Its covariance is robust: what the model leaves over (noise and the field
    scattered diffusely alike) may be correlated over neighbouring elements and frequencies.

    Raises
    ------
    ValueError
        If the iteration leaves the neighbourhood of the peak.
    """
    parameters = np.array([aoa, path_length] + ([] if radius is None else [radius]))
    start = parameters.copy()
    wavenumbers = 2 * np.pi * uplink.frequencies / speed_of_light
    aperture = float(np.ptp(uplink.positions[:, 0]))
    lobe = np.array(
        [
            2 * np.pi / (wavenumbers[-1] * aperture),
            2 * np.pi / max(np.ptp(wavenumbers), wavenumbers[-1] * 1e-3),
        ]
    )
    for _ in range(ITERATIONS):
        normal, scores, gain, explained = _linearised(uplink, wavenumbers, parameters)
        step = np.linalg.solve(normal, scores.sum(axis=0))
        # Far from the peak the linear model overshoots: never move by more than half a lobe.
        limit = float(np.max(np.abs(step[2:4]) / (0.5 * lobe), initial=0.0))
        if radius is not None:
            limit = max(limit, abs(step[4]) / (0.3 * parameters[2]))
        parameters = parameters + step[2:] / max(1.0, limit)
        if np.any(np.abs(parameters[:2] - start[:2]) > 2 * lobe):
            raise ValueError(
                f"no peak within two main lobes of {np.degrees(aoa):.3f}°, {path_length:.4f} m"
            )
        deviation = np.sqrt(np.diag(np.linalg.inv(normal))[2:])
        noise = np.sqrt(np.mean(np.abs(uplink.samples) ** 2) * max(1 - explained, 1e-12))
        if np.all(np.abs(step[2:]) < CONVERGED * deviation * noise):
            break
    normal, scores, gain, explained = _linearised(uplink, wavenumbers, parameters)
    blocks = np.array_split(scores, min(BLOCKS, len(scores)))
    sums = np.stack([block.sum(axis=0) for block in blocks])
    bread = np.linalg.inv(normal)
    freedom = len(sums) / max(len(sums) - len(bread), 1)
    covariance = freedom * bread @ (sums.T @ sums) @ bread
    return SphericalWave(
        aoa=float(parameters[0]),
        path_length=float(parameters[1]),
        radius=float(parameters[-1]),
        gain=gain,
        covariance=covariance[2:, 2:],
        explained=explained,
    )


def _linearised(
    uplink: Uplink,
    wavenumbers: Float[np.ndarray, " freqs"],
    parameters: Float[np.ndarray, " parameters"],
) -> tuple[np.ndarray, np.ndarray, complex, float]:
    """Return JᵀJ, each element's Jᵀe, the gain and the share of energy.

    Columns of J: real and imaginary part of the relative gain, then the parameters. The
    amplitude ratio's own dependence on them carries 1/(kr)² of their information: left out.
    """
    free = len(parameters) == 3
    aoa, path_length, radius = parameters[0], parameters[1], parameters[-1]
    field = wave_field(
        uplink.positions, uplink.frequencies, aoa=aoa, path_length=path_length, radius=radius
    )
    gain = np.vdot(field, uplink.samples) / np.vdot(field, field).real
    model = gain * field
    explained = float(np.vdot(model, model).real / np.vdot(uplink.samples, uplink.samples).real)
    towards = np.array([np.cos(aoa), np.sin(aoa), 0.0])
    turned = np.array([-np.sin(aoa), np.cos(aoa), 0.0])
    reach = radius * towards - uplink.positions
    reach = reach / np.linalg.norm(reach, axis=-1, keepdims=True)
    # Derivatives of the length r − R_c + R by (aoa, R, R_c), each per element.
    bend = reach @ towards
    lengths = [radius * (reach @ turned), np.ones_like(bend) if free else bend]
    if free:
        lengths.append(bend - 1)
    slopes = np.stack(lengths, axis=-1)
    # With J = model·(1, j, −jk·slope): JᵀJ and Jᵀe separate into sums over frequency.
    power = np.abs(model) ** 2
    by_order = np.stack([power @ wavenumbers**order for order in range(3)], axis=-1)
    size = 2 + slopes.shape[1]
    normal = np.zeros((size, size))
    normal[0, 0] = normal[1, 1] = by_order[:, 0].sum()
    normal[1, 2:] = normal[2:, 1] = -(by_order[:, 1] @ slopes)
    normal[2:, 2:] = np.einsum("m,mi,mj->ij", by_order[:, 2], slopes, slopes)
    against = np.conj(model) * (uplink.samples - model)
    plain, weighted = against.sum(axis=1), against @ wavenumbers
    scores = np.column_stack([plain.real, plain.imag, -weighted.imag[:, None] * slopes])
    return normal, scores, complex(gain), explained
