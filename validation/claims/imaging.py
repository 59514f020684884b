"""The estimator on closed-form signals: positions and widths of points, and both image formers."""

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure
from scipy.constants import speed_of_light

from estimator.imaging.backprojection import backproject, focus_uplink
from estimator.imaging.wavenumber.range_migration import range_migration
from estimator.results.pixel_grid import PixelGrid
from validation.analytic.point_scatterer import point_echo, point_uplink
from validation.experiments import simulator_on_points
from validation.harness.claim import Claim, Effort, Finding, Row, Tell
from validation.metrics.image_quality import image_entropy, sidelobe_ratios

BAND = np.linspace(220e9, 295e9, 401)
LENGTH = 0.13  # of the thesis' aperture [m]
HALF_POWER = 0.886  # width of a sinc² at half its peak, over its first null

HALF = np.sqrt(0.5)
LOBES = 20
"""Extent to either side over which sidelobes are compared, in first zeros c/B. [-]"""
LOBES_WITHIN_DB = 0.3
"""Largest difference of sidelobes from those of a sinc: an amplitude of 1 + x·u over the band adds
x² to their energy, 0.1 dB at ±15 %, and the curvature of 1/f about as much again. [dB]"""


def array(count: int, length: float = LENGTH) -> Float[np.ndarray, "positions 3"]:
    """Place elements along x [m]."""
    positions = np.zeros((count, 3))
    positions[:, 0] = (np.arange(count) - (count - 1) / 2) * length / count
    return positions


def image_formers(effort: Effort, tell: Tell) -> Finding:
    """Form the same image by range migration and by back-projection."""
    positions = array(120, 0.06)
    targets = np.array([[0.0, 0.35, 0.0], [0.05, 0.42, 0.0], [-0.06, 0.3, 0.0]])
    echo = point_echo(
        targets, positions=positions, frequencies=BAND, radar_cross_section=np.ones(3)
    )
    grid = PixelGrid.spanning(x=(-0.08, 0.08), y=(0.27, 0.45), spacing=1e-3)
    reference = backproject(echo, grid.points)
    migrated = range_migration(echo, grid)
    tell(1, 2)
    steps = np.linspace(-4e-3, 4e-3, 801)
    offsets = []
    for target in targets:
        line = target + steps[:, None] * np.array([0.0, 1.0, 0.0])
        cut = np.abs(range_migration(echo, PixelGrid.plane(x=target[:1], y=line[:, 1])))
        offsets.append(abs(float(steps[int(cut.ravel().argmax())])))
    tell(2, 2)
    entropies = [image_entropy(image) for image in (migrated, reference)]
    difference = np.abs(migrated - reference).max() / np.abs(reference).max()
    rows = [
        Row(
            name="range migration against back-projection, largest difference",
            stated="the same image (Stolt interpolation with its Jacobian)",
            measured=float(20 * np.log10(difference)),
            unit="dB",
            high=-40.0,
            origin="stationary phase leaves the edges of aperture and band",
        ),
        Row(
            name="range migration: entropy over that of back-projection",
            stated="1: focused alike",
            measured=entropies[0] / entropies[1],
            low=0.99,
            high=1.01,
            origin="a difference of -40 dB (1 %) in each pixel",
        ),
        Row(
            name="range migration: points in range",
            stated="where they are",
            measured=1e3 * max(offsets),
            unit="mm",
            high=0.1,
            origin="0.05 of a cell of 2 mm",
        ),
    ]

    def draw_both(figure: Figure) -> None:
        axes = figure.subplots(1, 2, sharey=True)
        for ax, values, name in zip(
            axes, (reference, migrated), ("back-projection", "range migration"), strict=True
        ):
            level = 20 * np.log10(np.abs(values) / np.abs(reference).max() + 1e-9)
            mesh = ax.pcolormesh(
                grid.x, grid.y, level.reshape(grid.x.size, grid.y.size).T, vmin=-40, vmax=0
            )
            ax.set(title=name, xlabel="x [m]")
            ax.set_aspect("equal")
        axes[0].set_ylabel("y [m]")
        figure.colorbar(mesh, ax=axes, label="level [dB]")

    return Finding(rows=rows, draw=draw_both)


def pilot(effort: Effort, tell: Tell) -> Finding:
    """Focus a closed-form pilot, which travels one way only."""
    positions = array(260)
    source = np.array([0.31, 1.2, 0.0])
    uplink = point_uplink(source[None], positions=positions, frequencies=BAND)
    distance = float(np.linalg.norm(source))
    along = source / distance
    bandwidth = float(np.ptp(BAND)) * BAND.size / (BAND.size - 1)
    cell = HALF_POWER * speed_of_light / bandwidth
    steps = np.linspace(-1.5, 1.5, 601)
    cut = np.abs(focus_uplink(uplink, source + (steps * cell)[:, None] * along))
    lags = np.linspace(-LOBES, LOBES, 40 * LOBES + 1)  # in first zeros, c/B
    far = focus_uplink(uplink, source + (lags * cell / HALF_POWER)[:, None] * along)
    lobes = sidelobe_ratios(far, np.abs(lags) <= 1)
    ideal = sidelobe_ratios(np.sinc(lags).astype(np.complex128), np.abs(lags) <= 1)
    tell(1, 1)
    wide = steps[cut >= HALF * cut.max()]
    return Finding(
        rows=[
            Row(
                name="range of a pilot, offset",
                stated="where the user is",
                measured=float(abs(steps[int(cut.argmax())])),
                unit="cell",
                high=0.05,
                origin="the design's bound for ideal points",
            ),
            Row(
                name="−3 dB width in range over 0.886·c/B",
                stated="1: one way, not the echo's c/2B",
                measured=float(np.ptp(wide)),
                low=0.95,
                high=1.05,
                origin="5 %: the amplitude's change over the band",
            ),
            Row(
                name="highest sidelobe in range",
                stated="-13.26 dB: sinc, a rectangular band",
                measured=lobes.peak_db,
                unit="dB",
                low=ideal.peak_db - LOBES_WITHIN_DB,
                high=ideal.peak_db + LOBES_WITHIN_DB,
                origin="the amplitude, as 1/f, changes by ±15 % over the band",
            ),
            Row(
                name=f"energy of {LOBES - 1} sidelobes a side in range",
                stated=f"{ideal.integrated_db:.2f} dB: sinc, a rectangular band",
                measured=lobes.integrated_db,
                unit="dB",
                low=ideal.integrated_db - LOBES_WITHIN_DB,
                high=ideal.integrated_db + LOBES_WITHIN_DB,
                origin="the amplitude, as 1/f, changes by ±15 % over the band",
            ),
        ]
    )


def points(effort: Effort, tell: Tell) -> Finding:
    """Image ideal points, and simulate them."""
    found = simulator_on_points.measure()
    tell(1, 1)
    return Finding(
        rows=simulator_on_points.rows(found),
        draw=lambda figure: simulator_on_points.draw(figure, found),
    )


CLAIMS = (
    Claim(
        key="points",
        title="Points focus where they are, as wide as theory says, and are simulated so",
        source="closed form; thesis (2-15), (2-19) as corrected",
        measure=points,
        minutes=0.5,
    ),
    Claim(
        key="pilot_range",
        title="A pilot's range is one way",
        source="thesis 3.2",
        measure=pilot,
    ),
    Claim(
        key="image_formers",
        title="Range migration and back-projection form the same image",
        source="thesis (2-13), (2-14) as corrected",
        measure=image_formers,
    ),
)
