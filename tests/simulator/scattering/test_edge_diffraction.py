"""Fringe currents at edges, against closed forms and a method of moments."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenes.files.loading import load_scenario
from scenes.schema.radio import Polarization
from simulator.scattering.edge_diffraction import fringe
from simulator.simulation import simulate
from validation.experiments.full_wave.localization import WALL, strip_scene
from validation.full_wave.strip_scattering import strip_response

angles = st.floats(0.05, np.pi - 0.05)


@given(angles, angles, st.sampled_from(["vertical", "horizontal"]))
def test_an_edge_does_not_tell_which_end_transmits(
    one: float, other: float, field: Polarization
) -> None:
    there, back = (
        fringe(a, b, exterior=1.5, faces=(True, False), polarization=field)
        for a, b in ((np.array(one), np.array(other)), (np.array(other), np.array(one)))
    )
    assert there == pytest.approx(back, rel=1e-6, abs=1e-9)


@given(angles, angles, st.sampled_from(["vertical", "horizontal"]))
def test_where_two_faces_make_a_plane_there_is_no_edge(
    one: float, other: float, field: Polarization
) -> None:
    if abs(one + other - np.pi) < 1e-3:
        return  # at the mirror both terms are without bounds
    found = fringe(
        np.array(one), np.array(other), exterior=1.0, faces=(True, True), polarization=field
    )
    assert abs(float(found)) < 1e-6


@pytest.mark.parametrize("exterior", [1.5, 2.0])
@pytest.mark.parametrize("field", ["vertical", "horizontal"])
def test_towards_the_mirror_the_fringe_is_finite(exterior: float, field: Polarization) -> None:
    at, beside = (
        float(
            fringe(
                np.array(0.9 + step),
                np.array(np.pi - 0.9),
                exterior=exterior,
                faces=(True, False),
                polarization=field,
            )
        )
        for step in (0.0, 1e-3)
    )
    assert abs(at) < 2
    assert at == pytest.approx(beside, abs=5e-3)  # a slope of some units per radian


def test_a_half_plane_diffracts_by_sommerfelds_solution() -> None:
    one, other = 0.8, 1.3
    exact = -0.5 / np.cos((one - other) / 2) + 0.5 / np.cos((one + other) / 2)
    found = fringe(
        np.array(one), np.array(other), exterior=2.0, faces=(False,), polarization="vertical"
    )
    assert float(found) == pytest.approx(exact, rel=1e-12)


def test_a_smooth_strip_echoes_as_full_wave_says() -> None:
    scenario = load_scenario(
        "slam_2d",
        (
            "waves=cylindrical",
            "noise.snr_db=inf",
            "radio.points=3",
            "base_station.elements=14",
            "base_station.spacing_mm=10.0",
            f"objects.{WALL}.length_m=0.08",
            f"objects.{WALL}.roughness.rms_mm=0",
        ),
    )
    measured = simulate(scenario, seed=0).measurement
    assert measured.echo is not None
    scene = strip_scene(scenario, seed=0)
    solved = np.stack([strip_response(scene, float(f))[0] for f in scenario.radio.frequencies], -1)
    simulated = measured.echo.samples
    norms = np.linalg.norm(simulated), np.linalg.norm(solved)
    # What is left: waves over both edges, 1/kL = 2e-3 in amplitude.
    assert abs(np.vdot(simulated, solved)) / np.prod(norms) > 0.9999
    assert abs(20 * np.log10(norms[0] / norms[1])) < 0.02
