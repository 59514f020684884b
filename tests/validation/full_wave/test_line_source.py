"""Fields of line sources against tabulated functions and the wave equation."""

import numpy as np
import pytest
from scipy.special import hankel2

from validation.full_wave.line_source import LineSource, greens_function, radial_derivative

WAVENUMBER = 5400.0  # 258 GHz
BEAM = LineSource(position=np.array([0.1, 0.2]), aim=np.array([-2.0, 0.0]), width=0.1)
FIXED = LineSource(position=np.array([0.1, 0.2]), aim=np.array([-2.0, 0.0]), displacement=0.02)
OPEN = LineSource(position=np.array([0.1, 0.2]))


def test_greens_function_is_the_hankel_function_near_and_far() -> None:
    phase = np.concatenate([np.geomspace(1e-6, 25, 200), np.linspace(25, 7000, 4001)])
    expected = -0.25j * hankel2(0, phase)
    # The series leaves out 1e-10 at its near end; SciPy's own phase errs by 1e-16 · kR.
    np.testing.assert_allclose(greens_function(phase), expected, rtol=1e-9)


def test_the_radial_derivative_is_that_of_greens_function() -> None:
    phase, step = np.linspace(1.0, 60.0, 50), 1e-5
    slope = (greens_function(phase + step) - greens_function(phase - step)) / (2 * step)
    # The stencil errs by step²/6, rounding by 1e-16/step; next to the series by 1e-10/step.
    np.testing.assert_allclose(radial_derivative(phase), slope, atol=1e-6)


@pytest.mark.parametrize("source", [OPEN, BEAM, FIXED])
def test_a_source_solves_the_wave_equation_and_knows_its_gradient(source: LineSource) -> None:
    step = 2 * np.pi / WAVENUMBER / 200
    middle = np.array([-0.3, 0.23])
    around = middle + step * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1.0]])
    values = source.field(around, WAVENUMBER)
    laplacian = (values[1:].sum() - 4 * values[0]) / step**2
    # The stencil errs by (kh)²/12 = 8e-5.
    assert abs(laplacian / WAVENUMBER**2 + values[0]) < 2e-4 * abs(values[0])
    slopes = np.array([values[1] - values[2], values[3] - values[4]]) / (2 * step)
    gradient = source.gradient(middle[None], WAVENUMBER)[0]
    assert np.linalg.norm(slopes - gradient) < 2e-4 * np.linalg.norm(gradient)  # (kh)²/6


def test_a_beam_is_a_gaussian_about_its_aim_and_has_the_level_of_an_open_source() -> None:
    angles = np.linspace(-0.2, 0.2, 21)
    points = BEAM.position + 50 * np.stack([-np.cos(angles), np.sin(angles)], axis=-1)
    ratio = np.abs(BEAM.field(points, WAVENUMBER) / OPEN.field(points, WAVENUMBER))
    # Exactly exp(−kb(1 − cos ψ)), up to b/R = 4e-4 times kb(1 − cos ψ).
    np.testing.assert_allclose(ratio, np.exp(-(1 - np.cos(angles)) / 0.01), rtol=2e-3)
    # A Gaussian in the angle up to kbψ⁴/24 = 0.007.
    np.testing.assert_allclose(ratio, np.exp(-(angles**2) / 0.02), rtol=1e-2)


def test_the_two_ways_to_tell_a_beam_agree() -> None:
    points = np.array([[-0.4, 0.25]])
    same = LineSource(position=BEAM.position, aim=BEAM.aim, displacement=100 / WAVENUMBER)
    np.testing.assert_allclose(
        same.field(points, WAVENUMBER), BEAM.field(points, WAVENUMBER), rtol=1e-10
    )


@pytest.mark.parametrize(
    ("aim", "width", "displacement"),
    [(None, 0.1, None), ([1.0, 0.0], None, None), ([1.0, 0.0], 0.1, 0.1), ([1.0, 0.0], -0.1, None)],
)
def test_half_a_beam_is_refused(
    aim: list[float] | None, width: float | None, displacement: float | None
) -> None:
    direction = None if aim is None else np.array(aim)
    with pytest.raises(ValueError, match="a beam needs an aim"):
        LineSource(position=np.zeros(2), aim=direction, width=width, displacement=displacement)
