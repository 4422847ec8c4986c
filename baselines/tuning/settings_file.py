"""Settings files with comments, section by section."""

import re
from pathlib import Path
from typing import Any

from formation_env.configuration.config_files import dump_yaml
from formation_env.files import write_texts


def write_section(path: Path, policy: str, settings: dict[str, Any], comment: str) -> None:
    """Replace or add a policy's section in a settings file; other sections stay.

    Args:
        path: of the file; made, with its folder, if it does not exist.
        policy: name of the section.
        settings: content of the section.
        comment: lines above it.

    Raises:
        OSError: the file cannot be written.
    """
    heading = f"# Settings of the classical policies for {path.stem.removesuffix('.baselines')}.\n"
    text = path.read_text(encoding="utf-8") if path.is_file() else heading
    write_texts(path.parent, {path.name: replace_section(text, policy, commented({policy: settings}, comment))})


def commented(data: dict[str, Any], comment: str) -> str:
    """YAML with a comment above it."""
    return "".join(f"# {line}\n" for line in comment.splitlines()) + dump_yaml(data, inline=True)


def replace_section(text: str, policy: str, new: str) -> str:
    """Text of a settings file with a policy's section and the comment above it replaced, or added at the end."""
    old = re.compile(rf"^(?:#.*\n)*{policy}:.*\n(?:[ \t].*\n|\n(?=[ \t]))*", re.MULTILINE)
    if old.search(text):
        return old.sub(lambda _: new, text, count=1)
    return f"{text.rstrip()}\n\n{new}"
