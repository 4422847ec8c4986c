"""The command line as it is installed, whatever is installed on this machine."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[2]


def write_metadata(folder: Path) -> Path:
    """Write the distribution's metadata, as an installer makes it from pyproject.toml; for the front of sys.path."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    info = folder / "formation_env-0.1.0.dist-info"
    info.mkdir(parents=True)
    groups = {"console_scripts": project["scripts"], **project["entry-points"]}
    sections = [
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in points.items())
        for group, points in groups.items()
    ]
    (info / "entry_points.txt").write_text("\n".join(sections), encoding="utf-8")
    requires = [f"Requires-Dist: {each}" for each in project["dependencies"]]
    for extra, members in project["optional-dependencies"].items():
        requires += [f'Requires-Dist: {each} ; extra == "{extra}"' for each in members]
    lines = ["Metadata-Version: 2.3", "Name: formation-env", "Version: 0.1.0", *requires]
    (info / "METADATA").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


def run_program(metadata: Path, *arguments: str, module: str = "formation_env") -> subprocess.CompletedProcess[str]:
    """Run `formation-env ARGUMENTS`, or `python -m MODULE ARGUMENTS`, in another process."""
    start = [sys.executable, "-c", "from formation_env.__main__ import main; main()"]
    if module != "formation_env":
        start = [sys.executable, "-m", module]
    return subprocess.run(
        [*start, *arguments], env=environment(metadata), capture_output=True, text=True, check=False, timeout=120
    )


def environment(metadata: Path) -> dict[str, str]:
    """Environment variables of such a process."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(metadata), str(ROOT)])}
