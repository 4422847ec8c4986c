"""The way in to the PettingZoo environment, which needs a package that not every user has."""

from pathlib import Path
from typing import TYPE_CHECKING

from formation_env.task.scenario import Scenario

if TYPE_CHECKING:
    from formation_env.envs.parallel import FormationParallelEnv


def parallel_env(scenario: str | Path | Scenario = "swarm", render_mode: str | None = None) -> "FormationParallelEnv":
    """A scenario of several followers as a PettingZoo `ParallelEnv`.

    Args:
        scenario: a name, a path of a YAML file, or a Scenario.
        render_mode: None.

    Raises:
        ConfigError: the scenario is wrong.
        ImportError: PettingZoo is not installed.
    """
    try:
        from formation_env.envs.parallel import FormationParallelEnv
    except ModuleNotFoundError as error:
        if error.name != "pettingzoo":
            raise
        raise ImportError("parallel_env needs PettingZoo: pip install 'formation-env[multiagent]'") from error
    return FormationParallelEnv(scenario, render_mode)
