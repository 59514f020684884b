"""The page in a browser: it is opened without a network, and clicked through."""

import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from estimator.measurement.model import Measurement
from estimator.results.deferred import Deferred
from estimator.results.estimate import Estimate, Image, Images
from estimator.results.pixel_grid import PixelGrid
from mmslam.moving_users import track_answers
from mmslam.results.document import result_document
from mmslam.results.page.plan import plan_document
from mmslam.results.page.room import SCRIPTS_ROOM, room_document
from mmslam.results.page.single_file import render_page
from mmslam.results.page.tracks import SCRIPTS_TRACK, tracks_document
from mmslam.results.report import render_report
from scenes.files.loading import load_scenario
from simulator.scene.scenario_paths import scenario_paths
from validation.metrics.truth import Truth

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
SOFTWARE = ("--enable-unsafe-swiftshader", "--use-gl=angle", "--use-angle=swiftshader")
"""Draws in space without a graphics card."""

PATIENCE = 60_000
"""For a page to be drawn, on a busy machine. [ms]"""

Opened = Callable[..., Any]

pytestmark = pytest.mark.browser


def until(page: Any, condition: str) -> None:
    """Wait for a condition of the page; Playwright's own wait evaluates text, which it refuses."""
    waited = 0
    while not page.evaluate(condition):
        assert waited < PATIENCE, condition
        page.wait_for_timeout(50)
        waited += 50


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    sync_api = pytest.importorskip("playwright.sync_api")
    pytest.importorskip("plotly")
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    with sync_api.sync_playwright() as playwright:
        program = found or playwright.chromium.executable_path
        if not Path(program).exists():
            pytest.skip(f"no Chromium: none of {', '.join(BROWSERS)}, nor Playwright's own")
        sandbox = ("--no-sandbox",) if os.geteuid() == 0 else ()
        running = playwright.chromium.launch(executable_path=program, args=[*SOFTWARE, *sandbox])
        yield running
        running.close()


@pytest.fixture
def opened(browser: Any, tmp_path: Path) -> Iterator[Opened]:
    """Open a page; what it complains of, or asks of the network, fails the test."""
    complaints: list[str] = []
    contexts = []

    def open_page(text: str, *, width: int = 1400, height: int = 1000, theme: str = "light") -> Any:
        path = tmp_path / "page.html"
        path.write_text(text, encoding="utf-8")
        context = browser.new_context(
            viewport={"width": width, "height": height}, color_scheme=theme
        )
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(PATIENCE)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on(
            "console",
            lambda told: complaints.append(told.text) if told.type == "error" else None,
        )
        page.on(
            "request",
            lambda asked: (
                None
                if asked.url.startswith(("file:", "data:", "blob:"))
                else complaints.append(asked.url)
            ),
        )
        page.goto(path.as_uri())
        for plot in page.query_selector_all(".plot"):
            plot.wait_for_element_state("visible")
        until(page, "[...document.querySelectorAll('.plot')].every(p => p.dataset.drawn === 'yes')")
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert not complaints


def report(measurement: Measurement, estimate: Estimate, truth: Truth, dimensions: int = 2) -> str:
    result = {**result_document(measurement, estimate, truth), "dimensions": dimensions}
    plan = plan_document(measurement, estimate, truth, dimensions=dimensions)
    return render_report(result, measurement, {}, plan=plan)


@pytest.fixture
def page(opened: Opened, measurement: Measurement, estimate: Estimate, truth: Truth) -> Any:
    return opened(report(measurement, estimate, truth))


def at(page: Any, x: float, y: float) -> tuple[float, float]:
    """Return where a place of the plan is on the screen. [pixel]."""
    page.locator("#plan-plot").scroll_into_view_if_needed()
    where = page.evaluate(
        """([x, y]) => {
          const plot = document.getElementById("plan-plot");
          const frame = plot.getBoundingClientRect();
          const [h, v] = [plot._fullLayout.xaxis, plot._fullLayout.yaxis];
          return [frame.left + h._offset + h.d2p(x), frame.top + v._offset + v.d2p(y)];
        }""",
        [x, y],
    )
    return float(where[0]), float(where[1])


