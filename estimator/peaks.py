r"""Extraction of all significant paths of an uplink, after CLEAN and RELAX.

A path is a spherical wave :math:`u_{mn} = \alpha \frac{R}{r_m} e^{-j (k_n r_m - \bar k R)}`.
The strongest peak of the angle/range map is refined, subtracted, and the next one looked for
in what remains; after each new path all are refined together (RELAX), which in the limit is
the joint maximum-likelihood estimate in white noise.

What is significant: without any path, the map's power over its mean is exponentially
distributed in each independent cell. A peak counts if the highest of all K cells would reach
it with a probability below the false-alarm rate P, that is above ln(K/P) times the mean. The
mean is taken from the map's median (its ln 2-fold), which a few strong paths do not move.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.angle_range_map import (
    X_AXIS,
    Y_AXIS,
    angle_range_map,
    default_angles,
    default_path_lengths,
    polar_points,
)
from estimator.measurement import MeasurementError, Uplink

CELLS = 2.0
"""Samples of the map for each -3 dB cell, in each direction, to start the refinement. [-]"""

ITERATIONS = 40
CONVERGED = 1e-3  # largest step that ends the refinement, in standard deviations [-]


@dataclass(frozen=True, kw_only=True)
class PathPeak:
    """One path, and how well it is known in white noise."""

    aoa: float  # from the array's axis [rad]
    path_length: float  # from the array's centre [m]
    gain: complex  # field at the array's centre, at the mean frequency [-]
    covariance: Float[np.ndarray, "2 2"]  # of (aoa [rad], path length [m])
    excess_db: float  # power over the threshold of significance [dB]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Frame:
    """What the model of all paths shares."""

    samples: Complex[np.ndarray, "elements freqs"]
    offsets: Float[np.ndarray, "elements 3"]  # of the elements from the centre [m]
    wavenumbers: Float[np.ndarray, " freqs"]  # [rad/m]
    along: Float[np.ndarray, " 3"]
    across: Float[np.ndarray, " 3"]

    @property
    def mean_wavenumber(self) -> float:
        return float(self.wavenumbers.mean())


def extract_paths(
    uplink: Uplink,
    *,
    false_alarm_rate: float = 1e-3,
    most: int = 8,
    longest: float | None = None,
    axis: Float[np.ndarray, " 3"] = X_AXIS,
    boresight: Float[np.ndarray, " 3"] = Y_AXIS,
) -> tuple[PathPeak, ...]:
    """Find all significant paths of one user, the strongest first.

    Parameters
    ----------
    uplink
        The user's pilot.
    false_alarm_rate
        Probability that noise alone gives any path. [-]
    most
        Number of paths at which the search ends.
    longest
        Longest path length that is looked at; ``None``: the unambiguous one. [m]
    axis, boresight
        Unit vectors along the array and to the side of the sources.

    Returns
    -------
    The paths; empty if nothing stands out of the noise.

    Raises
    ------
    MeasurementError
        If the rate is no probability.
    """
    if not 0 < false_alarm_rate < 1:
        raise MeasurementError(
            f"false-alarm rate {false_alarm_rate:g}; it must lie between 0 and 1"
        )
    frame = _frame(uplink, axis, boresight)
    angles = default_angles(uplink, axis=axis, cells=CELLS)
    # The ends of the axis are no directions of a wave that a linear array could refine.
    angles = angles[(np.sin(angles) > 0.05)]
    lengths = default_path_lengths(uplink, longest=longest, cells=CELLS)
    cells = angles.size * lengths.size / CELLS**2
    threshold = float(np.log(cells / false_alarm_rate))
    parameters = np.zeros((0, 2))
    excess: list[float] = []
    residual = frame.samples
    while len(parameters) < most:
        power, start = _strongest(uplink, residual, angles, lengths, axis, boresight)
        if power <= threshold:
            break
        candidate = _refined(frame, np.vstack([parameters, start]))
        if _coincide(frame, candidate):
            break
        parameters = candidate
        excess.append(10 * np.log10(power / threshold))
        residual = frame.samples - _model(frame, parameters)[0]
        if np.linalg.norm(residual) <= 1e-9 * np.linalg.norm(frame.samples):
            break  # nothing but rounding is left
    return _described(frame, parameters, excess)


def refine_paths(
    uplink: Uplink,
    starts: Float[np.ndarray, "paths 2"],
    *,
    axis: Float[np.ndarray, " 3"] = X_AXIS,
    boresight: Float[np.ndarray, " 3"] = Y_AXIS,
) -> tuple[PathPeak, ...]:
    """Refine given paths together, to the joint maximum of the likelihood in float64.

    Parameters
    ----------
    uplink
        The user's pilot.
    starts
        Angle [rad] and path length [m] of each, within its main lobe.
    axis, boresight
        Unit vectors along the array and to the side of the sources.

    Returns
    -------
    The paths, in the order of their strength.
    """
    frame = _frame(uplink, axis, boresight)
    parameters = _refined(frame, starts)
    return _described(frame, parameters, [float("nan")] * len(parameters))


def _frame(
    uplink: Uplink, axis: Float[np.ndarray, " 3"], boresight: Float[np.ndarray, " 3"]
) -> _Frame:
    centre = uplink.positions.mean(axis=0)
    unit = polar_points(
        aoa=np.array([0.0, np.pi / 2]),
        path_length=np.ones(1),
        centre=np.zeros(3),
        axis=axis,
        boresight=boresight,
    )[:, 0]
    return _Frame(
        samples=uplink.samples,
        offsets=uplink.positions - centre,
        wavenumbers=2 * np.pi * uplink.frequencies / speed_of_light,
        along=unit[0],
        across=unit[1],
    )


def _strongest(
    uplink: Uplink,
    residual: Complex[np.ndarray, "elements freqs"],
    angles: Float[np.ndarray, " angles"],
    lengths: Float[np.ndarray, " ranges"],
    axis: Float[np.ndarray, " 3"],
    boresight: Float[np.ndarray, " 3"],
) -> tuple[float, Float[np.ndarray, " 2"]]:
    """Return the highest power over the mean of noise, and where it is."""
    left = Uplink(
        samples=residual,
        positions=uplink.positions,
        frequencies=uplink.frequencies,
        user=uplink.user,
    )
    chart = angle_range_map(left, aoa=angles, path_length=lengths, axis=axis, boresight=boresight)
    power = np.abs(chart.values) ** 2
    noise = float(np.median(power)) / np.log(2)
    row, column = np.unravel_index(int(power.argmax()), power.shape)
    return float(power[row, column]) / noise, np.array([angles[row], lengths[column]])


def _waves(
    frame: _Frame, parameters: Float[np.ndarray, "paths 2"]
) -> tuple[Complex[np.ndarray, "paths elements freqs"], Float[np.ndarray, "paths 2 elements"]]:
    """Return each path's unit wave, and the slopes of its lengths by angle and path length."""
    waves, slopes = [], []
    for aoa, path_length in parameters:
        towards = np.cos(aoa) * frame.along + np.sin(aoa) * frame.across
        turned = -np.sin(aoa) * frame.along + np.cos(aoa) * frame.across
        rays = path_length * towards - frame.offsets
        distance = np.linalg.norm(rays, axis=1)
        excess = ((frame.offsets**2).sum(1) - 2 * path_length * frame.offsets @ towards) / (
            distance + path_length
        )
        # k r - k̄ R, written so that neither term is large.
        phase = np.outer(excess, frame.wavenumbers) + path_length * (
            frame.wavenumbers - frame.mean_wavenumber
        )
        waves.append((path_length / distance)[:, None] * np.exp(-1j * phase))
        slopes.append([path_length * (rays @ turned) / distance, (rays @ towards) / distance])
    return np.array(waves), np.array(slopes)


