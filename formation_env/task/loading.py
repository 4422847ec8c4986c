"""Scenarios by registered id, by name, or from a YAML file."""

from importlib.resources import files
from pathlib import Path

from formation_env.registration import ENV_IDS as ENV_IDS
from formation_env.settings import ConfigError, build, load_yaml, nearest
from formation_env.task.scenario import Scenario
from formation_env.task.variants import draw_variants


def config_folder(name: str) -> Path:
    """The folder `configs/NAME`: inside the installed package, or beside it in a checkout."""
    inside = Path(str(files("formation_env"))) / "configs" / name
    return inside if inside.is_dir() else inside.parents[2] / "configs" / name


def scenario_names() -> list[str]:
    """Names of the scenarios that come with the package."""
    return sorted(path.stem for path in config_folder("scenarios").glob("*.yaml"))


def load_scenario(scenario: str | Path | Scenario) -> Scenario:
    """A scenario by registered id, by name, by path of a YAML file, or as it is.

    Raises:
        ConfigError: one line per fault, naming file, key and value.
    """
    if isinstance(scenario, Scenario):
        return scenario
    scenario = ENV_IDS.get(str(scenario), scenario)
    path = Path(scenario)
    if path.suffix not in (".yaml", ".yml"):
        if path.is_file():
            raise ConfigError(f"{path}: a scenario file must end in .yaml or .yml")
        path = config_folder("scenarios") / f"{scenario}.yaml"
        if not path.is_file():
            raise ConfigError(f"no scenario named {str(scenario)!r}; {nearest(str(scenario), scenario_names())}")
    loaded = build(Scenario, load_yaml(path), str(path))
    try:
        draw_variants(loaded)
    except ValueError as error:
        raise ConfigError(f"{path}: {error}") from None
    return loaded
