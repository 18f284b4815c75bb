"""The motion of a program in files: CSV and NPZ, written piece by piece, complete or absent."""

from __future__ import annotations

import contextlib
import shutil
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np

from shapegcode import _core
from shapegcode.io.data_file import named_errors, replaced_file
from shapegcode.model.stream import KINDS, Chunk

_COPY_BYTES = 1 << 20
_ZIP_DATE = (1980, 1, 1, 0, 0, 0)  # the same motion gives the same bytes


WriteMotion = Callable[[Chunk], None]
"""Appends the rows of a chunk to a file."""


def _csv(stream: BinaryIO) -> WriteMotion:
    has_head = False

    def write(chunk: Chunk) -> None:
        nonlocal has_head
        columns = chunk.columns()
        if not has_head:
            has_head = True
            stream.write((",".join(["kind", *columns]) + "\n").encode())
        table = np.column_stack([column.astype(np.float64) for column in columns.values()])
        stream.write(_core.csv_rows(chunk.kind, KINDS, table))

    return write


class _Npz:
    """One temporary file per column, put together at the end: an archive holds them one after the other."""

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
def csv_file(path: str | Path) -> Iterator[WriteMotion]:
    """A CSV file of `kind` and `Chunk.columns`, their names first, shortest numbers; ``-`` is standard output."""
    if path == "-":
        yield _csv(sys.stdout.buffer)
        sys.stdout.buffer.flush()
        return
    with named_errors(path), replaced_file(path) as stream:
        yield _csv(stream)


@contextlib.contextmanager
def npz_file(path: str | Path) -> Iterator[WriteMotion]:
    """A NumPy archive of `Chunk.columns`, `kind` and its names; it takes twice the room in its folder meanwhile."""
    target = Path(path).resolve()
    with named_errors(path), contextlib.ExitStack() as files, replaced_file(path) as stream:
        # Beside the file, where there is room for it; not beside a device.
        npz = _Npz(target.parent if target.is_file() or not target.exists() else None, files)
        yield npz.write
        npz.finish(stream)
