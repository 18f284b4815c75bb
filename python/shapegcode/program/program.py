"""A CNC program as read by the controller: exact text, cutting regions, findings."""

from __future__ import annotations

import codecs
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from shapegcode import _core
from shapegcode.errors import ProgramError, located_error
from shapegcode.hints import Hinted
from shapegcode.io.units import MM_PER_INCH
from shapegcode.machine import Machine
from shapegcode.program.computer import require_memory_for_lines
from shapegcode.program.foreign.read import CONTROLS, LOOKED_AT_BYTES, ForeignProgram, doubtful_word, foreign_program
from shapegcode.program.reading import (
    ProgramPlace,
    Reading,
    called_from,
    given_text,
    index_of,
    programs_of,
    signs_of_turning,
)
from shapegcode.program.stamp import STAMP_BEGIN, Stamp, mark_of, stamp_of, text_with_verdict, verdict_changes

_KEPT_CALL = re.compile(r"program O(\d+) .*: the call is kept")
_ARC_OFF_RADIUS = "off its radius"


@dataclass(frozen=True, eq=False)
class Program(Hinted):
    """A CNC program that has been read.

    Attributes:
        core: its parsed form in the core: text, regions (sequences of cutting moves between stops), other moves.
        source: name for messages.
        reading: reading settings, including the machine.
        unexpanded: the text read, if the core's is the expanded program.
        folder: folder in which called programs are looked for.
        number: program of the text, as requested; None: the first.
        foreign: expanded FANUC form, if the text is for another control.
    """

    core: _core.ProgramText
    source: str
    reading: Reading
    unexpanded: bytes | None = None
    folder: Path | None = None
    number: int | str | None = None
    foreign: ForeignProgram | None = None

    def __repr__(self) -> str:
        return f"<Program {self.source}: {len(self.regions)} cuts>"

    @classmethod
    def read(
        cls,
        path: str | bytes | Path,
        machine: Machine | str | Path | None = None,
        *,
        program_number: int | str | None = None,
        expand_compensation: bool = True,
        collect_alarms: bool = False,
    ) -> Program:
        """Read a program file like the controller of `machine` (None: of the built-in ``vx500``).

        Called programs are looked for in the file, in its folder, and in `input.program_folders`.

        Args:
            path: the file; a string or bytes of several lines are the program's text itself.
            machine: machine whose controller reads it, its file or built-in name.
            program_number: program of a multi-program file: its O number, or an address as in
                `shapegcode.program.reading.ProgramPlace`; None: the first.
            expand_compensation: G41/G42 become plain moves; False: they are kept unchanged.
            collect_alarms: continue after an alarm and collect all in `core.alarms`.

        Returns:
            The program: exact text, cutting regions, findings of the reader.

        Raises:
            ProgramError: the program cannot be read; the message starts with ``file:line:column``.
            OSError: the file cannot be read.
        """
        machine = Machine.of(machine or "vx500")
        text, source, folder = given_text(path, machine)
        return cls.from_text(
            text,
            machine,
            source=source,
            program_number=program_number,
            expand_compensation=expand_compensation,
            collect_alarms=collect_alarms,
            folder=folder,
        )

    @classmethod
    def from_text(
        cls,
        text: bytes | str,
        machine: Machine | str | Path | None = None,
        *,
        source: str = "<text>",
        emitted: bool = False,
        probe_lines: Sequence[int] = (),
        program_number: int | str | None = None,
        expand_compensation: bool = True,
        collect_alarms: bool = False,
        folder: Path | None = None,
        absolute_arc_centres: bool | None = None,
    ) -> Program:
        """Read a program text; `source` names it in messages.

        Called programs are looked for in the text, in `folder` and in `input.program_folders`.

        Args:
            text: the program.
            machine: whose controller reads it; None: the built-in ``vx500``.
            source: names the text in messages.
            emitted: the text was written by shapegcode: its number of moves and its time are not limited.
            probe_lines: ascending line numbers after which the modal state is stored.
            program_number: program of a multi-program text: its O number, or an address as in
                `shapegcode.program.reading.ProgramPlace`; None: the first.
            expand_compensation: G41/G42 become plain moves; False: they are kept unchanged.
            collect_alarms: continue after an alarm and collect all in `core.alarms`.
            folder: folder in which called programs are looked for; None: only the text and the machine's folders.
            absolute_arc_centres: I, J, K are positions; None: as `input.arc_centre` says, and never in emitted text.

        Returns:
            The program, as from `read`.

        Raises:
            ProgramError: the program cannot be read; the message starts with ``source:line:column``.
        """
        machine = Machine.of(machine or "vx500")
        data = text.encode() if isinstance(text, str) else text
        require_memory_for_lines(data, source)
        foreign = None if emitted else foreign_program(data, machine, source, folder)
        if not emitted and foreign is None and (turning := signs_of_turning(data)) is not None:
            line, signs = turning
            message = f"this is a turning program: {signs}, and no Y; shapegcode shapes milling programs"
            raise located_error(source, line, 1, message)
        reading = Reading(
            machine,
            emitted=emitted or STAMP_BEGIN in data,
            probe_lines=tuple(probe_lines),
            expand_compensation=expand_compensation,
            collect_alarms=collect_alarms,
            absolute_arc_centres=absolute_arc_centres,
        )
        return _read(data, source, reading, folder, program_number, foreign)

    @classmethod
    def from_parts(
        cls, parts: list[bytes], machine: Machine, *, source: str, probe_lines: Sequence[int] = ()
    ) -> Program:
        """Read an emitted program from the parts of its text.

        Args:
            parts: parts of the text; the list is emptied, so that the text is in memory only once.
            machine: whose controller reads it.
            source: names the text in messages.
            probe_lines: as in `from_text`.

        Returns:
            The program.

        Raises:
            ProgramError: as in `from_text`.
        """
        reading = Reading(machine, emitted=True, keeps_calls=True, probe_lines=tuple(probe_lines))
        try:
            core = _core.read_parts(parts, reading.options(None))
        except ProgramError as error:
            raise located_error(error.file or source, error.line, error.column, str(error), error.alarm) from None
        return cls(core, source, reading, core.unexpanded if core.expanded else None)

    def __reduce__(self) -> tuple[Callable[..., Program], tuple[object, ...]]:
        """Pickle as texts of the program and called programs, which are read again."""
        return _read, (self.text, self.source, self.reading, self.folder, self.number, self.foreign)

    def __eq__(self, other: object) -> bool:
        """Whether text, name, program number and settings of reading are equal."""
        if not isinstance(other, Program):
            return NotImplemented
        mine, others = ((each.source, each.number, each.reading, each.size) for each in (self, other))
        return mine == others and self.view() == other.view()

    def __hash__(self) -> int:
        """Hash of name and size, which are equal for equal programs."""
        return hash((self.source, self.size))

    def require_machine(self, machine: Machine) -> None:
        """Refuse a machine that would read this program differently.

        Args:
            machine: machine for its simulation, conversion, check or timing.

        Raises:
            ArgumentError: the machine differs; the message gives the settings with both values, and the remedy.
        """
        if differences := self.reading.differences(machine):
            raise _core.ArgumentError(
                f"{self.source} was read with other settings than those of the machine {machine.name}: "
                f"{'; '.join(differences)}; read it with that machine: machine= of Program.read or Program.from_text"
            )

    def refuse_shaped(self, remedy: str) -> None:
        """Refuse a program that is already shaped.

        Args:
            remedy: what to do instead.

        Raises:
            ProgramError: its header marks it as shaped.
        """
        if self.stamp is not None:
            raise ProgramError(f"{self.source}:1:1: already shaped by shapegcode (see its header): {remedy}")

    @property
    def text(self) -> bytes:
        """The exact text read."""
        return self.core.text if self.unexpanded is None else self.unexpanded

    @property
    def size(self) -> int:
        """Size of the text read, bytes."""
        return self.core.size if self.unexpanded is None else len(self.unexpanded)

    def view(self) -> memoryview:
        """View of the text read, without a copy."""
        return self.core.view() if self.unexpanded is None else memoryview(self.unexpanded)

    def text_slice(self, begin: int, end: int) -> bytes:
        """Bytes between two offsets of the text that was read.

        Args:
            begin: offset of the first byte.
            end: offset after the last byte.

        Returns:
            The bytes.
        """
        return self.core.slice(begin, end) if self.unexpanded is None else self.unexpanded[begin:end]

    def with_verdict(self, *, good: bool, better: bool = False) -> Program:
        """Write verdict and checksum into the header, in place if the program was not expanded.

        Args:
            good: False: the program should not be run.
            better: it misses a tolerance, like the original, but is better.

        Returns:
            The program.
        """
        if self.unexpanded is not None:
            return replace(self, unexpanded=text_with_verdict(self.unexpanded, good=good, better=better))
        for begin, after in verdict_changes(self.core.find, self.mark, good=good, better=better):
            self.core.overwrite(begin, after)
        return replace(self)  # without cached values of the former text

    @cached_property
    def mark(self) -> str:
        """Checksum of the expanded program, as in the header of an emitted program."""
        return mark_of(self.core)

    @property
    def own_text(self) -> bytes:
        """Lines of this program in a multi-program text; else the whole text."""
        text = self.text
        if self.foreign is not None:
            return text
        try:
            places = programs_of(text)
            index = 0 if self.number is None else index_of(text, self.number, self.source)
        except ProgramError:
            return text
        return text if index is None or len(places) == 1 else text[places[index].text_begin : places[index].text_end]

    @cached_property
    def kept_calls(self) -> tuple[ProgramPlace, ...]:
        """Programs of its file that the expanded program still calls; empty if nothing was expanded."""
        kept = {int(match[1]) for warning in self.core.warnings if (match := _KEPT_CALL.match(warning[3]))}
        if self.unexpanded is None or self.foreign is not None or not kept:
            return ()
        index = 0 if self.number is None else index_of(self.unexpanded, self.number, self.source)
        return called_from(self.unexpanded, index or 0, kept)

    @cached_property
    def regions(self) -> list[_core.Region]:
        """Sequences of cutting moves between two stops, in order."""
        # Cached, as the core builds them at every call and a program may have a hundred thousand.
        return self.core.regions

    @cached_property
    def stamp(self) -> Stamp | None:
        """Data of its header, if it is an emitted program; else None."""
        return stamp_of(self.own_text) if STAMP_BEGIN in self.text else None

    @property
    def shaped_regions(self) -> int:
        """Number of shaped regions, by its header and marks."""
        return sum(region.shaped for region in self.regions)

    @property
    def warnings(self) -> list[str]:
        """Findings of the reader, each ``source:line: text``."""
        own = [f"{file or self.source}:{line}: {message}" for line, _, _, message, file in self.core.warnings]
        return own if self.doubt is None else [f"{self.source}:{self.doubt[0]}: {self.doubt[1]}", *own]

    @cached_property
    def doubt(self) -> tuple[int, str] | None:
        """Line and warning: a word that other controls read differently; None: no such word, or a known control."""
        is_stated = self.reading.machine.controller.dialect != "auto"
        if is_stated or self.reading.emitted or self.foreign is not None:
            return None
        return doubtful_word(self.text_slice(0, LOOKED_AT_BYTES))

    @property
    def expanded_text(self) -> bytes:
        """The expanded program: calls, macros, coordinate modes and (unless kept) cutter compensation resolved.

        The unchanged text if the program has none of them.
        """
        return self.core.text

    def place(self, line: int) -> str:
        """Source of a line of the expanded program as ``file:line``.

        Args:
            line: line of the expanded program, from 1.

        Returns:
            The location as text.
        """
        number, file = self.core.origin(line)
        return f"{file or self.source}:{number}"

    def source_lines(self, first: int, last: int) -> tuple[int, int]:
        """Convert lines of the expanded program to reported ones: for a program of another control those of its source.

        Args:
            first: first line, from 1.
            last: last line.

        Returns:
            First and last reported line.
        """
        if self.foreign is None:
            return first, last
        return int(self.core.origin(first)[0]), int(self.core.origin(last)[0])

    def lines(self, region: _core.Region) -> str:
        """Line numbers of a region as text: of the source, or of the expanded program.

        Args:
            region: region of this program.

        Returns:
            The lines, first to last.
        """
        if self.foreign is not None:
            return "lines {} to {}".format(*self.source_lines(region.first_line, region.last_line))
        return f"lines {region.first_line} to {region.last_line}{' expanded' if self.core.expanded else ''}"

    @property
    def has_absolute_arc_centres(self) -> bool:
        """Whether I, J, K of the core's program are positions."""
        return self.foreign is None and self.reading.has_absolute_arc_centres

    def other_arc_centre(self, data: bytes) -> str:
        """The other meaning of I, J, K ("absolute" or "incremental"), if it removes the alarms of arcs.

        Args:
            data: bytes from which it was read.

        Returns:
            The other value of `input.arc_centre`, if an alarm is of an arc and the whole program is readable with that
            value; empty if not, and for a program of another control.
        """
        if self.foreign is not None:
            return ""
        options = _options(data, self.source, self.reading, self.folder, self.number)
        return _other_arc_centre(data, options, " ".join(message for _, _, _, message, _ in self.core.alarms))

    def region_error(self, region: _core.Region, message: str) -> ProgramError:
        """Error with the file and lines of a region.

        Args:
            region: region of this program.
            message: the fault.

        Returns:
            The error, to be raised.
        """
        first, file = self.core.origin(region.first_line)
        return located_error(file or self.source, first, 1, f"{self.lines(region)}: {message}")


