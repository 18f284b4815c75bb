"""Translate a program of any dialect into one for FANUC: choose the dialect and its reader."""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Literal

from shapegcode import _core
from shapegcode.errors import ProgramError, located_error
from shapegcode.io.data_file import read_file
from shapegcode.machine import Machine

_MAX_CALLED_BYTES = 10_000_000


# Line of the source, from 1; a sentence, with both meanings of a word that FANUC reads otherwise.
Note = tuple[int, str]


@dataclass(frozen=True)
class ForeignSettings:
    """Settings to read the expanded program, where the control differs from the machine file."""

    # by H number; the machine file's own values come first
    tool_length_mm: Mapping[int, float] = field(default_factory=dict)
    tool_radius_mm: Mapping[int, float] = field(default_factory=dict)  # by D number, likewise
    peck_clearance_mm: float | None = None  # distance to which a peck of G73 and G83 returns; None: the machine file's
    calculator_decimal_point: bool | None = True  # whether X10 is 10 mm; None: as the machine file says
    # translates a called program of another file (text, name) into FANUC's words; None: none is called
    called_text: Callable[[str, str], str] | None = None
    # LinuxCNC: (P, Q) common to all its G64, mm, None for an absent word; None: they differ, or there is no G64
    path_tolerance_mm: tuple[float | None, float | None] | None = None
    # substituted words, to be restored in a program for that control: {"T901": 'T="MILL"'}
    names: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class ForeignProgram:
    """A program for another control, translated into one for FANUC.

    From LinuxCNC and Siemens it is expanded: numbers have a point where their unit depends on it (`X10.`), I J K are
    distances from the start, dwells are `G04 X` in seconds; it begins and ends with a line `%`. A Haas program keeps
    its calls and lines, except for replaced words.
    """

    dialect: str  # "linuxcnc", "haas", "siemens"
    text: str  # the translated program
    lines: Sequence[int]  # for each line of `text`, from 0, the line of the source, from 1
    reason: str = ""  # why it was read in this dialect
    notes: tuple[Note, ...] = ()  # for the user
    files: tuple[str, ...] = ()  # names of other files whose lines are in it (subprograms)
    # for each line of `text` its file: 0 the source, n the n-th of `files`; empty: all are from the source
    line_files: Sequence[int] = ()
    settings: ForeignSettings = ForeignSettings()  # how to read it


def program_of_core(dialect: str, expanded: _core.ExpandedProgram, settings: ForeignSettings) -> ForeignProgram:
    """Convert the expanded program that a reader in the core returns."""
    return ForeignProgram(
        dialect,
        expanded.text.decode("latin-1"),
        expanded.lines,
        notes=tuple(expanded.notes),
        files=tuple(expanded.files),
        line_files=expanded.line_files,
        settings=settings,
    )


def program_folders(machine: Machine, folder: Path | None) -> list[Path]:
    """Folders to search for called programs: the caller's own first."""
    own = [] if folder is None else [folder]
    return own + [Path(name).expanduser() for name in machine.input.program_folders]


def called_program(path: Path, machine: Machine) -> tuple[str, bytes]:
    """Read a called program, within the size limit: its name and text."""
    most = min(_MAX_CALLED_BYTES, machine.controller.max_program_bytes)
    return str(path), read_file(path, most).removeprefix(BOM_UTF8)


def shown_name(file: str) -> str:
    """Name of a file for the core, in UTF-8: characters that cannot be encoded become escapes."""
    return file.encode("utf-8", "backslashreplace").decode()


@contextmanager
def located_errors(file: str) -> Iterator[None]:
    """Add file, line and column to errors of a reader in the core; the program is named *file*, unescaped."""
    try:
        yield
    except ProgramError as error:
        where = file if error.file == shown_name(file) else error.file
        raise located_error(where, error.line, error.column, str(error)) from None


def refusal(file: str, line: int, message: str) -> ProgramError:
    """Error that refuses a line of the source, from 1, with the fault and the remedy."""
    return located_error(file, line, 1, message)


InputDialect = Literal["fanuc", "linuxcnc", "haas", "siemens"]

