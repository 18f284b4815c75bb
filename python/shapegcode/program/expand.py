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
        text: the expanded program; the unchanged text if there was nothing to expand.
        expanded: whether there was something to expand.
        lines: number of lines of the expanded program.
        size_bytes: size of the expanded program.
        expanded_radii_mm: radius by D number, "D1", if cutter compensation was expanded.
        origins: for each line of the expanded program its source line, and the file if it is
            not the program's; empty if there was nothing to expand.
        warnings: findings of the reader.
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
    def answer(self) -> str:
        """Name, lines and bytes of the expanded program, and whether there was something to expand."""
        what = "expanded" if self.expanded else "nothing to expand: the program is unchanged"
        return f"{self.program}: {self.lines} lines, {self.size_bytes} bytes, {what}"

    @property
    def next_step(self) -> str:
        """What to do next, in one sentence."""
        return self._next_after("OUT")

    def _next_after(self, file: str) -> str:
        if self.expanded_radii_mm:
            return "use it only with these radii: the offsets in the control have no effect."
        return f"compute its cycle time: shapegcode time {file} -m MACHINE."

    @property
    def notes(self) -> list[str]:
        """Notes on the expanded cutter compensation, one for each radius."""
        return [
            f"{name} = {radius:g} mm was expanded: the offset in the control has no effect"
            for name, radius in self.expanded_radii_mm.items()
        ]


def expand(
    program: Program | str | Path,
    machine: Machine | str | Path,
    *,
    compensation: Literal["expand", "keep"] = "expand",
    program_number: int | str | None = None,
) -> Expansion:
    """Expand subprogram calls, custom macros, coordinate modes, corner words and cutter compensation.

    Args:
        program: the program, or its file; a `Program` keeps its reading settings.
        machine: whose controller reads it.
        compensation: "expand": G41/G42 become plain moves of the tool's centre; "keep": they stay unchanged.
        program_number: program of a multi-program file: its O number, or an address as in
            `shapegcode.program.reading.ProgramPlace`; None: the first.

    Returns:
        The expanded program, and the source of each of its lines.

    Raises:
        ProgramError: the program cannot be read, is a shaped one with macros, or has compensation with a radius of 0;
            the message starts with ``file:line:column``.
        ArgumentError: it was read with other settings than the machine's.
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
        # The control stores the override switch in a variable, which expansion would overwrite.
        raise _core.ProgramError(
            f"{program.source}:1:1: written by shapegcode (see its header); it is already expanded, except for the "
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
