"""Protection of an Optuna journal against damage: the hash of what has been written, in a file beside it.

Optuna reads a journal line by line and accepts altered numbers. A kill between a trial and its seal leaves lines behind
the sealed part; these are accepted, so that an interrupted search continues.
"""

import hashlib
import json
from pathlib import Path

from formation_env.files import write_texts
from formation_env.settings import ConfigError, load_json


def seal_path(journal: Path) -> Path:
    """File of a journal's seal."""
    return journal.with_name(f"{journal.name}.seal.json")


def seal(journal: Path) -> None:
    """Record length and SHA-256 of a journal's present content.

    Raises:
        OSError: the folder cannot be written.
    """
    content = journal.read_bytes()
    record = {"bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}
    write_texts(journal.parent, {seal_path(journal).name: json.dumps(record) + "\n"})


def check_seal(journal: Path) -> None:
    """Refuse a journal whose sealed part has changed; one without a seal is new or was never finished.

    Raises:
        ConfigError: the journal or its seal is damaged.
    """
    path = seal_path(journal)
    if not path.exists():
        return
    record = load_json(path)
    try:
        size, digest = int(record["bytes"]), str(record["sha256"])
        sealed = journal.read_bytes()[:size] if journal.exists() else b""
    except (KeyError, TypeError, ValueError):
        raise ConfigError(f"{path}: damaged: must hold bytes and sha256") from None
    except OSError as error:
        raise ConfigError(f"{journal}: cannot be read: {error.strerror}") from None
    if len(sealed) != size or hashlib.sha256(sealed).hexdigest() != digest:
        raise ConfigError(f"{journal}: damaged: does not have the SHA-256 in {path.name}; remove both to start anew")
