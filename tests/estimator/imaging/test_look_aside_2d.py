"""A linear array's look beyond the angles without grating lobes."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from estimator.array.linear_array import imaged_sine
from estimator.imaging.look_aside_2d import peaks_aside
from estimator.imaging.survey_2d import survey
from estimator.measurement.model import Echo
from validation.analytic.point_scatterer import point_echo

FREQUENCIES = np.linspace(220e9, 295e9, 301)


def polar(far: float, sine: float) -> Float[np.ndarray, " 3"]:
    return far * np.array([sine, np.sqrt(1 - sine**2), 0.0])


def echo(*places: Float[np.ndarray, " 3"]) -> Echo:
    positions = np.zeros((64, 3))
    positions[:, 0] = (np.arange(64) - 31.5) * 0.5e-3
    clean = point_echo(
        np.stack(places),
        positions=positions,
        frequencies=FREQUENCIES,
        radar_cross_section=np.ones(len(places)),
    )
    rng = np.random.default_rng(1)
    noise = rng.standard_normal((2, *clean.samples.shape))
    level = 0.1 * float(np.abs(clean.samples).mean())
    return replace(clean, samples=clean.samples + level * (noise[0] + 1j * noise[1]))


def test_a_point_beyond_the_sector_is_seen_there_and_the_lobe_of_one_within_is_not() -> None:
    outside, within = polar(0.3, 0.75), polar(0.25, 0.0)
    for places, expected in (((outside,), True), ((within,), False)):
        measured = echo(*places)
        assert imaged_sine(measured) < 0.55
        peaks = peaks_aside(measured, survey(measured), polar(1.0, 0.75), 0.4)
        assert peaks is not None
        near = np.linalg.norm(peaks - outside, axis=1) < 0.01
        assert bool(near.any()) is expected


def test_along_the_array_nothing_can_be_seen() -> None:
    measured = echo(polar(0.3, 0.2))
    assert peaks_aside(measured, survey(measured), polar(1.0, 0.99), 0.4) is None
