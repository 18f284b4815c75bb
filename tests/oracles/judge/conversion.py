"""Holds an emitted program against the one it was made from, read by this judge's interpreter.

How the two texts are laid side by side: a *strong* line is one no converter may touch, insert or drop (a
rapid, a dwell, M S T H D words, a reference return, a cycle, an offset or coordinate system, O and % lines).
Strong lines must be the same list in both. Between two of them lies a *gap*: at most one run of cutting lines
with blank, comment and modal-only lines before, inside and after it. Before and after the run the text must
be the original's to the letter.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from .interpreter import interpret
from .plant import contour_error_um, path_polyline
from .records import INCH_MM, MODAL_GROUPS, Interpretation, JudgeError, LineRecord, Move, canonical_g

Vector = npt.NDArray[np.float64]
Ranges = Sequence[tuple[int, int]]

#: G codes a converter may use freely inside a region (it has to restore what it changes).
WEAK_G = frozenset(("G00", "G01", "G02", "G03", "G09", "G17", "G18", "G19", "G61", "G64", "G90", "G91", "G93", "G94"))
WEAK_ADDRESSES = frozenset("GFNXYZIJKR")
METRIC_TOLERANCE_MM = 1.0e-3
INCH_TOLERANCE_MM = 1.3e-3
#: Radii at the two ends of an emitted arc may differ by this many least increments.
ARC_INCREMENTS = 2.0
LARGEST_SWEEP = math.pi / 2.0
_DUST = 1e-6


#: Groups whose codes are weak where they change nothing: G40 in a safe line, G21 in a metric program.
IDLE_GROUPS = frozenset(("comp", "units", "return_level", "wcs", "length_offset"))


def is_strong(record: LineRecord, inserted: frozenset[str] = frozenset()) -> bool:
    """Whether a converter must leave this line where it is, to the letter.

    `inserted` are lines that it was told to write around its regions.
    """
    if not record.executed:
        return True
    if record.text.rstrip("\r") in inserted:
        return False
    for address, number in record.words:
        if address not in WEAK_ADDRESSES:
            return True
        if address == "G" and not is_weak_code(canonical_g(number), record):
            return True
    return any(not move.is_cut for move in record.moves)


def is_weak_code(code: str, record: LineRecord) -> bool:
    """Whether a G code only says what a converter may say too: motion, plane, feed, or what holds anyway."""
    if code in WEAK_G:
        return True
    group = MODAL_GROUPS.get(code)
    return group in IDLE_GROUPS and record.modal_before[group] == code


def is_comment(record: LineRecord) -> bool:
    """A line that holds comments and nothing else."""
    return record.executed and record.is_blank and bool(record.comments)


@dataclass
class Gap:
    """The lines between two strong lines: prefix, run from its first to its last cutting line, suffix."""

    prefix: list[LineRecord]
    run: list[LineRecord]
    suffix: list[LineRecord]

    @property
    def lines(self) -> list[LineRecord]:
        """All lines in order."""
        return self.prefix + self.run + self.suffix

    @property
    def moves(self) -> list[Move]:
        """All moves in order."""
        return [m for r in self.lines for m in r.moves]

    @property
    def texts(self) -> list[str]:
        """The lines to the letter."""
        return [r.text for r in self.lines]


def split(program: Interpretation, inserted: frozenset[str] = frozenset()) -> tuple[list[LineRecord], list[Gap]]:
    """Strong lines, and the gaps before, between and after them (one more than the strong lines)."""
    strong: list[LineRecord] = []
    loose: list[list[LineRecord]] = [[]]
    for record in program.lines:
        if is_strong(record, inserted):
            strong.append(record)
            loose.append([])
        else:
            loose[-1].append(record)
    gaps = []
    for lines in loose:
        cutting = [i for i, r in enumerate(lines) if r.moves]
        first, last = (cutting[0], cutting[-1] + 1) if cutting else (len(lines), len(lines))
        gaps.append(Gap(lines[:first], lines[first:last], lines[last:]))
    return strong, gaps


def regions(program: Interpretation) -> list[tuple[int, int]]:
    """First and last line number of every maximal run of cutting lines."""
    return [(g.run[0].number, g.run[-1].number) for g in split(program)[1] if g.run]


class _Verdict:
    def __init__(
        self,
        original: Interpretation,
        emitted: Interpretation,
        ranges: Ranges | None,
        contour_tolerance_um: float | None,
        inserted: frozenset[str],
    ) -> None:
        self.inserted = inserted
        self.original = original
        self.emitted = emitted
        self.ranges = ranges
        self.contour_tolerance_um = contour_tolerance_um
        self.complaints: list[str] = []

    def say(self, message: str) -> None:
        self.complaints.append(message)

    # ---- alignment -----------------------------------------------------------------------------------------

    def judge(self) -> list[str]:
        strong, gaps = split(self.original)
        got, got_gaps = split(self.emitted, self.inserted)
        for theirs, ours in zip(got, strong, strict=False):
            if theirs.text != ours.text:
                self.say(
                    f"(a) original line {ours.number} {ours.text!r} is not in its place: "
                    f"emitted line {theirs.number} is {theirs.text!r}"
                )
                return self.finish()
        if len(got) != len(strong):
            self.say(f"(a) {len(strong)} lines had to stay to the letter, {len(got)} such lines were emitted")
            return self.finish()
        for ours, theirs in zip(strong, got, strict=True):
            self.compare_states(ours, theirs)
        for gap, got_gap in zip(gaps, got_gaps, strict=True):
            self.gap(gap, got_gap)
        return self.finish()

    def finish(self) -> list[str]:
        self.sequence_numbers()
        return self.complaints

    # ---- (b) states ----------------------------------------------------------------------------------------

    def compare_states(self, ours: LineRecord, theirs: LineRecord) -> None:
        where = f"at {ours.text.strip()!r} (original line {ours.number}, emitted line {theirs.number})"
        self.compare_state(ours.modal_before, theirs.modal_before, f"before and {where}")
        if not self.complaints or where not in self.complaints[-1]:
            self.compare_state(ours.modal, theirs.modal, f"after and {where}")

    def compare_state(self, ours: dict[str, Any], theirs: dict[str, Any], where: str) -> None:
        tolerance = INCH_TOLERANCE_MM if ours["units"] == "G20" else METRIC_TOLERANCE_MM
        for key, value in ours.items():
            other = theirs[key]
            if isinstance(value, np.ndarray):
                apart = np.where(np.isnan(value) & np.isnan(other), 0.0, np.abs(value - other))
                if not (apart <= tolerance + _DUST).all():
                    self.say(f"(b) {key} {other} instead of {value} mm {where}")
            elif isinstance(value, float):
                same = (math.isnan(value) and math.isnan(other)) or math.isclose(value, other, rel_tol=1e-9)
                if not same:
                    self.say(f"(b) {key} {other:g} instead of {value:g} {where}")
            elif value != other:
                self.say(f"(b) {key} {other} instead of {value} {where}")

    # ---- gaps ----------------------------------------------------------------------------------------------

    def gap(self, ours: Gap, theirs: Gap) -> None:
        if not ours.run or not any(self.is_shaped(r) for r in ours.run):
            if ours.texts != theirs.texts:
                self.differing_text(ours, theirs)
            return
        start = ours.run[0].number
        if ours.texts == theirs.texts:
            return  # Left as it was: nothing here is the converter's.
        if not theirs.moves:
            self.say(f"(e) the cutting lines {start}–{ours.run[-1].number} have vanished")
            return
        lines = theirs.lines
        before = self.match_front(ours.prefix, lines)
        after = self.match_back(ours.suffix, lines[before:])
        middle = lines[before : len(lines) - after]
        self.match_inside(ours, middle)
        self.run_end(ours, theirs)
        self.emitted_moves(ours, middle)
        self.exact_stops(ours, theirs)
        self.contour(ours, theirs)

    def is_shaped(self, record: LineRecord) -> bool:
        """Whether the converter says, or may be taken to say, that it shaped this line."""
        return self.ranges is None or any(a <= record.number <= b for a, b in self.ranges)

    def differing_text(self, ours: Gap, theirs: Gap) -> None:
        for a, b in zip(ours.lines, theirs.lines, strict=False):
            if a.text != b.text:
                self.say(
                    f"(a) outside every region: original line {a.number} {a.text!r}, emitted line {b.number} {b.text!r}"
                )
                return
        extra = theirs.texts[len(ours.texts) :] or ours.texts[len(theirs.texts) :]
        verb = "inserted" if len(theirs.texts) > len(ours.texts) else "dropped"
        near = (ours.lines or theirs.lines)[-1].number
        self.say(f"(a) outside every region, near line {near}: {verb} {extra}")

    def match_front(self, prefix: list[LineRecord], lines: list[LineRecord]) -> int:
        for i, record in enumerate(prefix):
            if i >= len(lines) or lines[i].text != record.text:
                found = lines[i].text if i < len(lines) else "nothing"
                self.say(f"(a) line {record.number} {record.text!r} before a region became {found!r}")
                return i
            self.compare_states(record, lines[i])
        return len(prefix)

    def match_back(self, suffix: list[LineRecord], lines: list[LineRecord]) -> int:
        """How many lines at the end belong to the suffix; modal-only lines may stand between its lines."""
        used = 0
        for record in reversed(suffix):
            at = used
            while at < len(lines) and lines[-1 - at].text != record.text and not lines[-1 - at].moves:
                at += 1
            if at >= len(lines) or lines[-1 - at].text != record.text:
                found = lines[-1 - used].text if used < len(lines) else "nothing"
                self.say(f"(a) line {record.number} {record.text!r} after a region became {found!r}")
                return used
            if not record.is_blank:
                self.compare_states(record, lines[-1 - at])
            used = at + 1
        return used

    def match_inside(self, ours: Gap, middle: list[LineRecord]) -> None:
        """Comments inside the run, and every line outside the ranges said to be shaped, in order."""
        texts = [r.text for r in middle]
        at = 0
        for record in ours.run:
            shaped = self.is_shaped(record)
            if shaped and not is_comment(record):
                continue
            try:
                at = texts.index(record.text, at) + 1
            except ValueError:
                kind = "comment" if shaped else "line outside the shaped ranges"
                self.say(f"(a) {kind} {record.text!r} (original line {record.number}) is lost")

    def run_end(self, ours: Gap, theirs: Gap) -> None:
        """(e) end points of the run, absolute or, from an unknown origin, as travel."""
        record, other = ours.run[-1], theirs.lines[-1]
        tolerance = INCH_TOLERANCE_MM if record.modal["units"] == "G20" else METRIC_TOLERANCE_MM
        for key in ("position", "drift"):
            value, found = record.modal[key], other.modal[key]
            apart = np.where(np.isnan(value) & np.isnan(found), 0.0, np.abs(value - found))
            if not (apart <= tolerance + _DUST).all():
                self.say(
                    f"(e) run of lines {ours.run[0].number}–{record.number}: {key} at its end is {found} "
                    f"instead of {value}"
                )

    # ---- (c) what was written ------------------------------------------------------------------------------

    def emitted_moves(self, ours: Gap, middle: list[LineRecord]) -> None:
        kept = {(r.text, tuple(self.shape(m) for m in r.moves)) for r in ours.run}
        known = not np.isnan([m.delta for m in ours.moves]).any()
        placed = np.asarray(~np.isnan(np.array([m.end for m in ours.moves])).any(axis=0))
        for record in middle:
            if (record.text, tuple(self.shape(m) for m in record.moves)) in kept:
                continue
            if record.number in self.emitted.one_digit_feeds:
                self.say(f"(c) emitted line {record.number} {record.text!r} has a one-digit F")
            for move in record.moves:
                self.one_move(record, move, known, placed)

    @staticmethod
    def shape(move: Move) -> tuple[object, ...]:
        return move.kind, tuple(np.round(move.delta, 6)), None if move.sweep is None else round(move.sweep, 6)

    def one_move(self, record: LineRecord, move: Move, known: bool, placed: npt.NDArray[np.bool_]) -> None:
        where = f"emitted line {record.number} {record.text!r}"
        if known and np.isnan(move.delta).any():
            self.say(f"(e) {where}: displacement {move.delta}")
        if np.isnan(move.end[placed]).any() or math.isnan(move.feed):
            self.say(f"(e) {where}: end {move.end}, feed {move.feed}")
        if move.kind != "arc":
            return
        assert move.sweep is not None and move.radius is not None and move.end_radius is not None
        if abs(move.sweep) >= LARGEST_SWEEP:
            self.say(f"(c) {where}: sweep {math.degrees(move.sweep):.2f}°")
        increment = 1e-4 * INCH_MM if record.modal["units"] == "G20" else 1e-3
        if abs(move.radius - move.end_radius) > ARC_INCREMENTS * increment + _DUST:
            self.say(f"(c) {where}: start radius {move.radius:.5f}, end radius {move.end_radius:.5f}")

    def exact_stops(self, ours: Gap, theirs: Gap) -> None:
        """(f) the end of every exact-stop block (G09, G61) must be the end of an emitted block, in order."""
        if np.isnan([m.delta for m in ours.moves + theirs.moves]).any():
            return
        inch = ours.run[-1].modal["units"] == "G20"
        tolerance = (INCH_TOLERANCE_MM if inch else METRIC_TOLERANCE_MM) + _DUST
        corners = np.cumsum([m.delta for m in theirs.moves], axis=0)
        at, travelled = 0, np.zeros(3)
        for record in ours.lines:
            for move in record.moves:
                travelled = travelled + move.delta
                if not record.exact_stop:
                    continue
                hits = np.flatnonzero((np.abs(corners[at:] - travelled) <= tolerance).all(axis=1))
                if len(hits) == 0:
                    self.say(f"(f) no block ends at the exact stop of line {record.number} {record.text!r}")
                    return
                at += int(hits[0])

    def contour(self, ours: Gap, theirs: Gap) -> None:
        """(g) the emitted path stays near the programmed one, and the programmed one near the emitted."""
        if self.contour_tolerance_um is None:
            return
        if np.isnan([m.delta for m in ours.moves + theirs.moves]).any():
            return
        for what, path, points in (("emitted", ours, theirs), ("programmed", theirs, ours)):
            error = contour_error_um(path_polyline(points.moves), path.moves).max_um
            if error > self.contour_tolerance_um:
                self.say(
                    f"(g) run of lines {ours.run[0].number}–{ours.run[-1].number}: {what} path is up to "
                    f"{error:.1f} µm off the other, {self.contour_tolerance_um:.1f} µm allowed"
                )

    # ---- (d) sequence numbers ------------------------------------------------------------------------------

    def sequence_numbers(self) -> None:
        ours = [n for r in self.original.lines for n in r.n_words]
        theirs = [n for r in self.emitted.lines for n in r.n_words]
        at = 0
        for n in ours:
            try:
                at = theirs.index(n, at) + 1
            except ValueError:
                self.say(f"(d) N{n} is lost or out of order")
        before, after = Counter(ours), Counter(theirs)
        for n in sorted(set(ours)):
            if after[n] > before[n]:
                self.say(f"(d) N{n} occurs {after[n]} times instead of {before[n]}")


def verify_conversion(
    original_text: str,
    emitted_text: str,
    region_line_ranges: Ranges | None = None,
    *,
    calculator_decimal_point: bool = True,
    arc_centre: Literal["incremental", "absolute"] = "incremental",
    contour_tolerance_um: float | None = None,
    inserted: Collection[str] = (),
) -> list[str]:
    """Complaints about an emitted program; an empty list is an acquittal.

    (a) text outside shaped regions is the original's to the letter, (b) position and modal state are the same
    before and after every kept line, (c) emitted arcs sweep less than 90° and have one radius, no emitted F
    has one digit and no point, (d) every N word is there in order and no more often, (e) no NaN, every run
    ends where it ended, (f) exact stops are still block ends, (g) with `contour_tolerance_um`: the two paths
    of every run are no further apart (each from the other; not in time). `region_line_ranges` are (first,
    last) 1-based original lines said to be shaped: what lies outside them is then held to the letter too.
    `inserted` are lines (without line end) that the converter was told to write around every region.
    Texts are compared with their line ends (CR included).

    Raises JudgeError if the *original* cannot be interpreted.
    """
    original = interpret(original_text, calculator_decimal_point=calculator_decimal_point, arc_centre=arc_centre)
    try:
        emitted = interpret(emitted_text, calculator_decimal_point=calculator_decimal_point, arc_centre=arc_centre)
    except JudgeError as error:
        return [f"(e) the emitted program cannot be interpreted: {error}"]
    return _Verdict(original, emitted, region_line_ranges, contour_tolerance_um, frozenset(inserted)).judge()
