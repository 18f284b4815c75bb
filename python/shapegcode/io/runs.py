"""Runs of programs, cut out of the events of a log: the values of the log's items over time.

A run lasts from ACTIVE to PROGRAM_COMPLETED, READY or the like; `run_items.STATES` has the words of controls.
"""

from __future__ import annotations

import math
import re
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from shapegcode.errors import RecordError
from shapegcode.io.run_items import STATES, Event, FileNotes, Item, ItemTable, Role, State, plain_name
from shapegcode.io.units import FloatArray


@dataclass(frozen=True, eq=False)
class Signal:
    """One data item over time: each value is valid until the next one.

    Attributes:
        time_s: (n,) since the start of the run, not descending; values set before the start have a time of 0 or less.
        value: (n,) values in the log, in the item's unit.
        name: name of the item in the log.
    """

    time_s: FloatArray
    value: FloatArray
    name: str = ""

    def __len__(self) -> int:
        return len(self.time_s)


@dataclass(frozen=True, eq=False)
class RunLog:
    """One run of a program.

    Attributes:
        source: file.
        start: time stamp of the start in the file; empty if there is none.
        duration_s: from start to completion, including holds; None: the log does not show both.
        block: block numbers, see `block_counts`; empty if this run has none.
        feed: feed along the path; None: not logged.
        feed_unit: unit of the feed, such as "mm/s", a unit of `shapegcode.io.units`; None: the log
            does not state it.
        tool: tool number in the spindle; on some controls 0 during a change.
        spindle_rpm: speed of the spindle in 1/min.
        feed_override: ratio, 1: 100 %.
        rapid_override: ratio of the rapid override.
        position_mm: (axis, positions) of X, Y and Z, if logged; mm is assumed if the log states no unit.
        holds: (start_s, duration_s) of logged holds, interruptions and stops.
        program: program name in the log; None: no name.
        notes: gaps and ignored data, with the line.
        block_counts: meaning of `block`: "line" of the program file, from 1, or "sequence": N words.
        block_texts: (time_s, text) of the blocks, if the log has their text.
        gaps: (start_s, duration_s) of more than 30 s without log entries: a dwell, a long block, or the log or its
            clock was interrupted; in a Sinumerik Edge file, of any missing samples.
        lines: first and last line of the run in the file; (0, 0) if the file has no lines.
        ended_by: status at the end, such as "PROGRAM_COMPLETED"; None: `cut_end`, or the log has no status.
        cut_start: the log began within the run.
        cut_end: the log ended, its clock was set back, or the status became UNAVAILABLE or OFF, within the run.
    """

    source: str
    start: str
    duration_s: float | None
    block: Signal
    feed: Signal | None = None
    feed_unit: str | None = None
    tool: Signal | None = None
    spindle_rpm: Signal | None = None
    feed_override: Signal | None = None
    rapid_override: Signal | None = None
    position_mm: tuple[tuple[str, Signal], ...] = ()
    holds: tuple[tuple[float, float], ...] = ()
    program: str | None = None
    notes: tuple[str, ...] = ()
    block_counts: Literal["line", "sequence"] = "line"
    block_texts: tuple[tuple[float, str], ...] = field(default=())
    gaps: tuple[tuple[float, float], ...] = ()
    lines: tuple[int, int] = (0, 0)
    ended_by: str | None = None
    cut_start: bool = False
    cut_end: bool = False

    @property
    def complete(self) -> bool:
        """False if the log lacks the start or the end of the run."""
        return not (self.cut_start or self.cut_end)


_TEXT_ROLES: frozenset[Role] = frozenset({"status", "program", "block_text"})
_AXES: tuple[Role, ...] = ("x", "y", "z")
_SIGNALS: tuple[Role, ...] = (
    "block", "sequence", "feed", "tool", "spindle", "feed_override", "rapid_override", "runtime", *_AXES,
)  # fmt: skip
_COUNTS: frozenset[Role] = frozenset({"block", "sequence"})
#: Items whose last value before the start stays valid in the run; that of feed and block does not.
_KEPT: frozenset[Role] = frozenset({"tool", "spindle", "feed_override", "rapid_override"})
_LEAD_IN_S = 1.0  # a status is polled: values up to this much earlier belong to the run, too
_NAME_S = 5.0  # largest delay of the program name after the start
_LATE_START = 50  # a larger first block number is no start of a program
_RESTART_BLOCKS = 20  # a program that restarts after a hold goes back by more blocks than this
_CLOCKS_APART_S = 3.0  # allowed difference of clocks: whole seconds, shown late
_CLOCKS_APART = 0.01


@dataclass
class Hold:
    """A hold, an interruption or a stop in a log."""

    start: float
    word: str
    is_stop: bool
    end: float | None = None
    resumed: tuple[str, int] = ("", 0)  # time stamp and line


