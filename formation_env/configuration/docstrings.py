"""Descriptions of keys for JSON Schema, from the docstrings of settings classes."""

import inspect
import re

from pydantic.config import JsonDict


def describe_keys(schema: JsonDict, cls: type) -> None:
    """Add to a class's JSON Schema its docstring's first line, the meaning of each key, and that `kind` is required."""
    schema["description"] = inspect.cleandoc(cls.__doc__ or "").partition("\n")[0]
    properties = schema.get("properties")
    if isinstance(properties, dict) and "kind" in properties:
        schema["required"] = ["kind"]  # a mapping names its kind, although the class has it by default
    for name, meaning in attributes(cls).items():
        if isinstance(properties, dict) and isinstance(entry := properties.get(name), dict):
            entry["description"] = meaning


def attributes(cls: type) -> dict[str, str]:
    """Meaning of each attribute that a Google-style docstring lists."""
    listed = inspect.cleandoc(cls.__doc__ or "").partition("Attributes:\n")[2]
    parts = re.split(r"^    (\w+): ", listed, flags=re.MULTILINE)[1:]
    return {name: " ".join(text.split()) for name, text in zip(parts[::2], parts[1::2], strict=True)}
