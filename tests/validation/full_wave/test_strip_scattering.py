"""Echo and uplink of a rough strip: another author's solution, and what is kept on disk."""

from pathlib import Path

import numpy as np
import pytest
from scipy.constants import speed_of_light

import validation.full_wave.strip_scattering as module
from validation.full_wave.band_interpolation import band_fields
from validation.full_wave.direct_solution import FullWaveError
from validation.full_wave.line_source import LineSource
from validation.full_wave.method_of_moments import scattered_fields
from validation.full_wave.strip_scattering import (
    StripScene,
    strip_fields,
    strip_response,
)
from validation.reference import ROUGH_WALL

REFERENCE = ROUGH_WALL
BEAM_DISPLACEMENT = 0.097
"""What that code's complex source was moved by: the best fit to five digits. [m]"""


def short_scene(positions: int = 8) -> StripScene:
    """Two centimetres of gentle waves, 0.2 m away."""
    along = np.linspace(-0.01, 0.01, 201)
    heights = 5e-5 * np.sin(5e3 * along) + 1e-4 * np.cos(1.3e3 * along)
    profile = np.stack([along - heights, 0.2 + along + heights], axis=-1)
    places = np.stack([np.linspace(-0.03, 0.03, positions), np.zeros(positions)], axis=-1)
    user = np.array([0.3, 0.2])
    beam = LineSource(position=user, aim=np.array([-1.0, 0.0]), width=0.1)
    return StripScene(profile=profile, positions=places, users=(LineSource(position=user), beam))


@pytest.mark.parametrize("index", [0, 100])
def test_the_stored_solution_of_another_author_is_reproduced(index: int) -> None:
    reference = np.load(REFERENCE)
    user = reference["user_position"][:2]
    aim = np.array([0.0, 0.8]) - user
    beam = LineSource(position=user, aim=aim, displacement=BEAM_DISPLACEMENT)
    scene = StripScene(
        profile=reference["wall_profile"],
        positions=reference["aperture_position"],
        users=(LineSource(position=user), beam),
        detail=1.5e-4,  # l/6.7
    )
    fields = strip_fields(scene, reference["frequency"][index : index + 1])
    found = [fields.echo[:, 0], *fields.uplinks[..., 0]]
    for row, name in zip(found, ("echo", "uplink_isotropic", "uplink_beam"), strict=True):
        stored = reference[name][:, index]
        # That code errs by 4e-6 at 295 GHz, ours by 1e-5 at most.
        assert np.linalg.norm(row - stored) < 2e-5 * np.linalg.norm(stored), name


def test_compressed_sources_and_blocks_lose_nothing() -> None:
    scene, frequency = short_scene(60), 260e9
    found = strip_response(scene, frequency)
    array = [LineSource(position=place) for place in scene.positions]
    wavenumber = 2 * np.pi * frequency / speed_of_light
    strips = [scene.grid(frequency)]
    echo = np.diagonal(scattered_fields(strips, array, array, wavenumber))
    uplinks = scattered_fields(strips, list(scene.users), array, wavenumber)
    for row, expected in zip(found, [echo, *uplinks], strict=True):
        # TOLERANCE, times some ten of adding up.
        assert np.linalg.norm(row - expected) < 1e-6 * np.linalg.norm(expected)


def test_neither_workers_nor_an_interruption_change_a_bit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "BLOCK", 3)
    scene, frequencies = short_scene(), np.linspace(220e9, 295e9, 8)
    told: list[tuple[int, int]] = []
    whole = strip_fields(scene, frequencies, workers=1)
    part = strip_fields(scene, frequencies[:6], folder=tmp_path, workers=2)
    np.testing.assert_array_equal(part.echo, whole.echo[:, :6])
    solved: list[float] = []

    def counted(scene: StripScene, frequency: float) -> np.ndarray:
        solved.append(frequency)
        return strip_response(scene, frequency)

    monkeypatch.setattr(module, "strip_response", counted)
    again = strip_fields(
        scene, frequencies, folder=tmp_path, advance=lambda done, steps: told.append((done, steps))
    )
    assert sorted(solved) == frequencies[6:].tolist()  # the first two blocks lay in the folder
    assert told == [(1, 3), (2, 3), (3, 3)]
    np.testing.assert_array_equal(again.echo, whole.echo)
    np.testing.assert_array_equal(again.uplinks, whole.uplinks)
    assert len(list(tmp_path.iterdir())) == 3


def test_files_of_another_wall_or_user_are_not_taken() -> None:
    scene = short_scene()
    moved = StripScene(profile=scene.profile + 1e-9, positions=scene.positions, users=scene.users)
    fewer = StripScene(profile=scene.profile, positions=scene.positions, users=scene.users[:1])
    finer = StripScene(
        profile=scene.profile, positions=scene.positions, users=scene.users, detail=1e-4
    )
    assert len({one.digest for one in (scene, moved, fewer, finer)}) == 4
    assert short_scene().digest == scene.digest


def test_a_solution_that_does_not_solve_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "TOLERANCE", 0.3)
    with pytest.raises(FullWaveError, match="at 260 GHz the solution errs"):
        strip_response(short_scene(60), 260e9)


def test_few_frequencies_carry_the_band() -> None:
    scene, frequencies = short_scene(), np.linspace(220e9, 295e9, 301)
    solved: list[int] = []
    fields = band_fields(scene, frequencies, advance=lambda done, steps: solved.append(steps))
    assert solved[0] * module.BLOCK < 100
    some = slice(7, None, 50)
    direct = strip_fields(scene, frequencies[some])
    for found, expected in (
        (fields.echo[:, some], direct.echo),
        (fields.uplinks[..., some], direct.uplinks),
    ):
        # What runs from one end of the strip to the other comes later than the margin covers: a
        # third of what is refused.
        assert np.linalg.norm(found - expected) < 3e-4 * np.linalg.norm(expected)


def test_a_band_with_few_frequencies_is_solved_as_it_is() -> None:
    scene, frequencies = short_scene(), np.linspace(220e9, 295e9, 5)
    np.testing.assert_array_equal(
        band_fields(scene, frequencies).echo, strip_fields(scene, frequencies).echo
    )


def test_where_few_frequencies_do_not_carry_the_band_more_are_solved(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene, frequencies = short_scene(), np.linspace(220e9, 295e9, 101)
    monkeypatch.setattr("validation.full_wave.band_interpolation.EXTRA", 3)
    monkeypatch.setattr("validation.full_wave.band_interpolation.MARGINS", (0.3, 0.5))
    np.testing.assert_array_equal(
        band_fields(scene, frequencies).echo, strip_fields(scene, frequencies).echo
    )
    lenient = band_fields(scene, frequencies, most_error=10.0)
    assert not np.allclose(lenient.echo, strip_fields(scene, frequencies).echo)