def _options(
    data: bytes, source: str, reading: Reading, folder: Path | None, number: int | str | None
) -> _core.ReaderOptions:
    options = reading.options(folder)
    if number is not None:
        index = index_of(data, number, source)
        options.program_index = -1 if index is None else index
        options.program = number if isinstance(number, int) and index is None else -1
    return options


def _read(
    data: bytes,
    source: str,
    reading: Reading,
    folder: Path | None,
    number: int | str | None,
    foreign: ForeignProgram | None = None,
) -> Program:
    if foreign is not None:
        if number is not None:
            message = f"--program {number}: a file for {CONTROLS[foreign.dialect]} is one program"
            raise located_error(source, 1, 1, message)
        return _read_foreign(data, source, reading, folder, foreign)
    options = _options(data, source, reading, folder, number)
    try:
        core = _core.read_program(data, options)
    except ProgramError as error:
        kind = _other_arc_centre(data, options, str(error))
        hint = f'; with {kind} I J K the whole program is readable: set input.arc_centre = "{kind}"' if kind else ""
        raise located_error(error.file or source, error.line, error.column, f"{error}{hint}", error.alarm) from None
    # The core skips the byte-order mark too.
    whole = data.removeprefix(codecs.BOM_UTF8) if core.expanded else None
    return Program(core, source, reading, whole, folder, number)


