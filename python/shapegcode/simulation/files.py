"""The motion of a program in files: CSV and NPZ, written piece by piece, complete or absent."""

from __future__ import annotations

import contextlib
import shutil
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Protocol

import numpy as np

from shapegcode import _core
from shapegcode.io.atomic import named_errors, replaced_file
from shapegcode.model.stream import KINDS, Chunk

_COPY_BYTES = 1 << 20
_ZIP_DATE = (1980, 1, 1, 0, 0, 0)  # the same motion gives the same bytes


class MotionFile(Protocol):
    """A file that a motion is written to."""

    def write(self, chunk: Chunk) -> None:
        """Append the rows of a chunk."""


class _Csv:
    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._has_head = False

    def write(self, chunk: Chunk) -> None:
        columns = chunk.columns()
        if not self._has_head:
            self._has_head = True
            self._stream.write((",".join(["kind", *columns]) + "\n").encode())
        table = np.column_stack([column.astype(np.float64) for column in columns.values()])
        self._stream.write(_core.csv_rows(chunk.kind, KINDS, table))


class _Npz:
    """One temporary file per column; the archive is put together from them at the end.

    A ZIP archive holds its members one after the other, but the columns come side by side.
    """

    def __init__(self, folder: Path | None, files: contextlib.ExitStack) -> None:
        self._folder = folder
        self._files = files
        self._columns: dict[str, tuple[BinaryIO, np.dtype[np.generic]]] = {}
        self._rows = 0

    def write(self, chunk: Chunk) -> None:
        for name, column in {**chunk.columns(), "kind": chunk.kind}.items():
            if name not in self._columns:
                # The stack closes it, and then it is gone.
                file = self._files.enter_context(tempfile.TemporaryFile(dir=self._folder))  # noqa: SIM115
                self._columns[name] = (file, column.dtype)
            self._columns[name][0].write(np.ascontiguousarray(column).data)
        self._rows += len(chunk)

    def finish(self, stream: BinaryIO) -> None:
        with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive:
            for name, (file, dtype) in self._columns.items():
                file.seek(0)
                with archive.open(_member(name), "w", force_zip64=True) as member:
                    _header(member, dtype, (self._rows,))
                    shutil.copyfileobj(file, member, _COPY_BYTES)
            names = np.array(KINDS)
            with archive.open(_member("kind_names"), "w") as member:
                _header(member, names.dtype, names.shape)
                member.write(names.tobytes())


def _member(name: str) -> zipfile.ZipInfo:
    return zipfile.ZipInfo(f"{name}.npy", date_time=_ZIP_DATE)


def _header(stream: object, dtype: np.dtype[np.generic], shape: tuple[int, ...]) -> None:
    description: dict[str, object] = {
        "descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": shape,
    }  # fmt: skip
    np.lib.format.write_array_header_1_0(stream, description)  # type: ignore[arg-type]


@contextlib.contextmanager
def csv_file(path: str | Path) -> Iterator[MotionFile]:
    """A CSV file with the names of its columns in the first line; ``-`` is standard output.

    Columns: `kind` in words, then those of `Chunk.columns`; numbers as the shortest text that reads back the same.
    """
    if path == "-":
        yield _Csv(sys.stdout.buffer)
        sys.stdout.buffer.flush()
        return
    with named_errors(path), replaced_file(path) as stream:
        yield _Csv(stream)


@contextlib.contextmanager
def npz_file(path: str | Path) -> Iterator[MotionFile]:
    """A NumPy archive with one array per column: those of `Chunk.columns`, `kind` and what its numbers mean.

    Until it is complete its columns take as much room again in the same folder.
    """
    target = Path(path).resolve()
    with named_errors(path), contextlib.ExitStack() as files, replaced_file(path) as stream:
        # Beside the file, where there is room for it; not beside a device.
        npz = _Npz(target.parent if target.is_file() or not target.exists() else None, files)
        yield npz
        npz.finish(stream)
