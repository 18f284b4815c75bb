"""From the bytes of a program file to programs of blocks: `%`, O numbers, comments, block skip, sequence numbers."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from ..records import JudgeError


class Alarm(JudgeError):
    """A program error with the number under which the control shows it (0: none)."""

    def __init__(self, line: int, message: str, alarm: int = 0) -> None:
        super().__init__(line, f"{message} (alarm {alarm:04d})" if alarm else message)
        self.alarm = alarm


@dataclass(frozen=True)
class Block:
    """One block: text without comments, blanks and N, upper case. `skip` is the number of a `/`, 0 if none."""

    line: int
    text: str
    skip: int = 0
    n: int | None = None


@dataclass
class TapeProgram:
    """The blocks of one O number."""

    number: int
    blocks: list[Block] = field(default_factory=list)

    def index_of_n(self, n: int, start: int) -> int | None:
        """The block with this sequence number, looked for from `start` to the end and then from the beginning."""
        order = [*range(start, len(self.blocks)), *range(start)]
        return next((k for k in order if self.blocks[k].n == n), None)


_COMMENT = re.compile(r"\([^()]*\)")
_O_WORD = re.compile(r"[O:](\d+)")
_N_WORD = re.compile(r"N(\d+)")


def read_tape(text: str) -> list[TapeProgram]:
    """The programs of a file in order. A text without an O number is one program with number 0."""
    programs: list[TapeProgram] = []
    current: TapeProgram | None = None
    opened = False
    for line, raw in enumerate(text.replace("\r", "").split("\n"), start=1):
        if raw.strip().startswith("%"):
            if opened:
                break
            opened = True
            continue
        code = _COMMENT.sub("", raw)
        if "(" in code or ")" in code:
            raise Alarm(line, f"open comment in {raw.strip()!r}")
        code = re.sub(r"\s+", "", code.partition(";")[0]).upper()
        if not code:
            continue
        opened = True
        if found := _O_WORD.match(code):
            number = int(found[1])
            if any(p.number == number for p in programs):
                raise Alarm(line, f"program O{number} stands twice in the file", 73)
            current = TapeProgram(number)
            programs.append(current)
            code = code[found.end() :]
            if not code:
                continue
        if current is None:
            current = TapeProgram(0)
            programs.append(current)
        skip = 0
        if found := re.match(r"/([1-9]?)", code):
            skip = int(found[1] or 1)
            code = code[found.end() :]
        n = None
        if found := _N_WORD.match(code):
            n = int(found[1])
            code = code[found.end() :]
            if found := re.match(r"/([1-9]?)", code):
                skip = int(found[1] or 1)
                code = code[found.end() :]
        current.blocks.append(Block(line, code, skip, n))
    return programs
