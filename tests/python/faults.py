"""Faults for tests: commands with their memory and time, files that are none, bombs, changed bytes."""

import dataclasses
import gzip
import io
import os
import random
import signal
import struct
import subprocess
import sys
import threading
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

#: Valid answers for `setup`.
ANSWERS = """\
name = "VMC-3"
rapid_mm_per_min = { x = 24000, y = 24000, z = 18000 }
delivery = "dnc"
dnc_baud = 9600
look_ahead = "G05.1"
contour_um = 15
modes = { x = "46:0.02", z = "rigid" }
"""
MAX_BYTES = 1 << 30
MAX_CPU_S = 10.0
_WAIT_S = 120.0  # nothing is this slow: who still runs then, waits


@dataclasses.dataclass(frozen=True)
class Done:
    """A command that has ended: with what, and what it took."""

    code: int
    said: str
    cpu_s: float
    peak_bytes: int


def hear_ctrl_c() -> None:
    """A process that was started in the background ignores Ctrl-C, and so do its children: undone for one."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def command(
    folder: Path,
    *words: str | Path,
    start: Callable[[], None] | None = None,
    python: Sequence[str] = ("-m", "shapegcode"),
) -> Done:
    """The command as a process of its own; killed where it waits."""
    out = folder / ".said"
    with out.open("wb") as stream:
        process = subprocess.Popen(
            [sys.executable, *python, *words],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=stream,
            stderr=stream,
            preexec_fn=start or hear_ctrl_c,  # noqa: PLW1509 - before the timer's thread is there
        )
    timer = threading.Timer(_WAIT_S, process.kill)
    timer.start()
    _, status, used = os.wait4(process.pid, 0)
    timer.cancel()
    process.returncode = os.waitstatus_to_exitcode(status)
    said = out.read_text(errors="replace")
    out.unlink()
    return Done(process.returncode, said, used.ru_utime + used.ru_stime, used.ru_maxrss * 1024)


def sound(done: Done, *parts: str, code: int = 2) -> None:
    """Refused in words, within the limits; `parts` stand in the words."""
    assert done.code == code, (done.code, done.said[-3000:])
    assert "Traceback" not in done.said and "Warning:" not in done.said, done.said[-3000:]
    assert len(done.said) < 20_000, done.said[:500]
    assert done.peak_bytes < MAX_BYTES, f"{done.peak_bytes / 2**20:.0f} MB"
    assert done.cpu_s < MAX_CPU_S, f"{done.cpu_s:.1f} s"
    for part in parts:
        assert part in done.said, done.said


def changed(seed: bytes, draw: random.Random) -> bytes:
    """A valid file with something wrong in it: bits, bytes, pieces, numbers, its end."""
    data = bytearray(seed)
    for _ in range(draw.choice((1, 1, 1, 1, 2, 8))):
        at, end = draw.randrange(len(data) + 1), draw.randrange(len(data) + 1)
        match draw.choices(range(8), (3, 2, 1, 1, 2, 6, 1, 1))[0]:
            case 0 if data:
                data[min(at, len(data) - 1)] ^= 1 << draw.randrange(8)
            case 1:
                data[at : at + 1] = draw.randbytes(draw.choice((1, 4, 8)))
            case 2:
                del data[at : at + draw.choice((1, 4, 100, 10_000))]
            case 3:
                data[at:at] = data[end : end + draw.choice((1, 16, 1000))]
            case 4:
                data[at : at + 4] = struct.pack(draw.choice("<>") + "I", draw.choice(_SIZES))
            case 5:
                digits = [place for place, byte in enumerate(data[:200_000]) if 48 <= byte < 58]
                if digits:
                    place = draw.choice(digits)
                    data[place : place + 1] = draw.choice(_NUMBERS)
            case 6:
                data[at:at] = draw.choice(_PIECES)
            case _:
                del data[at:]
    return bytes(data)


_SIZES = (0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0xFFFFFFFE, 255, 65536, 1 << 24)
_PLAIN = b"-1 1e308 1e999 nan -0 0 7 12.5 0x1 \xc2\xb2 1.2.3"
_NUMBERS = (b"9" * 400, b"1" * 5000, b"", *_PLAIN.split(b" "))
_LONG = (b"[" * 2000, b"{" * 2000, b"a." * 3000, b";" * 5000, b"\xff\xfe")
_PIECES = (*_LONG, *(bytes([one]) for one in b'\0"<&\n\r]'))


def _packed(head: bytes, piece: bytes, megabytes: int, tail: bytes = b"") -> bytes:
    """Gzip members one behind the other, so that this process stays small."""
    middle = gzip.compress(piece * ((1 << 20) // len(piece)))
    return gzip.compress(head) + middle * megabytes + gzip.compress(tail)


def _false_sizes() -> bytes:
    """A zip whose entry states 100 bytes and unpacks to a gigabyte."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("a.json", "w") as member:
        for _ in range(1024):
            member.write(b" " * (1 << 20))
    data = bytearray(stream.getvalue())
    at = data.index(b"PK\x01\x02")
    data[at + 24 : at + 28] = struct.pack("<I", 100)
    data[22:26] = struct.pack("<I", 100)
    return bytes(data)


_XML = b'<?xml version="1.0"?><MTConnectStreams><Header instanceId="1"/><Streams>'
RECORD_BOMBS: dict[str, tuple[str, Callable[[], bytes]]] = {
    "nested lists": ("a.json.gz", lambda: _packed(b'{"Header": ', b"[", 1000)),
    "flat lists": ("a.json.gz", lambda: _packed(b'{"Header": {}, "Payload": [', b"[],", 300, b"0]}")),
    "plain nested lists": ("a.json", lambda: b'{"Header": ' + b"[" * 3_000_000),
    "plain flat lists": ("a.json", lambda: b'{"Header": {}, "Payload": [' + b"{}," * 3_000_000 + b"0]}"),
    "one text": ("a.json", lambda: b'{"Header": {"Format": "' + b"A" * 3_000_000 + b'"}}'),
    "false sizes": ("a.zip", _false_sizes),
    "nested elements": ("a.xml.gz", lambda: _packed(_XML, b"<a>", 1000)),
    "endless text": ("a.xml.gz", lambda: _packed(_XML + b"<Line>", b"A", 1000)),
    "endless tag": ("a.xml.gz", lambda: _packed(_XML + b'<Line a="', b"A", 1000)),
    "endless spaces": ("a.txt.gz", lambda: _packed(b"", b" ", 1000)),
    "endless line": ("a.csv.gz", lambda: _packed(b"time,line\n", b"1,", 1000)),
}
TOML_BOMBS: dict[str, bytes] = {
    "long key": b"a." * 500_000 + b"a = 1",
    "long table": b"[" + b"a." * 500_000 + b"a]",
    "inline key": b"b = {" + b"a . " * 500_000 + b"a = 1}",
    "nested lists": b"a = " + b"[" * 1_000_000,
    "a hundred lists": b"a = " + b"[" * 100 + b"]" * 100,
    "nested tables": b"a = " + b"{a = " * 300_000,
    "one text": b'name = "' + b"A" * 3_000_000 + b'"',
    "one name": b"A" * 3_000_000 + b" = 1",
    "400 digits": b"n = 1" + b"0" * 400,
    "5000 digits": b"n = 1" + b"0" * 5000,
    "many keys": b"".join(b"k%d = 1\n" % k for k in range(200_000)),
    "many tables": b"".join(b"[t%d]\n" % k for k in range(200_000)),
}
