"""The result cache: what is read is what was written for the same key, whatever happened to the file."""

import hashlib
import io
import json
import os
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest

from baselines import result_cache
from baselines.result_cache import SUFFIX, Entry, entry, remove_temporaries
from formation_env.files import hash_sources

ARRAYS = {
    "cost": np.array([1 / 3, np.nan, -1e-300, np.inf]),
    "seed": np.arange(4),
    "early": np.array([True, False, True, False]),
    "policy": np.array(["lqr", "", "NA", "Δv"]),
    "states": np.arange(6.0).reshape(2, 3),
}
MAGIC = len(b"formation-env result, version 1\n")


@pytest.fixture
def place(tmp_path: Path) -> Entry:
    made = entry(tmp_path, "job", ("scenario", 1))
    made.write(ARRAYS)
    return made


def assert_same(read: result_cache.Arrays | None) -> None:
    assert read is not None
    assert list(read) == list(ARRAYS)
    for name, values in ARRAYS.items():
        np.testing.assert_array_equal(read[name], values)
        assert read[name].dtype == values.dtype


def test_arrays_are_read_as_written(place: Entry) -> None:
    """To the last bit, with their types and shapes; the folder holds that file alone."""
    assert_same(place.read())
    assert list(place.path.parent.iterdir()) == [place.path]


def test_no_inverted_byte_passes(place: Entry) -> None:
    """Every byte of the file inverted in turn: the result is missing, never an error and never another number."""
    whole = place.path.read_bytes()
    for position in range(len(whole)):
        broken = bytearray(whole)
        broken[position] ^= 0xFF
        place.path.write_bytes(bytes(broken))
        assert place.read() is None, position
    for length in range(0, len(whole), 7):
        place.path.write_bytes(whole[:length])
        assert place.read() is None, length
    place.path.write_bytes(whole + b"\0")
    assert place.read() is None
    place.path.write_bytes(whole)
    assert_same(place.read())


def proven(place: Entry, header: bytes, data: bytes = b"", size: int | None = None) -> bytes:
    """A file whose key and hash are right, so that its content is looked at."""
    content = (len(header) if size is None else size).to_bytes(4, "little") + header + data
    start = place.path.read_bytes()[:MAGIC] + bytes.fromhex(place.digest)
    return start + hashlib.sha256(content).digest() + content


def header(*columns: object) -> bytes:
    return json.dumps(columns).encode()


HOSTILE = {
    "huge shape": header(["cost", "<f8", [2**60]]),
    "huge product": header(["cost", "<f8", [2**40, 2**40]]),
    "negative shape": header(["cost", "<f8", [-1]]),
    "flag as a size": header(["cost", "<f8", [True]]),
    "float as a size": header(["cost", "<f8", [1.0]]),
    "objects": header(["cost", "|O", [1]]),
    "structure": header(["cost", "f8,f8", [1]]),
    "void": header(["cost", "|V8", [1]]),
    "huge text": header(["cost", "<U999999999", [1]]),
    "no list": b"7",
    "no columns": header(7),
    "numbers": header([1, 2, 3]),
    "no json": b"\xff\xfe",
    "deep json": b"[" * 60_000,
    "huge number": b"1" * 60_000,
    "nothing": b"",
}


@pytest.mark.parametrize("fault", HOSTILE)
def test_hostile_headers_are_missing_results(place: Entry, fault: str) -> None:
    """Key and hash are right, the header is not: no memory is asked for, nothing is raised."""
    place.path.write_bytes(proven(place, HOSTILE[fault], bytes(8)))
    assert place.read() is None


def test_hostile_files_are_missing_results(place: Entry, tmp_path: Path) -> None:
    """A wrong length of the header, no Unicode, pickles, zip bombs, pipes, devices, folders, links to nowhere."""
    place.path.write_bytes(proven(place, b"[]", size=2**32 - 1))
    assert place.read() is None
    place.path.write_bytes(proven(place, header(["a", "<U1", [1]]), b"\xff\xff\xff\xff"))
    assert place.read() is None
    archive = io.BytesIO()
    np.savez(archive, cost=np.array([{"a": 1}], dtype=object), allow_pickle=True)
    place.path.write_bytes(archive.getvalue())
    assert place.read() is None
    with zipfile.ZipFile(place.path, "w", zipfile.ZIP_DEFLATED) as bomb:
        bomb.writestr("cost.npy", bytes(10**7))
    assert place.read() is None
    place.path.unlink()
    os.mkfifo(place.path)
    start = time.monotonic()
    assert place.read() is None  # opening a pipe would wait for a writer
    assert time.monotonic() - start < 1
    place.path.unlink()
    for target in ("/dev/zero", tmp_path / "nowhere", tmp_path):
        place.path.symlink_to(target)
        assert place.read() is None
        place.path.unlink()
    assert place.read() is None


def test_files_above_the_limit_are_not_read(place: Entry, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor written, as they would be computed again anyway."""
    monkeypatch.setattr(result_cache, "MAX_FILE_BYTES", place.path.stat().st_size - 1)
    assert place.read() is None
    place.path.unlink()
    place.write(ARRAYS)
    assert not place.path.exists()


def test_swapped_files_are_missing_results(tmp_path: Path) -> None:
    """Two whole files under each other's names: neither is taken for the other."""
    one, other = (entry(tmp_path, "job", policy) for policy in ("lqr", "smc"))
    one.write({"cost": np.array([1.0])})
    other.write({"cost": np.array([2.0])})
    first, second = one.path.read_bytes(), other.path.read_bytes()
    one.path.write_bytes(second)
    other.path.write_bytes(first)
    assert one.read() is None
    assert other.read() is None


def test_results_of_other_code_are_not_reused(place: Entry, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another hash of the sources makes another file, and the key within is another, too."""
    monkeypatch.setattr(result_cache, "source_hash", lambda: "other code")
    later = entry(tmp_path, "job", ("scenario", 1))
    assert later.path != place.path
    later.path.write_bytes(place.path.read_bytes())
    assert later.read() is None


def test_the_source_hash_sees_the_content(tmp_path: Path) -> None:
    """A changed line or a renamed file changes it; the same sources have the same hash in another process."""
    file = tmp_path / "a.py"
    hashes = set()
    for text in ("x = 1\n", "x = 2\n"):
        file.write_text(text)
        hashes.add(hash_sources([file]))
    hashes.add(hash_sources([file.rename(tmp_path / "b.py")]))
    assert len(hashes) == 3
    code = "from baselines.result_cache import source_hash; print(source_hash())"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == result_cache.source_hash()


def test_objects_are_refused(place: Entry) -> None:
    """They would have to be pickled."""
    with pytest.raises(TypeError, match="cost: cannot store the type object"):
        place.write({"cost": np.array([None])})


def test_temporaries_of_killed_processes_are_removed(place: Entry) -> None:
    """Old ones only: a fresh one may belong to a process that is writing; results stay."""
    folder = place.path.parent
    old, fresh = folder / f".job.abc{SUFFIX}", folder / f".job.def{SUFFIX}"
    for path in (old, fresh):
        path.touch()
    hour_ago = time.time() - 3600
    os.utime(old, (hour_ago, hour_ago))
    remove_temporaries(folder)
    assert sorted(folder.iterdir()) == sorted([fresh, place.path])
    remove_temporaries(folder / "none")
