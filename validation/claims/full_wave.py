"""The simulator against full-wave solutions, stored ones and our own."""

from validation.experiments.full_wave import bodies, localization, roughness, wall
from validation.full_wave.ghost_comparison import LEAST_CORRELATION as GHOST_CORRELATION
from validation.full_wave.ghost_comparison import MOST_LEVEL_DB as GHOST_LEVEL_DB
from validation.full_wave.ghost_comparison import compare_ghosts
from validation.full_wave.wall_comparison import (
    LEAST_CORRELATION,
    MOST_LEVEL_DB,
    compare_with_full_wave,
)
from validation.harness.claim import Claim, Effort, Finding, Row, Tell
from validation.metrics.errors import ErrorSummary, error_summary
from validation.reference import ROUGH_WALL, TWO_CYLINDERS

STORED = "2-D method of moments, TM, 0.15 mm rms, 1 mm correlation; checked to 4e-6"


def rough_wall(effort: Effort, tell: Tell) -> Finding:
    """Compare echo and pilots of a rough wall with a stored full-wave solution."""
    rows = []
    for one in compare_with_full_wave(ROUGH_WALL):
        name = one.name.replace("_", ", ")
        rows += [
            Row(
                name=f"{name}: complex correlation",
                stated=STORED,
                measured=one.correlation,
                low=LEAST_CORRELATION,
                origin="physical optics reaches 0.993 (echo) and 0.996 … 0.999 (pilots)",
            ),
            Row(
                name=f"{name}: level",
                stated=STORED,
                measured=one.level_db,
                unit="dB",
                low=-MOST_LEVEL_DB,
                high=MOST_LEVEL_DB,
                origin="physical optics is 1.1 dB (echo) and 0.5 dB (pilots) above full wave",
            ),
        ]
    tell(1, 1)
    return Finding(rows=rows)


def ghosts(effort: Effort, tell: Tell) -> Finding:
    """Compare the echo of two cylinders seen over the rough wall with full wave."""
    correlation, level = compare_ghosts(TWO_CYLINDERS, ROUGH_WALL)
    tell(1, 1)
    return Finding(
        rows=[
            Row(
                name="hidden cylinders' part of the echo: complex correlation",
                stated=STORED,
                measured=correlation,
                low=GHOST_CORRELATION,
                origin="physical optics twice reaches 0.985 on the whole reference",
            ),
            Row(
                name="hidden cylinders' part of the echo: level",
                stated=STORED,
                measured=level,
                unit="dB",
                low=-GHOST_LEVEL_DB,
                high=GHOST_LEVEL_DB,
                origin="0.6 dB below full wave on the whole reference",
            ),
        ]
    )


def solver(effort: Effort, tell: Tell) -> Finding:
    """Check our own method of moments against series, refinement and the stored solution."""
    found = wall.solver_check()
    tell(1, 2)
    series = bodies.body_errors()
    tell(2, 2)
    return Finding(
        rows=[
            Row(
                name="method of moments: field round a cylinder, relative error",
                stated="Bessel series",
                measured=found.series_error,
                high=wall.MOST_SERIES_ERROR,
                origin="spectral quadrature",
            ),
            Row(
                name="method of moments: rough wall of 8 cm, change with twice the unknowns",
                stated="none",
                measured=found.refinement,
                high=wall.MOST_REFINEMENT,
                origin="converged far below what it is compared with",
            ),
            Row(
                name="method of moments: the stored wall of 40 cm, relative difference",
                stated="an independent code",
                measured=found.reference_error,
                high=wall.MOST_REFERENCE_ERROR,
                origin="the wall's profile is interpolated between its 8001 points by either",
            ),
            *(
                Row(
                    name=f"integral equations: {one.name}, relative error",
                    stated="Airy's formula" if one.reference == "Airy" else "Bessel series",
                    measured=one.error,
                    high=one.most,
                    origin="the grid, and what comes back from the ends of slabs and faces",
                )
                for one in series
            ),
        ]
    )


