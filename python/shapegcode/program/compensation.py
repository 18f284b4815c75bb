"""Cutter compensation in a conversion: refused, kept, or expanded with a check of the offset."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode._core import ProgramError
from shapegcode.machine import Machine
from shapegcode.program import MM_PER_INCH, Program, located_error
from shapegcode.program.computer import require_memory

RADIUS_NOT_KNOWN = "the radius of offset D"
"""Start of the reader's warning about a G41 or G42 without a given radius."""

_ZERO_RADIUS = re.compile(r"offset D(\d+) has a radius of 0\b")
_KEPT = "cutter compensation is on and not expanded"
_MEMORY_PER_BLOCK = 100  # bytes of memory per emitted block (docs/evidence/benchmarks.md)
_SLACK_MM = 0.0005  # radii that differ by no more count as equal


def read_for_conversion(path: str | Path, machine: Machine, *, program_number: int | str | None = None) -> Program:
    """Read a program file or text for `convert`: compensation is expanded only with `input.compensation = "expand"`."""
    expand = machine.input.compensation == "expand"
    program = Program.read(path, machine, program_number=program_number, expand_compensation=expand)
    require_decision(program, machine)
    period_s = machine.emission.block_period_s or machine.controller.block_time_s
    if period_s > 0.0:
        blocks = round(program.core.least_time_s / period_s)
        sentence = f"about {blocks} blocks are to be written"
        require_memory(program.source, blocks * _MEMORY_PER_BLOCK, sentence)
    return program


def program_for_conversion(program: Program | str | Path, machine: Machine) -> Program:
    """A given program, or one read from its file for `convert`."""
    if not isinstance(program, Program):
        return read_for_conversion(program, machine)
    program.require_machine(machine)
    require_decision(program, machine)
    return program


def require_decision(program: Program, machine: Machine) -> None:
    """Refuse a program with G41 or G42 unless the machine file states how to handle it."""
    core, policy = program.core, machine.input.compensation
    if policy == "expand":
        for line, _, _, message, file in core.warnings:
            if message.startswith(RADIUS_NOT_KNOWN):
                sentence = f"{message.partition(' (')[0]}: its path cannot be shaped"
                raise _undecided(program, line, file, sentence, machine)
        refuse_zero_radius(program)
        if core.kept_compensated_moves:
            raise ProgramError(f"{program.source}:1:1: read the program with expand_compensation=True to expand it")
        return
    if core.compensated_moves:
        raise ProgramError(
            f"{program.source}:1:1: cutter compensation was expanded when the program was read: "
            'read it with expand_compensation=False, or set input.compensation = "expand"'
        )
    if policy == "refuse" and core.kept_compensated_moves:
        line, file = next(((w[0], w[4]) for w in core.warnings if _KEPT in w[3]), (1, ""))
        sentence = "cutter compensation G41/G42: shaped moves do not follow the offset in the control"
        raise _undecided(program, line, file, sentence, machine)


def refuse_zero_radius(program: Program) -> None:
    """Refuse a program whose compensation was expanded with radius 0: the tool centre would be on the contour."""
    for line, _, _, message, file in program.core.warnings:
        if found := _ZERO_RADIUS.match(message):
            number = found[1]
            what = (
                f"give it: --set input.tool_radius_mm.{number}=RADIUS_IN_MM, or G10 L12 P{number} R... in the program"
            )
            what = "write D with the number of the offset after it" if number == "0" else what
            sentence = f"{message.partition(':')[0]} mm: expanded, the tool centre would move on the contour\n{what}"
            raise located_error(file or program.source, line, 1, sentence)


def _undecided(program: Program, line: int, file: str, sentence: str, machine: Machine) -> ProgramError:
    """Error with the fault, and in a second line the command to continue."""
    text = program.text.split(b"\n", line)[line - 1] if not file or file == program.source else b""
    found = re.search(rb"D\s*(\d+)", text)
    number = str(int(found[1])) if found else "1"
    known = number in machine.input.tool_radius_mm
    radius = "" if known else f" --set input.tool_radius_mm.{number}=RADIUS_IN_MM"
    command = f"shapegcode convert {shlex.quote(program.source)} -m MACHINE --compensation"
    go_on = f"{command} expand{radius} shapes the path of that radius; --compensation keep leaves these moves unchanged"
    return located_error(file or program.source, line, 1, f"{sentence}\nnext: {go_on}")


def header_lines(radii_mm: Mapping[int, float]) -> list[str]:
    """Comments on the expanded radii."""
    return [f"D{number} RADIUS {radius:g} MM EXPANDED - OFFSET DOES NOT ACT" for number, radius in radii_mm.items()]


def guard_lines(radii_mm: Mapping[int, float], machine: Machine) -> list[str]:
    """Lines that stop the control if its offset differs from the expanded radius: M00 where IF cannot run."""
    lines = []
    for number, radius in radii_mm.items():
        own = machine.input
        name = str(number)
        known = [table[name] for table in (own.tool_radius_mm, own.tool_radius_wear_mm) if name in table]
        if number == 0 or not known or abs(sum(known) - radius) > 1e-9:
            continue  # set by the program itself (G10)
        stops = machine.emission.compensation_guard == "stop" or machine.emission.dialect != "fanuc"
        if stops or not machine.controller.holds_macros:
            lines.append(f"M00(CHECK D{number} RADIUS {radius:.4g} WITH WEAR)")
            continue
        geometry, wear = {"A": (10000, 0), "B": (11000, 10000), "C": (13000, 12000)}[machine.controller.offset_memory]
        value = f"[#{geometry + number}+#{wear + number}]" if wear else f"#{geometry + number}"
        # The variable is in mm or inch, as the control is set when the check runs: accept either.
        checks = [
            f"[ABS[{value}-{size:.6f}]GT{slack:.6f}]"
            for size, slack in ((radius, _SLACK_MM), (radius / MM_PER_INCH, _SLACK_MM / MM_PER_INCH))
        ]
        lines.append(f"IF[{'AND'.join(checks)}]THEN#3000=1(D{number} CHANGED)")
    return lines


_SAME_PLACE_MM = 0.005


def paired_regions(program: Program, nominal: Program) -> Iterator[tuple[_core.Region, _core.Region]]:
    """Yield pairs of a region of a program and that of the nominal program, matched by start and end."""
    if program is nominal:
        yield from ((region, region) for region in program.regions)
        return
    if nominal.core.kept_compensated_moves > program.core.kept_compensated_moves:
        sentence = (warning for warning in nominal.warnings if RADIUS_NOT_KNOWN in warning)
        why = next(sentence, f"{nominal.source}: cutter compensation is on and not expanded").partition(" (")[0]
        raise _core.ArgumentError(
            f"{why}: the path of the original is unknown, so a shaped program cannot be measured against it: set "
            "input.tool_radius_mm to the radius used for shaping, in the machine file or with --set"
        )
    candidates = iter(program.regions)
    for region in nominal.regions:
        for candidate in candidates:
            ours, theirs = ([path.start_mm, path.end_mm] for path in (candidate.path, region.path))
            if np.allclose(ours, theirs, rtol=0.0, atol=_SAME_PLACE_MM):
                yield candidate, region
                break
        else:
            raise _core.ArgumentError(
                f"{program.source}: no cut from {_place(region.path.start_mm)} to {_place(region.path.end_mm)} as "
                f"{nominal.source} has in {nominal.lines(region)}: it was not made from that program; omit "
                "--against"
            )


def _place(position_mm: npt.ArrayLike) -> str:
    return " ".join(f"{axis}{value:.3f}" for axis, value in zip("XYZ", np.asarray(position_mm), strict=True))
