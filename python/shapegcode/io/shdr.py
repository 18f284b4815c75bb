"""Reads SHDR, the text that adapters of MTConnect send: ``time|item|value``, also several ``|item|value`` in a line.

Source of the format: MTConnect Institute, C++ Agent, "Adapter Agent Protocol Version 2.0".
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from shapegcode.errors import RecordError
from shapegcode.io.run_items import Item, ItemTable
from shapegcode.io.run_notes import Event, FileNotes
from shapegcode.io.stamps import Stamps
from shapegcode.io.text_lines import line_chunks

__all__ = ["shdr_events"]

_CONDITION = {b"normal", b"warning", b"fault", b"unavailable"}
_CONDITION_FIELDS = 6
_MARK = b"--multiline--"


def shdr_events(path: Path, table: ItemTable, notes: FileNotes) -> Iterator[Event]:
    """The values of the items that are used."""
    known: dict[bytes, Item | None] = {}
    seconds = Stamps().seconds
    number, readable = 0, False
    odd = _Odd(path, table, notes, known)
    for lines in line_chunks(path):
        for number, line in enumerate(lines, start=number + 1):  # noqa: B020  (goes on over the chunks)
            fields = line.split(b"|")
            if len(fields) != 3 or odd.until:
                pairs = odd.pairs(number, line, fields)
            elif fields[1] in known:
                item = known[fields[1]]
                if item is not None:  # nearly every line: kept short
                    try:
                        time = seconds(fields[0])
                    except ValueError:
                        odd.leave_out(number, fields[0])
                        continue
                    readable = True
                    yield number, time, fields[0], item, fields[2]
                continue
            else:
                pairs = odd.one(fields)
            for item, text in pairs:
                try:
                    time = seconds(fields[0])
                except ValueError:
                    odd.leave_out(number, fields[0])
                    break
                readable = True
                yield number, time, fields[0], item, text
    odd.end(readable)


class _Odd:
    """Lines that are not one item and its value."""

    def __init__(self, path: Path, table: ItemTable, notes: FileNotes, known: dict[bytes, Item | None]) -> None:
        self._path = path
        self._table = table
        self._notes = notes
        self._known = known
        self.until = b""  # ends what goes over several lines
        self._began = 0
        self._unreadable = ""

    def one(self, fields: list[bytes]) -> tuple[tuple[Item, bytes], ...]:
        """(item, value) of a line with an item that was not met so far; none of one of no use."""
        item = self._find(fields[1])
        return () if item is None else ((item, fields[2]),)

    def leave_out(self, number: int, stamp: bytes) -> None:
        """A line of which the time stamp cannot be read."""
        shown = stamp[:40].decode("latin-1")
        self._unreadable = self._unreadable or f"{self._path}:{number}: {shown!r} is no time stamp"
        self._notes.add("stamp", number, f"{shown!r} is no time stamp, the line is left out")

    def end(self, readable: bool) -> None:
        """The end of the file; *readable*: some time stamp could be read."""
        if self._unreadable and not readable:
            raise RecordError(f"{self._unreadable}; needed is for example 2017-02-10T18:33:01.138Z")
        if self.until:
            raise RecordError(
                f"{self._path}:{self._began}: the asset that begins here does not end: no line is "
                f"{self.until[:40].decode('latin-1')!r}, so that nothing behind it can be read; take it out"
            )

    def _find(self, name: bytes) -> Item | None:
        """What an item is; kept for the next time, with a limit for what is no log."""
        item = self._table.find(name.decode("utf-8", errors="replace").strip())
        if len(self._known) < 10_000:
            self._known[name] = item
        return item

    def pairs(self, number: int, line: bytes, fields: list[bytes]) -> tuple[tuple[Item, bytes], ...]:
        """(item, value) of a line with several of them; none of everything else, which is noted."""
        if self.until:
            if line.strip() == self.until:
                self.until = b""
            return ()
        if not line.strip() or line.startswith((b"*", b"#")):
            return ()
        rest = fields[1:]
        if rest and rest[0].strip().startswith(b"@"):  # @ASSET@, @REMOVE_ASSET@
            if _MARK in line:
                self.until, self._began = line[line.index(_MARK) :].strip(), number
            self._notes.add("asset", number, "an asset, left out")
        elif len(rest) == _CONDITION_FIELDS and rest[1].strip().lower() in _CONDITION and self._find(rest[2]) is None:
            self._notes.add("condition", number, f"the condition {rest[0].decode('latin-1')}, left out")
        elif len(rest) < 2 or len(rest) % 2:
            self._notes.add("odd", number, f"{line[:60].strip().decode('latin-1')!r} is not time|item|value, left out")
        else:
            found = ((self._find(name), text) for name, text in zip(rest[::2], rest[1::2], strict=True))
            return tuple((item, text) for item, text in found if item is not None)
        return ()