def visible_traces(page: Any) -> int:
    count: int = page.evaluate(
        "document.getElementById('plan-plot').data.filter(t => t.visible).length"
    )
    return count


def test_each_layer_is_switched_on_and_off(page: Any) -> None:
    for box in page.locator("#plan-layers input[data-layer]").all():
        before, was_on = visible_traces(page), box.is_checked()
        shapes = page.evaluate("document.getElementById('plan-plot').layout.shapes.length")
        box.click()
        assert box.is_checked() is not was_on
        after = visible_traces(page)
        layer = box.get_attribute("data-layer")
        if layer == "predicted":
            assert shapes > 0
            assert page.evaluate("document.getElementById('plan-plot').layout.shapes.length") == 0
        elif layer == "raw":  # in place of the corrected one
            assert not page.locator("[data-layer=corrected]").is_checked()
            assert after == before
        elif layer == "corrected":
            assert not page.locator("[data-layer=raw]").is_checked()
        else:
            assert after < before
        box.click()


def test_axes_have_units_and_one_scale(page: Any) -> None:
    assert page.locator("#plan-plot .xtitle").text_content() == "x [m]"
    assert page.locator("#plan-plot .ytitle").text_content() == "y [m]"
    left, bottom = at(page, 0.0, 0.0)
    right, top = at(page, 0.5, 0.5)
    assert right - left == pytest.approx(bottom - top, rel=0.01)


def test_no_button_sends_the_data_anywhere(page: Any) -> None:
    titles = page.locator(".modebar-btn").evaluate_all(
        "buttons => buttons.map(b => b.dataset.title || b.getAttribute('aria-label') || b.title)"
    )
    assert len(titles) >= 5  # zoom, pan, and the like are there
    told = " ".join(titles).lower()
    assert "zoom" in told
    for word in ("cloud", "share", "plotly", "studio"):
        assert word not in told


def test_the_pointer_reads_metres_and_decibels(page: Any) -> None:
    for layer in ("mirrors", "truth"):  # they are told before the image
        page.locator(f"[data-layer={layer}]").click()
    x, y = at(page, -0.05, 0.75)  # on the wall of the image
    page.mouse.move(x, y)
    page.locator("#plan-plot .hovertext").first.wait_for()
    told = page.locator("#plan-plot .hovertext").first.text_content()
    assert "x -0.05" in told.replace("−", "-")
    assert "dB below the peak" in told


def test_a_user_that_is_put_down_is_told_its_paths(page: Any) -> None:
    # Over the diagonal mirror the user at (0.9, 0.85) has its image at (0.05, 1.7) or so: the line
    # y = x + 0.8 swaps and shifts the coordinates.
    page.mouse.click(*at(page, 0.9, 0.85))
    until(page, "document.getElementById('moved-place').textContent.includes('(0.9')")
    rows = page.locator("#moved-paths tr").all()[1:]
    (direct, over) = [row.locator("td").all_text_contents() for row in rows]
    place = page.evaluate("document.getElementById('moved-place').textContent")
    x, y = (float(part) for part in place.split("(")[1].split(")")[0].split(","))
    assert (x, y) == pytest.approx((0.9, 0.85), abs=0.005)  # a pixel
    assert direct[0] == "direct"
    assert over[0] == "mirror 0"
    image = np.array([y - 0.8, x + 0.8])
    assert float(direct[3].split()[0]) == pytest.approx(np.hypot(x, y), abs=2e-4)
    assert float(over[3].split()[0]) == pytest.approx(np.hypot(*image), abs=2e-4)
    assert float(over[1].rstrip("°")) == pytest.approx(
        np.degrees(np.arctan2(image[1], image[0])), abs=0.02
    )