def trust(effort: Effort, tell: Tell) -> Finding:
    """Compare the simulator with full wave over rms height and correlation length."""
    told: list[roughness.Comparison] = []

    def advance(comparison: roughness.Comparison) -> None:
        told.append(comparison)
        tell(len(told), len(statistics))

    quick = effort == "quick"
    statistics = roughness.QUICK if quick else roughness.STATISTICS
    realisations = 1 if quick else roughness.REALISATIONS
    found = roughness.trust_map(statistics, realisations=realisations, advance=advance)
    rows = []
    for one in found:
        if one.limits is None:
            continue
        surface = f"{one.rms_mm:g} mm rms, {one.correlation_mm:g} mm long (slope {one.slope:.2f})"
        for part, what in (("echo", "echo"), ("uplink", "pilot")):
            least = getattr(one.limits, part)
            most = getattr(one.limits, f"{part}_level_db")
            if least > 0:
                rows.append(
                    Row(
                        name=f"{surface}: {what}, correlation",
                        stated="method of moments on the same profiles",
                        measured=getattr(one, part),
                        low=least,
                        origin="small-slope approximation: the third power of slopes is left out",
                    )
                )
            rows.append(
                Row(
                    name=f"{surface}: {what}, level over full wave",
                    stated="0 dB",
                    measured=getattr(one, f"{part}_level_db"),
                    unit="dB",
                    low=-most,
                    high=most,
                    origin="the same",
                )
            )
    return Finding(rows=rows, draw=lambda figure: roughness.draw_on(figure, found))


def located(effort: Effort, tell: Tell) -> Finding:
    """Locate the user on full-wave data of several realisations."""
    name = next(iter(localization.CASES))
    trials = localization.TRIALS
    done = []

    def advance(trial: localization.Trial) -> None:
        done.append(trial)
        tell(len(done), trials)

    found = localization.localization(name, trials=trials, advance=advance)
    errors = error_summary(list(found.errors))
    outside = sum(
        one.full_wave.status != "found" or not one.full_wave.square < localization.REGION
        for one in found.trials
    )
    return Finding(
        rows=[
            Row(
                name=f"user on full-wave data, {name}: not found, or outside its region",
                stated="found each time, its uncertainty told",
                measured=float(outside),
                high=0.0,
                origin="the 99.9 % region",
            ),
            *_error_rows(name, errors, trials),
        ],
        draw=lambda figure: localization.draw(figure.subplots(), found),
    )


def _error_rows(name: str, errors: ErrorSummary, trials: int) -> list[Row]:
    return [
        Row(
            name=f"user on full-wave data, {name}: {what} of {trials}",
            stated="as on simulated data",
            measured=1e3 * value,
            unit="mm",
            high=1e3 * limit,
            origin="the design's bounds of slam_2d",
        )
        for what, value, limit in (
            ("median", errors.median, localization.MOST_MEDIAN),
            ("worst", errors.worst, localization.MOST_WORST),
        )
    ]


CLAIMS = (
    Claim(
        key="full_wave_solver",
        title="Our own full-wave solver is right",
        source="series of a cylinder; its own refinement; the stored reference",
        measure=solver,
        minutes=0.5,
    ),
    Claim(
        key="full_wave_roughness",
        title="How far the simulator can be trusted, by roughness",
        source="our method of moments, TM",
        measure=trust,
        minutes=15.0,
    ),
    Claim(
        key="full_wave_localization",
        title="The estimator on full-wave data, end to end",
        source="our method of moments, TM",
        measure=located,
        quick=False,
        minutes=45.0,
    ),
    Claim(
        key="full_wave_wall",
        title="A rough wall's echo and pilots are those of full wave",
        source="the stored full-wave reference of the thesis' SLAM scene",
        measure=rough_wall,
    ),
    Claim(
        key="full_wave_ghosts",
        title="Ghosts of hidden cylinders, with their clouds, are those of full wave",
        source="the stored full-wave reference with two cylinders",
        measure=ghosts,
        minutes=0.5,
    ),
)
