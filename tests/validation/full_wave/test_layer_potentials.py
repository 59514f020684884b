"""Boundary operators against their eigenvalues on a circle and what they do on a strip."""

import numpy as np
import pytest
from scipy.special import h2vp, hankel2, jv, jvp

from validation.full_wave.conducting_contour import circle, open_strip
from validation.full_wave.layer_potentials import (
    Block,
    CurveOperators,
    green_and_slope,
    second_difference,
)

AIR = 2 * np.pi  # all lengths in wavelengths


@pytest.mark.parametrize("loss", [0.0, 0.05])
def test_the_kernels_agree_with_bessel_functions_at_any_argument(loss: float) -> None:
    size = np.array([1e-3, 0.1, 0.29, 0.31, 2.0, 24.0, 26.0, 300.0])
    phase = size * (1 - 1j * loss) if loss else size
    green, slope = green_and_slope(phase)
    np.testing.assert_allclose(green, -0.25j * hankel2(0, phase), rtol=1e-9)
    expected = 0.25j * hankel2(1, phase) / phase + 1 / (2 * np.pi * phase**2)
    # The pole is 1e6 times as large as E at the smallest argument.
    np.testing.assert_allclose(slope, expected, rtol=1e-9)


@pytest.mark.parametrize("wavenumber", [AIR + 0j, 1.6 * AIR * (1 - 0.05j)])
@pytest.mark.parametrize("order", [0, 3, 8])
def test_waves_round_a_circle_are_eigenfunctions(wavenumber: complex, order: int) -> None:
    radius = 1.3
    body = circle(np.array([0.4, -0.2]), radius, spacing=1 / 8)
    curve, every = CurveOperators(body), np.arange(body.count)
    block = Block(curve, curve, every, every, wavenumber)
    wave = np.exp(1j * order * np.arctan2(body.normals[:, 1], body.normals[:, 0]))
    phase, round_ = wavenumber * radius, -0.5j * np.pi * radius
    bessel, hankel = jv(np.asarray(order), phase), hankel2(order, phase)
    slopes = jvp(order, phase), h2vp(order, phase)
    mixed = 0.5 * round_ * wavenumber * (slopes[0] * hankel + bessel * slopes[1])
    for found, value in (
        (block.single(), round_ * bessel * hankel),
        (block.double(), mixed),
        (block.adjoint(), mixed),
        (block.hypersingular(), round_ * wavenumber**2 * slopes[0] * slopes[1]),
    ):
        # The quadrature's fit errs by 8e-8 where a band is full; here it is half full.
        np.testing.assert_allclose(
            found @ (curve.root * wave), value * curve.root * wave, rtol=2e-8
        )


def test_static_parts_cancel_where_media_are_subtracted() -> None:
    body = circle(np.zeros(2), 0.7, spacing=1 / 12)
    curve, every = CurveOperators(body), np.arange(body.count)
    air, glass = (Block(curve, curve, every, every, k) for k in (AIR + 0j, 2.4 * AIR + 0j))
    whole = air.hypersingular() - glass.hypersingular()
    parts = air.hypersingular(static=False) - glass.hypersingular(static=False)
    assert np.abs(whole - parts).max() < 1e-11 * np.abs(air.hypersingular()).max()
    np.testing.assert_allclose(air.double() - glass.double(), air.double(0.0) - glass.double(0.0))


def test_the_static_current_of_a_strip_has_its_closed_form() -> None:
    # N of sqrt(1 - x²) is -1/2 all over the strip from -1 to 1, as k falls to 0.
    along = np.linspace(-1, 1, 30)
    strip = open_strip(np.stack([along, 0 * along], axis=-1), spacing=0.05)
    curve, every = CurveOperators(strip), np.arange(strip.count)
    block = Block(curve, curve, every, every, 1e-5 + 0j)
    density = np.sqrt(1 - strip.points[:, 0] ** 2)
    found = block.hypersingular() @ (curve.root * density) / curve.root
    inner = np.abs(strip.points[:, 0]) < 0.98
    # EDGE_DIGITS: the map resolves the edge to 1e-7; N amplifies by the points in a unit length.
    assert np.abs(found[inner] + 0.5).max() < 2e-5


def test_the_second_difference_differentiates_waves_twice() -> None:
    weights = second_difference()
    phase = np.linspace(0, 2, 9)
    steps = np.arange(1, len(weights))
    found = weights[0] + 2 * np.cos(phase[:, None] * steps) @ weights[1:]
    np.testing.assert_allclose(found, -(phase**2), atol=3e-9)


def test_a_curve_without_its_schwarzian_derivative_has_no_finite_part() -> None:
    body = circle(np.zeros(2), 1.0, spacing=0.2)
    cut = type(body)(**{**vars(body), "closed": False})
    with pytest.raises(ValueError, match="use open_strip"):
        _ = CurveOperators(cut).static_diagonal
