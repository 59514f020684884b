from dataclasses import replace

import pytest

from validation.experiments.fig04_angle_spectra import check, spectra_of


@pytest.mark.parametrize("aoa_deg", [90.0, 70.0])
@pytest.mark.parametrize("distance", [1.8, 20.0])
def test_the_thesis_users_are_found_where_they_are(aoa_deg: float, distance: float) -> None:
    assert "spherical misses by 0.0" in check(spectra_of(aoa_deg, distance))


def test_a_model_that_misses_fails_the_check() -> None:
    spectra = spectra_of(90.0, 20.0)
    with pytest.raises(RuntimeError, match="the spherical model misses by 0"):
        check(replace(spectra, aoa_deg=90.5))
