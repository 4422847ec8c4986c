"""Optuna journals that notice damage: each study states what it searches, and each trial carries a checksum.

Optuna reads a journal whose numbers have changed without complaint. Here the name of a study is the hash of its
identity, and a trial's checksum covers the study, its number, its parameters and its costs.
"""

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from formation_env.settings import ConfigError

if TYPE_CHECKING:
    from optuna import Study
    from optuna.trial import FrozenTrial

Identity = Mapping[str, str | int]
FIRST_KEY: Final = b'{"op_code":'
"""First bytes of an Optuna journal."""
IDENTITY: Final = "identity"
CHECKSUM: Final = "checksum"


def digest(data: object) -> str:
    """First 16 hexadecimal digits of the SHA-256 of plain data."""
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:16]


def open_study(identity: Identity, journal: Path) -> "Study":
    """Open the study of an identity in a journal; a new one if there is none.

    Args:
        identity: all that the cost of a trial depends on: names, seeds, hashes of longer things.
        journal: the file; made, with its folder, if it does not exist.

    Raises:
        ConfigError: the file is no journal, or damaged.
        OSError: it cannot be written.
        ModuleNotFoundError: Optuna is not installed.
    """
    import optuna
    from optuna.storages import JournalStorage
    from optuna.storages.journal import JournalFileBackend

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    journal.parent.mkdir(parents=True, exist_ok=True)
    try:
        _cut_torn_line(journal)
        storage = JournalStorage(JournalFileBackend(str(journal)))
        for known in optuna.get_all_study_summaries(storage):
            _check_identity(optuna.load_study(study_name=known.study_name, storage=storage))
        study = optuna.create_study(storage=storage, study_name=digest(dict(identity)), load_if_exists=True)
        if IDENTITY not in study.user_attrs:
            study.set_user_attr(IDENTITY, dict(identity))
        trials_of(study)
    except OSError:
        raise
    except Exception as error:  # Optuna replays the damaged file: any kind can come out of it
        raise ConfigError(f"{journal}: no Optuna journal, or damaged; remove it, or give another folder") from error
    return study


def add_trial(study: "Study", trial: "FrozenTrial") -> None:
    """Append a finished trial with its checksum."""
    trial.set_user_attr(CHECKSUM, _checksum(study.study_name, len(study.get_trials(deepcopy=False)), trial))
    study.add_trial(trial)


def trials_of(study: "Study") -> Sequence["FrozenTrial"]:
    """The trials of a study, in order.

    Raises:
        ValueError: a trial is not as it was added.
    """
    trials = study.get_trials(deepcopy=False)
    for number, trial in enumerate(trials):
        if trial.number != number or trial.user_attrs.get(CHECKSUM) != _checksum(study.study_name, number, trial):
            raise ValueError(f"trial {number} of study {study.study_name} has changed")
    return trials


def _check_identity(study: "Study") -> None:
    """Refuse a study whose name is not the hash of its identity; one without trials may lack both after a kill."""
    if study.get_trials(deepcopy=False) and digest(study.user_attrs.get(IDENTITY)) != study.study_name:
        raise ValueError(f"study {study.study_name} is not what its name says")


def _checksum(name: str, number: int, trial: "FrozenTrial") -> str:
    """Hash of a trial's content."""
    value = None if trial.values is None else trial.values[0]
    if value is not None and not math.isfinite(value):
        raise ValueError(f"trial {number}: cost must be finite, got {value}")
    limits = {key: repr(limit) for key, limit in trial.distributions.items()}
    costs: dict[str, Any] = {str(step): cost for step, cost in trial.intermediate_values.items()}
    return digest([name, number, trial.state.name, trial.params, limits, value, costs])


def _cut_torn_line(journal: Path) -> None:
    """Remove the incomplete last line that a kill or a full disk left.

    Raises:
        ValueError: the file does not begin as a journal does.
    """
    with journal.open("ab+") as file:
        file.seek(0)
        text = file.read()
        if not text.startswith(FIRST_KEY[: len(text)]):
            raise ValueError("no journal")
        file.truncate(text.rfind(b"\n") + 1)
