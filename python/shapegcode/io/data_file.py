"""Reads and writes files. Data files must be regular files (no pipe or device), and are limited in size, unpacked
size, nesting depth and length of strings. A file is written completely, or remains unchanged.

All input files are opened here, or checked here before a library reads them: settings, records, logs, dumps, results,
programs. So no file of a few megabytes takes gigabytes of memory, and no pipe or device blocks a command.
"""

import contextlib
import errno
import gzip
import json
import os
import re
import secrets
import stat
import sys
import tomllib
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, BinaryIO, Self, cast

from shapegcode.errors import ArgumentError, RecordError, ShapegcodeError

MAX_DEPTH = 64  # nesting of lists and tables
MAX_TEXT_BYTES = 1 << 20  # of one text, key, or line
MAX_SETTINGS_BYTES = 4 << 20  # of a TOML file
_MAX_BYTES = 2 << 30
_MAX_INTEGER = 2**63 - 1
#: Limit of unpacked over packed size (logs of numbers: 5 to 15), and unpacked size up to which any ratio is accepted.
_MAX_RATIO, _ANY_RATIO_BYTES = 50, 16 << 20
#: Memory limit of a JSON file's values, relative to its bytes, and the limit for small files.
_MAX_GROWTH, _ANY_GROWTH_BYTES = 60, 600 << 20
_PIECE_BYTES = 1 << 20
_GZIP, _ZIP = b"\x1f\x8b", b"PK\x03\x04"
_PACKED_FAULTS = (EOFError, NotImplementedError, RuntimeError, ValueError, zipfile.BadZipFile, zlib.error)
_KINDS = {stat.S_IFIFO: "a pipe", stat.S_IFCHR: "a device", stat.S_IFBLK: "a device", stat.S_IFSOCK: "a socket"}
#: Upper bound on a value's memory, by its JSON character; objects with one key need most.
_MEMORY = {b"{": 240, b"[": 100, b":": 100, b'"': 30, b",": 40}
_NOT_STRUCTURE = bytes(set(range(256)) - set(b'[]{}"'))
_STRING = re.compile(rb'"[^"]*+"')
_ONE_KIND = bytes.maketrans(b"{}", b"[]")
_KEY_PART = r"""(?:[A-Za-z0-9_-]++|"[^"\n]*+"|'[^'\n]*+')"""
#: A key of more than `MAX_DEPTH` parts: tomllib's time grows with the square of its length.
_LONG_KEY = re.compile(rf"(?<![\w.-]){_KEY_PART}(?:[ \t]*+\.[ \t]*+{_KEY_PART}){{{MAX_DEPTH}}}")

Fault = Callable[[str], Exception]


def open_file(path: str | Path) -> BinaryIO:
    """Open a regular file to read it; a pipe or device is refused at once, without waiting for it."""
    if not isinstance(path, str | os.PathLike):
        raise ArgumentError(f"a file name is needed, not {type(path).__name__}")
    wanted = os.O_RDONLY | getattr(os, "O_BINARY", 0) | getattr(os, "O_NOCTTY", 0) | getattr(os, "O_NONBLOCK", 0)
    try:
        mode = os.stat(path).st_mode  # before opening, which can rewind a tape
        if stat.S_ISREG(mode):
            descriptor = os.open(path, wanted)
            mode = os.fstat(descriptor).st_mode
            if stat.S_ISREG(mode):
                return _readable(os.fdopen(descriptor, "rb"), path)
            os.close(descriptor)
    except ValueError as error:  # a NUL in its name
        raise OSError(errno.EINVAL, str(error), str(path)) from None
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    kind = _KINDS.get(stat.S_IFMT(mode), "something else")
    raise OSError(errno.EINVAL, f"{kind}, not a regular file; write it to a file first", str(path))


def _readable(file: BinaryIO, path: str | Path) -> BinaryIO:
    """Check the first byte, since kernel files may look regular but be unreadable."""
    try:
        with named_errors(path):
            if file.read(1) is None:
                raise OSError(errno.EAGAIN, "no data is available at once", str(path))
            file.seek(0)
    except OSError:
        file.close()
        raise
    return file


def read_file(path: str | Path, most: int = _MAX_BYTES) -> bytes:
    """Read the bytes of a regular file."""
    with open_file(path) as file:
        if os.fstat(file.fileno()).st_size > most:
            raise OSError(errno.EFBIG, f"more than {most} bytes, the limit for reading at once", str(path))
        with named_errors(path):
            return file.read()


