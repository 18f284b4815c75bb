"""Reads files of the SINUMERIK Data Recorder (Edge): JSON of Header, Payload and Footer, plain, gzip or zip.

Source of the format: Siemens, SINUMERIK Data Recorder, "Data output format"; of the signals: SINUMERIK Connector,
"Which HF data can be collected".
"""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from shapegcode.errors import RecordError
from shapegcode.io.data_file import DataFile
from shapegcode.io.edge_capture import EdgeAxis, EdgeBlock, EdgeCall, EdgeCapture, EdgeGap, EdgeValue, IntArray
from shapegcode.io.runs import RunLog, Signal
from shapegcode.io.units import FloatArray

_MIN_ROWS = 2
_MAX_VALUE = 1e12
_NUMBERS = {int, float, type(None)}
_EVENTS = ("HFBlockEvent", "HFCallEvent", "HFTimestamp")  # entries of a payload with a single event
_COUNTER_RANGE = 1 << 31  # the counter restarts at 0 after its last number
_APART_S = 0.5
_VERSIONS = ((0, 6), (1, 1))
_MAX_GAPS = 10
_CYCLE_MS = (0.05, 50.0)
_AXIS_DIGITS = 4  # an axis number has two at most
_END = re.compile(r"\s*(?:/?\s*N\d+\s*)?(?:M0?2|M30)\b", re.IGNORECASE)


def _joined_rows(path: Path, parts: list[_Part]) -> tuple[IntArray, dict[str, FloatArray], list[str]]:
    """Join the rows of all entries "HFData": counters, values by address, and notes."""
    addresses = parts[0].addresses
    pieces: list[FloatArray] = []
    sources: list[str] = []  # source of each piece, for messages
    for part in parts:
        for index, entry in enumerate(part.payload):
            where = f"{part.where}: Payload[{index}].HFData"
            if "HFData" in entry and len(piece := _numbers(where, entry["HFData"], addresses)):
                pieces.append(piece)
                sources.append(where)
    starts = np.cumsum([0, *map(len, pieces)])
    if starts[-1] < _MIN_ROWS:
        raise RecordError(f"{path}: the Payload has {starts[-1]} rows of HFData: at least 2 are needed")
    values = np.concatenate(pieces)
    counter, kept, notes = _counters(values[:, addresses.index("CYCLE")], values, sources, starts)
    columns: dict[str, FloatArray] = {}
    for rank, address in enumerate(addresses):
        if address == "CYCLE":
            continue
        columns[address] = column = np.ascontiguousarray(values[kept, rank])
        missing = np.flatnonzero(np.isnan(column))
        if missing.size:
            where = "in any sample" if missing.size == len(column) else f"in {missing.size} of {len(column)} samples"
            notes.append(f"{address}: no value {where}, the first at counter {counter[missing[0]]}")
    return counter, columns, notes


def _numbers(where: str, rows: Any, addresses: tuple[str, ...]) -> FloatArray:
    """Numbers of one entry, (rows, signals); NaN for null."""
    if not isinstance(rows, list):
        raise RecordError(f"{where} = {str(rows)[:40]!r}: must be a list of rows")
    for index, row in enumerate(rows):
        if not isinstance(row, list) or len(row) != len(addresses):
            found = f"{len(row)} values" if isinstance(row, list) else repr(str(row)[:40])
            raise RecordError(
                f"{where}[{index}] has {found}: SignalListHFData lists {len(addresses)} signals, each row needs one "
                "value of each"
            )
        if not set(map(type, row)) <= _NUMBERS:
            rank = next(at for at, value in enumerate(row) if type(value) not in _NUMBERS)
            raise RecordError(f"{where}[{index}]: {addresses[rank]} = {row[rank]!r}: must be a number")
    try:
        values: FloatArray = np.array(rows, dtype=np.float64).reshape(len(rows), len(addresses))
    except OverflowError as error:
        raise RecordError(f"{where}: a number is too large: {error}") from error
    wild = np.argwhere(np.abs(values) > _MAX_VALUE)
    if len(wild):
        at, rank = wild[0]
        raise RecordError(
            f"{where}[{at}]: {addresses[rank]} = {values[at, rank]:g}: must be finite and at most {_MAX_VALUE:g}"
        )
    return values


