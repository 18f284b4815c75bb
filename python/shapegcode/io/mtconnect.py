"""Reads answers of MTConnect agents to `sample` and `current` (MTConnectStreams), and data of adapters (SHDR).

Sources of the formats: MTConnect Institute, MTConnect Standard, Part 1 and Part 3 (streams), versions 1.0 to 2.x;
C++ Agent, "Adapter Agent Protocol Version 2.0": ``time|item|value``, also several ``|item|value`` in a line.
"""

import operator
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

from shapegcode.errors import RecordError
from shapegcode.io.data_file import MAX_DEPTH, MAX_TEXT_BYTES
from shapegcode.io.run_items import Event, FileNotes, Item, ItemTable, Stamps
from shapegcode.io.table import chunks, line_chunks

_MAX_OBSERVATIONS = 1_000_000  # the size of an agent's largest buffer
_MAX_ITEMS = 100_000
#: Sub-types whose value is not the machine's actual one.
_LEFT_OUT = {"COMMANDED", "PROGRAMMED", "JOG", "TARGET", "PROBE", "INCREMENTAL", "SCHEDULE", "OVERRIDE"}
_AXES = ("X", "Y", "Z")
_BEGIN = re.compile(rb"<\?xml\s|<(?:\w+:)?MTConnect(?:Streams|Devices|Error|Assets)\b")
_OVERLAP = 80  # bytes for a document's declaration, or the beginning of its root
_FEED_UNIT = "mm/s"
_SEQUENCE = re.compile(r"\d{1,20}", re.ASCII)

_Observation = tuple[int, int, float, bytes, Item, bytes]  # sequence, line, time, time stamp, item, text


def mtconnect_events(path: Path, table: ItemTable, notes: FileNotes) -> Iterator[Event]:
    """Yield the values of the used items: those of each document of the file at its end."""
    notes.feed_unit = _FEED_UNIT  # unit of PathFeedrate by the standard, whatever the control's unit
    document: _Document | None = None
    rest, line = b"", 1
    last_sent: dict[str, int] = {}  # last sequence number by instance of the agent
    for piece in chunks(path):
        data, rest = rest + piece, b""
        while data:
            if document is None:
                found = _BEGIN.search(data)
                if found is None:
                    keep = max(0, len(data) - _OVERLAP)
                    line += data.count(b"\n", 0, keep)
                    rest = data[keep:]
                    break
                line += data.count(b"\n", 0, found.start())
                data = data[found.start() :]
                document = _Document(path, line, table, notes, b"utf-16" in data[:_OVERLAP].lower())
            used = document.feed(data)
            line += data.count(b"\n", 0, used)
            data = data[used:]
            if document.ended:
                sent = last_sent.get(document.instance, -1)
                last_sent[document.instance] = max([sent, *(each[0] for each in document.observations)])
                fresh = [each for each in document.observations if each[0] < 0 or each[0] > sent]
                numbered = all(each[0] >= 0 for each in fresh)
                order = operator.itemgetter(0 if numbered else 2)
                yield from (each[1:] for each in sorted(fresh, key=order))
                document = None
    if document is not None:
        raise RecordError(
            f"{path}:{line}: the document begun in line {document.line} is truncated within "
            f"<{document.open_element}>: its observations are sorted by component, so some are missing over its whole "
            "time; save it again"
        )
    if not last_sent:
        raise RecordError(f"{path}:1: no MTConnectStreams document in the file")


