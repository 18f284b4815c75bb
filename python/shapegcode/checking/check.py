"""Find what a controller would refuse in a program on reading it, and where it would not run it as programmed.

The latter follows mainly from the time that each block takes at its feed.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

from shapegcode._core import ProgramError
from shapegcode.checking.result import Check, Finding, FindingCounts, SerialLine, ShortBlocks, ShortRun, StarvedRun
from shapegcode.checking.runs import BlockTable, CuttingRun, block_table, look_ahead_breakers
from shapegcode.machine import Machine
from shapegcode.model.machine_model import ini_lines
from shapegcode.model.programs import SimulatedPrograms, shaped_warnings
from shapegcode.program import Program
from shapegcode.program.computer import require_memory_for_lines
from shapegcode.program.reading import given_text, index_of, programs_of
from shapegcode.program.stamp import STAMP_BEGIN, no_room

MAX_FINDINGS = 1000  # listed findings of one code; all are counted

_SEVERITIES = ("alarm", "warning", "note")
_MACRO_CONTROL = re.compile(r"(?<![A-Z])(IF|GOTO|WHILE)(?=\s*[\[#\d.])|(?<![A-Z])(DO|END)(?=\s*\d)")
_COMMENT = re.compile(r"\([^()\n]*\)?")
_ALARM_WORDS = re.compile(r" \(alarm \d+\)")
_MACRO_FROM_DNC = 123
_NO_ROOM = 70
_WORK_LIMIT = re.compile(r"controller\.max_(program|expansion)_")  # in the message of every limit of the reader
# Remarks of the reader on text that a control may execute differently than it seems.
_NOT_AS_WRITTEN = re.compile(r"does not end with M30|^text behind the '%'|^G68 R|byte-order mark")
_ROUNDING = 1e-9
_LOST_S = 1e-3  # time lost by short blocks: less is not a reason to change the program
# Largest number of alarms per reading (max_alarms in the core's reader).
_MAX_ALARMS = 200
_MEMORY_PER_LINE = 350  # bytes


def check(
    program: Program | str | Path, machine: Machine | str | Path, *, program_number: int | str | None = None
) -> Check:
    """Check a program: what the control would refuse, and what it would not run as programmed.

    Args:
        program: the file, or a program read from it: a program with alarms can only be checked as a file or a text.
        machine: machine of the controller.
        program_number: program of a multi-program file: its O number, or an address as in
            `shapegcode.program.reading`; None: the first.

    Returns:
        The findings, with the time lost by short blocks and the data rate required of the serial line.

    Raises:
        ProgramError: it is too large, or it cannot be read at all, without a position to report.
        ArgumentError: the program was read with settings that differ from the machine's.
        OSError: the file cannot be read.
    """
    machine = Machine.of(machine)
    if isinstance(program, Program):
        program.require_machine(machine)
        text, source, folder = program.text, program.source, program.folder
        program_number = program.number if program_number is None else program_number
    else:
        text, source, folder = given_text(program, machine)
    return check_text(text, machine, source=source, program_number=program_number, folder=folder)


def check_text(
    text: bytes | str,
    machine: Machine | str | Path,
    *,
    source: str = "<text>",
    program_number: int | str | None = None,
    folder: Path | None = None,
) -> Check:
    """Check a program text, as `check` does a file.

    Args:
        text: text of the program.
        machine: machine of the controller.
        source: its name in findings.
        program_number: program of a multi-program text: its O number, or an address as in
            `shapegcode.program.reading`; None: the first.
        folder: further folder to search for called programs.

    Returns:
        The findings, with the time lost by short blocks and the data rate required of the serial line.

    Raises:
        ProgramError: it is too large, or it cannot be read at all, without a position to report.
    """
    machine = Machine.of(machine)
    data = text.encode() if isinstance(text, str) else text
    require_memory_for_lines(data, source, _MEMORY_PER_LINE)
    own, lines_before = _own_text(data, program_number, source)
    found = list(_size_and_macros(own, lines_before, source, machine))
    too_long = len(data) > machine.controller.max_program_bytes  # it may have been read only partly
    short: ShortBlocks | None = None
    dnc: SerialLine | None = None
    simulated: SimulatedPrograms | None = None
    try:
        program = Program.from_text(
            data, machine, source=source, program_number=program_number, collect_alarms=not too_long, folder=folder
        )
    except ProgramError as error:
        if error.line < 1 or too_long:
            raise
        message = str(error).removeprefix(f"{error.file}:{error.line}:{error.column}: ")
        found.append(_finding("alarm", "alarm", error.alarm, error.file or source, error.line, error.column, message))
    else:
        found += _reader_findings(program)
        if kind := program.other_arc_centre(data):
            remedy = f"with {kind} I J K the whole program reads: --set input.arc_centre={kind}, or in the machine file"
            found.append(Finding("note", "arc_centre", 0, source, 0, 0, remedy))
        found += (_at(program, "warning", code, 1, message) for code, message in shaped_warnings(program, machine))
        table = block_table(program, machine)
        for stop in look_ahead_breakers(program, machine, table):
            severity = "warning" if stop.unasked else "note"
            found.append(_at(program, severity, "look_ahead_breaker", stop.line, stop.message))
        found += _feed_findings(program, machine, table)
        slowed = [region for region in program.regions if region.shaped]
        for code, line, message in ini_lines([region.path for region in slowed], machine):
            found.append(_at(program, "warning", code, line or slowed[0].first_line, message))
        if not program.core.alarms:
            simulated = SimulatedPrograms(program, machine, labels=("program", ""))
        short = _short_blocks(program, machine, table)
        found += _short_findings(program, machine, table.runs)
        if machine.controller.dnc_baud > 0:
            dnc = _serial_line(program, machine, table.runs)
            found += _dnc_findings(program, dnc, table.runs)
    severities = Counter(finding.severity for finding in found)
    return Check(
        source,
        machine.name,
        _listed(found, source),
        FindingCounts(*(severities[name] for name in _SEVERITIES)),
        dict(sorted(Counter(finding.code for finding in found).items())),
        len(own),
        machine.controller.program_memory_bytes,
        short,
        dnc,
        simulated=simulated,
    )


def _finding(severity: str, code: str, alarm: int, file: str, line: int, column: int, message: str) -> Finding:
    # The alarm number has its own field.
    return Finding(severity, code, alarm, file, line, column, _ALARM_WORDS.sub("", message))


def _at(program: Program, severity: str, code: str, line: int, message: str) -> Finding:
    """A finding in the expanded program, reported at the line of the source."""
    number, file = program.core.origin(line)
    return Finding(severity, code, 0, file or program.source, number, 0, message)


def _listed(found: Iterable[Finding], source: str) -> tuple[Finding, ...]:
    def rank(each: Finding) -> tuple[bool, str, int, int, int]:
        return each.file != source, each.file, each.line, each.column, _SEVERITIES.index(each.severity)

    listed, seen = [], Counter[str]()
    for finding in sorted(found, key=rank):
        seen[finding.code] += 1
        if seen[finding.code] <= MAX_FINDINGS:
            listed.append(finding)
    return tuple(listed)


def _own_text(data: bytes, wanted: int | str | None, source: str) -> tuple[bytes, int]:
    """The requested program of a multi-program file, and the number of lines before it; else the whole file."""
    try:
        index = None if wanted is None else index_of(data, wanted, source)
    except ProgramError as error:
        if error.line < 1:
            raise
        return data, 0  # reported by the reader
    if index is None:
        return data, 0
    place = programs_of(data)[index]
    return data[place.text_begin : place.text_end], place.first_line - 1


def _size_and_macros(data: bytes, lines_before: int, source: str, machine: Machine) -> Iterator[Finding]:
    controller = machine.controller
    fed = controller.dnc_baud > 0
    if len(data) > controller.program_memory_bytes:
        over = f"the program has {len(data)} bytes, the memory for programs {controller.program_memory_bytes}"
        if fed:
            yield Finding("note", "program_memory", 0, source, 0, 0, f"{over}: it can only be drip fed")
        else:
            # Only a shaped program can be made smaller.
            remedy = no_room(controller.program_memory_bytes) if STAMP_BEGIN in data else "drip feed it, or split it"
            message = f"{over}: the control cannot store it; {remedy}"
            yield Finding("warning", "program_memory", _NO_ROOM, source, 0, 0, message)
    if not fed:
        return
    for number, raw in enumerate(re.split(rb"\r\n|\n|\r", data), start=lines_before + 1):
        line = raw.decode("latin-1").upper()
        match = _MACRO_CONTROL.search(_COMMENT.sub(lambda comment: " " * len(comment[0]), line))
        if match:
            message = f"{match[0]} cannot run from DNC: a line once read is gone; expand the program first"
            yield Finding("alarm", "macro_in_dnc", _MACRO_FROM_DNC, source, number, match.start() + 1, message)


def _reader_findings(program: Program) -> Iterator[Finding]:
    for line, column, alarm, message, file in program.core.alarms:
        if _WORK_LIMIT.search(message):
            # A control would not refuse it: only the reader of shapegcode has this limit.
            sentence = f"{message}: what follows is not checked"
            yield _finding("warning", "work_limit", 0, file or program.source, line, column, sentence)
        else:
            yield _finding("alarm", "alarm", alarm, file or program.source, line, column, message)
    if len(program.core.alarms) >= _MAX_ALARMS:
        line, _, _, _, file = program.core.alarms[-1]
        message = f"reading stopped here after {_MAX_ALARMS} alarms: what follows is not checked"
        yield Finding("note", "reader", 0, file or program.source, line, 0, message)
    if (doubt := program.doubt) is not None:
        yield _finding("warning", "reader", 0, program.source, doubt[0], 0, doubt[1])
    for line, column, alarm, message, file in program.core.warnings:
        severity = "warning" if _NOT_AS_WRITTEN.search(message) else "note"
        yield _finding(severity, "reader", alarm, file or program.source, line, column, message)


def _feed_findings(program: Program, machine: Machine, table: BlockTable) -> Iterator[Finding]:
    for clamped in table.clamped_feeds:
        message = (
            f"{clamped.feed_mm_per_min:.10g} mm/min exceed the axis limits in {clamped.blocks} "
            f"block{'' if clamped.blocks == 1 else 's'} from here on: the control reduces it to "
            f"{clamped.min_mm_per_min:.0f} mm/min"
        )
        yield _at(program, "warning", "axis_feed", clamped.first_line, message)
    least = machine.controller.minimum_feed_mm_per_min
    for region in program.regions:
        slowest = region.path.slowest_feed_mm_per_s * 60.0
        if region.shaped or not 0.0 < slowest < least * (1.0 - _ROUNDING):
            continue
        message = (
            f"{program.lines(region)}: feed {slowest:g} mm/min is below controller.minimum_feed_mm_per_min = {least:g}"
            ": convert leaves them unchanged"
        )
        yield _at(program, "note", "reader", region.first_line, message)


def _short_findings(program: Program, machine: Machine, runs: Iterable[CuttingRun]) -> Iterator[Finding]:
    block_time_s = machine.controller.block_time_s
    for run in runs:
        if run.short_blocks:
            lost = run.taken_s - run.time_s >= _LOST_S
            price = f"takes {run.taken_s:.3f} s" if lost else f"takes less than {_LOST_S * 1e3:g} ms more"
            message = (
                f"{run.short_blocks} of the {run.blocks} blocks that end with {_end(program, run)}: "
                f"shorter than the block time of {block_time_s * 1e3:g} ms, the shortest {run.shortest_s * 1e3:.3g} "
                "ms; with an empty block buffer the control stops between blocks (buffer underrun), and "
                f"the sequence, {run.time_s:.3f} s at its feeds, {price}"
            )
            yield _at(program, "warning" if lost else "note", "short_block", run.first_short_line, message)


def _short_blocks(program: Program, machine: Machine, table: BlockTable) -> ShortBlocks:
    count, blocks = sum(run.short_blocks for run in table.runs), sum(run.blocks for run in table.runs)
    short = [run for run in table.runs if run.short_blocks]
    return ShortBlocks(
        block_time_s=machine.controller.block_time_s,
        count=count,
        blocks=blocks,
        share=count / blocks if blocks else 0.0,
        shortest_s=min((run.shortest_s for run in short), default=None),
        programmed_s=sum(run.time_s for run in table.runs),
        taken_s=sum(run.taken_s for run in table.runs),
        first_places=tuple(program.place(line) for line in table.first_short_lines),
        region_count=len(short),
        regions=tuple(
            ShortRun(_lines(program, run), run.short_blocks, run.blocks, run.shortest_s, run.time_s, run.taken_s)
            for run in short[:MAX_FINDINGS]
        ),
    )


def _serial_line(program: Program, machine: Machine, runs: Iterable[CuttingRun]) -> SerialLine:
    controller = machine.controller
    carried = controller.dnc_baud / controller.dnc_bits_per_character
    timed = [run for run in runs if run.time_s > 0.0]
    needed = max((run.needed_per_s for run in timed), default=0.0)
    starved = [run for run in timed if run.needed_per_s > carried]
    return SerialLine(
        baud=controller.dnc_baud,
        bits_per_character=controller.dnc_bits_per_character,
        characters_per_s=carried,
        needed_characters_per_s=needed,
        factor=needed / carried,
        region_count=len(starved),
        regions=tuple(
            StarvedRun(
                lines=_lines(program, run),
                bytes=run.bytes,
                programmed_s=run.time_s,
                blocks_per_s=run.blocks / run.time_s,
                needed_characters_per_s=run.needed_per_s,
                factor=run.needed_per_s / carried,
            )
            for run in starved[:MAX_FINDINGS]
        ),
    )


def _dnc_findings(program: Program, line: SerialLine, runs: Iterable[CuttingRun]) -> Iterator[Finding]:
    for run in runs:
        if run.time_s > 0.0 and run.needed_per_s > line.characters_per_s:
            factor = run.needed_per_s / line.characters_per_s
            where = (
                "" if run.bytes > run.time_s * line.characters_per_s else "its section with the most blocks per second "
            )
            message = (
                f"up to {_end(program, run)} the program needs {run.needed_per_s:.0f} characters/s "
                f"({run.blocks / run.time_s:.0f} blocks/s), the serial line transmits {line.characters_per_s:.0f}: "
                f"{where or 'it '}takes {factor:.2f} times as long, with stops; "
                f"{run.needed_per_s * line.bits_per_character:.0f} baud or more are needed"
            )
            yield _at(program, "warning", "dnc_rate", run.first_line, message)


def _end(program: Program, run: CuttingRun) -> str:
    """The last line of a run, with its file if it differs from that of the first line."""
    (number, file), (_, first_file) = program.core.origin(run.last_line), program.core.origin(run.first_line)
    return f"line {number}" if file == first_file else f"line {number} of {file or program.source}"


def _lines(program: Program, run: CuttingRun) -> tuple[int, int]:
    return program.core.origin(run.first_line)[0], program.core.origin(run.last_line)[0]
