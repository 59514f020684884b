from dataclasses import replace

import numpy as np
import pytest

from estimator.measurement.model import Echo, Measurement, Uplink
from estimator.results.deferred import Deferred
from estimator.results.estimate import (
    AngleRangeMap,
    Estimate,
    Image,
    Images,
    Mirror,
    Target,
    UserEstimate,
)
from estimator.results.pixel_grid import PixelGrid
from validation.metrics.truth import Truth


@pytest.fixture
def measurement() -> Measurement:
    positions = np.stack([np.linspace(-0.06, 0.06, 13), np.zeros(13), np.zeros(13)], axis=-1)
    frequencies = np.linspace(220e9, 295e9, 16)
    samples = np.ones((13, 16), dtype=np.complex128)
    return Measurement(
        echo=Echo(samples=samples, positions=positions, frequencies=frequencies),
        uplinks=(
            Uplink(samples=samples, positions=positions, frequencies=frequencies, user="ann"),
        ),
        scenario="hall",
        seed=3,
    )


@pytest.fixture
def truth() -> Truth:
    return Truth(
        user_position={"ann": np.array([1.0, 0.8, 0.0])},
        wall_start={"door": np.array([-0.14, 0.66, 0.0])},
        wall_end={"door": np.array([0.14, 0.94, 0.0])},
    )


@pytest.fixture
def estimate() -> Estimate:
    """What an estimator would say of the thesis' scene, with an error of 5 mm."""
    grid = PixelGrid.spanning(x=(-0.3, 0.3), y=(0.5, 1.1), spacing=0.005)
    away = np.abs(grid.points[..., 1] - 0.8 - grid.points[..., 0]) / np.sqrt(2)
    image = Image(values=np.exp(-((away / 0.01) ** 2)).astype(np.complex128), grid=grid)
    user = UserEstimate(
        name="ann",
        status="found",
        position=np.array([1.003, 0.796, 0.0]),
        covariance=np.diag([1e-6, 4e-6, 0.0]),
        bounces=1,
        aoa=np.pi / 2,
        path_length=1.8,
        path=np.array([[0.0, 0.0, 0.0], [0.0, 0.8, 0.0], [1.003, 0.796, 0.0]]),
    )
    mirror = Mirror(
        start=np.array([-0.13, 0.67, 0.0]),
        end=np.array([0.13, 0.93, 0.0]),
        normal=np.array([1.0, -1.0, 0.0]) / np.sqrt(2),
        covariance=np.diag([1e-8, 1e-10]),
        confidence=0.999,
        level_db=24.0,
    )
    heard = AngleRangeMap(
        values=np.ones((5, 7), dtype=np.complex128),
        aoa=np.linspace(1.4, 1.7, 5),
        path_length=np.linspace(1.7, 1.9, 7),
        user="ann",
    )
    return Estimate(
        users=(user,),
        mirrors=(mirror,),
        targets=(
            Target(
                position=np.array([0.3, 0.7, 0.0]),
                ghost=np.array([-0.1, 1.1, 0.0]),
                seen_through=(0,),
            ),
        ),
        images=Deferred.of(Images(raw=image, corrected=image)),
        maps=(heard,),
        close_up_maps=Deferred.of((heard,)),
        notes=("z = 0 and y > 0 are assumed",),
        timings={"image": 0.25},
    )


@pytest.fixture
def nothing_found(estimate: Estimate) -> Estimate:
    lost = UserEstimate(name="ann", status="not_found", reason="no peak above the noise")
    images = Deferred.of(Images(raw=estimate.raw_image))
    return replace(estimate, users=(lost,), mirrors=(), targets=(), images=images)
