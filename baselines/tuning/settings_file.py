"""Settings files with comments, section by section."""

import re
from io import StringIO
from pathlib import Path
from typing import Any

from formation_env.files import write_texts


def write_section(path: Path, policy: str, settings: dict[str, Any], comment: str) -> None:
    """Put a policy's settings into a settings file; what else is in it stays.

    Args:
        path: of the file; made, with its folder, if it does not exist.
        policy: its name.
        settings: the section.
        comment: lines above it.

    Raises:
        OSError: the file cannot be written.
    """
    text = (
        path.read_text(encoding="utf-8") if path.is_file() else f"# Gains of the classical policies for {path.stem}.\n"
    )
    write_texts(path.parent, {path.name: replace_section(text, policy, section(policy, settings, comment))})


def section(policy: str, settings: dict[str, Any], comment: str) -> str:
    """A policy's section of a settings file, as text with a comment above it."""
    return commented({policy: settings}, comment)


def commented(data: dict[str, Any], comment: str) -> str:
    """YAML with a comment above it."""
    from ruamel.yaml import YAML

    yaml, stream = YAML(typ="safe", pure=True), StringIO()
    yaml.default_flow_style, yaml.width = None, 120
    yaml.width, yaml.sort_base_mapping_type_on_output = 120, False  # type: ignore[assignment]
    yaml.dump(data, stream)
    return "".join(f"# {line}\n" for line in comment.splitlines()) + stream.getvalue()


def replace_section(text: str, policy: str, new: str) -> str:
    """A settings file's text with a policy's section, and the comment right above it, replaced, or added at its end."""
    old = re.compile(rf"^(?:#.*\n)*{policy}:.*\n(?:[ \t].*\n|\n(?=[ \t]))*", re.MULTILINE)
    if old.search(text):
        return old.sub(lambda _: new, text, count=1)
    return f"{text.rstrip()}\n\n{new}"
