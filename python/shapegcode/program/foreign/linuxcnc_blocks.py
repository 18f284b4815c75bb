"""One block of a LinuxCNC program in FANUC's words, in the order in which LinuxCNC executes its words.

Order of execution: LinuxCNC's G-code overview, "G-Code Order of Execution".
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from shapegcode.program.foreign.arcs import PLANES, centre_by_radius, sweep_of
from shapegcode.program.foreign.linuxcnc_codes import SYSTEMS, by_group_of, refuse_unused, sorted_words
from shapegcode.program.foreign.linuxcnc_cycles import drill
from shapegcode.program.foreign.linuxcnc_offsets import Offsets
from shapegcode.program.foreign.linuxcnc_state import AXES, CYCLES, Modes, State, given_axes, system_words
from shapegcode.program.foreign.read import PlainProgram, number_text, words_of

_BEFORE_MOTION = (6, 19, 3, 4, 5, 7, 8, 9, 48, 49)
_STOPS = (0, 1, 2, 30, 60)
_KEPT_OUTPUTS = {
    50: "feed override", 51: "spindle override", 52: "adaptive feed", 53: "feed hold switch", 62: "digital output",
    63: "digital output", 64: "digital output", 65: "digital output", 67: "analog output", 68: "analog output",
}  # fmt: skip


class BlockRunner:
    """Executes blocks and writes the lines that they become."""

    def __init__(self, state: State, plain: PlainProgram) -> None:
        self.state, self.plain = state, plain
        self.line, self.file = 1, 0
        self.number = ""  # N word that the next block takes
        self.written_distance = 900  # what the plain program's reader takes for granted
        self.written_motion: int | None = None  # None: what is in force there is not followed
        self.written_feed = 0.0
        self.ended = False
        self.offsets = Offsets(state, self.put)
        self.path_tolerances: set[tuple[float | None, float | None]] = set()  # (P, Q) of G64, mm

    def put(self, text: str) -> None:
        """Write one line; the first block of a line of the source takes its N word."""
        if not text.startswith("("):
            text, self.number = self.number + text, ""
        self.plain.put(text, self.line, self.file)

    def note(self, text: str, key: str) -> None:
        """Add a note, if it is not there yet."""
        where = f"{self.plain.names[self.file - 1]}:{self.line}: " if self.file else ""
        self.plain.note(self.line if not self.file else 1, where + text, key)

    def run(self, words: Sequence[tuple[str, float]], comments: Sequence[str]) -> None:
        """Execute a block."""
        codes, functions, values = sorted_words(words)
        by_group = by_group_of(codes, functions, values)
        refuse_unused(self.state.modes, by_group, functions, values)
        for text in filter(None, map(_plain_comment, comments)):
            self.put(f"({text})")
        if not words:
            return
        modes, mode = self.state.modes, by_group.get("feed")
        if mode not in {None, modes.feed_mode}:
            modes.feed_mode, modes.feed, self.written_feed = mode or 0, 0.0, 0.0
        if "f" in values:
            if values["f"] < 0.0:
                raise ValueError(f"F{values['f']:g} is negative")
            modes.feed = values["f"]
        self._functions(functions, values)
        if "dwell" in by_group:
            self._dwell(values)
        pending = self._modal_codes(by_group, values)
        self._axes(by_group, values, pending)
        for function in functions:
            if function in _STOPS:
                self.put(f"M{0 if function == 60 else function:02d}")
                self.ended = self.ended or function in {2, 30}
                if function == 60:
                    self.note("M60 changes the pallet and stops: kept as M00", "M60")

    def sync(self) -> None:
        """Before lines that are taken as they are: G90 or G91 and F are in force in the plain program too."""
        modes = self.state.modes
        if code := self._distance(modes.distance):
            self.put(code)
        if self.written_feed != modes.feed and modes.feed > 0.0 and modes.feed_mode != 930:
            self.put(self._written_f())

    def _distance(self, code: int) -> str:
        """G90 or G91, where the plain program has the other one; it has this from then on."""
        changes = self.written_distance != code
        self.written_distance = code
        return f"G{code // 10}" if changes else ""

    def _written_f(self) -> str:
        """F of the mode in force, which the plain program has from then on."""
        self.written_feed = self.state.modes.feed
        return f"F{number_text(self.written_feed)}"

    # ---- what comes before the move --------------------------------------------------------------------------

    def _functions(self, functions: Sequence[int], values: Mapping[str, float]) -> None:
        """S, T and the M codes that come before a move."""
        state, modes = self.state, self.state.modes
        if "s" in values:
            modes.speed = values["s"]
        if "t" in values:
            state.selected = round(values["t"])
        line = [f"T{round(values['t'])}"] if "t" in values else []
        if 6 in functions:
            state.tool = state.selected
            modes.spindle = 5
            line.append("M06")
        if 61 in functions:
            state.tool = int(values.get("q", 0.0))
            self.note(f"M61 Q{state.tool} states the tool in the spindle: no motion", "M61")
        if line:
            self.put("".join(line))
        line = [f"S{round(values['s'])}"] if "s" in values else []
        for function in functions:
            if function in _BEFORE_MOTION and function != 6:
                line.append(f"M{function:02d}")
                modes.spindle = function if function in {3, 4, 5} else modes.spindle
                modes.mist = (modes.mist or function == 7) and function != 9
                modes.flood = (modes.flood or function == 8) and function != 9
            elif function in _KEPT_OUTPUTS:
                self.note(f"M{function} ({_KEPT_OUTPUTS[function]}) moves nothing and is left out", f"M{function}")
            elif 100 <= function <= 199:
                line.append(f"M{function}")
                self.note(f"{line[-1]} runs a program of the machine's own: it is kept without P and Q", line[-1])
        for start in range(0, len(line), 3):  # no more M codes in a block than every FANUC control takes
            self.put("".join(line[start : start + 3]))

    def _dwell(self, values: Mapping[str, float]) -> None:
        if (seconds := values.get("p")) is None:
            raise ValueError("G4 needs P, the dwell in seconds")
        if seconds < 0.0:
            raise ValueError(f"G4 P{seconds:g} is negative")
        self.put(f"G04X{number_text(seconds)}")
        self.note(f"G4 P{seconds:g} is a dwell of {seconds:g} s on LinuxCNC; on FANUC P counts milliseconds", "G4 P")

    def _modal_codes(self, by_group: Mapping[str, int], values: Mapping[str, float]) -> list[str]:
        """Codes that change a mode; those that may stand in the block of a move."""
        state, modes = self.state, self.state.modes
        pending = [f"G{modes.feed_mode // 10}"] if "feed" in by_group else []
        if "plane" in by_group:
            modes.plane = by_group["plane"]
            pending.append(f"G{modes.plane // 10}")
        if "units" in by_group:
            pending.append(self._unit(by_group["units"], values))
        if "spindle" in by_group:
            if by_group["spindle"] == 960:
                raise ValueError("G96 is constant surface speed of a lathe: it is not read")
            pending.append("G97")
        if "compensation" in by_group:
            pending.append("G40")
        if "length" in by_group:
            self.sync()
            self.offsets.length(by_group["length"], values)
        if "system" in by_group:
            state.select_system(SYSTEMS[by_group["system"]])
            self.put(system_words(state.modes.system))
        if "path" in by_group:
            pending.append(self._path_mode(by_group["path"], values))
        if "distance" in by_group:
            modes.distance = self.written_distance = by_group["distance"]
            pending.append(f"G{modes.distance // 10}")
        modes.centres = by_group.get("centres", modes.centres)
        if "retract" in by_group:
            modes.retract = by_group["retract"]
            pending.append(f"G{modes.retract // 10}")
        return pending

    def _unit(self, code: int, values: Mapping[str, float]) -> str:
        """G20, G21: the feed in force stays what it is in mm."""
        before, modes = self.state.unit_mm, self.state.modes
        modes.units = code
        if "f" in values and before != self.state.unit_mm:
            old, new = ("mm", "inch") if code == 200 else ("inch", "mm")
            self.note(
                f"F{values['f']:g} in the block of G{code // 10} is in {old} still: LinuxCNC sets F before the unit; "
                f"FANUC would read it in {new}",
                "F and unit",
            )
        if modes.feed_mode != 930:
            modes.feed *= before / self.state.unit_mm
            self.written_feed *= before == self.state.unit_mm
        return f"G{code // 10}"

    def _path_mode(self, code: int, values: Mapping[str, float]) -> str:
        self.state.modes.path = code
        if code == 611:
            self.note("G61.1 stops at the end of every block: FANUC's G61", "G61.1")
            return "G61"
        if code == 610:
            what = "G61 follows the path exactly and does not stop where it is smooth"
            self.note(f"{what}; FANUC's G61 would stop in every block: read as G64", "G61")
            self.path_tolerances |= {(None, None), (0.0, 0.0)}  # more than one
        else:
            p, q = (values[name] * self.state.unit_mm if name in values else None for name in "pq")
            self.path_tolerances.add((p, q))
        if code == 640 and "p" in values:
            blend = values["p"] * self.state.unit_mm
            self.note(
                f"G64 P: blends leave the path by up to {blend:g} mm (FANUC's G64 has no P); the planner model takes "
                "it from controller.linuxcnc.blend_tolerance_mm, for the original and for what is left unchanged",
                "G64 P",
            )
        return "G64"

    # ---- the move --------------------------------------------------------------------------------------------

    def _axes(self, by_group: Mapping[str, int], values: Mapping[str, float], pending: list[str]) -> None:
        """What uses the axis words: one-shot codes, drilling cycles, moves."""
        state, modes = self.state, self.state.modes
        one_shot = by_group.get("one-shot")
        if one_shot is not None:
            self._flush(pending)
            self.sync()
            self.offsets.one_shot(one_shot, values)
            if "motion" not in by_group:
                return
            values = {letter: value for letter, value in values.items() if letter not in "xyzabc"}
            pending = []
        before = modes.motion
        if "motion" in by_group:
            modes.motion = by_group["motion"]
        has_axes = any(letter in values for letter in "xyzabc@^") and by_group.get("length") != 431
        if modes.motion not in CYCLES:
            state.cycle = None
        if modes.motion == 800:
            if has_axes and ("motion" in by_group or "dwell" not in by_group):
                raise ValueError("axis words while no G code of motion is in force (G80)")
            self._flush([*pending, *(["G80"] if "motion" in by_group else [])])
        elif modes.motion in CYCLES:
            self._flush(pending)
            if has_axes or "motion" in by_group:
                self._cycle(values, fresh=before != modes.motion)
        elif has_axes or (modes.motion in {20, 30} and any(letter in values for letter in "ijk")):
            self._move(values, pending, machine="machine" in by_group)
        else:
            changes = modes.motion < 20 and before != modes.motion
            self.written_motion = modes.motion if changes else self.written_motion
            self._flush([*pending, *([f"G{modes.motion // 10:02d}"] * changes)])

    def _flush(self, codes: Sequence[str]) -> None:
        if codes:
            self.put("".join(codes))

    def _cycle(self, values: Mapping[str, float], *, fresh: bool) -> None:
        modes = self.state.modes
        if modes.feed_mode == 930:
            raise ValueError("a drilling cycle in G93")
        feed = self._written_f() if modes.feed > 0.0 else ""
        self.written_motion = None
        times = 1
        if "@" in values or "^" in values:  # each repetition goes on from the hole before it
            times = int(values.get("l", 1.0))
            values = {letter: value for letter, value in values.items() if letter != "l"}
        lines: list[str] = []
        for time in range(times):
            lines += drill(self.state, modes.motion, self._cartesian(values), fresh and time == 0)
        if code := self._distance(900):
            self.put(code)
        for index, line in enumerate(lines):
            self.put(line + (feed if index == 0 or line.startswith("G01") else ""))

    def _move(self, values: Mapping[str, float], codes: Sequence[str], *, machine: bool) -> None:
        """G0 to G3."""
        state, modes = self.state, self.state.modes
        values = self._cartesian(values)
        if machine:
            self._flush(codes)
            codes = []
            self.sync()
            self.written_motion = None
            if modes.motion > 10:
                raise ValueError("G53 stands with G0 or G1 only")
            values = self.offsets.in_program(values, rapid=modes.motion == 0)
            if not values:
                return
        incremental = modes.distance == 910 and not machine
        start = [*state.position]
        for axis in given_axes(values):
            here, given = state.position[axis], values[AXES[axis]] * state.unit_mm
            state.position[axis] = given if not incremental else None if here is None else here + given
        head = f"{''.join(codes)}{self._distance(910 if incremental else 900)}G{modes.motion // 10:02d}"
        self.written_motion = modes.motion
        if modes.motion < 20:
            self.put(head + words_of(values, "xyzabc") + self._feed_word(values))
        else:
            first, *others = self._arc(values, start, incremental=incremental)
            for block in (head + first, *others):
                self.put(block)

    def _feed_word(self, values: Mapping[str, float]) -> str:
        modes = self.state.modes
        if modes.motion == 0:
            return self._written_f() if "f" in values and modes.feed_mode == 940 else ""
        if modes.feed_mode == 930 and "f" not in values:
            raise ValueError("a move in G93 without F")
        if modes.feed <= 0.0:
            raise ValueError("a cutting move, and no F greater than 0 was given before it")
        return self._written_f()

    def _cartesian(self, values: Mapping[str, float]) -> Mapping[str, float]:
        """Polar words @ and ^ as X and Y."""
        if "@" not in values and "^" not in values:
            return values
        state = self.state
        x, y = state.position[0], state.position[1]
        if state.modes.plane != 170 or "x" in values or "y" in values:
            raise ValueError("polar words @ and ^ stand in G17, without X and Y")
        if x is None or y is None:
            raise ValueError("the position of X and Y is not known, from which @ and ^ go on")
        unit = state.unit_mm
        here, incremental = complex(x, y) / unit, state.modes.distance == 910
        radius, angle = abs(here), math.degrees(cmath.phase(here))
        if radius == 0.0 and "^" not in values:
            raise ValueError("a polar radius @ without an angle ^ at the origin")
        if incremental:
            radius, angle = radius + values.get("@", 0.0), angle + values.get("^", 0.0)
        else:
            radius, angle = values.get("@", radius), values.get("^", angle)
        to = cmath.rect(radius, math.radians(angle)) - (here if incremental else 0.0)
        others = {letter: value for letter, value in values.items() if letter not in "@^"}
        return {**others, "x": to.real, "y": to.imag}

    def _arc(self, values: Mapping[str, float], start: Sequence[float | None], *, incremental: bool) -> list[str]:
        """Words of an arc and its F: one block, and one more for each further full turn."""
        state, modes, unit = self.state, self.state.modes, self.state.unit_mm
        first, second, normal = PLANES[modes.plane // 10]
        names = "ijk"[first], "ijk"[second]
        turns = values.get("p", 1.0)
        if turns != int(turns) or turns < 1:
            raise ValueError(f"P{turns:g}: an arc has a whole number of turns, 1 or more")
        if "r" in values and any(name in values for name in "ijk"):
            raise ValueError("an arc with R and I, J or K")
        if "r" not in values and not any(name in values for name in names):
            raise ValueError(f"an arc without R, {names[0].upper()} or {names[1].upper()}")
        known = None not in (start[first], start[second], state.position[first], state.position[second])
        if not known:
            if turns > 1 or modes.centres == 901 or modes.feed_mode == 930:
                raise ValueError("the position is not known, which this arc needs (P turns, G90.1, G93)")
            return [words_of(values, "xyzabcijkr") + self._feed_word(values)]
        here = complex(start[first] or 0.0, start[second] or 0.0)
        to = complex(state.position[first] or 0.0, state.position[second] or 0.0)
        turn = 1 if modes.motion == 30 else -1
        given = complex(values.get(names[0], 0.0), values.get(names[1], 0.0)) * unit
        if "r" in values:
            radius, chord = values["r"] * unit, abs(to - here)
            if chord == 0.0 or radius == 0.0:
                raise ValueError("an arc with R ends where it begins, or its R is 0")
            if chord / 2.0 - abs(radius) > 0.00127:
                raise ValueError(f"R{abs(radius):g} mm is too small for a chord of {chord:g} mm")
            centre = centre_by_radius(here, to, radius, turn)
        elif modes.centres == 901 and any(name not in values for name in names):
            raise ValueError(f"G90.1 needs {names[0].upper()} and {names[1].upper()}")
        else:
            centre = given if modes.centres == 901 else here + given
        spoke = (centre - here) / unit
        words = words_of({names[0]: spoke.real, names[1]: spoke.imag}, "".join(names))
        total = abs(sweep_of(here, to, centre, turn)) + (turns - 1.0) * math.tau
        feed = self._arc_feed(values, total, abs(here - centre), start)
        blocks: list[str] = []
        rise = values.get(AXES[normal])
        name = AXES[normal].upper()
        last = {letter: value for letter, value in values.items() if letter in "xyzabc"}
        for time in range(1, int(turns)):
            axial = ""
            if rise is not None:
                if start[normal] is None and not incremental:
                    raise ValueError(f"the position of {name} is not known, from which the helix rises")
                share = math.tau / total
                begin = (start[normal] or 0.0) / unit
                step = rise * share if incremental else (rise - begin) * share
                axial = f"{name}{number_text(step if incremental else begin + time * step)}"
                if incremental:
                    last[AXES[normal]] = rise * (1.0 - time * share)
            blocks.append(axial + words)
        blocks.append(words_of(last, "xyzabc") + words)
        return [blocks[0] + feed, *blocks[1:]]

    def _arc_feed(self, values: Mapping[str, float], sweep: float, radius: float, start: Sequence[float | None]) -> str:
        """F of an arc: in G93 LinuxCNC's counts the whole block, FANUC's the radius."""
        if self.state.modes.feed_mode != 930:
            return self._feed_word(values)
        self._feed_word(values)
        normal = PLANES[self.state.modes.plane // 10][2]
        begin, end = start[normal], self.state.position[normal]
        rise = 0.0 if begin is None or end is None else end - begin
        length = math.hypot(radius * sweep, rise)
        self.note("in G93 F counts the whole arc on LinuxCNC; FANUC's counts its radius: worked out", "G93")
        return f"F{number_text(self.state.modes.feed * length / radius)}"

    def restore(self, saved: Modes) -> None:
        """Modes of M72: what differs is written."""
        modes, state = self.state.modes, self.state
        state.select_system(saved.system)
        kept = replace(saved, motion=modes.motion)
        codes = [f"G{getattr(kept, name) // 10}" for name in ("plane", "units", "retract")
                 if getattr(kept, name) != getattr(modes, name)]  # fmt: skip
        if kept.feed_mode != modes.feed_mode:
            codes.append(f"G{kept.feed_mode // 10}")
        if kept.path != modes.path:
            codes.append("G61" if kept.path == 611 else "G64")
        self._flush(codes)
        self.put(system_words(saved.system))
        if kept.speed != modes.speed:
            self.put(f"S{round(kept.speed)}")
        if kept.spindle != modes.spindle:
            self.put(f"M{kept.spindle:02d}")
        if (kept.mist, kept.flood) != (modes.mist, modes.flood):
            self.put("M09")
            for on, code in ((kept.mist, "M07"), (kept.flood, "M08")):
                if on:
                    self.put(code)
        state.modes = kept


def _plain_comment(text: str) -> str:
    """A comment that FANUC's reader takes; those that LinuxCNC executes are left out."""
    if text.lower().startswith(("msg,", "debug,", "print,", "log", "probe")):
        return ""
    return "".join(c for c in text.upper() if " " <= c <= "~" and c not in "()%;").strip()
