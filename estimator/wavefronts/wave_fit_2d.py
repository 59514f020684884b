r"""Maximum-likelihood fit of spherical waves to an uplink, together, below the grid, in float64.

The model of each wave is (3-10) of the thesis with the delay and the curvature of the wavefront
as separate lengths (:mod:`estimator.wavefronts.wave_model_2d`). A direct path, or one over flat
mirrors, has :math:`R_c = R`: the image of the user radiates as the user does. A wave that a point
(an edge, a rough patch) scatters keeps the path's delay, but its curvature is that of the last leg
alone. Comparing both tells them apart.

All waves of a pilot are fitted at once (RELAX in the limit), so that the sidelobes of one do not
bias another. The covariance contains the noise and the wavefront's phase error
(:mod:`estimator.wavefronts.phase_error`): with N = JᵀJ and the error's own JᵀCJ it is N⁻¹ JᵀCJ N⁻¹.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Complex, Float
from scipy.constants import speed_of_light
from scipy.linalg import cho_factor, cho_solve

from estimator.measurement.model import Uplink
from estimator.wavefronts.no_wave import NoWaveError
from estimator.wavefronts.noise_variance import noise_variance
from estimator.wavefronts.phase_error import wavefront_error
from estimator.wavefronts.wave_model_2d import (
    curved_part,
    length_bends,
    length_slopes,
    wave_columns,
    wave_field,
)

ITERATIONS = 40
"""Most Gauss-Newton steps; five suffice from a summit's own main lobe. [-]"""
CONVERGED = 1e-2
"""Step at which the iteration ends, in standard deviations of the parameters. [-]"""
FLOOR = 1e-7
"""Noise that is assumed at least, over the pilot's rms, so that a noise-free pilot converges too:
the rounding of float64 after sums over 1e5 samples. [-]"""
SHORTENED = 6
"""Times that a step is halved until the residual does not grow: after these it is lost in rounding.
[-]"""
ROUNDING = 1e-12
"""Growth of the residual's energy that is none: rounding over 1e5 samples. [-]"""
LONGEST_STEP = 0.5
"""Largest step, in main lobes: the model is linear over less. [-]"""
LONGEST_RADIUS_STEP = 0.3
"""Largest step of a radius of curvature, over the radius. [-]"""
MERGED = 0.1
"""Distance of two waves, in main lobes, below which they are one: a fifth of what
:mod:`estimator.channel.path_extraction_2d` takes for resolved. Such pairs did not converge. [-]"""
FARTHEST = 2.0
"""Distance from its start, in main lobes, beyond which a fit has left its peak. [-]"""
NARROWEST_BAND = 1e-3
"""Bandwidth over the highest frequency that the length's main lobe is taken of at least: of one
frequency alone it would be endless. [-]"""
MOST_CONDITION = 1e12
"""Condition number of JᵀJ, its columns scaled, from which two waves are the same: float64 keeps
four digits of its inverse. [-]"""


@dataclass(frozen=True, kw_only=True)
class WaveStart:
    """Where the fit of a wave begins, within its main lobe."""

    aoa: float  # [rad]
    path_length: float  # [m]
    radius: float | None = None  # of curvature; None: it is the path length, also in the fit [m]
    lit: Bool[np.ndarray, " elements"] | None = None  # the elements that it reaches; None: all


@dataclass(frozen=True, kw_only=True)
class SphericalWave:
    """One wave in the array's frame and how well it is known."""

    aoa: float  # from the array's axis [rad]
    path_length: float  # from its delay [m]
    radius: float  # of curvature [m]
    gain: complex  # field at the array's centre, at zero path length [-]
    covariance: Float[np.ndarray, "parameters parameters"]  # of aoa, path length (, radius)
    explained: float  # its energy over the uplink's; of orthogonal waves, their shares [-]
    lit: Bool[np.ndarray, " elements"] | None = None  # the elements that it reaches; None: all

    @property
    def bearing(self) -> Float[np.ndarray, " 1"]:
        """What a linear array measures of the direction: the angle. [rad]."""
        return np.array([self.aoa])

    @property
    def curvature(self) -> float:
        """Of the wavefront at the array's centre. [1/m]."""
        return 1 / self.radius

    @property
    def curvature_deviation(self) -> float:
        """Its standard deviation, to first order; 0 where it was not fitted. [1/m]."""
        if len(self.covariance) < 3:
            return 0.0
        return float(np.sqrt(self.covariance[2, 2]) / self.radius**2)


