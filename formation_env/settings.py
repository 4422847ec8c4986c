"""Validated, frozen settings and their error messages.

Every settings class of the project is a frozen dataclass made with `settings`: its fields are the YAML keys, unknown
keys and wrong types are refused, and numbers are never read out of strings.
"""

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from dataclasses import fields as dataclass_fields
from pathlib import Path
from typing import Annotated, Any, TypeVar, dataclass_transform

import pydantic
from pydantic import AllowInfNan, ConfigDict, Field, GetCoreSchemaHandler, Strict
from pydantic.dataclasses import dataclass as pydantic_dataclass
from pydantic_core import ArgsKwargs, CoreSchema, ErrorDetails, PydanticCustomError, core_schema

T = TypeVar("T")

# Strict: a number is never read out of a string, nor a flag out of a number.
Real = Annotated[float, Strict(), AllowInfNan(False)]
Positive = Annotated[Real, Field(gt=0)]
NonNegative = Annotated[Real, Field(ge=0)]
Probability = Annotated[Real, Field(ge=0, le=1)]
Flag = Annotated[bool, Strict()]
Text = Annotated[str, Strict()]
Vector3 = tuple[Real, Real, Real]


class ConfigError(ValueError):
    """A settings file or object is wrong; the message is one line that names file, key and value."""


@dataclass_transform(frozen_default=True, kw_only_default=True)
def settings(cls: type[T]) -> type[T]:
    """Make a class a frozen, keyword-only dataclass that validates its fields on construction."""

    def refuse_unknown_keys(owner: type, data: Any) -> Any:
        given = data.kwargs if isinstance(data, ArgsKwargs) else data
        known = [field.name for field in dataclass_fields(owner)]
        for key in given if isinstance(given, Mapping) else ():
            if key not in known:
                hint = nearest(str(key), known)
                raise PydanticCustomError("unknown_key", "unknown key; {hint}", {"key": str(key), "hint": hint})
        return data

    cls.refuse_unknown_keys = pydantic.model_validator(mode="before")(classmethod(refuse_unknown_keys))  # type: ignore[attr-defined]
    config = ConfigDict(extra="forbid")
    return pydantic_dataclass(cls, frozen=True, kw_only=True, config=config)


@dataclass(frozen=True)
class OneOf:
    """Annotation of a field that holds one of a registry's classes, chosen by its `kind` key."""

    registry: Mapping[str, type]

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Build the tagged union that pydantic validates against."""
        choices = {kind: handler.generate_schema(cls) for kind, cls in self.registry.items()}
        return core_schema.tagged_union_schema(choices, discriminator="kind")


def build(cls: type[T], data: Any, where: str) -> T:
    """Validate plain data (as YAML gives it) into a settings object.

    Args:
        cls: a class made with `settings`.
        data: nested dicts, lists and scalars.
        where: what to name in errors, usually the file.

    Raises:
        ConfigError: one line per fault, each naming `where`, the key, the fault and the value.
    """
    try:
        return pydantic.TypeAdapter(cls).validate_python(data)
    except pydantic.ValidationError as error:
        raise ConfigError("\n".join(f"{where}: {_describe(fault, data)}" for fault in error.errors())) from None


def _describe(fault: ErrorDetails, data: Any) -> str:
    """One line for one fault: the dotted path of the key, what is wrong, what was given."""
    context = fault.get("ctx", {})
    path = _path((*fault["loc"], context["key"]) if "key" in context else fault["loc"], data)
    message = fault["msg"].removeprefix("Value error, ")
    given = fault["input"]
    if fault["type"] in ("unknown_key", "value_error", "missing"):
        return f"{path}: {message}"
    if isinstance(given, str):
        message += " (this is a string)"
    return f"{path}: {message}, got {str(given)[:80]!r}" if isinstance(given, str) else f"{path}: {message}, got {str(given)[:80]}"


def _path(loc: Iterable[str | int], data: Any) -> str:
    """Dotted path of a fault, without the tags that pydantic puts in for unions."""
    parts: list[str] = []
    *parents, last = [*loc] or ["(top level)"]
    for part in parents:
        try:
            data = data[part]
        except (KeyError, IndexError, TypeError):
            continue
        parts.append(str(part))
    tag = isinstance(data, Mapping) and data.get("kind") == last
    return ".".join(parts if tag else [*parts, str(last)])


def load_yaml(path: Path) -> Any:
    """Read one YAML 1.2 file; so `1e-3` is a number, and a repeated key is an error.

    Raises:
        ConfigError: the file is missing, unreadable, or no YAML.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        return YAML(typ="safe", pure=True).load(path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    except (YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: no valid YAML: {' '.join(str(error).split())}") from None


def nearest(name: str, known: Iterable[str]) -> str:
    """A hint for a misspelt name: its nearest neighbour, or all known names."""
    known = sorted(known)
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f"did you mean {close[0]!r}?" if close else f"known: {', '.join(known)}"
