"""Reading of programs by the core: its options for a machine, files of called programs, and multi-program files,
such as memory dumps of a control.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import cast

from shapegcode import _core
from shapegcode.io.data_file import named_errors, open_file
from shapegcode.machine import Machine
from shapegcode.machine.programs import Input
from shapegcode.program.computer import require_memory
from shapegcode.program.foreign.read import (
    COMMENT,
    LOOKED_AT_BYTES,
    ForeignSettings,
    program_folders,
    refuse_words_behind_semicolon,
)
from shapegcode.settings.keys import toml

_ADDRESS = re.compile(r"#([1-9][0-9]{0,8})")
_NUMBER = re.compile(r"[Oo:]?0*([1-9][0-9]{0,7})")
_COMMENT = re.compile(rb"\([^()\r\n]*\)")
CALLS = re.compile(rb"(?:M *0*1?98|G *0*6[56](?: *\. *1)?)(?![0-9.])", re.IGNORECASE)  # of another program
_CALLED = re.compile(rb"P *0*([0-9]+)")
_RETURNS, _ENDS = re.compile(rb"M *0*99(?!\d)"), re.compile(rb"M *0*(?:2|30)(?!\d)")


@dataclass(frozen=True)
class ProgramPlace:
    """One program of a file."""

    index: int  # number of programs before it
    # unique address: its number ``O0001`` or its name ``<PART>``; with the folder (``/USER/O0001``) if it is in several
    # folders; ``#3``, the third program of the file, if nothing else is unique
    address: str
    first_line: int  # from 1
    text_begin: int  # offset of its first byte
    text_end: int  # offset after its last byte


def is_subprogram(text: bytes) -> bool:
    """Whether a program only returns to its caller: M99, and neither M02 nor M30."""
    plain = _COMMENT.sub(b"", text).upper()
    return _RETURNS.search(plain) is not None and _ENDS.search(plain) is None


def programs_of(text: bytes) -> tuple[ProgramPlace, ...]:
    """Programs of a file, in order."""
    entries = _core.list_programs(text)
    short = [_own_name(entry) for entry in entries]
    long = [f"{entry.folder.rstrip('/')}/{own}" for entry, own in zip(entries, short, strict=True)]
    plain, full = Counter(short), Counter(long)
    # A line end may be LF CR CR.
    heads = ((entry.text_begin, text[entry.text_begin : entry.text_begin + 2]) for entry in entries)
    begins = [begin + len(head) - len(head.lstrip(b"\r")) for begin, head in heads]
    ends = [*begins[1:], entries[-1].text_end]
    places = []
    for index, (entry, own, whole) in enumerate(zip(entries, short, long, strict=True)):
        address = own if own and plain[own] == 1 else whole if own and full[whole] == 1 else f"#{index + 1}"
        places.append(ProgramPlace(index, address, entry.first_line, begins[index], ends[index]))
    return tuple(places)


def index_of(text: bytes, wanted: int | str, source: str) -> int | None:
    """Index of a program in a multi-program file, to read it alone; None: read the whole file."""
    try:
        entries, places = _core.list_programs(text), programs_of(text)
    except _core.ProgramError:
        if isinstance(wanted, str):
            raise
        return None  # the reader reports it with its location
    if isinstance(wanted, int) and wanted not in [entry.number for entry in entries]:
        return None  # likewise
    wanted = wanted if isinstance(wanted, str) else f"O{wanted}"
    if match := _ADDRESS.fullmatch(wanted):
        found = [index for index in range(len(places)) if index == int(match[1]) - 1]
    else:
        folder, _, name = wanted.rpartition("/")
        own = f"O{int(match[1]):04d}" if (match := _NUMBER.fullmatch(name)) else name
        found = [
            index
            for index, entry in enumerate(entries)
            if _own_name(entry) == own and (not folder or entry.folder.strip("/") == folder.strip("/"))
        ]
    if len(found) == 1:
        return found[0] if len(entries) > 1 else None
    if found:
        known = ", ".join(places[index].address for index in found)
        raise _core.ProgramError(f"{source}:1:1: the file contains several programs {wanted}: specify one, {known}")
    known = ", ".join(place.address for place in places[:_LISTED])
    more = f" and {len(places) - _LISTED} more" if len(places) > _LISTED else ""
    raise _core.ProgramError(f"{source}:1:1: the file contains no program {wanted} (but {known}{more})")


def called_from(text: bytes, index: int, kept: Iterable[int]) -> tuple[ProgramPlace, ...]:
    """Programs of a file that program `index` calls, also indirectly; `kept`: numbers called and not expanded."""
    entries, places = _core.list_programs(text), programs_of(text)
    found: set[int] = set()
    waiting = [(index, number) for number in kept]
    while waiting:
        caller, number = waiting.pop()
        # The reader searches the caller's folder first.
        same = [at for at, entry in enumerate(entries) if entry.number == number]
        same.sort(key=lambda at: entries[at].folder != entries[caller].folder)
        if not same and number > 9999:
            waiting.append((caller, number % 10000))  # P0030100: three times O0100
        elif same and same[0] not in found | {index}:
            found.add(same[0])
            lines = _COMMENT.sub(b"", text[places[same[0]].text_begin : places[same[0]].text_end]).upper().splitlines()
            calls = (_CALLED.search(line) for line in lines if CALLS.search(line))
            waiting += [(same[0], int(call[1])) for call in calls if call]
    return tuple(places[at] for at in sorted(found))


def alone_with(program: bytes | memoryview, text: bytes, needed: Sequence[ProgramPlace]) -> bytes | memoryview:
    """Text of a program, followed by the programs of its file that it needs."""
    if not needed:
        return program
    whole = bytes(program)
    end = whole.rfind(b"%") if whole.rstrip().endswith(b"%") else len(whole)
    return b"".join([whole[:end], *(text[place.text_begin : place.text_end] for place in needed), whole[end:]])


def _own_name(entry: _core.ProgramEntry) -> str:
    return f"O{entry.number:04d}" if entry.number >= 0 else entry.name


_LISTED = 20  # addresses in a message
_NO_LIMIT = 2**63
_ANY_PROGRAM = (0, 99_999_999)
_PLAIN_LINE = 1000  # characters: longest line of an expanded program
_SHOWN_CHARACTERS = 60  # shown characters of a value in a message, such as a tool table

_CONTROLLER_KEYS = (
    "calculator_decimal_point", "least_increment_mm", "least_increment_inch", "arc_radius_tolerance_mm",
    "offset_memory", "nesting_limit_subprogram", "dialect",
)  # fmt: skip
"""Keys of `controller` that affect reading; limits of memory and time do not."""

_NOT_READ = ("compensation", "material_side")  # keys of `input` that do not affect reading


Finder = Callable[[int], tuple[str, bytes] | None]  # name and text of a called program, by O number


@dataclass(frozen=True)
class Reading:
    """Settings with which a program was read."""

    machine: Machine  # whose controller read it
    emitted: bool = False  # text written by shapegcode
    keeps_calls: bool = False  # text just emitted: every call in it was kept
    probe_lines: tuple[int, ...] = ()  # ascending line numbers after which the modal state is stored
    expand_compensation: bool = True  # G41/G42 became plain moves
    # I, J, K are positions; None: as `input.arc_centre` says, and never in emitted text
    absolute_arc_centres: bool | None = None
    collect_alarms: bool = False  # the reader continued after an alarm
    # name and text of called programs in other files, by O number
    called: dict[int, tuple[str, bytes]] = dataclasses.field(default_factory=dict)

    @property
    def has_absolute_arc_centres(self) -> bool:
        """True if I, J, K are positions; does not apply to a translated program, where they are distances."""
        if self.absolute_arc_centres is None:
            return self.machine.input.arc_centre == "absolute" and not self.emitted
        return self.absolute_arc_centres

    def options(self, folder: Path | None, foreign: ForeignSettings | None = None) -> _core.ReaderOptions:
        """Options of the core for this reading; `foreign`: settings of the other control whose program was expanded."""
        options = reader_options(self.machine, emitted=self.emitted)
        options.absolute_arc_centres = self.has_absolute_arc_centres
        options.probe_lines = list(self.probe_lines)
        options.expand_compensation = self.expand_compensation
        options.collect_alarms = self.collect_alarms
        if foreign is not None:
            _apply(foreign, options)
        if self.keeps_calls:
            options.opaque_programs = list(_ANY_PROGRAM)
        if folders := program_folders(self.machine, folder):
            find = program_loader(folders, self.machine.controller.max_program_bytes)
            options.load_program = partial(self._called, find, foreign)
        return options

    def _called(self, find: Finder, foreign: ForeignSettings | None, number: int) -> tuple[str, bytes] | None:
        """Find a program in another file, and store its text, so that the file is not needed when it is read again."""
        if number not in self.called and (found := find(number)) is not None:
            file, text = found
            if foreign is not None and foreign.called_text is not None:
                text = foreign.called_text(text.decode("latin-1"), file).encode("latin-1")
            elif foreign is None and not self.emitted:
                refuse_words_behind_semicolon(text, file)
            self.called[number] = file, text
        return self.called.get(number)

    def differences(self, machine: Machine) -> list[str]:
        """Settings with which another machine would read the text differently."""
        if machine is self.machine:
            return []
        unused = {"input.arc_centre"} if self.emitted or self.absolute_arc_centres is not None else set()
        unused |= {"input.opaque_programs"} if self.keeps_calls else set()
        mine, other = _settings_of_reading(self.machine), _settings_of_reading(machine)
        return [
            f"{key} = {_shown(value)} as read, {_shown(other[key])} there"
            for key, value in mine.items()
            if value != other[key] and key not in unused
        ]


def _settings_of_reading(machine: Machine) -> dict[str, object]:
    tables = (
        ("controller", {name: getattr(machine.controller, name) for name in _CONTROLLER_KEYS}),
        ("power_on", vars(machine.power_on)),
        ("input", {name: value for name, value in vars(machine.input).items() if name not in _NOT_READ}),
    )
    return {f"{table}.{name}": value for table, values in tables for name, value in values.items()}


def _shown(value: object) -> str:
    text = toml(value)
    return text if len(text) <= _SHOWN_CHARACTERS else f"{text[:_SHOWN_CHARACTERS]}..."


def _apply(foreign: ForeignSettings, options: _core.ReaderOptions) -> None:
    """Apply the settings for an expanded program that was translated from one for another control."""
    if foreign.calculator_decimal_point is not None:
        options.calculator_decimal_point = foreign.calculator_decimal_point
    options.absolute_arc_centres = False
    options.max_line_length = max(options.max_line_length, _PLAIN_LINE)
    tools = dict(options.tool_offsets)
    for table, name in ((foreign.tool_length_mm, "length_mm"), (foreign.tool_radius_mm, "radius_mm")):
        for number, value in table.items():
            offset = tools.setdefault(number, _core.ToolOffset())
            if getattr(offset, name) is None:
                setattr(offset, name, value)
    options.tool_offsets = tools  # type: ignore[assignment]
    if foreign.peck_clearance_mm is not None:
        options.peck_clearance_mm = foreign.peck_clearance_mm


def is_program_text(given: object) -> bool:
    """Whether it is the text of a program and not a file name: it contains a line end."""
    text = given.decode("latin-1") if isinstance(given, bytes) else given
    return isinstance(text, str) and ("\n" in text or "\r" in text)


def reader_options(machine: Machine, *, emitted: bool = False) -> _core.ReaderOptions:
    """Options of the core to read a program of this machine."""
    options = _core.ReaderOptions()
    controller, given = machine.controller, machine.input
    options.calculator_decimal_point = controller.calculator_decimal_point
    options.absolute_arc_centres = given.arc_centre == "absolute"
    options.least_increment_mm = controller.least_increment_mm
    options.least_increment_inch = controller.least_increment_inch
    options.arc_without_centre_is_line = given.arc_without_centre == "line"
    options.arc_tolerance_mm = controller.arc_radius_tolerance_mm
    options.max_line_length = given.max_line_length
    options.unknown_after_tool_change = [axis in given.tool_change_unknown_axes for axis in "XYZ"]
    if offsets := given.work_offsets:
        options.work_offsets_mm = [offsets.get(f"G{code}", (0.0, 0.0, 0.0)) for code in range(54, 60)]
        extra = (each for each in offsets.items() if each[0].startswith("G54.1P"))
        options.extra_work_offsets_mm = {int(name[6:]): offset for name, offset in extra}
    options.tool_offsets = _tool_offsets(given)  # type: ignore[assignment]
    options.offset_memory = controller.offset_memory
    options.retained_variables = {int(name): value for name, value in given.variables.items()}
    bindings = _core.CodeBindings()
    bindings.g_macros = {round(float(name) * 10): program for name, program in given.g_macros.items()}
    bindings.m_macros = {int(name): program for name, program in given.m_macros.items()}
    bindings.m_subprograms = {int(name): program for name, program in given.m_subprograms.items()}
    bindings.tool_program = given.tool_program or -1
    options.bindings = bindings
    options.opaque_programs = list(given.opaque_programs)
    options.subprogram_nesting = controller.nesting_limit_subprogram
    options.limits = _limits(machine, emitted=emitted)
    options.block_skip = [{"unknown": None, "on": True, "off": False}[given.block_skip]] * 9
    options.compensation_start_up = given.compensation_start_up
    options.peck_clearance_mm = given.peck_clearance_mm
    options.scale_unit = given.scale_unit
    state = _core.ModalState()
    names = {"path_mode": "exact_stop", "work_offset": "coordinate_system"}
    for name, code in vars(machine.power_on).items():
        setattr(state, names.get(name, name), int(code[1:]))
    options.power_on = state
    return options


def _limits(machine: Machine, *, emitted: bool) -> _core.WorkLimits:
    limits = _core.WorkLimits()
    controller, axes = machine.controller, machine.axes.as_tuple()
    limits.steps = controller.max_program_steps
    limits.bytes = controller.max_program_bytes
    limits.expansion_bytes = controller.max_expansion_bytes
    limits.feed_mm_per_s = [axis.max_feed_mm_per_min / 60.0 for axis in axes]
    limits.rapid_mm_per_s = [axis.rapid_mm_per_min / 60.0 for axis in axes]
    limits.tool_change_s = machine.times.tool_change_s
    limits.m_function_s = machine.times.m_function_s
    # The original was within the limits; the emitted program has more blocks and takes slightly longer.
    limits.moves = _NO_LIMIT if emitted else controller.max_program_moves
    limits.expansion_moves = _NO_LIMIT if emitted else controller.max_expansion_moves
    limits.seconds = math.inf if emitted else controller.max_program_s
    return limits


def _tool_offsets(given: Input) -> dict[int, _core.ToolOffset]:
    offsets: dict[int, _core.ToolOffset] = {}
    for field in ("length_mm", "length_wear_mm", "radius_mm", "radius_wear_mm"):
        for name, value in getattr(given, f"tool_{field}").items():
            setattr(offsets.setdefault(int(name), _core.ToolOffset()), field, value)
    return offsets


PROGRAM_SUFFIXES = ("", ".nc", ".NC", ".cnc", ".CNC", ".txt", ".TXT", ".tap", ".TAP", ".prg", ".PRG", ".ngc")
"""Usual suffixes of program files."""


def program_bytes(path: str | Path, most: int) -> bytes:
    """Read the content of a program file; of a longer one only `most` + 1 bytes."""
    with open_file(path) as file, named_errors(path):
        size = min(os.fstat(file.fileno()).st_size, most + 1)
        require_memory(str(path), 2 * size, f"{size} bytes of program text are to be read")
        return file.read(size)


def given_text(program: str | bytes | Path, machine: Machine) -> tuple[bytes, str, Path | None]:
    """Text of a program (given, or from its file), its name in messages, and its folder."""
    program = getattr(program, "text", program)  # of a conversion
    if is_program_text(program):
        return program if isinstance(program, bytes) else str(program).encode(), "<text>", None
    file = cast("str | Path", program)  # bytes are refused where it is opened
    return program_bytes(file, machine.controller.max_program_bytes), str(file), Path(file).parent


def program_loader(folders: Sequence[Path], most: int) -> Finder:
    """Make a finder of called programs' files: O0123, O123, o0123, 0123, O00000123, with any of `PROGRAM_SUFFIXES`."""

    def load(number: int) -> tuple[str, bytes] | None:
        stems = (f"O{number:04d}", f"O{number}", f"o{number:04d}", f"{number:04d}", f"O{number:08d}")
        for folder, stem, suffix in itertools.product(folders, stems, PROGRAM_SUFFIXES):
            path = folder / (stem + suffix)
            if path.is_file():
                return str(path), program_bytes(path, most)
        return None

    return load