@dataclass(frozen=True, kw_only=True)
class FittedWaves:
    """Waves that were fitted together."""

    waves: tuple[SphericalWave, ...]  # in the order of their starts
    covariance: Float[np.ndarray, "all all"]  # of all parameters, wave after wave
    white: Float[np.ndarray, "all all"]  # the same for a unit variance of white noise alone
    residual: Complex[np.ndarray, "elements freqs"]  # the pilot less all waves [-]


def fit_spherical_wave(
    uplink: Uplink, *, aoa: float, path_length: float, radius: float | None = None
) -> SphericalWave:
    """Refine one peak of the angle/range map: :func:`fit_spherical_waves` for a single wave."""
    start = WaveStart(aoa=aoa, path_length=path_length, radius=radius)
    return fit_spherical_waves(uplink, [start]).waves[0]


def fit_spherical_waves(uplink: Uplink, starts: Sequence[WaveStart]) -> FittedWaves:
    """Refine peaks of the angle/range map together, for elements in the array's frame.

    Parameters
    ----------
    uplink
        The pilot, with positions in the array's frame.
    starts
        The peaks on the grid, each within its main lobe.

    Returns
    -------
    The waves, in the order of their starts. What of the residual is more than noise is taken to be
    a phase error of each wave (:mod:`estimator.wavefronts.phase_error`).

    Raises
    ------
    NoWaveError
        If the iteration leaves the neighbourhood of a peak, or two waves become one.
    """
    wavenumbers = 2 * np.pi * uplink.frequencies / speed_of_light
    parameters = [
        np.array([start.aoa, start.path_length] + ([start.radius] if start.radius else []))
        for start in starts
    ]
    first = [values.copy() for values in parameters]
    lobe = _main_lobe(uplink, wavenumbers)
    lit = [start.lit for start in starts]
    state = _linearised(uplink, wavenumbers, parameters, lit)
    floor = FLOOR * np.sqrt(np.mean(np.abs(uplink.samples) ** 2))
    for _ in range(ITERATIONS):
        bread = _inverse(state.normal, starts)
        steps = np.split(_ascent(state, bread), state.bounds)
        limit = max(
            _overshoot(step, values, lobe) for step, values in zip(steps, parameters, strict=True)
        )
        # Far from the peak the linear model overshoots.
        moves = [step[2:] / max(1.0, limit) for step in steps]
        moved = _moved(uplink, wavenumbers, parameters, moves, state, lit)
        if moved is None:
            break
        last, parameters, state = state, *moved
        for values, origin, start in zip(parameters, first, starts, strict=True):
            far = np.abs(values[:2] - origin[:2]) > FARTHEST * lobe
            if np.any(far) or np.any(values <= 0):
                raise NoWaveError(
                    f"no peak within two main lobes of {np.degrees(start.aoa):.3f}°, "
                    f"{start.path_length:.4f} m"
                )
        if _merged(parameters, lobe):
            raise NoWaveError("two waves became one")
        noise = np.sqrt(np.mean(np.abs(last.residual) ** 2) / 2)
        deviations = np.split(np.sqrt(np.diag(bread)), state.bounds)
        if all(
            np.all(np.abs(move) < CONVERGED * deviation[2:] * max(noise, floor))
            for move, deviation in zip(moves, deviations, strict=True)
        ):
            break
    return _described(uplink, wavenumbers, parameters, starts, state)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Linear:
    """The model about some parameters."""

    gains: Complex[np.ndarray, " waves"]
    fields: tuple[Complex[np.ndarray, "elements freqs"], ...]  # of each wave, with its gain
    slopes: tuple[Float[np.ndarray, "elements _"], ...]  # of its length by its parameters
    normal: Float[np.ndarray, "all all"]  # JᵀJ
    hessian: Float[np.ndarray, "all all"]  # JᵀJ less what the model's curvature takes of it
    scores: Float[np.ndarray, "elements all"]  # each element's Jᵀe
    residual: Complex[np.ndarray, "elements freqs"]
    bounds: list[int]  # where the columns of one wave end


def _merged(parameters: Sequence[Float[np.ndarray, " _"]], lobe: Float[np.ndarray, " 2"]) -> bool:
    """Tell whether two waves are so near that they describe one, whose front roughness bends."""
    places = np.array([[np.cos(values[0]), values[1]] for values in parameters]) / lobe
    apart = np.abs(places[:, None] - places).max(axis=-1)
    return bool((apart[np.triu_indices(len(places), k=1)] < MERGED).any())


