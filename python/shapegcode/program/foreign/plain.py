"""The expanded program of a program for another control, and what is needed to read it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from shapegcode.errors import ProgramError, located_error
from shapegcode.io.data_file import read_file

if TYPE_CHECKING:
    from shapegcode.machine import Machine

_MAX_CALLED_BYTES = 10_000_000
MAX_DIGITS = 8
"""Digits of a word in FANUC's words (alarm 0003)."""


@dataclass(frozen=True)
class Note:
    """A note about a line of the source."""

    line: int  # of the source, from 1
    text: str  # one sentence, with both meanings where a word means another thing on FANUC


@dataclass(frozen=True)
class ForeignSettings:
    """How the plain program must be read, where the control differs from what the machine file says."""

    # by H number; the machine file's own values come first
    tool_length_mm: Mapping[int, float] = field(default_factory=dict)
    tool_radius_mm: Mapping[int, float] = field(default_factory=dict)  # by D number, likewise
    peck_clearance_mm: float | None = None  # distance to which a peck of G73 and G83 returns; None: the machine file's
    calculator_decimal_point: bool | None = True  # whether X10 is 10 mm; None: as the machine file says
    # writes a program of another file that it calls (text, name) in FANUC's words; None: it calls none
    called_text: Callable[[str, str], str] | None = None
    # words that stand for others of the source, for who writes for that control again: {"T901": 'T="MILL"'}
    names: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class ForeignProgram:
    """A program for another control, translated into an expanded program for FANUC.

    Its numbers have a point where a unit hangs on it (`X10.`), I J K are distances from the start, dwells are
    `G04 X` in seconds; it begins and ends with a line `%`. One that calls programs of its own may keep these calls.
    """

    dialect: str  # "linuxcnc", "haas", "siemens"
    text: str  # the plain program
    lines: Sequence[int]  # for each line of `text`, from 0, the line of the source, from 1
    reason: str = ""  # why it was read so, in words
    notes: tuple[Note, ...] = ()  # what to tell
    files: tuple[str, ...] = ()  # names of other files whose lines are in it (subprograms)
    # for each line of `text` its file: 0 the source, n the n-th of `files`; empty: all of the source
    line_files: Sequence[int] = ()
    settings: ForeignSettings = ForeignSettings()  # how to read it


class PlainProgram:
    """Collects the lines of a plain program, each with the line of the source from which it comes."""

    def __init__(self) -> None:
        """Begin with the line `%`."""
        self._parts: list[str] = ["%\n"]
        self._lines: list[int] = [1]
        self._files: list[int] = [0]
        self.notes: dict[str, Note] = {}
        self.names: list[str] = []
        self.size = 2  # characters

    def put(self, text: str, line: int, file: int = 0) -> None:
        """Add one line; `file`: 0 the source, n the n-th of `names`."""
        self.put_lines(text + "\n", line, file)

    def put_lines(self, text: str, first_line: int, file: int = 0) -> None:
        """Add lines of the source as they are, each with its line end."""
        missing = first_line - 1 - len(self._lines)
        if file == 0 and missing > 0:  # blank ones, so that a line keeps its number as long as that is possible
            self._add("\n" * missing, len(self._lines) + 1, file)
        self._add(text, first_line, file)

    def _add(self, text: str, first_line: int, file: int) -> None:
        count = text.count("\n")
        self._parts.append(text)
        self.size += len(text)
        self._lines.extend(range(first_line, first_line + count))
        self._files.extend([file] * count)

    def note(self, line: int, text: str, key: str = "") -> None:
        """Tell something once: of two notes with one key (empty: the text itself) the first counts."""
        self.notes.setdefault(key or text, Note(line, text))

    def finish(self, dialect: str, last_line: int, settings: ForeignSettings | None = None) -> ForeignProgram:
        """Close it with the line `%`."""
        self.put("%", last_line)
        return ForeignProgram(
            dialect,
            "".join(self._parts),
            self._lines,
            notes=tuple(sorted(self.notes.values(), key=lambda note: note.line)),
            files=tuple(self.names),
            line_files=self._files if self.names else (),
            settings=settings or ForeignSettings(),
        )


def program_folders(machine: Machine, folder: Path | None) -> list[Path]:
    """Where programs that another one calls are looked for: its own folder first."""
    own = [] if folder is None else [folder]
    return own + [Path(name).expanduser() for name in machine.input.program_folders]


def called_source(path: Path, machine: Machine) -> str:
    """The text of a program that another one calls, as long as it may be."""
    most = min(_MAX_CALLED_BYTES, machine.controller.max_program_bytes)
    return read_file(path, most).decode("utf-8-sig", "replace")


def number_text(value: float) -> str:
    """A number as a word of the plain program has it: with a point, and no more digits than FANUC's reader takes."""
    decimals = MAX_DIGITS - len(str(int(abs(value)))) if abs(value) >= 1.0 else MAX_DIGITS
    if decimals < 0:
        raise ValueError(f"{value:g} has more than {MAX_DIGITS} digits before its point")
    text = f"{value:.{decimals}f}".rstrip("0")
    return "0." if text in {"0.", "-0."} else text


def words_of(values: Mapping[str, float], letters: str = "xyz") -> str:
    """Values of these letters as words of the plain program, in the order of the letters."""
    return "".join(f"{letter.upper()}{number_text(values[letter])}" for letter in letters if letter in values)


def refusal(file: str, line: int, message: str) -> ProgramError:
    """The error that refuses a line of the source, from 1; what is wrong there, and what would help."""
    return located_error(file, line, 1, message)
