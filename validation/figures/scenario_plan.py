"""The plan of a scenario, drawn before any simulation."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from scenes.scenario import Scenario
from scenes.schema.antenna import Antenna, Cosine, GaussianBeam, Horn
from scenes.schema.objects import Box, Cylinder, MeshFile, Plate
from simulator.scene.scenario_paths import ScenarioPath
from validation.figures import figures_2d, views

MATERIAL_COLOURS = {"absorber": "#3d3d3d", "metal": figures_2d.MIRROR}
DIELECTRIC = "#8c6d4f"
TARGET_PATH = "#2c7a51"
TRANSMITTER = "#8a4fa0"
FAINT_DB = -30.0
"""Gain relative to the antennas' peaks below which a path is drawn faint: it is negligible. [dB]"""

_BEAM = 0.25  # length of the wedge that shows an antenna's beam, over the view's size
_MARGIN = 0.15  # around the drawing, over the view's size: space for names beside walls


def draw_scenario(ax: Axes, scenario: Scenario, paths: Sequence[ScenarioPath] = ()) -> Axes:
    """Draw a scenario from above: array, objects, users and the aims of their antennas.

    Parameters
    ----------
    ax
        Set to equal scales in metres.
    scenario
        Drawn in projection along z.
    paths
        Its specular paths, to be drawn with it.
    """
    station = scenario.base_station
    outlines = {name: outline(scenario, name) for name in scenario.objects}
    users = {name: user.position for name, user in scenario.users.items()}
    points = [station.element_positions, *outlines.values()]
    points += [] if station.transmitter is None else [station.transmitter.positions]
    points += [place[None] for place in users.values()]
    points += [target.position[None] for target in scenario.points.values()]
    view = views.view_around(np.concatenate(points), margin=_MARGIN)
    size = max(view.right - view.left, view.top - view.bottom)
    ax.grid(color="#dfe4e8", lw=0.6)
    ax.set_axisbelow(True)
    ahead = station.boresight * 0.06 * size
    if station.receivers is None:
        ax.annotate(
            "",
            (float(station.centre[0] + ahead[0]), float(station.centre[1] + ahead[1])),
            xytext=(float(station.centre[0]), float(station.centre[1])),
            arrowprops={"arrowstyle": "-|>", "color": figures_2d.ARRAY},
        )
    for name, line in outlines.items():
        _draw_object(ax, scenario, name, line)
    for path in paths:
        style = path_style(path)
        ax.plot(path.vertices[:, 0], path.vertices[:, 1], zorder=2.5, **style)
    beams = _station_beams(ax, scenario)
    beams += [(user.position, user.antenna, figures_2d.USER) for user in scenario.users.values()]
    for place, antenna, colour in beams:
        _draw_beam(ax, place, scenario.aim(antenna, place), antenna, colour, _BEAM * size)
    for name, target in scenario.points.items():
        ax.plot(*target.position[:2], "+", color=figures_2d.MIRROR, ms=9, mew=2, zorder=6)
        ax.annotate(
            name,
            (float(target.position[0]), float(target.position[1])),
            xytext=(0, 7),
            textcoords="offset points",
            ha="center",
            color=figures_2d.MIRROR,
            fontsize=8,
        )
    for name, place in users.items():
        figures_2d.mark_user(ax, name, place)
    return figures_2d.in_metres(ax, view)