def _read_foreign(data: bytes, source: str, reading: Reading, folder: Path | None, foreign: ForeignProgram) -> Program:
    """Read the expanded form of a program for another control; messages give the lines of the source."""
    beside = folder if foreign.settings.called_text is not None else None
    try:
        core = _core.read_program(foreign.text.encode("latin-1", "replace"), reading.options(beside, foreign.settings))
    except ProgramError as error:
        if error.file:
            raise located_error(error.file, error.line, error.column, str(error), error.alarm) from None
        line = min(max(error.line, 1), len(foreign.lines)) - 1
        index = foreign.line_files[line] if foreign.line_files else 0
        file = foreign.files[index - 1] if index else source
        raise located_error(file, foreign.lines[line], 1, str(error), error.alarm) from None
    notes = list(foreign.notes)
    if foreign.reason:
        notes.insert(0, (1, f"read as a program for {CONTROLS[foreign.dialect]}: {foreign.reason}"))
    core.lead_back(data, list(foreign.lines), list(foreign.line_files), list(foreign.files), notes)
    return Program(core, source, reading, data, folder, None, foreign)


def least_increment_mm(machine: Machine, units: int) -> float:
    """Least increment of words in G20 or G21, mm."""
    controller = machine.controller
    return controller.least_increment_inch * MM_PER_INCH if units == 20 else controller.least_increment_mm


