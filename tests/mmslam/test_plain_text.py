import json
import warnings
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from mmslam.plain_text import file_name, json_text, message, visible
from mmslam.results.pictures_2d import save

ATTACK = "\x1b]0;owned\x07\x9b31m\u202eevil\ud800\0"


def test_control_characters_and_marks_of_direction_are_shown_by_number() -> None:
    assert visible(ATTACK) == r"\x1b]0;owned\x07\x9b31m\u202eevil\ud800\x00"
    assert visible("Björn Ω — 1σ\n\tλ/4") == "Björn Ω — 1σ\n\tλ/4"


@given(st.text())
def test_whatever_is_told_a_terminal_has_nothing_to_obey(text: str) -> None:
    shown = visible(text)
    assert all(sign.isprintable() or sign in "\n\t" for sign in shown)
    assert shown == text or not text.replace("\n", "").replace("\t", "").isprintable()


@given(st.dictionaries(st.text(), st.text()))
def test_json_is_printable_and_means_the_same(document: dict[str, str]) -> None:
    text = json_text(document)
    assert text.replace("\n", "").isprintable()
    assert json.loads(text) == document


@given(st.text())
def test_a_name_from_data_stays_in_its_folder(name: str) -> None:
    made = file_name(name)
    assert made not in ("", ".", "..")
    assert Path(made).name == made
    assert made.isprintable()
    assert len(made.encode()) <= 100


def test_a_file_name_holds_nothing_that_a_shell_obeys() -> None:
    attack = "-rf $(touch x)`id`&;!'#~{a,b}[c]%PATH%^"
    assert not set(file_name(attack)) & set("$`&;!'#~^%(){}[]")
    assert file_name(attack).startswith("_rf ")


def test_names_that_are_cut_alike_stay_apart() -> None:
    assert file_name("x" * 300) != file_name("x" * 301)
    assert file_name("../../etc/passwd") == "_.._etc_passwd"
    assert file_name("hall 3") == "hall 3"


def test_a_message_does_not_repeat_a_hostile_name_of_200_kilobytes() -> None:
    assert len(message("error: " + "x" * 200_000 + " is not known")) < 300
    assert message("a\nb") == "a\nb"
    assert len(message("word " * 100_000)) < 2100


@pytest.mark.parametrize("name", [r"$\frac$", "a$b$", "$", r"\$x", "\x1b[2J", "$x^$"])
def test_a_name_that_looks_like_a_formula_is_drawn_as_it_is(name: str, tmp_path: Path) -> None:
    figure = Figure(layout="constrained")
    axes = figure.add_subplot()
    axes.plot([-1, 1], [1e-3, 1], label=name)
    axes.set_yscale("log")
    axes.set_title(name)
    axes.legend()
    with warnings.catch_warnings(action="error"):
        save(figure, tmp_path / "it.png")
    assert axes.get_title() == visible(name)
    # The numbers on the axes are formulas of Matplotlib's own, and stay that.
    numbers = [label for label in axes.get_yticklabels() if "$" in label.get_text()]
    assert numbers
    assert all(label.get_parse_math() for label in numbers)
