"""Results on disk: arrays in files that name the computation they belong to and prove their content.

A file holds a magic line, the SHA-256 of its key, the SHA-256 of what follows, a JSON header with name, type and shape
of each array, and the arrays' bytes. Nothing in it is code or compressed, so reading is bounded by `MAX_FILE_BYTES`. A
file that is damaged, of another key or of another format counts as missing: the result is computed again.
"""

import contextlib
import hashlib
import json
import math
import re
import stat
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from formation_env.files import hash_sources, replacing

SUFFIX: Final = ".result"
MAX_FILE_BYTES: Final = 256 * 2**20
"""Larger results are not cached: a table of two million episodes has 200 MB."""
MAX_HEADER_BYTES: Final = 2**16
"""A few dozen arrays take a few kB."""
STALE_S: Final = 60.0
"""Age from which a temporary file belongs to a killed process: writing takes milliseconds."""

_MAGIC: Final = b"formation-env result, version 1\n"
_HASH_BYTES: Final = 32
_SIZE_BYTES: Final = 4
_DTYPE: Final = re.compile(r"[<|][biufU]\d{1,6}")
"""Flags, integers, floats and texts in little-endian order; no objects."""
_CODE: Final = ("formation_env", "baselines")
_PRESENTATION: Final = (
    "formation_env/rendering/",
    "baselines/report/",
    "baselines/thesis/",
    "baselines/tuning/",
    "baselines/cli",
)
"""Sources that no cached number depends on."""

Arrays = dict[str, NDArray[Any]]
_open_temporaries: set[Path] = set()


@dataclass(frozen=True)
class Entry:
    """The file of one result.

    Attributes:
        path: where it is.
        digest: SHA-256 of the key, hexadecimal.
    """

    path: Path
    digest: str

    def read(self) -> Arrays | None:
        """The arrays; None if there is no whole file of this key."""
        content = _read_bounded(self.path)
        return None if content is None else _decode(content, bytes.fromhex(self.digest))

    def write(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Store the arrays; the file is complete or not there. Results above `MAX_FILE_BYTES` are left out.

        Raises:
            OSError: the folder cannot be written.
            TypeError: an array holds objects.
        """
        content = _encode(arrays, bytes.fromhex(self.digest))
        if len(content) > MAX_FILE_BYTES:
            return
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(self.path) as temporary:
            _open_temporaries.add(temporary)
            try:
                temporary.write_bytes(content)
            finally:
                _open_temporaries.discard(temporary)


def entry(folder: Path, label: str, key: Any) -> Entry:
    """The file of a result.

    Args:
        folder: of the cache.
        label: first part of the file's name, for people.
        key: all settings that the result depends on, compared by `repr`; the sources of this project are added.
    """
    text = repr((source_hash(), label, key))
    digest = hashlib.sha256(text.encode(errors="surrogatepass")).hexdigest()
    return Entry(folder / f"{label}_{digest[:24]}{SUFFIX}", digest)


@cache
def source_hash() -> str:
    """SHA-256 over the sources that results depend on, hexadecimal: results of other code are computed again."""
    root = Path(__file__).parents[1]
    return hash_sources(
        path
        for package in _CODE
        for path in sorted((root / package).rglob("*.py"))
        if not path.relative_to(root).as_posix().startswith(_PRESENTATION)
    )


def remove_temporaries(folder: Path, names: Callable[[str], bool] = lambda name: name.endswith(SUFFIX)) -> None:
    """Remove temporary files that killed processes left in a folder.

    Args:
        folder: it need not exist.
        names: whether a hidden file of that name may be one of them.
    """
    with contextlib.suppress(OSError):
        for path in folder.glob(".*.*"):
            with contextlib.suppress(OSError):
                if names(path.name) and path.is_file() and time.time() - path.stat().st_mtime > STALE_S:
                    path.unlink()


def discard_open_temporaries() -> None:
    """Remove the temporary files that this process is writing, right before it ends without clean-up."""
    for path in list(_open_temporaries):
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)


def _read_bounded(path: Path) -> bytes | None:
    """The bytes of a regular file of at most `MAX_FILE_BYTES`; None otherwise: pipes and devices may never end."""
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode) or status.st_size > MAX_FILE_BYTES:
            return None
        with path.open("rb") as file:
            return file.read(MAX_FILE_BYTES)
    except OSError:
        return None


def _encode(arrays: Mapping[str, NDArray[Any]], key: bytes) -> bytes:
    whole = {name: np.ascontiguousarray(values) for name, values in arrays.items()}
    whole = {name: values.astype(values.dtype.newbyteorder("<"), copy=False) for name, values in whole.items()}
    for name, values in whole.items():
        if not _DTYPE.fullmatch(values.dtype.str):
            raise TypeError(f"result_cache: {name}: cannot store the type {values.dtype}")
    described = [[name, values.dtype.str, list(values.shape)] for name, values in whole.items()]
    header = json.dumps(described).encode()
    parts = (len(header).to_bytes(_SIZE_BYTES, "little"), header, *(values.tobytes() for values in whole.values()))
    content = b"".join(parts)
    return _MAGIC + key + hashlib.sha256(content).digest() + content


def _decode(data: bytes, key: bytes) -> Arrays | None:
    """The arrays of a file; None unless its magic line, key, hash, header and length all agree."""
    start = len(_MAGIC)
    named, proof = data[start : start + _HASH_BYTES], data[start + _HASH_BYTES : start + 2 * _HASH_BYTES]
    content = data[start + 2 * _HASH_BYTES :]
    if data[:start] != _MAGIC or named != key or hashlib.sha256(content).digest() != proof:
        return None
    size = int.from_bytes(content[:_SIZE_BYTES], "little")
    if size > MAX_HEADER_BYTES:
        return None
    try:
        return _arrays(json.loads(content[_SIZE_BYTES : _SIZE_BYTES + size]), content[_SIZE_BYTES + size :])
    except (ValueError, TypeError, RecursionError, OverflowError):
        return None


def _arrays(header: Any, data: bytes) -> Arrays | None:
    """The arrays that a header describes; None where it does not describe exactly these bytes."""
    result: Arrays = {}
    position = 0
    for name, kind, shape in header:
        if not (isinstance(name, str) and _DTYPE.fullmatch(kind) and all(type(n) is int and n >= 0 for n in shape)):
            return None
        dtype, count = np.dtype(kind), math.prod(shape)
        if position + count * dtype.itemsize > len(data):
            return None
        values = np.frombuffer(data, dtype, count, position).reshape(shape).copy()
        if dtype.kind == "U" and values.view(np.uint32).max(initial=0) > sys.maxunicode:
            return None
        result[name] = values
        position += count * dtype.itemsize
    return result if position == len(data) else None
