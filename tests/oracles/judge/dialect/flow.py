"""Control flow: which block is next. Subprograms, macro calls, GOTO, IF, WHILE; NC blocks go to the controller."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from .controller import Controller
from .expressions import Expression, Value, half_away, number
from .tape import Alarm, Block, TapeProgram, read_tape
from .variables import Variables, arguments
from .words import Word, parse_words

MAX_STEPS = 200_000
_DO = re.compile(r"DO(\d+)$")
_END = re.compile(r"END(\d+)$")
_KEYWORDS = ("IF", "WHILE", "GOTO", "DO", "END")
_OUTPUT = ("POPEN", "PCLOS", "BPRNT", "DPRNT", "SETVN")


@dataclass
class Frame:
    """One active program. `locals_of` is where its #1 ... #33 live: a subprogram shares its caller's."""

    program: TapeProgram
    at: int = 0
    repeats: int = 1
    local: dict[int, float] = field(default_factory=dict)
    kind: str = "main"


@dataclass
class ModalCall:
    """G66 or G66.1: program, repeats and the local variables, which stay from call to call."""

    number: int
    repeats: int
    local: dict[int, float]
    every_block: bool
    depth: int


class Flow:
    """Runs one program of a file."""

    def __init__(
        self,
        text: str,
        controller: Controller,
        *,
        program: int | None = None,
        switches: frozenset[int] = frozenset(),
        nesting: int = 10,
        macro_nesting: int = 5,
        retained: Mapping[int, float] | None = None,
    ) -> None:
        self.programs = read_tape(text)
        if not self.programs:
            raise Alarm(1, "the file is empty")
        self.controller = controller
        self.variables = Variables(controller)
        self.variables.common.update(retained or {})
        self.switches, self.nesting, self.macro_nesting = switches, nesting, macro_nesting
        first = self.programs[0] if program is None else self.program(program, 1)
        self.stack = [Frame(first)]
        self.modal_calls: list[ModalCall] = []
        self.line = 1

    def program(self, n: int, line: int) -> TapeProgram:
        found = next((p for p in self.programs if p.number == n), None)
        if found is None:
            raise Alarm(line, f"no program O{n}", 78)
        return found

    # ---- the loop ----------------------------------------------------------------------------------------------------

    def play(self) -> None:
        for _ in range(MAX_STEPS):
            frame = self.stack[-1]
            self.variables.local = frame.local
            if frame.at >= len(frame.program.blocks):
                if len(self.stack) == 1:
                    return
                raise Alarm(self.line, f"O{frame.program.number} ends without M99", 0)
            block = frame.program.blocks[frame.at]
            frame.at += 1
            self.line = block.line
            if block.skip and block.skip in self.switches:
                continue
            if self.execute(frame, block):
                return
        raise Alarm(self.line, f"more than {MAX_STEPS} blocks: endless?")

    def read(self, n: int) -> Value:
        return self.variables.read(n, self.line)

    def expression(self, text: str, at: int = 0) -> Expression:
        return Expression(text, at, self.read, self.line)

    def execute(self, frame: Frame, block: Block) -> bool:
        """One block; True at the end of the program."""
        text = block.text
        if not text or text.startswith(_OUTPUT):
            return False
        if text.startswith("#"):
            self.assign(text)
        elif text.startswith("IF"):
            self.conditional(frame, text)
        elif text.startswith("GOTO"):
            self.go_to(frame, text)
        elif text.startswith(("WHILE", "DO")):
            self.loop(frame, text)
        elif text.startswith("END"):
            self.end_of_loop(frame, text)
        elif any(word in text for word in _KEYWORDS) or "=" in text:
            raise Alarm(self.line, f"NC words and a macro statement in {text!r}", 127)
        else:
            return self.nc_block(frame, text)
        return False

    # ---- macro statements --------------------------------------------------------------------------------------------

    def assign(self, text: str) -> None:
        left = self.expression(text)
        target = left.variable()
        if not left.take("="):
            raise Alarm(self.line, f"no '=' in {text!r}", 114)
        right = self.expression(text, left.at)
        value = right.expression()
        if right.at != len(text):
            # A bracket closed too often, or words behind the statement.
            raise Alarm(self.line, f"{text[right.at :]!r} behind the statement", 118 if text[right.at] == "]" else 114)
        self.variables.write(target, value, self.line)

    def conditional(self, frame: Frame, text: str) -> None:
        condition = self.expression(text, 2)
        holds = condition.condition()
        rest = text[condition.at :]
        if rest.startswith("THEN#"):
            if holds:
                self.assign(rest[4:])
        elif rest.startswith("GOTO"):
            if holds:
                self.go_to(frame, rest)
        else:
            raise Alarm(self.line, f"neither THEN nor GOTO in {text!r}", 114)

    def go_to(self, frame: Frame, text: str) -> None:
        target = self.expression(text, len("GOTO"))
        n = int(half_away(number(target.expression())))
        if not 1 <= n <= 99999999:
            raise Alarm(self.line, f"GOTO {n}", 128)
        self.jump(frame, n)

    def jump(self, frame: Frame, n: int) -> None:
        index = frame.program.index_of_n(n, frame.at)
        if index is None:
            raise Alarm(self.line, f"no N{n} in O{frame.program.number}", 128)
        frame.at = index

    def loop_number(self, text: str, pattern: re.Pattern[str]) -> int:
        found = pattern.search(text)
        if found is None:
            raise Alarm(self.line, f"no DO in {text!r}", 114)
        if not 1 <= int(found[1]) <= 3:
            raise Alarm(self.line, f"loop number {found[1]}", 126)
        return int(found[1])

    def loop(self, frame: Frame, text: str) -> None:
        m = self.loop_number(text, _DO)
        blocks = frame.program.blocks
        end = next((k for k in range(frame.at, len(blocks)) if blocks[k].text == f"END{m}"), None)
        if end is None:
            raise Alarm(self.line, f"no END{m}", 124)
        if text.startswith("WHILE") and not self.expression(text, 5).condition():
            frame.at = end + 1

    def end_of_loop(self, frame: Frame, text: str) -> None:
        m = self.loop_number(text, _END)
        blocks = frame.program.blocks
        for k in range(frame.at - 2, -1, -1):
            if blocks[k].text.startswith(("WHILE", "DO")) and blocks[k].text.endswith(f"DO{m}"):
                frame.at = k
                return
        raise Alarm(self.line, f"END{m} without DO{m}", 125)

    # ---- NC blocks and calls -----------------------------------------------------------------------------------------

    def nc_block(self, frame: Frame, text: str) -> bool:
        words = parse_words(text, self.line, self.read)
        g_codes = [round(w.value, 1) for w in words if w.letter == "G"]
        m_codes = [int(half_away(w.value)) for w in words if w.letter == "M"]
        every = self.modal_calls[-1] if self.modal_calls and self.modal_calls[-1].every_block else None
        if 65 in g_codes:
            self.call_macro(words)
            return False
        if 66 in g_codes or 66.1 in g_codes:
            self.open_modal_call(words, every_block=66.1 in g_codes)
            return False
        if 67 in g_codes:
            if self.modal_calls:
                self.modal_calls.pop()
            words = [w for w in words if not (w.letter == "G" and round(w.value, 1) == 67)]
        elif every is not None and len(self.stack) == every.depth:
            every.local = arguments([(w.letter, w.value) for w in words if w.letter not in "GLPNO"], self.line)
            self.call(self.program(every.number, self.line), every.repeats, every.local, "macro")
            return False
        moved = len(self.controller.items)
        if 98 in m_codes or 99 in m_codes:
            plain = [w for w in words if not (w.letter in "PL" or (w.letter == "M" and w.value in (98, 99)))]
            self.controller.run(self.line, plain)
            self.call_subprogram(words) if 98 in m_codes else self.return_from(frame, words)
            return False
        self.controller.run(self.line, words)
        if len(self.controller.items) > moved and self.controller.items[-1].kind != "dwell":
            self.modal_call_after_a_move()
        return bool({2, 30} & set(m_codes))

    def call(self, program: TapeProgram, repeats: int, local: dict[int, float], kind: str) -> None:
        depth = sum(f.kind == kind for f in self.stack)
        if kind == "sub" and depth >= self.nesting:
            raise Alarm(self.line, "subprograms nested too deep", 77)
        if kind == "macro" and depth >= self.macro_nesting:
            raise Alarm(self.line, "macro calls nested too deep", 122)
        if repeats > 0:
            self.stack.append(Frame(program, 0, repeats, local, kind))

    def call_subprogram(self, words: list[Word]) -> None:
        p = next((w for w in words if w.letter == "P"), None)
        if p is None:
            raise Alarm(self.line, "M98 without P", 76)
        target, repeats = int(p.value), 1
        if len(p.literal) > 4:
            repeats, target = divmod(target, 10_000)
            repeats = repeats or 1
        repeats = next((int(w.value) for w in words if w.letter == "L"), repeats)
        self.call(self.program(target, self.line), repeats, self.stack[-1].local, "sub")

    def call_macro(self, words: list[Word]) -> None:
        number_, repeats, local = self.macro_words(words)
        self.call(self.program(number_, self.line), repeats, local, "macro")

    def macro_words(self, words: list[Word]) -> tuple[int, int, dict[int, float]]:
        start = next(k for k, w in enumerate(words) if w.letter == "G" and int(w.value) in (65, 66))
        rest = words[start + 1 :]
        p = next((int(w.value) for w in rest if w.letter == "P"), None)
        if p is None:
            raise Alarm(self.line, "macro call without P", 76)
        repeats = next((int(w.value) for w in rest if w.letter == "L"), 1)
        return p, repeats, arguments([(w.letter, w.value) for w in rest if w.letter not in "PL"], self.line)

    def open_modal_call(self, words: list[Word], *, every_block: bool) -> None:
        number_, repeats, local = self.macro_words(words)
        self.program(number_, self.line)
        self.modal_calls.append(ModalCall(number_, repeats, local, every_block, len(self.stack)))

    def modal_call_after_a_move(self) -> None:
        """The moves of the called macro itself call nothing."""
        if self.modal_calls and not self.modal_calls[-1].every_block:
            call = self.modal_calls[-1]
            if not any(f.kind == "macro" and f.local is call.local for f in self.stack):
                self.call(self.program(call.number, self.line), call.repeats, call.local, "macro")

    def return_from(self, frame: Frame, words: list[Word]) -> None:
        p = next((int(w.value) for w in words if w.letter == "P"), None)
        if len(self.stack) == 1:
            if p is None:
                raise Alarm(self.line, "M99 in the main program: it would start again without end")
            self.jump(frame, p)
            return
        frame.repeats -= 1
        if frame.repeats > 0:
            frame.at = 0
            return
        self.stack.pop()
        if p is not None:
            self.jump(self.stack[-1], p)
