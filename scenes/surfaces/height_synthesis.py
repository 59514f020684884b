r"""Frozen realisations of rough surfaces, by spectral synthesis.

Heights are a Gaussian random field, a sum of waves with independent random amplitudes,

.. math:: h(x) = \sum_j a_j \cos(k_j \cdot x) + b_j \sin(k_j \cdot x),
          \qquad \langle a_j^2 \rangle = \langle b_j^2 \rangle = \sigma^2 W(k_j),

with :math:`W` the spectrum of the heights, normalised to 1 over all waves. Only the
*expectation* is normalised: like real walls, realisations differ in their own rms.

===============  ==============================  =======================================
spectrum         correlation function            :math:`W(k)` in d dimensions, to a factor
===============  ==============================  =======================================
``gaussian``     :math:`\sigma^2 e^{-s^2/l^2}`   :math:`e^{-k^2 l^2/4}`
``exponential``  :math:`\sigma^2 e^{-s/l}`       :math:`(1+k^2l^2)^{-(d+1)/2} e^{-k^2c^2/4}`
``power_law``    Matérn's of order H             :math:`(1+k^2l^2)^{-d/2-H} e^{-k^2c^2/4}`
===============  ==============================  =======================================

These surfaces would have unbounded slopes; the inner cut-off :math:`c` smooths their
correlation function by :math:`e^{-s^2/c^2}`, and the total variance stays :math:`\sigma^2`.

The waves depend on the size and the statistics alone, not on the number of samples: more
samples of the same stream sample the *same surface* more finely.
"""

import math

import numpy as np
from jaxtyping import Float

from scenes.schema.roughness import Roughness, Spectrum

NEGLIGIBLE = 1e-12
"""Waves weaker than this, relative to the strongest, are left out: 1e-6 of an amplitude [-]."""

SHARE_STEPS = 2000
"""Steps of an integral over the spectrum: a hundredth of a wavenumber each. [-]"""

_REACH = {"gaussian": 4.0, "exponential": 12.0, "power_law": 15.0}
"""Correlation lengths after which the correlation is below 1e-5 [-]."""


def rough_profile(
    *,
    length: float,
    count: int,
    rms: float,
    correlation_length: float,
    spectrum: Spectrum,
    inner_cutoff: float,
    rng: np.random.Generator,
    hurst: float = 0.5,
    periodic: bool = False,
) -> Float[np.ndarray, " count"]:
    """Draw the heights of a rough line.

    Parameters
    ----------
    length
        Length of the line. [m]
    count
        Number of equally spaced heights: from end to end, both included; on a periodic line
        the end is the start again and is left out.
    rms
        Root mean square of the heights, in the expectation. [m]
    correlation_length
        Distance at which the correlation has fallen to 1/e. [m]
    spectrum
        ``"gaussian"``, ``"exponential"`` or ``"power_law"``.
    inner_cutoff
        Length below which the surface is smooth; not used for a Gaussian spectrum. [m]
    hurst
        Exponent H of a power law; not used for others. [-]
    rng
        The stream of this surface.
    periodic
        Whether the line closes on itself (a circumference); else it is cut from a period so
        much longer that the heights at its two ends are uncorrelated.

    Returns
    -------
    Heights over the mean line. [m]

    Raises
    ------
    ValueError
        If a size is not positive, or an exponential spectrum lacks its cut-off.
    """
    _check(rms, correlation_length, spectrum, inner_cutoff)
    axis = _Axis(length, count, correlation_length, spectrum, inner_cutoff, periodic)
    wavenumber = axis.wavenumber * np.arange(axis.waves + 1)
    power = _power(wavenumber**2, 1, correlation_length, spectrum, inner_cutoff, hurst)
    power[1:] *= 2  # k and -k
    amplitude = rms * np.sqrt(power / power.sum())
    parts = rng.standard_normal((axis.waves + 1, 2))
    waves = amplitude * (parts[:, 0] + 1j * parts[:, 1])
    waves[1:] /= 2  # the inverse transform adds the conjugate
    heights = np.fft.irfft(waves, n=axis.grid, norm="forward")
    return np.ascontiguousarray(heights[axis.kept])


def rough_sheet(
    *,
    lengths: tuple[float, float],
    counts: tuple[int, int],
    rms: float,
    correlation_length: float,
    spectrum: Spectrum,
    inner_cutoff: float,
    rng: np.random.Generator,
    hurst: float = 0.5,
    periodic: tuple[bool, bool] = (False, False),
) -> Float[np.ndarray, "first second"]:
    """Draw the heights of a rough rectangle with isotropic statistics.

    Parameters
    ----------
    lengths
        Its two sides. [m]
    counts
        Number of heights along each; see :func:`rough_profile`.
    rms, correlation_length, spectrum, inner_cutoff, rng, hurst
        See :func:`rough_profile`.
    periodic
        Which of the two directions close on themselves (a cylinder's side).

    Returns
    -------
    Heights over the mean plane. [m]

    Raises
    ------
    ValueError
        If a size is not positive, or an exponential spectrum lacks its cut-off.
    """
    _check(rms, correlation_length, spectrum, inner_cutoff)
    first, second = (
        _Axis(length, count, correlation_length, spectrum, inner_cutoff, closed)
        for length, count, closed in zip(lengths, counts, periodic, strict=True)
    )
    order = np.concatenate([np.arange(first.waves + 1), np.arange(-first.waves, 0)])
    across = first.wavenumber * order
    along = second.wavenumber * np.arange(second.waves + 1)
    squared = across[:, None] ** 2 + along**2
    power = _power(squared, 2, correlation_length, spectrum, inner_cutoff, hurst)
    power[:, 1:] *= 2  # k and -k
    parts = rng.standard_normal((*power.shape, 2))
    waves = parts[..., 0] + 1j * parts[..., 1]
    waves *= rms * np.sqrt(power / power.sum())
    waves[:, 1:] /= 2  # the inverse transform adds the conjugate
    padded = np.zeros((first.grid, second.waves + 1), dtype=np.complex128)
    padded[order] = waves
    rows = np.fft.ifft(padded, axis=0, norm="forward")[first.kept]
    heights = np.fft.irfft(rows, n=second.grid, axis=1, norm="forward")
    return np.ascontiguousarray(heights[:, second.kept])


