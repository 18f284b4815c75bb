"""Lines of a text file of any length in bounded memory: plain or packed by gzip, UTF-8 or UTF-16."""

from __future__ import annotations

import codecs
from collections.abc import Iterator
from pathlib import Path

from shapegcode.errors import RecordError
from shapegcode.io.cells import refuse_binary
from shapegcode.io.data_file import MAX_TEXT_BYTES, DataFile

__all__ = ["chunks", "head_of", "line_chunks"]

_HEAD_BYTES = 65_536


def chunks(path: Path) -> Iterator[bytes]:
    """Pieces of a file as UTF-8, without a byte order mark."""
    decoder: codecs.IncrementalDecoder | None = None
    first = True
    with DataFile(path) as file:
        for raw in file.pieces():
            piece = raw
            if first and piece[:2] in {codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE}:
                decoder = codecs.getincrementaldecoder("utf-16")(errors="replace")
            if decoder is not None:
                piece = decoder.decode(piece).encode("utf-8")
            if first:
                piece = piece.removeprefix(codecs.BOM_UTF8)
            first = False
            yield piece


def line_chunks(path: Path) -> Iterator[list[bytes]]:
    """The lines of a file, many at a time, without their ends."""
    rest = b""
    for piece in chunks(path):
        lines = (rest + piece).split(b"\n")
        rest = lines.pop()
        if len(rest) > MAX_TEXT_BYTES:
            raise RecordError(f"{path}: a line of more than {MAX_TEXT_BYTES} bytes: no text with lines")
        yield lines
    if rest:
        yield [rest]


def head_of(path: Path) -> bytes:
    """The beginning of a file."""
    head = next(chunks(path), b"")[:_HEAD_BYTES]
    if not head.strip():
        raise RecordError(f"{path}: the file is empty; needed is the log of a run")
    if head[:4] != b"PK\x03\x04":
        refuse_binary(path, head, "a log of a run: SHDR text, MTConnect streams, Sinumerik Edge JSON or a table")
    return head
