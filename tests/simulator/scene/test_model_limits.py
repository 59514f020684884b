"""What the simulator tells about surfaces that are too steep for it."""

import numpy as np
import pytest

from scenes.files.loading import load_scenario
from scenes.schema.roughness import Roughness
from scenes.surfaces.roughness_spectrum import rough_profile
from simulator.scene.model_limits import model_notes, rms_slope


def test_a_steep_wall_is_told_and_a_gentle_one_is_not() -> None:
    steep = load_scenario(
        "slam_2d",
        ("objects.wall.roughness.rms_mm=0.2", "objects.wall.roughness.correlation_mm=0.3"),
    )
    assert "objects.wall.roughness: an rms slope of 0.94" in model_notes(steep)[0]
    assert model_notes(load_scenario("slam_2d")) == ()


def test_the_rms_slope_is_that_of_drawn_surfaces() -> None:
    rough = Roughness(rms_mm=0.05, correlation_mm=1.0, spectrum="exponential", inner_cutoff_mm=0.1)
    count, length = 200_001, 2.0
    heights = rough_profile(
        length=length,
        count=count,
        rms=rough.rms,
        correlation_length=rough.correlation_length,
        spectrum="exponential",
        inner_cutoff=rough.inner_cutoff,
        rng=np.random.default_rng(0),
    )
    drawn = np.std(np.diff(heights)) * (count - 1) / length
    # 20 000 independent slopes: a standard error of 0.5 %.
    assert drawn == pytest.approx(rms_slope(rough), rel=0.02)
