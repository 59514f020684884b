import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenes.scenario import Plate
from scenes.surfaces.facet_spacing import facet_spacing, mesh_facet_count, steps, steps_round


def spacing_of(wavelength: float = 1e-3, **changes: Any) -> float:
    options: dict[str, Any] = {"material": "metal", "centre_m": (0, 1, 0), "length_m": 0.4}
    return facet_spacing(Plate(kind="plate", **(options | changes)), wavelength)


def test_a_smooth_surface_needs_four_facets_to_the_wavelength() -> None:
    assert spacing_of() == pytest.approx(0.25e-3)
    assert spacing_of(roughness={"rms_mm": 0.0, "correlation_mm": 0.1}) == pytest.approx(0.25e-3)


def test_a_rough_surface_needs_four_facets_to_the_correlation_length() -> None:
    assert spacing_of(roughness={"rms_mm": 0.05, "correlation_mm": 0.3}) == pytest.approx(75e-6)
    assert spacing_of(roughness={"rms_mm": 0.05, "correlation_mm": 3}) == pytest.approx(0.25e-3)


def test_an_exponential_surface_needs_two_facets_to_its_cutoff() -> None:
    rough = {"rms_mm": 0.05, "correlation_mm": 0.3, "spectrum": "exponential"}
    assert spacing_of(roughness=rough | {"inner_cutoff_mm": 0.03}) == pytest.approx(15e-6)
    assert spacing_of(roughness=rough | {"inner_cutoff_mm": 0.3}) == pytest.approx(75e-6)


def test_an_absorber_needs_no_facets() -> None:
    assert spacing_of(material="absorber") == math.inf


@given(st.floats(1e-3, 10), st.floats(1e-5, 20))
def test_steps_are_the_fewest_that_are_not_longer_than_the_spacing(
    length: float, spacing: float
) -> None:
    count = steps(length, spacing)
    assert length / count <= spacing * (1 + 1e-11)  # the rounding that is forgiven
    assert count == 1 or length / (count - 1) > spacing * (1 - 1e-11)


def test_a_whole_number_of_steps_does_not_gain_one_by_rounding() -> None:
    assert [steps(0.1 * n, 0.1) for n in range(1, 50)] == list(range(1, 50))


def test_a_circle_stays_round_however_coarse() -> None:
    assert steps_round(1.0, math.inf) == 64
    assert steps_round(1.0, 0.01) == math.ceil(200 * math.pi)


def test_a_mesh_needs_more_triangles_the_finer_it_is() -> None:
    assert mesh_facet_count(1.0, 12, math.inf) == 12
    # Right isosceles triangles whose longest edge is the spacing have spacing²/4 each.
    assert mesh_facet_count(1.0, 12, 0.01) == 12 + 40_000