def _model(
    frame: _Frame, parameters: Float[np.ndarray, "paths 2"]
) -> tuple[Complex[np.ndarray, "elements freqs"], Complex[np.ndarray, " paths"]]:
    """Return the sum of all paths with the gains that fit best, and these gains."""
    waves = _waves(frame, parameters)[0].reshape(len(parameters), -1)
    gram = waves.conj() @ waves.T
    gains = np.linalg.solve(gram, waves.conj() @ frame.samples.ravel())
    return (gains @ waves).reshape(frame.samples.shape), gains


def _normal_equations(
    frame: _Frame, parameters: Float[np.ndarray, "paths 2"]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Linearise: return JᵀJ, Jᵀe, the gains and the power left over.

    Columns of J, path by path: relative gain (real, imaginary part), angle, path length.
    """
    waves, slopes = _waves(frame, parameters)
    total, gains = _model(frame, parameters)
    columns = []
    for gain, wave, (by_angle, by_length) in zip(gains, waves, slopes, strict=True):
        field = gain * wave
        turning = -1j * field * frame.wavenumbers
        # The reference phase k̄R of the gain turns with the path length as well.
        along = turning * by_length[:, None] + 1j * frame.mean_wavenumber * field
        columns += [field, 1j * field, turning * by_angle[:, None], along]
    jacobian = np.stack([column.ravel() for column in columns])
    left = (frame.samples - total).ravel()
    normal = (jacobian.conj() @ jacobian.T).real
    return normal, (jacobian.conj() @ left).real, gains, float(np.vdot(left, left).real)


def _refined(frame: _Frame, starts: Float[np.ndarray, "paths 2"]) -> Float[np.ndarray, "paths 2"]:
    """Climb the likelihood by Gauss-Newton steps, each halved until it helps."""
    parameters = np.array(starts, dtype=np.float64)
    normal, gradient, _, power = _normal_equations(frame, parameters)
    floor = 1e-28 * float(np.vdot(frame.samples, frame.samples).real)
    for _ in range(ITERATIONS):
        step = np.linalg.solve(normal, gradient).reshape(-1, 4)[:, 2:]
        for _ in range(20):
            moved = parameters + step
            valid = np.all((moved[:, 0] > 0) & (moved[:, 0] < np.pi) & (moved[:, 1] > 0))
            if valid:
                trial = _normal_equations(frame, moved)
                if trial[3] <= power * (1 + 1e-12) + floor:
                    break
            step = step / 2
        else:
            return parameters  # no step helps: this is the maximum, to rounding
        parameters = moved
        normal, gradient, _, power = trial
        deviation = np.sqrt(np.diag(np.linalg.inv(normal)).reshape(-1, 4)[:, 2:])
        noise = np.sqrt(max(power, floor) / (2 * frame.samples.size))
        if np.all(np.abs(step) < CONVERGED * deviation * noise + 1e-15):
            break
    return parameters


def _coincide(frame: _Frame, parameters: Float[np.ndarray, "paths 2"]) -> bool:
    """Tell whether two paths came closer than the data can tell apart."""
    waves = _waves(frame, parameters)[0].reshape(len(parameters), -1)
    waves = waves / np.linalg.norm(waves, axis=1, keepdims=True)
    overlap = np.abs(waves.conj() @ waves.T) - np.eye(len(parameters))
    return bool(overlap.max() > 0.98)


def _described(
    frame: _Frame, parameters: Float[np.ndarray, "paths 2"], excess: list[float]
) -> tuple[PathPeak, ...]:
    if not len(parameters):
        return ()
    normal, _, gains, power = _normal_equations(frame, parameters)
    freedom = max(2 * frame.samples.size - 4 * len(parameters), 1)
    covariance = np.linalg.inv(normal) * power / freedom
    order = np.argsort(-np.abs(gains))
    return tuple(
        PathPeak(
            aoa=float(parameters[i, 0]),
            path_length=float(parameters[i, 1]),
            gain=complex(gains[i]),
            covariance=covariance[4 * i + 2 : 4 * i + 4, 4 * i + 2 : 4 * i + 4],
            excess_db=excess[i],
        )
        for i in order
    )
