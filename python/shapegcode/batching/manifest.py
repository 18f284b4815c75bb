"""What a batch has done, row by row: a file of JSON lines that outlives it.

The first line says what the file is. Each further one is the row of a run, written when its files are complete; of
several with one key the last counts. A row that was cut off in the middle is not there.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from shapegcode.errors import ArgumentError
from shapegcode.io.atomic import named_errors, write_lines

__all__ = ["MANIFEST", "Manifest"]

MANIFEST = "batch.jsonl"
"""Name of the file, in the output folder."""

_FORMAT = 1
_HEAD = {"shapegcode": "batch", "format": _FORMAT}


class Manifest:
    """The manifest of an output folder, held by one batch at a time.

    Args:
        folder: of the results; it is made.
        resume: keep the rows that are there; False: forget them.

    Raises:
        ArgumentError: another batch writes into the folder, or the file is no manifest of this version.
        OSError: it cannot be written.
    """

    def __init__(self, folder: Path, *, resume: bool) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.path = folder / MANIFEST
        # The folder itself is locked: that leaves no file behind, however the batch ends.
        self._lock = os.open(folder, os.O_RDONLY)
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(self._lock)
            raise ArgumentError(
                f"{folder}: another batch is writing there; wait for it or name another folder"
            ) from None
        try:
            self.earlier: dict[str, dict[str, Any]] = {row["key"]: row for row in self._read()}
            """Rows of earlier batches by key, also of those that are forgotten: their files are known by them."""
            kept = self.earlier.values() if resume else ()
            lines = (json.dumps(row, sort_keys=True) + "\n" for row in (_HEAD, *kept))
            write_lines(self.path, lines)
            self._stream = self.path.open("ab")
        except BaseException:
            self.close()
            raise

    def _read(self) -> Iterator[dict[str, Any]]:
        try:
            lines = self.path.read_bytes().splitlines(keepends=True)
        except FileNotFoundError:
            return
        head: object = None
        if lines:
            with contextlib.suppress(ValueError):
                head = json.loads(lines[0])
        if head != _HEAD:
            raise ArgumentError(f"{self.path}: not a manifest of this version; name another folder or remove it")
        for line in lines[1:]:
            with contextlib.suppress(ValueError):
                row = json.loads(line)
                if line.endswith(b"\n") and isinstance(row, dict) and isinstance(row.get("key"), str):
                    yield row

    def add(self, row: Mapping[str, Any]) -> None:
        """Write a row, to the disk itself.

        Args:
            row: with its "key".

        Raises:
            OSError: a full disk; the row is then not there.
        """
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

    def close(self) -> None:
        """Let others write into the folder."""
        with contextlib.suppress(AttributeError, OSError):
            self._stream.close()
        os.close(self._lock)
