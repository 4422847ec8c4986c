"""Scenarios by registered id, by name, or from a YAML file; their kinds of parts, and their JSON Schema."""

import warnings
from collections.abc import Mapping
from dataclasses import MISSING, fields
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

from pydantic import TypeAdapter

from formation_env.configuration.docstrings import attributes
from formation_env.dropout import DROPOUTS
from formation_env.dynamics import DYNAMICS, NONLINEAR
from formation_env.formations import FORMATIONS
from formation_env.registration import ENV_IDS as ENV_IDS
from formation_env.registration import SWARM_IDS as SWARM_IDS
from formation_env.settings import ConfigError, build, load_yaml, nearest
from formation_env.task.domain import DomainWarning, beyond_the_model
from formation_env.task.scenario import Scenario
from formation_env.task.variants import draw_variants

SUFFIXES: Final = (".yaml", ".yml")
"""A path to a scenario ends in one of these; anything else is a name."""


def config_folder(name: str) -> Path:
    """The folder `configs/NAME`: inside the installed package, or beside it in a checkout."""
    inside = Path(str(files("formation_env"))) / "configs" / name
    return inside if inside.is_dir() else inside.parents[2] / "configs" / name


def scenario_names() -> list[str]:
    """Names of the scenarios of one follower that come with the package."""
    return _names("scenarios")


def swarm_names() -> list[str]:
    """Names of the scenarios of several followers that come with the package."""
    return _names("swarms")


def _names(folder: str) -> list[str]:
    return sorted(path.stem for path in config_folder(folder).glob("*.yaml"))


def load_scenario(scenario: str | Path | Scenario) -> Scenario:
    """Load a scenario by registered id, by name, or by path of a YAML file; an instance passes as it is.

    A `DomainWarning` is issued if the scenario asks for what its models cannot describe.

    Raises:
        ConfigError: one line per fault, naming file, key and value.
    """
    loaded = scenario if isinstance(scenario, Scenario) else _read(str(scenario))
    if sentences := beyond_the_model(loaded):
        warnings.warn(f"scenario {loaded.title or scenario!s:.80}: {' '.join(sentences)}", DomainWarning, stacklevel=2)
    return loaded


def _read(name: str) -> Scenario:
    """Read a shipped scenario or a YAML file, and check its variants.

    Raises:
        ConfigError: one line per fault, naming file, key and value.
    """
    path = Path((ENV_IDS | SWARM_IDS).get(name, name))
    if path.suffix not in SUFFIXES:
        swarms = swarm_names()
        known = [*scenario_names(), *swarms]
        if str(path) not in known:
            if len(path.parts) > 1 or path.suffix:
                raise ConfigError(
                    f"{name[:80]}: no scenario has this name, and a scenario file must end in .yaml or .yml"
                )
            raise ConfigError(f"no scenario named {name[:80]!r}; {nearest(name[:80], known)}")
        path = config_folder("swarms" if str(path) in swarms else "scenarios") / f"{path}.yaml"
    loaded = build(Scenario, load_yaml(path), str(path))
    try:
        draw_variants(loaded)
    except ValueError as error:
        raise ConfigError(f"{path}: {error}") from None
    return loaded


def scenario_schema() -> dict[str, Any]:
    """JSON Schema of a scenario file, for editors; formations and dropouts are those registered at this moment."""
    schema = TypeAdapter(Scenario).json_schema()
    schema["properties"]["dynamics"]["enum"] = [*DYNAMICS, NONLINEAR]
    return schema


def kinds() -> dict[str, dict[str, dict[str, str]]]:
    """Kinds of formations, dropouts and dynamics models: group -> kind -> key -> type, default, meaning.

    The keys of a kind do not contain `kind` itself; dynamics models have no keys.
    """
    models: dict[str, dict[str, str]] = {name: {} for name in (*DYNAMICS, NONLINEAR)}
    return {"formation": _keys(FORMATIONS), "dropout": _keys(DROPOUTS), "dynamics": models}


def _keys(registry: Mapping[str, type]) -> dict[str, dict[str, str]]:
    """Keys of each settings class of a registry, with type, default and meaning."""
    return {kind: _keys_of(cls) for kind, cls in registry.items()}


def _keys_of(cls: type) -> dict[str, str]:
    """Keys of a settings class but its `kind`, each as `type = default: meaning`."""
    types = TypeAdapter(cls).json_schema().get("properties", {})
    meanings = attributes(cls)
    described = {}
    for field in fields(cls):
        if field.name != "kind":
            default = "required" if field.default is MISSING else f"default {_plain(field.default)}"
            kind = types.get(field.name, {}).get("type", "object")
            described[field.name] = f"{kind}, {default}: {meanings.get(field.name, '')}".removesuffix(": ")
    return described


def _plain(value: Any) -> str:
    """A default as YAML's flow style would show it."""
    plain = TypeAdapter(type(value)).dump_python(value, mode="json")
    return str(plain)