def test_the_user_is_dragged_and_the_plan_stays(page: Any) -> None:
    ranges = "JSON.stringify(document.getElementById('plan-plot').layout.xaxis.range)"
    before = page.evaluate(ranges)
    page.mouse.move(*at(page, 1.003, 0.796))  # where the first user was found
    page.mouse.down()
    page.mouse.move(*at(page, 0.7, 0.5), steps=5)
    page.mouse.move(*at(page, 0.5, 0.4), steps=5)
    page.mouse.up()
    until(page, "document.getElementById('moved-place').textContent.includes('(0.5')")
    assert page.evaluate(ranges) == before


def test_a_button_zooms_to_the_user_and_back(page: Any) -> None:
    width = """(() => {
      const [a, b] = document.getElementById('plan-plot')._fullLayout.yaxis.range;
      return b - a;
    })()"""
    whole = page.evaluate(width)
    page.get_by_role("button", name="zoom to ann").click()
    until(page, f"{width} < 0.2")
    page.get_by_role("button", name="whole plan").click()
    until(page, f"Math.abs({width} - {whole}) < 0.01")


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_a_telephone_shows_all_of_it_in_both_themes(
    opened: Opened, measurement: Measurement, estimate: Estimate, truth: Truth, theme: str
) -> None:
    page = opened(report(measurement, estimate, truth), width=420, height=800, theme=theme)
    assert page.evaluate("document.documentElement.scrollWidth") <= 420
    brightness = page.evaluate(
        "getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)[0]"
    )
    assert (brightness < 60) is (theme == "dark")
    ink = page.evaluate(
        "getComputedStyle(document.querySelector('#plan-plot .xtick text')).fill.match(/\\d+/g)[0]"
    )
    assert (int(ink) > 150) is (theme == "dark")


def test_hostile_names_are_shown_and_not_obeyed(
    opened: Opened, measurement: Measurement, estimate: Estimate, truth: Truth
) -> None:
    evil = "</script><img src=x onerror=\"window.hacked=1\"><a href='javascript:hacked=1'>x</a>"
    (user,) = estimate.users
    hostile = replace(estimate, users=(replace(user, name=evil),))
    page = opened(report(measurement, hostile, replace(truth, user_position={evil: np.zeros(3)})))
    x, y = at(page, 1.003, 0.796)
    page.mouse.move(x, y)
    page.mouse.move(x + 1, y)
    page.locator("#plan-plot .hovertext").first.wait_for()
    assert page.evaluate("window.hacked === undefined")
    assert page.locator("img, #plan-plot a[*|href]").count() == 0
    assert "<img src=x" in page.locator("#plan-zoom").text_content()


