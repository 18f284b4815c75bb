"""Of what a result was made: the command, the files with their hashes, the version; so that it can be found again."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from shapegcode.io.data_file import open_file

FORMAT = 1
"""Of the JSON of results: raised where an older file can no longer be read."""

_PIECE_BYTES = 1 << 20


@dataclass(frozen=True)
class MadeFile:
    """A file that was read or written.

    Attributes:
        role: what it was for: "input", "machine", "output" and so on.
        name: as it was given.
        sha256: of its bytes; empty: it could not be read again.
        size_bytes: how many it has.
    """

    role: str
    name: str
    sha256: str
    size_bytes: int

    @classmethod
    def of(cls, role: str, name: str | Path, content: bytes | memoryview | None = None) -> MadeFile:
        """Of a file, or of what is about to be written into it."""
        if content is not None:
            import hashlib

            return cls(role, str(name), hashlib.sha256(content).hexdigest(), len(content))
        try:
            sha256, size = file_hash(name)
        except OSError:
            return cls(role, str(name), "", 0)
        return cls(role, str(name), sha256, size)


@dataclass(frozen=True)
class Made:
    """Of what a result was made.

    Attributes:
        result: name of its class.
        by: "shapegcode" and its version.
        format: see `FORMAT`.
        command: as it was typed, or the same for one program of several.
        files: read and written.
    """

    result: str
    by: str
    format: int
    command: str
    files: tuple[MadeFile, ...]

    def file(self, role: str) -> MadeFile | None:
        """The file with a role."""
        return next((each for each in self.files if each.role == role), None)


def file_hash(name: str | Path) -> tuple[str, int]:
    """SHA-256 of a file, and its size."""
    import hashlib

    digest, size = hashlib.sha256(), 0
    with open_file(name) as stream:
        while piece := stream.read(_PIECE_BYTES):
            digest.update(piece)
            size += len(piece)
    return digest.hexdigest(), size


@cache
def this_version() -> str:
    """ "shapegcode" and its version."""
    from importlib import metadata  # slow to load, and wanted where a file is written only

    try:
        return f"shapegcode {metadata.version('shapegcode')}"
    except metadata.PackageNotFoundError:
        return "shapegcode (not installed)"
