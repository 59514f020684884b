r"""One spherical wave at a linear array, and how it changes with its parameters.

.. math:: u_{mn} = \alpha \frac{R_c}{r_m} e^{-j k_n (r_m - R_c + R)}, \qquad
          r_m = \lVert R_c\,\hat s(\theta) - q_m \rVert

has the parameters θ and R, and the radius of curvature R_c where that is free; else it is R. The
amplitude ratio's own dependence on them carries 1/(kr)² of their information: left out.
"""

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.measurement.model import UNIFORM_STEP, Uplink


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
    # r − R_c without cancellation, also for the huge radius of a plane wave.
    excess = ((positions**2).sum(axis=-1) - 2 * positions @ source) / (distances + radius)
    field: np.ndarray = (radius / distances)[:, None] * _delayed(excess + path_length, frequencies)
    return field


def _delayed(
    lengths: Float[np.ndarray, " elements"], frequencies: Float[np.ndarray, " freqs"]
) -> Complex[np.ndarray, "elements freqs"]:
    """Evaluate exp(-jkL) for every length and frequency."""
    per_metre = frequencies / speed_of_light
    steps = np.diff(frequencies)
    block = int(np.ceil(np.sqrt(frequencies.size)))
    if frequencies.size < 4 or np.ptp(steps) > UNIFORM_STEP * steps[0]:
        return _phasor(np.outer(lengths, per_metre))
    # On a uniform grid the phase of frequency a·block + b is a product of two phasors.
    step = float(per_metre[-1] - per_metre[0]) / (frequencies.size - 1)
    coarse = _phasor(np.outer(lengths, per_metre[::block]))
    fine = _phasor(np.outer(lengths, step * np.arange(block)))
    field = coarse[:, :, None] * fine[:, None, :]
    return np.ascontiguousarray(field.reshape(len(lengths), -1)[:, : frequencies.size])


def _phasor(turns: Float[np.ndarray, "*n"]) -> Complex[np.ndarray, "*n"]:
    phasor: np.ndarray = np.exp(-2j * np.pi * (turns - np.round(turns)))
    return phasor


def length_slopes(
    uplink: Uplink, values: Float[np.ndarray, " parameters"]
) -> Float[np.ndarray, "elements parameters"]:
    """Differentiate the length r − R_c + R by (aoa, R[, R_c]), for each element."""
    _, along, across = _rays(uplink, values)
    free = len(values) == 3
    lengths = [float(values[-1]) * across, np.ones_like(along) if free else along]
    if free:
        lengths.append(along - 1)
    return np.stack(lengths, axis=-1)


def length_bends(
    uplink: Uplink, values: Float[np.ndarray, " parameters"]
) -> Float[np.ndarray, "elements parameters parameters"]:
    """Differentiate the length r − R_c + R twice by (aoa, R[, R_c]), for each element."""
    radius = float(values[-1])
    distance, along, across = _rays(uplink, values)
    bends = np.zeros((len(distance), len(values), len(values)))
    bends[:, 0, 0] = radius**2 * (1 - across**2) / distance - radius * along
    bends[:, 0, -1] = bends[:, -1, 0] = across - radius * along * across / distance
    bends[:, -1, -1] = (1 - along**2) / distance
    return bends


def _rays(
    uplink: Uplink, values: Float[np.ndarray, " parameters"]
) -> tuple[Float[np.ndarray, " elements"], ...]:
    """Return elements' distances from the source [m], and their rays along and across the axis."""
    aoa = float(values[0])
    towards = np.array([np.cos(aoa), np.sin(aoa), 0.0])
    turned = np.array([-np.sin(aoa), np.cos(aoa), 0.0])
    reach = float(values[-1]) * towards - uplink.positions
    distance = np.linalg.norm(reach, axis=-1)
    rays = reach / distance[:, None]
    return distance, rays @ towards, rays @ turned


def curved_part(
    matched: Complex[np.ndarray, "elements 3"],
    slopes: Float[np.ndarray, "elements parameters"],
    bends: Float[np.ndarray, "elements parameters parameters"],
) -> Float[np.ndarray, "columns columns"]:
    """Sum residual times the model's second derivatives, by relative gain and parameters.

    ``matched`` is Σ wave*·residual·kⁿ over frequency. The derivatives are wave·(−jkL_a)·(1, j) by a
    gain and a parameter, and wave·(−k²L_aL_b − jkL_ab) by two parameters.
    """
    count = slopes.shape[1]
    curved = np.zeros((2 + count, 2 + count))
    by_gain = (1j * matched[:, 1]) @ slopes
    curved[0, 2:] = curved[2:, 0] = by_gain.real
    curved[1, 2:] = curved[2:, 1] = by_gain.imag
    first = np.einsum("ma,mb,m->ab", slopes, slopes, -matched[:, 2].real)
    second = np.einsum("mab,m->ab", bends, (1j * matched[:, 1]).real)
    curved[2:, 2:] = first + second
    return curved


def wave_columns(
    slopes: Float[np.ndarray, "elements parameters"],
) -> tuple[Complex[np.ndarray, "elements columns"], np.ndarray]:
    """Return the factors of a wave's columns of J, and the power of k that each one has."""
    ones = np.ones(len(slopes))
    shape = np.column_stack([ones, 1j * ones, -1j * slopes])
    return shape, np.array([0, 0] + [1] * slopes.shape[1])
