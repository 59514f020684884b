r"""Over which roughness the ray-traced model may be trusted: simulator against full wave.

Run as ``python -m validation.experiments.full_wave_roughness [FIGURE.png [FOLDER]]``. It takes some
ten minutes on two cores, and continues where it was stopped if FOLDER is given.

Not in the thesis, which calculates with full waves only. A conducting wall of 8 cm takes the
place of its 40 cm; all else is the scene of its figures 4.9 to 4.12: the wall 0.8 m away and
turned by 45°, an aperture of 13 cm, 220 to 295 GHz, a user 1 m behind the wall with a beam of
0.1 rad. Positions 1 mm apart and 501 frequencies do for so short a wall, and the fields are
solved for at some 90 of them (:mod:`validation.full_wave.band_interpolation`). For each rms height
and correlation length (Gaussian) the same frozen realisations are given to the simulator, as a
scenario, and to the method of moments; cylindrical waves, no noise. What is compared, over all
realisations at once, by magnitude of the complex correlation and by level, simulated over full
wave:

- the echo, of the wall with its edges, which count five times as much as those of the thesis'
  wall;
- the back-projected image within 1 cm of the wall but for its outer 1.5 cm: the rough wall alone,
  and the measure of whether walls are imaged as they should be;
- the uplink.

Three limits are known. Small heights scatter into the echo as perturbation theory says, with an
amplitude of :math:`2 k^2 \cos^2\theta` times the transform of the heights for TM and a conductor;
physical optics has :math:`2 k^2`, since :math:`|\mathbf q|^2 = 4` in an echo. So the simulator is
6.02 dB too bright at 45°, whatever the spectrum. Towards the mirror direction :math:`|\mathbf
q|^2 = 4 \cos^2\theta` and both agree: the uplink is right wherever heights are small. And where
next to nothing is left of the Bragg wave, :math:`2k\sin\theta` along the wall, only the edges
echo: :math:`1 - 1/\cos\varphi` in Keller's theory, :math:`\tan\varphi` in physical optics, with
:math:`\varphi` of 45° at one edge and 135° at the other; in power 2 against 6, -4.77 dB. In
between, tilted mirrors on long waves echo, which is what physical optics is made for.

Claims that are asserted:

- A stored full-wave solution by another author's code, of a 40 cm wall with other draws whose edges
  hardly count, has an echo's correlation and level of 0.993 and 1.1 dB at 0.15 mm, 1.0 mm; 0.970
  and 4.5 dB at 0.05 mm, 0.3 mm; 0.978 and 1.0 dB at 0.10 mm, 1.0 mm; 0.993 and 0.7 dB at 0.20 mm,
  1.0 mm. The 4.5 dB are of a wall whose near and brighter half is seen at 33 to 45°, where the
  limit is 3.1 to 6.0 dB; the short wall's 45° lie between 4.5 and 6.0 dB, and 5.3 dB are claimed.
  The image is held against these (:data:`CLAIMS`); it has a fifth of the speckles, so 0.02 of the
  correlation and 1 dB are allowed for.
- Where heights are small and short (:data:`BRAGG`), the image is too bright by 6.02 ± 0.5 dB,
  for terms of higher order, :math:`(2k\sigma\cos\theta)^2 = 0.02`, and the edges' sidelobes.
- Where the wall is all but smooth (:data:`EDGES`), the echo is too faint by 4.77 ± 0.5 dB, for
  edges seen at 43 and 47°, the nearer one 0.3 dB brighter, and what roughness is left.
- Up to 0.10 mm rms the uplink's correlation is at least 0.99: heights turn the mirrored wave by
  :math:`2k\sigma\cos\theta = 0.8` rad, and physical optics errs in the second order of slopes.
"""

import csv
import itertools
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Complex, Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from estimator.imaging.backprojection import backproject
from estimator.measurement.model import Echo
from scenes.files.loading import load_scenario
from scenes.scenario import Scenario
from scenes.schema.objects import Plate
from simulator.simulation import simulate
from validation.experiments.full_wave_localization import USER, WALL, strip_scene
from validation.full_wave.band_interpolation import band_fields

Part = Literal["echo", "image", "uplink"]
PARTS: tuple[Part, ...] = ("echo", "image", "uplink")

