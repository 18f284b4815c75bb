"""``--program all``: run a command for the programs of a file, each as if it were alone.

Not run are programs that another one calls (unless that is true of all), and subprograms whose moves are already in a
shaped program of the file.

The emitted programs replace the originals in a copy of the file. Everything else is unchanged, also subprograms whose
moves the shaped programs now contain.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from shapegcode._core import ArgumentError, ProgramError
from shapegcode.cli.options import load_machine
from shapegcode.cli.runner import check_files, output_console, standard_output, write_results
from shapegcode.machine import Machine
from shapegcode.program import Program
from shapegcode.program.foreign.read import CONTROLS, input_dialect
from shapegcode.program.reading import ProgramPlace, is_subprogram, program_bytes, programs_of
from shapegcode.program.stamp import STAMP_BEGIN

_TABLES = ("csv", "npz", "html")


def run_all(args: argparse.Namespace) -> int:
    """Run a command for each program of a file, except those that others call, and subprograms no longer called."""
    for name in _TABLES:
        if getattr(args, name, None) == "-":
            raise ArgumentError(f"--{name} - with --program all: each program needs a file, give one")
    machine = load_machine(args)
    check_files(args)
    source = args.input if hasattr(args, "input") else args.inputs[0]
    text = program_bytes(source, machine.controller.max_program_bytes)
    if (dialect := input_dialect(text, machine, str(source))[0]) != "fanuc":
        raise ArgumentError(f"--program all: a file for {CONTROLS[dialect]} is one program; omit --program")
    try:
        several = Gathered(str(source), text, programs_of(text))
    except ProgramError as error:
        raise ProgramError(f"{source}:{error.line}:{error.column}: {error}") from None
    called = _called(several, machine)
    left = _left_over(several) - called
    code = 0
    for place in several.places:
        if place.index not in called | left:
            several.at = place.index
            code = max(code, _run_one(args, several))
    _finish(args, several, called, left)
    return code


def _called(several: Gathered, machine: Machine) -> set[int]:
    """Indices of programs that others in the file call (there expanded, or left as calls); none if all are called."""
    called: set[int] = set()
    folder = Path(several.source).parent
    for place in several.places:
        try:
            program = Program.from_text(
                several.text, machine, program_number=f"#{place.index + 1}", collect_alarms=True, folder=folder
            )
        except ProgramError:
            continue  # its own run reports the error
        called |= {*program.core.called, *(each.index for each in program.kept_calls)} - {place.index}
    # If every program is called by another one, as in a cycle, all are run.
    return called if len(called) < len(several.places) else set()


def _left_over(several: Gathered) -> set[int]:
    """Indices of the subprograms that are not shaped, if any program of the file is; else empty."""
    if STAMP_BEGIN not in several.text:
        return set()
    texts = [several.text[place.text_begin : place.text_end] for place in several.places]
    return {index for index, text in enumerate(texts) if STAMP_BEGIN not in text and is_subprogram(text)}


def _run_one(args: argparse.Namespace, several: Gathered) -> int:
    one = argparse.Namespace(**vars(args))
    one.program, one.several = f"#{several.at + 1}", several
    label = several.address.strip("/<>#").replace("/", "-").replace("<", "").replace(">", "")
    if getattr(args, "plots", None) is not None:
        one.plots = str(Path(args.plots) / label)
    for name in _TABLES:
        if (target := getattr(args, name, None)) is not None:
            setattr(one, name, str(Path(target).with_stem(f"{Path(target).stem}-{label}")))
    console = output_console(standard_output(args))
    console.print(f"{several.address}:", style="bold", markup=False)
    try:
        code = int(args.run(one))
    except ProgramError as error:
        console.print(f"not done: {error}", style="bold red", markup=False, soft_wrap=True)
        several.add({"ok": False, "error": str(error)}, None)
        code = 2
    console.print()
    return code


def _finish(args: argparse.Namespace, several: Gathered, called: set[int], left: set[int]) -> None:
    """Write the common JSON and program, and print the outcome."""
    outputs = {str(output) for output, _ in several.written.values()}
    # If one program misses its tolerance, the whole file gets the suffix of failed programs.
    asked = getattr(args, "output", None)
    output = next((name for name in sorted(outputs) if name != str(asked)), str(asked)) if outputs else None
    for report in several.reports:
        if output is not None and "output" in report:
            report["output"] = output
    program = None if output is None else (output, several.joined())
    write_results(several.reports, getattr(args, "json", None), program)
    console = output_console(standard_output(args))
    for reason, indices in (
        ("called by others and expanded there", called),
        ("subprograms no longer called, since the shaped programs contain their moves", left),
    ):
        if indices:
            names = ", ".join(several.places[index].address for index in sorted(indices))
            console.print(f"{reason}: {names}", markup=False, soft_wrap=True)
    if output is not None:
        console.print(f"wrote {output}", markup=False, soft_wrap=True)


@dataclass
class Gathered:
    """Results of the runs of one command over a file."""

    source: str  # the file
    text: bytes
    places: tuple[ProgramPlace, ...]  # its programs
    reports: list[dict[str, Any]] = field(default_factory=list)  # the report of each for --json
    # output file and emitted program, by index of the program
    written: dict[int, tuple[Path | str, bytes]] = field(default_factory=dict)
    at: int = 0  # index of the current program

    @property
    def address(self) -> str:
        """Address of the current program."""
        return self.places[self.at].address

    def add(self, report: dict[str, Any], output: tuple[Path | str, bytes | memoryview] | None) -> None:
        """Collect the report of a run and its emitted program, if any."""
        self.reports.append({**report, "program_address": self.address})
        if output is not None:
            self.written[self.at] = output[0], bytes(output[1])

    def joined(self) -> bytes:
        """The file with every emitted program in its place; everything else unchanged."""
        parts, position = [], 0
        for place in self.places:
            parts.append(self.text[position : place.text_begin])
            written = self.written.get(place.index)
            parts.append(self.text[place.text_begin : place.text_end] if written is None else _unframed(written[1]))
            position = place.text_end
        return b"".join([*parts, self.text[position:]])


def _unframed(text: bytes) -> bytes:
    """Remove the '%' lines of a single program."""
    begin = text.find(b"\n") + 1 if text.startswith(b"%") else 0
    end = text.rfind(b"%")
    # The line end after the first % may be LF CR CR: remove its CR, too.
    while text[begin : begin + 1] == b"\r":
        begin += 1
    return text[begin : end if end > begin else len(text)]
