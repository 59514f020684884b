"""What a bench adds to a point's echo is proposed to be taken out, and is taken out by its key."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.imaging.autofocus import contributions
from estimator.localization.medium import as_in_vacuum
from estimator.measurement.model import Echo, MeasurementError
from mmslam.formats.import_measured import Import
from validation.metrics.image_quality import image_entropy

FREQUENCIES = np.linspace(30e9, 34e9, 21)  # [Hz]
FREQUENCY = 'frequency = { start = 30.0, stop = 34.0, points = 21, unit = "GHz" }\n'
LINE = 'positions = { first = [-9.0, 0.0, -4.0], step = [4.0, 0.0, 0.0], unit = "mm" }\n'


def plane() -> np.ndarray:
    """Positions of a grid, x fastest. [m]."""
    z, x = np.meshgrid(4e-3 * np.arange(-1.0, 3.0), 4e-3 * np.arange(5.0) - 9e-3, indexing="ij")
    return np.stack([x.ravel(), 0 * x.ravel(), z.ravel()], axis=1)


def line() -> np.ndarray:
    return plane()[:5]


def test_a_constant_that_covers_the_scene_is_proposed_to_be_subtracted_and_is(
    tmp_path: Path,
    take: Callable[[Path, str, str], Import],
    taken: Callable[[Path, str, str], Echo],
    echo_of: Callable[..., np.ndarray],
) -> None:
    leak = np.exp(-2j * np.pi * FREQUENCIES * 0.3e-9) * (0.7 + 0.3 * np.cos(FREQUENCIES / 3e8))
    np.savez(tmp_path / "s.npz", s=0.01 * echo_of(plane()) + 0.1 * leak, p=plane())
    mapping = FREQUENCY + 'positions = { variable = "p", unit = "m" }\n[echo]\nvariable = "s"\n'
    (note,) = take(tmp_path, "s.npz", mapping).notes
    assert "all positions share one constant" in note
    assert 'subtract_shared = "mean"' in note
    cleaned = take(tmp_path, "s.npz", mapping + 'subtract_shared = "mean"\n')
    assert not cleaned.notes
    exact = 0.01 * echo_of(plane())
    assert cleaned.measurement.echo is not None
    np.testing.assert_allclose(
        cleaned.measurement.echo.samples, exact - exact.mean(axis=0), atol=1e-15
    )
    echo = taken(tmp_path, "s.npz", mapping + "gate_out_ns = [-0.5, 0.9]\n")
    assert np.abs(echo.samples).max() < 0.01 * np.abs(leak).max()
    with pytest.raises(MeasurementError, match=r"echo\.gate_out_ns: a gate of .* must rise"):
        take(tmp_path, "s.npz", mapping + "gate_out_ns = [0.9, 0.5]\n")


def test_in_a_medium_lengths_come_out_by_its_refractive_index(
    tmp_path: Path, take: Callable[[Path, str, str], Import], echo_of: Callable[..., np.ndarray]
) -> None:
    slow = echo_of(line(), 1.5 * FREQUENCIES)  # every path is 1.5 times as long
    np.savez(tmp_path / "s.npz", s=slow)
    mapping = "refractive_index = 1.5\n" + FREQUENCY + LINE + 'echo = { variable = "s" }'
    imported = take(tmp_path, "s.npz", mapping)
    assert imported.measurement.echo is not None
    echo = imported.measurement.echo
    assert imported.measurement.medium_index == 1.5
    np.testing.assert_allclose(echo.frequencies, FREQUENCIES, rtol=1e-15)  # to their rounding
    in_vacuum = as_in_vacuum(imported.measurement).echo
    assert in_vacuum is not None
    wanted = echo_of(echo.positions, in_vacuum.frequencies)
    np.testing.assert_allclose(echo.samples, wanted, atol=1e-13)
    assert any("refractive index 1.5" in note for note in imported.notes)


WIDE = np.stack([5e-3 * (np.arange(31) - 15), np.zeros(31), np.zeros(31)], axis=1)
DELAYED = FREQUENCY + 'positions = { variable = "p", unit = "m" }\n[echo]\nvariable = "s"\n'


def test_a_cables_delay_is_remarked_by_the_focus_and_taken_out_on_request(
    tmp_path: Path, take: Callable[[Path, str, str], Import], echo_of: Callable[..., np.ndarray]
) -> None:
    late = np.exp(-2j * np.pi * FREQUENCIES * 0.4e-9)
    np.savez(tmp_path / "s.npz", s=echo_of(WIDE) * late, p=WIDE)
    (note,) = take(tmp_path, "s.npz", DELAYED).notes
    assert float(note.split("delay by ")[1].split(" ns")[0]) == pytest.approx(0.4, abs=1e-3)
    told = take(tmp_path, "s.npz", DELAYED + "cable_delay_ns = 0.4\n")
    assert not told.notes
    found = take(tmp_path, "s.npz", DELAYED + 'cable_delay_ns = "focus"\n')
    assert not found.notes
    assert found.measurement.echo is not None
    # A picosecond is 0.01 rad over the band of 4 GHz, and 0.2 rad at 34 GHz: of phase only.
    turn = found.measurement.echo.samples / echo_of(WIDE)
    assert np.ptp(np.unwrap(np.angle(turn.mean(axis=0)))) < 0.01


def test_samples_of_the_other_sign_are_told_by_their_converging_wave(
    tmp_path: Path, take: Callable[[Path, str, str], Import], echo_of: Callable[..., np.ndarray]
) -> None:
    np.savez(tmp_path / "s.npz", s=echo_of(WIDE).conj(), p=WIDE)
    notes = take(tmp_path, "s.npz", DELAYED).notes
    assert any("converges" in note and "time_convention" in note for note in notes)
    assert not take(tmp_path, "s.npz", 'time_convention = "exp(-jwt)"\n' + DELAYED).notes


def test_a_delay_that_no_focus_tells_is_refused_with_the_remedy(
    tmp_path: Path, take: Callable[[Path, str, str], Import], echo_of: Callable[..., np.ndarray]
) -> None:
    rng = np.random.default_rng(5)
    noise = rng.normal(size=(31, 21)) + 1j * rng.normal(size=(31, 21))
    np.savez(tmp_path / "s.npz", s=0.1 * noise, p=WIDE)
    with pytest.raises(MeasurementError, match=r"echo\.cable_delay_ns: .* corner reflector"):
        take(tmp_path, "s.npz", DELAYED + 'cable_delay_ns = "focus"\n')
    flat = np.broadcast_to(echo_of(WIDE)[15], (31, 21))
    np.savez(tmp_path / "s.npz", s=flat, p=WIDE)
    with pytest.raises(MeasurementError, match=r"needs a wave whose curvature is known"):
        take(tmp_path, "s.npz", DELAYED + 'cable_delay_ns = "focus"\n')


def rail(folder: Path, *, jitter: float) -> np.ndarray:
    """Write a sweep of two points from a rail; return the true positions. [m]."""
    x = (np.arange(60) - 29.5) * 0.45e-3
    true = np.stack([x, jitter * np.random.default_rng(2).normal(size=60), 0 * x], axis=-1)
    f = np.linspace(285e9, 315e9, 31)
    delays = [
        2 * np.linalg.norm(true - target, axis=1)[:, None] / speed_of_light
        for target in ([0.004, 0.16, 0.0], [-0.006, 0.15, 0.0])
    ]
    s = 1e-3 * sum(np.exp(-2j * np.pi * f * delay) for delay in delays)
    np.savez(folder / "rail.npz", s=s, f=f, x=x)
    return true


RAIL = """
frequency = { variable = "f", unit = "Hz" }
positions = { x = "x", unit = "m" }
echo = { variable = "s", autofocus = "range" }
"""


def test_a_rails_jitter_is_taken_out_at_import(
    tmp_path: Path, take: Callable[[Path, str, str], Import]
) -> None:
    true = rail(tmp_path, jitter=1e-4)
    found = take(tmp_path, "rail.npz", RAIL)
    assert found.measurement.echo is not None
    assert any("positions were moved towards the scene" in note for note in found.notes)
    echo = found.measurement.echo
    x, y = np.meshgrid(np.arange(-0.02, 0.02, 1e-3), np.arange(0.13, 0.19, 2e-3))
    points = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=-1)
    sharp, real = (
        image_entropy(contributions(one, points).sum(axis=0))
        for one in (echo, replace(echo, positions=true))
    )
    assert sharp < 1.02 * real
