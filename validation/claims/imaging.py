"""The estimator on closed-form signals: where points focus, how wide, and both image formers."""

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure
from scipy.constants import speed_of_light

from estimator.backprojection import backproject, focus_uplink
from estimator.measurement import Echo
from estimator.pixel_grid import PixelGrid
from estimator.range_migration import range_migration
from validation.claim import Claim, Effort, Finding, Row, Tell
from validation.experiments.fig04_angle_spectra import TOLERANCE_DEG, draw, spectra_of
from validation.point_scatterer import point_echo, point_uplink

BAND = np.linspace(220e9, 295e9, 401)
CENTRE = float(BAND.mean())
LENGTH = 0.13  # of the thesis' aperture [m]
HALF_POWER = 0.886  # width of a sinc² at half its peak, over its first null

HALF = np.sqrt(0.5)


def array(count: int, length: float = LENGTH) -> Float[np.ndarray, "positions 3"]:
    """Place elements along x [m]."""
    positions = np.zeros((count, 3))
    positions[:, 0] = (np.arange(count) - (count - 1) / 2) * length / count
    return positions


def points_in_the_image(effort: Effort, tell: Tell) -> Finding:
    """Image random points: position, −3 dB widths, phase and level, in the plane and in space."""
    rng = np.random.default_rng(8)
    trials = 40 if effort == "full" else 8
    rows = []
    for dimensions, positions in ((2, array(260)), (3, _planar())):
        offsets, widths, phases, levels = [], [], [], []
        for trial in range(trials):
            low, high = ([-0.1, 0.4, 0.0], [0.1, 0.75, 0.0])
            if dimensions == 3:
                low, high = ([-0.05, 0.3, -0.05], [0.05, 0.5, 0.05])
            target = rng.uniform(low, high)
            phase = float(rng.uniform(-np.pi, np.pi))
            echo = point_echo(
                target[None],
                positions=positions,
                frequencies=BAND,
                radar_cross_section=np.ones(1),
                phase=np.array([phase]),
            )
            found = _cuts(echo, target, float(np.ptp(positions[:, 0])) * _full(positions))
            offsets.append(found[0])
            widths.append(found[1])
            value = backproject(echo, target[None])[0]
            phases.append(float(abs(np.degrees(np.angle(value * np.exp(-1j * phase))))))
            wavelength = speed_of_light / CENTRE
            expected = wavelength / ((4 * np.pi) ** 1.5 * float(target @ target))
            levels.append(float(abs(20 * np.log10(abs(value) / expected))))
            tell(trials * (dimensions - 2) + trial + 1, 2 * trials)
        where = f"in {dimensions} dimensions"
        rows += [
            Row(
                name=f"position {where}, worst of range and cross-range",
                stated="where the point is",
                measured=float(np.max(offsets)),
                unit="cell",
                high=0.05,
                origin="the design's bound for ideal points",
            ),
            Row(
                name=f"−3 dB widths {where}, worst deviation from theory",
                stated="0.886·c/2B in range, 0.886·λR/(2D cosφ) across",
                measured=100 * float(np.max(np.abs(widths))),
                unit="%",
                high=5.0,
                origin="the formula is for small apertures, and takes the centre frequency",
            ),
            Row(
                name=f"phase {where}",
                stated="that of the point",
                measured=float(np.max(phases)),
                unit="°",
                high=5.0,
                origin="amplitudes vary over aperture and band, the phase does so little",
            ),
            Row(
                name=f"level {where}",
                stated="that of the radar equation at the centre",
                measured=float(np.max(levels)),
                unit="dB",
                high=0.5,
                origin="the mean of λ/R² over band and aperture is not that of its centre",
            ),
        ]
    return Finding(rows=rows)


def _planar() -> Float[np.ndarray, "positions 3"]:
    x, z = np.meshgrid(np.arange(24), np.arange(24), indexing="ij")
    positions = np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=1) * 1.5e-3
    return np.asarray(positions - positions.mean(axis=0))


def _full(positions: Float[np.ndarray, "positions 3"]) -> float:
    """Return the length that the elements stand for over that between the outer ones."""
    count = np.unique(positions[:, 0].round(9)).size
    return count / (count - 1)


