"""The single and the batched environment, both faces of one simulation."""

from formation_env.envs.single import FormationEnv
from formation_env.envs.swarm import FormationSwarmEnv
from formation_env.envs.swarm_vector import FormationSwarmVectorEnv
from formation_env.envs.vector import FormationVectorEnv
from formation_env.registration import ENV_IDS, register_all

__all__ = [
    "ENV_IDS",
    "FormationEnv",
    "FormationSwarmEnv",
    "FormationSwarmVectorEnv",
    "FormationVectorEnv",
    "register_all",
]
