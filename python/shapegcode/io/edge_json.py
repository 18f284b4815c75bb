"""Reads what the SINUMERIK Data Recorder (Edge) writes: JSON of Header, Payload and Footer, plain, gzip or zip.

Source of the format: Siemens, SINUMERIK Data Recorder, "Data output format"; of the signals: SINUMERIK Connector,
"Which HF data can be collected".
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from shapegcode.errors import RecordError
from shapegcode.io.data_file import DataFile
from shapegcode.io.edge_capture import EdgeAxis, EdgeCapture, EdgeGap
from shapegcode.io.edge_events import EVENTS, Events, key_of
from shapegcode.io.edge_rows import Rows, read_rows

__all__ = ["is_edge_json", "read_edge_json"]

_VERSIONS = ((0, 6), (1, 1))
_MOST_GAPS = 10
_CYCLE_MS = (0.05, 50.0)


def is_edge_json(head: bytes) -> bool:
    """Whether a file may be such a capture, by its first bytes."""
    text = head.lstrip(b"\xef\xbb\xbf \t\r\n")
    return head[:2] == b"\x1f\x8b" or head[:4] == b"PK\x03\x04" or (text[:1] == b"{" and text[1:].lstrip()[:1] == b'"')


def read_edge_json(path: str | Path) -> EdgeCapture:
    """Read a capture.

    Args:
        path: of the file: .json as recorded, packed by gzip, or the recorder's .zip; the files of one recording in a
            zip are joined in the order of their counters.

    Returns:
        Its samples, blocks, calls and slow values; what is missing or doubtful is in `notes`.

    Raises:
        RecordError: not such a file, cut off, of another version, or with values that cannot be; the message says
            where, what stands there and what must.
        OSError: the file cannot be read.
    """
    path = Path(path)
    with DataFile(path) as file:
        parts = [_Part(where, _parsed(file, where, data)) for where, data in _contents(file)]
    if not parts:
        raise RecordError(f"{path}: the archive holds no .json file")
    parts.sort(key=lambda each: each.first_counter)
    if len({(part.cycle_s, part.addresses) for part in parts}) > 1:
        raise RecordError(f"{path}: the files in it differ in signals or cycle: one recording has one header")
    rows = read_rows(str(path), parts[0].addresses, ((part.where, part.payload) for part in parts))
    return _capture(path, parts, rows)


def _contents(file: DataFile) -> Iterator[tuple[str, bytes]]:
    """(name for messages, text) of the file, or of each file in an archive."""
    if file.kind == "zip":
        for name, data in file.members(".json"):
            yield f"{file.path}({name})", data
    else:
        yield str(file.path), file.read()


def _parsed(file: DataFile, where: str, data: bytes) -> dict[str, Any]:
    """The JSON object of a file."""
    if not data.strip():
        raise RecordError(f"{where}: the file is empty; needed is JSON with Header, Payload and Footer")
    try:
        found = file.json(where, data)
    except UnicodeDecodeError as error:
        raise RecordError(f"{where}: not UTF-8 text: byte {error.start} is {error.object[error.start]:#04x}") from error
    except json.JSONDecodeError as error:
        length = len(error.doc)
        cut = "it is cut off there; record it again or mend it"
        cut = cut if error.pos >= len(error.doc.rstrip()) - 1 else error.msg
        raise RecordError(
            f"{where}:{error.lineno}: not whole JSON: column {error.colno}, character {error.pos} of {length}: {cut}"
        ) from error
    if not isinstance(found, dict) or not isinstance(found.get("Header"), dict):
        raise RecordError(f"{where}: no Header: not a file of the SINUMERIK Data Recorder (Header, Payload, Footer)")
    return found


@dataclass
class _Part:
    """One file of a recording."""

    where: str
    data: dict[str, Any]
    version: str = field(init=False)
    cycle_s: float = field(init=False)
    signals: tuple[tuple[str, str], ...] = field(init=False)  # address, label of the axis
    payload: list[Any] = field(init=False)
    notes: list[str] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        header = self.data["Header"]
        self.version = self._version(header)
        kind = header.get("Format", "DEFAULT")
        if kind != "DEFAULT":
            raise RecordError(f"{self.where}: Header.Format = {kind!r}: must be 'DEFAULT'")
        cycle = header.get("CycleTimeMs")
        low, high = _CYCLE_MS
        if isinstance(cycle, bool) or not isinstance(cycle, int | float) or not low <= cycle <= high:
            raise RecordError(
                f"{self.where}: Header.CycleTimeMs = {cycle!r}: must be the position control cycle, {low:g} to "
                f"{high:g} ms; without it counters are no times"
            )
        self.cycle_s = cycle / 1000.0
        self.signals = self._signals(header)
        payload = self.data.get("Payload")
        if not isinstance(payload, list):
            raise RecordError(f"{self.where}: Payload is missing or no list: the file holds no data")
        for index, entry in enumerate(payload):
            if not isinstance(entry, dict):
                raise RecordError(f"{self.where}: Payload[{index}] = {str(entry)[:40]!r}: must be an object")
        self.payload = payload
        self._footer()

    @property
    def addresses(self) -> tuple[str, ...]:
        return tuple(address for address, _ in self.signals)

    @property
    def first_counter(self) -> float:
        """Of the first event or sample, to put files in order."""
        for entry in self.payload:
            for kind in EVENTS:
                found = key_of(entry[kind], "HFProbeCounter") if isinstance(entry.get(kind), dict) else None
                if isinstance(found, int):
                    return found
            rows = entry.get("HFData")
            if isinstance(rows, list) and rows and isinstance(rows[0], list) and "CYCLE" in self.addresses:
                place = self.addresses.index("CYCLE")
                if place < len(rows[0]) and isinstance(rows[0][place], int | float):
                    return float(rows[0][place])
        return math.inf

    def _version(self, header: dict[str, Any]) -> str:
        table = header.get("Version")
        text = str(key_of(table, "OutputFileFormatVersion")) if isinstance(table, dict) else "None"
        key = f"{self.where}: Header.Version.outputFileFormatVersion"
        first, last = (".".join(map(str, each)) for each in _VERSIONS)
        try:
            number = tuple(int(word) for word in text.split(".")[:2])
        except ValueError:
            raise RecordError(f"{key} = {text}: must be {first} to {last}") from None
        if number < _VERSIONS[0] or number[0] > _VERSIONS[1][0]:
            raise RecordError(f"{key} = {text}: must be {first} to {last}: the format may mean something else there")
        if number > _VERSIONS[1]:
            self.notes.append(f"format {text} is newer than {last}, the newest that is known")
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
                raise RecordError(f"{key}[{index}] has no Address: needed is for example 'DES_POS|1'")
            if address in dict(found):
                raise RecordError(f"{key}[{index}]: {address} is listed twice: which one holds cannot be told")
            found.append((address.strip(), str(each.get("Axis") or "")))
        if "CYCLE" not in dict(found):
            raise RecordError(
                f"{key} has no CYCLE: without the counter of each sample gaps cannot be seen; record it too"
            )
        return tuple(found)

    def _footer(self) -> None:
        footer = self.data.get("Footer")
        if not isinstance(footer, dict):
            self.notes.append("no Footer: the recorder did not end the file")
            return
        errors = footer.get("ErrorMessages") or []
        for text in errors if isinstance(errors, list) else [errors]:
            self.notes.append(f"the recorder reports an error: {str(text)[:200]}")
        chain = footer.get("FilePathChain")
        for name, words in (("Previous", "began in"), ("Next", "goes on in")):
            if isinstance(chain, dict) and chain.get(name):
                self.notes.append(f"the recording {words} {str(chain[name])[:200]}")


def _capture(path: Path, parts: list[_Part], rows: Rows) -> EdgeCapture:
    first = parts[0]
    time = (rows.counter - rows.counter[0]) * first.cycle_s
    gaps = _gaps(rows, first.cycle_s)
    notes = [note for part in parts for note in part.notes] + list(rows.notes)
    notes += [
        f"{gap.missing} cycles ({gap.missing * first.cycle_s:.3f} s) are missing at {gap.start_s:.3f} s, behind "
        f"counter {gap.counter}"
        for gap in gaps[:_MOST_GAPS]
    ]
    if len(gaps) > _MOST_GAPS:
        notes.append(f"{sum(gap.missing for gap in gaps)} cycles are missing in {len(gaps)} places altogether")
    events = Events(int(rows.counter[0]), first.cycle_s)
    for part in parts:
        events.read(part.where, part.payload)
    notes += events.notes()
    return EdgeCapture(
        source=str(path),
        version=first.version,
        cycle_s=first.cycle_s,
        counter=rows.counter,
        time_s=time,
        columns=rows.columns,
        axes=_axes(first.signals),
        blocks=tuple(sorted(events.blocks, key=lambda each: each.counter)),
        calls=tuple(sorted(events.calls, key=lambda each: each.counter)),
        values=tuple(sorted(events.values, key=lambda each: each.counter)),
        gaps=gaps,
        notes=tuple(notes),
    )


def _gaps(rows: Rows, cycle_s: float) -> tuple[EdgeGap, ...]:
    steps = np.diff(rows.counter)
    return tuple(
        EdgeGap(
            index=int(index) + 1,
            counter=int(rows.counter[index]),
            missing=int(steps[index]) - 1,
            start_s=float(rows.counter[index] - rows.counter[0]) * cycle_s,
            duration_s=float(steps[index]) * cycle_s,
        )
        for index in np.flatnonzero(steps > 1)
    )


def _axes(signals: tuple[tuple[str, str], ...]) -> tuple[EdgeAxis, ...]:
    found: dict[int, tuple[str, list[str]]] = {}
    for address, label in signals:
        name, bar, number = address.partition("|")
        if bar and number.isdigit():
            found.setdefault(int(number), (label or number, []))[1].append(name)
    return tuple(EdgeAxis(number, label, tuple(names)) for number, (label, names) in sorted(found.items()))
