"""Splits the events of a log into runs, from ACTIVE to PROGRAM_COMPLETED in any control's words."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from shapegcode.errors import RecordError
from shapegcode.io.run_items import STATES, Event, FileNotes, Item, ItemTable, Role, State, plain_name
from shapegcode.io.run_tracks import Hold, RunLog, RunPart, Track, run_of

_DISORDER_S = 1.0  # smaller steps back come from an adapter's item order; larger ones from a clock that was set
_QUIET_S = 30.0  # a longer silence within a run is noted
_TEXT_VALUES = 8  # weight of a text value, in values
_EXAMPLE = 'for example items = { block = "Block_Number" }'
_IDLE_VALUES = 100_000  # values kept between runs


class RunCutter:
    """Splits events into runs; stores the values of one run at a time."""

    def __init__(self, source: str, table: ItemTable, feed_unit: str | None, max_values: int) -> None:
        self.notes = FileNotes()
        self._source, self._table, self._feed_unit, self._limit = source, table, feed_unit, max_values
        self._tracks: dict[Item, Track] = {}
        self._status: Item | None = None
        self._state: State = "unknown"
        self._open: RunPart | None = None  # the run in progress
        self._first: tuple[int, float, str] | None = None
        self._last_line, self._given = 0, False

    def runs(self, events: Iterator[Event]) -> Iterator[RunLog]:
        """Yield the runs of a log."""
        tracks, last, room, line = self._tracks, -math.inf, self._limit, 0
        for line, time, stamp, item, text in events:
            if not 0.0 <= time - last <= _QUIET_S:
                yield from self._odd_step(line, time, last, stamp)
                last = time if time > last or time < last - _DISORDER_S else last
            else:
                last = time
            track = tracks.get(item)
            if track is None:
                track = tracks[item] = Track(item)
            if track.texts is None:
                try:
                    value = float(text)
                except ValueError:
                    value = math.nan
                if value - value != 0.0 or (track.counts and (value < 0.0 or value % 1.0)):
                    self._leave_out(line, track, text)
                    continue
                if track.counts and track.times and track.times[-1] == time:
                    self.notes.add("twice", line, f"{item.name} twice at one time: the first value is ignored")
                track.times.append(time)
                track.values.append(value)
                room -= 1
            elif item.role == "status":
                self._last_line = line
                yield from self._status_event(line, time, stamp, item, text)
                room = self._limit if self._open is not None or self._state == "unknown" else _IDLE_VALUES
            else:
                track.times.append(time)
                track.texts.append(text.decode("utf-8", errors="replace").strip())
                room -= _TEXT_VALUES
            if room <= 0:
                self._last_line = line
                yield from self._full(line)
                room = self._limit if self._open is not None else _IDLE_VALUES
        self._last_line = line
        yield from self._end(last)

    # --- steps of the clock, and limits ---

    def _odd_step(self, line: int, time: float, last: float, stamp: bytes) -> Iterator[RunLog]:
        """Handle the first event, a clock that went back, or a long silence."""
        if self._first is None:
            self._first = line, time, stamp.decode("latin-1").strip()
            return
        step = time - last
        run = self._open
        if step > 0.0:
            if run is not None and run.held is None:
                run.gaps.append((last, step))
                self.notes.add("gap", line, f"nothing for {step:.1f} s before it: a dwell, a long block, or the log "
                               "or its clock was interrupted")  # fmt: skip
            return
        if step >= -_DISORDER_S:
            self.notes.add("disorder", line, f"its time stamp is {-step:.3f} s before that of the line before; sorted")
            return
        then = "" if run is None else "; the run ends there, its rest is ignored"
        if run is None and self._state == "unknown" and self._moved():
            first, at, began = self._first
            run = self._open = RunPart(self._source, at, began, (first, first), cut_start=True)
            then = "; the run ends there, and another one begins"
        self.notes.add("back", line, f"the clock goes back by {-step:.3f} s{then}")
        if run is not None:
            self._last_line = line
            yield from self._finish(last, None)
        for track in self._tracks.values():
            track.forget_times()
        self._first = line, time, stamp.decode("latin-1").strip()

    def _full(self, line: int) -> Iterator[RunLog]:
        """Handle too many values: an error within a run; between runs old ones are dropped."""
        if self._open is not None and self._open.held is not None:
            yield from self._finish(self._open.held.start, self._open.held.word)
        elif self._open is not None:
            raise RecordError(
                f"{self._source}:{line}: the run that began in line {self._open.lines[0]} has more than {self._limit} "
                "values: is its end logged? Log fewer items, split the log, or allow more (max_values)"
            )
        elif self._status is None:
            what = f"{self._limit} values, and no item that shows when a program runs"
            raise RecordError(f"{self._source}:{line}: {what}: {self._sought('status')} (items), or split the log")
        for track in self._tracks.values():
            track.drop_until(track.last_time)

    def _leave_out(self, line: int, track: Track, text: bytes) -> None:
        shown = text.decode("utf-8", errors="replace").strip()
        wrong = "is empty" if not shown else f"is {shown[:40]!r}, no {'line number' if track.counts else 'number'}"
        self.notes.add(f"value of {track.item.name}", line, f"{track.item.name} {wrong}, ignored")

    def _sought(self, role: Role) -> str:
        names = list(self._table.seen)
        more = f" and {len(names) - 20} more" if len(names) > 20 else ""
        held = f"{', '.join(names[:20])}{more}" or "no items"
        return f"searched for {self._table.sought(role)}; the log has {held}; specify it"

    # --- program status ---

    def _status_event(self, line: int, time: float, stamp: bytes, item: Item, text: bytes) -> Iterator[RunLog]:
        if self._status is None:
            self._status = item
        elif item is not self._status:
            one, other = self._status.name, item.name
            if plain_name(one.rpartition(":")[2]) == plain_name(other.rpartition(":")[2]):
                raise RecordError(
                    f"{self._source}:{line}: {other} and {one}: the log has more than one control; choose one, for "
                    f'example items = {{ status = "{one}" }} with the other items of that control'
                )
            self.notes.add("status", line, f"{other} ignored: {one} shows when the program runs")
            return
        word = text.decode("utf-8", errors="replace").strip().upper()
        state = STATES.get(re.sub(r"[_\s-]", "", word), "unknown")
        if state == "unknown":
            self.notes.add("state", line, f"{item.name} is {word[:40]!r}, which is not known, ignored")
            return
        first = self._state == "unknown"
        self._state = state
        if first and state in ("hold", "stop", "completed") and self._moved() and self._first is not None:
            began, at, text_at = self._first
            self._open = RunPart(self._source, at, text_at, (began, began), cut_start=True)
            self.notes.add("middle", began, f"the log begins within a run: no {item.name} ACTIVE before it")
        run = self._open
        if run is None:
            if state == "active":
                self._open = RunPart(self._source, time, stamp.decode("latin-1").strip(), (line, line))
        elif state == "active":
            if (held := run.held) is not None:
                held.end, held.resumed = time, (stamp.decode("latin-1").strip(), line)
        elif state in ("hold", "stop"):
            if run.held is None:
                run.holds.append(Hold(time, word, state == "stop"))
        elif state == "completed":
            if run.held is not None:
                run.held.end = time
            yield from self._finish(time, word)
        else:
            yield from self._break_off(line, time, word)

    def _break_off(self, line: int, time: float, word: str) -> Iterator[RunLog]:
        """End a run whose status shows no completion (READY, for example); if it is held, it ends with the hold."""
        run = self._open
        assert run is not None
        name = self._status.name if self._status else ""
        if word in ("UNAVAILABLE", "OFF"):
            self.notes.add("gone", line, f"{name} is {word}: the run is truncated")
            yield from self._finish(time, None)
        elif run.held is not None:
            held = run.holds.pop()
            self.notes.add("broken", line, f"{name} is {word} after {held.word}: the run ended at {held.word}")
            yield from self._finish(held.start, held.word)
        else:
            self.notes.add("ended", line, f"{name} is {word} without PROGRAM_COMPLETED: ended, or aborted")
            yield from self._finish(time, word)

    def _moved(self) -> bool:
        """Whether block numbers have changed in this run."""
        return any(len(set(track.values)) > 1 for track in self._tracks.values() if track.counts)

    # --- the ends of runs ---

    def _finish(self, end: float, word: str | None) -> Iterator[RunLog]:
        """Yield the run in progress; *word*: what ended it, None: the log ends first."""
        run = self._open
        assert run is not None
        self._open, self._given = None, True
        run.end, run.word = max(end, run.start), word  # items may be out of order
        run.lines, run.has_status = (run.lines[0], self._last_line), self._status is not None
        run.cut_end = word is None and run.has_status
        tracks = list(self._tracks.values())
        for part in run.restarted(tracks):
            found = run_of(part, tracks, self._feed_unit or self.notes.feed_unit, self.notes)
            if not len(found.block) and not any(track.counts and track.ever for track in tracks):
                what = f"no line numbers of the program: {self._sought('block')}, {_EXAMPLE}"
                raise RecordError(f"{self._source}:{part.lines[1]}: {what}")
            yield found
        for track in tracks:
            track.drop_until(run.end)

    def _end(self, last: float) -> Iterator[RunLog]:
        if self._first is None:
            raise RecordError(f"{self._source}: no usable item: {self._sought('block')}, {_EXAMPLE}")
        if self._open is not None:
            held = self._open.held
            if held is not None:
                self._open.holds.pop()
                self.notes.add("end", self._last_line, f"the log ends in {held.word}, taken as the end of the run")
                yield from self._finish(held.start, held.word)
            else:
                self.notes.add("end", self._last_line, "the log ends within the run")
                yield from self._finish(last, None)
        elif self._status is None:
            line, time, stamp = self._first
            self.notes.add("status", 0, "no item shows when the program runs: the whole log is one run")
            self._open = RunPart(self._source, time, stamp, (line, line))
            yield from self._finish(last, None)
        elif not self._given:
            raise RecordError(
                f"{self._source}:{self._last_line}: no run: {self._status.name} never shows a running program (ACTIVE)"
            )
