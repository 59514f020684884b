"""The truth of a scenario, stored beside its measurement and never shown to the estimator."""

import numpy as np
import xarray as xr

from scenes.objects import Plate
from scenes.scenario import Scenario
from scenes.shapes import plate_segment


def scenario_truth(scenario: Scenario) -> xr.Dataset:
    """Lay out where users and walls (conducting plates) are.

    Returns
    -------
    ``user_position [user, axis]``, ``wall_start`` and ``wall_end [wall, axis]``, in metres.
    """
    walls = {
        name: plate_segment(body)
        for name, body in scenario.objects.items()
        if isinstance(body, Plate) and body.material != "absorber"
    }
    positions = [user.position for user in scenario.users.values()]
    labels = np.dtypes.StringDType()
    return xr.Dataset(
        {
            "user_position": (("user", "axis"), _rows(positions), {"units": "m"}),
            "wall_start": (
                ("wall", "axis"),
                _rows([ends[0] for ends in walls.values()]),
                {"units": "m"},
            ),
            "wall_end": (
                ("wall", "axis"),
                _rows([ends[1] for ends in walls.values()]),
                {"units": "m"},
            ),
        },
        {
            "user": ("user", np.array(list(scenario.users), dtype=labels)),
            "wall": ("wall", np.array(list(walls), dtype=labels)),
        },
    )


def _rows(points: list[np.ndarray]) -> np.ndarray:
    return np.array(points, dtype=np.float64).reshape(-1, 3)