def _counters(
    raw: FloatArray, values: FloatArray, sources: list[str], starts: IntArray
) -> tuple[IntArray, npt.NDArray[np.bool_], list[str]]:
    """Counters of the rows used, the mask of these rows, and notes."""

    def at(row: int) -> str:
        piece = int(np.searchsorted(starts, row, side="right")) - 1
        return f"{sources[piece]}[{row - starts[piece]}]"

    bad = np.flatnonzero(~((raw >= 0) & (raw < _COUNTER_RANGE) & (raw == np.floor(raw))))
    if bad.size:
        raise RecordError(f"{at(bad[0])}: CYCLE = {raw[bad[0]]:g}: must be a whole number, 0 to {_COUNTER_RANGE - 1}")
    notes: list[str] = []
    steps = np.diff(raw)
    over = steps < -_COUNTER_RANGE / 2
    if over.any():
        notes.append(f"the counter starts again at 0 after {int(raw[np.flatnonzero(over)[0]])}: continued")
    counter = raw.astype(np.int64)
    counter[1:] += _COUNTER_RANGE * np.cumsum(over)
    repeated = np.flatnonzero(np.diff(counter) == 0) + 1
    same = np.array([np.array_equal(values[row], values[row - 1], equal_nan=True) for row in repeated], dtype=bool)
    kept = np.ones(len(counter), dtype=bool)
    kept[repeated[same]] = False
    if same.any():
        notes.append(f"{same.sum()} rows are repeated and were used once, the first at {at(repeated[same][0])}")
    back = np.flatnonzero((np.diff(counter) <= 0) & kept[1:])
    if back.size:
        row = int(back[0]) + 1
        fault = "other values under the same counter" if counter[row] == counter[row - 1] else "the counter goes back"
        raise RecordError(
            f"{at(row)}: CYCLE = {raw[row]:.0f} after {raw[row - 1]:.0f}: {fault}; it must rise from row to row"
        )
    return counter[kept], kept, notes


def _key_of(table: Mapping[str, Any], name: str) -> Any:
    """Value of a key, capital or small letters alike, since versions differ ("HfProbeCounter"); None if missing."""
    if name in table:
        return table[name]
    return next((value for key, value in table.items() if key.lower() == name.lower()), None)


@dataclass
class _Events:
    """Blocks, calls, slow values and time stamps of the files, in file order."""

    start: int
    cycle_s: float
    blocks: list[EdgeBlock] = field(default_factory=list)
    calls: list[EdgeCall] = field(default_factory=list)
    values: list[EdgeValue] = field(default_factory=list)
    stamps: list[tuple[int, str]] = field(default_factory=list)
    others: Counter[str] = field(default_factory=Counter)
    path: str = ""

    def read(self, name: str, payload: list[dict[str, Any]]) -> None:
        """Read the events of a file."""
        for index, entry in enumerate(payload):
            for kind, content in entry.items():
                where = f"{name}: Payload[{index}].{kind}"
                if kind not in ("HFData", "LFData", *_EVENTS):
                    self.others[kind] += 1
                elif kind in _EVENTS:
                    self._event(where, kind, _object(where, content))
                elif kind == "LFData":
                    if not isinstance(content, list):
                        raise RecordError(f"{where} = {str(content)[:40]!r}: must be a list")
                    for number, value in enumerate(content):
                        each = _object(f"{where}[{number}]", value)
                        when = self._when(f"{where}[{number}]", each)
                        self.values.append(EdgeValue(*when, str(each.get("address", "")), str(each.get("value", ""))))

    def notes(self) -> list[str]:
        """Notes on ignored entries, and where clock and counter disagree."""
        left = [f"{count} entries {kind} in the payload were ignored" for kind, count in self.others.items()]
        return left + _clock_notes(self.stamps, self.cycle_s)

    def _event(self, where: str, kind: str, event: dict[str, Any]) -> None:
        counter, time_s = self._when(where, event)
        channel = _integer(where, event, "Channel")
        line = _integer(where, event, "SeekOffset")
        if kind == "HFTimestamp":
            self.stamps.append((counter, str(event.get("Time"))))
        elif kind == "HFCallEvent":
            self.path = str(event.get("Path") or "")
            level = _integer(where, event, "CallStackLevel")
            self.calls.append(EdgeCall(counter, time_s, self.path, line, level, channel))
        else:
            block = EdgeBlock(
                counter, time_s, str(event.get("GCode") or ""), line, self.path,
                _integer(where, event, "SelectedTool"), _integer(where, event, "ActiveTool"),
                str(event.get("IpoGC") or ""), _integer(where, event, "laBuf"), channel,
            )  # fmt: skip
            # A continued file begins with the last block of the file before.
            if not self.blocks or self.blocks[-1] != block:
                self.blocks.append(block)

    def _when(self, where: str, event: dict[str, Any]) -> tuple[int, float]:
        counter = _integer(where, event, "HFProbeCounter")
        if counter is None:
            raise RecordError(f"{where}.HFProbeCounter is missing: the time is unknown")
        if self.start - counter > _COUNTER_RANGE // 2:
            counter += _COUNTER_RANGE  # it restarted at 0 after the first sample
        return counter, (counter - self.start) * self.cycle_s


