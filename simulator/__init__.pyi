from .dataset import make_dataset, plan_dataset
from .export.sionna_scene import sionna_scene
from .response import simulate_echo, simulate_uplink
from .scene import scenario_truth
from .scene.scenario_paths import ScenarioPath, scenario_paths
from .simulation import Simulation, simulate

__all__ = [
    "ScenarioPath",
    "Simulation",
    "make_dataset",
    "plan_dataset",
    "scenario_paths",
    "scenario_truth",
    "simulate",
    "simulate_echo",
    "simulate_uplink",
    "sionna_scene",
]