class _Document:
    """One document."""

    def __init__(self, path: Path, line: int, table: ItemTable, notes: FileNotes, transcoded: bool) -> None:
        self.line, self.ended, self.instance = line, False, ""
        self.observations: list[_Observation] = []
        self._path, self._table, self._notes = path, table, notes
        self._stamps = Stamps()
        self._open: list[str] = []
        self._known: dict[tuple[str, ...], Item | None] = {}
        self._axis = ""
        self._now: tuple[Item, dict[str, str], int] | None = None
        self._text: list[str] = []
        self._text_length = self._fed = 0
        # A file in UTF-16 was converted to UTF-8 before, but not its declaration.
        self._parser = expat.ParserCreate("UTF-8" if transcoded else None, namespace_separator="}")
        self._parser.buffer_text = True
        self._parser.StartElementHandler, self._parser.EndElementHandler = self._start, self._end
        self._parser.CharacterDataHandler = self._characters
        self._parser.EntityDeclHandler = self._refuse_entity

    @property
    def open_element(self) -> str:
        """The innermost open element."""
        return self._open[-1] if self._open else "?xml"

    def feed(self, data: bytes) -> int:
        """Parse data; return how many of its bytes belong to this document."""
        try:
            self._parser.Parse(data, False)
        except LookupError as error:
            raise RecordError(f"{self._path}:{self.line}: {error}") from error
        except expat.ExpatError as error:
            if not self.ended:
                raise RecordError(
                    f"{self._path}:{self.line + error.lineno - 1}: incomplete XML: {expat.ErrorString(error.code)}, "
                    f"column {error.offset + 1}, within <{self.open_element}>"
                ) from error
            return max(0, self._parser.ErrorByteIndex - self._fed)
        self._fed += len(data)
        if self._fed - self._parser.CurrentByteIndex > MAX_TEXT_BYTES + len(data):
            self._refuse_long("a tag")
        return len(data)

    def _characters(self, text: str) -> None:
        self._text_length += len(text)
        if self._text_length > MAX_TEXT_BYTES:
            self._refuse_long("a text")
        self._text.append(text)

    def _refuse_long(self, what: str) -> NoReturn:
        raise RecordError(
            f"{self._path}:{self._here}: {what} of more than {MAX_TEXT_BYTES} bytes within <{self.open_element}>"
        )

    def _forget_text(self) -> None:
        self._text.clear()
        self._text_length = 0

    def _refuse_entity(self, *_: object) -> None:
        raise RecordError(f"{self._path}:{self._here}: a declared entity: MTConnectStreams documents have none")

    @property
    def _here(self) -> int:
        return self.line + self._parser.CurrentLineNumber - 1

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        name = tag.rpartition("}")[2]
        if not self._open and name != "MTConnectStreams":
            kinds = {"MTConnectDevices": "the answer to `probe`", "MTConnectError": "an error of the agent"}
            raise RecordError(
                f"{self._path}:{self._here}: <{name}>{', ' + kinds[name] if name in kinds else ''}; required: "
                "MTConnectStreams, the answer to `sample`"
            )
        depth = len(self._open)
        if depth == MAX_DEPTH:
            raise RecordError(f"{self._path}:{self._here}: <{name}> is nested too deeply: at most {MAX_DEPTH} elements")
        self._open.append(name)
        self._forget_text()
        if name == "Header" and depth == 1:
            self.instance = attributes.get("instanceId", "")
        elif name == "ComponentStream":
            self._axis = attributes.get("name", "") if attributes.get("component") == "Linear" else ""
        elif "timestamp" in attributes and depth >= 2:
            kind = attributes.get("subType", ""), attributes.get("name", ""), attributes.get("dataItemId", "")
            key = (name + self._axis, *kind)
            if key not in self._known:
                if len(self._known) == _MAX_ITEMS:
                    raise RecordError(f"{self._path}:{self._here}: more than {_MAX_ITEMS} different data items")
                self._known[key] = self._item(name, *kind)
            item = self._known[key]
            self._now = None if item is None else (item, attributes, self._here)

    def _item(self, name: str, kind: str, given: str, identity: str) -> Item | None:
        """Identify a data item by an id or name that `items` states, else by element and sub-type."""
        chosen = {one.strip().lower() for one in self._table.chosen.values()}
        if {given.lower(), identity.lower()} & chosen:
            return self._table.find(given or identity, identity)
        label = f"{name} ({given or identity})" if given or identity else name
        if name == "PathFeedrateOverride" and kind == "RAPID":
            return self._table.find(label, "PathFeedrateOverrideRapid")
        override = name.endswith("Override")
        if (kind in _LEFT_OUT and not (override and kind == "PROGRAMMED")) or name == "AxisFeedrate":
            return None
        if name == "Position":
            return self._table.find(label, self._axis) if self._axis in _AXES else None
        return self._table.find(label, name)

    def _end(self, tag: str) -> None:
        self._open.pop()
        if self._now is not None:
            item, attributes, line = self._now
            self._now = None
            stamp = attributes["timestamp"].encode()
            text = "".join(self._text).strip()
            try:
                time = self._stamps.seconds(stamp)
            except ValueError:
                self._notes.add("stamp", line, f"{attributes['timestamp'][:40]!r} is not a time stamp, ignored")
            else:
                sequence = attributes.get("sequence", "")
                number = int(sequence) if _SEQUENCE.fullmatch(sequence) else -1
                self.observations.append((number, line, time, stamp, item, text.encode()))
                if len(self.observations) > _MAX_OBSERVATIONS:
                    raise RecordError(
                        f"{self._path}:{line}: more than {_MAX_OBSERVATIONS} observations in one document: ask the "
                        "agent for fewer at once (count)"
                    )
        self._forget_text()
        self.ended = not self._open


