r"""Range of validity of the ray-traced model over roughness: simulator against full wave.

Run as ``python -m validation.experiments.full_wave.roughness [FIGURE.png [FOLDER]]``. It takes some
ten minutes on two cores, and continues where it was stopped if FOLDER is given.

Not in the thesis, which calculates with full waves only. The wall has 8 cm instead of 40 cm; all
else is the scene of its figures 4.9 to 4.12: a conducting wall 0.8 m away and
turned by 45°, an aperture of 13 cm, 220 to 295 GHz, a user 1 m behind the wall with a beam of
0.1 rad. Positions 1 mm apart and 501 frequencies suffice for so short a wall, and the fields are
solved for at some 90 of them (:mod:`validation.full_wave.band_interpolation`). For each rms height
and correlation length (Gaussian) the same frozen realisations are given to the simulator, as a
scenario, and to the method of moments; cylindrical waves, no noise. Compared, over all
realisations together, by magnitude of the complex correlation and by level, simulated over full
wave, are

- the echo of the wall with its edges, whose relative weight is five times that of the thesis'
  wall;
- the back-projected image within 1 cm of the wall without its outer 1.5 cm: the rough wall alone;
- the uplink.

The simulator sums rough walls by the small-slope approximation and their edges by fringe currents
(:mod:`simulator.scattering.small_slope_2d`, :mod:`simulator.scattering.edge_diffraction`); errors
grow with the rms slope, :math:`\sqrt2\,\sigma/l` of a Gaussian surface. On the figure, a wall
within the first limits is outlined.

Claims that are asserted (:data:`LIMITS`), for each wall:

- up to a slope of 0.15 the echo's correlation is at least 0.992 and its level within 0.5 dB, the
  pilot's 0.995 and 0.3 dB;
- up to 0.35, the same with 0.985 for the echo;
- up to 0.6, echo and pilot are within 1 dB. Steeper walls are drawn, but nothing is claimed for
  them; ``simulate`` reports this.

The error of tangent planes alone would be 6 dB for small heights of short correlation length (Bragg
scattering: :math:`\cos^2\theta` for 1, at 45°), and 4.8 dB if only the edges scatter.
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
from validation.experiments.full_wave.localization import USER, WALL, strip_scene
from validation.full_wave.band_interpolation import band_fields

Part = Literal["echo", "image", "uplink"]
PARTS: tuple[Part, ...] = ("echo", "image", "uplink")

RMS_MM = (0.02, 0.05, 0.10, 0.15, 0.20, 0.30)
CORRELATION_MM = (0.2, 0.3, 0.5, 1.0, 2.0)
STATISTICS = tuple(itertools.product(RMS_MM, CORRELATION_MM))
QUICK = ((0.02, 0.2), (0.02, 2.0), (0.15, 1.0))
"""Statistics of the quick variant, for one realisation: Bragg scattering, edges, long waves."""

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
"""Length left out of the image at each end of the wall; depth of the image to either side of the
wall; pixel, half a range resolution. [m]"""

TRUSTED_CORRELATION, TRUSTED_LEVEL_DB = 0.985, 0.5
"""Least correlation and largest level error at which a part of the measurement is outlined as
valid: those of the claim on slopes up to 0.35. [-], [dB]"""

MOST_ERROR = 0.01
"""Largest interpolation error of the full-wave fields: 5e-5 of a correlation. [-]"""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Claims for walls up to a slope."""

    slope: float  # √2 rms/length [-]
    echo: float  # least correlation [-]
    echo_level_db: float  # largest deviation
    uplink: float
    uplink_level_db: float


LIMITS = (
    Limits(slope=0.15, echo=0.992, echo_level_db=0.5, uplink=0.995, uplink_level_db=0.3),
    Limits(slope=0.35, echo=0.985, echo_level_db=0.5, uplink=0.995, uplink_level_db=0.3),
    Limits(slope=0.60, echo=0.0, echo_level_db=1.0, uplink=0.0, uplink_level_db=1.0),
)
"""Limits of the small-slope approximation against full wave: its error is of third order in slopes;
0.5 dB is a part in 17 of an amplitude."""

SLOPE_ROUNDING = 5e-3
"""Tolerance by which 0.05 mm over 0.2 mm belongs to the slopes up to 0.35. [-]"""


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

    @property
    def slope(self) -> float:
        """Rms slope of a Gaussian surface. [-]."""
        return float(np.sqrt(2)) * self.rms_mm / self.correlation_mm

    @property
    def limits(self) -> Limits | None:
        """Claims for this wall; None: none."""
        return next((one for one in LIMITS if self.slope <= one.slope + SLOPE_ROUNDING), None)

    def trusted(self, part: Part) -> bool:
        """Whether one part of the measurement agrees within the limits."""
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
        Further overrides.
    folder
        Cache of solutions.
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
    """Draw the map: six panels with their numbers, and the valid range outlined."""
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
        f"{TRUSTED_LEVEL_DB:g} dB."
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
    """Check the claims; return a line for each.

    Raises
    ------
    RuntimeError
        If one does not hold.
    """
    told = []
    for one in comparisons:
        if one.limits is None:
            continue
        told.append(f"{table_row(one)}; claimed: {one.limits}")
        for part in ("echo", "uplink"):
            correlation, level = getattr(one, part), getattr(one, f"{part}_level_db")
            least, most = getattr(one.limits, part), getattr(one.limits, f"{part}_level_db")
            if correlation < least or abs(level) > most:
                raise RuntimeError(f"{told[-1]}: the {part} falls short")
    return told


def table_row(one: Comparison) -> str:
    """Return the line of one roughness."""
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