def _station_beams(
    ax: Axes, scenario: Scenario
) -> list[tuple[Float[np.ndarray, " 3"], Antenna, str]]:
    """Mark the base station's antennas; return position, kind and colour of those with a beam.

    Of many receivers the beam of the middle one is drawn.
    """
    station = scenario.base_station
    places = station.element_positions
    if station.receivers is None:
        figures_2d.overlay_array(ax, places)
        beams = [(station.centre, station.antenna, figures_2d.ARRAY)]
    else:
        ax.plot(places[:, 0], places[:, 1], ".", color=figures_2d.ARRAY, ms=5, zorder=5)
        _label(ax, places[len(places) // 2], "receivers", figures_2d.ARRAY)
        beams = [(places[len(places) // 2], station.antenna, figures_2d.ARRAY)]
    if station.transmitter is not None:
        senders = station.transmitter.positions
        ax.plot(senders[:, 0], senders[:, 1], "^", color=TRANSMITTER, ms=7, zorder=6)
        _label(ax, senders[0], "transmitter", TRANSMITTER)
        beams.append((senders[0], station.transmit_antenna, TRANSMITTER))
    return beams


def _label(ax: Axes, place: Float[np.ndarray, " 3"], text: str, colour: str) -> None:
    ax.annotate(
        text,
        (float(place[0]), float(place[1])),
        xytext=(0, -13),
        textcoords="offset points",
        ha="center",
        color=colour,
        fontsize=9,
        annotation_clip=False,
    )


def path_style(path: ScenarioPath) -> dict[str, Any]:
    """Return the style of a path: by its end, and faint outside of the antennas' beams."""
    faint = path.gain_db < FAINT_DB
    return {
        "color": figures_2d.PATH if path.kind == "user" else TARGET_PATH,
        "lw": 1.0 if faint else 1.6,
        "ls": ":" if faint else "-",
        "alpha": 0.6 if faint else 0.95,
    }


def outline(scenario: Scenario, name: str) -> Float[np.ndarray, "corners 3"]:
    """Return the corners of an object seen from above [m]."""
    body = scenario.objects[name]
    if isinstance(body, MeshFile):
        from scenes.meshes.mesh_file import placed_mesh

        low, high = np.asarray(placed_mesh(body).bounds, dtype=np.float64)
        corners = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
        return np.array([[x, y, low[2]] for x, y in corners])
    if isinstance(body, Plate):
        half = body.length_m / 2 * body.tangent
        return np.stack([body.centre - half, body.centre + half])
    if isinstance(body, Cylinder):
        along, across = body.radius_m * body.tangent, body.radius_m * body.across
    else:
        along, across = body.length_m / 2 * body.tangent, body.depth_m / 2 * body.across
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    return np.stack([body.centre + u * along + v * across for u, v in signs])


def _draw_object(
    ax: Axes, scenario: Scenario, name: str, line: Float[np.ndarray, "corners 3"]
) -> None:
    body = scenario.objects[name]
    material = body.material if isinstance(body.material, str) else body.material.name or "slab"
    colour = MATERIAL_COLOURS.get(material, DIELECTRIC)
    if isinstance(body, Plate):
        ax.plot(line[:, 0], line[:, 1], color=colour, lw=3.5, solid_capstyle="butt", zorder=3)
    elif isinstance(body, Cylinder):
        ax.add_patch(Circle((body.centre_m[0], body.centre_m[1]), body.radius_m, color=colour))
    else:
        style = "--" if isinstance(body, MeshFile) else "-"  # of a mesh, the bounding box
        ax.add_patch(Polygon(line[:, :2], fc="none", ec=colour, lw=2, ls=style))
    rough = f", {body.roughness.rms_mm:g} mm rms" if body.roughness else ""
    centre = line.mean(axis=0)
    ax.annotate(
        f"{name}\n{material}{rough}",
        (float(centre[0]), float(centre[1])),
        xytext=(0, 8),
        textcoords="offset points",
        ha="center",
        va="bottom",
        rotation=_readable(body.angle_deg) if isinstance(body, Plate | Box) else 0.0,
        rotation_mode="anchor",
        color=colour,
        fontsize=8,
    )


def _draw_beam(
    ax: Axes,
    place: Float[np.ndarray, " 3"],
    aim: Float[np.ndarray, " 3"],
    antenna: Antenna,
    colour: str,
    reach: float,
) -> None:
    width = half_power_width(antenna)
    if width is None:
        return
    azimuth = float(np.arctan2(aim[1], aim[0]))
    angles = np.linspace(azimuth - width / 2, azimuth + width / 2, 33)
    edge = place[:2] + reach * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    ax.add_patch(Polygon(np.vstack([place[:2], edge]), color=colour, alpha=0.18, lw=0))


def half_power_width(antenna: Antenna) -> float | None:
    """Return the angle between an antenna's half-power directions, None if isotropic [rad].

    In closed form, so that a plan needs neither the simulator nor LLVM.
    """
    if isinstance(antenna, GaussianBeam):
        return float(2 * antenna.sigma_rad * np.sqrt(np.log(2)))
    if isinstance(antenna, Cosine):
        return float(2 * np.arccos(0.5 ** (1 / antenna.exponent))) if antenna.exponent else None
    if isinstance(antenna, Horn):
        return float(np.pi * 10 ** (-antenna.gain_dbi / 20))
    return None


def _readable(angle_deg: float) -> float:
    """Return a text's angle rotated by 180° if it would be upside down [degree]."""
    return (angle_deg + 90.0) % 180.0 - 90.0