def slope_share(roughness: Roughness | None, width: float) -> float:
    r"""Share of the slopes' variance that is left when a surface is smoothed.

    .. math:: g = \frac{\int k^3 W(k)\, e^{-k^2 w^2}\, dk}{\int k^3 W(k)\, dk}

    Parameters
    ----------
    roughness
        Statistics of its heights; None: of unknown ones nothing is smoothed.
    width
        Standard width w of the Gaussian that smooths along each direction. [m]

    Returns
    -------
    The share g: 1 if the correlation length is much longer than the width, 0 if it is much
    shorter. [-]
    """
    if roughness is None or roughness.rms == 0 or width == 0:
        return 1.0
    if roughness.measured is not None:
        return roughness.measured.slope_share(width)
    left, whole = 0.0, 0.0
    for scale in roughness.scales:
        finest = scale.inner_cutoff or scale.correlation_length
        top = 2.0 * math.sqrt(-math.log(NEGLIGIBLE)) / finest
        wavenumbers = np.geomspace(1e-3 / scale.correlation_length, top, SHARE_STEPS)
        power = _power(
            wavenumbers**2,
            2,
            scale.correlation_length,
            scale.spectrum,
            scale.inner_cutoff,
            scale.hurst,
        )
        power *= scale.rms_mm**2 / np.trapezoid(power * wavenumbers**2, np.log(wavenumbers))
        slopes = power * wavenumbers**4
        smoothed = slopes * np.exp(-((wavenumbers * width) ** 2))
        whole += float(np.trapezoid(slopes, np.log(wavenumbers)))
        left += float(np.trapezoid(smoothed, np.log(wavenumbers)))
    return left / whole


class _Axis:
    """One direction of the synthesis: its period, its waves, and the samples to keep."""

    def __init__(
        self,
        length: float,
        count: int,
        correlation_length: float,
        spectrum: Spectrum,
        inner_cutoff: float,
        periodic: bool,
    ) -> None:
        fewest = 1 if periodic else 2
        if not (math.isfinite(length) and length > 0 and count >= fewest):
            raise ValueError(
                f"a rough surface of {length} m with {count} heights cannot be drawn; "
                f"the length must be positive, and at least {fewest} heights are needed"
            )
        # Cut from a period that is a whole multiple of the length, so that equal steps fit
        # into it, and long enough that the two ends are uncorrelated across the periodic boundary.
        seam = _REACH[spectrum] * correlation_length
        periods = 1 if periodic else max(2, 1 + math.ceil(seam / length))
        steps = count if periodic else periods * (count - 1)
        finest = correlation_length if spectrum == "gaussian" else inner_cutoff
        steepest = 2.0 * math.sqrt(-math.log(NEGLIGIBLE)) / finest
        self.wavenumber = 2.0 * math.pi / (periods * length)
        self.waves = math.ceil(steepest / self.wavenumber)
        finer = 2 * self.waves // steps + 1  # samples coarser than the waves: keep every n-th
        self.grid = finer * steps
        self.kept = slice(0, finer * (count - 1) + 1, finer)


def _power(
    wavenumber_squared: Float[np.ndarray, "*waves"],
    dimensions: int,
    correlation_length: float,
    spectrum: Spectrum,
    inner_cutoff: float,
    hurst: float,
) -> Float[np.ndarray, "*waves"]:
    scaled = wavenumber_squared * correlation_length**2
    if spectrum == "gaussian":
        return np.exp(-scaled / 4)
    smooth = np.exp(-wavenumber_squared * inner_cutoff**2 / 4)
    order = 0.5 if spectrum == "exponential" else hurst
    return smooth * (1 + scaled) ** (-(dimensions + 2 * order) / 2)


def _check(rms: float, correlation_length: float, spectrum: Spectrum, inner_cutoff: float) -> None:
    if not (math.isfinite(rms) and rms >= 0):
        raise ValueError(f"rms = {rms} m must be zero or more; give a height")
    if not (math.isfinite(correlation_length) and correlation_length > 0):
        raise ValueError(f"correlation_length = {correlation_length} m must be positive")
    if spectrum != "gaussian" and not (math.isfinite(inner_cutoff) and inner_cutoff > 0):
        raise ValueError(
            f"inner_cutoff = {inner_cutoff} m must be positive: such a spectrum ({spectrum}) has "
            "unbounded slopes; give the length below which the surface is smooth"
        )
