"""The registered ids. Nothing heavy is imported, so that `import formation_env` and the command line start fast."""

from typing import Final

import gymnasium

ENV_IDS: Final = {
    "FormationInitialization-v0": "initialization",
    "FormationKeeping-v0": "keeping",
    "FormationReconfiguration-v0": "reconfiguration",
    "FormationMission-v0": "mission",
}
"""Registered ids and their scenarios."""


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
