from .loading import (
    ScenarioSource,
    load_scenario,
    override_scenario,
    scenario_names,
    scenario_schema,
    scenario_source,
    scenario_to_toml,
    set_keys,
)
from .toml_writer import toml_text

__all__ = [
    "ScenarioSource",
    "load_scenario",
    "override_scenario",
    "scenario_names",
    "scenario_schema",
    "scenario_source",
    "scenario_to_toml",
    "set_keys",
    "toml_text",
]
