"""Maps of a planar array's pilots over direction and length."""

from typing import Any

import numpy as np

from estimator.array.planar_array import planar_array
from estimator.channel.angle_range_map_3d import direction_map
from estimator.measurement.model import Uplink


def test_half_a_wavelength_apart_a_path_nearly_as_long_as_is_unambiguous_is_mapped(
    world: Any,
) -> None:
    # All but the corners of the square of cosines ±0.98 is imaged. A corner is no direction: its
    # place, √2 times the path away, is beyond the unambiguous 1.71 m.
    frequencies = np.linspace(57e9, 64e9, 41)
    steps = 2.4e-3 * (np.arange(6) - 2.5)
    x, z = np.meshgrid(steps, steps, indexing="ij")
    positions = np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=-1)
    source = 1.5 * np.array([0.0, 1.0, 0.0])
    uplink = Uplink(
        samples=world.pilot(source, positions=positions, frequencies=frequencies),
        positions=positions,
        frequencies=frequencies,
        user="ann",
    )
    chart = direction_map(uplink, planar_array(positions), least_share=0.05)
    along, up, length = np.unravel_index(np.abs(chart.values).argmax(), chart.values.shape)
    # To half a step of its axes, by which the grid may miss the peak.
    assert abs(chart.along[along]) <= np.diff(chart.along)[0]
    assert abs(chart.up[up]) <= np.diff(chart.up)[0]
    assert abs(chart.path_length[length] - 1.5) <= np.diff(chart.path_length)[0]
    corner = chart.along[:, None] ** 2 + chart.up**2 > 1
    assert corner.any()
    assert not chart.values[corner].any()
