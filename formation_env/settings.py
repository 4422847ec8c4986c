"""Validated, frozen settings and their error messages.

Every settings class of the project is a frozen dataclass made with `settings`: its fields are the YAML keys, unknown
keys and wrong types are refused, and numbers are never read out of strings.
"""

import difflib
from collections.abc import Callable, Iterable, Mapping, MutableMapping
from dataclasses import dataclass, is_dataclass
from dataclasses import fields as dataclass_fields
from functools import partial, wraps
from typing import Annotated, Any, Final, TypeVar, cast, dataclass_transform, overload

import pydantic
from pydantic import AllowInfNan, ConfigDict, Field, GetCoreSchemaHandler, GetJsonSchemaHandler, Strict
from pydantic.dataclasses import dataclass as pydantic_dataclass
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import ArgsKwargs, CoreSchema, ErrorDetails, PydanticCustomError, core_schema

from formation_env.configuration.config_files import ConfigError, load_json, load_yaml
from formation_env.configuration.docstrings import describe_keys
from formation_env.configuration.short_values import MAX_VALUE_LENGTH, shortened

__all__ = [
    "ConfigError",
    "Flag",
    "NonNegative",
    "OneOf",
    "Positive",
    "Probability",
    "Real",
    "Text",
    "build",
    "faults_of",
    "load_json",
    "load_yaml",
    "nearest",
    "register",
    "settings",
]

T = TypeVar("T")

# Strict: a number is never read out of a string, nor a flag out of a number.
Real = Annotated[float, Strict(), AllowInfNan(False)]
Positive = Annotated[Real, Field(gt=0)]
NonNegative = Annotated[Real, Field(ge=0)]
Probability = Annotated[Real, Field(ge=0, le=1)]
Flag = Annotated[bool, Strict()]
Text = Annotated[str, Strict()]

MAX_FAULT_LINES: Final = 20
"""Faults that an error names one by one; a reader mends the first ones first."""

# Pydantic's messages about Python objects, in a YAML author's words.
_PLAIN_WORDS: Final = {
    "missing": "required but missing",
    "dataclass_type": "must be a mapping",
    "tuple_type": "must be a list",
}


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
    """Make the dataclass, with the validation of keys, and errors in a line per fault."""

    def refuse_unknown_keys(owner: type, data: Any) -> Any:
        given = data.kwargs if isinstance(data, ArgsKwargs) else data
        known = [field.name for field in dataclass_fields(owner)]
        for key in given if isinstance(given, Mapping) else ():
            if key not in known:
                name = str(key)[:MAX_VALUE_LENGTH]
                if key in renamed:
                    raise PydanticCustomError("renamed_key", "now {new}", {"key": name, "new": renamed[key]})
                raise PydanticCustomError(
                    "unknown_key", "unknown key; {hint}", {"key": name, "hint": nearest(name, known)}
                )
        return data

    validator = pydantic.model_validator(mode="before")(classmethod(refuse_unknown_keys))  # type: ignore[arg-type]
    cls.refuse_unknown_keys = validator  # type: ignore[attr-defined]
    config = ConfigDict(extra="forbid", json_schema_extra=describe_keys)
    made = pydantic_dataclass(cls, frozen=True, kw_only=True, config=config)
    validate = made.__init__

    @wraps(validate)
    def init(self: Any, *args: Any, **kwargs: Any) -> None:
        try:
            validate(self, *args, **kwargs)
        except pydantic.ValidationError as error:
            raise _one_line_per_fault(error, type(self).__name__) from None

    made.__init__ = init  # type: ignore[method-assign]
    return cast(type[T], made)


