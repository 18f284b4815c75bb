"""Reads the record of a tap test or of a decay, whatever file it is in."""

from __future__ import annotations

from pathlib import Path

from shapegcode.errors import RecordError
from shapegcode.io.options import ReadOptions
from shapegcode.io.record import Record

__all__ = ["ReadOptions", "read_records"]

_BYTES_TO_KNOW = 4096


def read_records(path: str | Path, options: ReadOptions | None = None) -> list[Record]:
    """Read a file: CSV or other text columns, UFF (dataset 58, text or binary) or WAV, told apart by its content.

    Args:
        path: of the file.
        options: what the file does not say.

    Returns:
        One record per response and measurement; recordings with several hits are not divided (`checks.split_hits`).

    Raises:
        RecordError: what was found and what is needed, with line and text of the cell where it is a text file.
        OSError: the file cannot be read.
    """
    path = Path(path)
    options = options or ReadOptions()
    if path.exists() and not path.is_file():
        raise RecordError(f"{path}: not a regular file")
    with path.open("rb") as file:
        head = file.read(_BYTES_TO_KNOW)
    if not head.strip():
        raise RecordError(f"{path}: the file is empty; a record of time, force and acceleration is needed")
    if head[:4] in {b"RIFF", b"RIFX", b"RF64"}:
        from shapegcode.io.wav import read_wav

        return read_wav(path, options)
    if head.lstrip(b"\r\n")[:6] == b"    -1" and (head.lstrip(b"\r\n")[6:7] in {b"\r", b"\n", b" "}):
        from shapegcode.io.uff import read_uff

        return read_uff(path, options)
    for suffixes, kind in (({".uff", ".unv", ".uf", ".uf58"}, "UFF"), ({".wav", ".wave"}, "WAV")):
        if path.suffix.lower() in suffixes:
            begins = "'    -1' (start of a dataset)" if kind == "UFF" else "'RIFF'"
            raise RecordError(
                f"{path}: not a {kind} file: it begins with {head[:16]!r} instead of {begins}; rename it if it is text "
                "with columns"
            )
    from shapegcode.io.taps import read_csv

    return read_csv(path, options)
