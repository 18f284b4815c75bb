"""The expanded program: calls, macros and coordinate modes resolved."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.program.compensation import refuse_zero_radius
from shapegcode.program.program import Program
from shapegcode.program.result import Expansion


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
            `shapegcode.program.several`; None: the first.

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
            f"{program.source}:1:1: written by shapegcode (its header says so), and plain but for the lines that lock "
            "the feed override: these only the control can work out"
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
