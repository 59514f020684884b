"""What the simulator tells about surfaces that are too steep for it."""

import numpy as np
import pytest

from scenes.files.loading import load_scenario
from scenes.realisations.object_surface import object_surface
from simulator.geometry.profile_lines import outline
from simulator.scene.model_limits import model_notes, rms_slope

STEEP = ("objects.wall.roughness.rms_mm=0.2", "objects.wall.roughness.correlation_mm=0.3")


def test_a_steep_wall_is_told_and_a_gentle_one_is_not() -> None:
    (note,) = model_notes(load_scenario("slam_2d", STEEP), seed=0)
    assert note.startswith("objects.wall.roughness: an rms slope of 0.")
    assert model_notes(load_scenario("slam_2d"), seed=0) == ()


def test_the_rms_slope_is_that_of_the_statistics() -> None:
    scenario = load_scenario("slam_2d", STEEP)
    (run,) = outline(object_surface(scenario, "wall", seed=0)).runs
    # √2 rms/l; differences over a quarter of l have (1 - 1/32)^½ of it, 1300 correlation lengths
    # scatter by 2 %.
    assert rms_slope(run) == pytest.approx(np.sqrt(2) * 0.2 / 0.3, rel=0.06)
