"""Levels of the edges of smooth plates: the simulator's echo against the closed form.

The simulator sums facets and fringe currents; the estimator predicts the levels by Keller's
diffraction (:mod:`estimator.prediction.edge_echo`). Both share no code.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimator.imaging.point_levels import point_levels_db
from estimator.positioning.edge_evidence import DEVIATION_DB
from estimator.prediction.edge_echo import edge_echoes_db
from scenes import load_scenario
from simulator.simulation import simulate
from validation.harness.claim import Row
from validation.metrics.truth import truth_from_dataset

ANGLES_DEG = (20.0, 35.0, 50.0, 65.0)
"""Between a plate and the array: away from where it faces the array. [deg]"""
SEARCHED = np.linspace(-4e-3, 4e-3, 17)
"""Places about an edge of which the brightest counts: a bent wave peaks a millimetre aside. [m]"""
SMALL = {"radio.points": 601, "base_station.elements": 128, "noise.snr_db": 80.0}
"""Fewer samples than the scenario's, for time, and hardly any noise: far edges are faint."""


@dataclass(frozen=True, kw_only=True)
class EdgeLevels:
    """The levels of the two edges of a plate over the predicted ones. [dB]."""

    along: tuple[float, float]  # of a conductor with the field along the edges
    lossy: tuple[float, float]  # of a weak reflector, over its coefficient


def edge_levels(material: str, angle_deg: float, *, seed: int = 0) -> EdgeLevels:
    """Simulate a smooth plate and compare the levels of its edges with the prediction."""
    scenario = load_scenario(
        "slam_2d",
        {
            "objects.wall.angle_deg": angle_deg,
            "objects.wall.material": material,
            "objects.wall.roughness.rms_mm": 5e-4,
            **SMALL,
        },
    )
    simulated = simulate(scenario, seed=seed)
    echo = simulated.measurement.echo
    assert echo is not None
    truth = truth_from_dataset(simulated.truth)
    edges = np.stack([truth.wall_start["wall"], truth.wall_end["wall"]])
    around = np.stack(np.meshgrid(SEARCHED, SEARCHED, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    levels = np.array([point_levels_db(echo, edge + around).max() for edge in edges])
    over = levels - edge_echoes_db(edges, float(echo.frequencies.mean()))
    return EdgeLevels(
        along=(float(over[0, 0]), float(over[0, 1])), lossy=(float(over[2, 0]), float(over[2, 1]))
    )


def edge_rows(angles_deg: Sequence[float] = ANGLES_DEG) -> list[Row]:
    """Compare conductors' edges with the closed form, and panes' two edges with each other."""
    metal = [edge_levels("metal", angle) for angle in angles_deg]
    glass = [edge_levels("glass", angle) for angle in angles_deg]
    return [
        Row(
            name="edge_evidence.DEVIATION_DB: largest error of a conductor's edge [dB]",
            stated="0.4",
            measured=float(np.max(np.abs([one.along for one in metal]))),
            high=DEVIATION_DB,
            origin="the deviation that is assumed",
        ),
        Row(
            name="edge_evidence.DEVIATION_DB: largest difference of a pane's two edges [dB]",
            stated="4",
            measured=float(np.max(np.abs([one.lossy[0] - one.lossy[1] for one in glass]))),
            high=2 * np.sqrt(2) * DEVIATION_DB,
            origin="two deviations of a difference",
        ),
    ]
