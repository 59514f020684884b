"""Run Sionna RT's own path solver, radio map and renderer on a scenario of the library.

Run as ``python examples/sionna_on_a_scenario.py [SCENARIO [FOLDER]]``; it writes
``sionna_paths.png`` and ``sionna_radio_map.png``. The scenario needs a user.

The scene has smooth mean surfaces; their roughness is in the scattering coefficient. So the
specular paths are those of our own simulation, but the diffuse ones are samples with random
phases: they have the right power, and an array cannot focus them.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.constants import speed_of_light

from scenes.files.loading import load_scenario
from simulator.export.sionna_scene import sionna_scene, stand_back

import sionna.rt as rt  # isort: skip  (the simulator chooses the backend first)

scenario = load_scenario(sys.argv[1] if len(sys.argv) > 1 else "slam_2d")
folder = Path(sys.argv[2] if len(sys.argv) > 2 else ".")
scene = sionna_scene(scenario)
scene.tx_array = scene.rx_array = rt.PlanarArray(
    num_rows=1, num_cols=1, pattern="iso", polarization="V"
)
for name, material in scene.radio_materials.items():
    print(
        f"{name}: permittivity {material.relative_permittivity[0]:.3g}, conductivity "
        f"{material.conductivity[0]:.3g} S/m, scattering {material.scattering_coefficient[0]:.3f}"
    )

solver = rt.PathSolver(deterministic=True)
paths = solver(
    scene, max_depth=scenario.max_bounces, refraction=False, synthetic_array=False, seed=0
)
lengths = speed_of_light * paths.tau.numpy().ravel()
gains = 20 * np.log10(np.abs(paths.a[0].numpy() + 1j * paths.a[1].numpy()).ravel() + 1e-30)
for length, gain in zip(lengths, gains, strict=True):
    if length > 0:
        print(f"specular path: {length:.4f} m, {gain:.1f} dB")

eye, target = stand_back(scenario)
figure = scene.render(
    camera=rt.Camera(position=eye, look_at=target),
    paths=paths,
    resolution=(900, 600),
    num_samples=64,
)
figure.savefig(folder / "sionna_paths.png", dpi=150, bbox_inches="tight")

# A cut 3 cm below the antennas: their own plane, seen edge-on, would catch no ray.
extent = 1.8
radio_map = rt.RadioMapSolver()(
    scene,
    center=[target[0], target[1], -0.03],
    orientation=[0.0, 0.0, 0.0],
    size=[extent, extent],
    cell_size=[0.02, 0.02],
    samples_per_tx=2_000_000,
    max_depth=scenario.max_bounces,
    diffuse_reflection=True,
    refraction=False,
)
gain_db = 10 * np.log10(radio_map.path_gain.numpy()[0] + 1e-30)
edges = np.array([-extent, extent, -extent, extent]) / 2 + np.repeat(target[:2], 2)
top = float(np.percentile(gain_db, 99.5))
fig, ax = plt.subplots(layout="constrained")
image = ax.imshow(gain_db, origin="lower", extent=tuple(edges), vmin=top - 50, vmax=top)
fig.colorbar(image, label="path gain [dB]")
ax.set(xlabel="x [m]", ylabel="y [m]", title=f"{scenario.name}: Sionna's radio map")
fig.savefig(folder / "sionna_radio_map.png", dpi=120)
