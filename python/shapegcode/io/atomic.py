"""Files that are either complete or as they were before."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import secrets
import stat
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO

_passing = False
_LONGEST_NAME = 200  # of a file, so that more has room behind it


def write_in_passing() -> None:
    """Do without fsync in this process from now on: its files are read at once and kept by another process."""
    global _passing  # noqa: PLW0603 - of the whole process, which has no other use
    _passing = True


_TEMPORARY = re.compile(r"\..+\.[0-9a-f]+\.tmp")  # digits alone: of versions before


@contextlib.contextmanager
def named_errors(path: str | Path) -> Iterator[None]:
    """Errors of the file system get the name of *path*: a failed write() has none, a temporary file another."""
    try:
        yield
    except OSError as error:
        raise type(error)(error.errno or errno.EIO, error.strerror or str(error), str(path)) from error


@contextlib.contextmanager
def replaced_file(path: str | Path) -> Iterator[BinaryIO]:
    """A stream whose content replaces a file when the block ends without an error; otherwise the file is unchanged.

    A symbolic link is followed, but not round in a circle; a device or pipe is written to directly.
    """
    target = _target_of(path)
    if target.exists() and not stat.S_ISREG(target.stat().st_mode):
        with open(target, "wb") as stream:
            yield stream
        return
    mode = stat.S_IMODE(target.stat().st_mode) if target.exists() else None
    # No number of a process: a container counts from 1 again, and threads have the same one. See is_temporary.
    temporary = target.with_name(f".{target.name[:_LONGEST_NAME]}.{secrets.token_hex(8)}.tmp")
    stream = open(temporary, "xb")  # noqa: SIM115 - what another one has written is not removed below
    try:
        with stream:
            yield stream
            stream.flush()
            if not _passing:
                os.fsync(stream.fileno())
        if mode is not None:
            temporary.chmod(mode)
        os.replace(temporary, target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _target_of(path: str | Path) -> Path:
    """The file that a symbolic link leads to."""
    target = Path(os.path.realpath(path))
    if target.is_symlink():  # realpath gives up only where links lead to each other
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(path))
    return target


def is_temporary(path: str | Path) -> bool:
    """Whether a file is a temporary one whose process was killed before it replaced the target."""
    return _TEMPORARY.fullmatch(Path(path).name) is not None


def write_text(path: str | Path, text: str, *, overwrite: bool = True) -> None:
    """Write a UTF-8 file so that it is either complete or as it was before; line ends as they are."""
    write_bytes(path, _encoded(text), overwrite=overwrite)


def _encoded(text: str) -> bytes:
    """As UTF-8; of names of files that are none JSON understands what then stands there."""
    return text.encode(errors="backslashreplace")


def write_lines(path: str | Path, lines: Iterable[str]) -> None:
    """As `write_text`, line by line, without holding all of them; ``-`` is standard output."""
    if path == "-":
        sys.stdout.writelines(lines)
        return
    with named_errors(path), replaced_file(path) as stream:
        for line in lines:
            stream.write(_encoded(line))


def write_bytes(path: str | Path, data: bytes | memoryview, *, overwrite: bool = True) -> None:
    """As :func:`write_text`, for bytes."""
    with named_errors(path):
        if overwrite:
            with replaced_file(path) as stream:
                stream.write(data)
        else:
            _write_new(_target_of(path), data)


def _write_new(target: Path, data: bytes | memoryview) -> None:
    with open(target, "xb") as stream:
        try:
            stream.write(data)
            stream.flush()
        except BaseException:
            target.unlink(missing_ok=True)
            raise
