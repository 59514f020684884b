"""The report: one self-contained page with the figures inside."""

import base64
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from scipy.constants import speed_of_light

from estimator.measurement.model import Measurement
from mmslam.plain_text import visible

CAPTIONS = {
    "localization.png": "Plan of what was found; the user enlarged, with its error ellipses.",
    "raw_image.png": "The image as measured, ghosts behind the mirrors included.",
    "corrected_image.png": "The image after each ghost was unfolded through its mirror.",
    "angle_range_map.png": "The user's pilot over angle of arrival and path length.",
}

WIDE = ("localization.png", "angle_range_map.png")  # these hold two panels


def render_report(
    result: Mapping[str, Any],
    measurement: Measurement,
    pictures: Mapping[str, Path],
    *,
    scenario: str | None = None,
) -> str:
    """Write the page that tells one result.

    Parameters
    ----------
    result
        The document of ``result.json``.
    measurement
        What it was made from; its radio parameters are listed.
    pictures
        PNG files by name; they are embedded.
    scenario
        What was simulated, if anything; its TOML text is included.

    Returns
    -------
    HTML that needs no other file and no network.
    """
    environment = Environment(
        loader=PackageLoader("mmslam"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_shown,
    )
    environment.filters["fixed"] = _fixed
    environment.filters["point"] = _point
    environment.filters["deviation"] = _deviation
    return environment.get_template("report.html.j2").render(
        result=result,
        radio=radio_parameters(measurement),
        figures=[
            {
                "source": base64.b64encode(pictures[name].read_bytes()).decode("ascii"),
                "caption": caption,
                "wide": name in WIDE,
            }
            for name, caption in CAPTIONS.items()
            if name in pictures
        ],
        scenario=scenario,
        pi=math.pi,
    )


def radio_parameters(measurement: Measurement) -> dict[str, str]:
    """Describe the sweep in the units that people use, each with its unit."""
    measured = measurement.echo or next(iter(measurement.uplinks), None)
    if measured is None:
        paths = sum(one.azimuth.size for one in measurement.path_lists)
        return {
            "frequencies": "lists of paths, no channels",
            "positions": f"{paths} paths of {len(measurement.path_lists)} places",
        }
    frequencies, positions = measured.frequencies, measured.positions
    described = {
        "frequencies": f"{frequencies[0] / 1e9:g} to {frequencies[-1] / 1e9:g} GHz, "
        f"{frequencies.size} points",
        "positions": f"{len(positions)} over "
        f"{1e3 * np.linalg.norm(np.ptp(positions, axis=0)):.1f} mm",
        "waves": measurement.waves,
    }
    if frequencies.size > 1:
        bandwidth = frequencies[-1] - frequencies[0]
        step = bandwidth / (frequencies.size - 1)
        described["range resolution c/2B"] = f"{1e3 * speed_of_light / (2 * bandwidth):.2f} mm"
        described["unambiguous one-way path"] = f"{speed_of_light / step:.2f} m"
    return described


def _shown(value: object) -> object:
    """Show control characters and marks of direction of a name, rather than obey them."""
    return visible(value) if type(value) is str else value  # markup is our own template's


def _fixed(value: float | None, digits: int = 3, scale: float = 1.0) -> str:
    return "—" if value is None else f"{value * scale:.{digits}f}"


def _point(values: list[float] | None, dimensions: int) -> str:
    return "—" if values is None else ", ".join(f"{value:.4f}" for value in values[:dimensions])


def _deviation(variance: float | None, scale: float) -> float | None:
    return None if variance is None else scale * math.sqrt(max(variance, 0.0))
