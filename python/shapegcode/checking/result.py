"""Result of a check: findings, figures, the next step."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from shapegcode.model.programs import SimulatedPrograms
from shapegcode.program.stamp import no_room
from shapegcode.results.json import hidden
from shapegcode.results.page.model import Figure
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table

_SHOWN_ALIKE = 5
_SHOWN_ALARMS = 20  # of one number
_STYLES = {"alarm": "bold red", "warning": "yellow", "note": "dim"}


@dataclass(frozen=True)
class Finding:
    """An alarm, warning or note about a line of a program.

    Attributes:
        severity: "alarm": the control refuses it; "warning": it will not run as programmed; "note": information.
        code: short stable name of the kind of finding.
        alarm: the control's number; 0: none.
        file: file of the position.
        line: from 1; 0: the file as a whole.
        column: from 1; 0: the line as a whole.
        message: the text.
    """

    severity: str
    code: str
    alarm: int
    file: str
    line: int
    column: int
    message: str

    @property
    def place(self) -> str:
        """``file:line:column``, as far as known; the file without its folder."""
        line = f":{self.line}" if self.line > 0 else ""
        return f"{Path(self.file).name}{line}{f':{self.column}' if self.line * self.column else ''}"


@dataclass(frozen=True)
class FindingCounts:
    """Number of findings of each severity, listed or not."""

    alarm: int  # refused by the control
    warning: int  # not run as programmed
    note: int  # information


@dataclass(frozen=True)
class ShortRun:
    """A sequence of cutting blocks, some of which are short."""

    lines: tuple[int, int]  # first and last line of the source, from 1
    count: int  # number of short blocks
    blocks: int  # number of all moving blocks
    shortest_s: float  # the shortest block
    programmed_s: float  # time of all at their feed, without acceleration
    taken_s: float  # the same with at least the block time for each


@dataclass(frozen=True)
class ShortBlocks:
    """Blocks shorter than the block time, and the time lost by them."""

    block_time_s: float  # shortest time of the control per block
    count: int  # number of short blocks
    blocks: int  # number of all moving cutting blocks
    share: float  # ratio of short ones
    shortest_s: float | None  # the shortest block; None: none is short
    programmed_s: float  # time of all at their feed, without acceleration
    taken_s: float  # the same with at least the block time for each
    first_places: tuple[str, ...]  # `file:line` of the first short blocks
    region_count: int  # number of sequences with short blocks, listed or not
    regions: tuple[ShortRun, ...]  # these sequences, at most `MAX_FINDINGS`


@dataclass(frozen=True)
class StarvedRun:
    """A sequence of cutting blocks that needs more than the serial line transmits."""

    lines: tuple[int, int]  # first and last line of the source, from 1
    bytes: int  # bytes of these lines, line ends included
    programmed_s: float  # time of all at their feed, without acceleration
    blocks_per_s: float  # required by the sequence
    needed_characters_per_s: float  # likewise; for shaped blocks in their busiest section
    factor: float  # duration of the sequence, or of that section, relative to the programmed one


@dataclass(frozen=True)
class SerialLine:
    """Characters per second of the serial line, and those required by the program."""

    baud: int  # bits per second
    bits_per_character: int  # start, stop and parity bits included
    characters_per_s: float  # transmitted by the line
    needed_characters_per_s: float  # required by the worst sequence
    factor: float  # their ratio; above 1 that sequence takes longer by this factor
    region_count: int  # number of sequences with underruns, listed or not
    regions: tuple[StarvedRun, ...]  # these sequences, at most `MAX_FINDINGS`


@dataclass(frozen=True, repr=False, eq=False)
class Check(Result):
    """Findings in a program.

    Attributes:
        program: name of the program.
        machine: name of the machine.
        findings: sorted by position, at most `MAX_FINDINGS` of each code.
        counts: number of findings by severity.
        counts_by_code: number of findings by code.
        size_bytes: size of the whole file, or of the requested program of a multi-program file.
        memory_bytes: program memory of the control.
        short_blocks: blocks shorter than the block time; None: the program was not read.
        dnc: the serial line; None: not drip fed, or not read.
        simulated: the program, to simulate it for a page; None: the control refuses it.
    """

    json_extra: ClassVar[dict[str, Any]] = {**Result.json_extra, "refused": bool}

    program: str
    machine: str
    findings: tuple[Finding, ...]
    counts: FindingCounts
    counts_by_code: dict[str, int]
    size_bytes: int
    memory_bytes: int
    short_blocks: ShortBlocks | None
    dnc: SerialLine | None
    simulated: SimulatedPrograms | None = field(default=None, compare=False, repr=False, metadata=hidden())

    @property
    def refused(self) -> bool:
        """True if the control refuses anything."""
        return self.counts.alarm > 0

    @property
    def ok(self) -> bool:
        """True if nothing is refused and everything would run as programmed."""
        return not self.refused and self.counts.warning == 0

    @property
    def exit_code(self) -> int:
        """0: neither alarms nor warnings; 1: warnings; 2: at least one alarm."""
        return 2 if self.refused else super().exit_code

    @property
    def warnings(self) -> tuple[str, ...]:  # type: ignore[override]
        """The listed findings that are warnings, each with its position."""
        return tuple(f"{each.place}: {each.message}" for each in self.findings if each.severity == "warning")

    def key_figures(self) -> tuple[Figure, ...]:
        """Numbers of alarms, warnings and notes."""
        return tuple(
            Figure(f"{name}s", "", None, float(count), 0, key_after=f"counts.{name}")
            for name, count in vars(self.counts).items()
        )

    @property
    def answer(self) -> str:
        """Numbers of findings and size, in one line."""
        counted = ", ".join(f"{count} {name}{'' if count == 1 else 's'}" for name, count in vars(self.counts).items())
        memory = f"{self.size_bytes} of {self.memory_bytes} bytes of program memory"
        return f"{self.program} on {self.machine}: {counted}; {memory}"

    @property
    def next_step(self) -> str:
        """The one thing to do next, in one sentence."""
        if self.refused:
            first = next(finding for finding in self.findings if finding.severity == "alarm")
            if "arc_centre" in self.counts_by_code:
                return "set input.arc_centre as in the note, and check again."
            return f"correct {first.place} first: later alarms may be its consequences."
        worst = {finding.code: finding for finding in reversed(self.findings) if finding.severity == "warning"}
        if "work_limit" in worst:
            place = worst["work_limit"].place
            return f"correct {place} if it is an error; else increase the key in its message with --set."
        if "dnc_rate" in worst:
            return "raise the baud rate or lower the feed where the serial line is too slow (controller.dnc_baud)."
        if "program_memory" in worst:
            if "--max-bytes" in worst["program_memory"].message:
                return f"{no_room(self.memory_bytes)}."
            return "drip feed the program (controller.dnc_baud), or split it."
        if "short_block" in worst:
            count = self.counts_by_code["short_block"]
            stretches = "the sequence" if count == 1 else f"the {count} sequences"
            return f"post longer blocks, or lower the feed, in {stretches} with short blocks (controller.block_time_s)."
        if "axis_feed" in worst:
            return "lower F to the limits of the axes: the control does so anyway."
        if "look_ahead_breaker" in worst:
            return "move the words that stop the control out of the cut."
        if worst:
            return "correct what the warnings name, and check again."
        return "shapegcode time predicts its cycle time, shapegcode simulate its vibration."

    def tables(self) -> list[Table]:
        """Table of findings by position: the first few of each kind; its caption counts the others by code."""
        if not self.findings:
            return []
        columns = (
            Column("place", text=True),
            Column("", value="severity", text=True, style=lambda finding: _STYLES[finding.severity]),
            Column("alarm", value=lambda finding: f"{finding.alarm:04d}" if finding.alarm else ""),
            Column("what", value="message", text=True),
        )
        shown, seen = [], Counter[tuple[str, str, int]]()
        for finding in self.findings:
            kind = (finding.severity, finding.code, finding.alarm)
            seen[kind] += 1
            # Of alarms more are listed.
            if seen[kind] <= (_SHOWN_ALARMS if finding.severity == "alarm" else _SHOWN_ALIKE):
                shown.append(finding)
        listed = Counter(finding.code for finding in shown)
        more = [
            f"... and {count - listed[code]} more of {code}: --json lists them"
            for code, count in self.counts_by_code.items()
            if count > listed[code]
        ]
        return [Table("", columns, shown, caption="\n".join(more))]
