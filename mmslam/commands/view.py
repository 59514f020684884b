"""The command ``view``: open the page of a result."""

import os
import sys
import webbrowser
from pathlib import Path

from mmslam import own_results
from mmslam.output import OutputError

PAGES = (own_results.REPORT, own_results.TRACK_PAGE, own_results.IMAGE_PARTS[1])
"""What a folder of results may hold to look at, the best first."""


def page_of(place: Path) -> Path:
    """Return the page to open: the file itself, or that of a folder of results.

    Parameters
    ----------
    place
        A folder that `run`, `locate`, `track` or `image` wrote, or a page.

    Raises
    ------
    OutputError
        If there is none.
    """
    if place.is_file() and place.suffix in (".html", ".png"):
        return place
    if not place.is_dir():
        raise OutputError(
            f"{place} is no folder of results and no page; give what `mmslam run` wrote, "
            "e.g. out/slam_2d-0"
        )
    for name in PAGES:
        if (place / name).is_file():
            return place / name
    raise OutputError(
        f"{place} holds none of {', '.join(PAGES)}; give a folder that `mmslam run`, `locate`, "
        "`track` or `image` wrote"
    )


def opened(page: Path) -> bool:
    """Open a page in the browser of the desktop; return whether there is one.

    Without a display nothing is started: a browser in the terminal would not draw it.

    Parameters
    ----------
    page
        Of this machine.
    """
    if not has_display():
        return False
    try:
        return webbrowser.open(page.resolve().as_uri())
    except webbrowser.Error:
        return False


def has_display() -> bool:
    """Tell whether this session has a desktop, or names a browser in ``BROWSER``."""
    if sys.platform in ("darwin", "win32"):
        return True
    return any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"))