def _ascent(state: _Linear, bread: Float[np.ndarray, "all all"]) -> Float[np.ndarray, " all"]:
    """Return Newton's step, or Gauss and Newton's where the likelihood is not concave.

    What roughness bends, or two waves closer than a cell, leave residuals so large that Gauss and
    Newton's steps fall by a few percent each.
    """
    scores = state.scores.sum(axis=0)
    try:
        return np.asarray(cho_solve(cho_factor(state.hessian), scores))
    except np.linalg.LinAlgError:
        return np.asarray(bread @ scores)


def _moved(
    uplink: Uplink,
    wavenumbers: Float[np.ndarray, " freqs"],
    parameters: Sequence[Float[np.ndarray, " _"]],
    moves: Sequence[Float[np.ndarray, " _"]],
    state: _Linear,
    lit: Sequence[Bool[np.ndarray, " elements"] | None],
) -> tuple[list[Float[np.ndarray, " _"]], _Linear] | None:
    """Take a step, shortened until the residual falls; None: it falls no more."""
    before = float(np.vdot(state.residual, state.residual).real)
    for shorter in range(SHORTENED + 1):
        there = [values + move / 2**shorter for values, move in zip(parameters, moves, strict=True)]
        taken = _linearised(uplink, wavenumbers, there, lit)
        if float(np.vdot(taken.residual, taken.residual).real) <= before * (1 + ROUNDING):
            return there, taken
    return None


def _main_lobe(uplink: Uplink, wavenumbers: Float[np.ndarray, " freqs"]) -> Float[np.ndarray, " 2"]:
    aperture = float(np.ptp(uplink.positions[:, 0]))
    return np.array(
        [
            2 * np.pi / (wavenumbers[-1] * aperture),
            2 * np.pi / max(np.ptp(wavenumbers), wavenumbers[-1] * NARROWEST_BAND),
        ]
    )


def _overshoot(
    step: Float[np.ndarray, " columns"],
    values: Float[np.ndarray, " parameters"],
    lobe: Float[np.ndarray, " 2"],
) -> float:
    """Return by how much a step is too long."""
    limit = float(np.max(np.abs(step[2:4]) / (LONGEST_STEP * lobe), initial=0.0))
    if len(values) < 3:
        return limit
    return max(limit, float(abs(step[4]) / (LONGEST_RADIUS_STEP * values[2])))


def _linearised(
    uplink: Uplink,
    wavenumbers: Float[np.ndarray, " freqs"],
    parameters: Sequence[Float[np.ndarray, " _"]],
    lit: Sequence[Bool[np.ndarray, " elements"] | None],
) -> _Linear:
    """Linearise about parameters, with the gains that fit best.

    Columns of J, wave by wave: real and imaginary part of the relative gain, then the
    parameters. The amplitude ratio's own dependence on them carries 1/(kr)² of their
    information: left out.
    """
    units = [
        wave_field(
            uplink.positions,
            uplink.frequencies,
            aoa=float(values[0]),
            path_length=float(values[1]),
            radius=float(values[-1]),
        )
        * (1.0 if mask is None else mask[:, None])
        for values, mask in zip(parameters, lit, strict=True)
    ]
    gram = np.array([[np.vdot(one, other) for other in units] for one in units])
    against = np.array([np.vdot(unit, uplink.samples) for unit in units])
    try:
        gains = np.linalg.solve(gram, against)
    except np.linalg.LinAlgError:
        raise NoWaveError("two waves became one") from None
    fields = tuple(gain * unit for gain, unit in zip(gains, units, strict=True))
    residual = uplink.samples - sum(fields)
    slopes = tuple(length_slopes(uplink, values) for values in parameters)
    # With J = wave·(1, j, −jk·slope), JᵀJ and Jᵀe separate into sums over frequency.
    powers = wavenumbers[:, None] ** np.arange(3)
    columns = [wave_columns(one) for one in slopes]
    scores, explained = [], []
    for field, (shape, order) in zip(fields, columns, strict=True):
        matched = (np.conj(field) * residual) @ powers
        scores.append((np.conj(shape) * matched[:, order]).real)
        explained.append(matched)
    ends = np.cumsum([shape.shape[1] for shape, _ in columns])
    sums = powers.sum(axis=0)

    def alone(field: Complex[np.ndarray, "elements freqs"]) -> Float[np.ndarray, "elements 3"]:
        """Sum |field|² kⁿ over frequency: the model's amplitude is the same at all of them."""
        size: np.ndarray = np.abs(field[:, 0]) ** 2
        return np.outer(size, sums)

    normal = np.zeros((ends[-1], ends[-1]))
    for i, (first, (shape, order)) in enumerate(zip(fields, columns, strict=True)):
        for j, (second, (other, higher)) in enumerate(zip(fields, columns, strict=True)):
            if j < i:
                continue
            product = (np.conj(first) * second) @ powers if i != j else alone(first)
            block = np.einsum(
                "mi,mj,mij->ij", np.conj(shape), other, product[:, np.add.outer(order, higher)]
            ).real
            rows = slice(ends[i] - len(order), ends[i])
            across = slice(ends[j] - len(higher), ends[j])
            normal[rows, across] = block
            normal[across, rows] = block.T
    hessian = normal.copy()
    for matched, slope, values, end in zip(explained, slopes, parameters, ends, strict=True):
        own = slice(end - 2 - len(values), end)
        hessian[own, own] -= curved_part(matched, slope, length_bends(uplink, values))
    return _Linear(
        gains=gains,
        fields=fields,
        slopes=slopes,
        normal=normal,
        hessian=hessian,
        scores=np.concatenate(scores, axis=1),
        residual=residual,
        bounds=[int(end) for end in ends[:-1]],
    )