def written_increment_mm(machine: Machine, units: int) -> float:
    """Least increment of emitted positions, mm; in some dialects finer than the control's."""
    decimals = machine.emission.position_decimals
    if decimals is None:
        return least_increment_mm(machine, units)
    return 10.0 ** -(decimals + 1) * MM_PER_INCH if units == 20 else 10.0**-decimals


def decimal(value: float, decimals: int) -> str:
    """A number in FANUC's decimal notation: always with a point, no trailing zeros."""
    text = f"{value:.{decimals}f}".rstrip("0") if decimals else f"{value:.0f}."
    return "0." if text in {"-0.", "0."} else text


_ON_INCREMENT = 1e-6  # in increments: tolerance of a position on the grid


def end_off_grid_mm(region: _core.Region, increment_mm: float) -> list[float]:
    """Distance of a region's end from the nearest multiple of the increment, mm, per axis.

    It may be above 0 if the program changes between G20 and G21, or has more digits than the control resolves.
    """
    off = [abs(each / increment_mm - round(each / increment_mm)) for each in map(float, region.path.end_mm)]
    return [each * increment_mm if each > _ON_INCREMENT else 0.0 for each in off]


def between_increments(region: _core.Region, increment_mm: float) -> list[bool]:
    """Mask of axes that stand still in a region, between two increments: no word may command such a position."""
    off_mm = end_off_grid_mm(region, increment_mm)
    return [extent <= 0.0 < off for extent, off in zip(map(float, region.path.extent_mm), off_mm, strict=True)]


def _other_arc_centre(data: bytes, options: _core.ReaderOptions, message: str) -> str:
    """The other meaning of I, J, K, if *message* is of an arc and the program is readable with it; else empty."""
    if _ARC_OFF_RADIUS not in message:
        return ""
    options.absolute_arc_centres = not options.absolute_arc_centres
    options.collect_alarms = False
    try:
        _core.read_program(data, options)
    except ProgramError:
        return ""
    return "absolute" if options.absolute_arc_centres else "incremental"


def given_program(program: Program | str | Path, machine: Machine) -> Program:
    """Return a `Program` unchanged, after a check of its settings, or read it from its file for `machine`."""
    if not isinstance(program, Program):
        return Program.read(program, machine)
    program.require_machine(machine)
    return program