def test_a_volume_is_sliced_along_each_axis_and_shown_in_space(
    opened: Opened, measurement: Measurement, estimate: Estimate, truth: Truth
) -> None:
    side = np.linspace(-0.1, 0.1, 21)
    grid = PixelGrid.volume(x=side, y=side + 0.5, z=side)
    values = np.full(grid.shape, 1e-3, dtype=np.complex128)
    values[4, 10, 16] = 1.0
    spread = np.stack(np.meshgrid(side, [0.0], side, indexing="ij"), axis=-1).reshape(-1, 3)
    assert measurement.echo is not None
    samples = np.ones((len(spread), 16), dtype=np.complex128)
    planar = replace(
        measurement,
        echo=replace(measurement.echo, positions=spread, samples=samples),
        uplinks=(),
    )
    (mirror,) = estimate.mirrors
    up = np.array([0.0, 0.0, 0.1])
    corners = np.stack([mirror.start - up, mirror.end - up, mirror.end + up, mirror.start + up])
    image = Image(values=values, grid=grid)
    found = replace(
        estimate,
        images=Deferred.of(Images(raw=image, corrected=image)),
        maps=(),
        mirrors=(replace(mirror, corners=corners, covariance=np.eye(3) * 1e-8),),
    )
    page = opened(report(planar, found, truth, dimensions=3))
    for axis, brightest in (("z", 0.06), ("x", -0.06), ("y", 0.5)):
        page.select_option("#slice-axis", axis)
        told = page.locator("#slice-text").text_content()
        assert told == f"{axis} = {brightest:.4f} m"
        peak = "Math.max(...document.getElementById('slice-plot').data[0].z.flatMap(r => [...r]))"
        assert page.evaluate(peak) == 0
        page.locator("#slice-at").fill("0")
        assert page.evaluate(peak) == pytest.approx(-60.0)
        assert page.evaluate("document.getElementById('slice-plot').data[0].zmin") == -40
    assert page.evaluate("document.querySelectorAll('#space-plot canvas').length") > 0
    kinds = page.evaluate("document.getElementById('space-plot').data.map(t => t.type)")
    assert {"mesh3d", "scatter3d"} == set(kinds)
    assert page.locator("#moved-height").is_visible()
    page.mouse.click(*at(page, 0.3, 0.4))
    until(page, "document.getElementById('moved-place').textContent.includes('(0.30')")
    # The direct path, from the array to the user, also in space.
    rays = "document.getElementById('space-plot').data.at(-1)"
    until(page, f"{rays}.x.length > 1")
    assert page.evaluate(f"[{rays}.x[0], {rays}.y[0]]") == pytest.approx([0.0, 0.0], abs=1e-9)
    assert page.evaluate(f"[{rays}.x[1], {rays}.y[1]]") == pytest.approx([0.3, 0.4], abs=0.01)


def test_a_room_is_turned_in_space_and_its_layers_are_switched(opened: Opened) -> None:

    scenario = load_scenario("slam_2d")
    document = room_document(scenario, scenario_paths(scenario))
    document["title"] = "<img src=x onerror=alert(1)>"
    page = opened(render_page("room.html.j2", document, SCRIPTS_ROOM), width=420)
    assert page.evaluate("document.documentElement.scrollWidth") <= 420
    assert page.locator("h1").text_content() == "<img src=x onerror=alert(1)>"
    shown = "document.getElementById('space-plot').data.filter(t => t.visible).length"
    for box in page.locator("#space-layers input").all():
        before = page.evaluate(shown)
        box.click()
        assert page.evaluate(shown) < before
    assert page.evaluate(shown) == 0


def test_the_slider_shows_where_a_moving_user_is(opened: Opened, estimate: Estimate) -> None:

    times = [0.0, 0.1, 0.2, 0.3]
    (user,) = estimate.users
    assert user.position is not None
    way = [user.position + np.array([0.02 * step, 0.0, 0.0]) for step in range(4)]
    found = [{"ann": replace(user, position=place)} for place in way]
    found[2] = {}  # bridged
    tracked = track_answers(times, found)
    truths = [{"ann": place} for place in way]
    document = tracks_document(tracked, truths, estimate.mirrors, np.zeros((2, 3)))
    page = opened(render_page("track.html.j2", document, SCRIPTS_TRACK))
    shapes = "document.getElementById('track-plot').layout.shapes"
    for moment, place in enumerate(way):
        page.locator("#track-time").fill(str(moment))
        assert page.locator("#track-now").text_content() == f"{times[moment]:.3f} s"
        ring = page.evaluate(f"[{shapes}[0].xanchor, {shapes}[0].yanchor]")
        point = tracked[0].track.points[moment]
        assert ring == pytest.approx(point.position[:2])
        assert ring == pytest.approx(place[:2], abs=0.01)
        row = page.locator("#track-table td").all_text_contents()
        assert row[0] == "ann"
        assert ("bridged" in row[4]) is (moment == 2)
        assert row[5].endswith("mm")
    page.get_by_role("button", name="play").click()  # from the start, to the end
    until(page, "document.getElementById('track-time').value === '3'")
    page.get_by_role("button", name="zoom to the tracks").click()
    page.locator("[data-layer=ellipses]").click()
    assert page.evaluate("document.getElementById('track-plot').data.every(t => t.visible)")
