r"""Thesis figure 4.1: the pattern of the user's Gaussian beam, equation (4-1).

Run as ``python -m validation.experiments.fig04_01_gaussian_beam [FILE.png]``; a second.

Correction: (4-1) is printed with the exponent :math:`(x-\mu)/2\sigma^2`, neither squared nor
negative: it would grow without bound to one side. The intended form is

.. math:: g(\psi) = e^{-(\psi - \mu)^2 / 2 \sigma^2} .

Left open there, chosen here: a standard width of 0.1 rad, as in the scenarios, of the field, not of
the power (that would be √2 narrower); a peak of 0 dBi, so that the beam's width does not change the
level on its axis; μ is the direction of the aim.

Simulated is the uplink of ``near_field_user`` without noise, with the user at 0.15 m from the
array's centre, where the array of 13 cm covers more than four standard widths to either side. An
element's signal times 4πR/λ is the pattern in its direction.

Claims that are asserted: that is (4-1) as corrected, over 70 dB; the half-power width is
twice √(ln 2) standard widths, 9.54°; the beam is even about its aim.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure
from scipy.constants import speed_of_light

from scenes.files.loading import load_scenario
from scenes.schema.antenna import GaussianBeam
from simulator.simulation import simulate
from validation.harness.claim import Row
from validation.harness.row_table import conclude_with_figure
from validation.metrics.point_response import peak_cut

DISTANCE = 0.15
USER = "beam_90"
ACCURACY = 1e-9
"""Largest error of the field over its closed form: double precision over a geometry of 0.15 m.
[-]"""
WIDTH_ACCURACY = 1e-3
"""Largest relative error of the half-power width, which is interpolated between elements 0.19°
apart, a fiftieth of it. [-]"""


@dataclass(frozen=True, kw_only=True)
class BeamPattern:
    """The simulated beam over the angle off its aim, and the closed form."""

    off_axis: Float[np.ndarray, " elements"]  # signed [rad]
    simulated: Float[np.ndarray, " elements"]  # field over an isotropic antenna's [-]
    closed_form: Float[np.ndarray, " elements"]  # (4-1), corrected [-]
    printed: Float[np.ndarray, " elements"]  # (4-1) as printed, 1 on the axis [-]
    sigma: float  # [rad]
    half_power_width: float  # measured [rad]

    @property
    def worst_error(self) -> float:
        """Largest error relative to the closed form. [-]."""
        return float(np.max(np.abs(self.simulated / self.closed_form - 1)))

    @property
    def unevenness_db(self) -> float:
        """Largest difference between the two sides. [dB]."""
        return float(np.max(np.abs(20 * np.log10(self.simulated / self.simulated[::-1]))))


def measure() -> BeamPattern:
    """Simulate the beam."""
    overrides = (
        f"users.{USER}.position_m=[0.0, {DISTANCE}]",
        "radio.points=2",
        "noise.snr_db=inf",
    )
    scenario = load_scenario("near_field_user", overrides)
    antenna = scenario.users[USER].antenna
    if not isinstance(antenna, GaussianBeam):
        raise RuntimeError(f"near_field_user: {USER} has a {antenna.kind}, not a Gaussian beam")
    uplinks = simulate(scenario, seed=0).measurement.uplinks
    (uplink,) = (one for one in uplinks if one.user == USER)
    rays = uplink.positions - scenario.users[USER].position
    length = np.linalg.norm(rays, axis=1)
    off_axis = np.arctan2(rays[:, 0], -rays[:, 1])
    wavelength = speed_of_light / uplink.frequencies
    field = np.abs(uplink.samples) * 4 * np.pi * length[:, None] / wavelength
    simulated = field.mean(axis=1)
    # Elements are evenly spaced along the array; the width needs an even grid of angles.
    even = np.linspace(off_axis[0], off_axis[-1], 4001)
    sigma = antenna.sigma_rad
    fine = np.exp(np.interp(even, off_axis, np.log(simulated)))
    return BeamPattern(
        off_axis=off_axis,
        simulated=simulated,
        closed_form=np.exp(-(off_axis**2) / (2 * sigma**2)),
        printed=np.exp(off_axis / (2 * sigma**2)),
        sigma=sigma,
        half_power_width=peak_cut(even, fine).width,
    )


def rows(result: BeamPattern) -> tuple[Row, ...]:
    """Return the figures with their limits."""
    width = float(np.degrees(2 * result.sigma * np.sqrt(np.log(2))))
    floor_db = float(20 * np.log10(result.closed_form.min()))
    return (
        Row(
            name=f"simulated field over (4-1), worst down to {floor_db:.0f} dB",
            stated="theory: exp(-(x-μ)²/2s²); the thesis prints exp((x-μ)/2s²)",
            measured=result.worst_error,
            high=ACCURACY,
            origin="double precision",
        ),
        Row(
            name="half-power width",
            stated=f"theory: 2s√(ln 2) = {width:.3f}°",
            measured=float(np.degrees(result.half_power_width)),
            unit="°",
            low=width * (1 - WIDTH_ACCURACY),
            high=width * (1 + WIDTH_ACCURACY),
            origin="interpolation between elements 0.19° apart",
        ),
        Row(
            name="largest difference between the beam's two sides",
            stated="theory: 0 dB; as printed the sides differ without bound",
            measured=result.unevenness_db,
            unit="dB",
            high=float(20 * np.log10(1 + 2 * ACCURACY)),
            origin="double precision",
        ),
    )


def draw(figure: Figure, result: BeamPattern) -> None:
    """Draw the pattern in decibels, and the field itself."""
    left, right = figure.subplots(1, 2)
    degrees = np.degrees(result.off_axis)
    curves = (
        (result.simulated, "-", "#30638e", "simulated uplink"),
        (result.closed_form, "--", "#e09f1f", "(4-1), exponent corrected"),
        (result.printed, ":", "#d1495b", "(4-1) as printed"),
    )
    for values, line, colour, label in curves:
        left.plot(degrees, 20 * np.log10(values), line, color=colour, label=label)
        right.plot(degrees, values, line, color=colour, label=label)
    half = float(np.degrees(result.half_power_width)) / 2
    for ax in (left, right):
        ax.axvspan(-half, half, color="0.92", zorder=0, label=f"half-power width {2 * half:.2f}°")
        ax.set_xlabel("angle off the aim [°]")
        ax.set_xlim(degrees[0], degrees[-1])
    left.set(ylabel="gain [dBi]", ylim=(-80, 6))
    right.set(ylabel="field over an isotropic antenna's [-]", ylim=(0, 1.15))
    left.legend(fontsize=8, loc="lower center")
    figure.suptitle(f"Gaussian beam, standard width of the field {result.sigma:g} rad", fontsize=11)


def main(arguments: list[str]) -> None:
    """Simulate, draw, print the figures and check them."""
    path = Path(arguments[0] if arguments else "fig04_01_gaussian_beam.png")
    result = measure()
    conclude_with_figure(path, (10, 4.2), lambda figure: draw(figure, result), rows(result))


if __name__ == "__main__":
    main(sys.argv[1:])