class DataFile:
    """A plain or packed file being read, with its use of the limits."""

    def __init__(self, path: str | Path, fault: Fault = RecordError) -> None:
        self.path, self._fault = Path(path), fault
        self._file = open_file(path)
        self.size = os.fstat(self._file.fileno()).st_size  # on the disk, bytes
        head = self._file.read(4)
        self._file.seek(0)
        self.kind = "gzip" if head[:2] == _GZIP else "zip" if head == _ZIP else ""
        self._unpacked = self._memory = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def pieces(self) -> Iterator[bytes]:
        """Yield its content in pieces, unpacked if gzip."""
        if self.kind != "gzip":
            while piece := self._file.read(_PIECE_BYTES):
                yield piece
            return
        with gzip.open(self._file) as packed:
            yield from self._checked(cast(BinaryIO, packed))

    def read(self) -> bytes:
        """Read the whole content of the file, unpacked; see `pieces`."""
        if self.kind != "gzip" and self.size > _MAX_BYTES:
            raise self._fault(f"{self.path}: {self.size} bytes: at most {_MAX_BYTES} are read at once")
        return b"".join(self.pieces())

    def members(self, suffix: str) -> Iterator[tuple[str, bytes]]:
        """Yield name and content of the files in a zip archive whose names end in *suffix*."""
        try:
            with zipfile.ZipFile(self._file) as archive:
                for each in archive.infolist():
                    if each.filename.lower().endswith(suffix):
                        with archive.open(each) as packed:
                            yield each.filename, b"".join(self._checked(cast(BinaryIO, packed)))
        except _PACKED_FAULTS as error:
            if isinstance(error, ShapegcodeError):
                raise
            raise self._fault(f"{self.path}: the packed file is cut off or damaged: {error}") from error

    def _checked(self, packed: BinaryIO) -> Iterator[bytes]:
        """Yield unpacked pieces and check their size, not trusting sizes in the file."""
        most = min(max(_MAX_RATIO * self.size, _ANY_RATIO_BYTES), _MAX_BYTES if self.kind == "zip" else 2**63)
        while True:
            try:
                piece = packed.read(_PIECE_BYTES)
            except (gzip.BadGzipFile, *_PACKED_FAULTS) as error:
                raise self._fault(f"{self.path}: the packed file is cut off or damaged: {error}") from error
            if not piece:
                return
            self._unpacked += len(piece)
            if self._unpacked > most:
                raise self._fault(
                    f"{self.path}: {self.size} bytes unpack to more than {most}: at most {_MAX_RATIO} times the packed "
                    "size is read; unpack it yourself if that is right"
                )
            yield piece

    def json(self, where: str, data: bytes, constant: Callable[[str], Any] | None = None) -> Any:
        """Parse JSON of this file within the limits."""
        self._memory += len(data) * (3 if data.isascii() else 6)
        self._memory += sum(count * data.count(mark) for mark, count in _MEMORY.items())
        most = max(_MAX_GROWTH * self.size, _ANY_GROWTH_BYTES)
        if self._memory > most:
            raise self._fault(
                f"{where}: its values would take about {self._memory} bytes of memory: at most {most} for a file of "
                f"{self.size} bytes"
            )
        structure = data.replace(b"\\\\", b"").replace(b'\\"', b"")
        longest = max((each.end() - each.start() for each in _STRING.finditer(structure)), default=0)
        if longest > MAX_TEXT_BYTES:
            raise self._fault(f"{where}: a string of {longest} bytes: at most {MAX_TEXT_BYTES} are read")
        structure = _STRING.sub(b"", structure.translate(None, _NOT_STRUCTURE)).translate(_ONE_KIND)
        for _ in range(MAX_DEPTH):  # remove innermost pairs
            structure = structure.replace(b"[]", b"")
        if structure.count(b"[") > MAX_DEPTH or b"[]" in structure:
            raise self._fault(f"{where}: nested too deeply: at most {MAX_DEPTH} levels of lists and objects")

        def integer(digits: str) -> int:
            if len(digits) > 20 or abs(int(digits)) > _MAX_INTEGER:
                shown = digits if len(digits) <= 24 else f"{digits[:12]}... ({len(digits)} digits)"
                must = f"must be from -{_MAX_INTEGER} to {_MAX_INTEGER}"
                raise self._fault(f"{where}: the whole number {shown}: {must}")
            return int(digits)

        parse_int = integer if re.search(rb"\d{19}", data) else None
        return json.loads(data.decode("utf-8-sig"), parse_int=parse_int, parse_constant=constant)


