"""Files from anywhere: each fault is one clear line, and none takes long."""

import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from formation_env.configuration.config_files import MAX_CONFIG_BYTES, ConfigError, load_json, load_yaml
from formation_env.configuration.yaml_loader import MAX_DEPTH

PATIENCE_S = 20.0
"""Far above what a refusal takes, and far below what the same file once took."""
ALIAS_BOMB = "a: &a [x, x]\n" + "\n".join(
    f"{name}: &{name} [{', '.join([f'*{before}'] * 9)}]"
    for before, name in zip("abcdefghij", "bcdefghijk", strict=True)
)
MERGE_BOMB = "a: &a {x: 1}\n" + "\n".join(
    f"{name}: &{name} {{<<: [{', '.join([f'*{before}'] * 9)}]}}"
    for before, name in zip("abcdefghij", "bcdefghijk", strict=True)
)


def write(folder: Path, text: str, name: str = "x.yaml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def refusal(load: Callable[[Path], object], path: Path) -> str:
    """The one line with which a file is refused, soon, after the file's name."""
    start = time.monotonic()
    with pytest.raises(ConfigError) as caught:
        load(path)
    assert time.monotonic() - start < PATIENCE_S
    line = str(caught.value)
    assert len(line.splitlines()) == 1
    assert len(line) < len(str(path)) + 300
    return line.removeprefix(f"{path}: ")


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("j2: !!bool maybe", "line 1: no valid YAML: 'maybe' is no bool"),
        ("a: 1\nb: !!int ''", "line 2: no valid YAML: '' is no int"),
        ("a: !!float ''", "line 1: no valid YAML: '' is no float"),
        ("a: !!float x", "line 1: no valid YAML: 'x' is no float: could not convert string to float: 'x'"),
        (f"a: {'9' * 5000}", f"line 1: no valid YAML: '{'9' * 79} is no int: Exceeds the limit"),
        (f"a: !{'x' * 5000}", "line 1: no valid YAML: could not determine a constructor for the tag"),
        ("a: &a [*a]", "line 1: alias 'a' is inside the value that it names"),
        (ALIAS_BOMB, "line 6: more than 50000 values, those that aliases repeat included"),
        (MERGE_BOMB, "line 6: more than 50000 values, those that aliases repeat included"),
        (f"[{'1,' * 400_000}]", "line 1: more than 50000 values"),
        ("[" * 1000 + "]" * 1000, f"line 1: nested more than {MAX_DEPTH} levels deep"),
        ("- " * 1000, f"line 1: nested more than {MAX_DEPTH} levels deep"),
        ("\n".join(" " * depth + "a:" for depth in range(400)), f"line 51: nested more than {MAX_DEPTH} levels deep"),
        ("#" * (MAX_CONFIG_BYTES + 1), "cannot be read: larger than 1,000,000 bytes"),
    ],
    ids=range(14),
)
def test_hostile_yaml_is_refused_soon_and_in_one_line(tmp_path: Path, text: str, fault: str) -> None:
    """Tags that do not fit, bombs of aliases and merges, depth, size."""
    assert refusal(load_yaml, write(tmp_path, text)).startswith(fault)


@pytest.mark.parametrize(("text", "value"), [(".5e3", 500.0), ("-.5E2", -50.0), ("+.25", 0.25), (".5e-1", 0.05)])
def test_fractions_without_a_leading_digit_are_numbers(tmp_path: Path, text: str, value: float) -> None:
    """YAML 1.2.2, section 10.3.2: [-+]? ( \\. [0-9]+ | [0-9]+ ( \\. [0-9]* )? ) ( [eE] [-+]? [0-9]+ )? is a float."""
    loaded = load_yaml(write(tmp_path, f"key: {text}"))["key"]
    assert loaded == value
    assert type(loaded) is float


def test_modest_aliases_and_merges_load(tmp_path: Path) -> None:
    """The limits leave ordinary files alone."""
    text = "a: &a {x: 1, y: 2}\nb: *a\nc: {<<: *a, y: 3}\nd: [*a, *a]\n"
    loaded = load_yaml(write(tmp_path, text))
    assert loaded["b"] == {"x": 1, "y": 2}
    assert loaded["c"] == {"x": 1, "y": 3}
    assert loaded["d"] == [loaded["a"]] * 2


@pytest.mark.parametrize("load", [load_yaml, load_json])
def test_only_regular_files_are_read(tmp_path: Path, load: Callable[[Path], object]) -> None:
    """A pipe without a writer would block for ever, a device never end."""
    os.mkfifo(tmp_path / "pipe.yaml")
    (tmp_path / "link.yaml").symlink_to("pipe.yaml")
    assert refusal(load, tmp_path / "pipe.yaml") == "cannot be read: not a regular file"
    assert refusal(load, tmp_path / "link.yaml") == "cannot be read: not a regular file"
    assert refusal(load, Path("/dev/zero")) == "cannot be read: not a regular file"
    assert refusal(load, tmp_path) == "cannot be read: Is a directory"
    assert refusal(load, tmp_path / ("x" * 300 + ".yaml")) == "cannot be read: File name too long"
    assert "null" in refusal(load, Path("a\0.yaml"))


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("[" * 100_000, "no valid JSON: nested too deep"),
        ("{", "no valid JSON: Expecting property name"),
        ("9" * 5000, "no valid JSON: Exceeds the limit"),
        (" " * (MAX_CONFIG_BYTES + 1), "cannot be read: larger than 1,000,000 bytes"),
    ],
    ids=range(4),
)
def test_hostile_json_is_refused_in_one_line(tmp_path: Path, text: str, fault: str) -> None:
    """The same for the JSON files of runs and policies."""
    assert refusal(load_json, write(tmp_path, text, "x.json")).startswith(fault)
