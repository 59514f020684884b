"""Waves taken out of a planar array's pilot, of which edges shadow a part."""

from typing import Any

import numpy as np
import pytest
from jaxtyping import Bool, Complex, Float
from scipy.constants import speed_of_light

from estimator.array.planar_array import planar_array
from estimator.channel.angle_range_map_3d import direction_map
from estimator.channel.path import LEAST_SHARE, Path
from estimator.channel.path_extraction_3d import find_space_paths
from estimator.measurement.model import Uplink

BAND = np.linspace(57e9, 64e9, 41)
SIDE = 16
SPACING = 2.4e-3
COSINES = (0.25, -0.1)
LENGTH = 0.38


def positions() -> Float[np.ndarray, "elements 3"]:
    line = SPACING * (np.arange(SIDE) - (SIDE - 1) / 2)
    x, z = np.meshgrid(line, line, indexing="ij")
    return np.stack([x.ravel(), np.zeros(SIDE**2), z.ravel()], axis=-1)


def pilot(cosines: tuple[float, float], length: float) -> Complex[np.ndarray, "elements freqs"]:
    place = length * np.array(
        [cosines[0], np.sqrt(1 - cosines[0] ** 2 - cosines[1] ** 2), cosines[1]]
    )
    far = np.linalg.norm(positions() - place, axis=-1)
    return np.asarray(np.exp(-2j * np.pi / speed_of_light * far[:, None] * BAND) / far[:, None])


def waves(samples: Complex[np.ndarray, "elements freqs"]) -> tuple[Path, ...]:
    uplink = Uplink(samples=samples, positions=positions(), frequencies=BAND, user="a")
    array = planar_array(uplink.positions)
    chart = direction_map(uplink, array, least_share=LEAST_SHARE)
    return find_space_paths(uplink, array, chart).paths


def lit_by(kind: str) -> Bool[np.ndarray, " elements"]:
    x, z = positions()[:, 0], positions()[:, 2]
    lit: dict[str, Bool[np.ndarray, " elements"]] = {
        "upright edge": x > -0.006,
        "level edge": z < 0.004,
        "slanted edge": x + z < 0.008,
        "corner": (x < 0.005) & (z < 0.005),
    }
    return lit[kind]


@pytest.mark.parametrize("kind", ["upright edge", "level edge", "slanted edge", "corner"])
def test_a_wave_that_an_edge_shadows_is_one_wave_from_its_true_source(
    kind: str, world: Any
) -> None:
    lit = lit_by(kind)
    samples = pilot(COSINES, LENGTH)
    samples[~lit] *= 0.03
    (path,) = waves(world.noisy(samples, 15.0, np.random.default_rng(5)))
    assert path.shadow is not None
    # The median over an element and its neighbours moves an edge by half a spacing, and rounds a
    # corner: less than a row of elements.
    assert np.count_nonzero(path.shadow.lit != lit) <= SIDE
    np.testing.assert_allclose(
        path.shadow.reached, positions()[lit].mean(axis=0), atol=0.5 * SPACING
    )
    np.testing.assert_allclose(path.shadow.dark, positions()[~lit].mean(axis=0), atol=SPACING)
    assert path.specular
    assert path.share == pytest.approx(1.0, abs=0.03)
    errors = np.array([*path.wave.bearing, path.wave.path_length]) - [*COSINES, LENGTH]
    square = errors @ np.linalg.solve(path.wave.covariance, errors)
    assert square < 16.3  # χ² of three: one in a thousand


def test_two_waves_that_an_edge_parts_are_found_each_with_its_own_elements(world: Any) -> None:
    lit = lit_by("upright edge")
    samples = pilot(COSINES, LENGTH)
    other = (0.2, 0.3)
    samples[~lit] = pilot(other, 0.5)[~lit]
    first, second = waves(world.noisy(samples, 15.0, np.random.default_rng(5)))
    for path, cosines, own in ((first, COSINES, lit), (second, other, ~lit)):
        assert path.shadow is not None
        assert np.count_nonzero(path.shadow.lit != own) <= SIDE
        deviation = np.sqrt(np.diag(path.free.covariance)[:2])
        assert np.all(np.abs(path.free.bearing - cosines) < 5 * deviation)


def test_two_waves_and_a_bent_front_are_no_shadow(world: Any) -> None:
    rng = np.random.default_rng(7)
    both = pilot((0.2, 0.1), 0.4) + 0.8 * pilot((0.27, 0.1), 0.41)
    bent = pilot(COSINES, LENGTH) * np.exp(0.5j * rng.standard_normal((SIDE**2, 1)))
    for samples in (both, bent):
        assert all(path.shadow is None for path in waves(samples))