class Track:
    """Values of one item, in log order."""

    def __init__(self, item: Item) -> None:
        self.item, self.counts = item, item.role in _COUNTS
        self.times, self.values = array("d"), array("d")
        self.texts: list[str] | None = [] if item.role in _TEXT_ROLES else None
        self.ever = False

    @property
    def last_time(self) -> float:
        """Time of the last value."""
        return self.times[-1] if self.times else -math.inf

    def drop_until(self, end: float) -> None:
        """Drop values up to a time except the last one, which may still be valid."""
        if not self.times:
            return
        self.ever = True
        keep = len(self.times) - 1
        if self.last_time > end:
            before = np.flatnonzero(np.array(self.times) <= end)
            keep = int(before[-1]) if before.size else 0
        self.times, self.values = self.times[keep:], self.values[keep:]
        if self.texts is not None:
            self.texts = self.texts[keep:]

    def forget_times(self) -> None:
        """Keep only the last value, without its time, after the recorder's clock was set."""
        self.drop_until(self.last_time)
        if self.times:
            self.times[0] = -math.inf

    def signal(self, start: float, end: float) -> Signal:
        """The values of a run."""
        times, values = np.array(self.times), np.array(self.values)
        inside = (times >= start - _LEAD_IN_S) & (times <= end)
        before = np.flatnonzero(times < start - _LEAD_IN_S)
        first_is_late = not inside.any() or times[inside].min() > start
        times, kept = times[inside] - start, values[inside]
        if before.size and first_is_late and self.item.role in _KEPT:
            times, kept = np.append(0.0, times), np.append(values[before[-1]], kept)
        order = np.argsort(times, kind="stable")
        times, kept = times[order], kept[order]
        if self.counts and times.size:  # of two with equal time stamps the second one is used
            last = np.append(np.diff(times) > 0.0, True)
            times, kept = times[last], kept[last]
        return Signal(times, kept, self.item.name)


@dataclass
class RunPart:
    """Start and end of a run; times in s on the log's clock."""

    source: str
    start: float
    stamp: str
    lines: tuple[int, int]
    cut_start: bool = False
    end: float = math.inf
    word: str | None = None  # status that ended it; None: truncated
    cut_end: bool = False
    has_status: bool = True
    holds: list[Hold] = field(default_factory=list)
    gaps: list[tuple[float, float]] = field(default_factory=list)

    @property
    def held(self) -> Hold | None:
        """The hold in progress, if any."""
        return self.holds[-1] if self.holds and self.holds[-1].end is None else None

    def restarted(self, tracks: Sequence[Track]) -> Iterator[RunPart]:
        """Split the run where the program restarted after a hold or stop, although the log shows no end."""
        rest = self
        for hold in self.holds:
            if hold.end is None or not hold.resumed[0] or not _began_again(hold, rest, tracks):
                continue
            yield replace(rest, end=hold.start, word=hold.word, cut_end=False, lines=(rest.lines[0], hold.resumed[1]),
                          holds=[each for each in rest.holds if each.start < hold.start],
                          gaps=[each for each in rest.gaps if each[0] < hold.start])  # fmt: skip
            rest = replace(rest, start=hold.end, stamp=hold.resumed[0], cut_start=False,
                           lines=(hold.resumed[1], self.lines[1]),
                           holds=[each for each in rest.holds if each.start > hold.start],
                           gaps=[each for each in rest.gaps if each[0] > hold.start])  # fmt: skip
        yield rest


def _began_again(hold: Hold, part: RunPart, tracks: Sequence[Track]) -> bool:
    """Whether the block numbers after a hold are again those at the start of the run."""
    assert hold.end is not None
    for track in tracks:
        if not track.counts or not track.times:
            continue
        times, values = np.array(track.times), np.array(track.values)
        before = values[(times >= part.start - _LEAD_IN_S) & (times <= hold.start)]
        after = values[(times > hold.end - _LEAD_IN_S) & (times >= hold.start) & (times <= part.end)]
        if before.size > 1 and after.size:
            fall = before[-1] - after[0]
            least = 0 if hold.is_stop else _RESTART_BLOCKS
            return bool(after[0] <= before[before > 0.0].min(initial=np.inf) + 2.0 and fall > least)
    return False


def run_of(part: RunPart, tracks: Sequence[Track], feed_unit: str | None, notes: FileNotes) -> RunLog:
    """Build the log of one run."""
    signals = {role: _best(part, tracks, role, notes) for role in _SIGNALS}
    block, counts = signals["block"], "line"
    inside = ([p for p in pairs if p[0] >= -_LEAD_IN_S] for _, pairs in _text_values(part, tracks, "block_text"))
    texts = tuple(next(filter(None, inside), ()))
    if block is None:
        counts = "sequence"
        block = signals["sequence"] or _n_words(texts, notes)
    if block is None:
        notes.add("no block", part.lines[0], "no block numbers in this run")
        block, counts = Signal(np.empty(0), np.empty(0)), "line"
    elif (first := block.value[block.value > 0.0][:1]).size and first[0] > _LATE_START and counts == "line":
        notes.add(
            "late", part.lines[0], f"the first {block.name} is {first[0]:g}: the program or the log began in the middle"
        )
    _compare_clocks(part, signals["runtime"], notes)
    return RunLog(
        source=part.source,
        start=part.stamp,
        duration_s=part.end - part.start if part.has_status and not (part.cut_start or part.cut_end) else None,
        block=block,
        feed=signals["feed"],
        feed_unit=feed_unit if signals["feed"] is not None else None,
        tool=signals["tool"],
        spindle_rpm=signals["spindle"],
        feed_override=_override(signals["feed_override"], notes),
        rapid_override=_override(signals["rapid_override"], notes),
        position_mm=tuple((axis, found) for axis in _AXES if (found := signals[axis]) is not None),
        holds=tuple(
            (hold.start - part.start, (part.end if hold.end is None else hold.end) - hold.start) for hold in part.holds
        ),
        program=_program(part, tracks, notes),
        notes=notes.taken(),
        block_counts="line" if counts == "line" else "sequence",
        block_texts=texts,
        gaps=tuple((start - part.start, duration) for start, duration in part.gaps),
        lines=part.lines,
        ended_by=part.word,
        cut_start=part.cut_start,
        cut_end=part.cut_end,
    )


