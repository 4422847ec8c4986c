"""The environments: two faces of one simulation, and their registration."""

import gymnasium

from formation_env.envs.single import FormationEnv
from formation_env.envs.vector import FormationVectorEnv
from formation_env.task.loading import ENV_IDS


def register_all() -> None:
    """Register the environments with Gymnasium, once."""
    for env_id, scenario in ENV_IDS.items():
        if env_id not in gymnasium.registry:
            gymnasium.register(
                id=env_id,
                entry_point="formation_env.envs.single:FormationEnv",
                vector_entry_point="formation_env.envs.vector:FormationVectorEnv",
                kwargs={"scenario": scenario},
            )


__all__ = ["ENV_IDS", "FormationEnv", "FormationVectorEnv", "register_all"]
