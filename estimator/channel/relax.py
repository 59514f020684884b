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

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator import false_alarm
from estimator.channel.angle_range_map_2d import (
    X_AXIS,
    Y_AXIS,
    angle_range_map,
    default_angles,
    default_path_lengths,
    polar_points,
)
from estimator.imaging.peak_detection import mean_background
from estimator.measurement.model import MeasurementError, Uplink
from estimator.wavefronts.no_wave import NoWaveError
from estimator.wavefronts.wave_fit_2d import (
    FittedWaves,
    WaveStart,
    fit_spherical_waves,
)
from estimator.wavefronts.wave_model_2d import wave_field

CELLS = 2.0
"""Samples of the map for each -3 dB cell, in each direction, to start the refinement. [-]"""

LEAST_SINE = 0.05
"""Sine of the angle from the array's axis from which waves are looked for: within 3° of the axis a
linear array's wavefront does not depend on the angle. [-]"""

ROUNDING = 1e-9
"""Residual over the pilot, both rms, at which nothing but rounding is left. [-]"""

SAME_WAVE = 0.98
"""Normalised inner product of two waves from which they are one: of the energy of either the other
leaves 1 − 0.98² = 4 % (−14 dB), no more than the first sidelobe of an untapered aperture (−13 dB),
which an error of its fit leaves as well. [-]"""

MOST_PATHS = 8
"""Number of paths at which the search ends, by default: a limit of time that callers set, since
all are fitted anew with each. What is significant ends the search, as a rule before. [-]"""


@dataclass(frozen=True, kw_only=True)
class PathPeak:
    """One path, and how well it is known in white noise."""

    aoa: float  # from the array's axis [rad]
    path_length: float  # from the array's centre [m]
    gain: complex  # field at the array's centre, at the mean frequency [-]
    covariance: Float[np.ndarray, "2 2"]  # of (aoa [rad], path length [m])
    excess_db: float  # power over the threshold of significance [dB]


def extract_paths(
    uplink: Uplink,
    *,
    false_alarm_rate: float = false_alarm.PATH,
    most: int = MOST_PATHS,
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
    local = _in_array_frame(uplink, axis, boresight)
    angles = default_angles(local, cells=CELLS)
    angles = angles[(np.sin(angles) > LEAST_SINE)]
    lengths = default_path_lengths(local, longest=longest, cells=CELLS)
    cells = angles.size * lengths.size / CELLS**2
    threshold = false_alarm.threshold(false_alarm_rate, cells=cells)
    found: FittedWaves | None = None
    excess: list[float] = []
    residual = local
    while len(excess) < most:
        power, start = _strongest(residual, angles, lengths)
        if power <= threshold:
            break
        before = found.waves if found else ()
        starts = [WaveStart(aoa=wave.aoa, path_length=wave.path_length) for wave in before]
        try:
            candidate = fit_spherical_waves(local, [*starts, start])
        except NoWaveError:
            break  # no maximum of its own: what is left is no wave
        if _coincide(local, candidate):
            break
        found = candidate
        excess.append(10 * np.log10(power / threshold))
        residual = replace(local, samples=found.residual)
        if np.linalg.norm(found.residual) <= ROUNDING * np.linalg.norm(local.samples):
            break
    return _described(local, found, excess) if found else ()


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
    local = _in_array_frame(uplink, axis, boresight)
    waves = [WaveStart(aoa=float(aoa), path_length=float(length)) for aoa, length in starts]
    return _described(local, fit_spherical_waves(local, waves), [float("nan")] * len(waves))


def _in_array_frame(
    uplink: Uplink, axis: Float[np.ndarray, " 3"], boresight: Float[np.ndarray, " 3"]
) -> Uplink:
    """Express the elements from their centre, along the array, ahead of it and across both."""
    unit = polar_points(
        aoa=np.array([0.0, np.pi / 2]),
        path_length=np.ones(1),
        centre=np.zeros(3),
        axis=axis,
        boresight=boresight,
    )[:, 0]
    axes = np.stack([unit[0], unit[1], np.cross(unit[0], unit[1])])
    return replace(uplink, positions=(uplink.positions - uplink.positions.mean(axis=0)) @ axes.T)


def _strongest(
    residual: Uplink, angles: Float[np.ndarray, " angles"], lengths: Float[np.ndarray, " ranges"]
) -> tuple[float, WaveStart]:
    """Return the highest power of the residual's map over the mean of noise, and where it is."""
    chart = angle_range_map(residual, aoa=angles, path_length=lengths, centre=np.zeros(3))
    power = np.abs(chart.values) ** 2
    noise = mean_background(power)
    row, column = np.unravel_index(int(power.argmax()), power.shape)
    start = WaveStart(aoa=float(angles[row]), path_length=float(lengths[column]))
    return float(power[row, column]) / noise, start


def _coincide(uplink: Uplink, found: FittedWaves) -> bool:
    """Tell whether two paths came closer than the data can tell apart."""
    waves = np.array(
        [
            wave_field(
                uplink.positions,
                uplink.frequencies,
                aoa=wave.aoa,
                path_length=wave.path_length,
                radius=wave.radius,
            ).ravel()
            for wave in found.waves
        ]
    )
    waves = waves / np.linalg.norm(waves, axis=1, keepdims=True)
    overlap = np.abs(waves.conj() @ waves.T) - np.eye(len(waves))
    return bool(overlap.max() > SAME_WAVE)


def _described(uplink: Uplink, found: FittedWaves, excess: list[float]) -> tuple[PathPeak, ...]:
    power = float(np.vdot(found.residual, found.residual).real)
    freedom = max(2 * found.residual.size - 4 * len(found.waves), 1)
    # Half a circular variance is in either part.
    covariance = found.white * (2 * power / freedom)
    mean = 2 * np.pi * float(uplink.frequencies.mean()) / speed_of_light
    order = np.argsort([-abs(wave.gain) for wave in found.waves], kind="stable")
    return tuple(
        PathPeak(
            aoa=found.waves[i].aoa,
            path_length=found.waves[i].path_length,
            gain=complex(found.waves[i].gain * np.exp(-1j * mean * found.waves[i].path_length)),
            covariance=covariance[2 * i : 2 * i + 2, 2 * i : 2 * i + 2],
            excess_db=excess[i],
        )
        for i in order
    )
