"""The events of a Sinumerik capture: blocks, calls, slow values, and time stamps held against the counter."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from shapegcode.errors import RecordError
from shapegcode.io.edge_capture import EdgeBlock, EdgeCall, EdgeValue

__all__ = ["COUNTER_RANGE", "EVENTS", "Events", "key_of"]

EVENTS = ("HFBlockEvent", "HFCallEvent", "HFTimestamp")
"""Entries of a payload that are one event each."""
COUNTER_RANGE = 1 << 31
"""Behind its last number the counter begins anew at 0."""
_APART_S = 0.5


def key_of(table: Mapping[str, Any], name: str) -> Any:
    """A value by its key in whatever case: versions differ ("HfProbeCounter"); None where there is none."""
    if name in table:
        return table[name]
    return next((value for key, value in table.items() if key.lower() == name.lower()), None)


@dataclass
class Events:
    """Blocks, calls, slow values and time stamps of the files, in their order there."""

    start: int
    cycle_s: float
    blocks: list[EdgeBlock] = field(default_factory=list)
    calls: list[EdgeCall] = field(default_factory=list)
    values: list[EdgeValue] = field(default_factory=list)
    stamps: list[tuple[int, str]] = field(default_factory=list)
    others: Counter[str] = field(default_factory=Counter)
    path: str = ""

    def read(self, name: str, payload: list[dict[str, Any]]) -> None:
        """Take the events of a file."""
        for index, entry in enumerate(payload):
            for kind, content in entry.items():
                where = f"{name}: Payload[{index}].{kind}"
                if kind not in ("HFData", "LFData", *EVENTS):
                    self.others[kind] += 1
                elif kind == "LFData":
                    self._values(where, content)
                elif kind in EVENTS:
                    if not isinstance(content, dict):
                        raise RecordError(f"{where} = {str(content)[:40]!r}: must be an object")
                    self._event(where, kind, content)

    def notes(self) -> list[str]:
        """What was left out, and where the clock does not go with the counter."""
        left = [f"{count} entries {kind} in the payload were left out" for kind, count in self.others.items()]
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
            # A file of a chain begins with the last block of the file before it.
            if not self.blocks or self.blocks[-1] != block:
                self.blocks.append(block)

    def _when(self, where: str, event: dict[str, Any]) -> tuple[int, float]:
        """Counter and time of an event."""
        counter = _integer(where, event, "HFProbeCounter")
        if counter is None:
            raise RecordError(f"{where}.HFProbeCounter is missing: nobody knows when it was")
        if self.start - counter > COUNTER_RANGE // 2:
            counter += COUNTER_RANGE  # it began anew at 0 after the first sample
        return counter, (counter - self.start) * self.cycle_s

    def _values(self, where: str, content: Any) -> None:
        if not isinstance(content, list):
            raise RecordError(f"{where} = {str(content)[:40]!r}: must be a list")
        for index, each in enumerate(content):
            if not isinstance(each, dict):
                raise RecordError(f"{where}[{index}] = {str(each)[:40]!r}: must be an object")
            counter, time_s = self._when(f"{where}[{index}]", each)
            self.values.append(EdgeValue(counter, time_s, str(each.get("address", "")), str(each.get("value", ""))))


def _integer(where: str, table: Mapping[str, Any], name: str) -> int | None:
    """A whole number, which versions write as number or as text; None where there is none."""
    value = key_of(table, name)
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
    """Where the clock and the counter go apart between two stamps, or a stamp is no time."""
    notes: list[str] = []
    jumps: list[tuple[int, float, float]] = []
    before: tuple[int, datetime] | None = None
    for counter, text in stamps:
        try:
            now = datetime.fromisoformat(text.replace("Z", "+00:00"))
        except ValueError:
            notes.append(f"the time stamp {text[:40]!r} at counter {counter} is no time")
            continue
        if before is not None and (now.tzinfo is None) == (before[1].tzinfo is None):
            clock, counted = (now - before[1]).total_seconds(), (counter - before[0]) * cycle_s
            if abs(clock - counted) > _APART_S:
                jumps.append((counter, clock, counted))
        before = counter, now
    if jumps:
        counter, clock, counted = jumps[0]
        more = f", and {len(jumps) - 1} times more" if len(jumps) > 1 else ""
        notes.append(
            f"the clock and the counter disagree before counter {counter}{more}: {clock:.3f} s passed by the time "
            f"stamps, {counted:.3f} s by the counter, which is taken"
        )
    return notes
