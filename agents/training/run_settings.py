"""From what the user asks for to a run's settings."""

from dataclasses import asdict
from pathlib import Path

from agents.hyperparameters import ALGORITHMS, AgentSettings, load_settings
from agents.training.run_folder import Run, versions
from formation_env.settings import ConfigError, build, nearest
from formation_env.task.loading import ENV_IDS, load_scenario


def plan_run(
    algorithm: str,
    env: str,
    steps: int | None = None,
    seed: int = 0,
    rows: int | None = None,
    config: Path | None = None,
    validations: int = 20,
    validation_episodes: int = 64,
    threads: int = 1,
    start: Path | None = None,
    command: str = "",
) -> Run:
    """A run with its hyperparameters and scenario read from their files.

    Args:
        algorithm: `ppo` or `sac`.
        env: a registered id, or a scenario's name or path.
        steps: environment steps; by default as in the file of hyperparameters.
        seed: of the training.
        rows: environments side by side; by default as in the file of hyperparameters.
        config: that file; by default configs/agents/ALGORITHM.yaml.
        validations: how many over the run.
        validation_episodes: episodes of each.
        threads: of torch.
        start: an actor to start from: its file, or the folder of a run that was pretrained in the same way.
        command: the command line, to be noted.

    Raises:
        ConfigError: anything in it is wrong; one line per fault, naming file, key and value.
    """
    if algorithm not in ALGORITHMS:
        raise ConfigError(f"no algorithm named {algorithm!r}; {nearest(algorithm, ALGORITHMS)}")
    if env.endswith("-v0") and env not in ENV_IDS:
        raise ConfigError(f"no environment named {env!r}; {nearest(env, ENV_IDS)}")
    agent = _with_rows(load_settings(algorithm, Path(env).stem, config), rows)
    data = {
        "algorithm": algorithm,
        "env": env,
        "seed": seed,
        "steps": agent.steps if steps is None else steps,
        "validations": validations,
        "validation_episodes": validation_episodes,
        "threads": threads,
        "agent": agent,
        "scenario": load_scenario(env),
        "start": "" if start is None else str(start),
        "command": command,
        "versions": versions(),
    }
    return build(Run, data, "train")


def _with_rows(agent: AgentSettings, rows: int | None) -> AgentSettings:
    return agent if rows is None else build(type(agent), asdict(agent) | {"rows": rows}, "--rows")


def default_folder(run: Run) -> Path:
    """Where a run is kept if nothing else is said: runs/ALGORITHM_ENV_seedN."""
    return Path("runs") / f"{run.algorithm}_{Path(run.env).stem}_seed{run.seed}"
