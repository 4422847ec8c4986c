"""Satellite formation flying as Gymnasium environments."""

from typing import TYPE_CHECKING

from formation_env.lazy import lazy_names
from formation_env.registration import ENV_IDS, SWARM_IDS, register_all

if TYPE_CHECKING:
    from formation_env.dynamics.propagation import propagate
    from formation_env.dynamics.spacecraft import Spacecraft
    from formation_env.envs import FormationEnv, FormationSwarmEnv, FormationSwarmVectorEnv, FormationVectorEnv
    from formation_env.envs.make_parallel import parallel_env
    from formation_env.orbital.orbit import Orbit
    from formation_env.settings import ConfigError
    from formation_env.task.loading import load_scenario, scenario_names, swarm_names
    from formation_env.task.scenario import Scenario

__version__ = "0.1.0"

register_all()

__getattr__ = lazy_names(
    __name__,
    {
        "ConfigError": "formation_env.settings",
        "FormationEnv": "formation_env.envs",
        "FormationSwarmEnv": "formation_env.envs",
        "FormationSwarmVectorEnv": "formation_env.envs",
        "FormationVectorEnv": "formation_env.envs",
        "Orbit": "formation_env.orbital.orbit",
        "Scenario": "formation_env.task.scenario",
        "Spacecraft": "formation_env.dynamics.spacecraft",
        "load_scenario": "formation_env.task.loading",
        "parallel_env": "formation_env.envs.make_parallel",
        "propagate": "formation_env.dynamics.propagation",
        "scenario_names": "formation_env.task.loading",
        "swarm_names": "formation_env.task.loading",
    },
)

__all__ = [
    "ENV_IDS",
    "SWARM_IDS",
    "ConfigError",
    "FormationEnv",
    "FormationSwarmEnv",
    "FormationSwarmVectorEnv",
    "FormationVectorEnv",
    "Orbit",
    "Scenario",
    "Spacecraft",
    "load_scenario",
    "parallel_env",
    "propagate",
    "scenario_names",
    "swarm_names",
]
