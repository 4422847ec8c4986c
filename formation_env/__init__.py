"""Satellite formation flying as Gymnasium environments."""

from formation_env.dynamics.propagation import propagate
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.envs import FormationEnv, FormationVectorEnv, register_all
from formation_env.orbital.orbit import Orbit
from formation_env.settings import ConfigError
from formation_env.task.loading import ENV_IDS, load_scenario, scenario_names
from formation_env.task.scenario import Scenario

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