def _cuts(
    echo: Echo, target: Float[np.ndarray, " 3"], length: float
) -> tuple[float, tuple[float, float]]:
    """Return the worst offset in cells, and how far both widths are off theory."""
    distance = float(np.linalg.norm(target))
    along = target / distance
    across = np.cross([0.0, 0.0, 1.0], along)
    across /= np.linalg.norm(across)
    cosine = float(np.sqrt(1 - (target[0] / distance) ** 2))
    bandwidth = float(np.ptp(BAND)) * BAND.size / (BAND.size - 1)
    cells = (
        HALF_POWER * speed_of_light / (2 * bandwidth),
        HALF_POWER * speed_of_light / CENTRE * distance / (2 * length * cosine),
    )
    steps = np.linspace(-1.0, 1.0, 401)
    worst, deviations = 0.0, []
    for direction, cell in zip((along, across), cells, strict=True):
        cut = np.abs(backproject(echo, target + (steps * cell)[:, None] * direction))
        worst = max(worst, float(abs(steps[int(cut.argmax())])))
        wide = steps[cut >= HALF * cut.max()]
        deviations.append(float(np.ptp(wide)) - 1.0)
    return worst, (deviations[0], deviations[1])


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


def angle_spectra(effort: Effort, tell: Tell) -> Finding:
    """Find users at 1.8 and 20 m with the spherical and the plane-wave model."""
    rows, spectra = [], []
    for number, (aoa, distance) in enumerate(
        ((90.0, 1.8), (70.0, 1.8), (90.0, 20.0), (70.0, 20.0))
    ):
        found = spectra_of(aoa, distance)
        spectra.append(found)
        near, plane = found.error_deg(found.spherical), found.error_deg(found.plane)
        rows.append(
            Row(
                name=f"{aoa:g}° at {distance:g} m, spherical waves",
                stated="the thesis: on its 0.18° grid",
                measured=near,
                unit="°",
                high=TOLERANCE_DEG,
                origin="the design's bound after refinement",
            )
        )
        if distance > 10:
            rows.append(
                Row(
                    name=f"{aoa:g}° at {distance:g} m, plane waves",
                    stated="the thesis: both models agree at 20 m",
                    measured=plane,
                    unit="°",
                    high=TOLERANCE_DEG,
                    origin="the same",
                )
            )
        elif aoa == 90.0:
            wide = found.plane > found.plane.max() * HALF
            rows.append(
                Row(
                    name=f"{aoa:g}° at {distance:g} m: width of the plane-wave model's lobe",
                    stated="smeared: near field",
                    measured=float(np.ptp(found.grid_deg[wide])),
                    unit="°",
                    low=1.0,
                    origin="the spherical model's lobe is 0.53° wide",
                )
            )
        tell(number + 1, 4)

    def draw_all(figure: Figure) -> None:
        for ax, one in zip(figure.subplots(2, 2).flat, spectra, strict=True):
            draw(ax, one)

    return Finding(rows=rows, draw=draw_all)


def pilot(effort: Effort, tell: Tell) -> Finding:
    """Focus a closed-form pilot: one way, not two."""
    positions = array(260)
    source = np.array([0.31, 1.2, 0.0])
    uplink = point_uplink(source[None], positions=positions, frequencies=BAND)
    distance = float(np.linalg.norm(source))
    along = source / distance
    bandwidth = float(np.ptp(BAND)) * BAND.size / (BAND.size - 1)
    cell = HALF_POWER * speed_of_light / bandwidth
    steps = np.linspace(-1.5, 1.5, 601)
    cut = np.abs(focus_uplink(uplink, source + (steps * cell)[:, None] * along))
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
        ]
    )


CLAIMS = (
    Claim(
        key="point_image",
        title="Points focus where they are, as wide as theory says",
        source="thesis (2-15), (2-19) as corrected",
        measure=points_in_the_image,
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
    Claim(
        key="angle_spectra",
        title="Near users need the spherical-wave model, far ones do not",
        source="thesis figures 4.3, 4.4, 4.6, 4.7",
        measure=angle_spectra,
    ),
)
