"""The thesis, figure by figure."""

from types import ModuleType

from matplotlib.figure import Figure

from scenes.files.loading import load_scenario
from validation.experiments import (
    eq02_design_numbers,
    fig02_07_rcs_drywall,
    fig02_10_nlos_posts,
    fig02_11_nlos_box,
    fig04_01_gaussian_beam,
    fig04_09_slam_2d,
    fig04_14_lab_two_walls,
)
from validation.experiments.fig04_angle_spectra import TOLERANCE_DEG, draw, spectra_of
from validation.harness.claim import Claim, Effort, Finding, Row, Tell
from validation.trials.hidden_imaging import draw_hidden, hidden_rows

SEEDS = 10


def design_numbers(effort: Effort, tell: Tell) -> Finding:
    """Measure widths, steps and ranges on point responses, against theory and thesis."""
    found = eq02_design_numbers.measure()
    tell(1, 1)
    return Finding(
        rows=eq02_design_numbers.rows(found),
        draw=lambda figure: eq02_design_numbers.draw(figure, found),
    )


def drywall(effort: Effort, tell: Tell) -> Finding:
    """Measure drywall against a metal mirror bistatically at 330 GHz."""
    levels = fig02_07_rcs_drywall.measured_levels(load_scenario("rcs_drywall"), tell=tell)

    def draw_levels(figure: Figure) -> None:
        fig02_07_rcs_drywall.draw(figure.subplots(), levels)

    return Finding(rows=fig02_07_rcs_drywall.rows(levels), draw=draw_levels)


def hidden_imaging(module: ModuleType, effort: Effort, tell: Tell) -> Finding:
    """Image objects behind a corner over a rough drywall."""
    count = SEEDS if effort == "full" else 1
    results = []
    for seed in range(count):
        results.append(module.measure(seed=seed, quick=effort == "quick"))
        tell(seed + 1, count)
    return Finding(rows=hidden_rows(results), draw=lambda figure: draw_hidden(figure, results[0]))


def posts(effort: Effort, tell: Tell) -> Finding:
    """Image two hidden posts."""
    return hidden_imaging(fig02_10_nlos_posts, effort, tell)


def box(effort: Effort, tell: Tell) -> Finding:
    """Image a hidden box."""
    return hidden_imaging(fig02_11_nlos_box, effort, tell)


def beam(effort: Effort, tell: Tell) -> Finding:
    """Simulate the user's Gaussian beam over angle."""
    found = fig04_01_gaussian_beam.measure()
    tell(1, 1)
    return Finding(
        rows=fig04_01_gaussian_beam.rows(found),
        draw=lambda figure: fig04_01_gaussian_beam.draw(figure, found),
    )


def angle_spectra(effort: Effort, tell: Tell) -> Finding:
    """Find users at 1.8 and 20 m with the spherical and the plane-wave model."""
    rows, spectra = [], []
    places = ((90.0, 1.8), (70.0, 1.8), (90.0, 20.0), (70.0, 20.0))
    for number, (aoa, distance) in enumerate(places):
        found = spectra_of(aoa, distance)
        spectra.append(found)
        where = f"{aoa:g}° at {distance:g} m"
        rows.append(
            Row(
                name=f"{where}, spherical waves: error",
                stated="the thesis: found, on its 0.18° grid",
                measured=found.error_deg(found.spherical),
                unit="°",
                high=TOLERANCE_DEG,
                origin="the design's bound after refinement",
            )
        )
        if distance > 10:
            rows.append(
                Row(
                    name=f"{where}, plane waves: error",
                    stated="the thesis: both models agree at 20 m",
                    measured=found.error_deg(found.plane),
                    unit="°",
                    high=TOLERANCE_DEG,
                    origin="the same",
                )
            )
        tell(number + 1, len(places))

    def draw_all(figure: Figure) -> None:
        for ax, one in zip(figure.subplots(2, 2).flat, spectra, strict=True):
            draw(ax, one)

    return Finding(rows=rows, draw=draw_all)


def slam(effort: Effort, tell: Tell) -> Finding:
    """Locate the hidden user of the two-dimensional scene, over seeds."""
    found = fig04_09_slam_2d.measure(quick=effort == "quick", tell=tell)
    return Finding(
        rows=fig04_09_slam_2d.rows(found), draw=lambda figure: fig04_09_slam_2d.draw(figure, found)
    )


def two_walls(effort: Effort, tell: Tell) -> Finding:
    """Find both drywalls of the lab, and the user over them."""
    found = fig04_14_lab_two_walls.measure(seeds=SEEDS, tell=tell)
    return Finding(
        rows=fig04_14_lab_two_walls.rows(found),
        draw=lambda figure: fig04_14_lab_two_walls.draw(figure, found),
    )


CLAIMS = (
    Claim(
        key="design_numbers",
        title="Resolutions, steps and ranges are what the corrected formulas say",
        source="thesis (2-15) to (2-28), (3-1) to (3-3)",
        measure=design_numbers,
    ),
    Claim(
        key="fig02_07_drywall",
        title="Drywall at 330 GHz: a mirror with a faint diffuse part",
        source="thesis figure 2.7",
        measure=drywall,
        quick=False,
        minutes=12.0,
    ),
    Claim(
        key="fig02_10_posts",
        title="Hidden posts are unfolded to where they are",
        source="thesis figure 2.10",
        measure=posts,
        minutes=8.0,
    ),
    Claim(
        key="fig02_11_box",
        title="A hidden box is unfolded to where it is",
        source="thesis figure 2.11",
        measure=box,
        quick=False,
        minutes=15.0,
    ),
    Claim(
        key="fig04_01_beam",
        title="The user's Gaussian beam has the pattern of (4-1), corrected",
        source="thesis figure 4.1, equation (4-1)",
        measure=beam,
    ),
    Claim(
        key="fig04_03_angles",
        title="Near users need the spherical-wave model, far ones do not",
        source="thesis figures 4.3, 4.4, 4.6, 4.7",
        measure=angle_spectra,
    ),
    Claim(
        key="fig04_09_slam",
        title="A hidden user is located to a fraction of a millimetre over one wall",
        source="thesis figures 4.9 to 4.12",
        measure=slam,
        minutes=4.0,
    ),
    Claim(
        key="fig04_14_two_walls",
        title="Two drywalls, and a user over both of them",
        source="thesis figures 4.14 to 4.17",
        measure=two_walls,
        quick=False,
        minutes=25.0,
    ),
)
