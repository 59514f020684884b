"""The map of where the ray-traced model may be trusted: its comparisons and its claims."""

from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest

from validation.experiments.full_wave_roughness import (
    BRAGG_DB,
    EDGES_DB,
    Comparison,
    agreement,
    check,
    compare,
    draw,
    write_numbers,
)

GOOD = Comparison(
    rms_mm=0.15,
    correlation_mm=1.0,
    echo=0.95,
    echo_level_db=-0.4,
    uplink=0.998,
    uplink_level_db=-0.4,
    image=0.994,
    image_level_db=1.0,
)
TINY = (
    "base_station.elements=16",
    "base_station.spacing_mm=4",
    "radio.points=21",
    "radio.start_ghz=285",
    "objects.wall.centre_m=[0.0, 0.2]",
    "objects.wall.length_m=0.04",
    "users.user.position_m=[0.2, 0.2]",
)
"""A smaller radio and a nearer wall: a second for each roughness."""


def test_the_simulator_is_too_bright_in_the_bragg_regime_and_right_in_the_uplink() -> None:
    bragg = compare(0.02, 0.2, realisations=1, overrides=TINY)
    assert bragg.image > 0.9
    # 6.02 dB at 45°; a wall of 4 cm 0.2 m away is seen at 40 to 50° (5 to 7 dB), in 5 speckles.
    assert bragg.image_level_db == pytest.approx(BRAGG_DB, abs=1.5)
    assert bragg.uplink > 0.99
    assert abs(bragg.uplink_level_db) < 0.3
    assert bragg.trusted("uplink")
    assert not bragg.trusted("image")


def test_the_same_fields_agree_and_twice_the_field_is_six_decibels_up() -> None:
    field = np.exp(1j * np.arange(12.0)).reshape(3, 4)
    correlation, level = agreement(-2j * field, field)
    assert correlation == pytest.approx(1.0)
    assert level == pytest.approx(6.0206, abs=1e-4)
    assert agreement(field, field[::-1] * np.array([1, -1, 1, -1]))[0] < 0.5


def test_image_and_uplink_are_trusted_each_by_itself() -> None:
    assert GOOD.trusted("image")
    assert GOOD.trusted("uplink")
    for wrong in (replace(GOOD, image=0.94), replace(GOOD, image_level_db=-2.1)):
        assert not wrong.trusted("image")
        assert wrong.trusted("uplink")
    for wrong in (replace(GOOD, uplink=0.94), replace(GOOD, uplink_level_db=-2.1)):
        assert wrong.trusted("image")
        assert not wrong.trusted("uplink")
    assert replace(GOOD, echo=0.5, echo_level_db=-9.0).trusted("image")  # its edges


def test_the_limits_are_those_of_the_literature() -> None:
    assert pytest.approx(6.0206, abs=1e-4) == BRAGG_DB  # 1/cos² 45° = 2
    assert pytest.approx(10 * np.log10(2 / 6)) == EDGES_DB  # (1 − √2)² + (1 + √2)² = 6


def test_claims_that_hold_are_told() -> None:
    bragg = replace(GOOD, rms_mm=0.02, correlation_mm=0.2, image_level_db=5.97)
    smooth = replace(GOOD, rms_mm=0.02, correlation_mm=2.0, echo_level_db=-4.97)
    unclaimed = replace(GOOD, correlation_mm=2.0, image=0.5)
    told = check((GOOD, bragg, smooth, unclaimed))
    assert len(told) == 3
    assert "claimed 0.993, +1.1 dB" in told[0]
    assert "+6.02 dB of the image by perturbation theory" in told[1]
    assert "-4.77 dB of the echo by Keller's theory" in told[2]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (replace(GOOD, image=0.97), "are allowed"),
        (replace(GOOD, image_level_db=-0.5), "are allowed"),
        (replace(GOOD, rms_mm=0.1, correlation_mm=0.5, uplink=0.98), "is below 0.99"),
        (replace(GOOD, rms_mm=0.02, correlation_mm=0.3, image_level_db=4.9), "perturbation"),
        (replace(GOOD, rms_mm=0.02, correlation_mm=2.0, echo_level_db=0.0), "Keller"),
    ],
)
def test_claims_that_do_not_hold_fail(wrong: Comparison, message: str) -> None:
    with pytest.raises(RuntimeError, match=message):
        check((wrong,))


def test_the_map_shows_each_number_and_outlines_what_is_trusted(tmp_path: Path) -> None:
    other = replace(GOOD, rms_mm=0.05, image_level_db=4.9, image=0.912)
    figure = draw((GOOD, other))
    panel = figure.axes[0]
    assert {text.get_text() for text in panel.texts} == {"0.994", "0.912"}
    assert len(panel.patches) == 1
    levels = {text.get_text() for text in figure.axes[3].texts}
    assert levels == {"+1.0", "+4.9"}
    plt.close(figure)
    write_numbers(tmp_path / "map.csv", (GOOD, other))
    lines = (tmp_path / "map.csv").read_text().splitlines()
    assert lines[0].startswith("rms_mm,correlation_mm,echo,")
    assert [line[-3:] for line in lines[1:]] == ["1,1", "0,1"]
