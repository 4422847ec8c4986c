"""Satellite formation flying as Gymnasium environments."""

from formation_env.envs import ENV_IDS, FormationEnv, FormationVectorEnv, register_all
from formation_env.orbit import Orbit
from formation_env.propagation import propagate
from formation_env.scenario import Scenario, load_scenario, scenario_names
from formation_env.settings import ConfigError
from formation_env.spacecraft import Spacecraft

__version__ = "0.1.0"

register_all()

__all__ = [
    "ENV_IDS",
    "ConfigError",
    "FormationEnv",
    "FormationVectorEnv",
    "Orbit",
    "Scenario",
    "Spacecraft",
    "load_scenario",
    "propagate",
    "scenario_names",
]
