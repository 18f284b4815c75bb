"""A FANUC milling interpreter that shares nothing with the converter it judges.

It is deliberately slow and plain: one function per idea, no look-ahead, no speed. Lengths are mm, feeds
mm/min, angles rad. What the program alone does not determine is NaN: positions before the first absolute
word, after a reference return, a machine-coordinate move, a tool change or a change of work coordinate
system.

Dialect and alarm numbers: FANUC operator's manuals as summarised in the project's `fanuc.md`, A1 to A5.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from .records import (
    AXES,
    AXIS_TAKERS,
    CENTRE_WORDS,
    DUST_MM,
    FULL_TURN,
    INCH_MM,
    INERT,
    INTEGER_ADDRESSES,
    MODAL_GROUPS,
    PLANES,
    SCALED_ADDRESSES,
    WAKE_UP,
    Interpretation,
    JudgeError,
    Kind,
    LineRecord,
    Move,
    Vector,
    canonical_g,
    split_line,
)


def initial_state() -> dict[str, Any]:
    """The modal state a control wakes up in. `drift` is the travel since an axis became unknown."""
    return {
        **WAKE_UP,
        "F": math.nan,
        "position": np.full(3, np.nan),
        "drift": np.zeros(3),
        "local_offset": np.zeros(3),
    }


class _Interpreter:
    """Carries the modal state from line to line."""

    def __init__(self, calculator: bool, absolute_centre: bool, state: dict[str, Any], arc_tolerance_mm: float) -> None:
        self.calculator = calculator
        self.absolute_centre = absolute_centre
        self.arc_tolerance_mm = arc_tolerance_mm
        self.state = state
        self.remarks: list[tuple[int, str]] = []
        self.one_digit_feeds: list[int] = []
        self.line = 0
        self.cycle_words: dict[str, float] = {}
        self.initial_level: tuple[float, float] = (math.nan, 0.0)
        self.h_word = ""
        self.spindle = math.nan

    # ---- small helpers -------------------------------------------------------------------------------------

    def fail(self, message: str) -> JudgeError:
        return JudgeError(self.line, message)

    def remark(self, message: str) -> None:
        self.remarks.append((self.line, message))

    def snapshot(self) -> dict[str, Any]:
        return {k: v.copy() if isinstance(v, np.ndarray) else v for k, v in self.state.items()}

    @property
    def unit_mm(self) -> float:
        return INCH_MM if self.state["units"] == "G20" else 1.0

    def length(self, address: str, number: str) -> float:
        """A coordinate word in mm, or a rotary word in degrees."""
        value = float(number)
        inch = self.state["units"] == "G20"
        if "." not in number and not self.calculator:
            value *= 0.0001 if inch else 0.001
        return value * (1.0 if address in "ABC" else self.unit_mm)

    def forget(self, axes: tuple[int, ...] = (0, 1, 2)) -> None:
        """The position of these axes is no longer known."""
        for k in axes:
            self.state["position"][k] = math.nan
            self.state["drift"][k] = 0.0

    def target(self, words: Mapping[str, float]) -> tuple[Vector, Vector]:
        """End position and displacement for the axis words given, under G90 or G91."""
        start = self.state["position"]
        end, delta = start.copy(), np.zeros(3)
        for k, axis in enumerate(AXES):
            if axis in words:
                if self.state["distance"] == "G91":
                    end[k], delta[k] = start[k] + words[axis], words[axis]
                else:
                    end[k], delta[k] = words[axis], words[axis] - start[k]
        return end, delta

    def advance(self, move: Move) -> Move:
        """Take the position to the end of a move."""
        self.state["position"] = move.end.copy()
        known = ~np.isnan(move.end)
        self.state["drift"] = np.where(known, 0.0, self.state["drift"] + move.delta)
        return move

    def straight(self, kind: Kind, end: Vector, delta: Vector, *, feed: float = math.nan, cycle: bool = False) -> Move:
        start = self.state["position"].copy()
        return self.advance(Move(kind, self.line, start, end.copy(), delta.copy(), feed=feed, cycle=cycle))

    # ---- one line ------------------------------------------------------------------------------------------

    def run(self, number: int, words: list[tuple[str, str]]) -> tuple[list[Move], float, bool]:
        """Execute one block. Returns its moves, its dwell and whether the program ends with it."""
        self.line = number
        g_codes = [canonical_g(v) for a, v in words if a == "G"]
        self.check_words(words, g_codes)
        new_wcs = self.wcs_of(words)
        self.set_modes(g_codes, words)
        values = self.values(words)
        self.set_feed(words, values)
        m_codes = [int(v) for a, v in words if a == "M"]
        if 98 in m_codes:
            raise self.fail("subprogram call M98 is not judged")

        moves: list[Move] = []
        dwell = 0.0
        takers = [g for g in g_codes if g in AXIS_TAKERS]
        axis_words = {a: values[a] for a in AXES if a in values}
        if new_wcs is not None and new_wcs != self.state["wcs"]:
            self.forget()
            self.state["wcs"] = new_wcs
        if len(set(takers)) > 1:
            raise self.fail(f"one-shot codes {takers} contend for the axis words")
        if takers:
            dwell = self.one_shot(takers[0], words, values, axis_words, moves)
        elif self.state["cycle"] != "G80" and (axis_words or "R" in values):
            self.drill(values, axis_words, moves)
        elif axis_words or (self.state["motion"] in ("G02", "G03") and any(a in values for a in "IJKR")):
            self.travel(values, axis_words, moves)
        if 6 in m_codes:
            self.forget()
        return moves, dwell, any(m in (2, 30, 99) for m in m_codes)

    def check_words(self, words: list[tuple[str, str]], g_codes: list[str]) -> None:
        seen: set[str] = set()
        for address, number in words:
            if address in INTEGER_ADDRESSES and "." in number:
                raise self.fail(f"decimal point in {address}{number} (alarm 007)")
            if address in "NOMTDH" and number.startswith("-"):
                raise self.fail(f"negative {address}{number} (alarm 006)")
            if address not in "GM" and address in seen:
                self.remark(f"address {address} stands twice; the last one counts")
            seen.add(address)
            if address == "F" and re.fullmatch(r"\+?\d", number):
                self.one_digit_feeds.append(self.line)
                self.remark(f"F{number} without a decimal point may select a stored feed")
            if address == "N" and int(number) == 0:
                self.remark("sequence number 0")
        for code in g_codes:
            if code not in MODAL_GROUPS and code not in AXIS_TAKERS and code not in INERT:
                raise self.fail(f"G code {code} is not judged")

    def wcs_of(self, words: list[tuple[str, str]]) -> str | None:
        wcs = None
        for address, number in words:
            if address == "G" and MODAL_GROUPS.get(canonical_g(number)) == "wcs":
                wcs = canonical_g(number)
        extra = [number for address, number in words if address == "P"]
        if wcs in ("G54", "G54.1") and extra:
            wcs = f"G54.1P{int(float(extra[-1]))}"
        return wcs

    def set_modes(self, g_codes: list[str], words: list[tuple[str, str]]) -> None:
        before = dict(self.state)
        for code in g_codes:
            group = MODAL_GROUPS.get(code)
            if group is not None and group != "wcs":
                self.state[group] = code
        if any(MODAL_GROUPS.get(c) == "motion" for c in g_codes) and not any(
            MODAL_GROUPS.get(c) == "cycle" for c in g_codes
        ):
            self.state["cycle"] = "G80"
        if before["cycle"] == "G80" and self.state["cycle"] != "G80":
            self.cycle_words = {}
            normal = PLANES[self.state["plane"]][2]
            self.initial_level = (float(self.state["position"][normal]), float(self.state["drift"][normal]))
        if before["feed_mode"] != self.state["feed_mode"] or before["units"] != self.state["units"]:
            self.state["F"] = math.nan
        for address, number in words:
            if address == "H":
                self.h_word = f"H{int(number)}"
        code = str(self.state["length_offset"])[:3]
        self.state["length_offset"] = code if code == "G49" else code + self.h_word

    def values(self, words: list[tuple[str, str]]) -> dict[str, float]:
        out: dict[str, float] = {}
        for address, number in words:
            if address in SCALED_ADDRESSES:
                out[address] = self.length(address, number)
            elif address not in "GN":
                out[address] = float(number)
        return out

    def set_feed(self, words: list[tuple[str, str]], values: Mapping[str, float]) -> None:
        self.spindle = values.get("S", self.spindle)
        if "F" in values:
            self.state["F"] = values["F"] * (1.0 if self.state["feed_mode"] == "G93" else self.unit_mm)

    # ---- one-shot codes ------------------------------------------------------------------------------------

    def one_shot(
        self,
        code: str,
        words: list[tuple[str, str]],
        values: Mapping[str, float],
        axis_words: Mapping[str, float],
        moves: list[Move],
    ) -> float:
        if code == "G04":
            return self.dwell(words)
        named = tuple(k for k, a in enumerate(AXES) if a in axis_words)
        position: Vector = self.state["position"]
        if code in ("G28", "G30"):
            if named:
                end, delta = self.target(axis_words)
                moves.append(self.straight("rapid", end, delta))
                self.to_machine_position(named, moves)
        elif code == "G53":
            if named:
                self.to_machine_position(named, moves)
        elif code == "G52":
            for k in named:
                position[k] += self.state["local_offset"][k] - axis_words[AXES[k]]
                self.state["local_offset"][k] = axis_words[AXES[k]]
        elif code == "G92":
            for k in named:
                position[k] = axis_words[AXES[k]]
                self.state["drift"][k] = self.state["local_offset"][k] = 0.0
        elif code == "G92.1" or (code == "G10" and values.get("L") in (2.0, 20.0)):
            self.forget()
        return 0.0

    def to_machine_position(self, named: tuple[int, ...], moves: list[Move]) -> None:
        end: Vector = self.state["position"].copy()
        delta = np.zeros(3)
        for k in named:
            end[k] = delta[k] = math.nan
        moves.append(self.straight("rapid", end, delta))
        self.forget(named)

    def dwell(self, words: list[tuple[str, str]]) -> float:
        seconds = 0.0
        for address, number in words:
            if address == "P":
                if "." in number:
                    raise self.fail(f"decimal point in G04 P{number} (alarm 007)")
                seconds = float(number) / 1000.0
            elif address in "XU":
                plain = "." not in number and not self.calculator
                seconds = float(number) * (0.001 if plain else 1.0)
        if seconds < 0.0:
            raise self.fail("negative dwell (alarm 006)")
        return seconds

    # ---- motion --------------------------------------------------------------------------------------------

    def block_feed(self, length: float) -> float:
        """Feed of this block in mm/min."""
        feed = float(self.state["F"])
        if not feed > 0.0:
            raise self.fail("cutting without a feed (alarm 011)")
        if self.state["feed_mode"] == "G93":
            return feed * length
        return feed * self.spindle if self.state["feed_mode"] == "G95" else feed

    def travel(self, values: Mapping[str, float], axis_words: Mapping[str, float], moves: list[Move]) -> None:
        motion = self.state["motion"]
        end, delta = self.target(axis_words)
        if motion in ("G02", "G03"):
            moves.append(self.advance(self.arc(values, end, delta)))
            return
        ignored = [a for a in "IJKR" if a in values]
        if ignored:
            self.remark(f"words {ignored} have no meaning in {motion}")
        if motion == "G00":
            moves.append(self.straight("rapid", end, delta))
        else:
            length = float(np.sqrt(np.sum(delta**2)))
            moves.append(self.straight("line", end, delta, feed=self.block_feed(length)))

    def arc(self, values: Mapping[str, float], end: Vector, delta: Vector) -> Move:
        a, b, normal = PLANES[self.state["plane"]]
        start: Vector = self.state["position"].copy()
        da, db = float(delta[a]), float(delta[b])
        if math.isnan(da) or math.isnan(db):
            raise self.fail("absolute arc end from an unknown position")
        clockwise = self.state["motion"] == "G02"
        if "R" in values:
            ca, cb = self.centre_from_r(values["R"], da, db, clockwise)
        else:
            ca, cb = self.centre_from_words(values, a, b, start)
        if CENTRE_WORDS[normal] in values:
            self.remark(f"{CENTRE_WORDS[normal]} lies outside the plane {self.state['plane']}")
        radius, end_radius = math.hypot(ca, cb), math.hypot(da - ca, db - cb)
        if radius <= DUST_MM:
            raise self.fail("arc with radius zero (alarm 020)")
        if abs(end_radius - radius) > self.arc_tolerance_mm:
            raise self.fail(
                f"arc end is {abs(end_radius - radius):.4f} mm off its radius: start radius {radius:.4f}, "
                f"end radius {end_radius:.4f}, tolerance {self.arc_tolerance_mm:.4f} (alarm 020)"
            )
        sweep = (math.atan2(db - cb, da - ca) - math.atan2(-cb, -ca)) * (-1.0 if clockwise else 1.0) % FULL_TURN
        if math.hypot(da, db) <= DUST_MM:
            sweep = FULL_TURN
        offset = np.zeros(3)
        offset[a], offset[b] = ca, cb
        return Move(
            "arc",
            self.line,
            start,
            end,
            delta,
            centre=start + offset,
            centre_offset=offset,
            radius=radius,
            end_radius=end_radius,
            sweep=-sweep if clockwise else sweep,
            normal_axis=normal,
            feed=self.block_feed(radius),  # in G93 the F of an arc counts its radius
        )

    def centre_from_words(self, values: Mapping[str, float], a: int, b: int, start: Vector) -> tuple[float, float]:
        given = [CENTRE_WORDS[k] for k in (a, b) if CENTRE_WORDS[k] in values]
        if not given:
            raise self.fail("arc without R and without a centre in its plane (alarm 022)")
        if not self.absolute_centre:
            return values.get(CENTRE_WORDS[a], 0.0), values.get(CENTRE_WORDS[b], 0.0)
        if len(given) < 2:
            raise self.fail(f"absolute arc centre needs both {CENTRE_WORDS[a]} and {CENTRE_WORDS[b]}")
        centre = values[CENTRE_WORDS[a]] - float(start[a]), values[CENTRE_WORDS[b]] - float(start[b])
        if math.isnan(centre[0]) or math.isnan(centre[1]):
            raise self.fail("absolute arc centre from an unknown position")
        return centre

    def centre_from_r(self, r: float, da: float, db: float, clockwise: bool) -> tuple[float, float]:
        """Centre relative to the start: the shorter sweep for R > 0, the longer one for R < 0."""
        chord = math.hypot(da, db)
        if abs(r) <= DUST_MM:
            raise self.fail("arc with radius zero (alarm 020)")
        if chord <= DUST_MM:
            raise self.fail("R cannot express a full circle: the end is the start")
        half = 0.5 * chord
        if half - abs(r) > self.arc_tolerance_mm:
            raise self.fail(f"arc radius {abs(r):.4f} is shorter than half the chord {half:.4f} (alarm 020)")
        height = math.sqrt(max(r * r - half * half, 0.0))
        # Left of the chord for a short counter-clockwise arc; each of "clockwise" and "long" changes the
        # side.
        side = -1.0 if clockwise != (r < 0.0) else 1.0
        return 0.5 * da - side * height * db / chord, 0.5 * db + side * height * da / chord

    # ---- drilling cycles -----------------------------------------------------------------------------------

    def drill(self, values: Mapping[str, float], axis_words: Mapping[str, float], moves: list[Move]) -> None:
        """One hole or K of them: rapid over it, rapid to R, cut to depth, rapid back. No pecks."""
        normal = PLANES[self.state["plane"]][2]
        depth_axis = AXES[normal]
        incremental = self.state["distance"] == "G91"
        for address in (depth_axis, "R", "Q"):
            if address in values:
                self.cycle_words[address] = values[address]
        if depth_axis not in self.cycle_words:
            raise self.fail(f"{self.state['cycle']} without its depth {depth_axis}")
        count = int(values.get("K", values.get("L", 1.0)) / (self.unit_mm if "K" in values else 1.0))
        level, level_drift = self.initial_level
        for _ in range(count):
            over = {a: v for a, v in axis_words.items() if a != depth_axis}
            end, delta = self.target(over)
            if over:
                moves.append(self.straight("rapid", end, delta, cycle=True))
            r_word = self.cycle_words.get("R", 0.0 if incremental else level)
            r_level = level + r_word if incremental else r_word
            bottom = r_level + self.cycle_words[depth_axis] if incremental else self.cycle_words[depth_axis]
            self.plunge("rapid", normal, r_level, moves)
            self.plunge("line", normal, bottom, moves)
            back = level if self.state["return_level"] == "G98" else r_level
            self.plunge("rapid", normal, back, moves)
            if math.isnan(back):
                self.state["drift"][normal] = level_drift + (0.0 if self.state["return_level"] == "G98" else r_word)

    def plunge(self, kind: Kind, normal: int, level: float, moves: list[Move]) -> None:
        end: Vector = self.state["position"].copy()
        delta = np.zeros(3)
        delta[normal] = level - end[normal]
        end[normal] = level
        feed = self.block_feed(abs(float(delta[normal]))) if kind == "line" else math.nan
        moves.append(self.straight(kind, end, delta, feed=feed, cycle=True))


def interpret(
    text: str,
    *,
    calculator_decimal_point: bool = True,
    arc_centre: Literal["incremental", "absolute"] = "incremental",
    start_state: Mapping[str, Any] | None = None,
    arc_tolerance_mm: float = 0.01,
) -> Interpretation:
    """Interpret a program line by line.

    `calculator_decimal_point`: `X10` is 10 mm (parameter 3401#0 = 1) instead of 10 least increments.
    `arc_centre`: whether I J K count from the start of the arc or are coordinates. `start_state` overrides
    entries of `initial_state()`. `arc_tolerance_mm`: allowed difference of the radii at the two ends of an
    arc.

    Raises JudgeError, with the line, on whatever a control would refuse or this judge does not follow.
    """
    if arc_centre not in ("incremental", "absolute"):
        raise ValueError(f"arc_centre must be 'incremental' or 'absolute', not {arc_centre!r}")
    state = initial_state()
    for key, value in (start_state or {}).items():
        if key not in state:
            raise ValueError(f"unknown modal state {key!r}")
        state[key] = np.array(value, dtype=float) if isinstance(state[key], np.ndarray) else value
    machine = _Interpreter(calculator_decimal_point, arc_centre == "absolute", state, arc_tolerance_mm)
    records: list[LineRecord] = []
    ended = begun = False
    for number, raw in enumerate(text.split("\n"), start=1):
        before = machine.snapshot()
        if ended or raw.strip().startswith("%"):
            # The first % opens the tape and its line is a title; a later one ends reading.
            ended = ended or begun
            begun = True
            records.append(LineRecord(number, raw, (), (), before, before, executed=False))
            continue
        words, comments = split_line(raw, number)
        begun = begun or bool(words)
        moves, dwell, ended = machine.run(number, words)
        stop = bool(moves) and (machine.state["exact_stop"] == "G61" or ("G", "09") in _g_pairs(words))
        records.append(
            LineRecord(
                number,
                raw,
                tuple(words),
                tuple(moves),
                before,
                machine.snapshot(),
                tuple(comments),
                dwell,
                exact_stop=stop,
            )
        )
    return Interpretation(records, machine.remarks, machine.one_digit_feeds)


def _g_pairs(words: list[tuple[str, str]]) -> set[tuple[str, str]]:
    return {("G", canonical_g(v)[1:]) for a, v in words if a == "G"}
