"""The registered ids. Nothing heavy is imported, so that `import formation_env` and the command line start fast."""

from typing import Final

import gymnasium

ENV_IDS: Final = {
    "FormationInitialization-v0": "initialization",
    "FormationKeeping-v0": "keeping",
    "FormationReconfiguration-v0": "reconfiguration",
    "FormationMission-v0": "mission",
}
"""Registered ids and their scenarios, of one follower."""

SWARM_IDS: Final = {
    "FormationSwarm-v0": "swarm",
    "FormationSwap-v0": "swap",
}
"""Registered ids and their scenarios, of several followers."""


def register_all() -> None:
    """Register the environments with Gymnasium, once.

    The specs state no `max_episode_steps`, or Gymnasium would cut `make(id, scenario=...)` at the length of the id's
    own scenario; `env.spec.max_episode_steps` of an environment made is the length of its plan.
    """
    single = ("formation_env.envs.single:FormationEnv", "formation_env.envs.vector:FormationVectorEnv")
    swarm = ("formation_env.envs.swarm:FormationSwarmEnv", "formation_env.envs.swarm_vector:FormationSwarmVectorEnv")
    for ids, (entry_point, vector_entry_point) in ((ENV_IDS, single), (SWARM_IDS, swarm)):
        for env_id, scenario in ids.items():
            if env_id not in gymnasium.registry:
                gymnasium.register(
                    id=env_id,
                    entry_point=entry_point,
                    vector_entry_point=vector_entry_point,
                    kwargs={"scenario": scenario},
                )
