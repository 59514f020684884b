r"""Channels in the axis order of Sionna PHY, from a measurement's pilots or from a scenario.

Sionna PHY takes a channel impulse response as coefficients and delays, or a frequency response over
the subcarriers of an OFDM symbol. The users are its transmitters of one antenna each, the array is
its receiver. A frozen diffuse background is no sum of a few rays, so that the delays are a grid:
with N subcarriers :math:`\Delta f` apart, the taps

.. math:: a_n = \frac1N \sum_k H(f_k) e^{+j 2 \pi (f_k - f_c) \tau_n}, \qquad
          \tau_n = \frac{n}{N \Delta f}

give back the frequency response of every element exactly at the subcarriers, near field and all:
:math:`H(f_k) = \sum_n a_n e^{-j 2 \pi (f_k - f_c) \tau_n}`. Delays count modulo
:math:`1/\Delta f`, as in any OFDM symbol.
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Complex, Complex64, Float, Float32

from estimator.measurement import model
from estimator.measurement.model import MeasurementError, Uplink
from mmslam.pipeline import simulate
from scenes.scenario import Noise, Scenario

Source = model.Measurement | Scenario


class SionnaChannel(NamedTuple):
    """A channel in the axis order of Sionna PHY; ``a`` and ``tau`` first, as it takes them.

    Examples
    --------
    >>> import mmslam
    >>> small = {"radio.points": 5, "base_station.elements": 4}
    >>> channel = mmslam.to_sionna_cir(mmslam.load_scenario("slam_2d", small))
    >>> channel.a.shape, channel.tau.shape
    ((1, 1, 4, 1, 1, 5, 1), (1, 1, 4, 1, 1, 5))
    """

    a: (
        Complex64[np.ndarray, "batch 1 elements users 1 taps 1"]
        | Complex[np.ndarray, "batch 1 elements users 1 taps 1"]
    )
    """Coefficients: batch, receiver, antennas, transmitters, antennas, paths, times. [-]"""
    tau: (
        Float32[np.ndarray, "batch 1 elements users 1 taps"]
        | Float[np.ndarray, "batch 1 elements users 1 taps"]
    )
    """Delays of the taps, for each pair of antennas. [s]"""
    cfr: (
        Complex64[np.ndarray, "batch 1 elements users 1 1 subcarriers"]
        | Complex[np.ndarray, "batch 1 elements users 1 1 subcarriers"]
    )
    """Frequency response: batch, receiver, antennas, transmitters, antennas, times, subcarriers."""
    frequencies: Float[np.ndarray, " subcarriers"]  # of the subcarriers, over the carrier's [Hz]
    carrier: float  # [Hz]
    users: tuple[str, ...]  # the transmitters' names, in their order


def to_sionna_cir(
    source: Source | Sequence[Source],
    *,
    seed: int = 0,
    precision: Literal["single", "double"] = "single",
) -> SionnaChannel:
    """Return the channel between users and array as Sionna PHY takes it.

    Parameters
    ----------
    source
        A measurement with pilots, or a scenario, which is simulated without noise; or several of
        equal users, array and band, which become the batch.
    seed
        Of the roughness of scenarios; the n-th of several has ``seed`` + n.
    precision
        Of the arrays, as Sionna PHY's own setting: ``"single"`` or ``"double"``.

    Returns
    -------
    ``a, tau, cfr, frequencies, carrier, users``. The frequencies are those of Sionna's
    ``subcarrier_frequencies``: of N subcarriers, the carrier is number N // 2, counted from 0.

    Raises
    ------
    MeasurementError
        If there are no pilots, or those of the batch differ in users, elements or frequencies.

    Examples
    --------
    >>> import numpy as np
    >>> import mmslam
    >>> array = {"frequencies": np.linspace(27.9e9, 28.1e9, 64), "positions": np.arange(4) * 5e-3}
    >>> measured = mmslam.Measurement.from_arrays(**array, uplink=np.ones((4, 64), complex))
    >>> channel = mmslam.to_sionna_cir(measured)
    >>> channel.a.shape, channel.tau.shape, channel.cfr.shape
    ((1, 1, 4, 1, 1, 64, 1), (1, 1, 4, 1, 1, 64), (1, 1, 4, 1, 1, 1, 64))
    """
    sources = [source] if isinstance(source, model.Measurement | Scenario) else list(source)
    pilots = [_pilots(one, seed + number) for number, one in enumerate(sources)]
    if not pilots:
        raise MeasurementError("no measurement is given; give at least one")
    for number, others in enumerate(pilots):
        _refuse_different(pilots[0], others, number)
    frequencies = pilots[0][0].frequencies
    count = frequencies.size
    carrier = float(frequencies[count // 2])
    step = float(frequencies[-1] - frequencies[0]) / max(count - 1, 1)
    offsets = (np.arange(count) - count // 2) * step
    # [batch, users, elements, subcarriers], then Sionna's order
    samples = np.array([[pilot.samples for pilot in some] for some in pilots])
    response = np.moveaxis(samples, 1, 2)[:, None, :, :, None, None, :]
    delays = np.arange(count) / (count * step) if step > 0 else np.zeros(1)
    taps = np.fft.ifft(np.fft.ifftshift(response, axes=-1), axis=-1)
    kinds = (np.complex64, np.float32) if precision == "single" else (np.complex128, np.float64)
    taps = np.moveaxis(taps, -1, -2).astype(kinds[0])
    return SionnaChannel(
        a=taps,
        tau=np.broadcast_to(delays, (*taps.shape[:5], delays.size)).astype(kinds[1]),
        cfr=response.astype(kinds[0]),
        frequencies=offsets,
        carrier=carrier,
        users=tuple(pilot.user for pilot in pilots[0]),
    )


def _pilots(source: Source, seed: int) -> tuple[Uplink, ...]:
    if isinstance(source, Scenario):
        quiet = source.model_copy(update={"noise": Noise()})
        source = simulate(quiet, seed=seed)
    if not source.uplinks:
        raise MeasurementError(
            f"{source.scenario or 'the measurement'} holds no pilot of a user, and a channel is "
            "one between users and array; give a scenario with [users], or a measurement of them"
        )
    return source.uplinks


def _refuse_different(first: tuple[Uplink, ...], other: tuple[Uplink, ...], number: int) -> None:
    """Refuse what does not fit into one batch."""
    names = [tuple(pilot.user for pilot in some) for some in (first, other)]
    if names[0] != names[1]:
        raise MeasurementError(
            f"measurement {number} has the users {', '.join(names[1])}, the first one "
            f"{', '.join(names[0])}; a batch needs the same ones"
        )
    for one, two in zip(first, other, strict=True):
        if one.samples.shape != two.samples.shape or not np.allclose(
            one.frequencies, two.frequencies, rtol=1e-12, atol=0.0
        ):
            raise MeasurementError(
                f"measurement {number}, user {two.user!r}: {two.samples.shape[0]} elements and "
                f"{two.frequencies.size} frequencies from {two.frequencies[0] / 1e9:g} GHz; the "
                f"first one has {one.samples.shape[0]} and {one.frequencies.size} from "
                f"{one.frequencies[0] / 1e9:g} GHz; a batch needs the same"
            )
