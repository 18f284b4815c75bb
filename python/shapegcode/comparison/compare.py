"""Compare two programs: the same moves, tools, offsets and functions in the same order?

Both are read as the control executes them. Nothing of a conversion is looked at: the words and canonical moves of
either program are put in order by themselves, and aligned by what they do (Myers 1986).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from shapegcode import _core
from shapegcode._core import ProgramError
from shapegcode.comparison.result import Allowed, Comparison, KindCount, ProgramDifference
from shapegcode.machine import Machine
from shapegcode.program import Program
from shapegcode.program.compensation import guard_lines
from shapegcode.program.reading import is_program_text, program_bytes, reader_options

_COMPENSATED = re.compile(rb"G4[12](?!\d)", re.IGNORECASE)


def compare(
    original: Program | str | Path,
    emitted: Program | str | Path,
    machine: Machine | str | Path | None = None,
    *,
    allow: Allowed | str | Iterable[str] = (),
) -> Comparison:
    """Hold a program against another one: what has one of them that the other has not?

    Calls, macros and coordinate modes are compared as the plain blocks that they come to. The paths of a cut are
    followed along each other, so that it may have other blocks.

    Args:
        original: the one program, or its file; a file that is cut off is read as far as it goes.
        emitted: the other one, for example what `convert` made of it.
        machine: whose controller reads them; None: that which read a `Program` of the two, else the built-in
            ``vx500``.
        allow: differences that are allowed, for example ``"feeds,blocks,path=20um"``.

    Returns:
        Counts, distance of the paths, and every difference with its lines.

    Raises:
        ArgumentError: `allow` has a word that is none; a program was read with other settings than the machine has.
        ProgramError: a file is no program that can be read.
        OSError: a file cannot be read.
    """
    if machine is None:
        machine = next((each.reading.machine for each in (original, emitted) if isinstance(each, Program)), "vx500")
    machine = Machine.of(machine)
    allowed = allow if isinstance(allow, Allowed) else Allowed.of(allow)
    (first, first_is_cut), (second, second_is_cut) = _read(original, machine), _read(emitted, machine)
    core = _core.compare_programs(
        first.core, second.core, reader_options(machine), _emission_lines(machine, first.core.expanded_radii_mm)
    )
    is_shaped = second.stamp is not None
    differences = [
        ProgramDifference(
            kind=_name(kind),
            original_line=line or None,
            emitted_line=other_line or None,
            original=text,
            emitted=other_text,
            allowed=allowed.covers(_name(kind), distance_mm * 1e3)
            or (kind == _core.ComparedKind.emission and is_shaped and line == 0 and allowed.covers("blocks")),
            distance_um=distance_mm * 1e3,
        )
        for kind, line, other_line, text, other_text, distance_mm in core.differences
    ]
    differences += _compensation(first, second, allowed)
    if (first_is_cut or second_is_cut) and not any(each.kind == "end" for each in differences):
        differences.append(_end(first, second, allowed, first_ends=first_is_cut))
    return Comparison(
        original=first.source,
        emitted=second.source,
        machine=machine.name,
        counts=tuple(
            KindCount(_name(kind), ours, theirs, unchanged)
            for kind, ours, theirs, unchanged in core.counts
            if ours + theirs
        ),
        path_um=core.path_mm * 1e3,
        differences=tuple(differences),
        allow=allowed.words,
    )


def _name(kind: _core.ComparedKind) -> str:
    return kind.name.replace("_", "-")


def _read(program: Program | str | Path, machine: Machine) -> tuple[Program, bool]:
    """The program, and whether it is cut off: without its end, or within its last line."""
    if isinstance(program, Program):
        program.require_machine(machine)
        return program, False
    try:
        return Program.read(program, machine), False
    except ProgramError:
        if is_program_text(program):
            raise
        text = program_bytes(program, machine.controller.max_program_bytes)
        whole_lines = text[: text.rfind(b"\n") + 1]
        for kept in (text, whole_lines):
            try:
                return (
                    Program.from_text(kept + b"\n%\n", machine, source=str(program), folder=Path(program).parent),
                    True,
                )
            except ProgramError:
                continue
        raise


def _emission_lines(machine: Machine, radii_mm: dict[int, float]) -> list[str]:
    """The lines that `convert` writes around shaped cuts for this machine, as the core compares them."""
    emission = machine.emission
    locks = (*emission.locking, *emission.unlocking)
    lines = [*emission.prologue, *emission.epilogue, *locks, *emission.prefill_lines, *guard_lines(radii_mm, machine)]
    return ["".join(re.sub(r"\([^)]*\)", "", line).split()) for line in lines]


def _compensation(first: Program, second: Program, allowed: Allowed) -> Iterator[ProgramDifference]:
    """Cutter compensation that only one of the programs still has, by offset number."""
    radii = [program.core.expanded_radii_mm for program in (first, second)]
    for number in sorted(radii[0].keys() | radii[1].keys()):
        if radii[0].get(number) == radii[1].get(number):
            continue
        has = [
            (_line_of(program, _COMPENSATED), f"G41 or G42 with D{number}") if number in known else (None, "worked out")
            for program, known in zip((first, second), radii, strict=True)
        ]
        (line, text), (other_line, other_text) = has
        yield ProgramDifference("compensation", line, other_line, text, other_text, allowed.covers("compensation"))


def _line_of(program: Program, pattern: re.Pattern[bytes]) -> int | None:
    text = program.text
    found = pattern.search(text)
    return None if found is None else 1 + text.count(b"\n", 0, found.start())


def _end(first: Program, second: Program, allowed: Allowed, *, first_ends: bool) -> ProgramDifference:
    """One program has neither an end nor anything less than the other."""
    lines = [max(1, program.text.rstrip().count(b"\n") + 1) for program in (first, second)]
    early = f"ends early at line {lines[0 if first_ends else 1]}"
    ours, theirs = (early, "has an end") if first_ends else ("has an end", early)
    return ProgramDifference("end", lines[0], lines[1], ours, theirs, allowed.covers("end"))
