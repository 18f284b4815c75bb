"""Reads the record of a tap test or of a decay, whatever file it is in."""

from __future__ import annotations

from pathlib import Path

from shapegcode.errors import RecordError
from shapegcode.io.data_file import open_file
from shapegcode.io.frequency_response import FrequencyResponse
from shapegcode.io.record import ReadOptions, Record

_BYTES_TO_KNOW = 4096
_WAV = (b"RIFF", b"RIFX", b"RF64")
_NO_TEXT = (".uff", ".unv", ".uf", ".uf58", ".wav", ".wave")


def read_records(path: str | Path, options: ReadOptions | None = None) -> list[Record]:
    """Read a file: CSV or other text columns, UFF (dataset 58, text or binary) or WAV, told apart by its content."""
    path = Path(path)
    options = options or ReadOptions()
    head = _head(path)
    if head[:4] in _WAV:
        from shapegcode.io.wav import read_wav

        if options.force_sensitivity or options.response_sensitivity:
            raise RecordError(
                f"{path}: a WAV file does not say what its full scale is in volts: state N and m/s² at full scale "
                "(--force-scale, --response-scale)"
            )

        return read_wav(path, options)
    if _is_uff(head):
        from shapegcode.io.uff import read_uff

        return read_uff(path, options)
    for suffixes, kind in (({".uff", ".unv", ".uf", ".uf58"}, "UFF"), ({".wav", ".wave"}, "WAV")):
        if path.suffix.lower() in suffixes:
            begins = "'    -1' (start of a dataset)" if kind == "UFF" else "'RIFF'"
            raise RecordError(
                f"{path}: not a {kind} file: it begins with {head[:16]!r} instead of {begins}; rename it if it is text "
                "with columns"
            )
    from shapegcode.io.taps import is_klipper, klipper_options, read_csv

    return read_csv(path, klipper_options(options) if is_klipper(head) else options)


def read_measurement(path: str | Path, options: ReadOptions | None = None) -> list[Record] | list[FrequencyResponse]:
    """Read a file, whether it holds records over time or a frequency response without them."""
    path = Path(path)
    options = options or ReadOptions()
    head = _head(path)
    from shapegcode.io.frf_mat import is_mat, read_frf_mat

    if is_mat(path, head):
        return read_frf_mat(path, options)
    if _is_uff(head):
        from shapegcode.io.frf_uff import is_frf_uff, read_frf_uff

        return read_frf_uff(path, options) if is_frf_uff(path, options) else read_records(path, options)
    if head[:4] not in _WAV and path.suffix.lower() not in _NO_TEXT:
        from shapegcode.io.frf_text import is_frf_text, read_frf_text

        if is_frf_text(path, options):
            return read_frf_text(path, options)
    return read_records(path, options)


def _head(path: Path) -> bytes:
    """The first bytes of a file that is one."""
    with open_file(path) as file:
        head = file.read(_BYTES_TO_KNOW)
    if not head.strip():
        raise RecordError(f"{path}: the file is empty; a record of time, force and acceleration is needed")
    return head


def _is_uff(head: bytes) -> bool:
    plain = head.lstrip(b"\r\n")
    return plain[:6] == b"    -1" and plain[6:7] in {b"\r", b"\n", b" "}
