"""Line of sight from a user to each element, by Sionna RT."""

import numpy as np
import sionna.rt as rt
from jaxtyping import Bool, Float

from simulator.geometry.ray_scene import RayScene, blocked

SHORTEST_LEG = 0.011
"""Length below which Sionna RT may leave a path out (its limit is 1 cm). [m]"""


def in_line_of_sight(
    rays: RayScene, user: Float[np.ndarray, " 3"], elements: Float[np.ndarray, "elements 3"]
) -> Bool[np.ndarray, " elements"]:
    """Return which elements see the user, by Sionna RT's deterministic path solver."""
    scene = rays.scene
    isotropic = rt.PlanarArray(num_rows=1, num_cols=1, pattern="iso", polarization="V")
    scene.tx_array = scene.rx_array = isotropic
    # No object's name holds a slash, so these names cannot collide.
    scene.add(rt.Transmitter("/user", position=rays.about_centre(user).tolist()))
    names = [f"/element-{index}" for index in range(len(elements))]
    for name, element in zip(names, rays.about_centre(elements), strict=True):
        scene.add(rt.Receiver(name, position=element.tolist()))
    paths = rt.PathSolver(deterministic=True)(
        scene, max_depth=0, los=True, synthetic_array=False, samples_per_src=1, refraction=False
    )
    # [receiver, antenna, transmitter, antenna, path]
    valid = np.asarray(paths.valid.numpy(), dtype=bool).reshape(len(elements), -1)
    seen = np.asarray(valid.any(axis=-1))
    # Sionna RT leaves out legs shorter than 1 cm.
    near = np.linalg.norm(elements - user, axis=-1) < SHORTEST_LEG
    seen[near] = ~blocked(rays, np.broadcast_to(user, elements[near].shape), elements[near])
    for name in ("/user", *names):
        scene.remove(name)
    return np.asarray(seen)