RMS_MM = (0.02, 0.05, 0.10, 0.15, 0.20, 0.30)
CORRELATION_MM = (0.2, 0.3, 0.5, 1.0, 2.0)
STATISTICS = tuple(itertools.product(RMS_MM, CORRELATION_MM))
QUICK = ((0.02, 0.2), (0.02, 2.0), (0.15, 1.0))
"""Statistics of the quick variant, for one realisation: Bragg waves, edges, and where physical
optics is at home."""

REALISATIONS = 2

SHORT_WALL = (
    "waves=cylindrical",
    "noise.snr_db=inf",
    "radio.points=501",
    "base_station.elements=131",
    "base_station.spacing_mm=1.0",
    f"objects.{WALL}.length_m=0.08",
)
"""Overrides of ``slam_2d``."""

EDGE, DEPTH, PIXEL = 0.015, 0.01, 0.001
"""What is left out of the image at each end of the wall; its depth to either side of it; a
pixel, half a range resolution. [m]"""

TRUSTED_CORRELATION, TRUSTED_LEVEL_DB = 0.95, 2.0
"""From where on a part of the measurement counts as trusted. At 0.95 a matched filter loses 5 %
of the amplitude; 2 dB is the simulator's own limit against the stored reference. [-], [dB]"""

MOST_ERROR = 0.01
"""Of the full-wave fields over frequency: 5e-5 of a correlation. [-]"""

CORRELATION_TOLERANCE, LEVEL_TOLERANCE_DB = 0.02, 1.0
CLAIMS = {
    (0.15, 1.0): (0.993, 1.1),
    (0.05, 0.3): (0.970, 5.3),
    (0.10, 1.0): (0.978, 1.0),
    (0.20, 1.0): (0.993, 0.7),
}
"""Echo's correlation and level in dB, simulated over full wave; from the stored solution. [-]"""

BRAGG = ((0.02, 0.2), (0.02, 0.3))
BRAGG_DB = float(20 * np.log10(1 / np.cos(np.pi / 4) ** 2))
"""Physical optics over perturbation theory, at an incidence of 45°. [dB]"""

EDGES = ((0.02, 2.0),)
EDGES_DB = float(
    10 * np.log10(2 / ((1 - 1 / np.cos(np.pi / 4)) ** 2 + (1 + 1 / np.cos(np.pi / 4)) ** 2))
)
"""Physical optics over Keller's theory, of both edges at 45°. [dB]"""

LIMIT_TOLERANCE_DB = 0.5

SMALL_RMS_MM, SMALL_RMS_UPLINK = 0.10, 0.99


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Simulator against full wave at one roughness."""

    rms_mm: float
    correlation_mm: float
    echo: float  # magnitude of the complex correlation [-]
    echo_level_db: float  # simulated over full wave
    uplink: float
    uplink_level_db: float
    image: float
    image_level_db: float

    def trusted(self, part: Part) -> bool:
        """Whether one part of the measurement is good enough."""
        level = abs(getattr(self, f"{part}_level_db"))
        correlation = float(getattr(self, part))
        return correlation >= TRUSTED_CORRELATION and level <= TRUSTED_LEVEL_DB


def compare(
    rms_mm: float,
    correlation_mm: float,
    *,
    realisations: int = REALISATIONS,
    overrides: tuple[str, ...] = (),
    folder: Path | None = None,
) -> Comparison:
    """Compare at one roughness.

    Parameters
    ----------
    rms_mm, correlation_mm
        Gaussian statistics. [mm]
    realisations
        Draws of the wall; seed 0 is the first.
    overrides
        More of them.
    folder
        Keeps what was solved.
    """
    roughness = (
        f"objects.{WALL}.roughness.rms_mm={rms_mm}",
        f"objects.{WALL}.roughness.correlation_mm={correlation_mm}",
    )
    scenario = load_scenario("slam_2d", (*SHORT_WALL, *roughness, *overrides))
    echoes, uplinks, images = [], [], []
    for seed in range(realisations):
        frequencies = scenario.radio.frequencies
        scene = strip_scene(scenario, seed=seed)
        solved = band_fields(scene, frequencies, most_error=MOST_ERROR, folder=folder)
        measured = simulate(scenario, seed=seed).measurement
        assert measured.echo is not None
        pilots = {one.user: one.samples for one in measured.uplinks}
        echoes.append((measured.echo.samples, solved.echo))
        uplinks.append((pilots[USER], solved.uplinks[0]))
        images.append([wall_image(scenario, echo) for echo in echoes[-1]])
    echo, echo_level = agreement(*np.stack(echoes, axis=1))
    uplink, uplink_level = agreement(*np.stack(uplinks, axis=1))
    image, image_level = agreement(*np.stack(images, axis=1))
    return Comparison(
        rms_mm=rms_mm,
        correlation_mm=correlation_mm,
        echo=echo,
        echo_level_db=echo_level,
        uplink=uplink,
        uplink_level_db=uplink_level,
        image=image,
        image_level_db=image_level,
    )


def wall_image(
    scenario: Scenario, samples: Complex[np.ndarray, "positions freqs"]
) -> Complex[np.ndarray, "along across"]:
    """Back-project an echo along the wall, on a grid that lies in the wall's frame."""
    plate = scenario.objects[WALL]
    assert isinstance(plate, Plate)
    half = plate.length_m / 2 - EDGE
    along = np.linspace(-half, half, round(2 * half / PIXEL) + 1)
    across = np.linspace(-DEPTH, DEPTH, round(2 * DEPTH / PIXEL) + 1)
    pixels = (
        plate.centre + along[:, None, None] * plate.tangent + across[None, :, None] * plate.normal
    )
    echo = Echo(
        samples=samples,
        positions=scenario.base_station.element_positions,
        frequencies=scenario.radio.frequencies,
    )
    return backproject(echo, pixels)


