"""The report: one self-contained page with the figures inside."""

import base64
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.constants import speed_of_light

from estimator.measurement.model import Measurement
from mmslam.results.page.single_file import closed_policy, inlined, template_environment

CAPTIONS = {
    "localization.png": "Plan of what was found; the user enlarged, with its error ellipses.",
    "raw_image.png": "The image as measured, ghosts behind the mirrors included.",
    "corrected_image.png": "The image after each ghost was unfolded through its mirror.",
    "angle_range_map.png": "The user's pilot over angle of arrival and path length.",
}

DRAWN_ALIVE = ("localization.png", "raw_image.png", "corrected_image.png")
"""Pictures of what the page draws itself, where it can."""

SCRIPTS_2D = ("predicted_paths.js", "moved_user.js", "plan.js", "start_report.js")
SCRIPTS_3D = (*SCRIPTS_2D[:-1], "slices.js", "space.js", SCRIPTS_2D[-1])

WIDE = ("localization.png", "angle_range_map.png")  # these hold two panels


def render_report(
    result: Mapping[str, Any],
    measurement: Measurement,
    pictures: Mapping[str, Path],
    *,
    scenario: str | None = None,
    plan: Mapping[str, Any] | None = None,
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
    plan
        What :func:`mmslam.results.page.plan_document` lays out: drawn to look into, in place of
        the still pictures of the same. None: the page runs no script.

    Returns
    -------
    HTML that needs no other file and no network.
    """
    environment = template_environment()
    scripts = SCRIPTS_3D if result["dimensions"] == 3 else SCRIPTS_2D
    alive = None if plan is None else inlined(plan, scripts)
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
            if name in pictures and not (alive and name in DRAWN_ALIVE)
        ],
        scenario=scenario,
        pi=math.pi,
        page=plan,
        inlined=alive,
        policy=closed_policy() if alive is None else alive.policy,
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
        "medium": _medium(measurement),
    }
    if frequencies.size > 1:
        bandwidth = frequencies[-1] - frequencies[0]
        step = bandwidth / (frequencies.size - 1)
        described["range resolution c/2B"] = f"{1e3 * speed_of_light / (2 * bandwidth):.2f} mm"
        described["unambiguous one-way path"] = f"{speed_of_light / step:.2f} m"
    return described


def _medium(measurement: Measurement) -> str:
    if measurement.air is not None:
        return f"air of {measurement.air}, n = {measurement.refractive_index:.6f}"
    index = measurement.medium_index
    return "vacuum" if index is None else f"of refractive index {index:g}"


def _fixed(value: float | None, digits: int = 3, scale: float = 1.0) -> str:
    return "—" if value is None else f"{value * scale:.{digits}f}"


def _point(values: list[float] | None, dimensions: int) -> str:
    return "—" if values is None else ", ".join(f"{value:.4f}" for value in values[:dimensions])


def _deviation(variance: float | None, scale: float) -> float | None:
    return None if variance is None else scale * math.sqrt(max(variance, 0.0))
