"""The header of an emitted program: written by the converter, read by all commands that get such a program.

Its cautions, each a sentence and a comment, are also used in reports, pages and test cuts.

(SHAPEGCODE 0.1.0 MACHINE VX500)
(VERDICT WITHIN TOLERANCE       )    or (BETTER - TOLERANCE NOT MET     )
(CHECKSUM 8A1F00C3)
(MODE X 46 HZ 0.02)
(BLOCK PERIOD 5 MS SHAPER 20 MS ZVD)
(SET FEED OVERRIDE 100 PCT)
(NO SINGLE BLOCK IN SHAPED CUTS)
(RESTART ONLY AFTER COMMENT SHAPED OR AT N IN RESTART LIST)
(FIRST RUN ABOVE THE PART WITHOUT TOOL)
(TIME CONSTANT AFTER INTERPOLATION 0 MS)

It contains only capitals, digits, spaces, points and minus signs, which any control keeps in a comment.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from shapegcode import _core


@dataclass(frozen=True)
class Habit:
    """One caution."""

    topic: str  # topic in a word or two
    comment: str  # for programs: capitals, 60 characters at most
    sentence: str  # the same as a sentence


OVERRIDE = Habit(
    "override",
    "SET FEED OVERRIDE 100 PCT",
    "feed override 100 %: any other setting changes the time of every block, and the blocks no longer fit the modes",
)
OVERRIDE_LOCKED = Habit(
    "override",
    "FEED OVERRIDE IS OFF IN SHAPED MOVES",
    "the program switches the feed override off in shaped moves and on again after them; in these moves only feed hold "
    "works",
)
OVERRIDE_ANY = Habit(
    "override",
    "BLOCKS OF ONE DURATION FOR ANY FEED OVERRIDE",
    "blocks of one duration: another feed override scales all of them alike; vibration is lowest at 100 %",
)
OVERRIDES = {"ask": OVERRIDE, "lock": OVERRIDE_LOCKED, "any": OVERRIDE_ANY}
"""Comment in the header by `emission.override`."""
SINGLE_BLOCK = Habit(
    "single block",
    "NO SINGLE BLOCK IN SHAPED CUTS",
    "no single block inside of shaped cuts: the control would stop at every block, some milliseconds apart; "
    "between the cuts it may be used; to check the program: graphic display, machine lock, or dry run above the part, "
    "then the first run above the part",
)
FEED_HOLD = Habit(
    "feed hold",
    "AFTER FEED HOLD RESUME AT 100 PCT",
    "feed hold is safe; the machine may vibrate once, since the control decelerates with its own acceleration; cycle "
    "start resumes the program",
)
RESTART = Habit(
    "restart",
    "RESTART ONLY AFTER COMMENT SHAPED OR AT N IN RESTART LIST",
    "restart only where a cut begins, or at a restart point, with its tool, H, coordinate system and spindle speed in "
    "force and the tool above its start: other blocks of a shaped cut are not valid restart points",
)
FIRST_RUN = Habit(
    "first run",
    "FIRST RUN ABOVE THE PART WITHOUT TOOL",
    "first run above the part: shift Z of the work offset by more than the deepest cut, no tool, spindle off, rapid "
    "override 25 %, feed override 100 %",
)


def no_room(room_bytes: int) -> str:
    """Remedy for a shaped program that exceeds the memory of the control."""
    return f"convert the original with --max-bytes {room_bytes}; or memory card, data server or drip feed (DNC)"


REGION_MARK = "(SHAPED)"  # comment before each shaped region

RAPID_MARK = "(SHAPED RAPID)"  # comment before shaped blocks that replace a rapid

STAMP_BEGIN = b"(SHAPEGCODE "  # start of the header

_WIDTH = 60
# Equal lengths, so that the verdict can be replaced in place; so can the checksum.
_PENDING, _GOOD, _BETTER, _BAD = (
    b"(VERDICT PENDING                )",
    b"(VERDICT WITHIN TOLERANCE       )",
    b"(BETTER - TOLERANCE NOT MET     )",
    b"(OUT OF TOLERANCE - DO NOT RUN  )",
)
_NO_MARK = "0" * 8
MARK_PENDING = f"(CHECKSUM {_NO_MARK})".encode()
_COMMENT = re.compile(rb"\(([^()\r\n]*)\)[ \t]*[\r\n]*")
# Parts that a control or editor may change without effect: comments, blanks, %; then N and O words.
_ANY_COMMENT = re.compile(rb"\([^()\r\n]*\)")
_BLANKS = b" \t%"
_CAPITALS = bytes(range(256)).upper()
_CHUNK = 1 << 20  # bytes per step, to avoid a second copy of a long program
_LINE_HEAD = re.compile(rb"(\n(?:/\d?)?)(?:N\d+(?:[O:]\d+)?|[O:]\d+)")


@dataclass(frozen=True)
class Stamp:
    """Data in the header of an emitted program; `lines` reduces all text to the characters of a comment."""

    version: str  # version of shapegcode
    machine: str  # name of the machine
    modes: tuple[str, ...]  # such as "X 46 HZ 0.02", in the order of the machine file
    block_period_ms: str  # period of the shaped blocks
    shaper_ms: str  # duration of the shaper
    family: str  # family of the shaper; empty: not stated
    own_filter: str  # the control's own filter for shaped blocks, such as "24 MS" or "48 MS BELL 24 MS"
    mark: str = _NO_MARK  # checksum of the program, see `text_mark`; eight zeros: not yet known
    override: str = "ask"  # key of `OVERRIDES` for the text
    notes: tuple[str, ...] = ()  # further lines

    def lines(self) -> list[str]:
        """Lines of the header, with pending verdict."""
        first, *rest = (
            f"({plain_comment(line)[:_WIDTH]})"
            for line in (
                f"SHAPEGCODE {self.version} MACHINE {self.machine}",
                f"CHECKSUM {self.mark}",
                *(f"MODE {mode}" for mode in self.modes),
                f"BLOCK PERIOD {self.block_period_ms} MS SHAPER {self.shaper_ms} MS {self.family}".rstrip(),
                *self.notes,
                *(habit.comment for habit in (OVERRIDES[self.override], SINGLE_BLOCK, RESTART, FIRST_RUN)),
                f"TIME CONSTANT AFTER INTERPOLATION {self.own_filter}",
            )
        )
        return [first, _PENDING.decode(), *rest]

    def difference(self, other: Stamp) -> str:
        """First difference between the machines of two headers, as text; empty: nothing relevant differs."""
        pairs = (
            ("machine", self.machine, other.machine),
            ("modes", ", ".join(self.modes) or "none", ", ".join(other.modes) or "none"),
            ("time constant after interpolation", self.own_filter, other.own_filter),
        )
        for name, ours, theirs in pairs:
            if _shown(ours) != _shown(theirs):
                return f"{name}: {_shown(ours)} in the program, {_shown(theirs)} here"
        return ""


def _shown(text: str) -> str:
    # In the form of a comment.
    return plain_comment(text)[: _WIDTH // 2]


def plain_comment(text: str) -> str:
    """Reduce a text to the characters of FANUC comments: capitals, digits and plain signs."""
    return "".join(c if c.isalnum() or c in " .-" else " " for c in text.upper())


def stamp_of(text: bytes) -> Stamp | None:
    """Parse the header of an emitted program, without its cautions and notes; None without a header."""
    begin = text.find(STAMP_BEGIN)
    if begin < 0:
        return None
    lines = []
    while match := _COMMENT.match(text, begin):
        lines.append(match[1].decode("latin-1").strip())
        begin = match.end()

    def found(pattern: str) -> list[re.Match[str]]:
        return [match for line in lines if (match := re.fullmatch(pattern, line))]

    head = found(r"SHAPEGCODE (\S+) MACHINE (.*)")
    period = found(r"BLOCK PERIOD (\S+) MS SHAPER (\S+) MS ?(.*)")
    if not head or not period:
        return None
    mark, constant = found(r"(?:CHECKSUM|TEXT) ([0-9A-F]{8})"), found(r"TIME CONSTANT AFTER INTERPOLATION (.*)")
    return Stamp(
        version=head[0][1],
        machine=head[0][2],
        modes=tuple(mode[1] for mode in found(r"MODE (.*)")),
        block_period_ms=period[0][1],
        shaper_ms=period[0][2],
        family=period[0][3],
        own_filter=constant[0][1] if constant else "",
        mark=mark[0][1] if mark else _NO_MARK,
    )


def text_mark(text: bytes) -> str:
    """Checksum of the motion and functions of a program: eight hexadecimal digits.

    Comments, blanks, kinds of line end, N words, the program's number and `%` are ignored, as a control or an
    editor may change them.
    """
    return _mark_of(_chunks(len(text), text.find, lambda begin, end: text[begin:end]))


def _mark_of(chunks: Iterable[bytes]) -> str:
    """Checksum of a text in chunks of whole lines; ignored parts never span a line end."""
    mark, is_first = 0, True
    for chunk in chunks:
        kept = _what_counts(chunk)
        if kept:
            mark = zlib.crc32(kept if is_first else b"\n" + kept, mark)
            is_first = False
    return f"{mark:08X}"


def _what_counts(lines: bytes) -> bytes:
    """Remove ignored parts from whole lines, with LF between them and no empty ones; fast for a million lines."""
    if b"(" in lines:
        lines = _ANY_COMMENT.sub(b"", lines)
    if not lines.isupper() or any(blank in lines for blank in _BLANKS):
        lines = lines.translate(_CAPITALS, _BLANKS)
    kept = _one_end(b"\n" + lines)
    if b"N" in kept or b"O" in kept or b":" in kept:
        kept = _one_end(_LINE_HEAD.sub(rb"\1", kept))
    return kept.strip()


def _one_end(text: bytes) -> bytes:
    if b"\r" in text:
        text = text.replace(b"\r", b"\n")
    while b"\n\n" in text:
        text = text.replace(b"\n\n", b"\n")
    return text


def text_with_verdict(text: bytes, *, good: bool, better: bool) -> bytes:
    """Write verdict and checksum into the header of an emitted program."""
    changes = verdict_changes(text.find, text_mark(text), good=good, better=better)
    if not changes:
        return text
    changed = bytearray(text)
    for begin, after in changes:
        changed[begin : begin + len(after)] = after
    return bytes(changed)


def mark_of(program: _core.ProgramText) -> str:
    """Checksum of a program that was read; see `text_mark`."""
    return _mark_of(whole_lines(program))


def verdict_changes(find: Callable[[bytes], int], mark: str, *, good: bool, better: bool) -> list[tuple[int, bytes]]:
    """Verdict and checksum in the header: position and new bytes of each, which overwrite the same number of bytes."""
    open_ones = (_PENDING,) if good else (_PENDING, _GOOD, _BETTER)
    verdicts = [(before, _BAD if not good else _BETTER if better else _GOOD) for before in open_ones]
    wanted = [*verdicts, (MARK_PENDING, f"(CHECKSUM {mark})".encode())]
    return [(begin, after) for before, after in wanted if (begin := find(before)) >= 0]


def whole_lines(program: _core.ProgramText) -> Iterator[bytes]:
    """Yield the text of a program in chunks of whole lines."""
    return _chunks(program.size, program.find, program.slice)


def _chunks(size: int, find: Callable[[bytes, int], int], part: Callable[[int, int], bytes]) -> Iterator[bytes]:
    end = 0
    while end < size:
        begin, end = end, 1 + find(b"\n", end + _CHUNK) or size
        yield part(begin, end)