def agreement(
    simulated: Complex[np.ndarray, "*n"], full_wave: Complex[np.ndarray, "*n"]
) -> tuple[float, float]:
    """Return the magnitude of the complex correlation, and the level of the first in dB."""
    norms = float(np.linalg.norm(simulated)), float(np.linalg.norm(full_wave))
    correlation = float(abs(np.vdot(simulated, full_wave))) / (norms[0] * norms[1])
    return correlation, float(20 * np.log10(norms[0] / norms[1]))


def trust_map(
    statistics: tuple[tuple[float, float], ...] = STATISTICS,
    *,
    realisations: int = REALISATIONS,
    folder: Path | None = None,
    advance: Callable[[Comparison], None] = lambda comparison: None,
) -> tuple[Comparison, ...]:
    """Compare over rms heights and correlation lengths; :data:`QUICK` is the quick variant."""
    done = []
    for rms, length in statistics:
        done.append(compare(rms, length, realisations=realisations, folder=folder))
        advance(done[-1])
    return tuple(done)


def draw(comparisons: tuple[Comparison, ...]) -> Figure:
    """Draw the map in a figure of its own."""
    figure = plt.figure(figsize=(14, 8), layout="constrained")
    draw_on(figure, comparisons)
    return figure


def draw_on(figure: Figure, comparisons: tuple[Comparison, ...]) -> None:
    """Draw the map: six panels with their numbers, and what is trusted within a line."""
    axes = figure.subplots(2, 3)
    titles: tuple[tuple[Part, str], ...] = (
        ("image", "image of the wall, without edges"),
        ("echo", "echo, its edges included"),
        ("uplink", "uplink"),
    )
    for column, (name, title) in enumerate(titles):
        _draw_panel(axes[0, column], comparisons, name, f"{title}: correlation", level=False)
        level = f"{name}: simulated over full wave [dB]"
        _draw_panel(axes[1, column], comparisons, name, level, level=True)
    figure.suptitle(
        "Where the ray-traced model may be trusted: conducting wall, 220 to 295 GHz, 45°, TM,\n"
        "against a method of moments on the same frozen profiles.\n"
        f"Outlined: correlated by {TRUSTED_CORRELATION:g} or more and within "
        f"{TRUSTED_LEVEL_DB:g} dB. Lower left: Bragg scattering ({BRAGG_DB:+.1f} dB);\n"
        f"upper left: only the edges echo ({EDGES_DB:+.1f} dB)."
    )


