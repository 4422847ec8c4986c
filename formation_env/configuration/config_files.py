"""Reading of YAML and JSON files: every fault is one clear line, and none takes long; and writing of YAML."""

import json
from pathlib import Path
from typing import Any, Final

from formation_env.files import read_regular_file

MAX_CONFIG_BYTES: Final = 1_000_000
"""Size of a settings file; the largest that the project ships has 4 kB."""


class ConfigError(ValueError):
    """A settings file or object is wrong; one line per fault names file (or class), key and value."""


def load_yaml(path: Path) -> Any:
    """Read one YAML 1.2 file; so `1e-3` is a number, and a repeated key is an error.

    Raises:
        ConfigError: the file is missing, unreadable, too large, nested too deep, or no YAML; one line.
    """
    from ruamel.yaml.error import YAMLError

    from formation_env.configuration import yaml_loader

    try:
        return yaml_loader.load(_read(path, "YAML"))
    except YAMLError as error:
        raise ConfigError(f"{path}: {yaml_loader.describe(error)}") from None


def dump_yaml(data: Any, *, inline: bool) -> str:
    """Plain data as YAML text, keys in their order.

    Args:
        data: nested dicts, lists and scalars.
        inline: whether mappings and lists of scalars stand on one line, in braces and brackets.
    """
    from io import StringIO

    from ruamel.yaml import YAML

    yaml, stream = YAML(typ="safe", pure=True), StringIO()
    yaml.default_flow_style = None if inline else False
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    yaml.width = 120
    yaml.dump(data, stream)
    return stream.getvalue()


def load_json(path: Path) -> Any:
    """Read one JSON file.

    Raises:
        ConfigError: the file is missing, unreadable, too large, nested too deep, or no JSON; one line.
    """
    try:
        return json.loads(_read(path, "JSON"))
    except RecursionError:
        raise ConfigError(f"{path}: no valid JSON: nested too deep") from None
    except ValueError as error:
        if isinstance(error, ConfigError):
            raise
        raise ConfigError(f"{path}: no valid JSON: {error}") from None


def _read(path: Path, language: str) -> str:
    """Text of a regular UTF-8 file of bounded size.

    Raises:
        ConfigError: there is none.
    """
    try:
        return read_regular_file(path, MAX_CONFIG_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: no valid {language}: {error}") from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from None
    except ValueError as error:  # a null character in the path
        raise ConfigError(f"{str(path)!r}: cannot be read: {error}") from None
