"""Bright sources beyond the sector without grating lobes are taken off the echo, others are not."""

from dataclasses import replace

import numpy as np
import pytest
from jaxtyping import Float

from estimator.array.linear_array import echo_resolution, imaged_sine
from estimator.array.resolution_cell import coarse_resolution
from estimator.array.windows import survey_weights
from estimator.imaging.backprojection import backproject
from estimator.imaging.focusing import PreparedEcho
from estimator.imaging.survey_2d import survey
from estimator.measurement.model import Echo
from estimator.walls.sources_aside import without_sources_aside
from validation.analytic.point_scatterer import point_echo


def polar(far: float, sine: float) -> Float[np.ndarray, " 3"]:
    return far * np.array([sine, np.sqrt(1 - sine**2), 0.0])


def echo(
    places: list[Float[np.ndarray, " 3"]], sizes: list[float], *, spacing: float = 0.5e-3
) -> Echo:
    positions = np.zeros((64, 3))
    positions[:, 0] = (np.arange(64) - 31.5) * spacing
    clean = point_echo(
        np.stack(places),
        positions=positions,
        frequencies=np.linspace(220e9, 295e9, 301),
        radar_cross_section=np.array(sizes),
    )
    rng = np.random.default_rng(7)
    noise = rng.standard_normal((2, *clean.samples.shape))
    level = 0.03 * float(np.abs(clean.samples).mean())
    return replace(clean, samples=clean.samples + level * (noise[0] + 1j * noise[1]))


def level(measured: Echo, place: Float[np.ndarray, " 3"]) -> float:
    focused = backproject(measured, place[None, None], weights=survey_weights(measured))
    return float(np.abs(focused[0, 0]))


INSIDE, OUTSIDE = polar(0.21, -0.2), polar(0.3, 0.72)


def test_a_flash_beyond_the_sector_goes_with_its_lobes_and_what_is_within_stays() -> None:
    measured = echo([INSIDE, OUTSIDE], [1.0, 100.0])
    alone = echo([INSIDE], [1.0])
    assert imaged_sine(measured) < 0.55
    lobes = survey(measured).peaks
    assert np.sum(np.abs(np.linalg.norm(lobes, axis=1) - 0.3) < 0.03) > 3
    found = without_sources_aside(PreparedEcho(measured))
    cleaned, brightest = found.prepared.echo, found.strongest
    assert brightest == pytest.approx(level(measured, OUTSIDE) ** 2, rel=0.5)
    (peak, *others) = survey(cleaned).peaks
    assert np.linalg.norm(peak - INSIDE) < 2e-3
    assert len(others) <= 1
    # The atoms about the flash overlap what is within by some 1/30, the lobe's dilution.
    assert level(cleaned, INSIDE) == pytest.approx(level(alone, INSIDE), rel=0.05)
    assert level(cleaned, OUTSIDE) < 0.05 * level(measured, OUTSIDE)


def test_a_source_within_the_sector_loses_nothing_to_its_own_lobes() -> None:
    measured = echo([INSIDE, polar(0.33, 0.35)], [1.0, 100.0])
    found = without_sources_aside(PreparedEcho(measured))
    cleaned, brightest = found.prepared.echo, found.strongest
    assert brightest == 0
    np.testing.assert_array_equal(cleaned.samples, measured.samples)


def test_an_array_without_grating_lobes_keeps_its_echo() -> None:
    measured = echo([INSIDE, OUTSIDE], [1.0, 100.0], spacing=0.25e-3)
    assert without_sources_aside(PreparedEcho(measured)).prepared.echo is measured


def test_a_line_is_followed_without_the_sources_that_are_not_on_it() -> None:
    measured = echo([INSIDE, OUTSIDE], [1.0, 100.0])
    found = without_sources_aside(PreparedEcho(measured))
    resolution = coarse_resolution(echo_resolution(measured))
    towards = 0.5 * (INSIDE + OUTSIDE)
    along = found.with_those_on(INSIDE, towards, resolution).echo
    np.testing.assert_allclose(along.samples, measured.samples, atol=1e-12)
    across = np.array([-towards[1], towards[0], 0.0])
    assert found.with_those_on(INSIDE, INSIDE + 0.2 * across, resolution) is found.prepared