CONTROLS: dict[str, str] = {"fanuc": "FANUC", "linuxcnc": "LinuxCNC", "haas": "Haas", "siemens": "a Sinumerik"}
"""Names of the controls in messages."""

LOOKED_AT_BYTES = 65536
_SHORT_DWELL = re.compile(rb"G0*4[ \t]*P[ \t]*0*([1-9])(?![\d.])")
_BEHIND_SEMICOLON = re.compile(rb"\([^)\n]*+\)?+|(;)[; \t\r]*+[^;%( \t\r\n]")
_TURNS = re.compile(
    rb"G0*[23](?![\d.])[ \t]*+(?:[FIJKRXYZ][ \t]*+[-+\d.]++[ \t]*+)++P[ \t]*0*([2-9]|[1-9]\d+)(?![\d.])"
)
_PERCENT = re.compile(rb"(?m)^[ \t]*%[ \t\r]*$")
_WRITTEN_FOR = re.compile(rb"(?m)^[ \t]*[;(] ?DIALECT (KLIPPER|ISG)\b")
COMMENT = re.compile(rb"\([^)\n]*+\)?+")  # an unclosed one ends with its line; linear time

_PATH_TOLERANCE = "tolerance of the path; FANUC's G64 has no P"
_DWELLS = (b"G4F", b"G04F", b"G4 ", b"G04 ")
_SIGNS: tuple[tuple[InputDialect, tuple[bytes, ...], re.Pattern[bytes], str], ...] = (
    (
        "linuxcnc",
        (b"SUB", b"CALL", b"IF", b"WHILE", b"DO", b"REPEAT"),
        re.compile(
            rb"(?m)^[ \t]*O[ \t]*(?:<[^>\n]+>|\d+|\[[^\]\n]+\])[ \t]*"
            rb"(?:SUB|ENDSUB|CALL|RETURN|IF|ELSEIF|ELSE|ENDIF|WHILE|ENDWHILE|DO|REPEAT|ENDREPEAT|BREAK|CONTINUE)\b"
        ),
        "O word of control flow",
    ),
    ("linuxcnc", (b"#<",), re.compile(rb"#<[^>\n]+>"), "named parameter"),
    ("linuxcnc", (b"G90.1", b"G91.1"), re.compile(rb"G9[01]\.1(?!\d)"), "centres of arcs"),
    ("linuxcnc", (b"G64", b"G064"), re.compile(rb"G0*64[ \t]*P[ \t]*[\d.]+"), _PATH_TOLERANCE),
    ("linuxcnc", (b"G59.",), re.compile(rb"G59\.[123](?!\d)"), "work coordinate system 7 to 9"),
    ("linuxcnc", (b"G38.",), re.compile(rb"G38\.[2-5](?!\d)"), "straight probe"),
    ("haas", (b"G154",), re.compile(rb"G154[ \t]*P[ \t]*\d+"), "additional work offset"),
    ("haas", (b"G187",), re.compile(rb"G187(?!\d)[ \t]*(?:[PE][ \t]*[\d.]+)?"), "smoothness"),
    ("haas", (b"G103",), re.compile(rb"G103[ \t]*(?:P[ \t]*\d+)?(?![\d.])"), "limit of the look-ahead"),
    ("haas", (b"M97",), re.compile(rb"M97[ \t]*P[ \t]*\d+"), "call of a subprogram by its N number"),
    ("haas", (b"G150",), re.compile(rb"G150(?!\d)"), "general pocket milling"),
    ("siemens", (b"CR",), re.compile(rb"(?<![A-Z])CR[ \t]*="), "radius of an arc"),
    ("siemens", (b"MSG",), re.compile(rb"(?<![A-Z])MSG(?=\s|\()"), "message"),
    ("siemens", _DWELLS, re.compile(rb"G0*4[ \t]*F[ \t]*[\d.]+"), "dwell in seconds; FANUC's F is a feed"),
    ("siemens", (b"%_N_",), re.compile(rb"%_N_\w+"), "name of a program"),
    ("siemens", (b"=",), re.compile(rb"(?<![A-Z])R\d+[ \t]*="), "R parameter"),
    ("siemens", (b"AC", b"IC"), re.compile(rb"=[ \t]*[AI]C(?![A-Z])"), "absolute or incremental word"),
    ("siemens", (b"GOTOF", b"GOTOB"), re.compile(rb"GOTO[FB](?![A-Z])"), "jump to a label"),
    ("siemens", (b"CYCLE",), re.compile(rb"(?<![A-Z_])CYCLE\d+"), "cycle"),
    ("siemens", (b"TRANS", b"AROT"), re.compile(rb"(?<![A-Z_])(?:A?TRANS|AROT)(?![A-Z_])"), "frame"),
    ("siemens", (b"G700", b"G710"), re.compile(rb"G7[01]0(?![\d.])"), "inch or mm"),
)
"""Words that no FANUC control knows, each with byte strings of which a program with the word contains at least one."""

