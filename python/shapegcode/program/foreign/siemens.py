"""SINUMERIK programs (DIN mode): executed as the control would, and written as expanded programs for FANUC.

Sources: subprograms easymanua.ls 1265481 pp. 491 to 494; work offsets and SUPA 679150 p. 100; jumps and loops as
nc-gcode-interpreter 0.2 has them (SINUMERIK ONE manual 4.1.5, 4.1.7); tool and D number i5cnc.com 126; what no page
was found for is *assumed* and marked so in docs/reference/input_siemens.md.
"""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import chain
from pathlib import Path

from shapegcode.errors import ProgramError, located_error
from shapegcode.machine import Machine
from shapegcode.program.foreign.read import (
    ForeignProgram,
    ForeignSettings,
    PlainProgram,
    called_source,
    program_folders,
)
from shapegcode.program.foreign.siemens_blocks import (
    Jump,
    ProgramLines,
    SiemensBlock,
    StructureError,
    Word,
    programs_of_source,
)
from shapegcode.program.foreign.siemens_expressions import (
    Expression,
    Value,
    Variable,
    WordError,
    constant,
    convert,
    is_equal,
    number,
    whole,
)
from shapegcode.program.foreign.siemens_path import SiemensPath
from shapegcode.program.foreign.siemens_words import BlockWords

_LEVELS = 16  # of subprograms, the main program among them
_R_PARAMETER = re.compile(r"R(\d+)")
_QUICK = re.compile(r"\s*(?:N\d+\s*)?(?:G0?([01])\s+)?((?:[XYZ]-?(?:\d+\.?\d*|\.\d+)\s*)+)(?:F(\d+\.?\d*)\s*)?")
_QUICK_WORD = re.compile(r"([XYZ])([-\d.]+)")
_CHANGES_TOOL = re.compile(r"(?im)(?<![A-Z0-9_])M0*6(?!\d)")


def read_siemens(source: str, *, file: str, machine: Machine, folder: Path | None = None) -> ForeignProgram:
    """Read a SINUMERIK program in DIN words.

    Subprograms are looked for in the text, in `folder` and in `input.program_folders`: NAME.SPF, then NAME.MPF.
    """
    return _Run(source, file, machine, folder).program()


