"""Find the programs of an earlier run, check that they are unchanged, and read them again."""

from __future__ import annotations

import argparse
import contextlib
import io
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from shapegcode._core import ShapegcodeError
from shapegcode.cli import command_in, parser_of
from shapegcode.cli.convert import MACHINE_KEYS
from shapegcode.cli.options import load_machine, overridden
from shapegcode.cli.runner import MACHINES
from shapegcode.machine import Machine
from shapegcode.model.programs import SimulatedPrograms
from shapegcode.program import Program
from shapegcode.program.compensation import read_for_conversion
from shapegcode.results.json import Provenance, ProvenanceFile, file_hash

_WITH_MOTION = ("Check", "Conversion", "CycleTime", "FeedSchedule", "Measurement", "Simulation")


def changes(provenance: Provenance, folder: Path) -> tuple[dict[tuple[str, str], Path], list[str]]:
    """Search for the input files of a run at their former paths and in a folder; return them and the problems."""
    asked = [file for file in provenance.files if file.role not in ("wrote", "output of all")]
    looked_up = [(file, *_looked_up(file, folder)) for file in asked]
    found = {(file.role, file.name): place for file, place, _ in looked_up if place is not None}
    return found, [problem for *_, problem in looked_up if problem]


def _looked_up(file: ProvenanceFile, folder: Path) -> tuple[Path | None, str]:
    if file.role in MACHINES and file.name in Machine.builtin_names() and not Path(file.name).exists():
        now = ProvenanceFile.of(file.role, file.name, Machine.builtin_text(file.name).encode()).sha256
        changed = f"the built-in machine {file.name} differs in this version: motion is not shown"
        return Path(file.name), "" if now == file.sha256 else changed
    places = [place for place in (Path(file.name), folder / Path(file.name).name) if place.is_file()]
    if not places:
        return None, f"{file.role} {file.name} was not found: motion is not shown"
    hashes = []
    for place in places:
        with contextlib.suppress(OSError):
            hashes.append(file_hash(place)[0])
            if hashes[-1] == file.sha256:
                return place, ""
    now = hashes[0][:12] if hashes else "not readable"
    return None, (
        f"{file.role} {file.name} was changed since: SHA-256 {now}…, it was {file.sha256[:12]}…; the figures are of "
        "the former file, motion is not shown"
    )


def simulated_again(
    provenance: Provenance, found: Mapping[tuple[str, str], Path], report: Mapping[str, Any]
) -> tuple[SimulatedPrograms | None, str]:
    """Read the programs and the machine of a run again, with the options of that run."""
    if provenance.result not in _WITH_MOTION or not provenance.command or "program_address" in report:
        return None, ""
    args = _typed(provenance.command)
    if args is None or not hasattr(args, "machine"):
        return None, f"its command cannot be read by this version: {provenance.command}; motion is not shown"
    try:
        return _read_again(provenance, found, args, str(report.get("plant", "modal"))), ""
    except (ShapegcodeError, OSError) as error:
        return None, f"{error}: motion is not shown"


def _typed(command: str) -> argparse.Namespace | None:
    """Parse a command line; None if it cannot be parsed."""
    try:
        words = shlex.split(command)[1:]
    except ValueError:
        return None
    selected = command_in(words)
    if selected is None:
        return None
    # argparse reports unknown arguments on standard error and exits.
    with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
        try:
            return parser_of(selected).parse_args(words)
        except SystemExit:
            return None


def _read_again(
    provenance: Provenance, found: Mapping[tuple[str, str], Path], args: argparse.Namespace, plant: str
) -> SimulatedPrograms | None:
    inputs = [place for (role, _), place in found.items() if role in ("input", "inputs")]
    if not inputs:
        return None
    args.machine = str(found.get(("machine", str(args.machine)), args.machine))
    machine = load_machine(args)
    conversion = provenance.result == "Conversion"
    if conversion:
        machine = overridden(machine, args, MACHINE_KEYS)
    read = read_for_conversion if conversion else Program.read
    number = None if getattr(args, "program", None) == "all" else getattr(args, "program", None)
    original = read(inputs[0], machine, program_number=number)
    emitted_file = next((place for (role, _), place in found.items() if role == "output"), None)
    labels = ("original", "emitted")
    if provenance.result == "Measurement":
        emitted_file = inputs[1] if len(inputs) > 1 else None
        labels = (inputs[0].name, emitted_file.name if emitted_file is not None else "")
    emitted = None if emitted_file is None else Program.read(emitted_file, machine)
    plant = machine.verdict.plant if conversion else plant
    return SimulatedPrograms(original, machine, emitted, labels=labels, plant=plant)
