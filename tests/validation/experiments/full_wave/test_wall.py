"""The solver's own checks, and the thesis' wall at full size."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from validation.experiments.full_wave.wall import (
    SolverCheck,
    check,
    cylinder_error,
    main,
    reference_errors,
    stored_error,
    thesis_wall,
)
from validation.full_wave.strip_scattering import StripFields, strip_fields
from validation.full_wave.wall_comparison import read_reference
from validation.reference import ROUGH_WALL

REFERENCE = ROUGH_WALL
GOOD = SolverCheck(
    series_error=1e-9, refinement=2e-5, reference_error=8e-6, seconds=4.0, frequencies=61
)


def save(path: Path, arrays: dict[str, Any]) -> None:
    np.savez(path, **arrays)


def test_a_cylinder_ten_wavelengths_thick_is_exact() -> None:
    assert cylinder_error() < 1e-8


def test_checks_that_hold_are_told() -> None:
    assert len(check(GOOD)) == 4


@pytest.mark.parametrize(
    "wrong",
    [
        replace(GOOD, series_error=1e-6),
        replace(GOOD, refinement=2e-4),
        replace(GOOD, reference_error=2e-4),
        replace(GOOD, seconds=31.0),
    ],
)
def test_a_check_that_does_not_hold_fails(wrong: SolverCheck) -> None:
    with pytest.raises(RuntimeError, match="at most"):
        check(wrong)


def test_the_full_wall_has_the_thesis_size() -> None:
    scene, frequencies = thesis_wall()
    assert len(frequencies) == 1001
    assert scene.positions.shape == (260, 3)
    assert [user.aim is None for user in scene.users] == [True, False]
    ends = scene.profile[-1] - scene.profile[0]
    assert np.linalg.norm(ends) == pytest.approx(0.4, abs=1e-3)  # heights of a millimetre at most


def test_the_stored_wall_is_reproduced_at_the_ends_of_its_band() -> None:
    assert stored_error() < 2e-5  # that code errs by 4e-6


def test_a_stored_wall_is_solved_and_compared() -> None:
    reference = read_reference(REFERENCE)
    scene, frequencies = thesis_wall(reference)
    # A single frequency of it; the full run is this for all of them.
    one = {name: values[:, 60:61] for name, values in reference.items() if values.ndim == 2}
    one["wall_profile"] = reference["wall_profile"]
    fields = strip_fields(scene, frequencies[60:61])
    errors = reference_errors(fields, one)
    assert set(errors) == {"echo", "uplink_isotropic", "uplink_beam"}
    assert max(errors.values()) < 2e-5  # that code errs by 4e-6
    doubled = StripFields(echo=2 * fields.echo, uplinks=fields.uplinks)
    assert reference_errors(doubled, one)["echo"] == pytest.approx(1.0, abs=1e-4)


def test_a_file_of_the_reference_s_layout_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    reference = read_reference(REFERENCE)
    few = slice(0, 2)
    part = {
        name: values[few, few] if name.startswith(("echo", "uplink")) else values
        for name, values in reference.items()
    }
    part["aperture_position"] = reference["aperture_position"][few]
    part["frequency"] = reference["frequency"][few]
    save(tmp_path / "part.npz", part)
    assert main([str(tmp_path / "own.npz"), str(tmp_path / "part.npz")]) == 0
    assert capsys.readouterr().out.count("differs from the reference by") == 3
    own = read_reference(tmp_path / "own.npz")
    np.testing.assert_allclose(own["echo"], part["echo"], rtol=1e-3)
    save(tmp_path / "other.npz", {**part, "echo": 2 * part["echo"]})
    assert main([str(tmp_path / "own.npz"), str(tmp_path / "other.npz")]) == 1