class _Run:
    """A program in execution; the scope of its expressions."""

    def __init__(self, source: str, file: str, machine: Machine, folder: Path | None) -> None:
        self.machine, self.file = machine, file
        self.out = PlainProgram()
        self.path = SiemensPath(machine, self.out)
        self._store = _Store(programs_of_source(source, file), machine, folder)
        self.words = BlockWords(self.path, self, uses_m6=_CHANGES_TOOL.search(source) is not None)
        self._r: dict[int, float] = {}
        self._locals: list[dict[str, Variable]] = []
        self._calls: list[str] = []
        lines = source.count("\n") + 1
        self._steps_left = machine.controller.max_program_steps + lines
        self._moves_left = machine.controller.max_expansion_moves + lines

    def program(self) -> ForeignProgram:
        main = self._store.main
        self.path.line = main.first
        name = re.sub(r"[^A-Z0-9 _.-]", "", main.name).replace("_", " ")[:32]
        self.path.put(f"O0001({name})" if name else "O0001")
        self.path.put("G21G17G90G94G40")
        ended = self._run(main, {})
        self.path.release()
        self.path.put("M30" if ended != "M2" else "M02")
        return self.out.finish("siemens", self.path.line, ForeignSettings(names=self.path.names))

    # ---- names -------------------------------------------------------------------------------------------------------

    def value_of(self, name: str, index: tuple[Value, ...], column: int) -> Value:
        """A variable, or an R parameter."""
        variable = self._locals[-1].get(name)
        if variable is not None:
            return variable.read(name, index, column)
        parameter = self._r_number(name, index, column)
        if parameter is None:
            raise WordError(f"{name} is no variable of this program: DEF must define it before", column)
        if parameter not in self._r:
            raise WordError(f"R{parameter} is read before the program sets it: its value is in the control", column)
        return self._r[parameter]

    def knows(self, name: str) -> bool:
        """Whether something can be set by this name."""
        return name in self._locals[-1] or name == "R" or _R_PARAMETER.fullmatch(name) is not None

    def assign(self, word: Word, value: Value) -> None:
        """Set a variable or an R parameter."""
        index = tuple(each(self) for each in word.index)
        variable = self._locals[-1].get(word.name)
        if variable is not None:
            variable.write(word.name, index, value, word.column)
            return
        parameter = self._r_number(word.name, index, word.column)
        if parameter is None:
            raise word.error(f"{word.name} alone: its number must follow (R1= or R[1]=); the radius of an arc is CR=")
        self._r[parameter] = float(number(value, word.column))

    def _r_number(self, name: str, index: tuple[Value, ...], column: int) -> int | None:
        if name == "R" and len(index) == 1:
            return whole(index[0], "R[ ]", column)
        found = _R_PARAMETER.fullmatch(name)
        return int(found[1]) if found and not index else None

    # ---- execution ---------------------------------------------------------------------------------------------------

    def _run(self, program: ProgramLines, variables: dict[str, Variable]) -> str:
        """Execute a program to its end; says which word ended it."""
        try:
            program.find_structure()
        except StructureError as error:
            raise self._error(program, error.index, 1, str(error)) from None
        self._locals.append(variables)
        flow = _Flow(program)
        file = 0 if program.file == self.file else self.out.names.index(program.file) + 1
        index = 0
        while index < len(program.lines):
            self.path.line, self.path.file = program.first + index, file
            self._steps_left -= 1
            quick = _QUICK.fullmatch(program.lines[index])
            try:
                self._require_limits()
                if quick and self.path.quick_move(quick[1] or "", _QUICK_WORD.findall(quick[2]), quick[3] or ""):
                    index += 1
                    continue
                block = program.block(index)
                if block.kind == "WORDS" and not self._is_skipped(block) and (ended := self._words(block)):
                    self._locals.pop()
                    return ended
                index = index + 1 if block.kind == "WORDS" else self._control(flow, block, index)
            except WordError as error:
                raise self._error(program, index, error.column, str(error)) from None
            except RecursionError:
                message = "the values of this block are nested too deep to be worked out"
                raise self._error(program, index, 1, message) from None
            except (OverflowError, ValueError):
                raise self._error(program, index, 1, "a value is too large to be computed") from None
        self._locals.pop()
        return ""

    def _require_limits(self) -> None:
        limits = self.machine.controller
        if self._steps_left < 0:
            number = f"controller.max_program_steps = {limits.max_program_steps}"
            raise WordError(f"more blocks are executed than {number}: an endless loop must end", 1)
        if self.path.moves > self._moves_left:
            number = f"controller.max_expansion_moves = {limits.max_expansion_moves}"
            raise WordError(f"loops and calls make more moves than {number}", 1)

    def _error(self, program: ProgramLines, index: int, column: int, message: str) -> ProgramError:
        line = program.first + index
        called = f"; called from {', '.join(reversed(self._calls))}" if self._calls else ""
        return located_error(program.file, line, column, message + called)

    def _is_skipped(self, block: SiemensBlock) -> bool:
        if not block.skip:
            return False
        switch = self.machine.input.block_skip
        if switch == "unknown":
            raise WordError('/: whether the block runs must be known: input.block_skip = "on" or "off"', 1)
        return switch == "on"

    def _words(self, block: SiemensBlock) -> str:
        """A block of words; says which of them ended the program."""
        self.words.comment(block.comment)
        if not block.words:
            return ""
        call = block.words[0]
        found = self._store.find(call.name) if call.value is None and self.words.may_be_call(call) else None
        if found is None:
            return self.words.execute(block)
        others = [word for word in block.words[1:] if word.name != "P"]
        if others:
            raise others[0].error(
                f"{others[0].name} beside the call of {call.name}: the call must be in a separate block"
            )
        count = next((whole(word.value(self), "P", word.column) for word in block.words[1:] if word.value), 1)
        for _ in range(count):
            self._call(found, call)
        return ""

    def call_named(self, name: str, word: Word) -> None:
        """CALL and EXTCALL of a program by a string."""
        found = self._store.find(re.split(r"[/\\]", name)[-1].upper().removeprefix("_N_"))
        if found is None:
            raise word.error(f'"{name}": no such program is beside this one')
        self._call(found, Word(found.name, word.column))

    def _call(self, program: ProgramLines, word: Word) -> None:
        if len(self._locals) >= _LEVELS:
            raise word.error(f"{word.name}: calls reach {_LEVELS} levels, the control has no more")
        if program.file != self.file and program.file not in self.out.names:
            self.out.names.append(program.file)
        head = self._heading(program)
        variables, references = self._parameters(head, word) if head else ({}, {})
        if head is None and word.given:
            raise word.error(f"{word.name}( ) with values: PROC with parameters must begin {program.file}")
        line, file, modes = self.path.line, self.path.file, replace(self.path.modes)
        self._calls.append(f"line {line}")
        self._run(program, variables)
        self._calls.pop()
        self.path.line, self.path.file = line, file
        for name, reference in references.items():
            self.assign(reference, variables[name].read(name, (), word.column))
        if head is not None and head.saves:
            self.words.restore(modes)

    def _heading(self, program: ProgramLines) -> SiemensBlock | None:
        """PROC at the begin of a program."""
        for index, line in enumerate(program.lines):
            if "PROC" in line.upper():
                block = program.block(index)
                return block if block.kind == "PROC" else None
            if line.split(";")[0].strip():
                return None
        return None

    def _parameters(self, head: SiemensBlock, word: Word) -> tuple[dict[str, Variable], dict[str, Word]]:
        given = list(word.given or ())
        if len(given) > len(head.definitions):
            raise word.error(f"{word.name} with {len(given)} values: PROC has {len(head.definitions)} parameters")
        given += [None] * (len(head.definitions) - len(given))
        variables: dict[str, Variable] = {}
        references: dict[str, Word] = {}
        for parameter, value in zip(head.definitions, given, strict=True):
            variable = Variable(parameter.kind)
            start = value or parameter.start
            if start is not None:
                variable.write(parameter.name, (), start(self), word.column)
            variables[parameter.name] = variable
            if parameter.by_reference and value is not None:
                probe = _Probe()
                value(probe)
                if len(probe.found) != 1 or not self.knows(probe.found[0][0]):
                    raise word.error(f"{word.name}: a value for a parameter with VAR must be a variable")
                name, index = probe.found[0]
                references[parameter.name] = Word(name, word.column, None, "", tuple(map(constant, index)))
        return variables, references

    # ---- control flow ------------------------------------------------------------------------------------------------

    def _control(self, flow: _Flow, block: SiemensBlock, index: int) -> int:
        """A statement of control flow; gives the line that follows."""
        program, kind = flow.program, block.kind
        if self._is_skipped(block):
            return index + 1
        self.words.comment(block.comment)
        if kind in ("IF", "WHILE"):
            return index + 1 if self._is_true(block.condition) else program.partners[index] + 1
        if kind == "ELSE":
            return program.partners[index] + 1
        if kind in ("ENDWHILE", "ENDLOOP"):
            return program.starts[index]
        if kind == "UNTIL":
            return index + 1 if self._is_true(block.condition) else program.starts[index] + 1
        if kind == "FOR":
            assert block.start is not None
            self._set_counter(block, block.start(self))
            return index + 1 if self._counts_on(block) else program.partners[index] + 1
        if kind == "ENDFOR":
            begin = program.starts[index]
            head = program.block(begin)
            self._set_counter(head, self._counter(head) + 1)
            return begin + 1 if self._counts_on(head) else index + 1
        if kind == "JUMPS":
            for jump in block.jumps:
                if jump.condition is None or self._is_true(jump.condition):
                    return flow.target(jump, index)
        elif kind == "CASE":
            assert block.condition is not None
            chosen = block.condition(self)
            for jump in block.jumps:
                if jump.condition is None or is_equal(chosen, jump.condition(self)):
                    return flow.target(jump, index)
        elif kind == "AGAIN":
            return flow.again(block, index, whole(block.condition(self), "P", block.column) if block.condition else 1)
        elif kind == "DEF":
            for each in block.definitions:
                if each.name in self._locals[-1]:
                    continue  # reached again by a jump
                shape = tuple(whole(size(self), f"size of {each.name}", each.column) for size in each.shape)
                variable = Variable(each.kind, shape)
                if each.start is not None:
                    variable.write(each.name, (), convert(each.start(self), each.kind, each.column), each.column)
                self._locals[-1][each.name] = variable
        return index + 1

    def _is_true(self, condition: Expression | None) -> bool:
        assert condition is not None
        return bool(condition(self))

    def _set_counter(self, block: SiemensBlock, value: Value) -> None:
        if not self.knows(block.name):
            raise block.error(f"{block.name} of FOR is no variable of this program: DEF must define it before")
        self.assign(Word(block.name, block.column, None, "", block.index), value)

    def _counter(self, block: SiemensBlock) -> float | int:
        return number(self.value_of(block.name, tuple(each(self) for each in block.index), block.column), block.column)

    def _counts_on(self, block: SiemensBlock) -> bool:
        assert block.condition is not None
        now, end = self._counter(block), number(block.condition(self), block.column)
        return is_equal(now, end) or now < end