def _inverse(normal: Float[np.ndarray, "all all"], starts: Sequence[WaveStart]) -> np.ndarray:
    """Invert JᵀJ, with its columns scaled to equal length."""
    scale = 1 / np.sqrt(np.diag(normal))
    scaled = normal * np.outer(scale, scale)
    if len(starts) > 1 and np.linalg.cond(scaled) > MOST_CONDITION:
        raise NoWaveError("two waves became one")
    try:
        inverse: np.ndarray = np.linalg.inv(scaled) * np.outer(scale, scale)
        if not np.all(np.diag(inverse) > 0):  # rounding alone told its columns apart
            raise np.linalg.LinAlgError
    except np.linalg.LinAlgError as error:  # two or three elements, or frequencies
        raise NoWaveError("the samples do not tell the wave's parameters apart") from error
    return inverse


def _described(
    uplink: Uplink,
    wavenumbers: Float[np.ndarray, " freqs"],
    parameters: Sequence[Float[np.ndarray, " _"]],
    starts: Sequence[WaveStart],
    state: _Linear,
) -> FittedWaves:
    bread = _inverse(state.normal, starts)
    noise = noise_variance(state.residual)
    meat = 0.5 * noise * state.normal
    ends = [*state.bounds, len(bread)]
    count = wavenumbers.size
    falling = np.sqrt(2) * np.cos(np.pi * (np.arange(count) + 0.5) / count)
    for field, slopes, end, start in zip(state.fields, state.slopes, ends, starts, strict=True):
        reached = slice(None) if start.lit is None else start.lit
        error = wavefront_error(state.residual[reached], field[reached], noise)
        # What an error of the phase alone does to Jᵀe: it has the columns' part along j·wave.
        power = np.abs(field) * np.sqrt(np.mean(np.abs(field) ** 2))
        for variance, shape in ((error.mean, np.ones(count)), (error.slope, falling)):
            plain = power @ shape
            weighted = power @ (wavenumbers * shape)
            columns = np.column_stack([0 * plain, plain, -weighted[:, None] * slopes])
            rows = slice(end - columns.shape[1], end)
            meat[rows, rows] += variance * columns.T @ columns
    keep = np.concatenate(
        [np.arange(end - len(values), end) for values, end in zip(parameters, ends, strict=True)]
    )
    covariance = (bread @ meat @ bread)[np.ix_(keep, keep)]
    covariance = 0.5 * (covariance + covariance.T)
    energy = float(np.vdot(uplink.samples, uplink.samples).real)
    waves = []
    last = 0
    for values, gain, field, start in zip(
        parameters, state.gains, state.fields, starts, strict=True
    ):
        own = slice(last, last := last + len(values))
        waves.append(
            SphericalWave(
                aoa=float(values[0]),
                path_length=float(values[1]),
                radius=float(values[-1]),
                gain=complex(gain),
                covariance=covariance[own, own],
                explained=float(np.vdot(field, field).real) / energy,
                lit=start.lit,
            )
        )
    return FittedWaves(
        waves=tuple(waves),
        covariance=covariance,
        white=0.5 * bread[np.ix_(keep, keep)],
        residual=state.residual,
    )
