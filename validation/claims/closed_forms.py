"""The simulator against closed forms: canonical bodies, rough plates."""

import numpy as np
from matplotlib.figure import Figure
from scipy.constants import speed_of_light

from validation.analytic.canonical_scatterers import (
    cylinder_echo_over_series,
    facets_cross_section,
    mean_specular_field,
    plate_cross_section,
    plate_facets,
)
from validation.harness.claim import Claim, Effort, Finding, Row, Tell

COHERENT_LEVELS = (0.0, 0.3, 0.6, 0.9, 1.2)  # k·rms·cosθ of the rough plates


def bodies(effort: Effort, tell: Tell) -> Finding:
    """Compare a plate's and a cylinder's echo with their closed form and series."""
    width, height, band = 30e-3, 20e-3, np.linspace(220e9, 295e9, 4)
    wavelengths = speed_of_light / band
    distance = 20 * (width**2 + height**2) / wavelengths[-1]
    degrees = np.linspace(-25.0, 25.0, 121)
    angles = np.radians(degrees)
    outward = np.stack([np.sin(angles), -np.cos(angles), np.zeros(angles.size)], axis=-1)
    expected = plate_cross_section((width, height), outward, wavelengths)
    step = 0.25 * float(wavelengths[-1])
    measured = facets_cross_section(plate_facets(width, height, step=step), outward, distance, band)
    tell(1, 2)
    above = expected > expected.max(axis=0) * 10**-2.5
    errors = 10 * np.log10(measured[above] / expected[above])
    peak = 10 * np.log10(measured[60] / (4 * np.pi * (width * height / wavelengths) ** 2))
    ratio = cylinder_echo_over_series()
    tell(2, 2)
    rows = [
        Row(
            name="plate: peak against 4πA²/λ²",
            stated="4πA²/λ²",
            measured=float(np.abs(peak).max()),
            unit="dB",
            high=0.02,
            origin="curvature of the wave at 20 D²/λ: a 160th of a wavelength at the corners",
        ),
        Row(
            name="plate: pattern above −25 dB",
            stated="cos²θ sinc²: physical optics in closed form",
            measured=float(np.abs(errors).max()),
            unit="dB",
            high=0.2,
            origin="the same curvature, where the pattern nears its nulls",
        ),
        Row(
            name="cylinder: echo level against its series, ka ≥ 20",
            stated="Bessel series, TM",
            measured=float(np.abs(20 * np.log10(np.abs(ratio))).max()),
            unit="dB",
            high=0.5,
            origin="physical optics ends at the shadow's edge: 1/(2ka) of the field",
        ),
        Row(
            name="cylinder: echo phase against its series",
            stated="Bessel series, TM",
            measured=float(np.abs(np.angle(ratio)).max()),
            unit="rad",
            high=0.06,
            origin="the same, and the next order in 1/(ka) = 0.04",
        ),
    ]

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.plot(degrees, 10 * np.log10(expected[:, 0]), "k", label="closed form")
        axes.plot(degrees, 10 * np.log10(measured[:, 0]), "--", label="facets")
        axes.set(
            title=f"plate of {width * 1e3:g} × {height * 1e3:g} mm at {band[0] / 1e9:g} GHz",
            xlabel="angle from the normal [°]",
            ylabel="radar cross-section [dB re 1 m²]",
            ylim=(10 * np.log10(expected[:, 0].max()) - 50, None),
        )
        axes.grid(alpha=0.3)
        axes.legend()

    return Finding(rows=rows, draw=draw)


def coherent_loss(effort: Effort, tell: Tell) -> Finding:
    """Average the specular field of rough plates over realisations."""
    side, length = 50e-3, 1e-3
    draws = 20 if effort == "full" else 3
    levels = np.array(COHERENT_LEVELS)
    measured = mean_specular_field(levels, side=side, length=length, draws=draws, advance=tell)
    expected = np.exp(-2 * levels**2)
    patches = draws * (side / length) ** 2
    # Near k·rms·cosθ = 1 the field decorrelates over half the square of a correlation length.
    scatter = 1 / np.sqrt(2 * patches) / expected
    rows = [
        Row(
            name=f"mean specular field at k·rms·cosθ = {level:g}",
            stated="exp(−2(k·rms·cosθ)²)",
            measured=float(value / loss),
            low=0.9,
            high=1.1,
            origin="10 % as asked for; the mean of so many patches scatters by "
            f"{100 * spread:.1f} %",
        )
        # With few draws the largest loss is below its statistical error: full form only.
        for level, value, loss, spread in zip(levels, measured, expected, scatter, strict=True)
        if level > 0 and spread < 0.06
    ]

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        fine = np.linspace(0, 1.3, 100)
        axes.plot(fine, 20 * np.log10(np.exp(-2 * fine**2)), "k", label="exp(−2(k·rms·cosθ)²)")
        axes.plot(levels, 20 * np.log10(measured), "o", label=f"mean of {patches:.0f} patches")
        axes.set(xlabel="k · rms · cosθ [-]", ylabel="specular field over a smooth plate's [dB]")
        axes.grid(alpha=0.3)
        axes.legend()

    return Finding(rows=rows, draw=draw)


CLAIMS = (
    Claim(
        key="canonical_bodies",
        title="Facets scatter like plate and cylinder",
        source="physical optics of a plate; series of a conducting cylinder",
        measure=bodies,
    ),
    Claim(
        key="coherent_loss",
        title="Roughness takes the coherent loss from the specular field",
        source="Kirchhoff approximation, Gaussian heights",
        measure=coherent_loss,
        minutes=3.0,
    ),
)
