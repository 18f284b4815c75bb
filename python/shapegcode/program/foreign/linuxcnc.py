"""LinuxCNC programs: executed as its interpreter does, and written as expanded programs in FANUC's dialect.

What is read and what is refused: docs/reference/input_dialects.md. Its control flow, parameters and modes are those of
LinuxCNC 2.9's documentation; tests hold the moves against its own interpreter rs274.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from shapegcode.io.ini import UNITS_MM
from shapegcode.machine import Machine
from shapegcode.program.foreign.arcs import PLANES
from shapegcode.program.foreign.linuxcnc_blocks import BlockRunner
from shapegcode.program.foreign.linuxcnc_cycles import PECK_CLEARANCE_MM
from shapegcode.program.foreign.linuxcnc_expression import Block, Scanner, evaluate, read_block, without_comments
from shapegcode.program.foreign.linuxcnc_parameters import MAX_ARGUMENTS, Frame, OLine, ParameterTable, SourceFile
from shapegcode.program.foreign.linuxcnc_state import Modes, State, find_tool_table
from shapegcode.program.foreign.read import (
    ForeignProgram,
    ForeignSettings,
    PlainProgram,
    called_source,
    program_folders,
    refusal,
)

_MAX_NESTING = 10  # INTERP_SUB_ROUTINE_LEVELS
_FILE_NAME = re.compile(r"[\w.+-]+")

# No word that means another thing on FANUC, and no number with more digits than FANUC's reader takes.
_NUMBER = r"[-+]?(?=[\d.]{1,9}(?![\d.]))\d*\.?\d*"
_AXES = rf"(?:[XYZ][ \t]*{_NUMBER}[ \t]*)"
_LINE = rf"(?:N\d+[ \t]*)?(?:G0?[01](?![\d.])[ \t]*)?{_AXES}+(?:F[ \t]*{_NUMBER}[ \t]*)?\n"
_ARC = (
    rf"(?:N\d+[ \t]*)?G0?[23](?![\d.])[ \t]*{_AXES}+(?:[IJK][ \t]*{_NUMBER}[ \t]*)+"
    rf"(?:F[ \t]*{_NUMBER}[ \t]*)?\n"
)
_MOVES = re.compile(rf"(?:[ \t]*{_LINE})+", re.IGNORECASE)
_MOVES_AND_ARCS = re.compile(rf"(?:[ \t]*(?:{_LINE}|{_ARC}))+", re.IGNORECASE)
_LAST_WORD = {letter: re.compile(rf"{letter}[ \t]*({_NUMBER})", re.IGNORECASE) for letter in "XYZF"}
_EVERY_WORD = {letter: re.compile(rf"{letter}[ \t]*([-+\d.]+)", re.IGNORECASE) for letter in "XYZ"}
_BEGINS_WITH_G = re.compile(r"[ \t]*(?:N\d+[ \t]*)?G0?[0-3](?![\d.])", re.IGNORECASE)
_POINTLESS = re.compile(r"([XYZIJKF][ \t]*[-+]?\d+)(?![\d.])", re.IGNORECASE)
_G_CODE = re.compile(r"G0?([0-3])", re.IGNORECASE)
# 1 to 99999, as FANUC has them.
_N_WORD = re.compile(r"^[ \t]*/?[ \t]*N[ \t]*0*([1-9]\d{0,4})(?![\d.])", re.IGNORECASE | re.MULTILINE)


def read_linuxcnc(source: str, *, file: str, machine: Machine, folder: Path | None = None) -> ForeignProgram:
    """The expanded program of a LinuxCNC program."""
    return _Interpreter(source, file, machine, folder).run()


class _Interpreter:
    """Executes the lines of a program."""

    def __init__(self, source: str, file: str, machine: Machine, folder: Path | None) -> None:
        self._machine = machine
        self._main = SourceFile(file, source, 0)
        self._file = self._main
        self._folders = program_folders(machine, folder)
        self._files: dict[str, SourceFile] = {}
        self._blocks: dict[tuple[int, int], Block] = {}
        self._plain = PlainProgram()
        # The plain program is read with the machine's own setting too, once it is emitted.
        self._adds_points = not machine.controller.calculator_decimal_point
        self._state = _first_state(machine, folder)
        self._runner = BlockRunner(self._state, self._plain)
        self._frames = [Frame(0, self._main)]
        self._parameters = ParameterTable(self._state, self._frames)
        self._n_words = Counter(_N_WORD.findall(source))
        self._next = 0
        self._steps, self._read_lines = 0, self._main.count
        self._broke = False

    def run(self) -> ForeignProgram:
        here = self._enter_main()
        power_on = self._machine.power_on
        given = (power_on.plane, power_on.distance, power_on.feed_mode, power_on.path_mode)
        own = ("G17", "G90", "G94", "G64")  # in which LinuxCNC begins
        if codes := [code for code, other in zip(own, given, strict=True) if code != other]:
            self._runner.put("".join(codes))
        try:
            while not self._runner.ended and self._next < self._file.count:
                here = self._next
                if not self._fast():
                    self._step(here)
                self._require_room()
        except ValueError as error:
            raise refusal(self._file.name, here + 1, f"{error}{self._call_stack()}") from None
        except RecursionError:
            message = "the values of this line are nested too deep to be worked out"
            raise refusal(self._file.name, here + 1, message + self._call_stack()) from None
        if not self._runner.ended and not self._main.text.lstrip().startswith("%"):
            message = "the program has neither M2 or M30 nor '%' lines: LinuxCNC refuses it, it may be truncated"
            raise refusal(self._main.name, self._main.count, message)
        if not self._runner.ended:
            self._plain.put("M30", self._main.count)
        blends = self._runner.path_tolerances
        settings = ForeignSettings(
            peck_clearance_mm=PECK_CLEARANCE_MM, path_tolerance_mm=next(iter(blends)) if len(blends) == 1 else None
        )
        if (table := self._state.table) is not None:
            unit = f"lengths and diameters in {table.units} (input.machine_unit, or the INI file)"
            self._plain.note(1, f"{table.file}: {len(table.tools)} tools, {unit}")
            settings = replace(settings, tool_length_mm=table.lengths_mm, tool_radius_mm=table.radii_mm)
        return self._plain.finish("linuxcnc", self._main.count, settings)

    # ---- lines -----------------------------------------------------------------------------------------------

    def _enter_main(self) -> int:
        """The first line: behind an opening `%`."""
        for index in range(self._main.count):
            text = self._main.line(index).strip()
            if text == "%":
                self._next = index + 1
                return index
            if text:
                break
        return 0

    def _fast(self) -> bool:
        """Take lines in which nothing differs as they are."""
        modes, begin = self._state.modes, self._file.starts[self._next]
        if modes.feed_mode == 930:
            return False
        if modes.motion not in {0, 10} and _BEGINS_WITH_G.match(self._file.text, begin) is None:
            return False
        match = (_MOVES_AND_ARCS if modes.centres == 911 else _MOVES).match(self._file.text, begin)
        if match is None:
            return False
        text = match[0]
        across = "ijk"[PLANES[modes.plane // 10][2]]
        if across in text or across.upper() in text:
            return False  # the slow way says what is wrong
        if modes.feed <= 0.0 and _LAST_WORD["F"].search(text) is None:
            return False
        self._runner.line, self._runner.file, self._runner.number = self._next + 1, self._file.index, ""
        self._runner.sync()
        if self._runner.written_motion != modes.motion and _BEGINS_WITH_G.match(text) is None:
            self._runner.put(f"G{modes.motion // 10:02d}")
        self._follow(text, modes)
        if self._adds_points:
            text = _POINTLESS.sub(r"\1.", text)
        self._plain.put_lines(text, self._next + 1, self._file.index)
        count = text.count("\n")
        self._next += count
        self._steps += count
        return True

    def _follow(self, text: str, modes: Modes) -> None:
        """Mode, feed and position behind lines that were taken as they are."""
        if codes := _G_CODE.findall(text):
            modes.motion = int(codes[-1]) * 10
        self._runner.written_motion = modes.motion
        feed = _last_number(text, "F")
        modes.feed = modes.feed if feed is None else feed
        self._runner.written_feed = modes.feed
        self._state.cycle = None
        position, unit = self._state.position, self._state.unit_mm
        for axis, letter in enumerate("XYZ"):
            here = position[axis]
            if modes.distance == 900:
                last = _last_number(text, letter)
                position[axis] = here if last is None else last * unit
            elif here is not None:
                position[axis] = here + unit * sum(map(float, _EVERY_WORD[letter].findall(text)))

    def _step(self, index: int) -> None:
        self._next = index + 1
        self._steps += 1
        self._runner.line, self._runner.file, self._runner.number = index + 1, self._file.index, ""
        o_line = self._file.o_lines.get(index)
        if o_line is not None:
            self._control(index, o_line)
            return
        block = self._block(index)
        if block is None:
            return
        if block.skips:
            block = self._skipping(block)
            if block is None:
                return
        words = [(letter, evaluate(value, self._parameters)) for letter, value in block.words]
        settings = [
            (name if isinstance(name, str) else evaluate(name, self._parameters), evaluate(value, self._parameters))
            for name, value in block.settings
        ]
        for name, value in settings:  # together, after all values are evaluated
            self._parameters.set(name, value)
        if words or block.comments:
            special = [int(value) for letter, value in words if letter == "m" and value in {70, 71, 72, 73, 98, 99}]
            if special:
                self._special(special[0], dict(words), index)
                words = [(letter, value) for letter, value in words if letter not in "mpl"]
            if words or block.comments:
                number = f"{dict(words).get('n', 0.0):g}"
                # Of the main program, once, and where no other line has the same.
                if self._file is self._main and self._n_words.pop(number, 0) == 1:
                    self._runner.number = f"N{number}"
                self._runner.run(words, block.comments)

    def _block(self, index: int) -> Block | None:
        """The words of a line; None: an empty one, or `%`."""
        key = self._file.index, index
        block = self._blocks.get(key)
        if block is None:
            line = self._file.line(index)
            if line.strip() in {"", "%"}:
                if line.strip() == "%" and self._file is self._main:
                    self._next = self._main.count  # what stands behind is not read
                return None
            block = self._blocks[key] = read_block(line)
        return block

    def _skipping(self, block: Block) -> Block | None:
        """Whether a line with `/` is executed, by the state of the block-skip switch."""
        switch = self._machine.input.block_skip
        if switch == "on":
            return None
        if switch == "unknown":
            text = "`/` lines are executed, as with the block-skip switch off; input.block_skip states its position"
            self._plain.note(self._runner.line, text, "block skip")
        return block

    # ---- control flow ----------------------------------------------------------------------------------------

    def _control(self, index: int, line: OLine) -> None:
        if line.keyword == "":
            if line.rest.strip() and not line.rest.strip().startswith(("(", ";")):
                raise ValueError(f"O{line.label}{line.rest[:20]}: no keyword of LinuxCNC")
            return  # the head of a program that M98 calls
        if line.keyword == "call":
            self._call(index, line)
        elif line.keyword in {"return", "endsub"}:
            self._return(line)
        elif line.keyword == "while":
            self._while(index, line)
        elif line.keyword == "sub":
            self._next = self._behind(index, line, "endsub") + 1
        elif line.keyword == "if":
            while not self._condition(line):
                index = self._behind(index, line, "elseif", "else", "endif")
                line = self._file.o_lines[index]
                if line.keyword != "elseif":
                    break
            self._next = index + 1
        elif line.keyword in {"elseif", "else"}:
            self._next = self._behind(index, line, "endif") + 1
        elif line.keyword == "endwhile":
            self._next = self._opening(index, line, "while")
        elif line.keyword == "repeat":
            count = round(self._condition(line))  # 2.7 is 3, 2.5 is 2: as rs274 2.9 repeats
            if count > 0:
                self._frames[-1].repeats[self._file.index, index] = count
            else:
                self._next = self._behind(index, line, "endrepeat") + 1
        elif line.keyword == "endrepeat":
            opening = self._opening(index, line, "repeat")
            left = self._frames[-1].repeats.get((self._file.index, opening))
            if left is None:
                raise ValueError(f"O{line.label} ENDREPEAT without REPEAT")
            self._frames[-1].repeats[self._file.index, opening] = left - 1
            if left > 1:
                self._next = opening + 1
        elif line.keyword in {"break", "continue"}:
            self._broke |= line.keyword == "break"
            self._next = self._loop_end(index, line) + (line.keyword == "break")
        elif line.keyword not in {"do", "endif"}:
            raise ValueError(f"O{line.label} {line.keyword.upper()} is no keyword of LinuxCNC")

    def _opening(self, index: int, line: OLine, keyword: str) -> int:
        """The line of the loop that an ENDWHILE or ENDREPEAT closes."""
        opening = self._file.before(index, line.label, (keyword,))
        if opening is None:
            raise ValueError(f"O{line.label} {line.keyword.upper()} without {keyword.upper()}")
        return opening

    def _values(self, line: OLine) -> list[float]:
        """The values in brackets behind a keyword."""
        scanner = Scanner(without_comments(line.rest)[0])
        values: list[float] = []
        while scanner.left:
            if not scanner.left.startswith("["):
                raise ValueError(f"[ is expected at {scanner.left[:12]!r}")
            values.append(evaluate(scanner.value(), self._parameters))
        return values

    def _condition(self, line: OLine) -> float:
        values = self._values(line)
        if len(values) != 1:
            raise ValueError(f"O{line.label} {line.keyword.upper()} needs one value in brackets")
        return values[0]

    def _behind(self, index: int, line: OLine, *keywords: str) -> int:
        place = self._file.after(index, line.label, keywords)
        if place is None:
            raise ValueError(f"O{line.label} {line.keyword.upper()}: no {' or '.join(keywords).upper()} behind it")
        return place

    def _call(self, index: int, line: OLine) -> None:
        label = line.label
        if label.startswith("["):
            label = str(round(evaluate(Scanner("".join(label.split()).lower()).value(), self._parameters)))
        arguments = self._values(line)
        if len(arguments) > MAX_ARGUMENTS:
            raise ValueError(f"{len(arguments)} arguments; a subroutine takes {MAX_ARGUMENTS}")
        file, begin = self._subroutine(label, "sub")
        frame = self._enter(file, begin + 1, index)
        frame.locals[1 : len(arguments) + 1] = arguments
        self._parameters.set("_value", 0.0)
        self._parameters.set("_value_returned", 0.0)

    def _subroutine(self, label: str, keyword: str) -> tuple[SourceFile, int]:
        if (line := self._file.find(label, keyword)) is not None:
            return self._file, line
        if (line := self._main.find(label, keyword)) is not None:
            return self._main, line
        if label not in self._files:
            name = label.strip("<>")
            files = (folder / (name + suffix) for folder in self._folders for suffix in (".ngc", ".NGC", ".nc"))
            path = next((file for file in files if file.is_file()), None) if _FILE_NAME.fullmatch(name) else None
            if path is None:
                where = f"in the file nor is there {name}.ngc beside it or in input.program_folders"
                raise ValueError(f"subroutine O{label} is neither {where}")
            text = called_source(path, self._machine)
            self._plain.names.append(str(path))
            self._files[label] = SourceFile(str(path), text, len(self._plain.names))
            self._read_lines += self._files[label].count
        file = self._files[label]
        if (line := file.find(label, keyword)) is None:
            raise ValueError(f"{file.name} holds no O{label} {keyword.upper()}")
        return file, line

    def _enter(self, file: SourceFile, begin: int, index: int) -> Frame:
        if len(self._frames) > _MAX_NESTING:
            raise ValueError(f"subroutines are nested more than {_MAX_NESTING} deep")
        frame = Frame(index + 1, self._file, begin=begin)
        self._frames.append(frame)
        self._file, self._next = file, begin
        return frame

    def _leave(self) -> None:
        frame = self._frames.pop()
        if frame.restores and frame.saved is not None:
            self._runner.restore(frame.saved)
        self._file, self._next = frame.caller, frame.back

    def _return(self, line: OLine) -> None:
        if len(self._frames) == 1 or self._frames[-1].by_m98:
            raise ValueError(f"O{line.label} {line.keyword.upper()} outside of a subroutine")
        values = self._values(line)
        if len(values) > 1:
            raise ValueError("a subroutine returns one value")
        if values:
            self._parameters.set("_value", values[0])
            self._parameters.set("_value_returned", 1.0)
        self._leave()

    def _while(self, index: int, line: OLine) -> None:
        holds = self._condition(line) != 0.0
        if self._file.closes_do(index, line.label):
            opening = self._file.before(index, line.label, ("do",))
            if holds and opening is not None:
                if self._broke:
                    text = "a DO loop behind a BREAK: read as documented; LinuxCNC 2.9.0~pre1 runs it once only"
                    self._plain.note(index + 1, text, "DO behind BREAK")
                self._next = opening + 1
        elif not holds:
            self._next = self._behind(index, line, "endwhile") + 1

    def _loop_end(self, index: int, line: OLine) -> int:
        """The last line of the loop of this label around a line."""
        opening = self._file.before(index, line.label, ("do", "while", "repeat"))
        keyword = None if opening is None else self._file.o_lines[opening].keyword
        ends = {"do": "while", "while": "endwhile", "repeat": "endrepeat"}
        if keyword is None:
            raise ValueError(f"O{line.label} {line.keyword.upper()} outside of a loop")
        return self._behind(index, line, ends[keyword])

    # ---- M codes that call and save --------------------------------------------------------------------------

    def _special(self, code: int, values: Mapping[str, float], index: int) -> None:
        frame = self._frames[-1]
        if code in {70, 73}:
            frame.saved, frame.restores = replace(self._state.modes), code == 73
            if code == 73 and len(self._frames) == 1:
                raise ValueError("M73 outside of a subroutine")
        elif code == 71:
            frame.saved = None
        elif code == 72:
            if frame.saved is None:
                raise ValueError("M72 without M70 before it")
            self._runner.restore(frame.saved)
        elif code == 98:
            times = int(values.get("l", 1.0))
            if times < 1:
                return
            file, begin = self._subroutine(str(int(values.get("p", -1.0))), "")
            called = self._enter(file, begin + 1, index)
            called.by_m98, called.again = True, times - 1
        elif len(self._frames) == 1:
            self._plain.note(index + 1, "M99 in the main program begins it again without end: read as its end", "M99")
            self._plain.put("M30", index + 1)
            self._runner.ended = True
        elif frame.again > 0:
            frame.again -= 1
            self._next = frame.begin
        else:
            self._leave()

    # ---- limits, notes ---------------------------------------------------------------------------------------

    def _require_room(self) -> None:
        controller = self._machine.controller
        if self._steps - self._read_lines > controller.max_program_steps:
            raise ValueError(
                f"more than {controller.max_program_steps} lines executed beyond one for each line "
                "(controller.max_program_steps): the program does not seem to end"
            )
        if self._plain.size - len(self._main.text) > controller.max_expansion_bytes:
            raise ValueError(
                f"up to here the expanded program is more than {controller.max_expansion_bytes} bytes larger than the "
                "program (controller.max_expansion_bytes)"
            )

    def _call_stack(self) -> str:
        calls = [f"{frame.caller.name} line {frame.back}" for frame in reversed(self._frames[1:])]
        return f"; called from {', '.join(calls[:3])}" if calls else ""


def _first_state(machine: Machine, folder: Path | None) -> State:
    """At the first line: what the machine file says of modes, offsets and tools."""
    state = State()
    state.modes.units = 200 if machine.power_on.units == "G20" else 210
    state.modes.system = int(machine.power_on.work_offset[1:]) - 53
    for name, offsets in machine.input.work_offsets.items():
        number = int(name[6:]) + 6 if name.startswith("G54.1P") else int(name[1:]) - 53
        state.work[number] = [*offsets]
    state.table = find_tool_table(machine.input.tool_table, machine.input.machine_unit, folder)
    state.machine_unit_mm = UNITS_MM[machine.input.machine_unit]
    if state.table is not None:
        state.lengths, state.radii = state.table.lengths_mm, state.table.radii_mm
        state.machine_unit_mm = state.table.unit_mm
    state.lengths.update({int(number): length for number, length in machine.input.tool_length_mm.items()})
    state.radii.update({int(number): radius for number, radius in machine.input.tool_radius_mm.items()})
    return state


def _last_number(text: str, letter: str) -> float | None:
    at = max(text.rfind(letter), text.rfind(letter.lower()))
    match = _LAST_WORD[letter].match(text, at) if at >= 0 else None
    return None if match is None else float(match[1])
