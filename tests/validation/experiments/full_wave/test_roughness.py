"""The map of where the ray-traced model may be trusted: its comparisons and its claims."""

from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest

from validation.experiments.full_wave.roughness import (
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
    echo=0.99,
    echo_level_db=-0.4,
    uplink=0.998,
    uplink_level_db=-0.2,
    image=0.994,
    image_level_db=0.4,
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


def test_short_waved_heights_scatter_as_perturbation_theory_says() -> None:
    bragg = compare(0.02, 0.2, realisations=1, overrides=TINY)
    # Tangent planes gave 6 dB too much here.
    assert bragg.echo > 0.992
    assert abs(bragg.echo_level_db) < 0.5
    assert bragg.uplink > 0.995
    assert abs(bragg.uplink_level_db) < 0.1


def test_the_same_fields_agree_and_twice_the_field_is_six_decibels_up() -> None:
    field = np.exp(1j * np.arange(12.0)).reshape(3, 4)
    correlation, level = agreement(-2j * field, field)
    assert correlation == pytest.approx(1.0)
    assert level == pytest.approx(6.0206, abs=1e-4)
    assert agreement(field, field[::-1] * np.array([1, -1, 1, -1]))[0] < 0.5


def test_image_and_uplink_are_trusted_each_by_itself() -> None:
    assert GOOD.trusted("image")
    assert GOOD.trusted("uplink")
    for wrong in (replace(GOOD, image=0.94), replace(GOOD, image_level_db=-0.6)):
        assert not wrong.trusted("image")
        assert wrong.trusted("uplink")
    for wrong in (replace(GOOD, uplink=0.94), replace(GOOD, uplink_level_db=-0.6)):
        assert wrong.trusted("image")
        assert not wrong.trusted("uplink")
    assert replace(GOOD, echo=0.5, echo_level_db=-9.0).trusted("image")  # its edges


def test_slopes_choose_what_is_claimed() -> None:
    slopes = {(0.02, 0.2): 0.15, (0.05, 0.2): 0.35, (0.15, 1.0): 0.35, (0.15, 0.5): 0.60}
    for (rms, length), limit in slopes.items():
        limits = replace(GOOD, rms_mm=rms, correlation_mm=length).limits
        assert limits is not None
        assert limits.slope == limit
    assert replace(GOOD, rms_mm=0.3, correlation_mm=0.2).limits is None


def test_claims_that_hold_are_told() -> None:
    told = check((GOOD, replace(GOOD, rms_mm=0.3, correlation_mm=0.2, echo=0.1)))
    assert len(told) == 1
    assert "claimed" in told[0]


@pytest.mark.parametrize(
    "wrong",
    [
        replace(GOOD, echo=0.98),
        replace(GOOD, echo_level_db=-0.6),
        replace(GOOD, uplink=0.99),
        replace(GOOD, uplink_level_db=0.4),
        replace(GOOD, rms_mm=0.02, echo=0.99),
        replace(GOOD, rms_mm=0.15, correlation_mm=0.5, echo_level_db=1.1),
    ],
)
def test_claims_that_do_not_hold_fail(wrong: Comparison) -> None:
    with pytest.raises(RuntimeError, match="falls short"):
        check((wrong,))


def test_the_map_shows_each_number_and_outlines_what_is_trusted(tmp_path: Path) -> None:
    other = replace(GOOD, rms_mm=0.05, image_level_db=4.9, image=0.912)
    figure = draw((GOOD, other))
    panel = figure.axes[0]
    assert {text.get_text() for text in panel.texts} == {"0.994", "0.912"}
    assert len(panel.patches) == 1
    levels = {text.get_text() for text in figure.axes[3].texts}
    assert levels == {"+0.4", "+4.9"}
    plt.close(figure)
    write_numbers(tmp_path / "map.csv", (GOOD, other))
    lines = (tmp_path / "map.csv").read_text().splitlines()
    assert lines[0].startswith("rms_mm,correlation_mm,echo,")
    assert [line[-3:] for line in lines[1:]] == ["1,1", "0,1"]
