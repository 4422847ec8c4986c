"""Files written all or none."""

import contextlib
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path


def write_files(folder: Path, texts: Mapping[str, str]) -> None:
    """Write text files into a folder: each to a temporary first, and renamed only when all are complete.

    Whatever goes wrong before that, an interrupt too, leaves the old files as they were and no temporary behind.

    Args:
        folder: made if it does not exist.
        texts: file name -> content.

    Raises:
        OSError: the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    temporaries: dict[str, Path] = {}
    try:
        for name, text in texts.items():
            temporaries[name] = _new_temporary(folder, name)
            temporaries[name].write_text(text, encoding="utf-8", newline="\n")
        for name, temporary in temporaries.items():
            os.replace(temporary, folder / name)
    finally:
        for temporary in temporaries.values():
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)


def _new_temporary(folder: Path, name: str) -> Path:
    """An empty file beside the one it will become, with the permissions of any new file."""
    handle, path = tempfile.mkstemp(dir=folder, prefix=f".{name}.", suffix=".tmp")
    os.close(handle)
    mask = os.umask(0)
    os.umask(mask)
    os.chmod(path, 0o666 & ~mask)
    return Path(path)
