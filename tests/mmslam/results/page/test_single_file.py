"""What data hold never becomes part of a page."""

import base64
import hashlib
import html
import json
import re
from dataclasses import replace

import pytest

from estimator.measurement.model import Measurement
from estimator.results.estimate import Estimate
from mmslam.results.document import result_document
from mmslam.results.page.plan import plan_document
from mmslam.results.page.single_file import script_json, script_source
from mmslam.results.report import SCRIPTS_3D, render_report
from validation.metrics.truth import Truth

HOSTILE = (
    "</script><script>alert(1)</script><img src=x onerror=alert(1)><!--\u202e\u2028&amp;\x1b[31m"
)

MOST_BYTES = 6_000_000
"""Of a whole page: what one sends by mail, and a telephone opens."""


@pytest.fixture
def page(measurement: Measurement, estimate: Estimate, truth: Truth) -> str:
    pytest.importorskip("plotly")
    (user,) = estimate.users
    hostile = replace(estimate, users=(replace(user, name=HOSTILE),), notes=(HOSTILE,))
    named = replace(truth, wall_start={HOSTILE: truth.wall_start["door"]})
    named = replace(named, wall_end={HOSTILE: truth.wall_end["door"]})
    result = result_document(replace(measurement, scenario=HOSTILE), hostile, named)
    plan = plan_document(measurement, hostile, named, dimensions=2)
    return render_report(result, measurement, {}, plan=plan, scenario=HOSTILE)


def scripts(page: str) -> list[tuple[str, str]]:
    """Return the attributes and the text of each script, as a browser separates them."""
    return re.findall(r"<script([^>]*)>(.*?)</script", page, flags=re.DOTALL)


def test_names_cannot_leave_the_data_of_the_page(page: str) -> None:
    (kind, data), *run = scripts(page)
    assert kind == ' type="application/json" id="page-data"'
    assert not set("<>&'\u2028\u202e\x1b") & set(data)
    told = json.loads(data)["users"][0]["name"]
    assert told.startswith("</script><script>alert(1)</script><img src=x onerror=alert(1)><!--")
    assert told.endswith("\\u202e\\u2028&amp;\\x1b[31m")  # shown by their numbers, not obeyed
    assert len(run) == 6


def test_only_scripts_whose_content_the_policy_names_are_run(page: str) -> None:
    (policy,) = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)
    allowed = re.findall(r"'sha256-([^']*)'", html.unescape(policy))
    digests = [
        base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        for kind, text in scripts(page)
        if "json" not in kind
    ]
    assert digests == allowed
    assert "script-src 'unsafe" not in html.unescape(policy)
    assert "default-src 'none'" in html.unescape(policy)


def test_the_page_names_no_place_outside_of_itself(page: str) -> None:
    from plotly.offline import get_plotlyjs

    ours = page.replace(get_plotlyjs().replace("\r\n", "\n"), "")
    assert len(ours) < len(page) - 1_000_000
    assert not re.findall(
        r"(?:https?:)?//[a-z]", re.sub(r"^\s*//.*$", "", ours, flags=re.MULTILINE)
    )
    assert not re.findall(r"<[a-z][^<>]*\s(?:src|href|action|srcset)\s*=", ours)
    assert "@import" not in ours
    assert "url(" not in ours


def test_the_page_is_small_enough_to_send(page: str) -> None:
    assert len(page.encode()) < MOST_BYTES


def test_no_control_or_direction_mark_is_in_the_page(page: str) -> None:
    assert not set("\u202e\u2028\x1b") & set(page)


def test_without_a_plan_the_page_may_run_nothing(
    measurement: Measurement, estimate: Estimate, truth: Truth
) -> None:
    page = render_report(result_document(measurement, estimate, truth), measurement, {})
    assert "script-src" not in page
    assert "default-src &#39;none&#39;" in page


@pytest.mark.parametrize("name", ["page.js", *SCRIPTS_3D, "track.js", "start_room.js"])
def test_no_script_of_ours_makes_markup_of_text(name: str) -> None:
    source = script_source(name)
    for way in (
        "innerHTML",
        "outerHTML",
        "insertAdjacentHTML",
        "document.write",
        "eval(",
        "Function(",
    ):
        assert way not in source


def test_json_in_a_page_reads_as_what_was_written() -> None:
    document = {"a": [1, 2.5, None], "b": {"c": "<&'>"}}
    assert json.loads(script_json(document)) == document
