import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.constants import speed_of_light

from validation.figures.resolution_bars import draw_resolution_bars
from validation.figures.views import View


def test_the_bars_are_ten_cells_long() -> None:
    positions = np.zeros((260, 3))
    positions[:, 0] = (np.arange(260) - 129.5) * 0.5e-3
    frequencies = np.linspace(220e9, 295e9, 1001)
    view = View(left=-0.5, right=0.5, bottom=0.0, top=1.0)
    ax = Figure().subplots()
    draw_resolution_bars(ax, view, np.array([0.0, 0.8, 0.0]), positions, frequencies)
    (line,) = ax.lines
    x, y = np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float)
    # 0.886 is 0.88589 rounded.
    assert y[2] - y[1] == pytest.approx(10 * 0.886 * speed_of_light / 150e9, rel=2e-4)
    # 0.886 λ R/2D, within the near field's correction of (D/2R)²/2 = 0.3 %.
    across = 0.886 * speed_of_light / 257.5e9 * 0.8 / (2 * 259 * 0.5e-3)
    assert x[0] - x[1] == pytest.approx(10 * across, rel=5e-3)
    assert view.left < x.min()
    assert x.max() < view.right
