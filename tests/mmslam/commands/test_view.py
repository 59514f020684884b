"""``mmslam view``: the page of a result, opened where there is a desktop."""

import json
import webbrowser
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from mmslam.cli import app


@pytest.fixture
def asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What a browser is asked to open, on a machine without a display."""
    places: list[str] = []

    def open_page(url: str) -> bool:
        places.append(url)
        return True

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(webbrowser, "open", open_page)
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    return places


def view(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["view", *arguments])


def folder(path: str, *names: str) -> Path:
    made = Path(path)
    made.mkdir()
    for name in names:
        (made / name).write_text("a page", encoding="utf-8")
    return made


def test_without_a_display_the_path_is_told_and_nothing_started(asked: list[str]) -> None:
    folder("out 1", "report.html", "result.json")
    result = view("out 1")
    assert result.exit_code == 0
    assert result.stdout == "open out 1/report.html\n"
    assert asked == []


def test_with_a_display_the_page_is_opened(
    asked: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    page = folder("out 1", "report.html") / "report.html"
    monkeypatch.setenv("DISPLAY", ":0")
    assert view("out 1").stdout == "opened out 1/report.html\n"
    assert asked == [page.resolve().as_uri()]


@pytest.mark.parametrize(
    ("names", "page"),
    [
        (("track.html", "track.png", "track.json"), "track.html"),
        (("image.png", "image.json"), "image.png"),
        (("report.html", "localization.png"), "report.html"),
    ],
)
def test_the_page_is_that_of_the_folders_kind(
    asked: list[str], names: tuple[str, ...], page: str
) -> None:
    folder("out", *names)
    document = json.loads(view("out", "--json").stdout)
    assert document == {"page": f"out/{page}", "opened": False}


def test_a_page_itself_is_opened(asked: list[str]) -> None:
    Path("room.html").write_text("a page", encoding="utf-8")
    assert view("room.html").stdout == "open room.html\n"


def test_a_desktop_without_a_browser_is_told_as_none(
    asked: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def none(url: str) -> bool:
        raise webbrowser.Error("could not locate runnable browser")

    folder("out", "report.html")
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(webbrowser, "open", none)
    assert view("out").stdout == "open out/report.html\n"


def test_a_folder_without_a_page_is_refused(asked: list[str]) -> None:
    folder("data", "numbers.csv")
    result = view("data")
    assert result.exit_code == 2
    assert "data holds none of report.html, track.html, image.png" in " ".join(
        result.stderr.split()
    )


def test_a_place_that_is_nothing_is_refused(asked: list[str]) -> None:
    result = view("nowhere")
    assert result.exit_code == 2
    assert "nowhere is no folder of results and no page" in " ".join(result.stderr.split())
