"""Fields of one frozen profile."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.constants import speed_of_light

import validation.full_wave.profile_scattering as module
from validation.full_wave.boundary_equations import BoundaryProblem, Polarisation, dense_fields
from validation.full_wave.direct_solution import FullWaveError
from validation.full_wave.line_source import LineSource
from validation.full_wave.profile_scattering import profile_body, profile_fields
from validation.full_wave.strip_scattering import StripScene, strip_fields

FREQUENCIES = np.array([240e9, 260e9])
PLACES = np.stack([np.linspace(-0.06, 0.06, 12), 0.15 + np.zeros(12)], axis=-1)


def profile() -> np.ndarray:
    along = np.linspace(-0.004, 0.004, 300)
    heights = 4e-5 * np.sin(9e3 * along) + 3e-5 * np.cos(1.7e4 * along)
    return np.stack([along, heights], axis=-1)


def test_a_strip_in_tm_is_that_of_the_strip_solver() -> None:
    scene = StripScene(profile=profile(), positions=PLACES, detail=6e-5)
    found = profile_fields(
        profile(), FREQUENCIES, polarisation="TM", sources=PLACES, receivers="echo", detail=6e-5
    )
    expected = strip_fields(scene, FREQUENCIES, workers=1).echo
    assert np.linalg.norm(found - expected) < 1e-6 * np.linalg.norm(expected)


@pytest.mark.parametrize("polarisation", ["TM", "TE"])
@pytest.mark.parametrize("permittivity", [None, 2.56 - 0.13j])
def test_compression_and_chosen_places_lose_nothing(
    polarisation: Polarisation, permittivity: complex | None
) -> None:
    frequency = float(FREQUENCIES[0])
    body = profile_body(
        profile(), frequency, permittivity=permittivity, thickness=1.0e-3, detail=8e-5
    )
    wavenumber = 2 * np.pi * frequency / speed_of_light
    ends = [LineSource(position=place) for place in PLACES]
    dense = dense_fields(BoundaryProblem([body], polarisation, wavenumber), ends, ends)
    keys: dict[str, Any] = {"permittivity": permittivity, "thickness": 1.0e-3, "detail": 8e-5}
    found = profile_fields(
        profile(),
        FREQUENCIES[:1],
        polarisation=polarisation,
        sources=PLACES,
        receivers=ends,
        **keys,
    )[..., 0]
    # TOLERANCE times the levels, and the coupling's condition.
    assert np.linalg.norm(found - dense) < 1e-5 * np.linalg.norm(dense)
    echo = profile_fields(
        profile(),
        FREQUENCIES[:1],
        polarisation=polarisation,
        sources=PLACES,
        receivers="echo",
        **keys,
    )[..., 0]
    np.testing.assert_allclose(echo, np.diagonal(found), rtol=1e-6, atol=1e-9 * abs(echo).max())


def test_a_board_looks_to_the_left_of_its_profile() -> None:
    body = profile_body(profile(), 250e9, permittivity=3.0 + 0j, thickness=2e-3)
    low, high = body.contour.points[:, 1].min(), body.contour.points[:, 1].max()
    assert low == pytest.approx(profile()[0, 1] - 2e-3, abs=1e-4)
    assert high < 8e-5


def test_what_lies_on_disk_is_not_solved_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keys: dict[str, Any] = {
        "polarisation": "TE",
        "sources": PLACES,
        "receivers": PLACES[:3],
        "detail": 8e-5,
    }
    first = profile_fields(profile(), FREQUENCIES[:1], folder=tmp_path, **keys)
    solved = []

    def counted(*arguments: Any) -> BoundaryProblem:
        solved.append(arguments)
        return BoundaryProblem(*arguments)

    monkeypatch.setattr(module, "BoundaryProblem", counted)
    again = profile_fields(profile(), FREQUENCIES, folder=tmp_path, **keys)
    assert len(solved) == 1
    np.testing.assert_array_equal(again[..., :1], first)
    assert again.shape == (12, 3, 2)
    value: dict[str, Any] = {
        "permittivity": lambda f: np.full(f.shape, 3 - 0.1j),
        "thickness": 1e-3,
    }
    other = profile_fields(profile(), FREQUENCIES[:1], folder=tmp_path, **keys, **value)
    assert not np.allclose(other, first)


def test_a_dielectric_without_thickness_is_refused() -> None:
    with pytest.raises(ValueError, match="no thickness"):
        profile_fields(
            profile(),
            FREQUENCIES,
            polarisation="TM",
            sources=PLACES,
            receivers="echo",
            permittivity=2.0 + 0j,
        )
    with pytest.raises(ValueError, match="must be positive"):
        profile_body(profile(), 250e9, permittivity=2.0 + 0j, thickness=0.0)


def test_a_solution_that_does_not_solve_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("validation.full_wave.direct_solution.TOLERANCE", 0.3)
    with pytest.raises(FullWaveError, match="mm the solution errs by"):
        profile_fields(
            profile(),
            FREQUENCIES[:1],
            polarisation="TE",
            sources=PLACES,
            receivers="echo",
            thickness=2e-3,
        )
