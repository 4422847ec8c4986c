"""The single and the batched environment, both faces of one simulation, and their registration."""

import gymnasium

from formation_env.envs.single import FormationEnv
from formation_env.envs.vector import FormationVectorEnv
from formation_env.task.loading import ENV_IDS


def register_all() -> None:
    """Register the environments with Gymnasium, once.

    The specs state no `max_episode_steps`, or Gymnasium would cut `make(id, scenario=...)` at the length of the id's
    own scenario; `env.spec.max_episode_steps` of an environment made is the length of its plan.
    """
    for env_id, scenario in ENV_IDS.items():
        if env_id not in gymnasium.registry:
            gymnasium.register(
                id=env_id,
                entry_point="formation_env.envs.single:FormationEnv",
                vector_entry_point="formation_env.envs.vector:FormationVectorEnv",
                kwargs={"scenario": scenario},
            )


__all__ = ["ENV_IDS", "FormationEnv", "FormationVectorEnv", "register_all"]
