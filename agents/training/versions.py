"""Versions of the libraries and the sources behind a training run."""

import platform
import subprocess
from importlib import metadata
from pathlib import Path
from typing import Final

LIBRARIES: Final = ("formation-env", "gymnasium", "numpy", "stable-baselines3", "torch")


def versions() -> dict[str, str]:
    """Versions of the interpreter and of the libraries behind a model, and the git revision of a checkout."""
    libraries = {name: metadata.version(name) for name in LIBRARIES}
    return {"python": platform.python_version()} | libraries | {"git": _revision(Path(__file__).parents[1])}


def _revision(package: Path) -> str:
    """Git revision of the repository whose top folder contains the package, `-dirty` if changed; empty without one.

    A package installed below some other repository, as in a virtual environment, has no revision of its own.
    """
    if _git(package, "rev-parse", "--show-toplevel") != str(package.parent.resolve()):
        return ""
    return _git(package, "describe", "--always", "--dirty", "--exclude=*", "--abbrev=40")


def _git(folder: Path, *arguments: str) -> str:
    """Output of a git command; empty if it fails or git is not installed."""
    try:
        command = ["git", "-C", str(folder), *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""