class _Probe:
    """Notes which variables an expression reads."""

    def __init__(self) -> None:
        self.found: list[tuple[str, tuple[Value, ...]]] = []

    def value_of(self, name: str, index: tuple[Value, ...], _column: int) -> Value:
        """1, a value that no function refuses."""
        self.found.append((name, index))
        return 1


class _Flow:
    """Where jumps of one execution of a program lead."""

    def __init__(self, program: ProgramLines) -> None:
        self.program = program
        self._again: dict[int, int] = {}

    def target(self, jump: Jump, index: int) -> int:
        """The line to which a jump leads: the nearest in its direction, and not inside of another structure."""
        count = len(self.program.lines)
        ahead, behind = range(index + 1, count), range(index, -1, -1)
        ways = {"GOTOF": [ahead], "GOTOB": [behind]}.get(jump.command, [ahead, behind])
        around = self.program.depth_path(index)
        for line in chain(*ways):
            if self._is_at(line, jump.target):
                inside = self.program.depth_path(line)
                if inside == around[: len(inside)]:
                    return line
        if jump.command == "GOTOC":
            return index + 1
        where = {"GOTOF": "behind", "GOTOB": "before"}.get(jump.command, "anywhere near")
        raise jump.error(
            f"{jump.command} {jump.target}: no such label or block {where} it, outside of other IF and loops"
        )

    def again(self, block: SiemensBlock, index: int, count: int) -> int:
        """`REPEAT label P=n`: the lines from the label to this one, n times more."""
        left = self._again.get(index, count)
        if left <= 0:
            self._again.pop(index, None)
            return index + 1
        self._again[index] = left - 1
        for line in range(index - 1, -1, -1):
            if self._is_at(line, block.name):
                return line
        raise block.error(f"REPEAT {block.name}: there is no such label before it")

    def _is_at(self, line: int, target: str) -> bool:
        text = self.program.lines[line].upper()
        if target.removeprefix("N") not in text:
            return False
        block = self.program.block(line)
        return target in (block.label, block.number) and target != ""


class _Store:
    """Programs of the text, and of files beside it."""

    def __init__(self, programs: list[ProgramLines], machine: Machine, folder: Path | None) -> None:
        self.main, self._machine = programs[0], machine
        self._known: dict[str, ProgramLines | None] = {each.name: each for each in programs}
        self._folders = program_folders(machine, folder)
        self._files: dict[str, Path] = {}  # by name in capitals; found when the first one is looked for

    def find(self, name: str) -> ProgramLines | None:
        """A program by its name; None: there is none."""
        if name not in self._known:
            self._known[name] = self._read(name)
        return self._known[name]

    def _read(self, name: str) -> ProgramLines | None:
        for folder in self._folders:
            for each in sorted(folder.iterdir()) if folder.is_dir() else ():
                self._files.setdefault(each.name.upper(), each)
        self._folders = []
        known = (f"{name}.SPF", f"{name}.MPF", f"_N_{name}_SPF", f"_N_{name}_MPF")
        path = next((self._files[file] for file in known if file in self._files), None)
        if path is None:
            return None
        return replace(programs_of_source(called_source(path, self._machine), str(path))[0], name=name)
