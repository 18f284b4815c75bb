"""The expanded program: calls, macros and coordinate modes resolved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.program.compensation import refuse_zero_radius
from shapegcode.program.program import Program
from shapegcode.results.json import hidden
from shapegcode.results.result import Result


@dataclass(frozen=True, repr=False, eq=False)
class Expansion(Result):
    """The expanded program: calls, macros and coordinate modes resolved.

    Attributes:
        program: name of the program.
        machine: name of the machine whose controller read it.
        text: the plain program; the text to the letter where there was nothing to expand.
        expanded: whether there was something to expand.
        lines: of the plain program.
        size_bytes: of the plain program.
        expanded_radii_mm: radius by D number, "D1", where cutter compensation is in the path now.
        origins: per line of the plain program the line of the source from which it comes, and its file where that is
            not the program's; empty where there was nothing to expand.
        warnings: what the reader noticed.
    """

    program: str
    machine: str
    text: bytes = field(metadata=hidden())
    expanded: bool
    lines: int
    size_bytes: int
    expanded_radii_mm: Mapping[str, float]
    origins: tuple[tuple[int, str], ...]
    warnings: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether it is done: always, as what cannot be read is refused."""
        return True

    @property
    def answer(self) -> str:
        """The expanded program, and whether it differs from the original."""
        what = "expanded" if self.expanded else "nothing to expand: the program is unchanged"
        return f"{self.program}: {self.lines} lines, {self.size_bytes} bytes, {what}"

    @property
    def next_step(self) -> str:
        """The one thing to do next, in one sentence."""
        return self.next_step_after("OUT")

    def next_step_after(self, file: str) -> str:
        """The same with the name of the program that was written.

        Args:
            file: name of it.

        Returns:
            One sentence.
        """
        if self.expanded_radii_mm:
            return "use it with these radii alone: the offsets in the control do not act."
        return f"see how long it takes: shapegcode time {file} -m MACHINE."

    @property
    def notes(self) -> list[str]:
        """The radii that are in the path now, each in a line."""
        return [
            f"{name} = {radius:g} mm is in the path now: the offset in the control does not act"
            for name, radius in self.expanded_radii_mm.items()
        ]


def expand(
    program: Program | str | Path,
    machine: Machine | str | Path,
    *,
    compensation: Literal["expand", "keep"] = "expand",
    program_number: int | str | None = None,
) -> Expansion:
    """Work out subprogram calls, custom macros, coordinate modes, corner words and cutter compensation.

    Args:
        program: what to expand, or its file; of a `Program` counts how it was read.
        machine: whose controller reads it.
        compensation: "expand": G41/G42 become plain moves of the tool's centre; "keep": they stay as they stand.
        program_number: which program of a file that holds several: its O number, or an address as in
            `shapegcode.program.reading`; None: the first.

    Returns:
        The plain program, and where each of its lines comes from.

    Raises:
        ProgramError: the text is no program that can be read, or its compensation has a radius of 0; the message
            starts with ``file:line:column``.
        ArgumentError: it was read with other settings than the machine has.
        OSError: the file cannot be read.
    """
    machine = Machine.of(machine)
    if isinstance(program, Program):
        program.require_machine(machine)
    else:
        whole = compensation == "expand"
        program = Program.read(program, machine, program_number=program_number, expand_compensation=whole)
    if compensation == "expand":
        refuse_zero_radius(program)
    core = program.core
    if program.stamp is not None and core.expanded:
        # The control keeps the switch of the override in a variable: worked out here, it would be overwritten.
        raise _core.ProgramError(
            f"{program.source}:1:1: written by shapegcode (see its header); it is expanded already, except for the "
            "lines that lock the feed override, which only the control can evaluate"
        )
    return Expansion(
        program.source,
        machine.name,
        program.expanded_text,
        core.expanded,
        core.line_count,
        core.size,
        {f"D{number}": radius for number, radius in core.expanded_radii_mm.items()},
        tuple(core.origin(line) for line in range(1, core.line_count + 1)) if core.expanded else (),
        tuple(program.warnings),
    )