_Sign = tuple[InputDialect, re.Pattern[bytes], str]
_OF_FANUC: tuple[_Sign, ...] = (
    ("fanuc", re.compile(rb"(?<![A-Z])(?:GOTO(?=[ \t]*[\d#\[])|THEN(?![A-Z]))"), "jump of a macro"),
    ("fanuc", re.compile(rb"(?<![A-Z])WHILE[ \t]*\[[^\n]*\][ \t]*DO[ \t]*\d"), "loop of a macro"),
    ("fanuc", re.compile(rb"G0*5\.1(?![\d])[ \t]*Q[ \t]*\d"), "look-ahead mode"),
    ("fanuc", re.compile(rb"G0*8[ \t]*P[ \t]*[01](?!\d)"), "look-ahead mode"),
    ("fanuc", re.compile(rb"G6[56](?![\d.])[ \t]*P[ \t]*\d+"), "call of a macro"),
    ("fanuc", re.compile(rb"G54\.1[ \t]*P[ \t]*\d+"), "additional work offset"),
    ("fanuc", re.compile(rb",[ \t]*[RC][ \t]*[\d.]+"), "corner word"),
    ("fanuc", re.compile(rb"\A\s*%?\s*[O:]\d{1,8}[ \t]*$", re.MULTILINE), "program number"),
)
"""Words that LinuxCNC and a Sinumerik in DIN mode do not know; a Haas may."""


@dataclass(frozen=True)
class Recognition:
    """Evidence of the control for which a program is written."""

    dialect: InputDialect
    line: int  # of the first sign, from 1
    words: str
    meaning: str  # meaning on that control

    @property
    def reason(self) -> str:
        """As text: "line 12: `O100 WHILE` (O word of control flow): LinuxCNC"."""
        return f"line {self.line}: `{self.words}` ({self.meaning}): {CONTROLS[self.dialect]}"


def recognize(text: bytes, *, of_fanuc: bool = False) -> tuple[Recognition, ...]:
    """First sign of each control a program may be for; FANUC's only beside another's, or with *of_fanuc*."""
    code = re.sub(rb";[^\n]*", b"", COMMENT.sub(b" ", text[:LOOKED_AT_BYTES].upper()))
    ends = [match.end() for match in _PERCENT.finditer(code)] if b"%" in code else []
    code = code[: ends[1]] if len(ends) > 1 else code  # no control reads beyond its second `%` line
    signs = [(each[0], *each[2:]) for each in _SIGNS if any(hint in code for hint in each[1])]
    found = _first_signs(code, signs)
    if found or of_fanuc:
        found = _first_signs(code, [*signs, *_OF_FANUC])
        if "haas" in found:
            found.pop("fanuc", None)  # macros, additional offsets and corner words are Haas' own too
    return tuple(found.values())


def _first_signs(code: bytes, signs: Iterable[_Sign]) -> dict[InputDialect, Recognition]:
    """The first sign of each dialect, in the order of their lines."""
    matches = [(*each, match) for each in signs if (match := each[1].search(code)) is not None]
    found: dict[InputDialect, Recognition] = {}
    for dialect, _, meaning, match in sorted(matches, key=lambda each: each[3].start()):
        words = " ".join(match[0].decode("latin-1").split())
        found.setdefault(dialect, Recognition(dialect, code.count(b"\n", 0, match.start()) + 1, words, meaning))
    return found


