"""A scenario in perspective: its smooth surfaces, antennas and specular paths."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from matplotlib.colors import to_rgba
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from scenes.scenario import Scenario
from simulator.geometry.mean_surfaces import mean_surfaces
from simulator.scene.scenario_paths import ScenarioPath
from validation.figures import figures_2d
from validation.figures.scenario_plan import DIELECTRIC, MATERIAL_COLOURS, TRANSMITTER, path_style

STRIP_HEIGHT = 0.12
"""Height of the strips that represent the lines of a 2-D scene, over the scene's size [-]."""

SHELL = 0.4
"""Size of a surface, over the scene's, above which it may enclose and hide others. [-]"""

MOST_FACES = 20_000
"""Most faces drawn of one object; of a finer mesh, evenly chosen ones. [-]"""

_ELEVATION, _AZIMUTH = 32.0, -58.0  # of the viewpoint, azimuth from +x [degree]


def draw_view(ax: Axes3D, scenario: Scenario, paths: Sequence[ScenarioPath] = ()) -> Axes3D:
    """Draw a scenario in perspective, from behind the base station's right and above.

    Parameters
    ----------
    ax
        Set to equal scales in metres.
    scenario
        Drawn with smooth surfaces; the lines of a 2-D scene become low upright strips.
    paths
        Its specular paths, to be drawn with it.
    """
    station = scenario.base_station
    surfaces = mean_surfaces(scenario)
    users = {name: user.position for name, user in scenario.users.items()}
    points = [station.element_positions, *(surface.vertices for surface in surfaces)]
    senders = station.transmitter.positions if station.transmitter is not None else None
    points += [] if senders is None else [senders]
    points += [place[None] for place in users.values()]
    points += [target.position[None] for target in scenario.points.values()]
    low, high = (bound(np.concatenate(points), axis=0) for bound in (np.min, np.max))
    size = float(np.linalg.norm(high - low))
    strip = STRIP_HEIGHT * size
    for surface in surfaces:
        corners = surface.vertices[surface.cells]
        if surface.cells.shape[1] == 2:
            corners = _strips(corners, strip)
        step = -(-len(corners) // MOST_FACES)
        material = scenario.objects[surface.name].material
        colour = MATERIAL_COLOURS.get(str(material), DIELECTRIC)
        edges = to_rgba(colour, 0.9 if len(corners) <= 200 else 0.15)
        # Surfaces that enclose others are drawn almost transparent.
        shell = float(np.ptp(surface.vertices, axis=0).max()) > SHELL * size
        face = to_rgba(colour, 0.04 if shell and scenario.dimensions == 3 else 0.28)
        ax.add_collection3d(
            Poly3DCollection(corners[::step], facecolors=face, edgecolors=edges, linewidths=0.5)
        )
        middle = surface.vertices.mean(axis=0)
        middle[2] += strip / 2 if scenario.dimensions == 2 else 0.0
        ax.text(*middle, surface.name, color=colour, fontsize=8, ha="center")
    for path in paths:
        ax.plot(*path.vertices.T, **path_style(path))
    ax.plot(*station.element_positions.T, ".", color=figures_2d.ARRAY, ms=2.5)
    if senders is not None:
        ax.plot(*senders.T, "^", color=TRANSMITTER, ms=7)
        ax.text(*senders[0], "  transmitter", color=TRANSMITTER, fontsize=8)
    for name, target in scenario.points.items():
        ax.plot(*target.position[:, None], "+", color=figures_2d.MIRROR, ms=8, mew=2)
        ax.text(*target.position, f"  {name}", color=figures_2d.MIRROR, fontsize=8)
    for name, place in users.items():
        ax.plot(*place[:, None], "o", color=figures_2d.USER, mec="white", ms=7)
        ax.text(*place, f"  {name}", color=figures_2d.USER, fontsize=9, fontweight="bold")
    _equal_axes(ax, low, high, strip if scenario.dimensions == 2 else 0.05 * size)
    return ax


def _strips(lines: Float[np.ndarray, "lines 2 3"], height: float) -> np.ndarray:
    up = np.array([0.0, 0.0, height / 2])
    first, second = lines[:, 0], lines[:, 1]
    return np.stack([first - up, second - up, second + up, first + up], axis=1)


def _equal_axes(
    ax: Axes3D, low: Float[np.ndarray, " 3"], high: Float[np.ndarray, " 3"], least: float
) -> None:
    centre, sides = (low + high) / 2, np.maximum(high - low, least) * 1.06
    for axis, middle, side in zip("xyz", centre, sides, strict=True):
        getattr(ax, f"set_{axis}lim")(middle - side / 2, middle + side / 2)
        getattr(ax, f"set_{axis}label")(f"{axis} [m]")
        getattr(ax, f"{axis}axis").set_tick_params(labelsize=7)
    ax.set_box_aspect(tuple(sides / sides.max()), zoom=0.97)
    ax.locator_params(nbins=5)
    ax.view_init(elev=_ELEVATION, azim=_AZIMUTH)
