"""Damage to files: inverted bytes and cuts, each of which must be noticed in one line or change nothing."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from formation_env import ConfigError


def refusals(
    path: Path, content: bytes, read: Callable[[], Any], inverted: int, stride: int = 1, cuts: int = 30
) -> list[str]:
    """Error lines of reading a file with one byte inverted, and with its end cut off.

    Args:
        path: file that is overwritten; it has its content again afterwards.
        content: of the whole file.
        read: reads the file; may succeed, or raise ConfigError in one line that begins with the path.
        inverted: bytes from the start that are inverted, one at a time.
        stride: every how many-th of them.
        cuts: number of lengths to which the file is cut, from 0 on.
    """
    damaged = [content[:i] + bytes([content[i] ^ 0xFF]) + content[i + 1 :] for i in range(0, inverted, stride)]
    damaged += [content[: i * len(content) // cuts] for i in range(cuts)]
    lines = []
    for each in damaged:
        path.write_bytes(each)
        try:
            read()
        except ConfigError as error:
            lines.append(str(error))
    path.write_bytes(content)
    assert [line for line in lines if not line.startswith(f"{path}") or "\n" in line] == []
    return lines