def _compare_clocks(part: RunPart, runtime: Signal | None, notes: FileNotes) -> None:
    if runtime is None or part.cut_start or part.cut_end or not part.has_status:
        return
    counted, clock = float(runtime.value[-1]), part.end - part.start
    if abs(counted - clock) > max(_CLOCKS_APART_S, _CLOCKS_APART * clock):
        notes.add(
            "clocks", part.lines[1], f"{runtime.name} is {counted:g} at the end, by the time stamps the run took "
            f"{clock:.1f} s: it was held, or a clock was set",
        )  # fmt: skip


def _best(part: RunPart, tracks: Sequence[Track], role: Role, notes: FileNotes) -> Signal | None:
    """Select among the items of a role by preferred name, then by number of values; note the others."""
    found = [
        (track.item.rank, -len(signal), index, signal)
        for index, track in enumerate(tracks)
        if track.item.role == role and len(signal := track.signal(part.start, part.end))
    ]
    found.sort(key=lambda each: each[:3])
    for _, _, _, other in found[1:]:
        notes.add(f"other {role}", part.lines[0], f"{other.name} ignored: {found[0][3].name} is used")
    return found[0][3] if found else None


def _text_values(part: RunPart, tracks: Sequence[Track], role: Role) -> Iterator[tuple[Item, list[tuple[float, str]]]]:
    """The text values until the end of a run, by item, preferred names first."""
    for track in sorted((track for track in tracks if track.item.role == role), key=lambda each: each.item.rank):
        pairs = zip(track.times, track.texts or (), strict=True)
        yield (
            track.item,
            [(time - part.start, text) for time, text in pairs if time <= part.end and text and text != "UNAVAILABLE"],
        )


def _n_words(texts: tuple[tuple[float, str], ...], notes: FileNotes) -> Signal | None:
    """Numbers of the N words of blocks that are logged as text only."""
    found = [
        (time, float(word[1])) for time, text in texts if (word := re.match(r"\s*/?\s*N(\d+)", text, re.IGNORECASE))
    ]
    if not found:
        return None
    notes.add("n words", 0, f"no line numbers: the N words of {len(found)} of {len(texts)} blocks are used")
    return Signal(np.array([time for time, _ in found]), np.array([number for _, number in found]), "N")


def _override(signal: Signal | None, notes: FileNotes) -> Signal | None:
    """Convert an override from percent to a ratio."""
    if signal is None:
        return None
    if signal.time_s[0] > 0.0:
        notes.add(
            f"late {signal.name}",
            0,
            f"{signal.name} is first logged at {signal.time_s[0]:.2f} s: the value before is unknown",
        )
    return Signal(signal.time_s, signal.value / 100.0, signal.name)


def _program(part: RunPart, tracks: Sequence[Track], notes: FileNotes) -> str | None:
    """Program name at the start or logged shortly after it, else the first one in the run."""
    for item, pairs in _text_values(part, tracks, "program"):
        early = [text for time, text in pairs if time <= _NAME_S]
        name = early[-1] if early else pairs[0][1] if pairs else None
        if name is not None:
            for time, text in pairs:
                if time > _NAME_S and text != name:
                    note = f"{item.name} is {text} from {time:.2f} s on: a called program, or another one"
                    notes.add("program", 0, note)
            return name
    return None


_DISORDER_S = 1.0  # smaller steps back come from an adapter's item order; larger ones from a clock that was set
_QUIET_S = 30.0  # a longer silence within a run is noted
_TEXT_VALUES = 8  # weight of a text value, in values
_EXAMPLE = 'for example items = { block = "Block_Number" }'
_IDLE_VALUES = 100_000  # limit of values stored between runs


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
            self.notes.add("disorder", line, f"its time stamp is {-step:.3f} s before that of the line above; sorted")
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
        """Handle too many values: a held run ends, a running one is an error; between runs old values are dropped."""
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
        """End a run that shows no completion; a held run ends where its hold began, except at UNAVAILABLE or OFF."""
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
        """End and yield the run in progress, in parts if restarted; *word*: what ended it; None: the log lacks it."""
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
