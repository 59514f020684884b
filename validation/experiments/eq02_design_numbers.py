r"""Thesis equations (2-15) to (2-28) and (3-1) to (3-3): computed and measured numbers.

Run as ``python -m validation.experiments.eq02_design_numbers [FILE.png]``; some seconds.

Measured means: from the response of the imaging and the matched filter to one ideal point, in
closed form (:mod:`validation.analytic.point_scatterer`), or from the phases of that closed form.
Parameters of the thesis: 260 elements 0.5 mm apart (13 cm), 220-295 GHz in steps of 75 MHz for the
simulation, 220-329.98 GHz in 5500 points of 20 MHz for the laboratory, users at 1.8 m and 2.8 m.

What the thesis leaves open, and what was chosen: which width is meant (-3 dB of an untapered
aperture; the rounder c/2B is the distance from peak to first zero, and both are measured); the
wavelength in a cross-range width (the band's centre); D (260 spacings).

Corrections:

- cross-range of 11 mm at 1.8 m and 2.6 cm at 2.8 m: 0.886 λR/(nD), n = 1 for the uplink, is 14.3
  and 20.8 mm (n = 2, for the echo, half of that). 26 mm is λR/D at about 250 GHz; 11 mm agrees with
  no formula;
- the laboratory's 220-330 GHz are called 100 GHz with 1.5 mm of range resolution: 110 GHz, 1.36 mm;
- 'maximum range' c/(4Δf), 1 m and 3.75 m, in section 2.4.3 c/(2Δf), 1.5 m: complex samples repeat
  every c/(2Δf), 2 m, 7.5 m and 1.5 m;
- (2-22) asks for a spacing of λ/4 always: λ_min/(4 sin φ_max). 0.5 mm serves |sin φ| up to 0.5 at
  295 GHz;
- (2-24): a phase of 4πR/Δλ for each frequency step should be 4πRΔf/c;
- (3-3): far field R < 2D²/λ should be R > 2D²/λ. That is 24.8 m for 13 cm at 220 GHz: the 'far
  field' at 20 m is still radiating near field;
- (3-1) applies to a single radiator; for a synthetic aperture the bound is the distance at which
the
  wavefront's cubic term reaches π/8, and no field is reactive there.

Claims that are asserted: each measured number is theory's.
"""

import sys
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure
from scipy.constants import speed_of_light

from validation.design.design_numbers import (
    FAR,
    NEAR,
    SIMULATION,
    SPACING,
    DesignNumbers,
    Number,
    measured_numbers,
)
from validation.harness.claim import Row
from validation.harness.row_table import conclude_with_figure


def measure() -> DesignNumbers:
    """Measure every number."""
    return measured_numbers()


def rows(result: DesignNumbers) -> tuple[Row, ...]:
    """Return every number with that of theory and that of the thesis."""
    return tuple(
        Row(
            name=f"{one.name}, {one.equation}",
            stated=_stated(one),
            measured=one.measured,
            unit=one.unit,
            low=one.theory * (1 - one.within),
            high=one.theory * (1 + one.within),
            origin=f"theory ± {100 * one.within:.2g} %: {one.origin}",
        )
        for one in result.numbers
    )


def _stated(number: Number) -> str:
    unit = f" {number.unit}" if number.unit else ""
    parts = [f"theory: {number.theory:.4g}{unit}"]
    if number.thesis is not None:
        parts.append(f"thesis: {number.thesis:.4g}{unit}")
    if number.remark:
        parts.append(number.remark)
    return "; ".join(parts)


def draw(figure: Figure, result: DesignNumbers) -> None:
    """Draw the responses across range at both distances, along range, and over sin φ."""
    axes = figure.subplots(2, 2).flat
    for ax, distance in zip(axes, (NEAR, FAR), strict=False):
        cuts = [cut for cut in result.across if cut.name.endswith(f"{distance:g} m")]
        for cut, colour in zip(cuts, ("#30638e", "#e09f1f"), strict=True):
            label = f"{cut.name}: {1e3 * cut.peak.width:.1f} mm (theory {1e3 * cut.theory:.1f})"
            ax.plot(1e3 * cut.coordinate, _decibels(cut.magnitude), color=colour, label=label)
        if cuts[0].thesis is not None:
            half = 1e3 * cuts[0].thesis / 2
            ax.plot(
                [-half, half],
                [-3, -3],
                "|-",
                color="#d1495b",
                ms=10,
                label=f"thesis: {2 * half:.0f} mm",
            )
        ax.set(xlabel="across range [mm]", xlim=(-50, 50), title=f"point at {distance:g} m")
    ax = axes[2]
    for cut, colour in zip(result.along, ("#e09f1f", "#30638e", "#2c7a51"), strict=True):
        label = f"{cut.name}: {1e3 * cut.peak.width:.2f} mm (theory {1e3 * cut.theory:.2f})"
        ax.plot(1e3 * cut.coordinate, _decibels(cut.magnitude), color=colour, label=label)
    ax.set(xlabel="along range, or path length [mm]", xlim=(-8, 8), title="range cells")
    ax = axes[3]
    ax.plot(
        result.lobes.coordinate,
        _decibels(result.lobes.magnitude),
        color="#30638e",
        label=result.lobes.name,
    )
    limit = speed_of_light / float(SIMULATION[-1]) / (4 * SPACING)
    ax.axvspan(-limit, limit, color="0.92", zorder=0, label=f"unambiguous: |sin φ| < {limit:.3f}")
    ax.set(xlabel="sin φ off broadside [-]", title="grating lobe of a spacing of 0.5 mm")
    for ax in axes:
        ax.set(ylabel="magnitude relative to the peak [dB]", ylim=(-40, 12))
        ax.axhline(-3, color="0.7", lw=0.7, zorder=0)
        ax.legend(fontsize=8, loc="upper right")


def _decibels(magnitude: Float[np.ndarray, " samples"]) -> Float[np.ndarray, " samples"]:
    return np.asarray(20 * np.log10(np.maximum(magnitude, 1e-6)))


def main(arguments: list[str]) -> None:
    """Measure, draw, print the figures and check them."""
    path = Path(arguments[0] if arguments else "eq02_design_numbers.png")
    result = measure()
    conclude_with_figure(path, (11, 8), lambda figure: draw(figure, result), rows(result))


if __name__ == "__main__":
    main(sys.argv[1:])
