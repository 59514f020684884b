r"""The method of moments by itself: accuracy, speed, and solution of the thesis' wall.

Run as ``python -m validation.experiments.full_wave.wall`` for the checks (half a minute), or as
``python -m validation.experiments.full_wave.wall FILE.npz [REFERENCE.npz]`` to solve the thesis'
wall at full size and write it in the layout of :mod:`validation.full_wave.wall_comparison`: 0.40 m
long, 0.8 m away, 260 positions, 1001 frequencies from 220 to 295 GHz, the user 1 m behind it with
an isotropic and with a beam antenna. Solved frequencies are stored in the folder ``FILE.parts`` and
reused if started again. The wall is that of REFERENCE, with which the result is then compared, or
else a realisation of 0.15 mm rms, l = 1 mm.

The thesis leaves the roughness open. The check of speed is a rough wall of 8 cm at 61
frequencies, for which 30 s are allowed on two cores.

Claims that are asserted: the error against the series of a cylinder ten wavelengths thick is below
1e-7, against twice as many unknowns on the short wall below 1e-4 (the accuracy for which the grid
per correlation length is chosen), and the short wall takes at most 30 s. Echo and uplinks agree
with the stored solution of an independent code, at the ends of the band, and with a REFERENCE, to
1e-4; the stored one's own accuracy is 4e-6, in complex64.
"""

import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Complex, Float
from scipy.special import hankel2, jv

from scenes.files.loading import load_scenario
from scenes.scenario import Scenario
from validation.experiments.full_wave.localization import USER, WALL, strip_scene
from validation.full_wave.conducting_contour import circle
from validation.full_wave.line_source import LineSource
from validation.full_wave.method_of_moments import scattered_fields
from validation.full_wave.strip_scattering import (
    StripFields,
    StripScene,
    strip_fields,
    strip_response,
)
from validation.full_wave.wall_comparison import COMPARED, read_reference
from validation.reference import ROUGH_WALL

ROUGHNESS = (
    "waves=cylindrical",
    "noise.snr_db=inf",
    f"objects.{WALL}.roughness.rms_mm=0.15",
    f"objects.{WALL}.roughness.correlation_mm=1.0",
)
SHORT = ("radio.points=61", f"objects.{WALL}.length_m=0.08")

BEAM_DISPLACEMENT = 0.097
"""Imaginary displacement of the stored reference's beam: fitted, to five digits. [m]"""

RADIUS, DISTANCE, SEPARATION = 5.0, 9.0, 2.0
"""The cylinder's radius and the line source's and receiver's distance from its axis [λ], and the
angle between them. [rad]"""

MOST_SERIES_ERROR, MOST_REFINEMENT, MOST_REFERENCE_ERROR = 1e-7, 1e-4, 1e-4
MOST_SECONDS = 30.0


@dataclass(frozen=True, kw_only=True)
class SolverCheck:
    """Results of the checks."""

    series_error: float  # of a cylinder's scattered field, relative [-]
    refinement: float  # change of the short wall's echo with twice the unknowns, relative [-]
    reference_error: float  # largest of echo and uplinks of the stored wall, relative [-]
    seconds: float  # for the short wall
    frequencies: int  # of it


def solver_check() -> SolverCheck:
    """Solve a cylinder, a short rough wall, and some of the stored one."""
    scenario = load_scenario("slam_2d", (*ROUGHNESS, *SHORT))
    scene, frequencies = strip_scene(scenario, seed=0), scenario.radio.frequencies
    started = time.perf_counter()
    fields = strip_fields(scene, frequencies)
    seconds = time.perf_counter() - started
    top = float(frequencies[-1])
    finer = replace(scene, detail=scene.grid(top).spacing / 2)
    refined = strip_response(finer, top)[0]
    return SolverCheck(
        series_error=cylinder_error(),
        refinement=relative_error(fields.echo[:, -1], refined),
        reference_error=stored_error(),
        seconds=seconds,
        frequencies=len(frequencies),
    )


def stored_error() -> float:
    """Solve the stored wall at both ends of its band and compare. [-]."""
    stored = read_reference(ROUGH_WALL)
    scene, frequencies = thesis_wall(stored)
    ends = [0, len(frequencies) - 1]
    part = {name: values[:, ends] for name, values in stored.items() if name in COMPARED}
    return max(reference_errors(strip_fields(scene, frequencies[ends]), part).values())


