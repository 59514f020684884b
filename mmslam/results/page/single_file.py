"""One HTML file that needs no other and no network: scripts, data and style are inside.

What data hold never becomes part of the page: it is JSON in which every sign that HTML obeys is
escaped, and only scripts of known content (their SHA-256 stands in the page's policy) are run. The
policy refuses every connection.
"""

import base64
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from importlib.util import find_spec
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from mmslam.plain_text import visible

_ESCAPED = {ord(sign): f"\\u{ord(sign):04x}" for sign in "<>&'\u2028\u2029"}
_SHARED = ("page.js",)


@dataclass(frozen=True, kw_only=True)
class Inlined:
    """What a page of a template holds beside its text."""

    scripts: tuple[Markup, ...]  # in the order in which they run
    data: Markup  # JSON
    policy: str  # of the page's Content-Security-Policy


def can_draw() -> bool:
    """Tell whether Plotly is installed, without importing it."""
    return find_spec("plotly") is not None


def inlined(document: Mapping[str, Any], scripts: Sequence[str]) -> Inlined:
    """Lay out what a page draws and how.

    Parameters
    ----------
    document
        Numbers, lists and text; control characters and marks of direction in its text are shown by
        their numbers.
    scripts
        Files of ``mmslam/templates/page``, run after Plotly and what all pages share.
    """
    from plotly.offline import get_plotlyjs  # only a page that is written pays for its import

    sources = [get_plotlyjs(), *(script_source(name) for name in (*_SHARED, *scripts))]
    sources = [source.replace("\r\n", "\n") for source in sources]  # as browsers read it
    allowed = " ".join(f"'sha256-{_digest(source)}'" for source in sources)
    return Inlined(
        scripts=tuple(Markup(source) for source in sources),
        data=Markup(script_json(document)),
        policy=f"{_CLOSED}; script-src {allowed}",
    )


def closed_policy() -> str:
    """Return the policy of a page that runs nothing."""
    return _CLOSED


def script_source(name: str) -> str:
    """Return the text of a script of the package.

    Parameters
    ----------
    name
        Of a file in ``mmslam/templates/page``.
    """
    return files("mmslam").joinpath(f"templates/page/{name}").read_text(encoding="utf-8")


def script_json(document: Mapping[str, Any]) -> str:
    r"""Write JSON that stays data within an HTML page, whatever its text holds.

    Examples
    --------
    >>> script_json({"name": "</script><img onerror=alert(1)>\u202e"})
    '{"name":"\\u003c/script\\u003e\\u003cimg onerror=alert(1)\\u003e\\\\u202e"}'
    """
    text = json.dumps(_shown(document), allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    return text.translate(_ESCAPED)


def template_environment() -> Environment:
    """Return the environment of our HTML templates: text of data is escaped and made visible."""
    return Environment(
        loader=PackageLoader("mmslam"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_visible,
    )


def render_page(template: str, document: Mapping[str, Any], scripts: Sequence[str]) -> str:
    """Write a page whose content is all drawn by scripts.

    Parameters
    ----------
    template
        Its file in ``mmslam/templates``.
    document, scripts
        As in :func:`inlined`; the template is given the document as well, as ``page``.
    """
    environment = template_environment()
    return environment.get_template(template).render(
        page=document, inlined=inlined(document, scripts)
    )


def _digest(source: str) -> str:
    return base64.b64encode(hashlib.sha256(source.encode()).digest()).decode("ascii")


def _shown(value: Any) -> Any:
    if isinstance(value, str):
        return visible(value)
    if isinstance(value, Mapping):
        return {visible(str(key)): _shown(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_shown(item) for item in value]
    return value


def _visible(value: object) -> object:
    """Show control characters and marks of direction of a name, rather than obey them."""
    return visible(value) if type(value) is str else value  # markup is our own template's


_CLOSED = (
    "default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; base-uri 'none'; "
    "form-action 'none'"
)
