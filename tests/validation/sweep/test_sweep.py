import csv
import io
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest

from scenes.files.loading import load_scenario
from scenes.scenario import ScenarioError
from simulator.dataset.task_runner import Workers
from simulator.simulation import simulate
from validation.sweep import noise_free as kept
from validation.sweep import sweep
from validation.sweep.figures import draw_distribution, draw_errors, draw_found
from validation.sweep.noise_free import noise_free, noise_free_key, with_receiver
from validation.sweep.sweep import Outcome, SweepConfig, plan_sweep, run_sweep, statistics
from validation.sweep.tables import error_dataset, error_table

HERE = Workers(processes=0)

CONFIG = """
base = "los_user"
realisations = 2
seed = 4
set.base_station.elements = 32
set.radio.points = 64
set.radio.stop_ghz = 232.0
set."objects.wall.roughness" = { rms_mm = 0.05, correlation_mm = 3.0 }
[vary]
"noise.snr_db" = { kind = "grid", values = [10.0, 30.0] }
"""


def planned(folder: Path, text: str = CONFIG) -> sweep.SweepJob:
    (folder / "config.toml").write_text(text, encoding="utf-8")
    return plan_sweep(folder / "config.toml", folder / "cache")


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> tuple[sweep.SweepJob, tuple[Outcome, ...]]:
    job = planned(tmp_path_factory.mktemp("sweep"))
    return job, run_sweep(job, workers=HERE)


def test_what_is_kept_and_noise_are_the_simulation_bit_for_bit(tmp_path: Path) -> None:
    flaws = [
        "impairments.phase_noise_deg=3.0",
        "impairments.position_jitter_mm=0.1",
        "impairments.clock_offset_ns=0.5",
        "impairments.dynamic_range_db=60.0",
    ]
    small = ["base_station.elements=8", "radio.points=16"]
    scenario = load_scenario("los_user", [*small, *flaws, "noise.snr_db=10.0"])
    whole = simulate(scenario, seed=2, sample=3).measurement
    for _ in range(2):  # made, then read
        quiet = noise_free(scenario, seed=2, sample=3, folder=tmp_path)
        parts = with_receiver(quiet, scenario, seed=2, sample=3)
        assert whole.echo is not None
        assert parts.echo is not None
        np.testing.assert_array_equal(parts.echo.samples, whole.echo.samples)
        np.testing.assert_array_equal(parts.uplinks[0].samples, whole.uplinks[0].samples)
        assert (parts.clock_offset, parts.seed) == (whole.clock_offset, whole.seed)


def test_a_kept_measurement_knows_what_it_depends_on() -> None:
    def key(*overrides: str, seed: int = 0, sample: int = 0) -> str:
        return noise_free_key(load_scenario("los_user", overrides), seed=seed, sample=sample)

    assert key("noise.snr_db=3.0") == key()
    assert key("impairments.phase_noise_deg=3.0") == key()
    others = [
        key("radio.points=100"),
        key("impairments.position_jitter_mm=0.1"),
        key("users.user.position_m=[0.2, 0.41]"),
        key(seed=1),
        key(sample=1),
    ]
    assert len({key(), *others}) == 6


def test_half_a_measurement_is_made_again(tmp_path: Path) -> None:
    scenario = load_scenario("point_scatterers", ["base_station.elements=8", "radio.points=16"])
    first = noise_free(scenario, seed=0, sample=0, folder=tmp_path)
    (store,) = tmp_path.glob("*.zarr")
    (store / "frequency" / "zarr.json").write_text("{")
    again = noise_free(scenario, seed=0, sample=0, folder=tmp_path)
    assert first.echo is not None
    assert again.echo is not None
    np.testing.assert_array_equal(again.echo.samples, first.echo.samples)


