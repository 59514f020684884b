"""Image a plain NumPy array of S-parameters: no scenario, no file, no simulator.

Run as ``python examples/image_a_numpy_array.py``; replace the first three arrays by your own
sweep.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.constants import speed_of_light

from estimator.imaging.backprojection import backproject
from estimator.measurement.model import Echo
from estimator.results.pixel_grid import PixelGrid

frequencies = np.linspace(220e9, 295e9, 301)  # [Hz]
positions = np.stack([np.linspace(-0.065, 0.065, 261), np.zeros(261), np.zeros(261)], axis=1)
distance = np.linalg.norm(np.array([0.03, 0.4, 0.0]) - positions, axis=1)  # of one target [m]
samples = np.exp(-4j * np.pi * distance[:, None] / speed_of_light * frequencies)

grid = PixelGrid.spanning(x=(-0.1, 0.1), y=(0.3, 0.5), spacing=0.5e-3)
echo = Echo(samples=samples, positions=positions, frequencies=frequencies)
image = backproject(echo, grid.points)

level_db = 20 * np.log10(np.abs(image).T + 1e-12)
plt.imshow(level_db, origin="lower", extent=grid.extent, vmin=-40, vmax=0)
plt.colorbar(label="level [dB]")
plt.xlabel("x [m]")
plt.ylabel("y [m]")
plt.savefig("image.png")
