"""What a flat opening lets through: Kirchhoff's integral, edges, and far away a plate's lobes."""

import numpy as np
import pytest
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from simulator.specular.rim_diffraction import rim_factor

FREQUENCIES = np.linspace(57e9, 64e9, 5)
WITHIN = 3e-3
"""Of the pieces of the rim, whose phase is taken as straight, and of the sum over cells. [-]"""


def square(off: float, side: float = 0.2) -> Float[np.ndarray, "1 4 3"]:
    """An opening at y = 0, moved along x."""
    x = off + side * np.array([-0.5, 0.5, 0.5, -0.5])
    z = side * np.array([-0.5, -0.5, 0.5, 0.5])
    return np.stack([x, np.zeros(4), z], axis=-1)[None]


def over_cells(
    source: Float[np.ndarray, " 3"],
    receiver: Float[np.ndarray, " 3"],
    off: float,
    side: float = 0.2,
    count: int = 400,
) -> Complex[np.ndarray, " freqs"]:
    """Kirchhoff's integral over the opening, by cells, over the wave straight through."""
    along = side * ((np.arange(count) + 0.5) / count - 0.5)
    x, z = np.meshgrid(off + along, along, indexing="ij")
    places = np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=-1)
    s, r = (np.linalg.norm(places - end, axis=-1) for end in (source, receiver))
    straight = float(np.linalg.norm(receiver - source))
    wavenumbers = 2 * np.pi * FREQUENCIES[:, None] / speed_of_light
    oblique = abs(source[1]) / s * (1 + 1 / (1j * wavenumbers * s))
    oblique = oblique + abs(receiver[1]) / r * (1 + 1 / (1j * wavenumbers * r))
    phase = np.exp(-1j * wavenumbers * (s + r - straight))
    cells = 1j * wavenumbers / (4 * np.pi) * oblique * phase / (s * r)
    total: np.ndarray = cells.sum(axis=-1) * straight * (side / count) ** 2
    return total


@pytest.mark.parametrize("off", [0.0, 0.05, 0.1, 0.1003, 0.12, 0.2, 0.4])
def test_an_opening_lets_through_what_kirchhoffs_integral_says(off: float) -> None:
    source, receiver = np.array([0.1, -1.2, 0.02]), np.array([-0.1, 1.6, -0.03])
    found = rim_factor(source[None], receiver[None], square(off), FREQUENCIES)[0]
    assert np.abs(found - over_cells(source, receiver, off)).max() <= WITHIN


def test_a_line_that_misses_the_opening_by_far_has_its_lobes() -> None:
    """Mirrored by a plate that is tilted by 20° the wave turns by 40°."""
    source, receiver = np.array([1.1, -1.2, 0.0]), np.array([0.3, 1.6, 0.1])
    found = rim_factor(source[None], receiver[None], square(0.0), FREQUENCIES)[0]
    exact = over_cells(source, receiver, 0.0)
    assert np.abs(found - exact).max() <= 0.03 * np.abs(exact).max()


def test_half_of_space_lets_half_of_the_field_through_on_its_edge() -> None:
    side = 4.0  # the other edges' waves are 1/(π √2 v) each, with v = 57 some 4e-3
    ends = np.array([[0.0, -1.6, 0.0]]), np.array([[0.0, 1.6, 0.0]])
    for beside in (-1e-6, 0.0, 1e-6):
        found = rim_factor(*ends, square(side / 2 + beside, side), FREQUENCIES)[0]
        assert np.abs(found - 0.5).max() <= 3 * 4e-3


def test_it_does_not_matter_which_way_round_the_rim_is_gone() -> None:
    ends = np.array([[0.1, -1.2, 0.02]]), np.array([[-0.1, 1.6, -0.03]])
    one = rim_factor(*ends, square(0.05), FREQUENCIES)
    assert rim_factor(*ends, square(0.05)[:, ::-1], FREQUENCIES) == pytest.approx(one, abs=1e-6)


def test_two_halves_of_an_opening_let_through_what_the_whole_does() -> None:
    ends = np.array([[0.1, -1.2, 0.02]]), np.array([[-0.1, 1.6, -0.03]])
    whole = square(0.0)
    left, right = whole.copy(), whole.copy()
    left[0, 1:3, 0] = right[0, [0, 3], 0] = 0.013
    both = rim_factor(*ends, left, FREQUENCIES) + rim_factor(*ends, right, FREQUENCIES)
    assert np.abs(both - rim_factor(*ends, whole, FREQUENCIES)).max() <= WITHIN


def test_an_opening_without_area_lets_nothing_through() -> None:
    ends = np.array([[0.1, -1.2, 0.02]]), np.array([[-0.1, 1.6, -0.03]])
    nothing = np.repeat(square(0.0)[:, :1], 4, axis=1)
    assert not rim_factor(*ends, nothing, FREQUENCIES).any()