_CONDITION = {b"normal", b"warning", b"fault", b"unavailable"}
_CONDITION_FIELDS = 6
_MARK = b"--multiline--"


def shdr_events(path: Path, table: ItemTable, notes: FileNotes) -> Iterator[Event]:
    """Yield the values of the used items."""
    known: dict[bytes, Item | None] = {}
    seconds = Stamps().seconds
    number, readable = 0, False
    odd = _Odd(path, table, notes, known)
    for lines in line_chunks(path):
        for number, line in enumerate(lines, start=number + 1):  # noqa: B020  (goes on over the chunks)
            fields = line.split(b"|")
            if len(fields) != 3 or odd.until:
                pairs = odd.pairs(number, line, fields)
            else:  # nearly every line: this branch must be fast
                name = fields[1]
                found = known[name] if name in known else odd.find(name)
                pairs = () if found is None else ((found, fields[2]),)
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
    """Handles every line that is not one item with its value: several items, a condition, an asset, a comment."""

    def __init__(self, path: Path, table: ItemTable, notes: FileNotes, known: dict[bytes, Item | None]) -> None:
        self._path, self._table, self._notes, self._known = path, table, notes, known
        self.until = b""  # end mark of a multi-line entry
        self._began, self._unreadable = 0, ""

    def leave_out(self, number: int, stamp: bytes) -> None:
        """Ignore a line with an unreadable time stamp."""
        shown = stamp[:40].decode("latin-1")
        self._unreadable = self._unreadable or f"{self._path}:{number}: {shown!r} is not a time stamp"
        self._notes.add("stamp", number, f"{shown!r} is not a time stamp, the line is ignored")

    def end(self, readable: bool) -> None:
        """Refuse a file without a readable time stamp (*readable* is false), or that ends within an asset."""
        if self._unreadable and not readable:
            raise RecordError(f"{self._unreadable}; required: for example 2017-02-10T18:33:01.138Z")
        if self.until:
            raise RecordError(
                f"{self._path}:{self._began}: the asset that begins here does not end: no line is "
                f"{self.until[:40].decode('latin-1')!r}, so that nothing after it can be read; remove it"
            )

    def find(self, name: bytes) -> Item | None:
        """Identify an item; at most 10 000 are cached (a file may be no log)."""
        item = self._table.find(name.decode("utf-8", errors="replace").strip())
        if len(self._known) < 10_000:
            self._known[name] = item
        return item

    def pairs(self, number: int, line: bytes, fields: list[bytes]) -> tuple[tuple[Item, bytes], ...]:
        """(item, value) pairs of a line; a line without any is noted unless blank, a comment or text of an asset."""
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
            self._notes.add("asset", number, "an asset, ignored")
        elif len(rest) == _CONDITION_FIELDS and rest[1].strip().lower() in _CONDITION and self.find(rest[2]) is None:
            self._notes.add("condition", number, f"the condition {rest[0].decode('latin-1')}, ignored")
        elif len(rest) < 2 or len(rest) % 2:
            self._notes.add("odd", number, f"{line[:60].strip().decode('latin-1')!r} is not time|item|value, ignored")
        else:
            found = ((self.find(name), text) for name, text in zip(rest[::2], rest[1::2], strict=True))
            return tuple((item, text) for item, text in found if item is not None)
        return ()
