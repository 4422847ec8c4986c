"""A YAML 1.2 loader for text from anywhere: bounded in size and depth, without tags that run code.

Nesting and aliases are checked on the parser's events, before anything is composed: composing recurses, and aliases
of aliases expand exponentially.
"""

import re
from typing import Any, Final

from ruamel.yaml import YAML
from ruamel.yaml.constructor import ConstructorError, SafeConstructor
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import AliasEvent, CollectionEndEvent, CollectionStartEvent, NodeEvent
from ruamel.yaml.nodes import ScalarNode
from ruamel.yaml.resolver import VersionedResolver
from ruamel.yaml.tag import Tag

MAX_DEPTH: Final = 50
"""Nesting levels of a file; the deepest setting, one window of a dropout, is at level 4."""
MAX_VALUES: Final = 50_000
"""Keys and values of a file, those that aliases repeat included; the parser reads as many in about three seconds."""
MAX_PROBLEM_LENGTH: Final = 200
"""Characters of an error; the parser quotes what it found, however long."""

_FLOAT_TAG: Final = "tag:yaml.org,2002:float"
_BARE_FRACTION: Final = re.compile(r"[-+]?\.[0-9]+[eE][0-9]+")
"""Numbers of YAML 1.2's core schema, such as .5e3, that ruamel.yaml takes for strings."""


class LoadError(YAMLError):
    """A file exceeds a limit, or an alias is inside what it names; the message is one line."""


def load(text: str) -> Any:
    """Read one YAML 1.2 document.

    Raises:
        MarkedYAMLError: no YAML, with the line.
        YAMLError: no YAML, or beyond the limits.
    """
    _check_events(text)
    yaml = YAML(typ="safe", pure=True)
    yaml.Resolver, yaml.Constructor = _Resolver, _Constructor
    return yaml.load(text)


def describe(error: YAMLError) -> str:
    """One line on what is wrong, with the line's number where it is known."""
    if isinstance(error, LoadError):
        return str(error)
    line, problem = "", str(error)
    if isinstance(error, MarkedYAMLError):
        line, problem = f"line {error.problem_mark.line + 1}: " if error.problem_mark else "", str(error.problem)
    return f"{line}no valid YAML: {' '.join(problem.split())[:MAX_PROBLEM_LENGTH]}"


def _check_events(text: str) -> None:
    """Refuse nesting, sizes and aliases that could not be loaded in reasonable time and memory."""
    open_since: list[tuple[str | None, int]] = []  # anchor and first value of each open collection
    sizes: dict[str, int] = {}  # values below each anchor, aliases expanded
    values = 0
    for event in YAML(typ="safe", pure=True).parse(text):
        line = event.start_mark.line + 1
        if isinstance(event, CollectionEndEvent):
            anchor, first = open_since.pop()
            if anchor is not None:
                sizes[anchor] = values - first
            continue
        if not isinstance(event, NodeEvent):
            continue
        if isinstance(event, AliasEvent):
            if any(anchor == event.anchor for anchor, _ in open_since):
                raise LoadError(f"line {line}: alias {event.anchor!r} is inside the value that it names")
            values += sizes.get(event.anchor, 1)
        elif isinstance(event, CollectionStartEvent):
            open_since.append((event.anchor, values))
            values += 1
        else:
            values += 1
        if len(open_since) > MAX_DEPTH:
            raise LoadError(f"line {line}: nested more than {MAX_DEPTH} levels deep")
        if values > MAX_VALUES:
            raise LoadError(f"line {line}: more than {MAX_VALUES} values, those that aliases repeat included")


class _Resolver(VersionedResolver):
    """YAML 1.2's numbers, all of them."""

    def resolve(self, kind: Any, value: Any, implicit: Any) -> Any:
        """Tag of an untagged node."""
        if kind is ScalarNode and implicit[0] and _BARE_FRACTION.fullmatch(value):
            return Tag(suffix=_FLOAT_TAG)
        return super().resolve(kind, value, implicit)


class _Constructor(SafeConstructor):
    """Plain data only; a value that does not fit its tag is an error with its line."""

    def construct_object(self, node: Any, deep: bool = False) -> Any:
        """Python object of a node."""
        try:
            return super().construct_object(node, deep)
        except YAMLError:
            raise
        except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError) as error:
            # ruamel.yaml takes a tag's value apart without checking it
            value = repr(node.value)[:80] if isinstance(node, ScalarNode) else f"a {node.id}"
            reason = f": {error}" if isinstance(error, ValueError) else ""
            problem = f"{value} is no {str(node.tag).rpartition(':')[2]}{reason}"
            raise ConstructorError(None, None, problem, node.start_mark) from None
