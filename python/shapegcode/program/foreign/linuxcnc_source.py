"""Files of LinuxCNC programs: their lines, and where the O words of one label stand."""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

KEYWORDS = (
    "sub", "endsub", "call", "return", "if", "elseif", "else", "endif", "while", "endwhile", "do", "repeat",
    "endrepeat", "break", "continue",
)  # fmt: skip

_O_LINE = re.compile(
    r"^[ \t]*(?:N[ \t]*\d+[ \t]*)?O[ \t]*(<[^>\n]*>|\d+|\[[^\n]*?\](?=[ \t]*call))[ \t]*([a-z]*)([^\n]*)",
    re.MULTILINE | re.IGNORECASE,
)


@dataclass(frozen=True)
class OLine:
    """An O word: its label, its keyword ("": the head of a program, as FANUC's), and what follows."""

    label: str
    keyword: str
    rest: str


class SourceFile:
    """One file of a program."""

    def __init__(self, name: str, text: str, index: int) -> None:
        """Find its lines and O words; `index`: 0: the main program, n: the n-th of the files that were read besides."""
        self.name, self.index = name, index
        self.text = text.replace("\r\n", "\n").replace("\r", " ")  # alone it is a blank to LinuxCNC
        if not self.text.endswith("\n"):
            self.text += "\n"
        self.starts = [0, *(match.end() for match in re.finditer("\n", self.text))]  # of each line; the text's end
        self.o_lines: dict[int, OLine] = {}  # by line, from 0
        self._places: dict[str, list[int]] = {}
        for match in _O_LINE.finditer(self.text):
            line = bisect_right(self.starts, match.start(1)) - 1
            label = "".join(match[1].split()).lower()
            label = label if label.startswith(("<", "[")) else str(int(label))
            self.o_lines[line] = OLine(label, match[2].lower(), match[3])
            self._places.setdefault(label, []).append(line)

    @property
    def count(self) -> int:
        """Lines."""
        return len(self.starts) - 1

    def line(self, index: int) -> str:
        """A line without its end."""
        return self.text[self.starts[index] : self.starts[index + 1] - 1]

    def find(self, label: str, keyword: str) -> int | None:
        """The first line with this O word."""
        return next((line for line in self._places.get(label, ()) if self.o_lines[line].keyword == keyword), None)

    def after(self, line: int, label: str, keywords: Sequence[str]) -> int | None:
        """The next line behind `line` with this label and one of these keywords."""
        places = self._places.get(label, [])
        behind = places[bisect_right(places, line) :]
        return next((place for place in behind if self.o_lines[place].keyword in keywords), None)

    def before(self, line: int, label: str, keywords: Sequence[str]) -> int | None:
        """The last line before `line` likewise."""
        places = self._places.get(label, [])
        return next(
            (p for p in reversed(places[: bisect_left(places, line)]) if self.o_lines[p].keyword in keywords), None
        )

    def closes_do(self, line: int, label: str) -> bool:
        """Whether a WHILE is the end of a DO: the last loop word of its label before it is that DO."""
        opening = self.before(line, label, ("do", "while", "endwhile"))
        return opening is not None and self.o_lines[opening].keyword == "do"


def subroutine_file(label: str, folders: Sequence[Path]) -> Path | None:
    """The file that holds a subroutine: `name.ngc` in one of the folders."""
    stem = label.strip("<>")
    if not re.fullmatch(r"[\w.+-]+", stem):
        return None
    for folder in folders:
        for suffix in (".ngc", ".NGC", ".nc"):
            path = folder / (stem + suffix)
            if path.is_file():
                return path
    return None
