"""The scale bars of an image: size of its resolution cell."""

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes

from estimator.array.resolution import cell_at
from validation.figures.figures_2d import ON_DARK
from validation.figures.views import View


def draw_resolution_bars(
    ax: Axes,
    view: View,
    point: Float[np.ndarray, " 3"],
    positions: Float[np.ndarray, "positions 3"],
    frequencies: Float[np.ndarray, " freqs"],
    *,
    cells: int = 10,
) -> Axes:
    """Draw bars of a number of -3 dB resolution cells in a corner: along range, and across.

    Parameters
    ----------
    ax, view
        The axes and the region shown.
    point
        Point at which the cell is computed: across range it grows with distance. [m]
    positions, frequencies
        Of the untapered echo. [m], [Hz]
    cells
        Cells in a bar; a single one is too short to be visible.
    """
    cell = cell_at(point, positions=positions, frequencies=frequencies)
    x = view.right - 0.05 * (view.right - view.left) - cells * cell.across
    y = view.bottom + 0.1 * (view.top - view.bottom)
    ax.plot(
        [x + cells * cell.across, x, x],
        [y, y, y + cells * cell.along_range],
        color=ON_DARK,
        lw=1.5,
        solid_joinstyle="miter",
    )
    ax.annotate(
        f"{cells} cells: {cells * cell.along_range * 1e3:.3g} mm along range,\n"
        f"{cells * cell.across * 1e3:.3g} mm across at {np.linalg.norm(point):.2f} m",
        (x + cells * cell.across, y),
        xytext=(0, -4),
        textcoords="offset points",
        color=ON_DARK,
        ha="right",
        va="top",
        fontsize=8,
    )
    return ax