def _object(where: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise RecordError(f"{where} = {str(value)[:40]!r}: must be an object")
    return value


def _integer(where: str, table: Mapping[str, Any], name: str) -> int | None:
    """A whole number, written as number or text depending on the version; None if missing."""
    value = _key_of(table, name)
    if value is None or value == "":
        return None
    try:
        number = float(value) if not isinstance(value, bool) else math.nan
    except (TypeError, ValueError):
        number = math.nan
    if not number.is_integer():
        raise RecordError(f"{where}.{name} = {value!r}: must be a whole number")
    return int(number)


def _clock_notes(stamps: Sequence[tuple[int, str]], cycle_s: float) -> list[str]:
    """One note for each invalid time stamp, and one if clock and counter disagree between two stamps."""
    notes: list[str] = []
    jumps: list[tuple[int, float, float]] = []
    before: tuple[int, datetime] | None = None
    for counter, text in stamps:
        try:
            now = datetime.fromisoformat(text.replace("Z", "+00:00"))
        except ValueError:
            notes.append(f"the time stamp {text[:40]!r} at counter {counter} is not a time")
            continue
        if before is not None and (now.tzinfo is None) == (before[1].tzinfo is None):
            clock, counted = (now - before[1]).total_seconds(), (counter - before[0]) * cycle_s
            if abs(clock - counted) > _APART_S:
                jumps.append((counter, clock, counted))
        before = counter, now
    if jumps:
        counter, clock, counted = jumps[0]
        more = f", and {len(jumps) - 1} more times" if len(jumps) > 1 else ""
        notes.append(
            f"the clock and the counter disagree before counter {counter}{more}: {clock:.3f} s passed by the time "
            f"stamps, {counted:.3f} s by the counter, which is used"
        )
    return notes


def is_edge_json(head: bytes) -> bool:
    """Whether a file may be a capture, by its first bytes."""
    text = head.lstrip(b"\xef\xbb\xbf \t\r\n")
    return head[:2] == b"\x1f\x8b" or head[:4] == b"PK\x03\x04" or (text[:1] == b"{" and text[1:].lstrip()[:1] == b'"')


def read_edge_json(path: str | Path) -> EdgeCapture:
    """Read a capture.

    Args:
        path: of the file: .json as recorded, packed by gzip, or the recorder's .zip; the files of one recording in a
            zip are joined by counter.

    Returns:
        Its samples, blocks, calls and slow values; `notes` list missing and doubtful data.

    Raises:
        RecordError: not such a file, truncated, of another version, or with impossible values; the message gives
            the location, what was found and what is required.
        OSError: the file cannot be read.
    """
    path = Path(path)
    with DataFile(path) as file:
        zipped = ((f"{path}({name})", data) for name, data in file.members(".json"))
        contents = zipped if file.kind == "zip" else [(str(path), file.read())]
        parts = [_Part(where, _parsed(file, where, data)) for where, data in contents]
    if not parts:
        raise RecordError(f"{path}: the archive contains no .json file")
    parts.sort(key=lambda each: each.first_counter)
    if len({(part.cycle_s, part.addresses) for part in parts}) > 1:
        raise RecordError(f"{path}: the files in it differ in signals or cycle: one recording has one header")
    return _capture(path, parts)


def _parsed(file: DataFile, where: str, data: bytes) -> dict[str, Any]:
    if not data.strip():
        raise RecordError(f"{where}: the file is empty; required: JSON with Header, Payload and Footer")
    try:
        found = file.json(where, data)
    except UnicodeDecodeError as error:
        raise RecordError(f"{where}: not UTF-8 text: byte {error.start} is {error.object[error.start]:#04x}") from error
    except json.JSONDecodeError as error:
        length = len(error.doc)
        cut = "it is truncated there; record it again or repair it"
        cut = cut if error.pos >= len(error.doc.rstrip()) - 1 else error.msg
        raise RecordError(
            f"{where}:{error.lineno}: not complete JSON: column {error.colno}, character {error.pos} of {length}: {cut}"
        ) from error
    if not isinstance(found, dict) or not isinstance(found.get("Header"), dict):
        raise RecordError(f"{where}: no Header: not a file of the SINUMERIK Data Recorder (Header, Payload, Footer)")
    return found


class _Part:
    """One file of a recording."""

    def __init__(self, where: str, data: dict[str, Any]) -> None:
        header = data["Header"]
        self.where, self.notes = where, list[str]()
        self.version = self._version(header)
        kind = header.get("Format", "DEFAULT")
        if kind != "DEFAULT":
            raise RecordError(f"{self.where}: Header.Format = {kind!r}: must be 'DEFAULT'")
        cycle = header.get("CycleTimeMs")
        low, high = _CYCLE_MS
        if isinstance(cycle, bool) or not isinstance(cycle, int | float) or not low <= cycle <= high:
            raise RecordError(
                f"{self.where}: Header.CycleTimeMs = {cycle!r}: must be the position control cycle, {low:g} to "
                f"{high:g} ms; without it counters give no times"
            )
        self.cycle_s = cycle / 1000.0
        self.signals = self._signals(header)  # address, label of the axis
        self.addresses = tuple(address for address, _ in self.signals)
        payload = data.get("Payload")
        if not isinstance(payload, list):
            raise RecordError(f"{self.where}: Payload is missing or not a list: the file has no data")
        self.payload: list[dict[str, Any]] = [_object(f"{where}: Payload[{k}]", each) for k, each in enumerate(payload)]
        self._footer(data)

    @property
    def first_counter(self) -> float:
        """Counter of the first event or sample, to sort files."""
        for entry in self.payload:
            for kind in _EVENTS:
                found = _key_of(entry[kind], "HFProbeCounter") if isinstance(entry.get(kind), dict) else None
                if isinstance(found, int):
                    return found
            rows = entry.get("HFData")
            if isinstance(rows, list) and rows and isinstance(rows[0], list) and "CYCLE" in self.addresses:
                rank = self.addresses.index("CYCLE")
                if rank < len(rows[0]) and isinstance(rows[0][rank], int | float):
                    return float(rows[0][rank])
        return math.inf

    def _version(self, header: dict[str, Any]) -> str:
        table = header.get("Version")
        text = str(_key_of(table, "OutputFileFormatVersion")) if isinstance(table, dict) else "None"
        key = f"{self.where}: Header.Version.outputFileFormatVersion"
        first, last = (".".join(map(str, each)) for each in _VERSIONS)
        try:
            number = tuple(int(word) for word in text.split(".")[:2])
        except ValueError:
            raise RecordError(f"{key} = {text}: must be {first} to {last}") from None
        if number < _VERSIONS[0] or number[0] > _VERSIONS[1][0]:
            raise RecordError(f"{key} = {text}: must be {first} to {last}: the format may differ")
        if number > _VERSIONS[1]:
            self.notes.append(f"format {text} is newer than {last}, the newest known one")
        return text

    def _signals(self, header: dict[str, Any]) -> tuple[tuple[str, str], ...]:
        key = f"{self.where}: Header.SignalListHFData"
        listed = header.get("SignalListHFData")
        if not isinstance(listed, list) or not listed:
            raise RecordError(f"{key} is missing or empty: no signal was recorded in every cycle")
        found: list[tuple[str, str]] = []
        for index, each in enumerate(listed):
            address = (each.get("Address") or each.get("Name")) if isinstance(each, dict) else None
            if not isinstance(address, str) or not address.strip():
                raise RecordError(f"{key}[{index}] has no Address; required: for example 'DES_POS|1'")
            if address in dict(found):
                raise RecordError(f"{key}[{index}]: {address} is listed twice: it is unclear which one is valid")
            found.append((address.strip(), str(each.get("Axis") or "")))
        if "CYCLE" not in dict(found):
            raise RecordError(
                f"{key} has no CYCLE: without the counter of each sample gaps cannot be seen; record it too"
            )
        return tuple(found)

    def _footer(self, data: dict[str, Any]) -> None:
        footer = data.get("Footer")
        if not isinstance(footer, dict):
            self.notes.append("no Footer: the recorder did not complete the file")
            return
        errors = footer.get("ErrorMessages") or []
        for text in errors if isinstance(errors, list) else [errors]:
            self.notes.append(f"the recorder reports an error: {str(text)[:200]}")
        chain = footer.get("FilePathChain")
        for name, words in (("Previous", "began in"), ("Next", "continues in")):
            if isinstance(chain, dict) and chain.get(name):
                self.notes.append(f"the recording {words} {str(chain[name])[:200]}")


def _capture(path: Path, parts: list[_Part]) -> EdgeCapture:
    first = parts[0]
    counter, columns, notes = _joined_rows(path, parts)
    time_s, steps = (counter - counter[0]) * first.cycle_s, np.diff(counter)
    gaps = [
        EdgeGap(at + 1, int(counter[at]), int(steps[at]) - 1, float(time_s[at]), float(steps[at]) * first.cycle_s)
        for at in np.flatnonzero(steps > 1).tolist()
    ]
    notes = [note for part in parts for note in part.notes] + notes
    notes += [
        f"{gap.missing} cycles ({gap.missing * first.cycle_s:.3f} s) are missing at {gap.start_s:.3f} s, after "
        f"counter {gap.counter}"
        for gap in gaps[:_MAX_GAPS]
    ]
    if len(gaps) > _MAX_GAPS:
        notes.append(f"{sum(gap.missing for gap in gaps)} cycles are missing in {len(gaps)} places in total")
    events = _Events(int(counter[0]), first.cycle_s)
    for part in parts:
        events.read(part.where, part.payload)
    notes += events.notes()
    return EdgeCapture(
        source=str(path),
        version=first.version,
        cycle_s=first.cycle_s,
        counter=counter,
        time_s=time_s,
        columns=columns,
        axes=_axes(first.signals),
        blocks=tuple(sorted(events.blocks, key=lambda each: each.counter)),
        calls=tuple(sorted(events.calls, key=lambda each: each.counter)),
        values=tuple(sorted(events.values, key=lambda each: each.counter)),
        gaps=tuple(gaps),
        notes=tuple(notes),
    )


def _axes(signals: tuple[tuple[str, str], ...]) -> tuple[EdgeAxis, ...]:
    found: dict[int, tuple[str, list[str]]] = {}
    for address, label in signals:
        name, bar, number = address.partition("|")
        if bar and number.isdecimal() and len(number) <= _AXIS_DIGITS:
            found.setdefault(int(number), (label or number, []))[1].append(name)
    return tuple(EdgeAxis(number, label, tuple(names)) for number, (label, names) in sorted(found.items()))


def edge_runs(path: Path) -> Iterator[RunLog]:
    """Yield the run of a capture: `block` has lines of the program with most blocks, `block_texts` all blocks."""
    capture = read_edge_json(path)
    count = Counter(block.path for block in capture.blocks if block.line is not None)
    if not count:
        raise RecordError(
            f"{path}: no block events (HFBlockEvent) with a line: the executed lines are unknown; record them"
        )
    program = count.most_common(1)[0][0]
    blocks = [block for block in capture.blocks if block.path == program and block.line is not None]
    notes = list(capture.notes)
    if len(count) > 1:
        others = ", ".join(f"{name or 'unnamed'} ({number})" for name, number in count.most_common()[1:6])
        notes.append(f"line numbers are those of {program or 'no name'}; blocks of {others} are ignored")
    end = next((block.time_s for block in capture.blocks if _END.match(block.text)), None)
    tools = [block for block in capture.blocks if block.active_tool is not None and block.active_tool < 65535]
    yield RunLog(
        source=str(path),
        start="",
        duration_s=None,
        block=_signal(blocks, [float(block.line or 0) for block in blocks], "SeekOffset"),
        tool=_signal(tools, [float(block.active_tool or 0) for block in tools], "ActiveTool") if tools else None,
        position_mm=tuple(
            (letter, Signal(capture.time_s, capture.position(axis.number), f"DES_POS|{axis.number}"))
            for letter in "xyz"
            for axis in capture.axes
            if axis.name.lower().startswith(letter) and "DES_POS" in axis.signals
        ),
        program=program or None,
        notes=tuple(notes),
        block_texts=tuple((block.time_s, block.text) for block in capture.blocks),
        gaps=tuple((gap.start_s, gap.duration_s) for gap in capture.gaps),
        ended_by=None if end is None else "M30",
        cut_start=True,
        cut_end=end is None,
    )


def _signal(blocks: list[EdgeBlock], values: list[float], name: str) -> Signal:
    return Signal(np.array([block.time_s for block in blocks]), np.array(values), name)
