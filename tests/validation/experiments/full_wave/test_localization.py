"""The estimator on full-wave data: what is solved is the scenario, and what is claimed of it."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from scenes.files.loading import load_scenario
from scenes.realisations.object_surface import object_surface
from validation.experiments.full_wave.localization import (
    CASES,
    HALF_SIZE,
    Case,
    Located,
    Trial,
    correlation,
    draw,
    fails,
    localization,
    noisy_measurement,
    strip_scene,
    summary,
    table_row,
)
from validation.full_wave.strip_scattering import StripFields

SMOOTH_NAME, ROUGH_NAME = CASES
RIGHT = Located(status="found", error=1e-4, square=1.0, wall_angle=1e-4, wall_offset=-1e-5)
TRIAL = Trial(
    seed=3, full_wave=RIGHT, simulated=RIGHT, echo_correlation=0.96, uplink_correlation=0.999
)


def test_the_solver_gets_the_simulator_s_own_wall_and_user() -> None:
    scenario = load_scenario("slam_2d", CASES[SMOOTH_NAME])
    scene = strip_scene(scenario, seed=4)
    surface = object_surface(scenario, "wall", seed=4)
    # Some points of the finer profile are the facets' vertices, of the same frozen surface.
    finer = (len(scene.profile) - 1) / (len(surface.vertices) - 1)
    along = np.linspace(0, 1, len(scene.profile))
    coarse = np.linspace(0, 1, len(surface.vertices))
    for axis in range(2):
        nearby = np.interp(coarse, along, scene.profile[:, axis])
        # Linear interpolation of the finer profile errs by h²·h''/8 = 0.03²/8·0.05·2/0.3² mm.
        np.testing.assert_allclose(nearby, surface.vertices[:, axis], atol=1e-6)
    assert finer > 2
    (user,) = scene.users
    assert user.width == 0.1
    assert user.aim is not None
    np.testing.assert_allclose(user.aim / np.hypot(*user.aim), [-1.0, 0.0], atol=1e-12)
    assert scene.detail == pytest.approx(1e-4)


def test_an_open_user_and_a_smooth_wall_are_handed_over_as_such() -> None:
    overrides = ("objects.wall.roughness.rms_mm=0", "users.user.antenna.kind=isotropic")
    isotropic = load_scenario("los_user", overrides[:1])
    scene = strip_scene(isotropic, seed=0)
    assert scene.users[0].aim is None
    assert np.isinf(scene.detail)


def test_the_noise_is_the_same_for_any_fields() -> None:
    scenario = load_scenario("slam_2d", ("base_station.elements=8", "radio.points=20"))
    echo = np.exp(1j * np.arange(160.0)).reshape(8, 20)
    first, second = (
        noisy_measurement(scenario, StripFields(echo=one, uplinks=one[None]), seed=2)
        for one in (echo, echo.conj())
    )
    assert first.echo is not None
    assert second.echo is not None
    noise = first.echo.samples - echo
    np.testing.assert_allclose(noise, second.echo.samples - echo.conj(), atol=1e-12)
    assert np.mean(np.abs(noise) ** 2) == pytest.approx(0.01, rel=0.3)  # 20 dB, 160 samples
    assert first.waves == "cylindrical"


def test_a_case_that_keeps_its_claims_has_no_fails() -> None:
    assert fails(Case(name=SMOOTH_NAME, trials=(TRIAL, TRIAL))) == []


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (replace(RIGHT, status="not_found", error=np.nan, square=np.nan), "not_found"),
        (replace(RIGHT, square=20.0), "of 13.8"),
        (replace(RIGHT, error=1.1e-3), "are the limits"),
        (replace(RIGHT, error=5e-4), "are the limits"),
    ],
)
def test_a_claim_that_does_not_hold_is_told(wrong: Located, message: str) -> None:
    case = Case(name=SMOOTH_NAME, trials=(replace(TRIAL, full_wave=wrong),))
    said = fails(case)
    assert said
    assert message in " ".join(said)


def test_the_rougher_wall_has_no_limit_on_the_error_but_its_own_covariance() -> None:
    far = replace(TRIAL, full_wave=replace(RIGHT, error=2e-3, square=9.0))
    assert fails(Case(name=ROUGH_NAME, trials=(far,))) == []


def test_a_trial_and_a_case_are_told_in_millimetres_and_degrees() -> None:
    assert "full wave found      0.100 mm" in table_row("a", TRIAL)
    assert "user median 0.100, worst 0.100 mm" in summary(Case(name="a", trials=(TRIAL,)))


def test_a_field_is_correlated_with_its_multiple() -> None:
    field = np.exp(1j * np.arange(6.0))
    assert correlation(field, 3j * field) == pytest.approx(1.0)


@pytest.mark.slow
def test_a_user_is_found_from_full_waves_at_half_size() -> None:
    case = localization(SMOOTH_NAME, trials=1, overrides=HALF_SIZE)
    assert fails(case) == []
    assert case.trials[0].echo_correlation > 0.94  # stored reference 0.970, of other draws
    assert case.trials[0].uplink_correlation > 0.999


def test_the_figure_shows_each_realisation_and_the_limits() -> None:
    worse = replace(RIGHT, error=2e-4)
    case = Case(
        name=SMOOTH_NAME, trials=tuple(replace(TRIAL, seed=i, simulated=worse) for i in range(3))
    )
    figure = Figure()
    ax = figure.subplots()
    draw(ax, case)
    full_wave, simulated, *limits = ax.lines
    np.testing.assert_allclose(full_wave.get_ydata(), 0.1)  # type: ignore[arg-type]
    np.testing.assert_allclose(simulated.get_ydata(), 0.2)  # type: ignore[arg-type]
    assert len(limits) == 2
