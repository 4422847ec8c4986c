"""Damaged, foreign and hostile files in a run's folder: refused in one line that names the file, never a traceback."""

import json
import pickle
import shutil
from pathlib import Path
from typing import Any

import pytest
import torch
from agents_helpers import small_run
from damage_helpers import refusals

from agents.training.checkpoint import HEADER_BYTES, KEYS, _header, load_checkpoint
from agents.training.run_folder import (
    CHECKPOINT,
    CURVE,
    DIGEST,
    PRETRAINING,
    RUN,
    Run,
    load_run,
    read_curve,
    read_pretraining,
    run_sha256,
)
from agents.training.train import resume, train
from agents.training.versions import _revision
from formation_env import ConfigError


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Run, Path]:
    """A short training."""
    folder = tmp_path_factory.mktemp("finished")
    run = small_run(folder, "ppo", steps=128, validations=1)
    train(run, folder / "run")
    return run, folder / "run"


@pytest.fixture
def copy(finished: tuple[Run, Path], tmp_path: Path) -> Path:
    """A copy of its folder, to be damaged."""
    return Path(shutil.copytree(finished[1], tmp_path / "run"))


def test_changed_settings_are_refused_or_equal(finished: tuple[Run, Path], copy: Path) -> None:
    """A byte inverted anywhere, or the end cut off."""
    path = copy / RUN
    content = path.read_bytes()

    def read() -> None:
        assert load_run(copy) == finished[0]

    lines = refusals(path, content, read, len(content), stride=11)
    assert len(lines) >= len(content) // 11  # an inverted byte is no ASCII, so no JSON, or another text


def test_other_settings_are_refused(finished: tuple[Run, Path], copy: Path) -> None:
    """Valid settings that are not those of the start: a digit changed, or the hash left out."""
    data = json.loads((copy / RUN).read_text())
    assert data[DIGEST] == run_sha256(finished[0]) == run_sha256(load_run(copy))
    for change in ({"seed": 1}, {"command": "another"}, {"agent": data["agent"] | {"gamma": 0.99}}, {DIGEST: "0" * 64}):
        (copy / RUN).write_text(json.dumps(data | change))
        with pytest.raises(ConfigError, match=r"settings.json: sha256: does not match"):
            load_run(copy)
    (copy / RUN).write_text(json.dumps({"algorithm": "pqo"}))
    with pytest.raises(ConfigError, match=r"settings.json: no algorithm named 'pqo'; did you mean 'ppo'?"):
        load_run(copy)


@pytest.mark.parametrize("name", [CURVE, PRETRAINING])
def test_damaged_tables_are_one_line(name: str, copy: Path) -> None:
    """A byte inverted or a cut gives an error or a table of finite numbers; so does each hostile table."""
    path = copy / name
    content = b"done,steps,seconds,return\nx,0,1.5,-2.25\ny,64,2.5,-2.125\nz,128,3.5,-2.0\n"

    def read() -> None:
        table = read_curve(copy) if name == CURVE else read_pretraining(copy)
        assert table is not None
        assert len(table) > 0
        assert (table["return"].abs() < 1e300).all()

    assert refusals(path, content, read, len(content))
    for text, fault in (
        (b"", "has no validation yet"),
        (b"done,steps,seconds,return\n", "finite numbers only|has no validation yet"),
        (b"\xff\xfe\x00", "damaged"),
        (b'steps,seconds,return\n1,2,"3\n', "damaged"),
        (b"steps,seconds,return\n1,2,3,4\n5\n1,2,3,4,5,6\n", "damaged"),
        (b"steps,seconds\n0,1\n", "return: this column is missing"),
        (b"steps,seconds,return\n0,1,nan\n", "return: must hold finite numbers only"),
        (b"steps,seconds,return\n0,1,x\n", "return: must hold finite numbers only"),
    ):
        path.write_bytes(text)
        with pytest.raises(ConfigError, match=rf"{name}: .*({fault})"):
            read()


def test_curves_run_forwards(copy: Path) -> None:
    """Lines out of order are damage."""
    (copy / CURVE).write_text("steps,seconds,return\n0,1,-2\n64,2,-1\n64,3,-1\n")
    with pytest.raises(ConfigError, match=r"validation.csv: steps: must increase from line to line"):
        read_curve(copy)


def test_damaged_checkpoints_are_refused(finished: tuple[Run, Path], copy: Path) -> None:
    """Any byte inverted and any cut: the hash does not match. The file itself still loads."""
    path = copy / CHECKPOINT
    content, stride = path.read_bytes(), 97
    load_checkpoint(path, finished[0])
    lines = refusals(path, content, lambda: load_checkpoint(path, finished[0]), len(content), stride)
    assert len(lines) == len(range(0, len(content), stride)) + 30
    assert {line.removeprefix(f"{path}: ").split(":")[0].split(",")[0] for line in lines} == {"damaged"}


def test_the_checkpoint_of_another_run_is_refused(finished: tuple[Run, Path], copy: Path, tmp_path: Path) -> None:
    """Of equal shape but with another seed: resuming from it would be neither run."""
    other = small_run(tmp_path, "ppo", steps=128, validations=1, seed=1)
    train(other, tmp_path / "other")
    shutil.copy(tmp_path / "other" / CHECKPOINT, copy / CHECKPOINT)
    with pytest.raises(ConfigError, match=r"checkpoint.pt: is the checkpoint of another run"):
        resume(copy)


class Payload:
    """An object whose unpickling would run code."""

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        return (Path.touch, (Path("executed"),))  # type: ignore[return-value]


def test_hostile_checkpoints_are_refused(
    finished: tuple[Run, Path], copy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a right hash: pickled code is not run, and what is no training's state is named."""
    monkeypatch.chdir(tmp_path)
    path = copy / CHECKPOINT
    torch.save({"run": Payload()}, tmp_path / "payload.pt")
    torch.save({"run": 1}, tmp_path / "incomplete.pt")
    torch.save([1], tmp_path / "list.pt")
    bodies = [pickle.dumps(Payload()), b"", b"PK\x03\x04", b"text"]
    bodies += [(tmp_path / f"{name}.pt").read_bytes() for name in ("payload", "incomplete", "list")]
    for body in bodies:
        path.write_bytes(_header(body) + body)
        assert len(_header(body)) == HEADER_BYTES
        with pytest.raises(ConfigError, match=r"checkpoint.pt: is not a checkpoint: ") as caught:
            load_checkpoint(path, finished[0])
        assert "\n" not in str(caught.value)
    assert not (tmp_path / "executed").exists()
    assert KEYS[1] in str(caught.value) or KEYS[0] in str(caught.value)


def test_the_revision_is_that_of_the_sources_own_repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package deeper inside some repository, as in a virtual environment, has none; nor has one without git."""
    answers = {"rev-parse": str(tmp_path.resolve()), "describe": "a" * 40}
    monkeypatch.setattr("agents.training.versions._git", lambda folder, verb, *rest: answers[verb])
    assert _revision(tmp_path / "agents") == "a" * 40
    assert _revision(tmp_path / ".venv" / "site-packages" / "agents") == ""
    monkeypatch.undo()
    monkeypatch.setenv("PATH", "")
    assert _revision(tmp_path / "agents") == ""
