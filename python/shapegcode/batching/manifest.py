"""Manifest of a batch: a file of JSON lines, one per finished run, kept for resuming.

The first line identifies the file; of rows with the same key the last counts; truncated rows are ignored.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

from shapegcode.errors import ArgumentError
from shapegcode.io.data_file import named_errors, write_lines

MANIFEST = "batch.jsonl"  # name of the file, in the output folder

_HEAD = {"shapegcode": "batch", "format": 2}
_FOLDER = "folder"


def base_folder(output: str | Path) -> str:
    """The folder in which the batch of an output folder was started; the current one if there is no manifest."""
    try:
        with (Path(output) / MANIFEST).open("rb") as stream:
            return _base_of(stream, output) or os.getcwd()
    except (FileNotFoundError, NotADirectoryError):
        return os.getcwd()


def short(text: str) -> bytes:
    """Sixteen-byte hash of a text."""
    return hashlib.blake2b(os.fsencode(text), digest_size=16).digest()


class Manifest:
    """The manifest of an output folder, locked by one batch at a time."""

    def __init__(self, folder: Path, *, resume: bool, base: str = "") -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.path = folder / MANIFEST
        self._before: BinaryIO | None = None
        self._known: dict[bytes, int] = {}
        self._moved: dict[int, int] = {}  # position of a kept row in the present file, by that in the former one
        self._lock = _locked(folder)
        try:
            # The former file stays open, so that its rows can be read after a new one has its name.
            with contextlib.suppress(FileNotFoundError):
                self._before = self.path.open("rb")
                _base_of(self._before, folder)
                self._known = {short(row["key"]): at for at, row in self._rows()}
            head = json.dumps(_HEAD | {_FOLDER: os.path.relpath(base or ".", folder)}) + "\n"
            write_lines(self.path, self._kept(head, sorted(self._known.values()) if resume else []))
            self._stream = self.path.open("ab")
        except BaseException:
            self.close()
            raise

    def earlier(self, key: str) -> dict[str, Any] | None:
        """Row of a run in an earlier batch, even without *resume*: the row lists the files that the run wrote."""
        at = self._known.get(short(key))
        if at is None or self._before is None:
            return None
        self._before.seek(at)
        row: dict[str, Any] = json.loads(self._before.readline())
        return row

    def kept_at(self, key: str) -> int:
        """Position in the present file of a row that was kept from an earlier batch."""
        return self._moved[self._known[short(key)]]

    def add(self, row: Mapping[str, Any]) -> int:
        """Write a row, flush it to the disk, and return its position in the file."""
        with named_errors(self.path):
            end = self._stream.tell()
            try:
                self._stream.write(json.dumps(row, sort_keys=True).encode() + b"\n")
                self._stream.flush()
                os.fsync(self._stream.fileno())
            except OSError:
                with contextlib.suppress(OSError):
                    os.ftruncate(self._stream.fileno(), end)
                raise
        return end

    def close(self) -> None:
        """Close the files and release the lock of the folder."""
        with contextlib.suppress(AttributeError, OSError):
            self._stream.close()
        if self._before is not None:
            self._before.close()
        os.close(self._lock)

    def _rows(self) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yield former rows and their positions, from the present position of the file."""
        assert self._before is not None
        at = self._before.tell()
        for line in self._before:
            with contextlib.suppress(ValueError):
                row = json.loads(line)
                if line.endswith(b"\n") and isinstance(row, dict) and isinstance(row.get("key"), str):
                    yield at, row
            at += len(line)

    def _kept(self, head: str, places: Iterable[int]) -> Iterator[str]:
        yield head
        end = len(head)
        for at in places:
            assert self._before is not None
            self._before.seek(at)
            line = self._before.readline()
            self._moved[at] = end
            end += len(line)
            yield line.decode()


def _locked(folder: Path) -> int:
    """Lock a folder; closing the returned descriptor unlocks it, as does the end of the process."""
    lock = -1
    try:
        if sys.platform == "win32":  # deleted by the system on closing
            return os.open(folder / ".batch.lock", os.O_CREAT | os.O_EXCL | os.O_TEMPORARY)
        import fcntl

        lock = os.open(folder, os.O_RDONLY)
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, FileExistsError):
        if lock >= 0:
            os.close(lock)
        raise ArgumentError(f"{folder}: another batch is writing there; wait for it or use another folder") from None
    return lock


def _base_of(stream: BinaryIO, output: str | Path) -> str:
    """Base folder from the first line; empty: there is none."""
    line, head = stream.readline(), None
    with contextlib.suppress(ValueError):
        head = json.loads(line)
    folder = head.pop(_FOLDER, None) if isinstance(head, dict) else None
    if line and (head != _HEAD or not isinstance(folder, str)):
        file = Path(output) / MANIFEST
        raise ArgumentError(f"{file}: not a manifest of this version; use another folder or remove it")
    return os.path.normpath(Path(output).absolute() / folder) if isinstance(folder, str) else ""
