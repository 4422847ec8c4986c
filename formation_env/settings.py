"""Validated, frozen settings and their error messages.

Every settings class of the project is a frozen dataclass made with `settings`: its fields are the YAML keys, unknown
keys and wrong types are refused, and numbers are never read out of strings.
"""

import difflib
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from dataclasses import fields as dataclass_fields
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final, TypeVar, cast, dataclass_transform, overload

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

# What pydantic says of Python objects, in a YAML author's words.
_PLAIN_WORDS: Final = {
    "missing": "required but missing",
    "dataclass_type": "must be a mapping",
    "tuple_type": "must be a list",
}


class ConfigError(ValueError):
    """A settings file or object is wrong; the message is one line that names file, key and value."""


@overload
def settings(cls: type[T]) -> type[T]: ...


@overload
def settings(*, renamed: Mapping[str, str]) -> Callable[[type[T]], type[T]]: ...


@dataclass_transform(frozen_default=True, kw_only_default=True)
def settings(cls: type[T] | None = None, *, renamed: Mapping[str, str] | None = None) -> Any:
    """Make a class a frozen, keyword-only dataclass that validates its fields on construction.

    Args:
        cls: the class.
        renamed: keys of an earlier version -> their new names, which the error for an old key gives.
    """
    if cls is None:
        return partial(_make_settings, renamed=renamed or {})
    return _make_settings(cls, renamed or {})


def _make_settings(cls: type[T], renamed: Mapping[str, str]) -> type[T]:
    """Add the validation of keys, and make the dataclass."""

    def refuse_unknown_keys(owner: type, data: Any) -> Any:
        given = data.kwargs if isinstance(data, ArgsKwargs) else data
        known = [field.name for field in dataclass_fields(owner)]
        for key in given if isinstance(given, Mapping) else ():
            if key not in known:
                if key in renamed:
                    raise PydanticCustomError("renamed_key", "now {new}", {"key": str(key), "new": renamed[key]})
                hint = nearest(str(key), known)
                raise PydanticCustomError("unknown_key", "unknown key; {hint}", {"key": str(key), "hint": hint})
        return data

    validator = pydantic.model_validator(mode="before")(classmethod(refuse_unknown_keys))  # type: ignore[arg-type]
    cls.refuse_unknown_keys = validator  # type: ignore[attr-defined]
    return cast(type[T], pydantic_dataclass(cls, frozen=True, kw_only=True, config=ConfigDict(extra="forbid")))


@dataclass(frozen=True)
class OneOf:
    """Annotation of a field that holds one of a registry's classes, chosen by its `kind` key."""

    registry: Mapping[str, type]

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Build the tagged union that pydantic validates against."""
        choices = {kind: handler.generate_schema(cls) for kind, cls in self.registry.items()}
        union = core_schema.tagged_union_schema(choices, discriminator="kind")
        return core_schema.no_info_before_validator_function(self._refuse_unknown_kind, union)

    def _refuse_unknown_kind(self, data: Any) -> Any:
        """Check the `kind` key before pydantic does, to say which kinds there are."""
        known = ", ".join(sorted(self.registry))
        kind = data.get("kind") if isinstance(data, Mapping) else getattr(data, "kind", None)
        if kind in list(self.registry):
            return data
        if not isinstance(data, Mapping):
            raise PydanticCustomError("mapping_type", "must be a mapping with a kind ({known})", {"known": known})
        if kind is None:
            raise PydanticCustomError("missing_kind", "missing; known: {known}", {"key": "kind", "known": known})
        hint = nearest(str(kind), self.registry)
        context = {"key": "kind", "kind": repr(kind), "hint": hint}
        raise PydanticCustomError("unknown_kind", "unknown kind {kind}; {hint}", context)


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
        raise ConfigError("\n".join(f"{where}: {fault}" for fault in faults(error, data))) from None


def faults(error: pydantic.ValidationError, data: Any = None) -> list[str]:
    """One line for each fault that pydantic found in plain data, or in what was built in Python (then without data)."""
    return [_describe(fault, data) for fault in error.errors()]


def _describe(fault: ErrorDetails, data: Any) -> str:
    """One line for one fault: the dotted path of the key, what is wrong, what was given."""
    context = fault.get("ctx", {})
    path = _path((*fault["loc"], context["key"]) if "key" in context else fault["loc"], data)
    message = _PLAIN_WORDS.get(fault["type"], fault["msg"])
    message = message.removeprefix("Value error, ").replace("Input should", "must", 1)
    if fault["type"] == "value_error" and not fault["loc"]:
        return message  # a check of the whole object; it names its keys
    if fault["type"] in ("unknown_key", "renamed_key", "missing_kind", "unknown_kind", "value_error", "missing"):
        return f"{path}: {message}"
    given = fault["input"]
    if isinstance(given, str):
        return f"{path}: {message}, got the string {given[:80]!r}"
    return f"{path}: {message}, got {str(given)[:80]}"


def _path(loc: Iterable[str | int], data: Any) -> str:
    """Dotted path of a fault, without the tags that pydantic puts in for unions."""
    parts: list[str] = []
    tagged: Any = None
    loc = [*loc] or ["(top level)"]
    for depth, part in enumerate(loc, start=1):
        if isinstance(data, Mapping) and data.get("kind") == part and data is not tagged:
            tagged = data
            continue
        try:
            data = data[part]
        except (KeyError, IndexError, TypeError):
            if depth < len(loc):
                continue
        parts.append(str(part))
    return ".".join(parts)


def load_yaml(path: Path) -> Any:
    """Read one YAML 1.2 file; so `1e-3` is a number, and a repeated key is an error.

    Raises:
        ConfigError: the file is missing, unreadable, or no YAML.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError, YAMLError

    try:
        return YAML(typ="safe", pure=True).load(path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    except MarkedYAMLError as error:
        line = f"line {error.problem_mark.line + 1}: " if error.problem_mark else ""
        raise ConfigError(f"{path}: {line}no valid YAML: {error.problem}") from None
    except (YAMLError, ValueError) as error:  # ValueError: not UTF-8, or a date that does not exist
        raise ConfigError(f"{path}: no valid YAML: {' '.join(str(error).split())}") from None


def load_json(path: Path) -> Any:
    """Read one JSON file.

    Raises:
        ConfigError: the file is missing, unreadable, or no JSON.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise ConfigError(f"{path}: no valid JSON: {error}") from None


def nearest(name: str, known: Iterable[str]) -> str:
    """A hint for a misspelt name: its nearest neighbour, or all known names."""
    known = sorted(known)
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f"did you mean {close[0]!r}?" if close else f"known: {', '.join(known)}"
