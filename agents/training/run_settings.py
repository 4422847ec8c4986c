"""From the user's choices to a run's settings."""

from dataclasses import asdict
from pathlib import Path

from agents.algorithms.registry import load_settings
from agents.hyperparameters import VALIDATION_EPISODES, VALIDATIONS, CommonSettings
from agents.training.run_folder import Run
from agents.training.versions import versions
from formation_env.settings import ConfigError, build, nearest
from formation_env.task.loading import ENV_IDS, load_scenario


# Above 40 lines: each argument has a line in the signature, in the docstring and in the settings.
def plan_run(
    algorithm: str,
    env: str,
    *,
    steps: int | None = None,
    seed: int = 0,
    rows: int | None = None,
    config: Path | None = None,
    validations: int = VALIDATIONS,
    validation_episodes: int = VALIDATION_EPISODES,
    threads: int = 1,
    start: Path | None = None,
    command: str = "",
) -> Run:
    """Settings of a run, with hyperparameters and scenario read from their files.

    Args:
        algorithm: a name in `agents.algorithms.registry.ALGORITHMS`.
        env: a registered id, or a scenario's name or path.
        steps: environment steps; by default as in the file of hyperparameters.
        seed: seed of the training.
        rows: environments side by side; by default as in the file of hyperparameters.
        config: that file; by default configs/agents/ALGORITHM.yaml.
        validations: number of validations over the run.
        validation_episodes: episodes of each.
        threads: threads of torch.
        start: actor to start from: its file, or the folder of a run that was pretrained with the same settings.
        command: command line, recorded with the run.

    Raises:
        ConfigError: any of it is wrong; one line per fault, naming file, key and value.
    """
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


def _with_rows(agent: CommonSettings, rows: int | None) -> CommonSettings:
    return agent if rows is None else build(type(agent), asdict(agent) | {"rows": rows}, "--rows")


def default_folder(run: Run) -> Path:
    """Folder of a run unless the user names one: runs/ALGORITHM_ENV_seedN."""
    return Path("runs") / f"{run.algorithm}_{Path(run.env).stem}_seed{run.seed}"
