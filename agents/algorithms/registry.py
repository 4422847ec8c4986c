"""The learning algorithms by name, and the YAML files of their hyperparameters.

To add an algorithm: a file with a subclass of `CommonSettings`, and a line in `ALGORITHMS`.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from agents.algorithms.ppo import PPOSettings
from agents.algorithms.sac import SACSettings
from agents.hyperparameters import CommonSettings
from formation_env.settings import ConfigError, build, load_yaml, nearest
from formation_env.task.loading import ENV_IDS, config_folder, scenario_names

ALGORITHMS: Final[dict[str, type[CommonSettings]]] = {
    "ppo": PPOSettings,
    "sac": SACSettings,
}
"""Name -> class of its hyperparameters, which builds the learner."""
OVERRIDES: Final = "environments"
"""Key of a file under which environments have hyperparameters of their own."""


def algorithm_settings(algorithm: str) -> type[CommonSettings]:
    """Class of an algorithm's hyperparameters.

    Raises:
        ConfigError: there is no such algorithm.
    """
    if algorithm not in ALGORITHMS:
        raise ConfigError(f"no algorithm named {algorithm!r}; {nearest(algorithm, ALGORITHMS)}")
    return ALGORITHMS[algorithm]


def load_settings(algorithm: str, env: str, path: Path | None = None) -> CommonSettings:
    """Hyperparameters of an algorithm for an environment.

    Args:
        algorithm: a name in `ALGORITHMS`.
        env: a registered id or a scenario's name; its overrides under `environments` are applied.
        path: a YAML file; by default configs/agents/ALGORITHM.yaml.

    Raises:
        ConfigError: the file is missing, or any of its keys is wrong; one line per fault, naming file, key and value.
    """
    cls = algorithm_settings(algorithm)
    path = path or config_folder("agents") / f"{algorithm}.yaml"
    data = load_yaml(path)
    if not isinstance(data, Mapping):
        raise ConfigError(f"{path}: (top level): must be a mapping, got {str(data)[:80]}")
    common = {key: value for key, value in data.items() if key != OVERRIDES}
    chosen = build(cls, common, str(path))
    for name, own in _overrides(data, path).items():
        overridden = build(cls, {**common, **own}, f"{path}: {OVERRIDES}.{name}")
        chosen = overridden if ENV_IDS.get(name, name) == ENV_IDS.get(env, env) else chosen
    return chosen


def _overrides(data: Mapping[str, Any], path: Path) -> dict[str, Mapping[str, Any]]:
    """Keys of each environment; every one is checked to be a mapping for a known id or scenario."""
    overrides = data.get(OVERRIDES, {})
    if not isinstance(overrides, Mapping):
        raise ConfigError(f"{path}: {OVERRIDES}: must be a mapping of environments, got {str(overrides)[:80]}")
    known = [*ENV_IDS, *scenario_names()]
    for name, own in overrides.items():
        if name not in known:
            raise ConfigError(f"{path}: {OVERRIDES}.{name}: no such environment; {nearest(str(name), known)}")
        if not isinstance(own, Mapping):
            raise ConfigError(f"{path}: {OVERRIDES}.{name}: must be a mapping, got {str(own)[:80]}")
    return dict(overrides)