def cylinder_error() -> float:
    """Compare the field round a cylinder with its series, over wavelengths of 1. [-]."""
    wavenumber = 2 * np.pi
    ends = [
        LineSource(position=DISTANCE * np.array([np.cos(angle), np.sin(angle)]))
        for angle in (0.0, SEPARATION)
    ]
    body = circle(np.zeros(2), RADIUS, spacing=1 / 6.5)
    found = scattered_fields([body], ends[:1], ends, wavenumber)[0]
    order = np.arange(-int(wavenumber * RADIUS) - 40, int(wavenumber * RADIUS) + 41)
    terms = jv(order, wavenumber * RADIUS) / hankel2(order, wavenumber * RADIUS)
    terms = 0.25j * terms * hankel2(order, wavenumber * DISTANCE) ** 2
    expected = np.array([np.sum(terms * np.exp(1j * order * a)) for a in (0.0, SEPARATION)])
    return relative_error(found, expected)


def thesis_wall(
    reference: dict[str, np.ndarray] | None = None,
) -> tuple[StripScene, Float[np.ndarray, " freqs"]]:
    """Return the wall at full size with an isotropic and a beam user, and frequencies in Hz."""
    if reference is None:
        scenario: Scenario = load_scenario("slam_2d", ROUGHNESS)
        scene = strip_scene(scenario, seed=0)
        user = LineSource(position=scenario.users[USER].position[:2])
        return replace(scene, users=(user, *scene.users)), scenario.radio.frequencies
    place = reference["user_position"][:2]
    wall = reference["wall_profile"][:, :2]
    aim = (wall[0] + wall[-1]) / 2 - place
    # The beam is aimed at the mean line's middle: the profile's ends have heights.
    aim = np.round(aim, 3)
    scene = StripScene(
        profile=reference["wall_profile"],
        positions=reference["aperture_position"],
        users=(
            LineSource(position=place),
            LineSource(position=place, aim=aim, displacement=BEAM_DISPLACEMENT),
        ),
        detail=1.5e-4,  # its l is 1 mm
    )
    return scene, reference["frequency"]


def reference_errors(fields: StripFields, reference: dict[str, np.ndarray]) -> dict[str, float]:
    """Compare solved fields with stored ones. [-]."""
    solved = (fields.echo, *fields.uplinks)
    names = ("echo", "uplink_isotropic", "uplink_beam")
    return {
        name: relative_error(one, reference[name])
        for name, one in zip(names, solved, strict=True)
        if name in reference
    }


def relative_error(one: Complex[np.ndarray, "*n"], other: Complex[np.ndarray, "*n"]) -> float:
    """Return the norm of the difference over that of the second. [-]."""
    return float(np.linalg.norm(one - other) / np.linalg.norm(other))


def check(result: SolverCheck) -> list[str]:
    """Check the claims; return a line for each.

    Raises
    ------
    RuntimeError
        If one does not hold.
    """
    claims = (
        ("error against a cylinder's series", result.series_error, MOST_SERIES_ERROR),
        ("change with twice the unknowns", result.refinement, MOST_REFINEMENT),
        ("difference from the stored solution", result.reference_error, MOST_REFERENCE_ERROR),
        (f"seconds for 8 cm at {result.frequencies} frequencies", result.seconds, MOST_SECONDS),
    )
    told = []
    for what, value, limit in claims:
        told.append(f"{what}: {value:.3g} (at most {limit:g})")
        if not value <= limit:
            raise RuntimeError(told[-1])
    return told


def main(arguments: list[str]) -> int:
    """Check the solver, or solve the thesis' wall; return 1 if agreement is insufficient."""
    if not arguments:
        for line in check(solver_check()):
            print(line)
        return 0
    path = Path(arguments[0])
    reference = read_reference(Path(arguments[1])) if len(arguments) > 1 else None
    scene, frequencies = thesis_wall(reference)
    started = time.perf_counter()

    def tell(done: int, steps: int) -> None:
        minutes = (time.perf_counter() - started) / 60
        print(f"{done}/{steps} blocks [{minutes:.1f} min]", file=sys.stderr, flush=True)

    fields = strip_fields(scene, frequencies, folder=path.with_suffix(".parts"), advance=tell)
    np.savez_compressed(
        path,
        echo=fields.echo.astype(np.complex64),
        uplink_isotropic=fields.uplinks[0].astype(np.complex64),
        uplink_beam=fields.uplinks[1].astype(np.complex64),
        wall_profile=scene.profile,
        aperture_position=scene.positions,
        frequency=frequencies,
        user_position=np.append(scene.users[0].position, 0.0),
    )
    print(f"written: {path}")
    errors = {} if reference is None else reference_errors(fields, reference)
    for name, error in errors.items():
        print(f"{name}: differs from the reference by {error:.2g}")
    return 0 if all(error <= MOST_REFERENCE_ERROR for error in errors.values()) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
