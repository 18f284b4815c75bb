"""One run of a program in a log, and the values of its items over time."""

from __future__ import annotations

import math
import re
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from shapegcode.io.run_items import FileNotes, Item, Role
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
        duration_s: from start to completion, including holds; None: not both are in the log.
        block: block numbers, see `block_counts`; empty if this run has none.
        feed: feed along the path; None: not logged.
        feed_unit: unit of the feed, such as "mm/s", a unit of `shapegcode.io.units`; None: the log
            does not state it.
        tool: tool number in the spindle; on some controls 0 during a change.
        spindle_rpm: speed of the spindle in 1/min.
        feed_override: ratio, 1: 100 %.
        rapid_override: ratio of the rapid override.
        position_mm: (axis, positions in mm or degrees) of the logged axes.
        holds: (start_s, duration_s) of logged holds, interruptions and stops.
        program: program name in the log; None: no name.
        notes: gaps and ignored data, with the line.
        block_counts: meaning of `block`: "line" of the program file, from 1, or "sequence": N words.
        block_texts: (time_s, text) of the blocks, if the log has their text.
        gaps: (start_s, duration_s) of long times without log entries: a dwell, a long block, or the log
            or its clock was interrupted.
        lines: first and last line of the run in the file; (0, 0) if the file has no lines.
        ended_by: status at the end, such as "PROGRAM_COMPLETED"; None: the log ends before.
        cut_start: the log began within the run.
        cut_end: the log ended, or its clock was set back, within the run.
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
        """Whether the log contains the run from its start to its end."""
        return not (self.cut_start or self.cut_end)


_TEXT_ROLES: frozenset[Role] = frozenset({"status", "program", "block_text"})
_AXES: tuple[Role, ...] = ("x", "y", "z")
_SIGNALS: tuple[Role, ...] = (
    "block", "sequence", "feed", "tool", "spindle", "feed_override", "rapid_override", "runtime", *_AXES,
)  # fmt: skip
_COUNTS: frozenset[Role] = frozenset({"block", "sequence"})
#: Values set before the start remain valid; feed and block are unknown after this time.
_KEPT: frozenset[Role] = frozenset({"tool", "spindle", "feed_override", "rapid_override"})
_LEAD_IN_S = 1.0  # a status is polled: values so shortly before it belong to the run
_NAME_S = 5.0  # largest delay of the program name after the start
_LATE_START = 50  # a larger first block number is no start of a program
_RESTART_BLOCKS = 20  # a program restarted after a hold goes back by more blocks
_CLOCKS_APART_S = 3.0  # allowed difference of clocks: whole seconds, shown late
_CLOCKS_APART = 0.01


@dataclass
class Hold:
    """A hold, an interruption, a stop."""

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
        """Split it where the program restarted after a stop without an end in the log."""
        rest = self
        for hold in self.holds:
            if hold.end is None or not hold.resumed[0] or not _began_anew(hold, rest, tracks):
                continue
            yield replace(rest, end=hold.start, word=hold.word, cut_end=False, lines=(rest.lines[0], hold.resumed[1]),
                          holds=[each for each in rest.holds if each.start < hold.start],
                          gaps=[each for each in rest.gaps if each[0] < hold.start])  # fmt: skip
            rest = replace(rest, start=hold.end, stamp=hold.resumed[0], cut_start=False,
                           lines=(hold.resumed[1], self.lines[1]),
                           holds=[each for each in rest.holds if each.start > hold.start],
                           gaps=[each for each in rest.gaps if each[0] > hold.start])  # fmt: skip
        yield rest


def _began_anew(hold: Hold, part: RunPart, tracks: Sequence[Track]) -> bool:
    """Whether the block numbers return to the start of the run."""
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
    """Build the run."""
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
    """The signal of the item with the best name, then with most values; others are noted."""
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
    """The text values until the end of a run, by item, preferred names first; items without values are omitted."""
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
    """Program name at the start, or logged shortly after it."""
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