def toml_tables(text: str) -> dict[str, Any]:
    """Parse TOML within the limits."""
    if len(text) > MAX_SETTINGS_BYTES:
        raise ValueError(f"more than {MAX_SETTINGS_BYTES} characters, the limit of a TOML file")
    if found := _LONG_KEY.search(text):
        line = text.count("\n", 0, found.start()) + 1
        raise ValueError(f"a key of more than {MAX_DEPTH} parts (at line {line}, column 1)")
    too_deep = f"nested too deeply: at most {MAX_DEPTH} lists and tables within each other"
    try:
        tables = tomllib.loads(text)
    except RecursionError:
        raise ValueError(too_deep) from None
    waiting: list[tuple[Any, int]] = [(tables, 1)]
    while waiting:
        value, depth = waiting.pop()
        if isinstance(value, dict | list):
            if depth > MAX_DEPTH:
                raise ValueError(too_deep)
            waiting += [(each, depth + 1) for each in (value.values() if isinstance(value, dict) else value)]
            if isinstance(value, dict) and any(len(key) > MAX_TEXT_BYTES for key in value):
                raise ValueError(f"a key of more than {MAX_TEXT_BYTES} characters")
        elif isinstance(value, str) and len(value) > MAX_TEXT_BYTES:
            raise ValueError(f"a string of {len(value)} characters: at most {MAX_TEXT_BYTES} are read")
        elif isinstance(value, int) and abs(value) > _MAX_INTEGER:
            digits = str(value) if abs(value) < 10**40 else f"of some {value.bit_length() * 3 // 10} digits"
            raise ValueError(f"the whole number {digits}: must be from -{_MAX_INTEGER} to {_MAX_INTEGER}")
    return tables


def toml_value(text: str) -> Any:
    """Parse one value of TOML within the limits."""
    return toml_tables(f"value = {text}")["value"]


_passing = False
_LONGEST_NAME = 200  # longest used part of a file name, to leave space for a suffix


def write_in_passing() -> None:
    """Disable fsync in this process, whose files another process reads at once and stores."""
    global _passing  # noqa: PLW0603 - of the whole process, which has no other use
    _passing = True


_TEMPORARY = re.compile(r"\..+\.[0-9a-f]+\.tmp")  # names of earlier versions have decimal digits only


@contextlib.contextmanager
def named_errors(path: str | Path) -> Iterator[None]:
    """Name *path* in file system errors: a failed write() names no file, others may name a temporary one."""
    try:
        yield
    except OSError as error:
        raise type(error)(error.errno or errno.EIO, error.strerror or str(error), str(path)) from error


@contextlib.contextmanager
def replaced_file(path: str | Path) -> Iterator[BinaryIO]:
    """A stream whose content replaces a file when the block ends without an error; a device is written directly."""
    target = _target_of(path)
    if target.exists() and not stat.S_ISREG(target.stat().st_mode):
        with open(target, "wb") as stream:
            yield stream
        return
    mode = stat.S_IMODE(target.stat().st_mode) if target.exists() else None
    # No process ID: it repeats in containers and is shared by threads. See is_temporary.
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
    """The path with symbolic links resolved; raises for a loop of links."""
    target = Path(os.path.realpath(path))
    if target.is_symlink():  # realpath fails only for a loop of links
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(path))
    return target


def is_temporary(path: str | Path) -> bool:
    """Whether a file has the name of a temporary one, which remains if its process is killed."""
    return _TEMPORARY.fullmatch(Path(path).name) is not None


def write_text(path: str | Path, text: str, *, overwrite: bool = True) -> None:
    """Write a UTF-8 file atomically: complete or unchanged; line ends as given."""
    write_bytes(path, _encoded(text), overwrite=overwrite)


def _encoded(text: str) -> bytes:
    """Encode as UTF-8; undecodable bytes of file names become JSON escapes."""
    return text.encode(errors="backslashreplace")


def write_lines(path: str | Path, lines: Iterable[str]) -> None:
    """Like `write_text`, from an iterator of lines; ``-`` is standard output."""
    if path == "-":
        sys.stdout.writelines(lines)
        return
    with named_errors(path), replaced_file(path) as stream:
        for line in lines:
            stream.write(_encoded(line))


def write_bytes(path: str | Path, data: bytes | memoryview, *, overwrite: bool = True) -> None:
    """Like :func:`write_text`, for bytes."""
    with named_errors(path):
        if overwrite:
            with replaced_file(path) as stream:
                stream.write(data)
            return
        target = _target_of(path)
        with open(target, "xb") as stream:
            try:
                stream.write(data)
                stream.flush()
            except BaseException:
                target.unlink(missing_ok=True)
                raise