def test_every_point_is_compared_with_the_truth(
    ran: tuple[sweep.SweepJob, tuple[Outcome, ...]],
) -> None:
    _, outcomes = ran
    assert [one.point for one in outcomes] == [0, 1, 2, 3]
    assert [one.realisation for one in outcomes] == [0, 0, 1, 1]
    assert [one.parameters["noise.snr_db"] for one in outcomes] == [10.0, 30.0, 10.0, 30.0]
    for one in outcomes:
        assert one.status == "found"
        assert one.error is not None
        assert one.bound is not None
        # Resolution of 12 GHz is 25 mm, and of 32 elements 84 mm there: peaks are found finer.
        assert one.error < 10e-3
    # Ten times the amplitude ratio, and a hundredth of the variance: 20 dB.
    first, second = outcomes[0].bound, outcomes[1].bound
    assert first is not None
    assert second is not None
    assert first / second == pytest.approx(10.0, rel=1e-6)


def test_what_was_computed_is_not_computed_again(
    ran: tuple[sweep.SweepJob, tuple[Outcome, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    job, outcomes = ran
    monkeypatch.setattr(sweep, "run_point", lambda *_: 1 // 0)
    assert run_sweep(job, workers=HERE) == outcomes
    # One noise-free measurement for each realisation serves both signal-to-noise ratios.
    assert len(list((job.cache / "noise_free").glob("*.zarr"))) == 2
    assert not sweep.missing_points(job)
    monkeypatch.undo()
    monkeypatch.setattr(
        "simulator.simulation.simulate", lambda *_, **__: pytest.fail("simulated again")
    )
    more = planned(job.cache.parent, CONFIG.replace("[10.0, 30.0]", "[10.0, 20.0, 30.0]"))
    assert len(sweep.missing_points(more)) == 2
    assert len(run_sweep(more, workers=HERE)) == 6


def test_a_point_that_fails_is_told_and_tried_again(
    ran: tuple[sweep.SweepJob, tuple[Outcome, ...]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    job = planned(tmp_path)
    monkeypatch.setattr(sweep, "with_receiver", lambda *_, **__: 1 // 0)
    failed = run_sweep(job, workers=HERE)
    assert {one.status for one in failed} == {"failed"}
    assert "ZeroDivisionError" in str(failed[0].reason)
    monkeypatch.setattr(sweep, "with_receiver", kept.with_receiver)
    assert run_sweep(job, workers=HERE) == ran[1]


SECOND = (
    "objects.second.kind=plate",
    "objects.second.material=metal",
    "objects.second.centre_m=[0.6, 0.4]",
    "objects.second.angle_deg=-45.0",
    "objects.second.length_m=0.25",
)
"""A second wall, on which no first reflection falls."""


def told_bound(*overrides: str, rms_mm: float = 0.05, snr_db: float = 60.0) -> tuple[float, float]:
    """Return the bounds of a user over one wall: the wall known, and as its echo tells."""
    small = ("base_station.elements=64", "radio.points=101", "radio.stop_ghz=250.0")
    room = ("objects.wall.centre_m=[0.0, 0.4]", "objects.wall.length_m=0.25")
    asked = (f"objects.wall.roughness.rms_mm={rms_mm}", f"noise.snr_db={snr_db}")
    user = "users.user.position_m=[0.4, 0.4]"
    scenario = load_scenario("slam_2d", [*small, *room, *asked, user, *overrides])
    known, told = sweep.position_bounds(scenario, "user")
    assert known is not None
    assert told is not None
    return known, told


def test_more_power_does_not_lower_the_bound_below_the_roughness_of_the_wall() -> None:
    known, told = told_bound()
    better_known, better_told = told_bound(snr_db=80.0)
    assert better_known == pytest.approx(0.1 * known, rel=1e-6)  # 20 dB are ten times
    # At 60 dB noise has no part left in what the wall's heights do.
    assert better_told == pytest.approx(told, rel=1e-3)
    assert told > 10 * known
    # Heights act in first order. The wall's own place gets no better as it gets smoother, for its
    # speckle stays what it is: the sum lies between a constant and that order.
    smoother = told_bound(rms_mm=0.025)[1]
    assert 0.5 * told < smoother < told


def test_only_the_wall_that_the_pilot_comes_over_bends_it() -> None:
    told = told_bound()[1]
    rough = (
        *SECOND,
        "objects.second.roughness.rms_mm=0.2",
        "objects.second.roughness.correlation_mm=0.3",
        "max_bounces=1",
    )
    assert told_bound(*rough)[1] == pytest.approx(told, rel=1e-3)
    smooth_second = load_scenario("slam_2d", [*SECOND, "noise.snr_db=20.0"])
    assert sweep.position_bounds(smooth_second, "user")[1] is None  # no echo tells where it is


def test_tables_hold_every_outcome(ran: tuple[sweep.SweepJob, tuple[Outcome, ...]]) -> None:
    job, outcomes = ran
    rows = list(csv.DictReader(io.StringIO(error_table(outcomes, job.space))))
    assert [float(row["error_m"]) for row in rows] == [one.error for one in outcomes]
    assert [float(row["noise.snr_db"]) for row in rows] == [10.0, 30.0, 10.0, 30.0]
    found = error_dataset(outcomes, job.config)
    assert found["error"].dims == ("noise.snr_db", "realisation", "user")
    chosen = found["error"].sel({"noise.snr_db": 30.0, "realisation": 1, "user": "user"})
    assert float(chosen) == outcomes[3].error
    assert found["error"].attrs["units"] == "m"
    assert found["wall_angle"].attrs["units"] == "rad"


def outcome(point: int, error: float | None) -> Outcome:
    return Outcome(
        point=point,
        realisation=point // 2,
        parameters={"noise.snr_db": (10.0, 30.0)[point % 2]},
        user="user",
        status="not_found" if error is None else "found",
        reason=None,
        error=error,
        deviation=None,
        bound=1e-3,
        bound_with_walls=None,
        wall_angle=None,
        wall_offset=None,
    )


def test_figures_show_what_was_found_and_the_bound() -> None:
    config = SweepConfig.model_validate(
        {
            "base": "los_user",
            "realisations": 2,
            "vary": {"noise.snr_db": {"kind": "grid", "values": [10.0, 30.0]}},
        }
    )
    outcomes = [outcome(0, 2e-3), outcome(1, 1e-3), outcome(2, None), outcome(3, 3e-3)]
    figure, axes = plt.subplots(3)
    draw_errors(axes[0], outcomes, config)
    lines = {tuple(np.nan_to_num(line.get_ydata(), nan=-1.0)) for line in axes[0].lines}
    assert (2.0, 1.0) in lines  # medians: of (2, not found) the smaller half is 2 mm
    assert (-1.0, 3.0) in lines  # the worst was not found: no point
    assert (1.0, 1.0) in lines  # the bound
    draw_found(axes[1], outcomes, config)
    assert axes[1].lines[0].get_ydata().tolist() == [50.0, 100.0]
    draw_distribution(axes[2], outcomes, config)
    assert axes[2].lines[0].get_ydata()[-1] == 50.0
    plt.close(figure)


def test_an_error_that_is_not_known_is_infinite() -> None:
    assert statistics([1.0, 2.0, None]) == (2.0, np.inf, np.inf)
    assert statistics([1.0] * 9 + [None]) == (1.0, 1.0, np.inf)
    assert statistics([3.0, 1.0, 2.0]) == (2.0, 3.0, 3.0)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (('kind = "grid", values = [10.0, 30.0]', 'kind = "uniform", low = 1.0, high = 2.0'), "neither a grid nor a list"),  # noqa: E501
        (("realisations = 2", "count = 3"), "count = 3: a sweep has its grid times realisations"),
        (("realisations = 2", 'axis = "radio.points"'), "axis = 'radio.points' is not swept"),
        (("noise.snr_db", "noise.snr"), "vary.noise.snr: unknown key"),
    ],
)  # fmt: skip
def test_wrong_sweeps_are_refused(tmp_path: Path, change: tuple[str, str], told: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        planned(tmp_path, CONFIG.replace(*change))
    assert told in str(caught.value)


@pytest.mark.parametrize(
    "path", sorted((Path(__file__).parents[3] / "validation" / "sweeps").glob("*.toml"))
)
def test_the_ready_made_sweeps_are_possible(path: Path, tmp_path: Path) -> None:
    job = plan_sweep(path, tmp_path)
    assert job.config.title
    assert job.config.points <= 200  # minutes on two cores
    for point in range(job.config.grid_size):
        assert job.space.first(point)[0].scenario is not None