_OF_A_MILL = re.compile(rb"Y\s*[-+.\d#\[]|M0*6(?!\d)")
_SURE = (
    (re.compile(rb"G(?:50|0*92)(?=\s*S\s*\d)\s*S\s*\d+"), "spindle speed limit"),
    (re.compile(rb"G96(?![\d.])(?:\s*S\s*\d+)?"), "constant surface speed"),
    (re.compile(rb"G7[0-3]\s*(?:P\s*\d+\s*Q\s*\d+|U\s*[\d.]+\s*R\s*[\d.]+|W\s*[\d.]+\s*R\s*[\d.]+)"), "turning cycle"),
    (re.compile(rb"T\d{4}(?!\d)"), "tool and offset in one word"),
    (re.compile(rb"(?<![A-Z])[UW]\s*-?\d*\.?\d+"), "incremental diameter or length"),
)
_LIKELY = (
    (re.compile(rb"G97(?![\d.])(?:\s*S\s*\d+)?"), "constant spindle speed"),
    (re.compile(rb"F0?\.\d+"), "feed per revolution"),
)


def signs_of_turning(text: bytes) -> tuple[int, str] | None:
    """Line and words that show a turning program; None: too few such words, or a Y word or M06, which show a mill."""
    code = COMMENT.sub(b"", text[:LOOKED_AT_BYTES].upper())
    sure = [(found, meaning) for sign, meaning in _SURE if (found := sign.search(code))]
    likely = [(found, meaning) for sign, meaning in _LIKELY if (found := sign.search(code))]
    if not sure or len(sure) + len(likely) < 2 or _OF_A_MILL.search(code):
        return None
    signs = sorted((*sure, *likely), key=lambda sign: sign[0].start())
    sentence = ", ".join(f"{' '.join(found[0].decode('latin-1').split())} ({meaning})" for found, meaning in signs)
    return code.count(b"\n", 0, signs[0][0].start()) + 1, sentence