def _draw_panel(
    ax: Axes, comparisons: tuple[Comparison, ...], part: Part, title: str, *, level: bool
) -> None:
    heights = sorted({one.rms_mm for one in comparisons})
    lengths = sorted({one.correlation_mm for one in comparisons})
    values: Float[np.ndarray, "lengths heights"] = np.full((len(lengths), len(heights)), np.nan)
    limits = (-6.0, 6.0) if level else (0.5, 1.0)
    for one in comparisons:
        row, column = lengths.index(one.correlation_mm), heights.index(one.rms_mm)
        value = values[row, column] = getattr(one, f"{part}_level_db" if level else part)
        dark = abs(value) > 4 if level else value < 0.75
        ax.text(
            column,
            row,
            f"{value:+.1f}" if level else f"{value:.3f}",
            ha="center",
            va="center",
            color="white" if dark else "black",
        )
        if one.trusted(part):
            outline = Rectangle(
                (column - 0.47, row - 0.47), 0.94, 0.94, fill=False, color="black", lw=1.8
            )
            ax.add_patch(outline)
    ax.imshow(
        values,
        origin="lower",
        cmap="RdBu_r" if level else "viridis",
        vmin=limits[0],
        vmax=limits[1],
        aspect="auto",
    )
    ax.set(
        title=title,
        xlabel="rms height [mm]",
        ylabel="correlation length [mm]",
        xticks=range(len(heights)),
        xticklabels=[f"{height:g}" for height in heights],
        yticks=range(len(lengths)),
        yticklabels=[f"{length:g}" for length in lengths],
    )


def check(comparisons: tuple[Comparison, ...]) -> list[str]:
    """Compare with the claims; return a line for each, or fail.

    Raises
    ------
    RuntimeError
        If one does not hold.
    """
    told = []
    for one in comparisons:
        statistics, line = (one.rms_mm, one.correlation_mm), table_row(one)
        if statistics in CLAIMS:
            correlation, level = CLAIMS[statistics]
            told.append(f"{line}; image claimed {correlation:.3f}, {level:+.1f} dB")
            if (
                one.image < correlation - CORRELATION_TOLERANCE
                or abs(one.image_level_db - level) > LEVEL_TOLERANCE_DB
            ):
                raise RuntimeError(
                    f"{told[-1]}; {CORRELATION_TOLERANCE} and {LEVEL_TOLERANCE_DB} dB are allowed"
                )
        for where, level, expected, what in (
            (BRAGG, one.image_level_db, BRAGG_DB, "image by perturbation theory"),
            (EDGES, one.echo_level_db, EDGES_DB, "echo by Keller's theory"),
        ):
            if statistics in where:
                told.append(f"{line}; {expected:+.2f} dB of the {what}")
                if abs(level - expected) > LIMIT_TOLERANCE_DB:
                    raise RuntimeError(f"{told[-1]}; {LIMIT_TOLERANCE_DB} dB are allowed")
        if one.rms_mm <= SMALL_RMS_MM and one.uplink < SMALL_RMS_UPLINK:
            raise RuntimeError(f"{line}: the uplink's correlation is below {SMALL_RMS_UPLINK}")
    return told


def table_row(one: Comparison) -> str:
    """Describe one roughness in a line."""
    return (
        f"rms {one.rms_mm:.2f} mm, l {one.correlation_mm:.1f} mm: echo {one.echo:.3f} "
        f"{one.echo_level_db:+.2f} dB, image {one.image:.3f} {one.image_level_db:+.2f} dB, uplink "
        f"{one.uplink:.4f} {one.uplink_level_db:+.2f} dB"
    )


def write_numbers(path: Path, comparisons: tuple[Comparison, ...]) -> None:
    """Write a line for each roughness."""
    names = list(Comparison.__dataclass_fields__)
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow([*names, *(f"{part}_trusted" for part in PARTS)])
        for one in comparisons:
            trusted = [int(one.trusted(part)) for part in PARTS]
            rows.writerow([f"{getattr(one, name):.5g}" for name in names] + trusted)


def main(arguments: list[str]) -> None:
    """Compare, write numbers and figure, and check the claims."""
    path = Path(arguments[0] if arguments else "full_wave_roughness.png")
    folder = Path(arguments[1]) if len(arguments) > 1 else None
    comparisons = trust_map(folder=folder, advance=lambda one: print(table_row(one), flush=True))
    write_numbers(path.with_suffix(".csv"), comparisons)
    draw(comparisons).savefig(path, dpi=150)
    print(f"written: {path}, {path.with_suffix('.csv')}")
    for line in check(comparisons):
        print(line)


if __name__ == "__main__":
    main(sys.argv[1:])