def doubtful_word(text: bytes) -> tuple[int, str] | None:
    """Line of the first dwell or arc whose P means something else on LinuxCNC, and a warning; None without one."""
    capitals = text[:LOOKED_AT_BYTES].upper()
    if b"P" not in capitals:
        return None
    code = COMMENT.sub(b" ", capitals)
    found = [match for match in (_SHORT_DWELL.search(code), _TURNS.search(code)) if match is not None]
    if not found:
        return None
    match = min(found, key=lambda each: each.start())
    value = int(match[1])
    sentence = (
        f"G04 P{value} is read as {value} ms (FANUC, Haas); on LinuxCNC it is {value} s"
        if match.re is _SHORT_DWELL
        else f"P{value} of an arc is not read, as FANUC knows none; on LinuxCNC the arc has {value} turns"
    )
    return code.count(b"\n", 0, match.start()) + 1, f"{sentence}: state which with controller.dialect"


def foreign_program(data: bytes, machine: Machine, source: str, folder: Path | None) -> ForeignProgram | None:
    """Translate a program for another control into one for FANUC; None: the program is for FANUC already."""
    dialect, reason = input_dialect(data, machine, source)
    if dialect == "fanuc":
        refuse_words_behind_semicolon(data, source)
        return None
    text = data.removeprefix(BOM_UTF8).decode("latin-1")
    # Imported on demand, since most programs are FANUC's.
    read: Callable[..., ForeignProgram] = getattr(
        import_module(f"shapegcode.program.foreign.{dialect}"), f"read_{dialect}"
    )
    program = read(text, file=source, machine=machine, folder=folder)
    return replace(program, reason=reason)


def refuse_words_behind_semicolon(data: bytes, source: str) -> None:
    """Refuse words after a semicolon: FANUC begins a block there, other controls a comment."""
    found = next((each for each in _BEHIND_SEMICOLON.finditer(data) if each[1]), None) if b";" in data else None
    if found is not None:
        message = (
            "words after `;`: FANUC begins a block there, LinuxCNC, a Haas and a Sinumerik have a comment; write a "
            "line end or ( ), or state the control: --set controller.dialect=linuxcnc, haas or siemens"
        )
        raise refusal(source, data.count(b"\n", 0, found.start()) + 1, message)


def input_dialect(data: bytes, machine: Machine, source: str) -> tuple[str, str]:
    """The dialect of a program, and the reason: `controller.dialect`, else words of one control, else its kind."""
    if written := _WRITTEN_FOR.search(data[:LOOKED_AT_BYTES]):
        control = {b"KLIPPER": "Klipper", b"ISG": "the ISG kernel"}[written[1]]
        message = f"emitted for {control}, whose programs are written and not read: keep the original"
        raise refusal(source, data.count(b"\n", 0, written.start()) + 1, message)
    stated = machine.controller.dialect
    # The usual case, a FANUC control and a program without foreign words, takes one search.
    expected = stated if stated != "auto" else machine.controller.kind
    signs = recognize(data, of_fanuc=expected in {"linuxcnc", "siemens"})
    if stated != "auto":
        for sign in signs:
            if sign.dialect != stated:
                message = (
                    f"this is a program for {CONTROLS[sign.dialect]}: {sign.words} ({sign.meaning}), which "
                    f"{CONTROLS[stated]} does not know; controller.dialect is {stated}: "
                    f"--set controller.dialect={sign.dialect} reads it"
                )
                raise refusal(source, sign.line, message)
        return stated, f"controller.dialect = {stated}"
    if len(signs) > 1:
        first, second = signs[0], signs[1]
        message = (
            f"{second.words} is a word of {CONTROLS[second.dialect]} ({second.meaning}), and {first.words} in line "
            f"{first.line} one of {CONTROLS[first.dialect]} ({first.meaning}): the program mixes them; state the "
            "control with controller.dialect"
        )
        raise refusal(source, second.line, message)
    if signs:
        return signs[0].dialect, signs[0].reason
    if machine.controller.kind == "linuxcnc":
        return "linuxcnc", "controller.kind = linuxcnc"
    return "fanuc", ""
