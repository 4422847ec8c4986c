"""From what the user asks for to a run's settings."""

from dataclasses import asdict
from pathlib import Path

from agents.runs import Run, library_versions
from agents.settings import ALGORITHMS, AgentSettings, load_settings
from formation_env.envs import ENV_IDS
from formation_env.evaluation import scenario_of
from formation_env.settings import ConfigError, build, nearest


def plan_run(
    algorithm: str,
    env: str,
    steps: int,
    seed: int = 0,
    rows: int | None = None,
    config: Path | None = None,
    validations: int = 20,
    validation_episodes: int = 64,
    threads: int = 1,
    command: str = "",
) -> Run:
    """A run with its hyperparameters and scenario read from their files.

    Args:
        algorithm: `ppo` or `sac`.
        env: a registered id, or a scenario's name or path.
        steps: environment steps.
        seed: of the training.
        rows: environments side by side; by default as in the file of hyperparameters.
        config: that file; by default configs/agents/ALGORITHM.yaml.
        validations: how many over the run.
        validation_episodes: episodes of each.
        threads: of torch.
        command: the command line, to be noted.

    Raises:
        ConfigError: anything in it is wrong; one line per fault, naming file, key and value.
    """
    if algorithm not in ALGORITHMS:
        raise ConfigError(f"no algorithm named {algorithm!r}; {nearest(algorithm, ALGORITHMS)}")
    known = ENV_IDS.get(env, env)
    if env.endswith("-v0") and env not in ENV_IDS:
        raise ConfigError(f"no environment named {env!r}; {nearest(env, ENV_IDS)}")
    data = {
        "algorithm": algorithm,
        "env": env,
        "seed": seed,
        "steps": steps,
        "validations": validations,
        "validation_episodes": validation_episodes,
        "threads": threads,
        "agent": _with_rows(load_settings(algorithm, Path(known).stem, config), rows),
        "scenario": scenario_of(env),
        "command": command,
        "versions": library_versions(),
    }
    return build(Run, data, "train")


def _with_rows(agent: AgentSettings, rows: int | None) -> AgentSettings:
    return agent if rows is None else build(type(agent), asdict(agent) | {"rows": rows}, "--rows")
