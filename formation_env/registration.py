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
    """Register the environments with Gymnasium, once."""
    for env_id, scenario in ENV_IDS.items():
        if env_id not in gymnasium.registry:
            gymnasium.register(
                id=env_id,
                entry_point="formation_env.envs.single:FormationEnv",
                vector_entry_point="formation_env.envs.vector:FormationVectorEnv",
                kwargs={"scenario": scenario},
            )
