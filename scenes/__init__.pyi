from .files import load_scenario, scenario_names, scenario_schema, scenario_to_toml
from .random_streams import random_stream
from .realisations import surface_to_mesh
from .scenario import Noise, Scenario, ScenarioError, User, parse_scenario

__all__ = [
    "Noise",
    "Scenario",
    "ScenarioError",
    "User",
    "load_scenario",
    "parse_scenario",
    "random_stream",
    "scenario_names",
    "scenario_schema",
    "scenario_to_toml",
    "surface_to_mesh",
]