@dataclass(frozen=True, eq=False)  # equal by identity, so that `OneOf | None` can hash it
class OneOf:
    """Annotation of a field that holds an instance of the annotated class.

    A mapping becomes an instance of the registry's class that its `kind` key names; the registry is read at each
    validation, so that classes may be registered later. A hashable instance passes as it is, registered or not.

    Attributes:
        registry: kind -> class.
        but: a kind that is not allowed here.
    """

    registry: Mapping[str, type]
    but: str = ""

    @property
    def _allowed(self) -> dict[str, type]:
        """The kinds that are allowed."""
        return {kind: cls for kind, cls in self.registry.items() if kind != self.but}

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Build the schema that pydantic validates against."""
        return core_schema.no_info_plain_validator_function(partial(self._validate, source))

    def __get_pydantic_json_schema__(self, _: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        """Describe the registry's classes of this moment."""
        choices = {kind: cls.__pydantic_core_schema__ for kind, cls in self._allowed.items()}  # type: ignore[attr-defined]
        return handler(core_schema.tagged_union_schema(choices, discriminator="kind"))

    def _validate(self, base: Any, data: Any) -> Any:
        """Make an instance of `base` out of a mapping with a known `kind`, or pass one."""
        if isinstance(data, base) and not (self.but and getattr(data, "kind", "") == self.but):
            if type(data).__hash__ is None:
                raise PydanticCustomError("unhashable", "must be hashable, such as an instance made with @settings")
            return data
        known = ", ".join(sorted(self._allowed))
        if not isinstance(data, Mapping):
            raise PydanticCustomError("mapping_type", "must be a mapping with a kind ({known})", {"known": known})
        if "kind" not in data:
            raise PydanticCustomError("missing_kind", "missing; known: {known}", {"key": "kind", "known": known})
        kind = data["kind"]
        if isinstance(kind, str) and kind in self._allowed:
            return pydantic.TypeAdapter(self.registry[kind]).validate_python(data)
        context = {"key": "kind", "kind": shortened(kind), "hint": nearest(str(kind)[:80], self._allowed)}
        raise PydanticCustomError("unknown_kind", "unknown kind {kind}; {hint}", context)


def register(registry: MutableMapping[str, Any], cls: type, base: type) -> None:
    """Add a settings class to a registry under its `kind`, so that files and mappings may name it.

    Args:
        registry: kind -> class.
        cls: a class made with `settings`, whose field `kind` has its name as the default.
        base: what it must inherit from.

    Raises:
        ValueError: it is no such class, or its kind is taken by another; one line.
    """
    if not (isinstance(cls, type) and issubclass(cls, base)):
        raise ValueError(f"{getattr(cls, '__name__', cls)}: must inherit from {base.__name__}")
    kinds = [field.default for field in dataclass_fields(cls) if field.name == "kind"] if is_dataclass(cls) else []
    if len(kinds) != 1 or not isinstance(kinds[0], str) or not hasattr(cls, "__pydantic_validator__"):
        raise ValueError(f'{cls.__name__}: must be made with @settings and have a field kind: Literal["x"] = "x"')
    taken = registry.setdefault(kinds[0], cls)
    if taken is not cls:
        raise ValueError(f"{cls.__name__}: kind {kinds[0]!r} is taken by {taken.__module__}.{taken.__qualname__}")


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
        raise _one_line_per_fault(error, where) from None


def _one_line_per_fault(error: pydantic.ValidationError, where: str) -> ConfigError:
    """The error of a file or class, a line per fault, at most MAX_FAULT_LINES of them."""
    faults = error.errors(include_url=False)
    lines = [_describe(fault) for fault in faults[:MAX_FAULT_LINES]]
    if len(faults) > MAX_FAULT_LINES:
        lines.append(f"and {len(faults) - MAX_FAULT_LINES} more faults")
    return ConfigError("\n".join(f"{where}: {line}" for line in lines))


def faults_of(error: ConfigError) -> str:
    """Faults of an error that `build` or a constructor raised, in one line without the file or class."""
    return "; ".join(line.partition(": ")[2] for line in str(error).splitlines())


def _describe(fault: ErrorDetails) -> str:
    """One line for one fault: the dotted path of the key, what is wrong, what was given."""
    context = fault.get("ctx", {})
    keys = (*fault["loc"], context["key"]) if "key" in context else fault["loc"]
    path = ".".join(str(key)[:MAX_VALUE_LENGTH] for key in keys) or "(top level)"
    message = _PLAIN_WORDS.get(fault["type"], fault["msg"])
    message = message.removeprefix("Value error, ").replace("Input should", "must", 1)
    if fault["type"] == "value_error" and not fault["loc"]:
        return message  # a check of the whole object; it names its keys
    if fault["type"] in ("unknown_key", "renamed_key", "missing_kind", "unknown_kind", "value_error", "missing"):
        return f"{path}: {message}"
    given = fault["input"]
    return f"{path}: {message}, got {'the string ' if isinstance(given, str) else ''}{shortened(given)}"


def nearest(name: str, known: Iterable[str]) -> str:
    """A hint for a misspelt name: its nearest neighbour, or all known names."""
    known = sorted(known)
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f"did you mean {close[0]!r}?" if close else f"known: {', '.join(known)}"
